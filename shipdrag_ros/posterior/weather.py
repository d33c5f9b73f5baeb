# SPDX-License-Identifier: Apache-2.0
"""
Wind and depth of a run: what they add to r(u), as far as they are measured or stated.

Each is an ensemble of forces over the speed, drawn at fixed points of what is not known: the wind
and its reading, the air drag of the ship, the depth and its formula. Its mean is a force without
an unknown, its principal parts are columns of the law. Without a reading there are two states,
little of it or as much as the effect of the library has, with the probability of each.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.polynomial.hermite_e import hermegauss

from shipdrag_ros.parameter import TAILS, Prior
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.law import (
    ABOVE,
    DEPTH,
    WIND,
    Influence,
    InfluenceState,
    stated_r,
    usual_baseline,
)
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import AIR_DENSITY_KG_M3, Ship
from shipdrag_ros.simulation.effect import Effect, Frame
from shipdrag_ros.simulation.effects import LIBRARY
from shipdrag_ros.simulation.scenario import Scenario

_TABLE = 33  # speeds at which the effect of the depth is tabulated, up to _FROUDE
_FROUDE = 0.45
_NEGLIGIBLE = 0.1  # size of a principal part, of the largest
_MOST = 2  # principal parts
_EACH = 6  # of the speeds, by which they are found


class Knowledge(StrEnum):
    """What is known of wind, depth or waves."""

    MEASURED = 'measured'
    STATED = 'stated'
    UNKNOWN = 'unknown'


@dataclass(frozen=True)
class Reference:
    """
    What is known of the conditions of a run, from which those of calm deep water follow.
    """

    wind: Knowledge = Knowledge.UNKNOWN
    depth: Knowledge = Knowledge.UNKNOWN
    waves: Knowledge = Knowledge.UNKNOWN

    @property
    def unknown(self) -> tuple[str, ...]:
        """Which of wind and depth are not known."""
        return self._of(Knowledge.UNKNOWN)

    @property
    def measured(self) -> tuple[str, ...]:
        """Which of wind and depth were read."""
        return self._of(Knowledge.MEASURED)

    def _of(self, known: Knowledge) -> tuple[str, ...]:
        both = list(vars(self).items())[:2]
        return tuple(name for name, how in both if how is known)


class MeasuredWind(NamedTuple):
    """
    Air that moves against the ship beside her own way, as an anemometer has it.

    Attributes
    ----------
    speed_m_s : (b,)
        Ascending; at each of them, while she slows down:
    head_m_s, cross_m_s : (b,)
        From ahead, and across.
    """

    speed_m_s: Float64
    head_m_s: Float64
    cross_m_s: Float64


@dataclass(frozen=True)
class Weather:
    """
    Conditions of a run.

    Attributes
    ----------
    wind
        None where no anemometer is read.
    depth_m
        None where no echo sounder is read.
    """

    wind: MeasuredWind | None
    depth_m: float | None

    def reference(self, ship: Ship) -> Reference:
        """Return what is known, with what the ship file states."""
        return Reference(
            _how(self.wind is not None, _denial(measured_by('wind_apparent'), ship)),
            _how(self.depth_m is not None, _denial(measured_by('depth'), ship)),
            _how(False, max(_fact(ship, 'no_waves'), _fact(ship, 'calm'))),
        )

    def influences(self, ship: Ship, speed_m_s: Float64) -> tuple[Influence, Influence]:
        """
        Return what wind and depth add to r over a grid of speeds.

        Parameters
        ----------
        ship
        speed_m_s : (m,)
            From 0 on.
        """
        return _of_wind(self.wind, ship, speed_m_s), _of_depth(self.depth_m, ship, speed_m_s)


def _how(measured: bool, rate: float) -> Knowledge:
    if measured:
        return Knowledge.MEASURED
    return Knowledge.STATED if rate > 0.0 else Knowledge.UNKNOWN


def measured_by(name: str) -> Effect:
    """
    Return the effect of the library that an input measures.
    """
    return next(each for each in LIBRARY.values() if name in each.struck_out_by)


def _fact(ship: Ship, name: str) -> float:
    """Return how often a fact that is stated is wrong; 0 where it is not stated."""
    return max((fact.rate for fact in ship.facts if fact.name == name), default=0.0)


def _denial(effect: Effect, ship: Ship) -> float:
    """Return how often the fact that denies an effect is wrong; 0 where none is stated."""
    names = [name for name, said in effect.facts.items() if not said.values]
    return max((_fact(ship, name) for name in names), default=0.0)


def _chance(prior: float, effect: Effect, ship: Ship) -> float:
    """Return the probability of an effect, with what a fact says."""
    rate = _denial(effect, ship)
    odds = prior / (1.0 - prior) * (rate if rate > 0.0 else 1.0)
    return odds / (1.0 + odds)


@lru_cache(maxsize=8)
def _nodes(*counts: int) -> tuple[Float64, Float64]:
    """Return points (n, d) of independent standard normals, and their weights (n,)."""
    each = [hermegauss(count) for count in counts]
    points = np.array(list(product(*(x for x, _ in each))))
    weight = np.array([math.prod(w) for w in product(*(w for _, w in each))])
    return points, weight / weight.sum()


def _influence(
    name: str, ensembles: Sequence[tuple[float, Float64, Float64]], inertia: float = 0.0
) -> Influence:
    """
    Return mean and principal parts of ensembles.

    Parameters
    ----------
    name
        `WIND` or `DEPTH`.
    ensembles
        Of each state: its probability, weights (n,) and forces (n, m).
    inertia
    """
    known = sum(chance * (weight @ force) for chance, weight, force in ensembles)
    away = np.vstack(
        [np.sqrt(chance * weight)[:, None] * (f - known) for chance, weight, f in ensembles]
    )
    left, size, _ = np.linalg.svd(away[:, ::_EACH], full_matrices=False)
    kept = np.flatnonzero(size[:_MOST] > max(_NEGLIGIBLE * size[0], 1e-12))
    columns = left[:, kept].T @ away / size[kept, None]
    states = []
    for chance, weight, force in ensembles:
        amount = (force - known)[:, ::_EACH] @ columns[:, ::_EACH].T
        mean = weight @ amount
        sd = np.sqrt(weight @ (amount - mean) ** 2)
        states.append(InfluenceState(chance, mean, np.maximum(sd, 1e-9)))
    return Influence(name, np.asarray(known), columns, tuple(states), inertia)


def _air_per_mass(ship: Ship, z: Float64) -> Float64:
    """Return the force of air of 1 m/s at points of what is not known of it."""
    if ship.air is None:
        usual = priors.AIR_AREA.prior
        assert isinstance(usual, Prior)
        area = np.array([usual.at(each) for each in z]) * ship.displaced_volume_m3 ** (2.0 / 3.0)
        return np.asarray(0.5 * AIR_DENSITY_KG_M3 * area / ship.mass_kg, np.float64)
    more: Float64 = 1.0 + measured_by('wind_apparent').formula_sd * z
    return more * float(ship.air_drag_n(1.0)) / ship.mass_kg


def _of_wind(measured: MeasuredWind | None, ship: Ship, speed: Float64) -> Influence:
    """Return the air drag beside that of air at rest."""

    def force(z_air: Float64, ahead: Float64, abeam: Float64) -> Float64:
        felt: Float64 = ahead * np.hypot(ahead, abeam) - speed**2
        return _air_per_mass(ship, z_air)[:, None] * felt

    if measured is not None:
        z, weight = _nodes(3, 3, 3, 3)
        off, gain, turned = priors.WIND_OFFSET.sd, priors.WIND_GAIN.sd, priors.WIND_TURNED.sd
        head, cross = (
            np.interp(speed, measured.speed_m_s, each)
            for each in (measured.head_m_s, measured.cross_m_s)
        )
        ahead = (1.0 + gain * z[:, 1:2]) * (speed + head) + off * z[:, 2:3]
        ahead = ahead + turned * z[:, 3:] * cross
        abeam = (1.0 + gain * z[:, 1:2]) * cross - turned * z[:, 3:] * (speed + head)
        return _influence(WIND, [(1.0, weight, force(z[:, 0], ahead, abeam))])
    effect = measured_by('wind_apparent')
    blows = _chance(priors.WINDY.mean, effect, ship)
    z, weight = _nodes(3, 5, 3)
    sheltered = priors.sheltered(float(speed[-1]) / ABOVE)
    light = priors.LIGHT_AIR.sd
    ensembles = []
    for chance, sds in (
        (1.0 - blows, (light, light)),
        (blows, tuple(each.prior.second for each in effect.parameters)),
    ):
        ahead, abeam = (sheltered * sd * each for sd, each in zip(sds, (z[:, 1:2], z[:, 2:])))
        forces = force(z[:, 0], speed + ahead, abeam)
        ensembles.append((chance, weight, forces))
    return _influence(WIND, ensembles)


def _of_depth(depth_m: float | None, ship: Ship, speed: Float64) -> Influence:
    """Return what water of some depth adds to r in deep water."""
    ship = with_usual_shape(ship)
    if depth_m is not None:
        z, weight = _nodes(3, 3)
        depths = depth_m * (1.0 + priors.DEPTH_READ.sd * z[:, 0])
        forces, inertia = _shallow(ship, tuple(depths.tolist()), speed)
        ensembles = [
            (chance, weight, forces * (1.0 + wide * priors.DEPTH_FORMULA.sd * z[:, 1:]))
            for wide, chance in TAILS
        ]
        # the most probable reading is the middle one
        return _influence(DEPTH, ensembles, float(inertia[len(z) // 2]))
    effect = measured_by('depth')
    shallow = _chance(effect.odds / (1.0 + effect.odds), effect, ship)
    z, weight = _nodes(5, 3)
    prior = effect.parameters_of(ship)[0].prior
    forces, inertia = _shallow(ship, tuple(prior.at(each) for each in z[:, 0]), speed)
    # its larger n_r too is a force here: the same deceleration
    own = 1.0 + ship.n_r(speed)
    deep = stated_r(ship, speed)
    whole = (deep + forces) * own / (own + inertia[:, None]) - deep
    whole = whole * (1.0 + effect.formula_sd * z[:, 1:])
    none = np.zeros((1, len(speed)))
    return _influence(DEPTH, [(1.0 - shallow, np.ones(1), none), (shallow, weight, whole)])


def with_usual_shape(ship: Ship) -> Ship:
    """
    Return a ship with a baseline, breadth and draught, usual ones where her file has none.
    """
    ship = usual_baseline(ship)
    if ship.breadth_m is not None and ship.draught_m is not None:
        return ship
    breadth = ship.breadth_m or ship.length_m / priors.LENGTH_OVER_BREADTH.mean
    draught = ship.draught_m or ship.displaced_volume_m3 / (
        priors.BLOCK.mean * ship.length_m * breadth
    )
    return replace(ship, breadth_m=breadth, draught_m=draught)


@lru_cache(maxsize=4)
def _shallow_table(ship: Ship, depths_m: tuple[float, ...]) -> tuple[Float64, Float64, Float64]:
    """Return speeds (t,), r that is added (n, t), and 1 + n_r that is added (n,)."""
    low, high = ship.baseline_range_m_s
    top = min(high, _FROUDE * float(ship.speed(1.0)))
    speed = np.linspace(max(low, 1e-3 * top), top, _TABLE)
    effect = measured_by('depth')
    frame = Frame(ship, Scenario(speed_m_s=top, duration_s=1.0), 0.0)
    actions = [effect.action(frame, depth) for depth in depths_m]
    forces = np.array([each.resistance_n(speed) for each in actions]) / ship.mass_kg
    return speed, forces, np.array([each.n_r_change for each in actions])


def _shallow(ship: Ship, depths_m: tuple[float, ...], speed: Float64) -> tuple[Float64, Float64]:
    """Return r that is added (n, m), beyond the table with the square of the speed."""
    at, forces, inertia = _shallow_table(ship, depths_m)
    inside = np.clip(speed, at[0], at[-1])
    found = np.array([np.interp(inside, at, force) for force in forces])
    return found * (speed / inside) ** 2, inertia
