# SPDX-License-Identifier: Apache-2.0
"""
A run as a diagnosis sees it: condensed rows of measurements, and what is known of it.

Rows are means over times in which the motion is as good as even, so that a few
hundred hold all that a run can show.

Observed runs as the one posterior takes them: rows, a prior of the stop, and their simulation.

A ship without a baseline is simulated with a usual one, and her law is that of any hull.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np

from shipdrag_ros.diagnosis.context import Context, Stop, damping_of
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.estimation.record import BIN_S, RunRows
from shipdrag_ros.estimation.run_down import RunDown
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.inference.learning import LEAST_S
from shipdrag_ros.inference.rows import KIND_COUNT, LOG, OVER_GROUND, POSITION, Input, Rows
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.hypotheses import RunSight, ShipRuns, SimulatedRows
from shipdrag_ros.posterior.problem import RunModel, StopPrior
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Fact, Ship
from shipdrag_ros.simulation import Action, Columns, Scenario, simulate_columns
from shipdrag_ros.simulation.effect import DAY_S, Frame

_LEAST_ROWS = 8  # of the steady record, for its speed


@dataclass(frozen=True)
class CoastRun:
    """
    A coastdown to be diagnosed.

    Attributes
    ----------
    name
        For the user.
    window
        With the steady record before it.
    facts
        That a log book knows of this run.
    ship
        The ship as she was in this run; None: as in all.
    """

    name: str
    window: Window
    facts: tuple[Fact, ...] = ()
    ship: Ship | None = None


@dataclass(frozen=True)
class Observation:
    """
    One run.

    Attributes
    ----------
    name
        For the user.
    lead_in_s
        Length of the steady record.
    time_s : (m,)
        Times of all rows, ascending, from the start of the steady record.
    run_down_s, run_down_sd_s
        Of the shaft: as the ship file states it, else as it was seen; 0: not known.
    heading_rad, heading_sd_rad
        Direction through water in the lead-in, from east, anticlockwise.
    speed_m_s
        Speed in the lead-in, roughly.
    rows
        Measured along the heading; of `POSITION` the distances along it [m].
    variance : (n,)
        Of the white noise of each row.
    at : (n,)
        Places of the rows among the times.
    context
        What is measured besides.
    ship
        As she was in this run, without effects.
    geodetic
        Whether positions came as latitude and longitude.
    notes
        A sentence for each input that is left out.
    """

    name: str
    lead_in_s: float
    time_s: Float64
    run_down_s: float
    run_down_sd_s: float
    heading_rad: float
    heading_sd_rad: float
    speed_m_s: float
    rows: Rows
    variance: Float64
    at: Int64
    context: Context
    ship: Ship
    geodetic: bool = False
    notes: tuple[str, ...] = ()

    @property
    def stop_sd_s(self) -> float:
        """How well the time of the stop is known."""
        return self.context.stop.sd_s

    @property
    def stopped_ns(self) -> int:
        """Time of the stop [ns since the epoch]."""
        return self.context.stop.since_ns + round(self.context.stop.lead_in_s * 1e9)

    @property
    def duration_s(self) -> float:
        """Length of the coastdown."""
        return float(self.time_s[-1]) - self.lead_in_s

    @property
    def inputs(self) -> set[str]:
        """Kinds of input of motion that were read."""
        return {Input(code % KIND_COUNT).key for code in np.unique(self.rows.kind).tolist()}

    @classmethod
    def of(cls, window: Window, ship: Ship, parameters: Parameters, *, name: str) -> Observation:
        """
        Condense a coastdown with the steady record before it.

        Parameters
        ----------
        window
            With the record before the stop.
        ship
            With a baseline, for how the ship answers a gust.
        parameters
            For the noise of the sensors and the convention of the heading.
        name
            For the user.

        Returns
        -------
        Observation
            With the noise of its steady part.

        Raises
        ------
        DiagnosisError
            If the steady record is too short.
        EstimationError
            If no input has enough samples.
        """
        window = window.by_rep103(parameters.heading_convention)
        run_down = RunDown.of(window, ship)
        record = RunRows.of(window, run_down, parameters)
        window = _usable(window, record)
        assert window.before is not None
        speed_m_s = _speed(record.steady)
        # the first mean is of as much time at most
        first_ns = run_down.stop_ns + round((float(record.steady.time_s[0]) - BIN_S) * 1e9)
        since_ns = max(window.before.start_ns, first_ns)
        lead_in_s = (run_down.stop_ns - since_ns) * 1e-9
        heading_rad, heading_sd = _heading(window, since_ns, record.white_sd.get('position', 0.0))
        halved_s = 2.0 / float(damping_of(ship, np.array([speed_m_s]))[0][0])

        def rows_of(direction_rad: float, way_m_s: float) -> tuple[Rows, Float64]:
            found = RunRows.of(window, run_down, parameters, heading_rad=direction_rad)
            rows, variance = found.condensed(way_m_s, halved_s)
            since_s = np.maximum(rows.time_s + lead_in_s, 0.0)  # rounding
            return rows._replace(time_s=since_s), variance

        rows, variance = rows_of(heading_rad, speed_m_s)
        across, noise = rows_of(heading_rad + 0.5 * math.pi, 0.0)
        placed = across.kind == POSITION
        times = np.unique(np.concatenate([rows.time_s, across.time_s[placed]]))
        shaft_s = run_down.shaft_s if run_down.by_shaft else 0.0
        stop = Stop(since_ns, lead_in_s, heading_rad, speed_m_s, shaft_s, run_down.stop_sd_s)
        # their noise is learnt from the steady record
        placed &= (across.time_s[placed] < lead_in_s - stop.sd_s).any()
        port = Rows(*(each[placed] for each in across)), noise[placed]
        return cls(
            name,
            lead_in_s,
            times,
            *(
                (run_down.shaft_s, run_down.shaft_sd_s)
                if ship.propulsion is None
                else (ship.propulsion.run_down_s, ship.propulsion.sd)
            ),
            heading_rad,
            heading_sd,
            speed_m_s,
            rows,
            variance,
            np.searchsorted(times, rows.time_s),
            Context.of(window, ship, times, stop, port),
            replace(ship, effects=()),
            'position' in window.geodetic,
            record.notes,
        )


def _usable(window: Window, record: RunRows) -> Window:
    """Return a window without the inputs that were refused, if it can be diagnosed."""
    if record.steady_s < LEAST_S or window.before is None:
        raise DiagnosisError(
            f'{record.steady_s:.0f} s of steady sailing before the stop, at least '
            f'{LEAST_S:.0f} s are needed to separate an effect from the noise: give a record '
            'that begins earlier'
        )
    for name in window.motion:
        if name not in record.white_sd:  # a note of the record says why
            window = window.without(name, 'not used')
    return window


def _heading(window: Window, since_ns: int, position_sd_m: float) -> tuple[float, float]:
    """Return direction through water in the lead-in, and its sd: compass, or else course."""
    assert window.before is not None
    yaw = window.before.heading.value
    if len(yaw):
        mean = math.atan2(float(np.sin(yaw).mean()), float(np.cos(yaw).mean()))
        return mean, priors.COMPASS.sd
    before, after = window.before.position, window.position
    if not len(after):
        return 0.0, 0.0
    sailed = before.time_ns >= since_ns
    courses = [
        _course(before.time_ns[sailed], before.value[sailed], position_sd_m),
        _course(after.time_ns, after.value, position_sd_m),
    ]
    # she turns little where that after the stop is needed
    course, sd = (
        courses[0] if courses[0][1] < priors.COURSE.sd else min(courses, key=itemgetter(1))
    )
    return course, math.hypot(sd, priors.COURSE.sd)


def _course(time_ns: Int64, place: Float64, sd_m: float) -> tuple[float, float]:
    """Return the direction of a line through places, and its sd by their noise."""
    if len(place) < 2:
        return 0.0, math.inf
    time_s = (time_ns - time_ns.mean()) * 1e-9
    spread = float(time_s @ time_s)
    east, north = time_s @ place / spread
    return math.atan2(north, east), sd_m / max(math.sqrt(spread) * math.hypot(east, north), 1e-9)


def _speed(steady: Rows) -> float:
    """Return the speed in the lead-in, by the first input that shows it."""
    for kind in np.unique(steady.kind).tolist():
        chosen = steady.kind == kind
        if chosen.sum() < _LEAST_ROWS:
            continue
        if kind != POSITION:
            return float(np.median(steady.value[chosen]))
        return float(np.polyfit(steady.time_s[chosen], steady.value[chosen], 1)[0])
    raise DiagnosisError('the steady record holds too few samples of any speed or position')


def ship_runs(seen: Sequence[Observation], ship: Ship) -> ShipRuns:
    """
    Return runs of a ship as hypotheses see them.

    Parameters
    ----------
    seen
        Effects of the earth are stated along the first.
    ship
        Her effects do not count: those of her file are hypotheses' own.
    """
    return ShipRuns(tuple(sight(run, seen, ship) for run in seen))


def day_of(run: Observation) -> float:
    """
    Return the day of the stop, counted from 1970-01-01 UTC.
    """
    return (run.context.stop.since_ns * 1e-9 + run.lead_in_s) / DAY_S


def lowest_m_s(run: Observation) -> float:
    """Return about the speed at the end."""
    speeds = [
        run.rows.value[run.rows.kind == kind][-5:]
        for kind in (0, 1)
        if (run.rows.kind == kind).any()
    ]
    if speeds:
        return max(float(np.median(speeds[0])), 0.05 * run.speed_m_s)
    return 0.3 * run.speed_m_s


def sight(run: Observation, seen: Sequence[Observation], ship: Ship) -> RunSight:
    """
    Return a run, or one that is yet to be made, beside some runs.

    Parameters
    ----------
    run
    seen
        What the law is spread over, and the first heading.
    ship
    """
    top = max(each.speed_m_s for each in seen)
    low = min(lowest_m_s(each) for each in seen)
    scenario = Scenario(
        speed_m_s=run.speed_m_s,
        lead_in_s=run.lead_in_s,
        # beyond the last row, whatever the difference is rounded to
        duration_s=run.duration_s + 1e-6,
        heading_rad=run.heading_rad,
        day=day_of(run),
    )
    if run.context.depth_m is not None:
        scenario = replace(scenario, depth_m=run.context.depth_m)
    frame = Frame(run.ship, scenario, seen[0].heading_rad)
    steady = int(np.searchsorted(run.rows.time_s, run.lead_in_s))
    stop = StopPrior(max(run.stop_sd_s, 1e-3), run.run_down_s, run.run_down_sd_s)
    own = replace(run.ship, baseline=ship.baseline)  # as heavy as she was in this run
    model = RunModel.of(
        run.rows._replace(time_s=run.rows.time_s - run.lead_in_s),
        run.variance,
        steady,
        own,
        stop,
        speeds_m_s=(low, run.speed_m_s, top),
    )
    # whether a free propeller stands is the ship's, not the run's: it is odd once
    odd = next((each for each in seen if each.context.odd), None) is run
    run = replace(run, context=replace(run.context, odd=odd))
    stated = ship.propulsion.run_down_s if ship.propulsion else 0.0
    return RunSight(
        model,
        frame,
        run.context.value,
        run.context.whitener,
        len(run.context.at_port),
        run.heading_sd_rad,
        stated,
        ship.baseline.run_scatter if ship.baseline else 0.0,
        len(run.context.at_shaft) > 0,
        _simulating(run, frame),
    )


def _simulating(
    run: Observation, frame: Frame
) -> Callable[[Sequence[Action], Float64, float], SimulatedRows]:
    first, length = frame.scenario.lead_in_s, frame.scenario.length_s

    def simulate(actions: Sequence[Action], speed_m_s: Float64, later_s: float) -> SimulatedRows:
        lead_in_s = min(max(first + later_s, 1.0), length - 1.0)  # within the record
        scenario = replace(frame.scenario, lead_in_s=lead_in_s, duration_s=length - lead_in_s)
        columns = simulate_columns(frame.ship, scenario, actions, run.time_s, speed_m_s=speed_m_s)
        along, ahead = rows_of(run, columns)
        rest = run.context.predict(columns, actions, lead_in_s)
        return SimulatedRows(along, rest, ahead[:, run.context.at_port])

    return simulate


def rows_of(seen: Observation, columns: Columns) -> tuple[Float64, Float64]:
    """Return rows (k, n), and the distance ahead (k, m), of each column."""
    cos, sin = math.cos(seen.heading_rad), math.sin(seen.heading_rad)
    place = columns.radar_position_m
    ahead = cos * place[..., 0] + sin * place[..., 1]
    kind, at = seen.rows.kind, seen.at
    along = ahead[:, at]
    along[:, kind == LOG] = columns.log_m_s[:, at[kind == LOG]]
    along[:, kind == OVER_GROUND] = columns.radar_speed_m_s[:, at[kind == OVER_GROUND]]
    return along, ahead
