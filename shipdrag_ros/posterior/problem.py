# SPDX-License-Identifier: Apache-2.0
"""
One run under the model: rows, motion, unknowns and the families of their priors.

A family is a hypothesis, or one size of what a hypothesis leaves open, with its prior
probability. All families share the rows and the unknowns.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from shipdrag_ros.inference.noise import WHITE, Noise
from shipdrag_ros.inference.rows import KIND_COUNT, LOG, POSITION, Rows
from shipdrag_ros.parameter import WIDER, WIDER_CHANCE, Declared
from shipdrag_ros.posterior import motion, priors
from shipdrag_ros.posterior.law import HELD, HullLaw, Influence, InfluenceState, wave_with_friction
from shipdrag_ros.posterior.motion import EXTRAS, Forces
from shipdrag_ros.posterior.weather import Weather
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import CoefficientBaseline, Ship

_STEPS = 80  # of the integration, longer as the ship slows down
_SPREAD = 25.0  # of all over the time from which steps grow
_STEPS_A_RUN_DOWN = 3.0
_VAGUE_SPEED, _VAGUE_S = 0.3, 300.0  # of the steady speed, and of where she was
EXACT = 1e-8  # sd of what does not act, so that every prior is proper


@dataclass(frozen=True)
class StopPrior:
    """
    What is known of the stop beforehand; times count from it.

    Attributes
    ----------
    sd_s
        Of its time; 0: it is before the first row, and no thrust is left.
    run_down_s, run_down_sd_s
        Of the shaft; 0: not known.
    stands
        Whether all shafts that are read stand after it: then no thrust is left.
    """

    sd_s: float
    run_down_s: float
    run_down_sd_s: float
    stands: bool = False


@dataclass(frozen=True)
class Family:
    """
    A prior of all unknowns: mean and precision (p,), and the probability of the family.

    `level` is that of the hull over the generic one, about which the prior is; `usual` says
    whether wind and depth are in their first state, and no scale is wrong.
    """

    name: str
    chance: float
    mean: Float64
    precision: Float64
    level: float = 1.0
    usual: bool = True


@dataclass(frozen=True)
class RunModel:
    """
    One run.

    Attributes
    ----------
    rows, white
        Readings and their white noise, the steady record first.
    steady
        How many rows are before the stop.
    forces, grid_s
        See `motion.predict`.
    start : (p,)
        Where the search begins.
    families
    low_m_s, speed_m_s
        At the end and at the stop, roughly.
    law
    influences
        What else acts, a force, wind and depth: their columns are the last ones.
    """

    rows: Rows
    white: Noise
    steady: int
    forces: Forces
    grid_s: Float64
    start: Float64
    families: tuple[Family, ...]
    low_m_s: float
    speed_m_s: float
    law: HullLaw
    influences: tuple[Influence, ...] = ()

    @property
    def of_hull(self) -> int:
        """How many of the coefficients are of the hull, before those of what else acts."""
        return self.coefficients - sum(len(each.columns) for each in self.influences)

    @property
    def coefficients(self) -> int:
        """How many of the unknowns are coefficients of forces."""
        return int(self.forces.columns.shape[1])

    @cached_property
    def free(self) -> Int64:
        """Which unknowns some family leaves open."""
        least = np.min([each.precision for each in self.families], axis=0)
        return np.flatnonzero(least < EXACT**-2.0 / 4.0)

    @cached_property
    def taught(self) -> tuple[Family, ...]:
        """One family a hypothesis, with its mean and variance: noise is learnt by these."""
        names = dict.fromkeys(each.name for each in self.families)
        return tuple(
            _merged(name, [each for each in self.families if each.name == name]) for name in names
        )

    @property
    def usual(self) -> RunModel:
        """The same with wind, depth and scales as they usually are: a fit climbs there."""
        return replace(self, families=tuple(each for each in self.families if each.usual))

    @classmethod
    def of(
        cls,
        rows: Rows,
        variance: Float64,
        steady: int,
        ship: Ship,
        stop: StopPrior,
        *,
        speeds_m_s: tuple[float, float, float],
        weather: Weather | None = None,
        geodetic: Iterable[int] = (),
    ) -> RunModel:
        """
        Set up the model of a run.

        Parameters
        ----------
        rows
            In ascending time from the stop as it is thought to be.
        variance : (n,)
            Of their white noise.
        steady
            How many of them are before the stop.
        ship
        stop
        speeds_m_s
            Roughly: the lowest, that at the stop, and the highest that the law reaches, of other
            runs too.
        weather
            None: wind and depth are part of r, no unseen force acts and no scale is wrong.
        geodetic
            Codes of the positions that are latitude and longitude.
        """
        low_m_s, speed_m_s, high_m_s = speeds_m_s
        law = HullLaw.of(ship, low_m_s, high_m_s)
        tau_s = _tau_s(stop)
        adds: tuple[Influence, ...] = ()
        if weather is not None:
            adds = _held(law, speed_m_s), *weather.influences(ship, law.speed_m_s)
        forces = law.forces(ship, tau_s, adds)
        end = float(rows.time_s[-1]) + 3.0 * stop.sd_s
        ones = np.ones(len(variance))
        k = forces.columns.shape[1]
        kinds = frozenset(np.unique(rows.kind).tolist())
        start = np.zeros(k + EXTRAS + max(map(motion.own, kinds)))
        start[k + motion.SPEED] = speed_m_s
        start[k + motion.THRUST] = priors.THRUST.mean
        for code in kinds:
            if code % KIND_COUNT == POSITION:
                place = rows.value[rows.kind == code]
                at = np.searchsorted(rows.time_s[rows.kind == code], 0.0)
                start[k + motion.own(code) + motion.PLACE] = place[min(int(at), len(place) - 1)]
        scales = _scales(kinds, geodetic) if weather is not None else {}
        families = tuple(_all_families(ship, law, adds, stop, start[k:], kinds, scales))
        found = cls(
            rows,
            Noise(variance, WHITE, ones, ones),
            steady,
            forces,
            _grid(end, tau_s),
            start,
            families,
            low_m_s,
            speed_m_s,
            law,
            adds,
        )
        start[:k] = families[0].mean[:k]
        return found


def _merged(name: str, families: list[Family]) -> Family:
    """Return a normal prior with the mean and variance of a mixture."""
    chance = np.array([each.chance for each in families])
    total, part = float(chance.sum()), chance / chance.sum()
    means = np.array([each.mean for each in families])
    mean = part @ means
    variance = part @ (1.0 / np.array([each.precision for each in families]) + (means - mean) ** 2)
    return Family(name, total, mean, 1.0 / variance)


def _tau_s(stop: StopPrior) -> float:
    if stop.run_down_s > 0.0:
        return stop.run_down_s
    return priors.RUN_DOWN.mean if stop.sd_s > 0.0 else 0.0


def _grid(end_s: float, tau_s: float) -> Float64:
    """Return the times of the integration."""
    spread = end_s / _SPREAD
    steps = _STEPS
    if tau_s > 0.0:
        # the first step is spread ln(1 + _SPREAD) / steps
        most = max(tau_s / _STEPS_A_RUN_DOWN, end_s / 2000.0)
        spread = min(spread, most * steps / math.log1p(end_s / spread))
    result: Float64 = spread * np.expm1(np.linspace(0.0, math.log1p(end_s / spread), steps + 1))
    return result


def _extras(
    ship: Ship, stop: StopPrior, start: Float64, kinds: frozenset[int]
) -> tuple[Float64, Float64]:
    """Return mean and sd of the unknowns that are no coefficients; alike in all families."""
    mean, sd = start.copy(), np.full(len(start), EXACT)
    sd[motion.SPEED] = _VAGUE_SPEED * mean[motion.SPEED]
    base = ship.baseline
    if base is None or base.relative_sd_of == 'resistance':
        sd[motion.INERTIA] = max(ship.added_mass.sd, EXACT)
    if stop.sd_s > 0.0:
        sd[motion.STOP] = stop.sd_s
        sd[motion.THRUST] = priors.THRUST.sd
        sd[motion.TAU] = priors.RUN_DOWN.sd
        if stop.run_down_s > 0.0:
            shape = priors.RUN_DOWN_SHAPE.sd
            sd[motion.TAU] = math.hypot(shape, stop.run_down_sd_s / stop.run_down_s)
    if any(code % KIND_COUNT != LOG for code in kinds):
        sd[motion.CURRENT] = priors.CURRENT.sd * priors.sheltered(mean[motion.SPEED])
    for code in kinds:
        own = motion.own(code)
        if code % KIND_COUNT == POSITION:
            sd[own + motion.PLACE] = _VAGUE_S * mean[motion.SPEED]
        elif code % KIND_COUNT == LOG:
            sd[own + motion.SCALE] = priors.LOG_SCALE.sd
            sd[own + motion.OFFSET] = priors.LOG_OFFSET.sd
            mean[own + motion.LAG], sd[own + motion.LAG] = priors.any_log_lag()
        else:
            lag = priors.GROUND_LAG
            mean[own + motion.GROUND_LAG], sd[own + motion.GROUND_LAG] = lag.mean, lag.sd
    return mean, sd


def _all_families(
    ship: Ship,
    law: HullLaw,
    influences: Sequence[Influence],
    stop: StopPrior,
    start: Float64,
    kinds: frozenset[int],
    wrong_scales: Mapping[int, Declared],
) -> Iterator[Family]:
    extra_mean, extra_sd = _extras(ship, stop, start, kinds)
    zeros = np.zeros(len(law.shapes) + len(law.humps) + len(law.dry))
    states = tuple(product(*(each.states for each in influences)))
    added = sum(len(each.columns) for each in influences)
    extra = 2 + len(zeros) + added
    for hull, state in product(_hulls(ship), states):
        others = [each.mean for each in state]
        mean = np.concatenate([[each[0] for each in hull.scales], zeros, *others, extra_mean])
        sizes = np.full(len(law.shapes), hull.size)
        humps = np.full(len(law.humps), hull.level * priors.GENERIC_HUMPS.sd)
        dry = np.full(len(law.dry), max(hull.dry, priors.SHIP_DRY.mean))
        others = [each.sd for each in state]
        scales = [each[1] for each in hull.scales]
        precision = np.concatenate([scales, sizes, humps, dry, *others, extra_sd]) ** -2.0
        chance = hull.chance * math.prod(each.chance for each in state)
        usual = all(each is of.states[0] for each, of in zip(state, influences))
        for lag, force, wrong in product(
            _lags(kinds), _after_stop(stop, added, hull.level), _wrong_scales(wrong_scales)
        ):
            own, known = mean.copy(), precision.copy()
            for place, prior_mean, prior_sd in (*lag.unknown, *force.unknown, *wrong.unknown):
                own[extra + place], known[extra + place] = prior_mean, prior_sd**-2.0
            part = chance * lag.chance * force.chance * wrong.chance
            plain = usual and not wrong.unknown
            yield Family(force.name or hull.name, part, own, known, hull.level, plain)


class _Option(NamedTuple):
    """
    One of some that exclude each other: of an unknown its place behind the coefficients, mean, sd.
    """

    chance: float
    unknown: tuple[tuple[int, float, float], ...] = ()
    name: str = ''


def _after_stop(stop: StopPrior, added: int, level: float) -> Iterator[_Option]:
    """Yield what acts after the stop and no input shows; `added` columns begin with `_held`."""
    if added == 0 or stop.sd_s == 0.0:  # the window is given: who gives it says that she glides
        yield _Option(1.0)
        return
    held, left = priors.HELD_CHANCE.mean, 0.0 if stop.stands else priors.LEFT_CHANCE.mean
    yield _Option(1.0 - held - left)
    force, thrust = priors.HELD, priors.LEFT
    yield _Option(held, ((-added, force.mean, level * force.sd),), priors.HELD_FORCE)
    if left > 0.0:
        yield _Option(left, ((motion.LEFT, thrust.mean, thrust.sd),), priors.THRUST_LEFT)


def _held(law: HullLaw, speed_m_s: float) -> Influence:
    """
    Return a force that no speed changes, over r of a hull of level 1 at the stop.

    It acts in few families.
    """
    at_stop = np.interp(speed_m_s, law.speed_m_s, law.parts.sum(axis=0))
    none, unit = np.zeros(len(law.speed_m_s)), np.full((1, len(law.speed_m_s)), at_stop)
    state = InfluenceState(1.0, np.zeros(1), np.full(1, EXACT))
    return Influence(HELD, none, unit, (state,))


def _lags(kinds: frozenset[int]) -> Iterator[_Option]:
    """Yield the filter of a log: none, or one."""
    if LOG not in kinds:
        yield _Option(1.0)
        return
    unfiltered = priors.UNFILTERED_CHANCE.mean
    for chance, lag in (
        (unfiltered, priors.LOG_UNFILTERED),
        (1.0 - unfiltered, priors.LOG_LAG),
    ):
        yield _Option(chance, ((motion.LAG, lag.mean, lag.sd),))


def _scales(kinds: Iterable[int], geodetic: Iterable[int]) -> dict[int, Declared]:
    """Return, by the place of the unknown, the scales that may be wrong."""
    of_earth = set(map(motion.own, geodetic))
    found = {}
    for code in sorted(kinds):
        own = motion.own(code)
        if code % KIND_COUNT == LOG:
            found[own + motion.SCALE] = priors.WRONG_LOG_SCALE
        elif own not in of_earth:
            found[own + motion.GROUND_SCALE] = priors.WRONG_GROUND_SCALE
    return found


def _wrong_scales(scales: Mapping[int, Declared]) -> Iterator[_Option]:
    """Yield which instrument is in a wrong scale: none, or one."""
    chance = priors.WRONG_SCALE.mean
    yield _Option(1.0 - chance * len(scales))
    for place, size in scales.items():
        yield _Option(chance, ((place, size.mean, size.sd),))


class _Hull(NamedTuple):
    """
    What a hull may be: mean and sd of both scales, size of s, level of the generic parts, and
    sd of the forces that water does not make.
    """

    name: str
    chance: float
    scales: tuple[tuple[float, float], tuple[float, float]]
    size: float
    level: float = 1.0
    dry: float = 0.0


def _generic_hulls() -> Iterator[_Hull]:
    """Yield hulls without a baseline: a ship, or another craft of a level that is not known."""
    friction, wave = priors.GENERIC_FRICTION, priors.GENERIC_WAVE

    def scales(level: float) -> tuple[tuple[float, float], tuple[float, float]]:
        return (
            (level * (1.0 + friction.mean) - 1.0, level * friction.sd),
            (level * (1.0 + wave.mean) - 1.0, level * wave.sd),
        )

    ships = (1.0 - priors.ANOTHER_CHANCE.mean) / len(priors.WIDE)
    for size in priors.WIDE:
        yield _Hull(priors.SMOOTH, ships, scales(1.0), size)
    others = priors.ANOTHER_CHANCE.mean / len(priors.ANOTHER_LEVELS) / len(priors.ANOTHER_SHAPES)
    for level, size in product(priors.ANOTHER_LEVELS, priors.ANOTHER_SHAPES):
        yield _Hull(priors.ANOTHER_CRAFT, others, scales(level), level * size, level, level)


def _hulls(ship: Ship) -> Iterator[_Hull]:
    """Yield what hulls may be."""
    base = ship.baseline
    unsure = priors.LAW_ERROR.sd
    if base is None:
        yield from _generic_hulls()
        return
    if isinstance(base, CoefficientBaseline):
        alone = base.relative_sd.wave * math.sqrt(1.0 - base.relative_sd.correlation**2)
        sds = max(base.relative_sd.friction, EXACT), max(alone, EXACT)
    else:
        sds = max(base.relative_sd, EXACT), EXACT
    with_it = wave_with_friction(ship)  # what is more of friction alone is not of the waves
    tails = (1.0, 1.0 - WIDER_CHANCE), (WIDER, WIDER_CHANCE)
    for (wide, chance), (size, part) in product(tails, priors.HALF_NORMAL):
        stated = ((0.0, wide * sds[0]), (0.0, wide * sds[1]))
        yield _Hull(
            priors.NOTHING, priors.CHANCES[priors.NOTHING] * chance * part, stated, size * unsure
        )
    share = priors.CHANCES[priors.FRICTION_ALONE] / len(priors.LOG_UNIFORM)
    for (wide, chance), more, (size, part) in product(
        tails, priors.LOG_UNIFORM, priors.HALF_NORMAL
    ):
        of_wave = 0.0 - with_it * more, math.hypot(with_it * more, wide * sds[1])
        scales = ((more, math.hypot(more, sds[0])), of_wave)
        shape = math.hypot(size * unsure, priors.SHAPE_OF_MORE.mean * more)
        yield _Hull(priors.FRICTION_ALONE, share * chance * part, scales, shape)
    chance = priors.CHANCES[priors.SMOOTH] / len(priors.LOG_UNIFORM)
    for size in priors.LOG_UNIFORM:
        # friction, waves and shape all differ
        wide = math.hypot(size, with_it * size, sds[1]) if sds[1] > EXACT else EXACT
        scales = ((0.0, math.hypot(size, sds[0])), (0.0, wide))
        yield _Hull(priors.SMOOTH, chance, scales, size)


def families_declared() -> Iterator[tuple[str, float, str, str, str]]:
    """
    Yield the families of a ship whose baseline states 2 % of friction and 10 % of waves.

    Yields
    ------
    tuple
        Name, probability, mean and sd of both scales, size of s, as text.
    """
    ship = Ship.example()
    for which in (ship, replace(ship, baseline=None)):
        for name, chance, scales, size, *_ in _hulls(which):
            friction, wave = (f'{mean + 0.0:g} ± {sd:.2g}' for mean, sd in scales)
            beside = name if which.baseline is not None else f'{name}, no baseline'
            yield beside, chance, friction, wave, f'{size:.2g}'
