# SPDX-License-Identifier: Apache-2.0
"""Sail a run: steady under an engine that holds torque, power or revs, then the stop."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from benchmarks.worlds.hidden_b.hulls import AIR, Array
from benchmarks.worlds.hidden_b.kernel import air, go
from benchmarks.worlds.hidden_b.setting import Setting
from benchmarks.worlds.hidden_b.weather import band, gusts


@dataclass(frozen=True)
class Track:
    """
    A run as it was; t [s] since the stop.

    Attributes
    ----------
    water_m_s
        Speed through water, ahead.
    ground_m_s : (n, 2)
        Velocity over ground, east and north.
    place_m : (n, 2)
    heading_rad
    shafts_rad_s : (n, shafts)
    pitch
        Of a controllable propeller.
    wind_m_s : (n, 2)
        Apparent: velocity of the air relative to the ship, ahead and to port.
    force_n
        All along the ship, ahead, for the balance of energy.
    steady
        Revs and torque before the stop.
    """

    t: Array
    water_m_s: Array
    ground_m_s: Array
    place_m: Array
    heading_rad: Array
    shafts_rad_s: Array
    pitch: Array
    wind_m_s: Array
    force_n: Array
    steady: tuple[float, float]


def steady_point(setting: Setting, need_n: float) -> tuple[float, float]:
    """
    Return revs and torque of each propeller at the steady speed.

    Parameters
    ----------
    setting
    need_n
        Resistance to be overcome.
    """
    screw = setting.screw
    each = max(need_n, 1.0) / (1.0 - screw.deduction) / screw.shafts
    revs = screw.revs_for(each, setting.speed_m_s)
    return revs, screw.loads(revs, setting.speed_m_s)[1]


def sail(setting: Setting) -> Track:
    """
    Sail a run.
    """
    dt = setting.step_s
    before = 0.0 if setting.quiet else setting.lead_s
    t = np.arange(-round(before / dt), round(setting.coast_s / dt) + 1) * dt
    return sail_at(setting, t)


def sail_at(setting: Setting, t: Array, push_m_s: float = 0.0) -> Track:
    """
    Sail a run at given times; the engine stops at 0, whenever the times begin.

    Parameters
    ----------
    setting
    t
        Even.
    push_m_s
        Change of the first speed, for which the engine was not set.
    """
    hull, dt, n = setting.hull, setting.step_s, len(t)
    heading, lateral = _heading(setting, t)
    wind, flow, lag = _weather(setting, t, heading)
    c, s = np.cos(heading), np.sin(heading)
    past = wind - flow
    ahead, port = past[:, 0] * c + past[:, 1] * s, -past[:, 0] * s + past[:, 1] * c
    at_rest, slope, square = np.zeros(n), np.zeros(n), np.zeros(n)
    for wave in setting.waves:
        rng = None if setting.quiet else setting.stream(7)
        more = wave(t, heading, setting.period_s, rng)
        at_rest, slope = at_rest + more[0], slope + more[1]
    others = []  # those that do not go with the square of the speed
    for timed in setting.timed:
        one, four = (timed(t, np.full(n, u)) for u in (1.0, 2.0))
        if np.allclose(four, 4.0 * one, rtol=1e-12, atol=1e-9):
            square = square + one
        else:
            others.append(timed)
    table, still_air = setting.still_n(), 0.5 * AIR * hull.frontal_m2 * hull.air_drag
    u, lead = setting.speed_m_s, 1
    if not setting.quiet:
        lead = max(1, round(setting.lead_s / dt))
    mean = float(np.mean([
        air(ahead[i] - u, port[i], still_air) + still_air * u * u - at_rest[i] - slope[i] * u
        for i in range(0, lead, 1 + lead // 300)
    ]))  # fmt: skip
    at_first = sum(float(f(np.array([-1.0]), np.array([u]))[0]) for f in setting.timed)
    need = float(np.interp(u, hull.grid_m_s, table)) - mean + at_first
    screw, steady = setting.screw, steady_point(setting, need)
    inertia = setting.mass_kg * (1.0 + setting.n_r)
    body = np.array([hull.grid_m_s[1], inertia, 1.0 + setting.n_r, still_air])
    revs, rows = np.full(screw.shafts, steady[0]), np.empty((3, n))
    turns, u = np.empty((n, screw.shafts)), u + push_m_s
    acts = np.stack([ahead, port, at_rest, slope, square, lag])
    given = (t, acts, table, body, screw.numbers, np.array(steady), revs, rows, turns)
    for i, j in zip(range(n), range(1, n + 1)) if others else [(0, n)]:
        other = float(sum(each(t[i:j], np.array([u]))[0] for each in others))
        u = go(i, j, u, other, *given)
    water, pitch, force = rows
    sideways = lateral * water
    ground = np.stack([water * c - sideways * s, water * s + sideways * c], axis=1) + flow
    steps = 0.5 * (ground[1:] + ground[:-1]) * dt
    place = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    apparent = np.stack([ahead - water, port - sideways], 1)
    return Track(t, water, ground, place, heading, 2 * pi * turns, pitch, apparent, force, steady)


def _heading(setting: Setting, t: Array) -> tuple[Array, Array]:
    """Return heading, and drift to port over speed."""
    yaw = np.zeros(len(t))
    for law in setting.helm:
        yaw += law(t)
    heading = setting.heading_rad + np.cumsum(yaw) * setting.step_s
    drift = -0.5 * yaw * setting.hull.length_m / setting.speed_m_s
    if not setting.quiet:
        rng = setting.stream(5)
        heading = heading + band(rng, np.radians(rng.uniform(0.2, 0.8)), 40.0, 300.0, 10).at(t)
        slow = band(rng, np.radians(rng.uniform(0.3, 2.0)), 400.0, 3000.0, 4).at(t)
        heading = heading + slow * np.clip(t / setting.coast_s, 0.0, 1.0)
    return heading, np.clip(drift, -0.2, 0.2)


def _weather(setting: Setting, t: Array, heading: Array) -> tuple[Array, Array, Array]:
    """Return wind and current over ground, (n, 2), and what the ship lags behind [m/s^2]."""
    day = setting.weather
    wind = np.tile(np.array(day.wind), (len(t), 1))
    for more in setting.wind:
        wind = wind + np.array(more)
    flow = day.current(setting.clock_s + t)
    for more in setting.flow:
        flow = flow + np.array(more)
    lag = np.zeros(len(t))
    along = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    for law in setting.shear:
        change = law(t)
        first = np.array(setting.along_first(1.0, 0.0))
        flow = flow + change[:, None] * first
        lag += np.gradient(change, t) * (along @ first)
    if not setting.quiet:
        rng = setting.stream(6)
        mean = float(np.hypot(*wind[0]))
        past = mean + 0.6 * setting.speed_m_s
        sd = max(day.gust_least, day.gust_share * mean)
        height = 0.5 * setting.hull.frontal_m2 / setting.hull.breadth_m
        for k, share in enumerate((1.0, 0.75)):
            gust = gusts(rng, day.law, past, height, share * sd).at(t)
            if mean > 0.0:
                toward = wind[0] / mean if k == 0 else np.array([-wind[0, 1], wind[0, 0]]) / mean
                wind = wind + gust[:, None] * toward
        shift = float(setting.seed[-1]) * 977.0  # another piece of the same water
        for k in (0, 1):
            flow = flow + day.eddies[k].at(t + shift)[:, None] * np.eye(2)[k]
            lag += day.eddies[k].rate(t + shift) * along[:, k]
    return wind, flow, lag
