# SPDX-License-Identifier: Apache-2.0
"""
A run as a diagnosis sees it: condensed rows of measurements, and what is known of it.

Rows are means over times in which the motion is as good as even, so that a few
hundred hold all that a run can show. The noise is that of the steady record before the stop,
colour included: what a coastdown leaves over a fit would hold the very effect that is sought.
Beside it stands what a ship wanders by as she glides, which no steady record shows.

The one posterior takes a run as rows, a prior of the stop, and its simulation. A ship without a
baseline is simulated with a usual one, and her law is that of any hull.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter, itemgetter

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.linalg import block_diag

from shipdrag_ros.errors import DiagnosisError, SimulationError
from shipdrag_ros.estimation.record import BIN_S, RunRows
from shipdrag_ros.estimation.run_down import TURNS, RunDown
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.inference.learning import LEAST_S, learn, of_steady
from shipdrag_ros.inference.rows import (
    KIND_COUNT,
    LOG,
    OVER_GROUND,
    POSITION,
    WHITE,
    Input,
    Noise,
    Rows,
    bin_means,
    noise_of,
    whiten,
)
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.hypotheses import RunSight, ShipRuns, SimulatedRows
from shipdrag_ros.posterior.law import stated_r
from shipdrag_ros.posterior.problem import RunModel, StopPrior
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Fact, Ship
from shipdrag_ros.simulation import Action, Columns, Scenario, simulate_columns
from shipdrag_ros.simulation.columns import RUN_DOWNS
from shipdrag_ros.simulation.effect import DAY_S, Frame
from shipdrag_ros.simulation.surge import turning

_SLOWEST = 0.02  # of the speed at the stop, that a glide is followed to
_SPEEDS = 200


def _port_covariance(rows: Rows, variance: Float64, ship: Ship, stop: Stop) -> Float64:
    """Return the covariance (n, n) of the noise of places to port, by that before the stop."""
    time, speed_m_s, lead_in_s = rows.time_s, stop.speed_m_s, stop.lead_in_s
    steady = time < lead_in_s - stop.sd_s
    damping, inertia = damping_of(ship, np.array([speed_m_s]))
    seen = of_steady(
        Rows(time[steady], rows.kind[steady], rows.value[steady]),
        variance[steady],
        float(damping[0]),
        float(inertia[0]),
    )
    # the engine damps the steady record; behind the stop the hull does
    learnt = learn(seen, speed_m_s).typical
    speed = _slowed_m_s(ship, speed_m_s, time - lead_in_s)
    whitener = np.eye(len(time))
    white = Noise(variance, WHITE, *damping_of(ship, speed))
    whiten(rows, whitener, noise_of(learnt, 0, rows, white, int(np.searchsorted(time, lead_in_s))))
    shaken = np.linalg.inv(whitener.T)
    sailed = np.tril(np.broadcast_to(speed * np.diff(time, prepend=time[0]), shaken.shape))
    wandered = sailed @ _yaw_wander(time) @ sailed.T
    return np.asarray(shaken @ shaken.T + wandered, np.float64)


def _slowed_m_s(ship: Ship, speed_m_s: float, after_s: Float64) -> Float64:
    """Return the speed (n,) some time after the stop, by her baseline in calm deep water."""
    speed = speed_m_s * np.geomspace(1.0, _SLOWEST, _SPEEDS)
    inertia = 1.0 + ship.n_r(np.clip(speed, *ship.baseline_range_m_s))
    glided_s = cumulative_trapezoid(inertia / stated_r(ship, speed), -speed, initial=0.0)
    return np.interp(after_s, glided_s, speed)


def _yaw_wander(time_s: Float64) -> Float64:
    """
    Return the covariance (n, n) of what a heading, and the course with it, wanders by.

    A steady record shows it while she is steered with way on, not as she glides.
    """
    apart = np.abs(time_s[:, None] - time_s) / priors.YAW_WANDERS_S.mean
    return priors.YAW_WANDERS.sd**2 * np.exp(-apart)


def damping_of(ship: Ship, speed_m_s: Float64) -> tuple[Float64, Float64]:
    """
    Return how a ship's speed answers a small force.

    Parameters
    ----------
    ship
        With a baseline.
    speed_m_s : (n,)
        Through water.

    Returns
    -------
    damping_1_s, inertia : (n,)
        dr/dv / (1 + n_r) and 1 + n_r of the baseline.
    """
    low, high = ship.baseline_range_m_s
    speed = np.clip(speed_m_s, max(low, 1e-3 * high), high)
    step = 1e-3 * speed
    above, below = np.minimum(speed + step, high), np.maximum(speed - step, low)
    rise = ship.resistance_n(above) - ship.resistance_n(below)
    inertia = 1.0 + ship.n_r(speed)
    damping = np.maximum(rise / (above - below), 0.0) / (ship.mass_kg * inertia)
    return np.maximum(damping, 1e-6), inertia


_BIN_S = 60.0
_GUSTY = 1.6  # of the median change from bin to bin: gusts outlast a bin
_DEEP_DRAUGHTS = 8.0  # of water: from there on its depth does not matter
_STANDS_SD = 2.0  # standard deviations by which a free propeller that stands is odd
_SHORTEST_S = 0.1  # fall of a shaft


@dataclass(frozen=True)
class Stop:
    """
    What the context is counted from.

    Attributes
    ----------
    since_ns
        Time 0 of the observation [ns].
    lead_in_s
        Time of the stop [s].
    heading_rad, speed_m_s
        In the lead-in.
    shaft_s
        Time constant of the shaft as it was seen to run down; 0: not seen.
    sd_s
        How well the time of the stop is known.
    """

    since_ns: int
    lead_in_s: float
    heading_rad: float
    speed_m_s: float
    shaft_s: float = 0.0
    sd_s: float = 0.0


_NO_ROWS = Rows(np.empty(0), np.empty(0, np.int64), np.empty(0)), np.empty(0)


@dataclass(frozen=True)
class Context:
    """
    Condensed context of one run.

    Attributes
    ----------
    stop
    value : (c,)
        Places to port [m], air ahead and to port [m/s], logarithm of the depth in draughts, shaft
        speed over the steady one, whether it stands, yaw from the first heading
        [rad], and the logarithm of the time constant of the shaft's fall [s].
    whitener : (c, c)
        Lower triangular.
    port_s : (a,)
        Times of the places to port, from the start of the steady record.
    at_port, at_wind, at_shaft, at_yaw
        Times of the observation that rows are nearest to.
    draught_m
        None where there is no row of depth.
    odd
        Whether a shaft that stands is odd: the baseline's propeller is free.
    run_down_s
        Of the thrust as the ship file states it; None where there is no row of the fall.
    depth_m
        Of the water, the median; None where it is not measured.
    turns
        Whether the water is seen to turn the shaft.
    """

    stop: Stop
    value: Float64
    whitener: Float64
    port_s: Float64
    at_port: NDArray[np.intp]
    at_wind: NDArray[np.intp]
    at_shaft: NDArray[np.intp]
    at_yaw: NDArray[np.intp]
    draught_m: float | None
    turns: bool
    odd: bool = False
    run_down_s: float | None = None
    depth_m: float | None = None

    @classmethod
    def of(
        cls,
        window: Window,
        ship: Ship,
        times: Float64,
        stop: Stop,
        port: tuple[Rows, Float64] = _NO_ROWS,
    ) -> Context:
        """
        Condense what a window holds.

        Parameters
        ----------
        window
            Of the coastdown.
        ship
            For the draught and the run-down of the thrust.
        times : (m,)
            Of the observation [s].
        stop
            What the context is counted from.
        port
            Places to port, and the variance of their white noise.

        Returns
        -------
        Context
            Without rows of what was not measured.
        """
        edges = np.arange(0.0, times[-1] + _BIN_S, _BIN_S)
        wind_s, wind = _binned(window, 'wind_apparent', stop, edges)
        yaw_s, yaw = _binned(window, 'heading', stop, edges)
        depth = _binned(window, 'depth', stop, edges)[1]
        shaft_s, shaft, turns = _shaft(window, ship, stop, times[-1])
        places = port[0]
        values = [places.value, wind[:, 0], wind[:, 1]]
        blocks = [_port_covariance(*port, ship, stop)] if len(places.value) else []
        blocks += [_wind_covariance(wind[:, i], wind[:, 1 - i]) for i in range(2)]
        draught_m = ship.draught_m if len(depth) else None
        if draught_m is not None:
            draughts = float(np.median(depth)) / draught_m
            values.append(np.log([min(draughts, _DEEP_DRAUGHTS)]))
            blocks.append(np.array([[priors.DEPTH_READ.sd**2]]))
        if len(shaft):
            values += [shaft, np.array([0.0])]
            blocks.append(np.eye(len(shaft)) * priors.SHAFT.sd**2 + priors.SHAFT_OFF.sd**2)
            blocks.append(np.eye(1))
        values.append(np.angle(np.exp(1j * (yaw[:, 0] - stop.heading_rad))))
        # what she yaws by from bin to bin, and what she and her compass wander by
        blocks.append(_yaw_wander(yaw_s) + np.eye(len(yaw_s)) * priors.YAW.sd**2)
        run_down_s = ship.propulsion.run_down_s if ship.propulsion and stop.shaft_s else None
        if run_down_s is not None:
            values.append(np.log([stop.shaft_s]))
            blocks.append(np.array([[priors.SHAFT_FALL.sd**2]]))
        last = len(times) - 1
        return cls(
            stop,
            np.concatenate(values),
            _whitener(blocks),
            places.time_s,
            np.searchsorted(times, places.time_s),
            np.searchsorted(times, wind_s).clip(max=last),
            np.searchsorted(times, shaft_s).clip(max=last),
            np.searchsorted(times, yaw_s).clip(max=last),
            draught_m,
            turns,
            not turns and (ship.propeller is None or ship.propeller.state_in_baseline == 'free'),
            run_down_s,
            float(np.median(depth)) if len(depth) else None,
        )

    def __len__(self) -> int:
        return len(self.value)

    def predict(self, columns: Columns, actions: Sequence[Action], stop_s: Float64) -> Float64:
        """
        Return what columns predict, (k, c).

        Parameters
        ----------
        columns
            Of one simulation.
        actions
            What acts in each column.
        stop_s : (k,) or one
            Time of the stop [s].

        Returns
        -------
        (k, c)
            A line a column, in the order of `value`.
        """
        stops_s = np.broadcast_to(stop_s, len(actions))[:, None]
        cos, sin = math.cos(self.stop.heading_rad), math.sin(self.stop.heading_rad)
        place = columns.radar_position_m[:, self.at_port]
        velocity = columns.velocity_over_ground_m_s[:, self.at_wind]
        air = np.array([action.wind_m_s for action in actions])
        east, north = (air[:, None, :] - velocity).transpose(2, 0, 1)
        parts = [cos * place[..., 1] - sin * place[..., 0]]
        parts += [cos * east + sin * north, cos * north - sin * east]
        if self.draught_m is not None:
            depth = np.array([action.depth_m for action in actions]) / self.draught_m
            parts.append(np.log(np.clip(depth, 1.0, _DEEP_DRAUGHTS))[:, None])
        if len(self.at_shaft):
            parts += self._shafts(columns, actions, stops_s)
        after = columns.time_s[self.at_yaw] - stops_s
        yaw = np.zeros_like(after)
        for i, action in enumerate(actions):
            for turn in action.turns:
                if turn.rate_rad_s:  # a force that goes by the time is many turns without one
                    yaw[i] += turn.turned_rad(after[i])
        parts.append(yaw)
        if self.run_down_s is not None:
            parts.append(np.array([[self._log_fall(self.run_down_s, each)] for each in actions]))
        return np.concatenate(parts, axis=1)

    @staticmethod
    def _log_fall(run_down_s: float, action: Action) -> float:
        """Return the logarithm of the time constant of the shaft's fall."""
        fraction = action.residual_fraction
        own = max(run_down_s + action.run_down_change_s, 0.0)
        fall_s = (1.0 - fraction) * own + fraction * action.residual_decay_s
        return math.log(max(fall_s, _SHORTEST_S))

    def _shafts(
        self, columns: Columns, actions: Sequence[Action], stop_s: Float64
    ) -> list[Float64]:
        """Return shaft speeds over the steady one, and how odd it is that the shaft stands."""
        after = columns.time_s[self.at_shaft] - stop_s
        speed = columns.speed_through_water_m_s[:, self.at_shaft]
        wanted = attrgetter(
            'stall_m_s', 'friction_m_s', 'free_shaft', 'residual_fraction', 'residual_decay_s'
        )
        asked = np.array([wanted(action) for action in actions])
        stall, friction, free, fraction, decay_s = asked.T[:, :, None]
        stands = np.where(stall > 0.0, stall, friction)  # of another propeller, or the baseline's
        turned = free * speed / self.stop.speed_m_s * turning(speed, stands)
        if not self.turns:
            turned[stall[:, 0] == 0.0] = 0.0
        driven = fraction * np.exp(-after / np.maximum(decay_s, 1e-3))
        odd = np.where(stall == 0.0, _STANDS_SD if self.odd else 0.0, 0.0)
        return [turned + (1.0 - turned) * driven, odd]


