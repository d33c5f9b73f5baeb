# SPDX-License-Identifier: Apache-2.0
"""
Runs without noise, as the oracle sails them: the generator's own laws, compiled.

The hull is as the ship file states her. An effect is made by the generator's own maker, from
numbers that are given instead of drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import ceil, exp, pi
from typing import Any

import numpy as np
import yaml
from numba import njit
from scipy.interpolate import PchipInterpolator

from benchmarks.worlds.hidden_b.cases import Known
from benchmarks.worlds.hidden_b.effects import Draw, Hidden
from benchmarks.worlds.hidden_b.hulls import AIR, GRAVITY, SEA, Array, Hull, ittc57
from benchmarks.worlds.hidden_b.instruments import faulty_log, faulty_place, filtered
from benchmarks.worlds.hidden_b.library import LIBRARY
from benchmarks.worlds.hidden_b.screws import BRAKE, DRAG, LIFT, SKIN, Screw
from benchmarks.worlds.hidden_b.setting import Setting
from benchmarks.worlds.hidden_b.voyage import Track, _heading, _weather, steady_point
from benchmarks.worlds.hidden_b.weather import Weather

_STILL = Weather('karman', (0.0, 0.0), 0.0, 0.0, (0.0, 0.0), (0.0, 0.0, 0.0), (), 0.0, 1.0)  # type: ignore[arg-type]
_DRIVES = ('declutched', 'direct', 'electric', 'cpp', 'locked', 'folding')
_BETWEEN_SD = 0.003  # of each of seven waves; resistance between the speeds of the file
_HOLDS = ('torque', 'power', 'revs')


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
    Sail a quiet run, the same as `voyage.sail`, and read log and place without noise.

    Parameters
    ----------
    setting
    known
    push
        Change of the speed at the stop, for which the engine was not set [m/s].
    """
    hull, dt = setting.hull, setting.step_s
    t = np.arange(round(setting.coast_s / dt) + 1) * dt
    track = quick(setting, t, push)
    before = ceil(0.35 * hull.time_s / dt)
    early = np.arange(-before, 0) * dt
    water = np.concatenate([np.full(before, track.water_m_s[0]), track.water_m_s])
    place = np.concatenate([early[:, None] * track.ground_m_s[0], track.place_m])
    whole = replace(track, t=np.concatenate([early, t]), water_m_s=water, place_m=place)
    seen = filtered(whole.t, water, known.kit.log_filter_s)
    log = faulty_log(whole.t, seen, setting.faults)
    return Sailed(whole.t, log, faulty_place(whole, known.kit, setting.faults), track)


def quick(setting: Setting, t: Array, push: float = 0.0, until: float = 0.0) -> Track:
    """
    Sail a quiet run at given times; the engine stops at 0, whenever the times begin.
    """
    hull, n = setting.hull, len(t)
    heading, lateral = _heading(setting, t)
    wind, flow, lag = _weather(setting, t, heading)
    c, s = np.cos(heading), np.sin(heading)
    wind_ahead, wind_port = wind[:, 0] * c + wind[:, 1] * s, -wind[:, 0] * s + wind[:, 1] * c
    flow_ahead, flow_port = flow[:, 0] * c + flow[:, 1] * s, -flow[:, 0] * s + flow[:, 1] * c
    at_rest, slope = np.zeros(n), np.zeros(n)
    for law in setting.waves:
        more = law(t, heading, setting.period_s, None)
        at_rest, slope = at_rest + more[0], slope + more[1]
    # what comes and goes goes with the square of the speed, all over the library
    square = np.zeros(n)
    for timed in setting.timed:
        square = square + timed(t, np.ones(n))
    table = setting.still_n()
    inertia = setting.mass_kg * (1.0 + setting.n_r)
    still_air = 0.5 * AIR * hull.frontal_m2 * hull.air_drag
    u = setting.speed_m_s
    ahead, port = wind_ahead[0] - u - flow_ahead[0], wind_port[0] - flow_port[0]
    outside = _air(ahead, port, still_air) + still_air * u * u - at_rest[0] - slope[0] * u
    need = float(np.interp(u, hull.grid_m_s, table)) - outside
    screw, revs, torque = steady_point(setting, need)
    water, turns, pitch = _go(
        t,
        u + push,
        table,
        float(hull.grid_m_s[1]),
        inertia,
        1.0 + setting.n_r,
        np.stack([wind_ahead - flow_ahead, wind_port - flow_port, at_rest, slope, square, lag]),
        still_air,
        _numbers(screw),
        np.array([revs, torque]),
    )
    sideways = lateral * water
    ground = np.stack(
        [water * c - sideways * s + flow[:, 0], water * s + sideways * c + flow[:, 1]], axis=1
    )
    steps = 0.5 * (ground[1:] + ground[:-1]) * setting.step_s
    place = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    apparent = np.stack([wind_ahead - water - flow_ahead, wind_port - flow_port - sideways], 1)
    steady = (revs, torque)
    return Track(
        t, water, ground, place, heading, 2 * pi * turns, pitch, apparent, np.zeros(n), steady
    )


