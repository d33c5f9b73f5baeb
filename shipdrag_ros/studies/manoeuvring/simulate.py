# SPDX-License-Identifier: Apache-2.0
"""Manoeuvres of many ships in one compiled call."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import inf, isinf, radians
from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.manoeuvring.ship import FORM, SteeredShip

KINDS = ('zigzag', 'turn')


class Side(StrEnum):
    """Sides of a ship."""

    STARBOARD = 'starboard'
    PORT = 'port'

    @property
    def sign(self) -> float:
        """Of headings and yaw rates to this side."""
        return 1.0 if self is Side.STARBOARD else -1.0


@dataclass(frozen=True)
class Manoeuvre:
    """
    Rudder orders of a helmsman.

    Attributes
    ----------
    rudder_rad
        Size of each order.
    reverse_rad
        Heading at which the order changes sides; infinite: never.
    first
        Side of the first turn.
    """

    rudder_rad: float
    reverse_rad: float = inf
    first: Side = Side.STARBOARD

    @property
    def name(self) -> str:
        """As `parse` reads it."""
        kind = 'turn' if isinf(self.reverse_rad) else 'zigzag'
        return f'{kind}:{np.degrees(self.rudder_rad):g}'


@dataclass(frozen=True)
class ManoeuvreMotion:
    """
    Motion of one ship through a manoeuvre.

    Attributes
    ----------
    time_s : (n,)
        From the first order on.
    surge_m_s, sway_m_s : (n,)
        Speed ahead and to starboard.
    yaw_rate_rad_s, heading_rad : (n,)
        To starboard positive.
    position_m : (n, 2)
        Ahead and to starboard of where the first order was given.
    rudder_rad : (n,)
        Positive where it turns the ship to starboard.
    """

    time_s: Float64
    surge_m_s: Float64
    sway_m_s: Float64
    yaw_rate_rad_s: Float64
    heading_rad: Float64
    position_m: Float64
    rudder_rad: Float64


@dataclass(frozen=True)
class Motions:
    """
    Motions of k ships at the same times.

    Attributes
    ----------
    time_s : (n,)
    speeds : (k, n, 3)
        Surge and sway [m/s], yaw rate [rad/s].
    position_m : (k, n, 2)
    heading_rad, rudder_rad : (k, n)
        All as in `ManoeuvreMotion`.
    """

    time_s: Float64
    speeds: Float64
    position_m: Float64
    heading_rad: Float64
    rudder_rad: Float64

    def __len__(self) -> int:
        return len(self.speeds)

    def __getitem__(self, column: int) -> ManoeuvreMotion:
        surge, sway, yaw = self.speeds[column].T
        return ManoeuvreMotion(
            time_s=self.time_s,
            surge_m_s=surge,
            sway_m_s=sway,
            yaw_rate_rad_s=yaw,
            heading_rad=self.heading_rad[column],
            position_m=self.position_m[column],
            rudder_rad=self.rudder_rad[column],
        )


def zigzag(angle_deg: float, *, first: Side = Side.STARBOARD) -> Manoeuvre:
    """
    Return a zigzag of equal rudder and heading angles.
    """
    return Manoeuvre(radians(angle_deg), radians(angle_deg), first)


def turn(angle_deg: float, *, first: Side = Side.STARBOARD) -> Manoeuvre:
    """
    Return a turning circle.
    """
    return Manoeuvre(radians(angle_deg), first=first)


def parse(text: str) -> Manoeuvre:
    """
    Read `zigzag:15` or `turn:35`, the angle in degrees; first to starboard.

    Raises
    ------
    SimulationError
        If it is neither; how far the rudder goes is the ship's, see `steer`.
    """
    kind, separator, size = text.partition(':')
    try:
        angle = float(size)
    except ValueError:
        angle = np.nan
    if kind not in KINDS or not separator or not np.isfinite(angle):
        raise SimulationError(
            f'manoeuvre {text!r}, expected zigzag:ANGLE or turn:ANGLE with the degrees of rudder; '
            'write zigzag:15, for instance'
        )
    return zigzag(angle) if kind == 'zigzag' else turn(angle)


def overshoots_rad(motion: ManoeuvreMotion, manoeuvre: Manoeuvre) -> Float64:
    """
    Return by how much the heading exceeds that of the reversal, each time.

    Returns
    -------
    (m,)
        First to the side of the first turn, then by turns.
    """
    heading, rate = motion.heading_rad, motion.yaw_rate_rad_s
    ends = np.flatnonzero((rate[1:-1] * rate[2:] < 0.0) | (rate[1:-1] == 0.0)) + 1
    between = rate[ends] - rate[ends + 1]
    step = np.diff(motion.time_s)[ends]
    # the heading is a parabola between two samples
    peak = heading[ends] + 0.5 * step * rate[ends] ** 2 / np.where(between == 0.0, 1.0, between)
    over = np.abs(peak) - manoeuvre.reverse_rad
    side = manoeuvre.first.sign
    found = []
    for sign, beyond in zip(np.sign(peak), over):
        # wiggles on the way count neither as a turn nor twice
        if sign == side and beyond >= 0.0:
            found.append(beyond)
            side = -side
    return np.array(found)


STATES = 7  # of a path: u, v, r, x, y, heading, rudder
MotionState = tuple[float, float, float, float, float, float, float]


class HullModel(NamedTuple):
    """
    What all columns share.

    Attributes
    ----------
    length_m, speed_m_s
    surge_inertia
        m' - X'udot.
    sway_by_y, sway_by_n, yaw_by_y, yaw_by_n
        Inverse of the inertia in sway and yaw.
    rate_rad_s, lag_s
        Rudder machine.
    """

    length_m: float
    speed_m_s: float
    surge_inertia: float
    sway_by_y: float
    sway_by_n: float
    yaw_by_y: float
    yaw_by_n: float
    rate_rad_s: float
    lag_s: float


class Helm(NamedTuple):
    """
    What the helmsman does: both manoeuvres are one rule.

    Attributes
    ----------
    order_rad
        Size of each order.
    reverse_rad
        Heading at which the order changes sides; infinite: never.
    first
        1: first to starboard, -1: to port.
    attentive
        True: the order changes at the very moment; else at the next look.
    step_s
        Of the integration.
    approach
        Steps with the rudder amidships before the first order.
    """

    order_rad: float
    reverse_rad: float
    first: float
    attentive: bool
    step_s: float
    approach: int


@compiled
def _accelerations(
    hull: HullModel, c: Float64, du: float, v: float, r: float, d: float
) -> tuple[float, float, float]:
    """
    Return du/dt, dv/dt, dr/dt in SI.

    `du` is the change of speed; `c` the derivatives in the order of `FORM`.
    """
    square = (hull.speed_m_s + du) ** 2 + v * v
    speed = np.sqrt(square)
    u, v, r = du / speed, v / speed, r * hull.length_m / speed
    vv, uu, dd = v * v, u * u, d * d
    surge = (
        u * (c[0] + u * (c[1] + u * c[2]))
        + vv * c[3]
        + r * (r * c[4] + v * c[7])
        + dd * (c[5] + u * c[6])
        + v * d * (c[8] + u * c[9])
    )
    sway = (
        v * (c[10] + vv * c[12] + u * c[14])
        + r * (c[11] + vv * c[13] + u * c[15])
        + d * (c[16] + dd * c[17] + u * c[18] + uu * c[19] + v * d * c[20] + vv * c[21])
        + (c[22] + u * c[23] + uu * c[24])
    )
    yaw = (
        v * (c[25] + vv * c[27] + u * c[29])
        + r * (c[26] + vv * c[28] + u * c[30])
        + d * (c[31] + dd * c[32] + u * c[33] + uu * c[34] + v * d * c[35] + vv * c[36])
        + (c[37] + u * c[38] + uu * c[39])
    )
    force = square / hull.length_m
    return (
        force * surge / hull.surge_inertia,
        force * (hull.sway_by_y * sway + hull.sway_by_n * yaw),
        force / hull.length_m * (hull.yaw_by_y * sway + hull.yaw_by_n * yaw),
    )


@compiled
def _rudder(hull: HullModel, d: float, ordered: float, after_s: float) -> float:
    """Return the angle some time later: it moves at its largest rate, then as a lag does."""
    gap = ordered - d
    nearest = hull.rate_rad_s * hull.lag_s
    ramp_s = (abs(gap) - nearest) / hull.rate_rad_s
    if after_s <= ramp_s:
        return float(d + np.copysign(hull.rate_rad_s, gap) * after_s)
    if ramp_s > 0.0:
        return float(ordered - np.copysign(nearest, gap) * np.exp((ramp_s - after_s) / hull.lag_s))
    return float(ordered - gap * np.exp(-after_s / hull.lag_s))


@compiled
def _step(
    hull: HullModel, c: Float64, state: MotionState, ordered: float, h: float
) -> MotionState:
    """Return the state a step later, in which the rudder moves smoothly."""
    du, v, r, x, y, heading, d = state
    e = 0.5 * h
    middle_d, end_d = _rudder(hull, d, ordered, e), _rudder(hull, d, ordered, h)
    du1, v1, r1 = _accelerations(hull, c, du, v, r, d)
    du2, v2, r2 = _accelerations(hull, c, du + e * du1, v + e * v1, r + e * r1, middle_d)
    du3, v3, r3 = _accelerations(hull, c, du + e * du2, v + e * v2, r + e * r2, middle_d)
    du4, v4, r4 = _accelerations(hull, c, du + h * du3, v + h * v3, r + h * r3, end_d)
    end_du = du + h * (du1 + 2.0 * (du2 + du3) + du4) / 6.0
    end_v = v + h * (v1 + 2.0 * (v2 + v3) + v4) / 6.0
    end_heading = heading + h * (r + h * (r1 + r2 + r3) / 6.0)
    # no force depends on the place: Simpson's rule on the way
    start = _over_ground(hull, du, v, heading)
    middle = _over_ground(hull, du + e * du2, v + e * v2, heading + e * (r + 0.5 * e * r1))
    end = _over_ground(hull, end_du, end_v, end_heading)
    return (
        end_du,
        end_v,
        r + h * (r1 + 2.0 * (r2 + r3) + r4) / 6.0,
        x + h * (start[0] + 4.0 * middle[0] + end[0]) / 6.0,
        y + h * (start[1] + 4.0 * middle[1] + end[1]) / 6.0,
        end_heading,
        end_d,
    )


@compiled
def _over_ground(hull: HullModel, du: float, v: float, heading: float) -> tuple[float, float]:
    cos, sin = np.cos(heading), np.sin(heading)
    ahead = hull.speed_m_s + du
    return ahead * cos - v * sin, ahead * sin + v * cos


@compiled
def _advance(
    hull: HullModel, c: Float64, state: MotionState, ordered: float, h: float
) -> MotionState:
    """Return the state a time later, in two steps where the rudder leaves its largest rate."""
    ramp_s = abs(ordered - state[6]) / hull.rate_rad_s - hull.lag_s
    if 0.0 < ramp_s < h:
        state = _step(hull, c, state, ordered, ramp_s)
        h -= ramp_s
    after: MotionState = _step(hull, c, state, ordered, h)
    return after


@compiled
def _reached(before: MotionState, after: MotionState, heading: float, h: float) -> float:
    """Return the part of a step after which a heading is reached."""
    low, high = 0.0, 1.0
    gain = after[5] - before[5]
    start, end = h * before[2], h * after[2]
    rises = gain > 0.0
    for _ in range(50):
        p = 0.5 * (low + high)
        # cubic through headings and yaw rates at both ends
        q = 1.0 - p
        at = before[5] + p * p * (3.0 - 2.0 * p) * gain + p * q * (q * start - p * end)
        if (at >= heading) == rises:
            high = p
        else:
            low = p
    return high


@compiled
def _follow(
    hull: HullModel, helm: Helm, c: Float64, steps: int, looks: int, path: Float64
) -> None:
    """Fill the path (n, STATES) of one ship, with so many looks between two rows."""
    state = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for _ in range(helm.approach):
        state = _advance(hull, c, state, 0.0, helm.step_s)
    # places count from the first order, headings from the course before
    state = (state[0], state[1], state[2], 0.0, 0.0, state[5], state[6])
    side = helm.first
    for row in range(len(path)):
        for i in range(STATES):
            path[row, i] = state[i]
        if row == len(path) - 1:
            break
        for _ in range(looks):
            if side * state[5] >= helm.reverse_rad:
                side = -side
            for _ in range(steps):
                # the derivatives count a rudder that turns the ship to port positive
                after = _advance(hull, c, state, -side * helm.order_rad, helm.step_s)
                if helm.attentive and side * after[5] >= helm.reverse_rad:
                    p = _reached(state, after, side * helm.reverse_rad, helm.step_s)
                    state = _advance(hull, c, state, -side * helm.order_rad, p * helm.step_s)
                    side = -side
                    after = _advance(
                        hull, c, state, -side * helm.order_rad, (1.0 - p) * helm.step_s
                    )
                state = after


@compiled
def follow_columns(
    hull: HullModel, helm: Helm, derivatives: Float64, steps: int, looks: int, paths: Float64
) -> None:
    """
    Follow ships from steady sailing through one manoeuvre.

    Parameters
    ----------
    derivatives : (k, 40)
        In the order of `FORM`.
    steps
        Of the integration between two looks of the helmsman.
    looks
        Of the helmsman between two rows of a path.
    paths : (k, n, STATES)
        Filled with u, v, r, x, y, heading and rudder angle, u the change of
        speed; SI.

    Notes
    -----
    Runge-Kutta of fourth order, each step between two kinks of the rudder.
    """
    for column in range(len(derivatives)):
        _follow(hull, helm, derivatives[column], steps, looks, paths[column])


_STEP_S = 0.5  # of the integration; the rudder, quickest of all, is followed exactly
_LONGEST_APPROACH_S = 3600.0


def steer(
    ship: SteeredShip,
    manoeuvre: Manoeuvre,
    derivatives: Float64 | None = None,
    *,
    sample_s: float = 0.5,
    samples: int = 1200,
    control_s: float = 0.1,
    approach_s: float = 0.0,
) -> Motions:
    """
    Simulate a manoeuvre of k ships that differ in their derivatives.

    Parameters
    ----------
    ship
        What they have in common; they begin in steady sailing at its speed.
    manoeuvre
        Rudder angles [rad] and headings [rad] at which they are ordered.
    derivatives : (k, 40), optional
        In the order of `FORM`; those of the ship alone by default.
    sample_s, samples
        How often and how many times to look at the motion, from the first
        order on.
    control_s
        How often the helmsman looks at the heading and orders the rudder; 0:
        he reverses it at the very moment.
    approach_s
        How long the rudder is amidships before the first order, to the nearest
        step of 0.5 s at most; the propeller alone turns the ship meanwhile.

    Returns
    -------
    Motions
        Not finite from where a ship cannot be simulated, as after a change
        of derivatives that makes her accelerate without end.

    Raises
    ------
    SimulationError
        If the rudder does not go as far as is ordered, the times do not fit each
        other, or the derivatives the form.

    Notes
    -----
    S3; equations and rudder machine after Fossen (1994): forces are polynomials
    in the dimensionless change of speed, sway, yaw rate and rudder angle, times
    powers of the momentary speed and the length.

    Examples
    --------
    >>> import math
    >>> from shipdrag_ros.studies.manoeuvring.simulate import turn
    >>> from shipdrag_ros.studies.manoeuvring.ship import mariner
    >>> from shipdrag_ros.studies.manoeuvring.simulate import steer
    >>> ship = mariner()
    >>> motions = steer(ship, turn(math.radians(20.0)))
    >>> motions.position_m.shape
    (1, 1200, 2)
    """
    limit_rad = ship.rudder.limit_rad
    if not 0.0 < manoeuvre.rudder_rad <= limit_rad * (1.0 + 1e-9):
        raise SimulationError(
            f'manoeuvre {manoeuvre.name!r}, expected more than 0 and at most '
            f'{np.degrees(limit_rad):g} degrees of rudder, which is as far as it goes'
        )
    looks = round(sample_s / control_s) if control_s > 0.0 else 1
    look_s = control_s or sample_s
    # written so that NaN fails
    if not (0.0 < sample_s < np.inf and looks >= 1 and np.isclose(looks * look_s, sample_s)):
        raise SimulationError(
            f'sample_s is {sample_s!r} and control_s {control_s!r}, expected a sample after a '
            'whole number of looks, or 0 for control_s'
        )
    if not 0.0 <= approach_s <= _LONGEST_APPROACH_S:
        raise SimulationError(
            f'approach_s is {approach_s!r}, expected 0 to {_LONGEST_APPROACH_S:g} s'
        )
    if samples < 2:
        raise SimulationError(f'samples is {samples!r}, expected 2 or more')
    table = np.atleast_2d(ship.values if derivatives is None else derivatives)
    if table.ndim != 2 or table.shape[1] != len(FORM):
        raise SimulationError(
            f'derivatives have the shape {table.shape}, expected (k, {len(FORM)})'
        )
    steps = max(1, int(np.ceil(look_s / _STEP_S - 1e-9)))
    helm = Helm(
        manoeuvre.rudder_rad,
        manoeuvre.reverse_rad,
        manoeuvre.first.sign,
        attentive=control_s == 0.0,
        step_s=look_s / steps,
        approach=round(approach_s * steps / look_s),
    )
    paths = np.empty((len(table), samples, STATES))
    follow_columns(
        _hull(ship),
        helm,
        np.ascontiguousarray(table, np.float64),
        steps,
        looks,
        paths,
    )
    paths[..., 0] += ship.speed_m_s
    return Motions(
        sample_s * np.arange(samples, dtype=np.float64),
        paths[..., :3],
        paths[..., 3:5],
        paths[..., 5],
        -paths[..., 6],
    )


def _hull(ship: SteeredShip) -> HullModel:
    added, machine = ship.inertial, ship.rudder
    inertia = np.array(
        [
            [ship.mass - added.Yvdot, ship.mass * ship.gravity_centre - added.Yrdot],
            [ship.mass * ship.gravity_centre - added.Nvdot, ship.yaw_inertia - added.Nrdot],
        ]
    )
    (sway_by_y, sway_by_n), (yaw_by_y, yaw_by_n) = np.linalg.inv(inertia).tolist()
    return HullModel(
        length_m=ship.length_m,
        speed_m_s=ship.speed_m_s,
        surge_inertia=ship.mass - added.Xudot,
        sway_by_y=sway_by_y,
        sway_by_n=sway_by_n,
        yaw_by_y=yaw_by_y,
        yaw_by_n=yaw_by_n,
        rate_rad_s=machine.rate_rad_s,
        lag_s=machine.lag_s,
    )
