# SPDX-License-Identifier: Apache-2.0
"""
The cases: what a diagnosis may see, and apart from it the truth.

`observe` gives the ship file and the runs; `reveal` the truth, to be asked
for once the verdict is kept. Both are made anew from the number of the case.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np

from benchmarks.worlds.hidden import recording
from benchmarks.worlds.hidden.effect import Effect, Leg
from benchmarks.worlds.hidden.hull import SHAPE_TERMS, Array, Hull, draw_hull
from benchmarks.worlds.hidden.library import FIRST_SHELF, SECOND_SHELF
from benchmarks.worlds.hidden.outside import OUTSIDE
from benchmarks.worlds.hidden.sailing import LEAD_IN_S, World, coasting_m_s2, sail

SEED = 20260601
SHAPE_RMS = 0.01
PAIRS = (
    ('current', 'fouling'),
    ('current', 'log_scale'),
    ('wind', 'fouling'),
    ('wind', 'current'),
    ('shallow_water', 'log_offset'),
    ('locked_propeller', 'current'),
    ('towed_cable', 'log_offset'),
    ('turning', 'current'),
    ('residual_thrust', 'log_scale'),
    ('waves', 'log_scale'),
    ('fouling', 'log_offset'),
    ('radar_scale', 'fouling'),
)
_BY_NAME = {kind.name: kind for kind in (*FIRST_SHELF, *SECOND_SHELF)}
_ONE, _SECOND, _PAIR, _OUTSIDE, _NONE, _MISSTATED = 7, 3, 1, 4, 60, 20  # of a kind


@dataclass(frozen=True)
class Condition:
    """
    What a diagnosis is given.

    Attributes
    ----------
    runs
        1, or 2 on reciprocal headings.
    context
        Wind, depth, heading and shaft are measured.
    misstated
        The baseline is three times worse than the ship file states.
    """

    runs: int
    context: bool
    misstated: bool = False

    def __str__(self) -> str:
        text = f'{self.runs} run' + 's' * (self.runs > 1) + ' + context' * self.context
        return text + ', baseline mis-stated' * self.misstated


CONDITIONS = tuple(Condition(runs, context) for context in (False, True) for runs in (1, 2))


@dataclass(frozen=True)
class Observation:
    """
    What a diagnosis may see.

    Attributes
    ----------
    ship_file
        YAML.
    runs
        Readings by input, one mapping a run.
    """

    ship_file: str
    runs: tuple[recording.Recording, ...]


@dataclass(frozen=True)
class Truth:
    """
    What was hidden.

    Attributes
    ----------
    kind
        `none`, `one`, `pair` or `outside`.
    shelf
        0 outside the library and without effect, else 1 or 2; of a pair 1.
    names
        In alphabetical order.
    parameters
        By name of effect and of parameter.
    condition
    """

    kind: str
    shelf: int
    names: tuple[str, ...]
    parameters: dict[str, dict[str, float]]
    condition: Condition


@dataclass(frozen=True)
class _Plan:
    kinds: tuple[type[Effect], ...]
    condition: Condition


@dataclass(frozen=True)
class _Voyage:
    """One run as it was, and how."""

    leg: Leg
    heading_rad: float


@dataclass(frozen=True)
class _Case:
    hull: Hull
    noise: recording.Noise
    world: World
    effects: tuple[Effect, ...]
    voyages: tuple[_Voyage, ...]


@cache
def _plans() -> tuple[_Plan, ...]:
    plans: list[_Plan] = []
    for condition in CONDITIONS:
        wanted: list[tuple[type[Effect], ...]] = []
        wanted += [(kind,) for kind in FIRST_SHELF for _ in range(_ONE)]
        wanted += [(kind,) for kind in SECOND_SHELF for _ in range(_SECOND)]
        wanted += [tuple(_BY_NAME[name] for name in pair) for pair in PAIRS for _ in range(_PAIR)]
        wanted += [(kind,) for kind in OUTSIDE for _ in range(_OUTSIDE)]
        wanted += [()] * _NONE
        plans += [_Plan(kinds, condition) for kinds in wanted]
        plans += [_Plan((), replace(condition, misstated=True))] * _MISSTATED
    # mixed, so that any part of them is a sample of all, and the number says nothing
    order = np.random.default_rng(SEED).permutation(len(plans))
    return tuple(plans[i] for i in order)


def count() -> int:
    """
    Return the number of cases.
    """
    return len(_plans())


def observe(number: int) -> Observation:
    """
    Return what a diagnosis may see of a case, counted from 0.
    """
    case, given = _case(number), condition(number)
    inputs = recording.INPUTS if given.context else recording.MOTION
    return Observation(
        case.hull.ship_file(), tuple(_run(number, case, k, inputs) for k in range(given.runs))
    )


def reveal(number: int) -> Truth:
    """
    Return what was hidden in a case.
    """
    plan, case = _plans()[number], _case(number)
    kinds = plan.kinds
    kind = 'none'
    if len(kinds) == 2:
        kind = 'pair'
    elif kinds:
        kind = 'outside' if kinds[0] in OUTSIDE else 'one'
    shelf = 2 if set(kinds) & set(SECOND_SHELF) else int(kind in ('one', 'pair'))
    return Truth(
        kind,
        shelf,
        names(number),
        {effect.name: effect.parameters() for effect in case.effects},
        plan.condition,
    )


def names(number: int) -> tuple[str, ...]:
    """
    Return the names of what is hidden in a case, in alphabetical order.
    """
    return tuple(sorted(kind.name for kind in _plans()[number].kinds))


def condition(number: int) -> Condition:
    """
    Return what is given of a case.
    """
    return _plans()[number].condition


def stops_ns(number: int) -> tuple[int, ...]:
    """
    Return when the engine was stopped, of each run.
    """
    first = recording.START_NS + round(LEAD_IN_S * 1e9)
    return tuple(
        first + which * recording.BETWEEN_RUNS_NS for which in range(condition(number).runs)
    )


def first_speed(number: int, run: int = 0) -> float:
    """
    Return the steady speed of a run.
    """
    return _case(number).voyages[run].leg.speed_m_s


def true_r(number: int, speed_m_s: Array, run: int = 0, *, calm: bool = False) -> Array:
    """
    Return the true r at speeds [m/s^2]: of hull, stopped propeller and what else goes with speed.

    That in calm deep water leaves wind and depth out.
    """
    case = _case(number)
    return coasting_m_s2(
        case.voyages[run].leg,
        tuple(each for each in _acting(case, run) if not calm or each.name not in _WEATHER),
        np.asarray(speed_m_s, np.float64),
        first_heading_rad=case.voyages[0].heading_rad,
        world=case.world,
    )


@lru_cache(maxsize=8)
def _case(number: int) -> _Case:
    plan = _plans()[number]
    rng = _stream(number, 0)
    hull = draw_hull(rng)
    resistance = float(hull.still_n(np.array([hull.speed_m_s]))[0])
    slow_s = hull.speed_m_s * hull.mass_kg / resistance
    duration_s = round(float(np.clip(2.4 * slow_s, 700.0, 3600.0)))
    heading = rng.uniform(-np.pi, np.pi)
    voyages = []
    for sign in (1.0, -1.0):
        speed = hull.speed_m_s * (1.0 if sign > 0.0 else rng.uniform(0.85, 1.0))
        turned = heading if sign > 0.0 else heading + np.pi + rng.normal(0.0, 0.03)
        voyages.append(_Voyage(Leg(hull, sign, duration_s, speed), turned))
    worse = 3.0 if plan.condition.misstated else 1.0
    world = World(
        friction=worse * hull.friction_sd * rng.standard_normal(),
        wave=worse * hull.wave_sd * rng.standard_normal(),
        shape=tuple(SHAPE_RMS * rng.standard_normal(SHAPE_TERMS) / np.sqrt(0.5 * SHAPE_TERMS)),
        n_r=hull.n_r_sd * rng.standard_normal(),
        run_down_s=hull.run_down_sd * rng.standard_normal(),
    )
    effects = tuple(kind.draw(voyages[0].leg, rng) for kind in plan.kinds)
    return _Case(hull, recording.draw_noise(rng), world, effects, tuple(voyages))


def _run(number: int, case: _Case, which: int, inputs: tuple[str, ...]) -> recording.Recording:
    leg, heading = case.voyages[which].leg, case.voyages[which].heading_rad
    effects = _acting(case, which)
    motion = sail(
        leg,
        effects,
        heading_rad=heading,
        first_heading_rad=case.voyages[0].heading_rad,
        world=case.world,
        disturbance=recording.disturb(leg, case.noise, heading, _stream(number, 1, which)),
    )
    found = {}
    for name in inputs:
        rng = _stream(number, 2, which, recording.INPUTS.index(name))
        scene = recording.Scene(motion, leg, effects, case.noise, heading, rng)
        found[name] = recording.read(name, scene, which)
    return found


_WEATHER = ('wind', 'shallow_water', 'waves')


def _acting(case: _Case, which: int) -> tuple[Effect, ...]:
    """Return the effects that act in a run."""
    return tuple(effect for effect in case.effects if which == 0 or not effect.single_run)


def _stream(*key: int) -> np.random.Generator:
    return np.random.default_rng([SEED, *key])