def _numbers(s: Screw) -> Array:
    """Return all that a compiled function needs of other modules: it may outlive them."""
    return np.array([
        s.diameter_m, s.pitch, s.blades, s.wake, s.deduction, float(s.shafts),
        float(_DRIVES.index(s.drive)), float(_HOLDS.index(s.hold)), s.inertia_s, s.coulomb,
        s.viscous, s.ramp_s, s.stopped, s.stagger_s, s.left, s.left_s,
        LIFT, DRAG, SKIN, BRAKE * (0.3 if s.drive == 'cpp' else 1.0), 0.5 * SEA[0],
    ])  # fmt: skip


@njit(cache=True, error_model='numpy')
def _air(ahead: float, port: float, still_air: float) -> float:
    square = ahead * ahead + port * port
    if square < 1e-12:
        return 0.0
    c = ahead / square**0.5
    return still_air * square * (c - 0.12 * (4.0 * c**3 - 3.0 * c - c))


@njit(cache=True, error_model='numpy')
def _loads(screw: Array, revs: float, speed: float, pitch: float) -> tuple[float, float]:
    """Return the same as `Screw.loads`."""
    advance = (1.0 - screw[3]) * speed
    turn = 0.7 * pi * revs * screw[0]
    flow = (advance * advance + turn * turn) ** 0.5
    if flow < 1e-9:
        return 0.0, 0.0
    sine, cosine = advance / flow, turn / flow
    attack = np.arctan2(pitch, 0.7 * pi) - np.arctan2(advance, turn)
    lift = screw[16] * np.sin(attack) * np.cos(attack)
    drag = screw[18] + screw[17] * np.sin(attack) ** 2
    disc = 0.25 * pi * screw[0] ** 2
    dynamic = screw[20] * screw[2] * disc * flow**2
    thrust = dynamic * (lift * cosine - drag * sine)
    torque = dynamic * 0.35 * screw[0] * (lift * sine + drag * cosine)
    if thrust < 0.0:
        largest = screw[19] * screw[20] * disc * (advance**2 + 1e-9)
        thrust = -largest * np.tanh(-thrust / largest)
    return thrust, torque


@njit(cache=True, error_model='numpy')
def _turned(
    screw: Array, revs: float, t: float, u: float, dt: float, late: float, steady: Array
) -> float:
    """Return the revs a step later, as `voyage` has it."""
    since, drive, hold = t - late, screw[6], screw[7]
    if drive == 3.0:
        return steady[0] * (1.0 - min(max(since / screw[11], 0.0), 1.0) * (1.0 - screw[12]))
    if drive >= 4.0 and since >= 0.0:
        return max(0.0, steady[0] * (1.0 - since / screw[11]))
    if since < 0.0 and hold == 2.0:
        return steady[0]
    inertia = screw[8] * steady[1] / max(steady[0], 1e-9)
    parts = ceil(12.0 * dt / screw[8])
    for _ in range(parts):
        if since < 0.0:
            engine = steady[1]
            if hold == 1.0:
                engine *= steady[0] / max(revs, 0.3 * steady[0])
        else:
            engine = steady[1] * max(screw[14] * exp(-since / screw[15]), 1.0 - since / screw[11])
        load = _loads(screw, revs, u, screw[1])[1]
        if since >= 0.0:
            load += steady[1] * (screw[9] + screw[10] * revs / steady[0])
        revs += (engine - load) / inertia * dt / parts
        if revs <= 0.0:
            return 0.0
    return revs


@njit(cache=True, error_model='numpy')
def _still(table: Array, spacing: float, u: float) -> float:
    place = min(abs(u) / spacing, len(table) - 1.001)
    i = int(place)
    found = table[i] + (place - i) * (table[i + 1] - table[i])
    return found if u >= 0.0 else -found


@njit(cache=True, error_model='numpy')
def _go(
    t: Array,
    u: float,
    table: Array,
    spacing: float,
    inertia: float,
    share: float,
    acts: Array,
    still_air: float,
    screw: Array,
    steady: Array,
) -> tuple[Array, Array, Array]:
    """Go on step by step, as `voyage.sail` does; `acts` are its forces that go with time."""
    n, shafts = len(t), int(screw[5])
    dt = t[1] - t[0]
    water, turns, pitches = np.empty(n), np.empty((n, shafts)), np.empty(n)
    revs, pitch = np.full(shafts, steady[0]), screw[1]
    for i in range(n):
        if screw[6] == 3.0:
            pitch = screw[1] * (1.0 - min(max(t[i] / screw[11], 0.0), 1.0))
        total = 0.0
        for k in range(shafts):
            late = screw[13] * k
            thrust = _loads(screw, revs[k], u, pitch)[0]
            if screw[6] == 5.0 and t[i] >= late:
                thrust *= max(0.0, 1.0 - (t[i] - late) / screw[11])
            total += thrust * (1.0 - screw[4]) if thrust > 0.0 else thrust
            revs[k] = _turned(screw, revs[k], t[i], u, dt, late, steady)
        water[i], pitches[i] = u, pitch
        turns[i] = revs
        total += _air(acts[0, i] - u, acts[1, i], still_air) + still_air * u * abs(u)
        total -= _still(table, spacing, u) + acts[2, i] + (acts[3, i] + acts[4, i] * abs(u)) * u
        after = u + (total / inertia - acts[5, i] / share) * dt
        change = _still(table, spacing, after) - _still(table, spacing, u)
        u = after - 0.5 * dt * change / inertia
    return water, turns, pitches
