# SPDX-License-Identifier: Apache-2.0
"""
One run under the model: rows, motion, unknowns and the families of their priors.

A family is a hypothesis, or one size of what a hypothesis leaves open, with its prior
probability. All families share the rows and the unknowns.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import chain, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.inference.linear import Families
from shipdrag_ros.inference.rows import KIND_COUNT, LOG, POSITION, WHITE, Noise, Rows
from shipdrag_ros.parameter import TAILS
from shipdrag_ros.posterior import motion, priors
from shipdrag_ros.posterior.law import HELD, HullLaw, Influence, InfluenceState, wave_with_friction
from shipdrag_ros.posterior.motion import EXTRAS, Forces
from shipdrag_ros.posterior.weather import Weather
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import CoefficientBaseline, Ship
from shipdrag_ros.simulation.effect import Action, Effect, Frame
from shipdrag_ros.simulation.effects import LIBRARY
from shipdrag_ros.simulation.scenario import Scenario

_STEPS = 80  # of the integration, longer as the ship slows down
_SPREAD = 25.0  # of all over the time from which steps grow
_STEPS_A_RUN_DOWN = 3.0
_VAGUE_SPEED, _VAGUE_S = 0.3, 300.0  # of the steady speed, and of where she was
_SOME = 0.1  # of what an effect does, to find it by that
_OF_LOG = {
    Action(log_factor=_SOME): motion.SCALE,
    Action(log_offset_m_s=_SOME): motion.OFFSET,
    Action(log_lag_s=_SOME): motion.LAG,
}
_OF_GROUND = {Action(radar_factor=_SOME): motion.GROUND_SCALE}
EXACT = 1e-8  # sd of what does not act, so that every prior is proper
LEFT_OPEN = EXACT**-2.0 / 4.0  # precision of what acts is less


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
    found
        Whether nobody claims that nothing but the water slows her after it.
    """

    sd_s: float
    run_down_s: float
    run_down_sd_s: float
    stands: bool = False
    found: bool = True


@dataclass(frozen=True)
class FamilySet:
    """
    Families, each a prior of all unknowns.

    Attributes
    ----------
    name : (f,)
        Of its hypothesis.
    chance : (f,)
    mean, precision : (f, p)
    level : (f,)
        Of the hull over the generic one, about which the prior is.
    usual : (f,)
        Whether wind and depth are in their first state, and no instrument is wrong.
    """

    name: NDArray[np.str_]
    chance: Float64
    mean: Float64
    precision: Float64
    level: Float64
    usual: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.chance)

    def of(self, which: NDArray[np.bool_]) -> FamilySet:
        """Return some of them."""
        return FamilySet(*(each[which] for each in vars(self).values()))

    def named(self, name: str) -> FamilySet:
        """Return those of a hypothesis."""
        return self.of(self.name == name)

    def about(self, now: Float64, free: Int64) -> Families:
        """Return what they say of the unknowns that are free, counted from some unknowns."""
        mean, precision = self.mean[:, free] - now[free], self.precision[:, free]
        return Families(mean, precision, np.log(self.chance))


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
    families: FamilySet
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
        return np.flatnonzero(self.families.precision.min(axis=0) < LEFT_OPEN)

    @property
    def free_forces(self) -> Int64:
        """Which of them are coefficients of forces: the first."""
        return self.free[self.free < self.coefficients]

    @cached_property
    def taught(self) -> FamilySet:
        """One family a hypothesis, with its mean and variance: noise is learnt by these."""
        names = [*dict.fromkeys(self.families.name.tolist())]
        merged = (_merged(self.families.named(name)) for name in names)
        chance, mean, precision = (np.array(each) for each in zip(*merged))
        every = np.ones(len(names))
        return FamilySet(np.array(names), chance, mean, precision, every, every > 0.0)

    @property
    def usual(self) -> RunModel:
        """The same with wind, depth and instruments as they usually are: a fit climbs there."""
        return replace(self, families=self.families.of(self.families.usual))

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
        wrong = [_Option(1.0)] if weather is None else [*_wrong(kinds, geodetic)]
        families = _all_families(ship, law, adds, stop, start[k:], kinds, wrong)
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
        start[:k] = families.mean[0, :k]
        return found


