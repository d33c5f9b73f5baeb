# SPDX-License-Identifier: Apache-2.0
"""
The cases of world B: what may be seen, and apart from it the truth.

Cases of even number are for choosing methods, those of odd number for scoring alone: whoever
tunes anything looks at the even ones only. Both halves hold the same mixture. Every case is made
anew from its seed and number.

Light air, small currents, small errors and the filter of the log are in every case; together they
move r by less than one percent (`everyday`) and are no effect. What is hidden moves it by
`LEAST` or more (`Truth.r_change`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from benchmarks.worlds.hidden_b.effects import FREE, LIBRARY, SECOND, Draw, Hidden
from benchmarks.worlds.hidden_b.hulls import Array, Hull, draw_hull
from benchmarks.worlds.hidden_b.instruments import (
    INPUTS,
    MOTION,
    Kit,
    Recording,
    draw_kit,
    faulty_log,
    faulty_place,
    read,
)
from benchmarks.worlds.hidden_b.plans import Condition, Facts, draw_facts, plans_of
from benchmarks.worlds.hidden_b.screws import Screw, draw_screw
from benchmarks.worlds.hidden_b.setting import Faults, Setting
from benchmarks.worlds.hidden_b.shipfile import Stated, draw_stated, ship_file
from benchmarks.worlds.hidden_b.strangers import OUTSIDE
from benchmarks.worlds.hidden_b.voyage import Track, sail, steady_point
from benchmarks.worlds.hidden_b.weather import Weather, draw_weather

SEED = 77_001
LEAST, MOST, EVERYDAY = 0.03, 0.45, 0.01
EPOCH_NS = 1_780_272_000_000_000_000  # 1 June 2026


@dataclass(frozen=True)
class Observation:
    """
    What a diagnosis may see: the ship file, and the readings of each run.
    """

    ship_file: str
    runs: tuple[Recording, ...]


@dataclass(frozen=True)
class Truth:
    """
    What was hidden.

    Attributes
    ----------
    kind
        `none`, `one`, `pair` or `outside`.
    shelf
        0 where nothing of the library is hidden, 2 for its rarer effects, else 1.
    names
        In alphabetical order; `unknown` for what is outside of the library.
    parameters
        By name of effect and of parameter.
    condition
    what
        Names of the effects themselves.
    r_change
        By how much each moves r, of its largest value; see `moved`.
    facts, lies
        What the crew says, and which of it is false.
    """

    kind: str
    shelf: int
    names: tuple[str, ...]
    parameters: dict[str, dict[str, float]]
    condition: Condition
    what: tuple[str, ...]
    r_change: dict[str, float]
    facts: Facts
    lies: tuple[str, ...]


@dataclass(frozen=True)
class Known:
    """
    What an oracle knows of a case beside what is seen; nothing of what is hidden.

    Attributes
    ----------
    hull
        Her lines; resistance and added mass are empty: the ship file states them.
    screw
        Propeller and engine as they usually are.
    kit
        Her instruments as their manuals have them: no scale and no offset of the log.
    lead_s, coast_s, step_s
        Length of the steady part and of the rest, and the time step of the simulation.
    clock_s
        Time of day at the stop, of each run.
    """

    hull: Hull
    screw: Screw
    kit: Kit
    lead_s: float
    coast_s: float
    step_s: float
    clock_s: tuple[float, ...]


@dataclass(frozen=True)
class _Case:
    hull: Hull
    screw: Screw
    stated: Stated
    kit: Kit
    ship: str
    hidden: tuple[Hidden, ...]
    sizes: tuple[float, ...]
    settings: tuple[Setting, ...]
    everyday: float


def count(seed: int = SEED) -> int:
    """
    Return the number of cases.
    """
    return len(plans_of(seed))


def condition(number: int, seed: int = SEED) -> Condition:
    """
    Return what is given of a case.
    """
    return plans_of(seed)[number][1]


def names(number: int, seed: int = SEED) -> tuple[str, ...]:
    """
    Return the names of what is hidden in a case, in alphabetical order.
    """
    return tuple(sorted(plans_of(seed)[number][0]))


def observe(number: int, *, seed: int = SEED) -> Observation:
    """
    Return what a diagnosis may see of a case, counted from 0, of the world of a seed.
    """
    case, given = _case(number, seed), condition(number, seed)
    inputs = INPUTS if given.context else MOTION
    readings = []
    for setting in case.settings[: given.runs]:
        start = EPOCH_NS + round((setting.clock_s - setting.lead_s) * 1e9)
        readings.append(read(sail(setting), setting, case.kit, inputs, start))
    return Observation(case.ship, tuple(readings))


def stops_ns(number: int, seed: int = SEED) -> tuple[int, ...]:
    """
    Return when the engine was stopped, of each run.
    """
    return tuple(EPOCH_NS + round(s.clock_s * 1e9) for s in _case(number, seed).settings)


def known(number: int, seed: int = SEED) -> Known:
    """
    Return what an oracle knows of a case.
    """
    case = _case(number, seed)
    runs = case.settings
    return Known(
        hull=replace(case.hull, still_n=np.zeros_like(case.hull.still_n), n_r=0.0),
        screw=case.screw,
        kit=replace(case.kit, log_scale=0.0, log_offset_m_s=0.0),
        lead_s=runs[0].lead_s,
        coast_s=runs[0].coast_s,
        step_s=runs[0].step_s,
        clock_s=tuple(run.clock_s for run in runs),
    )


def reveal(number: int, seed: int = SEED) -> Truth:
    """
    Return what was hidden in a case.
    """
    what, case = names(number, seed), _case(number, seed)
    outside = bool(set(what) & set(OUTSIDE))
    kind = 'outside' if outside else ('none', 'one', 'pair')[len(what)]
    first = case.settings[0]
    wind = float(np.hypot(*np.sum([first.weather.wind, *first.wind], axis=0)))
    drive = first.screw.drive
    facts, lies = draw_facts(np.random.default_rng([seed, number, 9]), what, drive, wind)
    return Truth(
        kind,
        0 if outside or not what else 2 if set(what) & set(SECOND) else 1,
        ('unknown',) if outside else what,
        {each.name: each.parameters for each in case.hidden},
        condition(number, seed),
        what,
        {each.name: size for each, size in zip(case.hidden, case.sizes, strict=True)},
        facts,
        lies,
    )


def true_r(
    number: int, speed_m_s: Array, run: int = 0, seed: int = SEED, *, calm: bool = False
) -> Array:
    """
    Return the true r at speeds [m/s^2]: of hull, stopped propeller and what else goes with speed.

    Wind, waves, current, helm and what comes and goes are no part of it; nor is the depth, where
    it is that in calm deep water.
    """
    setting = _case(number, seed).settings[run]
    speed = np.asarray(speed_m_s, np.float64)
    hull = setting.hull
    still = np.interp(speed, hull.grid_m_s, setting.still_n(deep=calm))
    grid = np.linspace(0.0, 1.2 * hull.speed_m_s, 160)
    drag = setting.screw.drag_n(grid, steady_of(setting))
    return (still + np.interp(speed, grid, drag)) / setting.mass_kg


def everyday(number: int, seed: int = SEED) -> float:
    """
    Return by how much the weather that is always there moves r.
    """
    return _case(number, seed).everyday


def first_speed(number: int, run: int = 0, seed: int = SEED) -> float:
    """
    Return the steady speed of a run.
    """
    return _case(number, seed).settings[run].speed_m_s


def steady_of(setting: Setting) -> tuple[float, float]:
    """
    Return revs and torque before the stop.
    """
    need = float(np.interp(setting.speed_m_s, setting.hull.grid_m_s, setting.still_n()))
    return steady_point(setting, need)


@lru_cache(maxsize=16)
def _case(number: int, seed: int) -> _Case:
    names, _ = plans_of(seed)[number]
    rng = np.random.default_rng([seed, number, 0])
    drives: tuple[str, ...] = ()
    for name in names:
        drives = LIBRARY[name][1] if name in LIBRARY and LIBRARY[name][1] else drives
    if {'residual_thrust', 'locked_propeller'} & set(names):
        drives = FREE
    ship, kit = draw_ship(rng, drives, (2400.0, 1200.0))
    hull, screw = ship['hull'], ship['screw']
    if {'radar_scale', 'gyro_ballistic'} & set(names):
        kit = replace(kit, fix='radar', fix_every_s=3.0)
    weather = draw_weather(rng, hull.time_s, hull.speed_m_s)
    bases = _legs(rng, ship, weather, (seed, number))
    weather, kit, moves = calm(bases, kit)
    bases = tuple(replace(base, weather=weather) for base in bases)
    stated = draw_stated(rng)
    steady = steady_of(bases[0])
    text = ship_file(hull, screw, steady, run_down_s(bases[0]), stated, number)
    key = (seed, number, 1)
    hidden, sizes = [], []
    for place, name in enumerate(names):
        effect, size = _sized(name, place, key, bases[0], kit, steady)
        hidden.append(effect)
        sizes.append(size)
    settings = []
    for run, base in enumerate(bases):
        setting = fresh(base)
        for effect in hidden:
            if effect.scope != 'run' or run == 0:
                effect.apply(setting)
        settings.append(setting)
    found = tuple(hidden), tuple(sizes), tuple(settings)
    return _Case(hull, screw, stated, kit, text, *found, moves)


def draw_ship(
    rng: np.random.Generator, drives: tuple[str, ...], longest_s: tuple[float, float]
) -> tuple[dict[str, Any], Kit]:
    """
    Draw what all runs of a ship have in common, by the names of `Setting`, and her instruments.

    Parameters
    ----------
    rng
    drives
        Those that will do; any where there are none.
    longest_s
        Of the steady part, of a ship that slows slowly and of a quick one.
    """
    hull = draw_hull(rng, drives)
    screw = draw_screw(rng, hull.drive, hull.diameter_m, hull.shafts, hull.time_s)
    coast = float(np.clip(rng.uniform(2.0, 3.5) * hull.time_s, 180.0, 3600.0))
    slow, quick = longest_s
    lead = rng.uniform(900.0, slow) if hull.time_s > 100.0 else rng.uniform(500.0, quick)
    kit = draw_kit(rng, hull.time_s, hull.speed_m_s, hull.draught_m, coast * hull.speed_m_s)
    step = float(np.clip(hull.time_s / 300.0, 0.15, 1.0))
    times = {'lead_s': round(lead / step) * step, 'coast_s': coast, 'step_s': step}
    return {'hull': hull, 'screw': screw, **times}, kit


def fresh(base: Setting) -> Setting:
    """
    Return a copy whose lists are its own.
    """
    lists = ('still', 'of_depth', 'timed', 'wind', 'flow', 'helm', 'shear', 'waves')
    return replace(base, **{name: list(getattr(base, name)) for name in lists})


def _legs(
    rng: np.random.Generator, ship: dict[str, Any], weather: Weather, key: tuple[int, int]
) -> tuple[Setting, ...]:
    """Return three runs: a first, one back, one on another course."""
    first = rng.uniform(-np.pi, np.pi)
    headings = (first, first + np.pi + rng.normal(0, 0.03), first + rng.uniform(1.0, 2.1))
    clock = rng.uniform(6.0, 14.0) * 3600.0
    legs, hull = [], ship['hull']
    for run, heading in enumerate(headings):
        speed = hull.speed_m_s * (1.0 if run == 0 else rng.uniform(0.8, 0.98))
        legs.append(
            Setting(
                **ship,
                weather=weather,
                speed_m_s=speed,
                heading_rad=heading,
                first_rad=first,
                clock_s=clock,
                seed=(*key, 2, run),
                depth_m=float(max(12.0 * hull.draught_m, 15.0)) * rng.uniform(1.0, 2.0),
            )
        )
        clock += ship['lead_s'] + ship['coast_s'] + rng.uniform(300.0, 900.0)
    return tuple(legs)


def calm(bases: tuple[Setting, ...], kit: Kit) -> tuple[Weather, Kit, float]:
    """
    Return weather and instruments, good enough to be no effect, and how they move r.
    """
    weather = bases[0].weather
    still = replace(weather, wind=(0.0, 0.0), flow=(0.0, 0.0), tide=(0.0, 0.0, 0.0))
    while True:
        moves = 0.0
        log = Faults(kit.log_scale, kit.log_offset_m_s, kit.log_filter_s)
        for base in bases:
            plain = replace(base, weather=still)
            moves = max(moves, moved(replace(base, weather=weather, faults=log), plain, kit))
        if moves < EVERYDAY:
            return weather, kit, moves
        less = 0.9 * EVERYDAY / moves
        weather = replace(
            weather,
            wind=(weather.wind[0] * less, weather.wind[1] * less),
            flow=(weather.flow[0] * less, weather.flow[1] * less),
            tide=(weather.tide[0] * less, weather.tide[1] * less, weather.tide[2]),
        )
        kit = replace(
            kit,
            log_scale=kit.log_scale * less,
            log_offset_m_s=kit.log_offset_m_s * less,
            log_filter_s=kit.log_filter_s * less**0.5,
        )


def _sized(
    name: str,
    place: int,
    key: tuple[int, ...],
    base: Setting,
    kit: Kit,
    steady: tuple[float, float],
) -> tuple[Hidden, float]:
    """Return an effect that matters, and by how much it moves r."""
    make = LIBRARY[name][0] if name in LIBRARY else OUTSIDE[name]

    def of(size: float) -> Hidden:
        rng = np.random.default_rng([*key, place])
        return make(Draw(rng, base.hull, base.screw, size, base.coast_s, steady))

    size, moves = matters(of, base, kit, LEAST)
    return of(size), moves


def matters(
    of: Callable[[float], Hidden], base: Setting, kit: Kit, least_r: float
) -> tuple[float, float]:
    """
    Return a size, of what `of` makes of one, that moves r by `least_r` to `MOST`, and by how much.
    """
    size, least, most = 1.0, 0.0, np.inf
    for _ in range(14):
        tried, changed = size, fresh(base)
        of(size).apply(changed)
        moves = moved(changed, base, kit)
        if least_r <= moves <= MOST:
            break
        least, most = (size, most) if moves < least_r else (least, size)
        within = least > 0.0 and np.isfinite(most)
        size = float(np.sqrt(least * most)) if within else size * (1.35 if least else 0.7)
    return tried, moves


def quiet(setting: Setting) -> Setting:
    """
    Return the run without anything random, and with longer steps.
    """
    step = min(4.0 * setting.step_s, setting.hull.time_s / 120.0)
    return replace(setting, quiet=True, step_s=step)


def seen(track: Track, setting: Setting, kit: Kit) -> tuple[Array, Array]:
    """
    Return what log and track say of the speed, without noise.
    """
    log = faulty_log(track.t, track.water_m_s, setting.faults)
    place = faulty_place(track, kit, setting.faults)
    velocity = np.gradient(place, track.t, axis=0)
    c, s = np.cos(setting.heading_rad), np.sin(setting.heading_rad)
    return log, velocity[:, 0] * c + velocity[:, 1] * s


def moved(changed: Setting, plain: Setting, kit: Kit) -> float:
    """
    Return by how much a change of the setting moves r, relative to its largest value.

    The retardation of log and of track, each against what the plain run shows at the same
    reading, and twice the gap between log and track over the first speed (r goes about as the
    square): the largest of the three, rms.
    """
    found = [sail(quiet(setting)) for setting in (plain, changed)]
    plain_seen, changed_seen = (
        seen(track, setting, kit) for track, setting in zip(found, (plain, changed), strict=True)
    )
    t, first = found[0].t, plain.speed_m_s
    skip = t > min(0.06 * plain.hull.time_s, 20.0)
    sizes = []
    for before, after in zip(plain_seen, changed_seen, strict=True):
        slope = -np.gradient(before, t)[skip]
        order = np.argsort(before[skip])
        largest = float(np.max(slope[before[skip] > 0.3 * first]))
        inside = (after > 0.3 * first) & (after < 1.1 * first)
        # a reading that falls to nothing has no slope
        inside[1:-1] &= inside[2:] & inside[:-2]
        use = skip & inside
        if use.sum() > 5:
            usual = np.interp(after[use], before[skip][order], slope[order])
            gap = -np.gradient(after, t)[use] - usual
            sizes.append(float(np.sqrt(np.mean(gap**2))) / largest)
    between = (changed_seen[0] - changed_seen[1]) - (plain_seen[0] - plain_seen[1])
    fast = found[0].water_m_s > 0.15 * first
    sizes.append(2.0 * float(np.sqrt(np.mean(between[fast] ** 2))) / first)
    return max(sizes)


def run_down_s(setting: Setting) -> float:
    """
    Return the time in which the thrust falls to a third after the stop.
    """
    track = sail(replace(setting, quiet=True, coast_s=max(60.0, 0.3 * setting.hull.time_s)))
    hull = setting.hull
    still = np.interp(track.water_m_s, hull.grid_m_s, setting.still_n())
    thrust = track.force_n + still
    under = np.flatnonzero(thrust < 0.37 * thrust[0])
    return max(float(track.t[under[0]]) if len(under) else 10.0, 2.0 * setting.step_s)