def _shaft(window: Window, ship: Ship, stop: Stop, end_s: float) -> tuple[Float64, Float64, bool]:
    """Return times and values of the shaft after its run-down, and whether the water turns it."""
    nothing = np.empty(0), np.empty(0), False
    if window.before is None or len(window.before.shaft) == 0:
        return nothing
    steady = float(np.median(np.abs(window.before.shaft.value)))
    run_down_s = ship.propulsion.run_down_s if ship.propulsion else _BIN_S
    fallen_s = stop.lead_in_s + RUN_DOWNS * max(run_down_s, stop.shaft_s)
    if steady <= 0.0 or end_s <= fallen_s:
        return nothing
    # a bin with readings from before holds some of the steady ones
    time_s, value = _binned(window, 'shaft', stop, np.arange(fallen_s, end_s + _BIN_S, _BIN_S))
    if not len(time_s):
        return nothing
    shaft = value[:, 0] / steady
    # soon after the fall, before it may stall
    turns = bool(np.median(shaft[:3]) > TURNS)
    return time_s, shaft, turns


def _binned(window: Window, name: str, stop: Stop, edges: Float64) -> tuple[Float64, Float64]:
    """Return times and mean values, (b,) and (b, columns)."""
    parts: list[Series] = [getattr(window, name)]
    if window.before is not None:
        parts.insert(0, getattr(window.before, name))
    time_s = np.concatenate([(part.time_ns - stop.since_ns) * 1e-9 for part in parts])
    value = np.concatenate([np.atleast_2d(part.value.T).T for part in parts])
    inside = (time_s >= edges[0]) & (time_s < edges[-1]) & np.isfinite(value).all(axis=1)
    if name == 'heading':
        value = np.unwrap(value, axis=0)
    if not inside.any():
        return np.empty(0), value[:0]
    found_s, found, _ = bin_means(time_s[inside], value[inside], edges)
    return found_s, found


