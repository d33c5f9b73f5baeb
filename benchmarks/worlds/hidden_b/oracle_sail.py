# SPDX-License-Identifier: Apache-2.0
"""
Runs without noise, as the oracle sails them: the generator's own laws.

The hull is as the ship file states her. An effect is made by the generator's own maker, from
numbers that are given instead of drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import ceil, pi
from typing import Any

import numpy as np
import yaml
from scipy.interpolate import PchipInterpolator

from benchmarks.worlds.hidden_b.cases import Known
from benchmarks.worlds.hidden_b.effects import LIBRARY, Draw, Hidden
from benchmarks.worlds.hidden_b.hulls import AIR, GRAVITY, SEA, Array, Hull, ittc57
from benchmarks.worlds.hidden_b.instruments import faulty_log, faulty_place, filtered
from benchmarks.worlds.hidden_b.setting import Setting
from benchmarks.worlds.hidden_b.voyage import Track, sail_at, steady_point
from benchmarks.worlds.hidden_b.weather import Weather

_STILL = Weather('karman', (0.0, 0.0), 0.0, 0.0, (0.0, 0.0), (0.0, 0.0, 0.0), (), 0.0, 1.0)  # type: ignore[arg-type]
_BETWEEN_SD = 0.003  # of each of seven waves; resistance between the speeds of the file


@dataclass(frozen=True)
class Stated:
    """
    What a ship file states.

    Attributes
    ----------
    hull
        With resistance (stopped propeller apart) and added mass as stated.
    misses
        What one standard deviation of each error adds to the resistance, on the hull's grid: of
        the two that are stated, and of what lies between the speeds of the file.
    added_sd, run_down_sd
        Of the added mass; of the time in which the thrust falls, relative.
    """

    hull: Hull
    misses: tuple[Array, ...]
    added_sd: float
    run_down_sd: float


def stated(text: str, known: Known) -> Stated:
    """
    Read a ship file of world B.
    """
    file = yaml.safe_load(text)
    grid, baseline = known.hull.grid_m_s, file['baseline']
    hull = known.hull
    steady = np.linspace(0.0, 1.2 * hull.speed_m_s, 80)
    sd = baseline['relative_sd']
    if 'resistance_n' in baseline:
        speed = np.array(baseline['speed_m_s'])
        usual = _smooth(speed[1:], np.array(baseline['resistance_n'])[1:] / speed[1:] ** 2)(grid)
        usual = usual * grid**2
        share = 1.3 * grid / speed[-1]
        misses = (0.8 * sd * usual, 0.6 * sd * usual * np.cos(pi * share))
    else:
        pressure = 0.5 * SEA[0] * hull.wetted_m2 * grid**2
        air = 0.5 * AIR * hull.frontal_m2 * hull.air_drag * grid**2
        line = ittc57(grid * hull.length_m / SEA[1])
        friction = (1.0 + baseline['form_factor']) * line + baseline['correlation_allowance']
        froude = grid / np.sqrt(GRAVITY * hull.length_m)
        wave = _smooth(np.array(baseline['wave_froude']), np.array(baseline['wave_coefficient']))
        waves = pressure * np.maximum(wave(froude), 0.0)
        usual = pressure * friction + waves + air
        misses = (sd['friction'] * pressure * friction, sd['wave'] * waves)
    between = _BETWEEN_SD * usual * np.cos(pi * np.arange(3, 10)[:, None] * grid / hull.speed_m_s)
    added, down = file['added_mass'], file['propulsion']
    bare = replace(hull, still_n=usual, n_r=added['value'])
    # revs and torque before the stop depend on the drag hardly at all
    revs, torque = steady_point(run_of(known, bare, 0, hull.speed_m_s, 0.0), float(
        np.interp(hull.speed_m_s, grid, usual)))[1:]  # fmt: skip
    drag = np.interp(grid, steady, known.screw.drag_n(steady, (revs, torque)))
    drag *= np.maximum(grid / steady[-1], 1.0) ** 2
    return Stated(
        replace(bare, still_n=np.maximum(usual - drag, 0.02 * usual)),
        (*misses, *between),
        added['sd'],
        down['sd'] / down['run_down_s'],
    )


def _smooth(x: Array, y: Array) -> Callable[[Array], Array]:
    curve = PchipInterpolator(x, y)
    return lambda at: curve(np.clip(at, x[0], x[-1]))


def run_of(known: Known, hull: Hull, run: int, speed: float, heading: float) -> Setting:
    """
    Return a run on which nothing acts.
    """
    return Setting(
        hull=hull,
        screw=known.screw,
        weather=_STILL,
        speed_m_s=speed,
        heading_rad=heading,
        first_rad=heading,
        lead_s=known.lead_s,
        coast_s=known.coast_s,
        step_s=min(4.0 * known.step_s, known.coast_s / 300.0),
        clock_s=known.clock_s[run],
        seed=(0,),
        quiet=True,
    )


Change = Callable[[Setting], None]
_WEATHER = (  # a standard deviation of each: in m/s, of the flow over the speed
    ('wind', (0.65, 0.0)), ('wind', (0.0, 0.65)),
    ('flow', (1.6e-3, 0.0)), ('flow', (0.0, 1.6e-3)),
    ('tide', (6e-3, 0.0, 0.0)), ('tide', (0.0, 6e-3, 0.0)),
    ('tide', (6e-3, 0.0, -np.pi / 2)), ('tide', (0.0, 6e-3, -np.pi / 2)),
)  # fmt: skip
_SCALE, _OFFSET = 1.7e-3, 7e-4  # of the log; over the speed


def shared(row: Callable[[Change, Hull], Array], stated: Stated) -> Array:
    """
    Return what a standard deviation of each changes, a column each: (n, m).

    Parameters
    ----------
    row
        Returns what would be seen of a hull in settings that are changed.
    stated
    """
    hull = stated.hull
    plain = row(_nothing, hull)
    hulls = [replace(hull, still_n=hull.still_n + miss) for miss in stated.misses]
    hulls.append(replace(hull, n_r=hull.n_r + stated.added_sd))
    changes = [_run_down(1.0 + stated.run_down_sd)]
    for name, value in _WEATHER:
        size = hull.speed_m_s if name == 'flow' else 1.0
        changes.append(_blowing(name, tuple(size * each for each in value)))
    changes += [_faulty('scale', _SCALE), _faulty('offset_m_s', _OFFSET * hull.speed_m_s)]
    rows = [row(_nothing, each) for each in hulls] + [row(change, hull) for change in changes]
    return np.stack([each - plain for each in rows], axis=1)


def _nothing(_: Setting) -> None:
    """Change nothing."""


def _run_down(late: float) -> Change:
    def change(setting: Setting) -> None:
        screw = setting.screw
        setting.screw = replace(
            screw, inertia_s=screw.inertia_s * late, ramp_s=screw.ramp_s * late
        )

    return change


def _blowing(name: str, value: tuple[float, ...]) -> Change:
    def change(setting: Setting) -> None:
        setting.weather = replace(setting.weather, **{name: value})  # type: ignore[arg-type]

    return change


def _faulty(name: str, size: float) -> Change:
    def change(setting: Setting) -> None:
        more = getattr(setting.faults, name) + size
        setting.faults = replace(setting.faults, **{name: more})

    return change


class _Given:
    """Stands for a generator of random numbers: each draw is the next number given."""

    def __init__(self, numbers: Sequence[float]) -> None:
        self.numbers = list(numbers)

    def uniform(self, *_: Any) -> float:
        return self.numbers.pop(0)

    normal = choice = uniform


def made(name: str, numbers: Sequence[float], hull: Hull, known: Known, steady: Any) -> Hidden:
    """
    Return an effect of the library.

    Parameters
    ----------
    name
    numbers
        What its maker would draw, in that order.
    hull, known, steady
        The ship; revs and torque before the stop.
    """
    given = _Given(numbers)
    draw = Draw(given, hull, known.screw, 1.0, known.coast_s, steady)  # type: ignore[arg-type]
    found = LIBRARY[name][0](draw)
    return _exact(found, numbers[0]) if name == 'fouling' else found


def _exact(found: Hidden, factor: float) -> Hidden:
    """Return fouling of a factor itself: its maker takes the next of 200 heights, in steps."""
    part = factor / found.parameters['friction_factor']

    def apply(setting: Setting) -> None:
        found.apply(setting)
        law = setting.still.pop()
        setting.still.append(lambda hull, v, r: r + part * (law(hull, v, r) - r))

    return replace(found, parameters={'friction_factor': factor}, apply=apply)


@dataclass(frozen=True)
class Sailed:
    """
    A run without noise, from some time before the stop on, at even steps.

    Attributes
    ----------
    t, log, place, track
    """

    t: Array
    log: Array
    place: Array
    track: Track


def sailed(setting: Setting, known: Known, *, push: float = 0.0) -> Sailed:
    """
    Sail a quiet run, and read log and place without noise.

    Parameters
    ----------
    setting
    known
    push
        Change of the speed at the stop, for which the engine was not set [m/s].
    """
    hull, dt = setting.hull, setting.step_s
    t = np.arange(round(setting.coast_s / dt) + 1) * dt
    track = sail_at(setting, t, push)
    before = ceil(0.35 * hull.time_s / dt)
    early = np.arange(-before, 0) * dt
    water = np.concatenate([np.full(before, track.water_m_s[0]), track.water_m_s])
    place = np.concatenate([early[:, None] * track.ground_m_s[0], track.place_m])
    whole = replace(track, t=np.concatenate([early, t]), water_m_s=water, place_m=place)
    seen = filtered(whole.t, water, known.kit.log_filter_s)
    log = faulty_log(whole.t, seen, setting.faults)
    return Sailed(whole.t, log, faulty_place(whole, known.kit, setting.faults), track)
