# SPDX-License-Identifier: Apache-2.0
"""The runs of one ship at one speed: added resistance over the clean hull's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shipdrag_ros.display import day
from shipdrag_ros.estimation.force import USUAL_SHARE
from shipdrag_ros.fleet.store import same_time
from shipdrag_ros.samples import Float64

FIRST_MONTHS_NS = 90 * 86_400_000_000_000
YEAR_NS = 365.25 * 86_400e9
_LENGTH_TOLERANCE = 0.02  # between ship files of one ship
_MANY_RUNS = 5  # of fewer each may stand alone
_FEW_SHARE = 0.1  # of all runs: so many may one wrong clock have dated, if ...
_FAR_NS = 3.0 * YEAR_NS  # ... they are so far off; a second season is nearer
_EARLIEST_NS = 631_152_000_000_000_000  # 1990: before it a clock was not set
_MOST_SHARED = 0.5  # a reference speed must lie inside the range of at least this many runs
CoastdownRow = Mapping[str, Any]


@dataclass(frozen=True)
class Point:
    """
    One run: its added resistance, or why it is not used.

    Attributes
    ----------
    value, sd
        Over the clean hull's, and its standard deviation as a whole; NaN where not known.
    sd_repeatable
        Without the errors that all runs share.
    covariates
        Of displacement and of water temperature; 0 where not known.
    """

    time_ns: int
    bag: str
    value: float = np.nan
    sd: float = np.nan
    sd_repeatable: float = np.nan
    covariates: tuple[float, float] = (0.0, 0.0)
    reason: str | None = None

    @property
    def used(self) -> bool:
        """Whether the trend is fitted to it."""
        return self.reason is None


@dataclass(frozen=True)
class ShipSeries:
    """
    What is known of one ship's added resistance.

    Attributes
    ----------
    name
        Of the ship.
    reference_speed_m_s
        Where the resistance is compared; NaN where no run has any.
    points
        One a coastdown, in the order of time.
    clean
        What the clean hull is: 'ship file' or 'first months'.
    clean_force_n
        Its resistance at the reference speed [N].
    sister
        Ships with equal ones are sisters: length [m] and displaced volume [m^3].
    notes
        What a reader must know, a sentence each.
    """

    name: str
    reference_speed_m_s: float
    points: tuple[Point, ...]
    clean: str
    clean_force_n: float
    sister: tuple[float, float]
    notes: tuple[str, ...] = ()

    @property
    def used(self) -> tuple[Point, ...]:
        """The points that the trend is fitted to."""
        return tuple(point for point in self.points if point.used)


def series_of(
    name: str, rows: Sequence[CoastdownRow], *, service_speed_m_s: float | None = None
) -> ShipSeries:
    """
    Return the runs of one ship at its reference speed.

    Parameters
    ----------
    name
        Of the ship.
    rows
        Rows of the store's `coastdowns`, of this ship.
    service_speed_m_s
        Of its `economics`; without it 0.75 of the speed at the stop, the median over runs.
    """
    rows = sorted(rows, key=lambda row: (row['time_ns'], row['bag']))
    speed, notes = _reference_speed(rows, service_speed_m_s)
    with_baseline = [_at('clean_m_s2', row, speed) for row in rows]
    baseline = any(np.isfinite(value) for value in with_baseline)
    points = [_point(row, speed, clean, baseline) for row, clean in zip(rows, with_baseline)]
    for left_out in (_of_other_hulls, _copies, _of_wrong_clocks):
        why = left_out(points, rows)
        points = [
            replace(point, reason=point.reason or why.get(number))
            for number, point in enumerate(points)
        ]
    masses = [row['displaced_volume_m3'] * row['water_density_kg_m3'] for row in rows]
    mass = float(np.median(masses)) if masses else np.nan
    if baseline:
        clean = float(np.nanmedian(with_baseline))
    else:
        points, clean, note = _over_first_months(points)
        notes += (note,)
    return ShipSeries(
        name,
        speed,
        tuple(_with_covariates(points, rows)),
        'ship file' if baseline else 'first months',
        clean * mass,
        (rows[0]['length_m'], rows[0]['displaced_volume_m3']) if rows else (np.nan, np.nan),
        notes,
    )


def _reference_speed(
    rows: Sequence[CoastdownRow], service: float | None
) -> tuple[float, tuple[str, ...]]:
    """Return the speed at which runs are compared, and what is to be said of it."""
    ranges = [found for row in rows if (found := _range(row))]
    if not ranges:
        return np.nan, ('no run has an estimate',)
    low, high = np.array(ranges).T
    if service is not None and np.mean((low <= service) & (service <= high)) >= _MOST_SHARED:
        return service, ()
    stops = [row['speed_at_stop_m_s'] for row in rows if row['speed_at_stop_m_s']]
    wished = USUAL_SHARE * float(np.median(stops)) if stops else float(np.median(high))
    places = np.unique(np.concatenate([low, high, [wished]]))
    covered = np.array([np.sum((low <= place) & (place <= high)) for place in places])
    best = places[covered == covered.max()]
    if covered[places == wished][0] >= 0.9 * covered.max():
        best = np.array([wished])
    chosen = float(best[np.abs(best - wished).argmin()])
    if service is None:
        return chosen, ()
    return chosen, (
        f'the service speed of {service:.2f} m/s lies outside the valid range of most runs; '
        f'they are compared at {chosen:.2f} m/s',
    )


def known(row: CoastdownRow, *names: str) -> tuple[Float64, ...]:
    """
    Return the speeds of a row at which curves of it are known, and the curves there.
    """
    curves = [np.array(row[name], float) for name in ('speed_m_s', *names)]
    if any(not curve.ndim for curve in curves):  # a curve that is not there
        return (np.zeros(0),) * len(curves)
    inside = np.isfinite(curves).all(axis=0)
    return tuple(curve[inside] for curve in curves)


def _range(row: CoastdownRow) -> tuple[float, float] | None:
    """Return the lowest and highest speed at which a row has r."""
    speed, _ = known(row, 'resistance_m_s2')
    return (float(speed.min()), float(speed.max())) if len(speed) else None


def _point(row: CoastdownRow, speed: float, clean: float, baseline: bool) -> Point:
    """Return the point of a row; without a baseline its value is r itself."""
    plain = Point(int(row['time_ns']), row['bag'])
    if row['error']:
        return replace(plain, reason=str(row['error']))
    if plain.time_ns < _EARLIEST_NS:
        return replace(plain, reason='its clock was not set: the date is before 1990')
    found = _range(row)
    r = _at('resistance_m_s2', row, speed)
    if found is None:
        return replace(plain, reason='no estimate of r(v)')
    if not np.isfinite(r):
        ends = f'{found[0]:.2f} to {found[1]:.2f} m/s'
        why = f'r is known from {ends}, the reference speed is {speed:.2f} m/s'
        return replace(plain, reason=why)
    if baseline and not np.isfinite(clean):
        return replace(plain, reason='its ship file has no baseline at the reference speed')
    sd, repeatable = (_at(name, row, speed) for name in ('sigma_m_s2', 'sigma_repeatable_m_s2'))
    point = replace(plain, value=r, sd=sd, sd_repeatable=repeatable)
    return _over(point, clean) if baseline else point


def _over(point: Point, clean: float) -> Point:
    """Put a value over that of the clean hull."""
    return replace(
        point,
        value=point.value / clean - 1.0,
        sd=point.sd / clean,
        sd_repeatable=point.sd_repeatable / clean,
    )


def _of_other_hulls(points: list[Point], rows: Sequence[CoastdownRow]) -> dict[int, str]:
    """Return the runs of a ship of another length: two ships have one name."""
    lengths = [float(row['length_m']) for row in rows]
    median = float(np.median(lengths)) if lengths else np.nan
    usual = min(lengths, key=lambda length: abs(length - median), default=np.nan)
    return {
        number: f'its ship file has a length of {length:g} m, most runs of this name have '
        f'{usual:g} m: another ship; give each a name of her own'
        for number, length in enumerate(lengths)
        if abs(length - usual) > _LENGTH_TOLERANCE * usual
    }


def _copies(points: list[Point], rows: Sequence[CoastdownRow]) -> dict[int, str]:
    """Return what was recorded at the same time as another run: it is the same run."""
    used = [number for number, point in enumerate(points) if point.used]
    return {
        used[number]: f'recorded at the same time as {points[used[other]].bag}: one run, counted '
        'once'
        for number, other in same_time([rows[each] for each in used]).items()
    }


def _of_wrong_clocks(points: list[Point], rows: Sequence[CoastdownRow]) -> dict[int, str]:
    """Return the few runs that are years from most of the others: their clock was wrong."""
    used = [number for number, point in enumerate(points) if point.used]
    times = np.array([points[number].time_ns for number in used])
    groups = np.split(np.arange(len(times)), np.flatnonzero(np.diff(times) > YEAR_NS) + 1)
    most = max(groups, key=len)
    # a ship that coasts once in a year or two has no season that most runs are in
    if len(times) < _MANY_RUNS or len(most) < _MOST_SHARED * len(times):
        return {}
    found = {}
    for group in groups:
        apart = np.abs(times[group][:, None] - times[most[[0, -1]]]).min(axis=1)
        is_small = len(group) <= max(_FEW_SHARE * len(times), 1.0)
        if group is most or not is_small or (len(group) > 1 and apart.min() < _FAR_NS):
            continue
        others = 'every other run' if len(group) == 1 else f'all but {len(group)} runs'
        for number, apart_ns in zip(group, apart):
            found[used[number]] = (
                f'its date, {day(int(times[number]))}, is {apart_ns / YEAR_NS:.1f} years from '
                f'{others}: a wrong clock'
            )
    return found


def _over_first_months(points: list[Point]) -> tuple[list[Point], float, str]:
    """Put values over the mean of the first months, which stand for the clean hull."""
    used = [point for point in points if point.used]
    first = [point for point in used if point.time_ns <= used[0].time_ns + FIRST_MONTHS_NS]
    values = np.array([point.value for point in first])
    weight = 1.0 / np.array([point.sd_repeatable for point in first]) ** 2
    clean = float(weight @ values / weight.sum()) if first else np.nan
    note = (
        f'the ship file has no baseline: the clean hull is the mean of the first {len(first)} '
        'run(s), in 90 days; give a baseline, or one from clean runs (shipdrag baseline)'
    )
    over = [_over(point, clean) for point in points]
    return over, clean, note if first else 'no run can be used'


def _with_covariates(points: Sequence[Point], rows: Sequence[CoastdownRow]) -> list[Point]:
    """Set displacement and water temperature, each against its mean over the used runs."""
    volume = np.array([np.log(row['displaced_volume_m3']) for row in rows])
    temperature = np.array([row['water_temperature_c'] for row in rows], float)
    warmth = (temperature - 15.0) / 10.0 * 0.02  # about what friction changes by
    return [
        replace(point, covariates=(each, other))
        for point, each, other in zip(points, _centred(volume), _centred(warmth))
    ]


def _centred(values: Float64) -> Float64:
    """Return values less their mean; 0 where not known."""
    known = np.isfinite(values)
    if not known.any():
        return np.zeros(len(values))
    return np.where(known, values - values[known].mean(), 0.0)


def _at(name: str, row: CoastdownRow, speed: float) -> float:
    """Return what a curve of a row is at a speed; NaN outside of what is known."""
    speeds, curve = known(row, name)
    if not len(speeds) or not speeds.min() <= speed <= speeds.max():
        return np.nan
    return float(np.interp(speed, speeds, curve))