def _merged(families: FamilySet) -> tuple[float, Float64, Float64]:
    """Return probability, mean and precision of a mixture."""
    total, part = float(families.chance.sum()), families.chance / families.chance.sum()
    mean = part @ families.mean
    variance = part @ (1.0 / families.precision + (families.mean - mean) ** 2)
    return total, mean, 1.0 / variance


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
    wrong: Sequence[_Option],
) -> FamilySet:
    bases = [*product(_hulls(ship), product(*(each.states for each in influences)))]
    zeros = [0.0] * (len(law.shapes) + len(law.humps) + len(law.dry))
    means = [
        [*(each[0] for each in hull.scales), *zeros, *chain(*(each.mean for each in state))]
        for hull, state in bases
    ]
    sds = [
        [each[1] for each in hull.scales]
        + [hull.size] * len(law.shapes)
        + [hull.level * priors.GENERIC_HUMPS.sd] * len(law.humps)
        + [max(hull.dry, priors.SHIP_DRY.mean)] * len(law.dry)
        + [*chain(*(each.sd for each in state))]
        for hull, state in bases
    ]
    extra, added = len(means[0]), sum(len(each.columns) for each in influences)
    level = np.array([hull.level for hull, _ in bases])
    options = [
        (lag, force, bad)
        for force, bad in product(_after_stop(stop, added, level), wrong)
        for lag in (_lags(kinds) if motion.LAG not in bad.places else [_Option(1.0)])
    ]
    many = len(options)
    mean, sd = (
        np.repeat(np.hstack([each, np.tile(of_extra, (len(bases), 1))]), many, axis=0)
        for each, of_extra in zip((means, sds), _extras(ship, stop, start, kinds))
    )
    for j, option in enumerate(options):
        for place, prior_mean, prior_sd in chain(*(each.unknown for each in option)):
            mean[j::many, extra + place], sd[j::many, extra + place] = prior_mean, prior_sd
    chance = [hull.chance * math.prod(each.chance for each in state) for hull, state in bases]
    parts = [math.prod(each.chance for each in option) for option in options]
    usual = [
        all(each is of.states[0] for each, of in zip(state, influences)) for _, state in bases
    ]
    return FamilySet(
        np.array([force.name or hull.name for hull, _ in bases for _, force, _ in options]),
        np.outer(chance, parts).ravel(),
        mean,
        sd**-2.0,
        np.repeat(level, many),
        np.outer(usual, [not option[-1].unknown for option in options]).ravel(),
    )


class _Option(NamedTuple):
    """
    One of some that exclude each other: of an unknown its place behind the coefficients, mean, and
    sd, one each for the hulls where it differs.
    """

    chance: float
    unknown: tuple[tuple[int, float, float | Float64], ...] = ()
    name: str = ''

    @property
    def places(self) -> set[int]:
        """The unknowns that it is about."""
        return {place for place, *_ in self.unknown}


def _after_stop(stop: StopPrior, added: int, level: Float64) -> Iterator[_Option]:
    """Yield what acts after the stop and no input shows; `added` columns begin with `_held`."""
    if added == 0 or not stop.found:
        yield _Option(1.0)
        return
    ended = stop.stands or stop.sd_s == 0.0  # of which no thrust is left
    held, left = priors.HELD_CHANCE.mean, 0.0 if ended else priors.LEFT_CHANCE.mean
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


def _wrong(kinds: Iterable[int], geodetic: Iterable[int]) -> Iterator[_Option]:
    """
    Yield what is wrong with an instrument: nothing, or what one effect of the library says.

    The library's parameters stand as normal priors.
    """
    of_earth, effects = set(map(motion.own, geodetic)), dict[int, Effect]()
    for code in sorted(kinds):
        own = motion.own(code)
        for action, place in (_OF_LOG if code % KIND_COUNT == LOG else _OF_GROUND).items():
            effect = _doing(action)
            if effect.in_geodetic or own not in of_earth:
                effects[own + place] = effect
    nothing = 1.0 / (1.0 + sum(each.odds for each in effects.values()))
    yield _Option(nothing)
    for place, effect in effects.items():
        yield _Option(nothing * effect.odds, ((place, *effect.parameters[0].prior.moments()),))


@cache
def _doing(action: Action) -> Effect:
    """Return the effect of the library that does this and nothing else."""
    frame = Frame(Ship.example(), Scenario(speed_m_s=1.0), 0.0)
    return next(
        each
        for each in LIBRARY.values()
        if len(each.parameters) == 1 and each.action(frame, _SOME) == action
    )


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
    for (wide, chance), (size, part) in product(TAILS, priors.HALF_NORMAL):
        stated = ((0.0, wide * sds[0]), (0.0, wide * sds[1]))
        yield _Hull(
            priors.NOTHING, priors.CHANCES[priors.NOTHING] * chance * part, stated, size * unsure
        )
    share = priors.CHANCES[priors.FRICTION_ALONE] / len(priors.LOG_UNIFORM)
    for (wide, chance), more, (size, part) in product(
        TAILS, priors.LOG_UNIFORM, priors.HALF_NORMAL
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
