# SPDX-License-Identifier: Apache-2.0
"""
Manoeuvres of many ships that are steered, in one compiled call: after Abkowitz.

The values of a ship are data: derivatives of her hull, and her rudder machine. Which derivatives
there are is the form of the model and stands in `FORM`, in the order in which the compiled
integration takes them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from importlib.resources import files
from math import inf, isinf, radians
from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import Float64
from shipdrag_ros.strict_yaml import load

# powers of the change of speed u, sway v, yaw rate r and rudder d, as the names spell them
FORM = (
    *('Xu', 'Xuu', 'Xuuu', 'Xvv', 'Xrr', 'Xdd', 'Xudd', 'Xrv', 'Xvd', 'Xuvd'),
    *('Yv', 'Yr', 'Yvvv', 'Yvvr', 'Yvu', 'Yru', 'Yd', 'Yddd', 'Yud', 'Yuud', 'Yvdd', 'Yvvd'),
    *('Y0', 'Y0u', 'Y0uu'),
    *('Nv', 'Nr', 'Nvvv', 'Nvvr', 'Nvu', 'Nru', 'Nd', 'Nddd', 'Nud', 'Nuud', 'Nvdd', 'Nvvd'),
    *('N0', 'N0u', 'N0uu'),
)


@dataclass(frozen=True)
class RudderMachine:
    """
    How the rudder follows an order.

    Attributes
    ----------
    limit_rad, rate_rad_s
        Largest angle and rate.
    lag_s
        Time constant below that rate.
    """

    limit_rad: float
    rate_rad_s: float
    lag_s: float


@dataclass(frozen=True, kw_only=True)
class SteeredShip:
    """
    Abkowitz's whole-ship model in surge, sway and yaw.

    Attributes
    ----------
    name, source
        Of the ship, and where the values come from.
    length_m
    speed_m_s
        That the derivatives are about.
    mass, yaw_inertia
    gravity_centre
        Ahead of amidships.
    rudder
    inertial
        Surge and sway forces and yaw moment by accelerations.
    viscous
        Forces on the hull and the rudder, by the names of `FORM`.
    multiples
        Derivatives that are exact multiples of another.

    Notes
    -----
    S3; Fossen (1994). All but length, speed and rudder machine are pure numbers of the prime
    system.
    """

    name: str
    source: str
    length_m: float
    speed_m_s: float
    mass: float
    yaw_inertia: float
    gravity_centre: float
    rudder: RudderMachine
    inertial: Mapping[str, float]
    viscous: Mapping[str, float]
    multiples: Mapping[str, str]

    @property
    def values(self) -> Float64:
        """The viscous derivatives (40,), in the order of `FORM`."""
        return np.array([self.viscous[name] for name in FORM])

    @property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """Derivatives that are one measurement, under the first of each."""
        return tuple(
            (name, *(other for other in FORM if self.multiples.get(other) == name))
            for name in FORM
            if name not in self.multiples
        )


_FORCES = {'X': 'surge force', 'Y': 'sway force', 'N': 'yaw moment'}
_MOTIONS = {'u': 'change of speed', 'v': 'sway', 'r': 'yaw', 'd': 'rudder'}


def meaning(name: str) -> str:
    """
    Say in words what a derivative of the form is.

    Parameters
    ----------
    name
        One of `FORM`: the force, and the powers of the motions that it grows with.

    Examples
    --------
    >>> from shipdrag_ros.studies.manoeuvring import meaning
    >>> meaning('Yvvr')
    'sway force by sway² x yaw'
    """
    force, motions = _FORCES[name[0]], name[1:].removeprefix('0')
    powers = {letter: motions.count(letter) for letter in dict.fromkeys(motions)}
    product = ' x '.join(
        _MOTIONS[letter] + {1: '', 2: '²', 3: '³'}[power] for letter, power in powers.items()
    )
    if name[1:2] != '0':
        return f'{force} by {product}'
    straight = f'{force} with the rudder amidships, sailing straight'
    return f'{straight}, by {product}' if product else straight


@cache
def mariner() -> SteeredShip:
    """
    Return the Mariner-class ship that comes with the package.
    """
    file = files('shipdrag_ros').joinpath('data', 'mariner.yaml')
    data = load(file.read_text(encoding='utf-8'))
    return SteeredShip(rudder=RudderMachine(**data.pop('rudder')), **data)


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
class Motions:
    """
    Motions of k ships at the same times; without the axis k that of one.

    Attributes
    ----------
    time_s : (n,)
        From the first order on.
    speeds : (k, n, 3)
        Speed ahead and to starboard [m/s], yaw rate [rad/s].
    position_m : (k, n, 2)
        Ahead and to starboard of where the first order was given.
    heading_rad : (k, n)
        To starboard positive.
    rudder_rad : (k, n)
        Positive where it turns the ship to starboard.
    """

    time_s: Float64
    speeds: Float64
    position_m: Float64
    heading_rad: Float64
    rudder_rad: Float64

    def __len__(self) -> int:
        return len(self.speeds)

    def __getitem__(self, column: int) -> Motions:
        _, *columns = vars(self).values()
        return Motions(self.time_s, *(each[column] for each in columns))


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
    kind, _, size = text.partition(':')
    make = {'zigzag': zigzag, 'turn': turn}.get(kind)
    try:
        angle = float(size)
    except ValueError:
        angle = np.nan
    if make is None or not np.isfinite(angle):
        raise SimulationError(
            f'manoeuvre {text!r}, expected zigzag:ANGLE or turn:ANGLE with the degrees of rudder; '
            'write zigzag:15, for instance'
        )
    return make(angle)


def overshoots_rad(motion: Motions, manoeuvre: Manoeuvre) -> Float64:
    """
    Return by how much the heading exceeds that of the reversal, each time.

    Returns
    -------
    (m,)
        First to the side of the first turn, then by turns.
    """
    heading, rate = motion.heading_rad, motion.speeds[:, 2]
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
# of each derivative: the force that it is of, and the motions that it is multiplied by
_FORCE_OF = np.array(['XYN'.index(name[0]) for name in FORM])
_FACTORS = np.array(
    [['uvrd0'.index(letter) for letter in name[1:].ljust(3, '0')] for name in FORM]
)


class HullModel(NamedTuple):
    """
    What all columns share: inverse of the inertia, length, speed, rate and lag of the rudder.
    """

    mobility: Float64
    length_m: float
    speed_m_s: float
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
def _rates(hull: HullModel, c: Float64, state: Float64, rudder: float) -> Float64:
    """
    Return the rates of the state in SI; `c` the derivatives (40,) in the order of `FORM`.
    """
    v, heading = state[1], state[5]
    ahead = hull.speed_m_s + state[0]
    square = ahead * ahead + v * v
    speed = np.sqrt(square)
    of = np.array((state[0] / speed, v / speed, state[2] * hull.length_m / speed, rudder, 1.0))
    forces = np.zeros(3)
    for i in range(len(c)):
        factors = of[_FACTORS[i, 0]] * of[_FACTORS[i, 1]] * of[_FACTORS[i, 2]]
        forces[_FORCE_OF[i]] += c[i] * factors
    rates = np.zeros(STATES - 1)
    for i in range(3):
        for j in range(3):
            rates[i] += hull.mobility[i, j] * forces[j]
    rates[:3] *= square / hull.length_m
    rates[2] /= hull.length_m
    cos, sin = np.cos(heading), np.sin(heading)
    rates[3] = ahead * cos - v * sin
    rates[4] = ahead * sin + v * cos
    rates[5] = state[2]
    return rates


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
def _step(hull: HullModel, c: Float64, state: Float64, ordered: float, h: float) -> Float64:
    """Return the state a step later, in which the rudder moves smoothly."""
    motion = state[:-1]
    middle, end = _rudder(hull, state[6], ordered, 0.5 * h), _rudder(hull, state[6], ordered, h)
    first = _rates(hull, c, motion, state[6])
    second = _rates(hull, c, motion + 0.5 * h * first, middle)
    third = _rates(hull, c, motion + 0.5 * h * second, middle)
    fourth = _rates(hull, c, motion + h * third, end)
    after = np.empty(STATES)
    after[:-1] = motion + h / 6.0 * (first + 2.0 * (second + third) + fourth)
    after[6] = end
    return after


@compiled
def _advance(hull: HullModel, c: Float64, state: Float64, ordered: float, h: float) -> Float64:
    """Return the state a time later, in two steps where the rudder leaves its largest rate."""
    ramp_s = abs(ordered - state[6]) / hull.rate_rad_s - hull.lag_s
    if 0.0 < ramp_s < h:
        state = _step(hull, c, state, ordered, ramp_s)
        h -= ramp_s
    return _step(hull, c, state, ordered, h)


@compiled
def _reached(before: Float64, after: Float64, heading: float, h: float) -> float:
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
    """
    Follow one ship from steady sailing through a manoeuvre.

    Fills the path (n, STATES), u the change of speed; so many looks of the helmsman between two
    rows, so many steps of the integration between two looks. Runge-Kutta of fourth order, each
    step between two kinks of the rudder.
    """
    state = np.zeros(STATES)
    for _ in range(helm.approach):
        state = _advance(hull, c, state, 0.0, helm.step_s)
    state[3:5] = 0.0  # places count from the first order, headings from the course before
    side = helm.first
    path[0] = state
    for row in range(1, len(path)):
        for _ in range(looks):
            if side * state[5] >= helm.reverse_rad:
                side = -side
            for _ in range(steps):
                # the derivatives count a rudder that turns the ship to port positive
                after = _advance(hull, c, state, -side * helm.order_rad, helm.step_s)
                if helm.attentive and side * after[5] >= helm.reverse_rad:
                    part = _reached(state, after, side * helm.reverse_rad, helm.step_s)
                    before_s = part * helm.step_s
                    state = _advance(hull, c, state, -side * helm.order_rad, before_s)
                    side = -side
                    left_s = helm.step_s - before_s
                    after = _advance(hull, c, state, -side * helm.order_rad, left_s)
                state = after
        path[row] = state


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
    >>> from shipdrag_ros.studies.manoeuvring import mariner, steer, turn
    >>> ship = mariner()
    >>> motions = steer(ship, turn(20.0))
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
    hull = _hull(ship)
    for column, path in zip(np.asarray(table, np.float64), paths):
        _follow(hull, helm, column, steps, looks, path)
    paths[..., 0] += ship.speed_m_s
    return Motions(
        sample_s * np.arange(samples, dtype=np.float64),
        paths[..., :3],
        paths[..., 3:5],
        paths[..., 5],
        -paths[..., 6],
    )


def _hull(ship: SteeredShip) -> HullModel:
    added, lever = ship.inertial, ship.mass * ship.gravity_centre
    inertia = [
        [ship.mass - added['Xudot'], 0.0, 0.0],
        [0.0, ship.mass - added['Yvdot'], lever - added['Yrdot']],
        [0.0, lever - added['Nvdot'], ship.yaw_inertia - added['Nrdot']],
    ]
    mobility = np.asarray(np.linalg.inv(inertia), np.float64)
    machine = ship.rudder
    return HullModel(mobility, ship.length_m, ship.speed_m_s, machine.rate_rad_s, machine.lag_s)
