# SPDX-License-Identifier: Apache-2.0
"""Forecasts of the rest of each glide of a record, beside what followed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from shipdrag_ros.coastdown.events import EndedBy, EndedCoastdown
from shipdrag_ros.coastdown.running import speed_at_rest, too_vague
from shipdrag_ros.display import Table, clock, ship_speed, speed_unit, utc, way
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate
from shipdrag_ros.estimation.window import Series
from shipdrag_ros.forecast.followed import Checked, Followed, Passed
from shipdrag_ros.forecast.foretell import HullNow, foretell, if_stopped
from shipdrag_ros.forecast.result import NO_WAY, Band, Forecast, Milestone
from shipdrag_ros.library.shown import Shown, drawing
from shipdrag_ros.replay import accepted_samples
from shipdrag_ros.replay.coasts import coast_windows
from shipdrag_ros.replay.playback import ReplayResult
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.ship import Ship

if TYPE_CHECKING:
    from matplotlib.axes import Axes


AFTER_S = (60.0, 120.0, 300.0)
"""Times after the stop at which forecasts are made by default [s]."""


@dataclass(frozen=True)
class GlideForecast:
    """
    A forecast made so long after a stop.

    Attributes
    ----------
    bag
        Name of the run.
    ship
    stop_ns
        The stop [ns].
    after_s
        When it was to be made, after the stop [s].
    checked
        The forecast and what followed; None where none could be made: `why` says so.
    why
        What could not be said; '' for nothing.
    followed
        The readings of the glide; None where they do not show it.
    """

    bag: str
    ship: Ship
    stop_ns: int
    after_s: float
    checked: Checked | None
    why: str = ''
    followed: Followed | None = None

    def table(self) -> Table:
        """
        Show it beside what followed, in even steps of the speed.
        """
        assert self.checked is not None
        even = _evenly(self.checked.forecast, self.ship.mass_kg)
        rows = tuple(map(Passed, even.milestones))
        if self.followed is not None:
            rows = self.followed.beside(even, self.stop_ns).milestones
        return milestone_table(rows, self.ship.mass_kg)


@dataclass(frozen=True, repr=False)
class Forecasts(Shown):
    """
    Forecasts of the rest of each glide, made from what was known until then.

    Attributes
    ----------
    made
        In the order of the glides and of time.
    without
        Of each run without a glide, why there is none.

    Raises
    ------
    EstimationError
        By `plot`, if no forecast could be made.

    Notes
    -----
    Source: docs/forecast.md.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> record = sd.simulate(sd.Ship.example(), duration_s=900.0, lead_in_s=400.0)
    >>> found = sd.estimate(record).forecast(after=(300.0,))
    >>> found
    <Forecasts: 1 forecast of 1 glide>
    >>> found.made[0].checked.inside
    1.0
    """

    made: tuple[GlideForecast, ...]
    without: tuple[tuple[str, str], ...] = ()

    def _document(self) -> Mapping[str, Any]:
        made: list[dict[str, Any]] = []
        not_made: list[tuple[object, ...]] = []
        for each in self.made:
            if each.checked is None:
                not_made.append((each.bag, each.stop_ns, each.after_s, each.why))
                continue
            made.append(
                {
                    'bag': each.bag,
                    'stop_ns': each.stop_ns,
                    'made_ns': each.checked.forecast.made_ns,
                    'over_ground': each.checked.forecast.over_ground,
                    'speeds': [_milestone(one) for one in each.checked.milestones],
                    'inside': each.checked.inside,
                    'interval_score': each.checked.interval_score,
                    'not_compared': each.why or None,
                }
            )
        not_made += [(bag, None, None, why) for bag, why in self.without]
        keys = ('bag', 'stop_ns', 'after_s', 'reason')
        return {'forecasts': made, 'not_made': [dict(zip(keys, each)) for each in not_made]}

    def _lines(self) -> Sequence[str]:
        none = [f'{bag}: {why}' for bag, why in self.without]
        return [*(_line(each) for each in self.made), *none]

    def table(self) -> Table:
        """
        Show each forecast in even steps of the speed, with when it was made.
        """
        columns: tuple[str, ...] = ()
        rows: list[tuple[str, ...]] = []
        for each in self.made:
            if each.checked is not None:
                part = each.table()
                columns = ('made after', *part.columns)
                rows += [(clock(each.after_s), *row) for row in part.rows]
        return Table(columns, tuple(rows))

    def plot(self, ax: Axes | None = None) -> Axes:
        """
        Draw the speed foretold with its band over the one that followed.

        Parameters
        ----------
        ax
            To draw on; None: new axes.

        Returns
        -------
        matplotlib.axes.Axes
            Of the first glide; time from the stop, speed in knots, of a model ship in m/s.
        """
        shown = [each for each in self.made if each.checked is not None]
        if not shown:
            raise EstimationError(' '.join(self._lines()))
        first = [each for each in shown if each.stop_ns == shown[0].stop_ns]
        unit, name = speed_unit(shown[0].ship.mass_kg)
        with drawing(ax) as axis:
            for each in first:
                assert each.checked is not None
                _draw(axis, each.checked.forecast, each.stop_ns, unit)
            if first[0].followed is not None:
                seen = first[0].followed
                axis.plot(seen.time_s / 60.0, seen.speed_m_s / unit, 'k.', ms=2, label='followed')
            axis.set(xlabel='time from the stop [min]', ylabel=f'speed [{name}]')
            axis.legend()
        return axis

    def _title(self) -> str:
        made = sum(each.checked is not None for each in self.made)
        glides = len({(each.bag, each.stop_ns) for each in self.made})
        return (
            f'{made} forecast{"" if made == 1 else "s"} of {glides} glide'
            f'{"" if glides == 1 else "s"}'
        )

    def _columns(self) -> Mapping[str, Any]:
        rows = [
            (each, one)
            for each in self.made
            if each.checked is not None
            for one in each.checked.milestones
        ]
        found: dict[str, Any] = {
            'bag': [each.bag for each, _ in rows],
            'after_s': [each.after_s for each, _ in rows],
            **milestone_columns([one.foretold for _, one in rows]),
        }
        found['time_was_s'] = [one.was_s for _, one in rows]
        found['distance_was_m'] = [one.was_m for _, one in rows]
        return found


def _draw(axis: Axes, forecast: Forecast, stop_ns: int, unit_m_s: float) -> None:
    """Draw the speed to come and its band of 90 %."""
    made_s = (forecast.made_ns - stop_ns) / SECOND_NS
    time, speed, low, high, *_ = forecast.in_time().T
    minutes = (time + made_s) / 60.0
    (line,) = axis.plot(minutes, speed / unit_m_s, label=f'foretold after {made_s:.0f} s')
    axis.fill_between(
        minutes, low / unit_m_s, high / unit_m_s, color=line.get_color(), alpha=0.2, lw=0.0
    )


def _milestone(one: Passed) -> Mapping[str, Any]:
    return {
        'speed_m_s': one.foretold.speed_m_s,
        'time_s': {**one.foretold.time_s._asdict(), 'was': one.was_s},
        'distance_m': {**one.foretold.distance_m._asdict(), 'was': one.was_m},
    }


def milestone_columns(milestones: Sequence[Milestone]) -> dict[str, Any]:
    """
    Return speeds, and medians and bands of times and distances, as columns.
    """
    found: dict[str, Any] = {'speed_m_s': [each.speed_m_s for each in milestones]}
    for name in ('time_s', 'distance_m'):
        for part in ('median', 'low', 'high'):
            values = [getattr(getattr(each, name), part) for each in milestones]
            found[name.replace('_', f'_{part}_')] = values
    return found


def _line(each: GlideForecast) -> str:
    head = f'{clock(each.after_s)} after the stop of {utc(each.stop_ns)}'
    if each.checked is None:
        return f'{head}: no forecast: {each.why}.'
    shown = _apart(each.checked.milestones, each.ship.mass_kg)
    said = '; '.join(
        milestone_sentence(one.foretold, each.ship.mass_kg, one.was_s) for one in shown
    )
    inside = each.checked.inside
    judged = '' if inside is None else f' {inside:.0%} of what followed lies inside the bands.'
    beside = f' Not compared: {each.why}.' if each.why else ''
    return f'{head}: {said}.{judged}{beside}'


def forecast(runs: Sequence[RunResult], after_s: float | Sequence[float]) -> Forecasts:
    """
    Make forecasts of each glide of some runs.

    Parameters
    ----------
    runs
    after_s
        When, from each stop on [s].

    Raises
    ------
    EstimationError
        If a time is not above 0, or there is none.
    """
    try:
        given = np.atleast_1d(np.asarray(after_s, np.float64))
        times_s = given.tolist() if given.ndim == 1 else []
    except (TypeError, ValueError):
        times_s = []
    if not times_s or not all(0.0 < each < math.inf for each in times_s):
        raise EstimationError(
            f'forecasts after {after_s!r}: give times above 0, in s from the stop'
        )
    made: list[GlideForecast] = []
    without: list[tuple[str, str]] = []
    for run in runs:
        glides = list(forecast_run(run, times_s))
        made += glides
        if not glides:
            dismissed = (f'{utc(one.start_ns)}: {one.text}.' for one in run.dismissed)
            without.append((run.bag, ' '.join((*run.summary(), *dismissed))))
    return Forecasts(tuple(made), tuple(without))


def forecast_run(result: ReplayResult, after_s: Sequence[float]) -> Iterator[GlideForecast]:
    """
    Yield forecasts of each glide that a replay found, each from the samples until then alone.

    Parameters
    ----------
    result
        From `replay`.
    after_s
        When, from each stop on [s].
    """
    for coastdown, window in coast_windows(result):
        followed, unseen = None, ''
        try:
            followed = _followed(coastdown, window)
        except EstimationError as error:
            unseen = str(error)
        for after in after_s:
            yield _forecast(result, window, after, followed, unseen)


def _followed(coastdown: EndedCoastdown, window: Window) -> Followed:
    if coastdown.estimate is None:
        raise EstimationError(coastdown.failure or 'the whole glide gave no estimate')
    return Followed.of(window, coastdown.estimate)


def _forecast(
    result: ReplayResult, window: Window, after_s: float, followed: Followed | None, unseen: str
) -> GlideForecast:
    ship, parameters = result.ship, result.parameters
    stop_ns, length_s = window.start_ns, (window.end_ns - window.start_ns) / SECOND_NS
    made = partial(GlideForecast, result.run.name, ship, stop_ns, after_s)
    if after_s >= length_s:
        return made(None, f'the glide ends {length_s:.0f} s after the stop')
    try:
        so_far = window.part(stop_ns, stop_ns + round(after_s * SECOND_NS))
        found = estimate(so_far, ship, parameters)
        if why := too_vague(found, parameters):
            return made(None, why)
        forecast = foretell(
            found, ship, froude_min=parameters.froude_min, speeds_m_s=parameters.forecast_speeds
        )
    except EstimationError as error:
        return made(None, str(error))
    if followed is None:
        milestones = tuple(map(Passed, forecast.milestones))
        return made(Checked(forecast, milestones, after_s, 0.0), unseen)
    return made(followed.beside(forecast, stop_ns), followed=followed)


_RECENT_S = 30.0  # whose mean is the present speed
_FEWEST = 3
_SLACK = 0.05  # of the speed at the stop, that a mean may be over the last speed


@dataclass(frozen=True, repr=False)
class IfStopped(Shown):
    """
    The glide that would begin at the end of a record.

    Attributes
    ----------
    bag
        Name of the last run.
    ship
    hull
        Where the hull as last known is from, in words.
    measured
        What kind of speed it begins from.
    gliding
        Whether she glides already: there is no run-down to come.
    forecast

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> record = sd.simulate(sd.Ship.example(), duration_s=1.0, lead_in_s=400.0)
    >>> found = sd.estimate(record).if_stopped_now()
    >>> found.hull, found.measured
    ('the clean hull of the ship file', 'through water')
    """

    bag: str
    ship: Ship
    hull: str
    measured: str
    gliding: bool
    forecast: Forecast

    def _document(self) -> Mapping[str, Any]:
        return {
            'if_stopped_now': {
                'bag': self.bag,
                'made_ns': self.forecast.made_ns,
                'speed_m_s': float(self.forecast.speed_m_s[0]),
                'measured': self.measured,
                'hull': self.hull,
                'gliding': self.gliding,
                'over_ground': self.forecast.over_ground,
                'speeds': [_milestone(each) for each in self.passed],
                'why': None if self.passed else NO_WAY,
            }
        }

    def _lines(self) -> Sequence[str]:
        mass = self.ship.mass_kg
        now = ship_speed(float(self.forecast.speed_m_s[0]), mass)
        shown = _apart(self.passed, mass)
        said = '; '.join(milestone_sentence(each.foretold, mass) for each in shown)
        when = f'at {utc(self.forecast.made_ns)}'
        begun = f'Gliding already {when}' if self.gliding else f'If the engine were stopped {when}'
        return (f'{begun}, at {now} {self.measured}, by {self.hull}: {said or NO_WAY}.',)

    @property
    def passed(self) -> tuple[Passed, ...]:
        """Each milestone, of which nothing has followed."""
        return tuple(map(Passed, self.forecast.milestones))

    def table(self) -> Table:
        """
        Show when and how far on she would have each lower speed, in even steps.
        """
        even = _evenly(self.forecast, self.ship.mass_kg)
        rows = tuple(map(Passed, even.milestones))
        return milestone_table(rows, self.ship.mass_kg, followed=False)

    def _title(self) -> str:
        return f'if stopped at {utc(self.forecast.made_ns)}'

    def _columns(self) -> Mapping[str, Any]:
        return milestone_columns(self.forecast.milestones)


def if_stopped_now(runs: Sequence[RunResult]) -> IfStopped:
    """
    Foretell the glide from the end of the last of some runs.

    Parameters
    ----------
    runs
        Of one ship; the latest coastdown in them is the hull as last known, or else the ship file.

    Raises
    ------
    EstimationError
        If no speed was read at its end, or nothing is known of the hull.
    """
    last = max(runs, key=lambda each: (each.run.span_ns or (0, 0))[1])
    usable = [
        (each.end_ns, each, run)
        for run in runs
        for each in run.coastdowns
        if each.stands and each.estimate is not None
    ]
    _, coastdown, run = max(usable, key=lambda each: each[0], default=(0, None, last))
    window, series, measured = _recent(last)
    speed, sd = float(series.value.mean()), float(series.value.std() / np.sqrt(len(series)))
    hull = HullNow.of_file(last.ship) if coastdown is None else _hull(coastdown)
    gliding = coastdown is not None and run is last and _goes_on(coastdown, speed)
    now_ns = window.end_ns
    if gliding and coastdown is not None and coastdown.end_ns >= window.start_ns:
        assert coastdown.estimate is not None  # a mean lags behind a ship that slows
        speed, sd = coastdown.estimate.last_speed_m_s, coastdown.estimate.last_speed_sigma_m_s
        now_ns, measured = coastdown.estimate.end_ns, 'through water, estimated'
    found = if_stopped(
        hull,
        last.ship,
        speed,
        now_ns,
        rest_m_s=speed_at_rest(last.ship),
        speed_sd_m_s=sd,
        gliding=gliding,
        speeds_m_s=last.parameters.forecast_speeds,
    )
    return IfStopped(last.bag, last.ship, hull.source, measured, gliding, found)


def _goes_on(coastdown: EndedCoastdown, speed_m_s: float) -> bool:
    """Say whether a coastdown goes on after its end, as nothing has driven her since."""
    assert coastdown.estimate is not None
    if coastdown.ended_by is EndedBy.RECORD_END:
        return True
    slack = _SLACK * coastdown.estimate.curve.speed_m_s[-1]
    slow = speed_m_s < coastdown.estimate.last_speed_m_s + slack
    return coastdown.ended_by is EndedBy.SPEED and slow


def _hull(coastdown: EndedCoastdown) -> HullNow:
    assert coastdown.estimate is not None
    curve = coastdown.estimate.valid_curve
    curve = curve if len(curve) > 1 else coastdown.estimate.curve
    known = curve.speed_m_s, curve.resistance_m_s2, curve.sigma_m_s2
    return HullNow.of_run(*known, coastdown.start_ns)


def _recent(run: RunResult) -> tuple[Window, Series, str]:
    """Return the end of a run, the speed that it shows, and which it is."""
    block, _ = accepted_samples(run.run, run.ship)
    if len(block):
        end_ns = int(block.stamp_ns.max())
        window = Window.from_block(block, end_ns - round(_RECENT_S * SECOND_NS), end_ns)
        for kind in ('through water', 'over ground'):
            for series in window.each(f'speed_{kind.replace(" ", "_")}'):
                if len(series) >= _FEWEST:
                    return window, series, kind
    raise EstimationError(
        f'{run.bag!r}: no speed was read in its last {_RECENT_S:.0f} s, so the present speed is '
        'not known; give a bag that ends with readings of speed_through_water or '
        'speed_over_ground'
    )


def milestone_sentence(milestone: Milestone, mass_kg: float, was_s: float | None = None) -> str:
    """
    Say when she has a speed and how far on: `3.9 knots in 7:40 (6:50 to 8:30), 0.71 nm`.
    """
    time = milestone.time_s
    text = (
        f'{ship_speed(milestone.speed_m_s, mass_kg)} in {clock(time.median)} '
        f'({clock(time.low)} to {clock(time.high)}), {way(milestone.distance_m.median, mass_kg)}'
    )
    if was_s is None:
        return text
    return f'{text}; was {clock(was_s)}' if was_s >= 0.0 else f'{text}; passed before'


def _was(value: float | None, was_s: float | None, show: Callable[[float], str]) -> str:
    """Return what was; a speed may have been passed before it was foretold."""
    if value is None or was_s is None:
        return 'not shown'
    return show(value) if was_s >= 0.0 else 'before'


def _cells(band: Band, show: Callable[[float], str]) -> tuple[str, ...]:
    """Return a median, and its band."""
    return show(band.median), f'{show(band.low)} to {show(band.high)}'


_ROWS = 8  # at most, beside the first


def _evenly(forecast: Forecast, mass_kg: float) -> Forecast:
    """Return a forecast that speaks of even steps of the speed above its last target."""
    if not forecast.targets_m_s:
        return forecast
    unit, _ = speed_unit(mass_kg)
    top, last = forecast.speed_m_s[0] / unit, forecast.targets_m_s[-1] / unit
    size = 10.0 ** math.floor(math.log10((top - last) / _ROWS))
    step = next(each * size for each in (1, 2, 5, 10) if each * size * _ROWS >= top - last)
    levels = step * np.arange(math.ceil(top / step) - 1, 0, -1)
    even = tuple(float(each) * unit for each in levels if each >= last)
    return replace(forecast, targets_m_s=even or forecast.targets_m_s[-1:])


def _apart(compared: Sequence[Passed], mass_kg: float) -> list[Passed]:
    """Return milestones without those whose speed reads as that of one before."""
    first: dict[str, Passed] = {}
    for each in compared:
        first.setdefault(ship_speed(each.foretold.speed_m_s, mass_kg), each)
    return list(first.values())


def milestone_table(compared: Sequence[Passed], mass_kg: float, *, followed: bool = True) -> Table:
    """
    Show milestones, a line each; beside what followed, or alone.
    """
    rows = []
    for each in _apart(compared, mass_kg):
        far = partial(way, mass_kg=mass_kg, largest_m=each.foretold.distance_m.high)
        time, distance = _cells(each.foretold.time_s, clock), _cells(each.foretold.distance_m, far)
        if followed:
            time += (_was(each.was_s, each.was_s, clock),)
            distance += (_was(each.was_m, each.was_s, far),)
        rows.append((ship_speed(each.foretold.speed_m_s, mass_kg), *time, *distance))
    was = ('was',) if followed else ()
    return Table(('down to', 'in [min:s]', '90 %', *was, 'after', '90 %', *was), tuple(rows))
