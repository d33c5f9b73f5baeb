# SPDX-License-Identifier: Apache-2.0
"""
What happens in a simulation: speeds, engine orders, turns, disturbances.

The time of the record starts at 0; orders and turns are timed from the end of
the lead-in, where the engine is stopped by default.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, pairwise
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from shipdrag_ros.compiled import compiled
from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import Float64


@dataclass(frozen=True)
class GaussMarkov:
    """
    Stationary Gauss-Markov process of first order, AR(1) when sampled.

    Attributes
    ----------
    sd
        Standard deviation, in the unit of what is disturbed.
    correlation_time_s
        Lag at which the correlation has fallen to 1/e.
    """

    sd: float
    correlation_time_s: float

    def problems(self) -> list[str]:
        """
        Say what is impossible about it.
        """
        problems = []
        if not 0.0 <= self.sd < np.inf:
            problems.append(f'sd is {self.sd!r}, expected 0 or more')
        if not 0.0 < self.correlation_time_s < np.inf:
            time_s = self.correlation_time_s
            problems.append(f'correlation_time_s is {time_s!r}, expected more than 0')
        return problems

    def sample(self, time_s: Float64, rng: np.random.Generator) -> Float64:
        """
        Draw one realisation (n,) at ascending times (n,), even or not.
        """
        white = rng.standard_normal(len(time_s))
        decay = np.exp(-np.diff(time_s) / self.correlation_time_s)
        return self.sd * _filter(white, decay)


@compiled
def _filter(white: Float64, decay: Float64) -> Float64:
    result = white.copy()
    for i in range(1, len(result)):
        phi = decay[i - 1]
        result[i] = phi * result[i - 1] + np.sqrt(1.0 - phi * phi) * white[i]
    return result


@dataclass(frozen=True)
class EngineOrder:
    """
    A change of engine power; thrust and shaft approach it as exp(-t/run_down).

    Attributes
    ----------
    time_s
        After the lead-in.
    shaft
        Shaft speed, as a fraction of the steady one.
    thrust
        Thrust, as a fraction of the steady one.
    """

    time_s: float
    shaft: float
    thrust: float


STOP = EngineOrder(0.0, shaft=0.0, thrust=0.0)


@dataclass(frozen=True)
class Turn:
    """
    A turn at a constant rate, which grows and falls evenly at its edges.

    Attributes
    ----------
    start_s
        Where the rate has grown to half, after the lead-in.
    duration_s
        Until it has fallen to half; the course changes by rate times duration.
    rate_rad_s
        Yaw rate, anticlockwise positive.
    drag_area_m2
        Resistance while turning is 0.5 rho drag_area u |u| larger.
    rudder_rad
        Rudder angle while turning.
    edge_s
        In which rate, drag and rudder grow, and fall; 0: at once.
    """

    start_s: float
    duration_s: float
    rate_rad_s: float
    drag_area_m2: float = 0.0
    rudder_rad: float = 0.0
    edge_s: float = 0.0

    @property
    def end_s(self) -> float:
        """After the lead-in."""
        return self.start_s + self.duration_s

    @cached_property
    def corners_s(self) -> tuple[float, float, float, float]:
        """Where its edges begin and end, after the lead-in."""
        half = 0.5 * self.edge_s
        return self.start_s - half, self.start_s + half, self.end_s - half, self.end_s + half

    def share(self, after_lead_in_s: ArrayLike) -> Float64:
        """
        Return how far rate, drag and rudder have grown, 0..1.
        """
        result: Float64 = shares([self], after_lead_in_s)[0]
        return result

    def turned_rad(self, after_lead_in_s: ArrayLike) -> Float64:
        """
        Return by how much the course has changed.
        """
        time = np.asarray(after_lead_in_s, np.float64)
        begins, _, falls, _ = self.corners_s
        return self.rate_rad_s * (self._risen_s(time - begins) - self._risen_s(time - falls))

    def _risen_s(self, since_s: Float64) -> Float64:
        """Return the integral of what grows to 1 within an edge."""
        positive = np.maximum(since_s, 0.0)
        if self.edge_s == 0.0:
            return positive
        within = np.minimum(positive, self.edge_s)
        return positive - within + 0.5 * within**2 / self.edge_s


def shares(turns: Sequence[Turn], after_lead_in_s: ArrayLike) -> Float64:
    """
    Return how far rate, drag and rudder of each turn have grown, 0..1.

    Parameters
    ----------
    turns
        t of them.
    after_lead_in_s
        Times of any shape [s].

    Returns
    -------
    (t, ...)
    """
    time = np.asarray(after_lead_in_s, np.float64)
    corners = np.reshape([turn.corners_s for turn in turns], (-1, 4)).T
    begins, grown, falls, ends = corners.reshape(4, -1, *[1] * time.ndim)
    with np.errstate(divide='ignore', invalid='ignore'):
        risen = np.clip((time - begins) / (grown - begins), 0.0, 1.0)
        fallen = np.clip((time - falls) / (ends - falls), 0.0, 1.0)
    at_once = (grown <= begins) | (ends <= falls)  # an edge of nothing, or lost beside the times
    result: Float64 = np.where(at_once, (time >= begins) & (time < ends), risen - fallen)
    return result


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """
    One simulated record.

    Attributes
    ----------
    speed_m_s
        Steady speed through water in the lead-in.
    lead_in_s, duration_s
        Length of the steady sailing and of what follows.
    heading_rad
        Yaw at the start, REP-103: from east, anticlockwise.
    shaft_rad_s
        Shaft speed in the lead-in.
    current_m_s
        Velocity of the water over ground, to the east and to the north.
    depth_m
        Water depth.
    day
        Day of the end of the lead-in, counted from 1970-01-01 UTC; of what goes by the date.
    orders
        Engine orders in the order of time; none: steady sailing throughout.
    turns
        Turns; where two overlap, they add.
    water_speed
        Slow disturbance of the water's velocity along the ship [m/s].
    gust_force
        Slow disturbance of the force along the ship [N], driving positive.
    seed
        Of the disturbances.

    Raises
    ------
    SimulationError
        Naming every value that is impossible.
    """

    speed_m_s: float
    lead_in_s: float = 600.0
    duration_s: float = 1500.0
    heading_rad: float = 0.0
    shaft_rad_s: float = 11.5
    current_m_s: tuple[float, float] = (0.0, 0.0)
    depth_m: float = 200.0
    day: float = 20605.0
    orders: tuple[EngineOrder, ...] = (STOP,)
    turns: tuple[Turn, ...] = ()
    water_speed: GaussMarkov | None = None
    gust_force: GaussMarkov | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        problems = list(self._problems())
        if problems:
            raise SimulationError('scenario: ' + '; '.join(problems))

    def _problems(self) -> Iterator[str]:
        for name in ('speed_m_s', 'lead_in_s', 'duration_s', 'shaft_rad_s', 'depth_m', 'day'):
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0.0):
                yield f'{name} is {value!r}, expected 0 or more'
        if not isfinite(self.heading_rad):
            yield f'heading_rad is {self.heading_rad!r}, expected finite'
        if not all(map(isfinite, self.current_m_s)):
            yield f'current_m_s is {self.current_m_s!r}, expected finite'
        if self.speed_m_s == 0.0 or self.lead_in_s + self.duration_s == 0.0:
            yield 'speed and length of the record must not be 0'
        times = [order.time_s for order in self.orders]
        ascending = all(early < late for early, late in zip([-np.inf, *times], times))
        if not ascending or any(time < -self.lead_in_s for time in times):
            yield f'orders are at {times}, expected ascending and within the record'
        for turn in self.turns:
            corners = (-self.lead_in_s, *turn.corners_s)
            if not all(early <= late for early, late in pairwise(corners)):
                yield f'a turn is at {turn.corners_s}, expected ascending and within the record'
        fractions = [(order.shaft, order.thrust) for order in self.orders]
        if not all(map(isfinite, chain(*fractions))):
            yield f'orders are {self.orders!r}, expected finite fractions'
        rates = [(turn.rate_rad_s, turn.drag_area_m2, turn.rudder_rad) for turn in self.turns]
        if not all(map(isfinite, chain(*rates))):
            yield f'turns are {self.turns!r}, expected finite values'
        for name, noise in ('water_speed', self.water_speed), ('gust_force', self.gust_force):
            if noise is not None:
                yield from (f'{name}: {problem}' for problem in noise.problems())

    @property
    def length_s(self) -> float:
        """Length of the record."""
        return self.lead_in_s + self.duration_s

    def events_s(self) -> list[float]:
        """
        Return the record times at which an order or a turn begins or ends.
        """
        moments = {self.moment_s(order.time_s) for order in self.orders}
        for turn in self.turns:
            moments |= {self.moment_s(time_s) for time_s in turn.corners_s}
        return sorted(moments)

    def moment_s(self, after_lead_in_s: float) -> float:
        """
        Return the record time; the same digits wherever it is compared.
        """
        return self.lead_in_s + after_lead_in_s

    def shaft_fraction(self, time_s: ArrayLike, *, run_down_s: float) -> Float64:
        """
        Return shaft speed over the steady one, at record times.

        It follows the orders with a first-order lag, from 1 in the lead-in.
        """
        time = np.asarray(time_s, np.float64)
        result = np.ones_like(time)

        def decay(elapsed: Float64) -> Float64:
            # before an order the value is not used, and must not overflow
            late = np.maximum(elapsed, 0.0)
            return np.exp(-late / run_down_s) if run_down_s > 0.0 else np.zeros_like(late)

        level, target, since = 1.0, 1.0, -np.inf
        for order in self.orders:
            moment = self.moment_s(order.time_s)
            level = target + (level - target) * float(decay(np.asarray(moment - since)))
            target, since = order.shaft, moment
            value = target + (level - target) * decay(time - since)
            result = np.where(time >= since, value, result)
        return result

    def thrust_ordered(self, time_s: float) -> float:
        """
        Return the thrust that is approached at a record time, over the steady one.
        """
        given = [order for order in self.orders if self.moment_s(order.time_s) <= time_s]
        return given[-1].thrust if given else 1.0

    def heading(self, time_s: ArrayLike) -> Float64:
        """
        Return the yaw [rad], unwrapped, at record times.
        """
        time = np.asarray(time_s, np.float64)
        yaw = np.full_like(time, self.heading_rad)
        for turn in self.turns:
            if turn.rate_rad_s:  # a force that goes by the time is many turns without one
                yaw += turn.turned_rad(time - self.lead_in_s)
        return yaw

    def rudder(self, time_s: ArrayLike) -> Float64:
        """
        Return the rudder angle [rad] at record times.
        """
        time = np.asarray(time_s, np.float64)
        angle = np.zeros_like(time)
        for turn in self.turns:
            angle += turn.rudder_rad * turn.share(time - self.lead_in_s)
        return angle
