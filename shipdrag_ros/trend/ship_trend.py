# SPDX-License-Identifier: Apache-2.0
"""The trend of each ship of a fleet, which hull comes first, and when cleaning pays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np

from shipdrag_ros.display import day
from shipdrag_ros.fleet.store import HullEvent
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.sections import Economics
from shipdrag_ros.trend.hull_state import FoundStep, Growth, HullState, Runs, Steps, search
from shipdrag_ros.trend.series import YEAR_NS, CoastdownRow, Point, ShipSeries, series_of

_DRAWS, _SEED = 4000, 1
_SURE = 0.9  # of growth: with less no date is given
_FARTHEST_YEARS = 5.0
_WIDEST_YEARS = 3.0


@dataclass(frozen=True)
class CleaningDate:
    """
    When cleaning pays, years from now; 80 % of what is likely lies in the interval.

    Attributes
    ----------
    years, earliest, latest
        0 where it pays already.
    """

    years: float
    earliest: float
    latest: float


def usd_per_year(economics: Economics, force_n: float, speed_m_s: float) -> float:
    """
    Return what overcoming a force costs in a year.

    Parameters
    ----------
    economics
        Prices and efficiencies.
    force_n
        Added resistance [N].
    speed_m_s
        Service speed [m/s].
    """
    return fuel_t_per_day(economics, force_n * speed_m_s / 1000.0) * (
        economics.fuel_usd_per_t * economics.days_at_sea_per_year
    )


def fuel_t_per_day(economics: Economics, effective_kw: float) -> float:
    """
    Return the fuel that effective power takes in a day at sea [t].
    """
    return effective_kw / economics.propulsive_efficiency * economics.sfoc_g_per_kwh * 24.0e-6


def cleaning_date(
    economics: Economics, usd_per_unit: float, since_cleaning: Parameter, growth: Parameter
) -> CleaningDate | None:
    """
    Return when cleaning pays, or None where the data cannot carry a date.

    Parameters
    ----------
    economics
        With the price of a cleaning.
    usd_per_unit
        Cost of an added resistance of 1 [USD a year].
    since_cleaning
        Added resistance since the last cleaning, now.
    growth
        Of it, per year.

    Notes
    -----
    Added resistance grows by g a year and costs c a year for each unit of it; a cleaning costs
    C and brings the hull back to where the last one left it. The mean cost a year is least
    where the hull is cleaned as soon as the added resistance since the last cleaning reaches
    sqrt(2 C g / c): the rule of optimal replacement under linear wear.
    """
    rng = np.random.default_rng(_SEED)
    added = rng.normal(since_cleaning.value, since_cleaning.sd, _DRAWS)
    rate = rng.normal(growth.value, growth.sd, _DRAWS)
    if np.mean(rate > 0.0) < _SURE or usd_per_unit <= 0.0:
        return None
    rate = np.maximum(rate, 1e-4)
    due = np.sqrt(2.0 * economics.cleaning_usd * rate / usd_per_unit)
    years = np.clip((due - added) / rate, 0.0, 100.0)
    earliest, middle, latest = (float(each) for each in np.quantile(years, (0.1, 0.5, 0.9)))
    if middle > _FARTHEST_YEARS or latest - earliest > _WIDEST_YEARS:
        return None
    return CleaningDate(middle, earliest, latest)


_SISTER_SD = 0.05  # of growth per year, between ships of one drawing
_SISTER_TOLERANCE = 0.01
_CURVE_POINTS = 200
_LEAST_RUNS = 3  # two runs are a difference, no trend
_CLEANING = ('cleaning', 'docking', 'coating')
UNKNOWN_KIND = 'unknown'


@dataclass(frozen=True)
class TrendEvent:
    """
    A step in the state of a hull.

    Attributes
    ----------
    time_ns
        When; of one that was found, the middle between the runs around it.
    kind
        As the log book has it; 'unknown' where it was found.
    probability
        That it happened about then; 1 for a known one.
    change
        Of the added resistance.
    """

    time_ns: int
    kind: str
    known: bool
    probability: float
    change: Parameter


@dataclass(frozen=True)
class LevelCurve:
    """
    The added resistance of the hull against time.

    Attributes
    ----------
    time_ns : (m,) int64
    value, sd : (m,)
        Over the clean hull's.
    """

    time_ns: Int64
    value: Float64
    sd: Float64


@dataclass(frozen=True)
class Costs:
    """
    What the added resistance costs, each with the error of the added resistance alone.

    Attributes
    ----------
    fuel_t_per_day
        At sea, now.
    usd_per_year
        At the present state.
    usd_so_far
        Since the first run.
    """

    fuel_t_per_day: Parameter
    usd_per_year: Parameter
    usd_so_far: Parameter


@dataclass(frozen=True)
class ShipTrend:
    """
    Added resistance of one ship against time.

    Attributes
    ----------
    series
        The runs at the reference speed.
    growth_per_year, now, power_kw
        Of the hull between cleanings; at the last run; effective power that it takes.
        None where the runs carry no trend.
    outlier : by bag and time
        Probability that a run is an outlier.
    cleaning
        When cleaning pays; None where that cannot be said, and `notes` say why.
    costs, usd_per_unit
        And what an added resistance of 1 costs [USD a year]; only where there are prices.
    rank
        1: which hull first, by cost a year, or by power where a ship has no prices.
    """

    series: ShipSeries
    events: tuple[TrendEvent, ...] = ()
    growth_per_year: Parameter | None = None
    now: Parameter | None = None
    power_kw: Parameter | None = None
    curve: LevelCurve | None = None
    outlier: tuple[float, ...] = ()
    scatter: float | None = None
    costs: Costs | None = None
    usd_per_unit: float = np.nan
    cleaning: CleaningDate | None = None
    rank: int | None = None
    notes: tuple[str, ...] = ()

    def after_last_run(self, years: float) -> int:
        """
        Return the time so long after the last run that is used [ns].
        """
        return self.series.used[-1].time_ns + round(years * YEAR_NS)

    @property
    def cleaning_from_ns(self) -> int | None:
        """From when cleaning pays; None where that cannot be said."""
        return None if self.cleaning is None else self.after_last_run(self.cleaning.years)

    @property
    def points(self) -> tuple[Point, ...]:
        """The runs, those the trend takes for outliers with the reason."""
        used = iter(self.outlier)
        found = []
        for point in self.series.points:
            share = next(used, 0.0) if point.used else 0.0
            if share > 0.5:
                text = f'an outlier by {share:.0%}: given little weight, not removed'
                point = replace(point, reason=text)
            found.append(point)
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """
        Return what `shipdrag trend --json` has of the ship.
        """
        now, cleaning_ns = _figure(self.now), self.cleaning_from_ns
        if now is not None:
            now['power_kw'] = _figure(self.power_kw)
        of_point = ('time_ns', 'bag', 'value', 'sd', 'used', 'reason')
        of_event = ('time_ns', 'kind', 'known', 'probability')
        return {
            'name': self.series.name,
            'coastdowns': len(self.series.points),
            'reference_speed_m_s': self.series.reference_speed_m_s,
            'clean_hull': self.series.clean,
            'added_resistance': [
                {name: getattr(point, name) for name in of_point} for point in self.points
            ],
            'growth_per_year': _figure(self.growth_per_year),
            'now': now,
            'events': [
                {name: getattr(event, name) for name in of_event}
                | {'change': _figure(event.change)}
                for event in self.events
            ],
            'costs': self.costs
            and {name: _figure(figure) for name, figure in vars(self.costs).items()},
            'cleaning_pays_from': None if cleaning_ns is None else day(cleaning_ns),
            'scatter': self.scatter,
            'rank': self.rank,
            'notes': list(self.notes),
        }


def _figure(found: Parameter | None) -> dict[str, Any] | None:
    return None if found is None else {'value': found.value, 'sd': found.sd}


def fleet_trends(
    rows: Sequence[CoastdownRow],
    ships: Mapping[str, Ship],
    events: Mapping[str, Sequence[HullEvent]],
) -> list[ShipTrend]:
    """
    Return the trend of every ship, the hull to be cleaned first in front.

    Parameters
    ----------
    rows
        Rows of the store's `coastdowns`.
    ships
        Ship files by name; prices are taken from them.
    events
        What is known to have been done to each hull, by name of the ship.
    """
    by_name = sorted(rows, key=lambda row: row['ship'])
    known = []
    for name, own in groupby(by_name, key=lambda row: row['ship']):
        economics = None if name not in ships else ships[name].economics
        speed = None if economics is None else economics.service_speed_m_s
        series = series_of(name, list(own), service_speed_m_s=speed)
        known.append((series, economics, events.get(name, ())))
    alone = [ship_trend(*each) for each in known]
    growths = [_from_sisters(alone, place) for place in range(len(alone))]
    return _ranked(
        [
            ship_trend(*each, growth=growth) if growth else trend
            for each, growth, trend in zip(known, growths, alone)
        ]
    )


def ship_trend(
    series: ShipSeries,
    economics: Economics | None = None,
    known: Sequence[HullEvent] = (),
    *,
    growth: Growth | None = None,
) -> ShipTrend:
    """
    Return the trend of one ship.

    Parameters
    ----------
    series
        Its runs.
    economics
        Prices; without them no date of a cleaning is given.
    known
        Events of its log book.
    growth
        Prior of its growth, from sister ships for instance.
    """
    used = series.used
    if len(used) < _LEAST_RUNS:
        why = f'{len(used)} run(s) can be used, a trend needs {_LEAST_RUNS}: give more runs'
        return ShipTrend(series, notes=(*series.notes, why))
    times = np.array([point.time_ns for point in used])
    first_ns = used[0].time_ns
    runs = Runs(
        (times - first_ns) / YEAR_NS,
        np.array([point.value for point in used]),
        np.array([point.sd_repeatable for point in used]),
        np.array([point.covariates for point in used]),
    )
    inside = [event for event in known if first_ns < event.time_ns <= used[-1].time_ns]
    notes = series.notes
    if left := len(known) - len(inside):
        notes += (f'{left} event(s) of events.csv lie outside the time of the runs: not used',)
    # two notes of one kind at one time are of one step
    once = tuple({(event.time_ns, event.kind): event for event in inside}.values())
    steps = Steps(
        np.array([(event.time_ns - first_ns) / YEAR_NS for event in once]),
        tuple(event.kind for event in once),
    )
    found = search(runs, steps, growth or Growth())
    state, open_state = found.state, found.open
    shared = _shared_sd(used)
    level = open_state.level(runs.years[-1:]).first
    now = Parameter(level.value, float(np.hypot(level.sd, shared)))
    kw = series.clean_force_n * series.reference_speed_m_s / 1000.0
    years = np.linspace(0.0, runs.years[-1], _CURVE_POINTS)
    curve = open_state.level(years)
    result = ShipTrend(
        series,
        _events(state, once, found.steps, first_ns),
        open_state.growth_per_year().first,
        now,
        _times(now, kw),
        LevelCurve((first_ns + years * YEAR_NS).astype(np.int64), curve.value, curve.sd),
        tuple(state.outlier.tolist()),
        state.scatter,
        notes=notes,
    )
    return _with_costs(result, state, economics)


def _shared_sd(used: Sequence[Point]) -> float:
    """Return the error that all runs share: it moves the level and no change."""
    apart = [max(point.sd**2 - point.sd_repeatable**2, 0.0) for point in used]
    return float(np.sqrt(np.median(apart)))


def _events(
    state: HullState, known: Sequence[HullEvent], found: Sequence[FoundStep], first_ns: int
) -> tuple[TrendEvent, ...]:
    """Return known and found steps with their changes, in the order of time."""
    changes = state.changes()
    events = []
    book = iter(known)  # in the order of the steps, of which several may be at one time
    for year, kind, value, sd in zip(
        state.steps.years, state.steps.kinds, changes.value, changes.sd, strict=True
    ):
        change = Parameter(float(value), float(sd))
        if kind:
            events.append(TrendEvent(next(book).time_ns, kind, True, 1.0, change))
        else:
            time_ns = first_ns + round(float(year) * YEAR_NS)
            [probability] = [each.probability for each in found if each.year == year]
            events.append(TrendEvent(time_ns, UNKNOWN_KIND, False, probability, change))
    return tuple(events)


def _with_costs(result: ShipTrend, state: HullState, economics: Economics | None) -> ShipTrend:
    """Add what the added resistance costs, and when cleaning pays."""
    if economics is None:
        why = 'no date of a cleaning: the ship file has no `economics`'
        return replace(result, notes=(*result.notes, why))
    assert result.now is not None
    assert result.power_kw is not None
    assert result.curve is not None
    series = result.series
    per_unit = usd_per_year(economics, series.clean_force_n, series.reference_speed_m_s)
    years = result.curve.time_ns / YEAR_NS
    so_far = float(np.trapezoid(result.curve.value, years))
    # the level at one time and at another err together: at most so much
    sd = float(np.trapezoid(np.hypot(result.curve.sd, _shared_sd(series.used)), years))
    costs = Costs(
        _times(result.power_kw, fuel_t_per_day(economics, 1.0)),
        _times(result.now, per_unit),
        _times(Parameter(so_far, sd), per_unit),
    )
    result = replace(result, costs=costs, usd_per_unit=per_unit)
    since = _since_cleaning(result, state)
    date = cleaning_date(economics, per_unit, since, state.growth_since_last_step().first)
    if date is None:
        why = 'no date of a cleaning: growth and state are not known well enough for one'
        return replace(result, notes=(*result.notes, why))
    return replace(result, cleaning=date)


def _times(figure: Parameter, unit: float) -> Parameter:
    return Parameter(figure.value * unit, figure.sd * unit)


def _since_cleaning(result: ShipTrend, state: HullState) -> Parameter:
    """Return what has been added since the last cleaning, or over the clean hull."""
    end = state.runs.years[-1]
    first_ns = result.series.used[0].time_ns
    cleanings = [
        event
        for event in result.events
        if event.kind in _CLEANING or (not event.known and event.change.value < 0.0)
    ]
    if not cleanings:
        assert result.now is not None
        return result.now
    after = (cleanings[-1].time_ns - first_ns) / YEAR_NS
    both = state.level(np.array([after, end]))
    # two times of one curve move together: their errors add at most
    return Parameter(float(both.value[1] - both.value[0]), float(np.hypot(*both.sd)))


def _from_sisters(alone: Sequence[ShipTrend], place: int) -> Growth | None:
    """Return the prior of a ship's growth by what her sisters show, None without any."""
    own = np.array(alone[place].series.sister)
    known = [
        each.growth_per_year
        for number, each in enumerate(alone)
        if number != place
        and each.growth_per_year is not None
        and np.allclose(each.series.sister, own, rtol=_SISTER_TOLERANCE)
    ]
    if not known:
        return None
    plain = Growth()
    precision = np.array([1.0 / (each.sd**2 + _SISTER_SD**2) for each in known])
    values = np.array([each.value for each in known])
    total = precision.sum() + 1.0 / plain.sd**2
    mean = float((precision @ values + plain.mean / plain.sd**2) / total)
    return Growth(mean, float(np.sqrt(1.0 / total + _SISTER_SD**2)))


def are_priced(trends: Sequence[ShipTrend]) -> bool:
    """
    Return whether every ship with a trend has prices, so that money ranks them; else power.
    """
    return all(each.costs is not None for each in trends if each.now is not None)


def _ranked(trends: Sequence[ShipTrend]) -> list[ShipTrend]:
    """Rank by the figure that the ranking shows first; ships without a trend last."""
    priced = are_priced(trends)

    def burden(trend: ShipTrend) -> float:
        figure = trend.costs.usd_per_year if priced and trend.costs else trend.power_kw
        return -np.inf if figure is None else figure.value

    ordered = sorted(trends, key=lambda trend: (-burden(trend), trend.series.name))
    return [
        replace(trend, rank=None if trend.now is None else place)
        for place, trend in enumerate(ordered, start=1)
    ]