def _wind_covariance(values: Float64, other: Float64) -> Float64:
    """
    Return a constant error of the true wind, wrong gain and direction, and what the bins scatter.

    Gain and direction go with what is felt, the ship's own way included: it is no other speed.
    """
    n = len(values)
    if n == 0:
        return np.zeros((0, 0))
    scatter = max(_GUSTY * float(np.median(np.abs(np.diff(values)))), 0.1) if n > 1 else 0.3
    turned = priors.WIND_TURNED.sd**2 * np.outer(other, other)
    gain = priors.WIND_GAIN.sd**2 * np.outer(values, values)
    return np.eye(n) * scatter**2 + priors.WIND_OFFSET.sd**2 + gain + turned


def _whitener(blocks: Sequence[Float64]) -> Float64:
    """Return the inverse Cholesky factor of a covariance of blocks."""
    found = [np.linalg.inv(np.linalg.cholesky(block)) for block in blocks if len(block)]
    return np.asarray(block_diag(*found, np.zeros((0, 0))), np.float64)


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
    stop = StopPrior(max(run.context.stop.sd_s, 1e-3), run.run_down_s, run.run_down_sd_s)
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
) -> Callable[[Sequence[Action], Float64 | float, Float64 | float], SimulatedRows]:
    first, length = frame.scenario.lead_in_s, frame.scenario.length_s

    def simulate(
        actions: Sequence[Action], speed_m_s: Float64 | float, later_s: Float64 | float
    ) -> SimulatedRows:
        stop_s = np.clip(first + later_s, 1.0, length - 1.0)  # within the record
        try:
            columns = simulate_columns(
                frame.ship,
                frame.scenario,
                actions,
                run.time_s,
                speed_m_s=speed_m_s,
                later_s=stop_s - first,
            )
        except SimulationError as error:  # of a speed that the baseline does not hold
            raise SimulationError(f'{run.name}: {error}') from error
        along, ahead = rows_of(run, columns)
        rest = run.context.predict(columns, actions, stop_s)
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
