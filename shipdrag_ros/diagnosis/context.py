# SPDX-License-Identifier: Apache-2.0
"""
What is measured besides the motion along the heading: places to port, wind, depth, shaft, heading.

It strikes hypotheses out, or makes them sure: an anemometer that feels no wind
speaks against a wind whatever the ship does.

The noise of places to port is that of the steady record before the stop, colour included: what a
coastdown leaves over a fit would hold the very effect that is sought. Beside it stands
what a ship wanders by as she glides, which no steady record shows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.linalg import block_diag

from shipdrag_ros.estimation.run_down import TURNS
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.inference.learning import learn, of_steady
from shipdrag_ros.inference.noise import WHITE, Noise, noise_of, whiten
from shipdrag_ros.inference.rows import Rows, bin_means
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.law import stated_r
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Action, Columns
from shipdrag_ros.simulation.columns import RUN_DOWNS
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

    def predict(self, columns: Columns, actions: Sequence[Action], stop_s: float) -> Float64:
        """
        Return what columns predict, (k, c).

        Parameters
        ----------
        columns
            Of one simulation.
        actions
            What acts in each column.
        stop_s
            Time of the stop [s].

        Returns
        -------
        (k, c)
            A line a column, in the order of `value`.
        """
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
            parts += self._shafts(columns, actions, stop_s)
        after = columns.time_s[self.at_yaw] - stop_s
        yaw = np.zeros((len(actions), len(after)))
        for i, action in enumerate(actions):
            for turn in action.turns:
                yaw[i] += turn.turned_rad(after)
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

    def _shafts(self, columns: Columns, actions: Sequence[Action], stop_s: float) -> list[Float64]:
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
