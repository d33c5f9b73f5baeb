# SPDX-License-Identifier: Apache-2.0
"""Sail a run: steady under an engine that holds torque, power or revs, then the stop."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, pi

import numpy as np

from benchmarks.worlds.hidden_b.hulls import AIR, Array, Hull
from benchmarks.worlds.hidden_b.screws import Screw
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


def air_force_n(hull: Hull, ahead: float, port: float) -> float:
    """
    Return the force of the relative wind along the ship, ahead positive.

    Longitudinal coefficient of a boxy ship: cos(a) with a third harmonic, as in Isherwood's data.
    """
    square = ahead * ahead + port * port
    if square < 1e-12:
        return 0.0
    c = ahead / square**0.5
    shape = c - 0.12 * (4.0 * c**3 - 3.0 * c - c)
    return 0.5 * AIR * hull.frontal_m2 * hull.air_drag * square * shape


def steady_point(setting: Setting, need_n: float) -> tuple[Screw, float, float]:
    """
    Return the propeller, its revs and its torque at the steady speed.

    Parameters
    ----------
    setting
    need_n
        Resistance to be overcome.
    """
    screw = setting.screw
    each = max(need_n, 1.0) / (1.0 - screw.deduction) / screw.shafts
    revs = screw.revs_for(each, setting.speed_m_s)
    return screw, revs, screw.loads(revs, setting.speed_m_s)[1]


def sail(setting: Setting) -> Track:
    """
    Sail a run.
    """
    hull, dt = setting.hull, setting.step_s
    before = 0.0 if setting.quiet else setting.lead_s
    t = np.arange(-round(before / dt), round(setting.coast_s / dt) + 1) * dt
    n = len(t)
    heading, lateral = _heading(setting, t)
    wind, flow, lag = _weather(setting, t, heading)
    c, s = np.cos(heading), np.sin(heading)
    wind_ahead, wind_port = wind[:, 0] * c + wind[:, 1] * s, -wind[:, 0] * s + wind[:, 1] * c
    flow_ahead, flow_port = flow[:, 0] * c + flow[:, 1] * s, -flow[:, 0] * s + flow[:, 1] * c
    waves = np.zeros(n), np.zeros(n)
    for law in setting.waves:
        rng = None if setting.quiet else setting.stream(7)
        at_rest, slope = law(t, heading, setting.period_s, rng)
        waves = waves[0] + at_rest, waves[1] + slope
    table, spacing = setting.still_n().tolist(), float(hull.grid_m_s[1])
    inertia = setting.mass_kg * (1.0 + setting.n_r)
    still_air = 0.5 * AIR * hull.frontal_m2 * hull.air_drag

    def resistance(u: float) -> float:
        place = min(abs(u) / spacing, len(table) - 1.001)
        i = int(place)
        found = table[i] + (place - i) * (table[i + 1] - table[i])
        return found if u >= 0.0 else -found

    def outside(i: int, u: float) -> float:
        ahead, port = wind_ahead[i] - u - flow_ahead[i], wind_port[i] - flow_port[i]
        air = air_force_n(hull, ahead, port) + still_air * u * abs(u)
        return air - waves[0][i] - waves[1][i] * u

    u = setting.speed_m_s
    lead = max(1, round(before / dt))
    mean = float(np.mean([outside(i, u) for i in range(0, lead, 1 + lead // 300)]))
    timed = sum(float(f(np.array([-1.0]), np.array([u]))[0]) for f in setting.timed)
    screw, revs0, torque0 = steady_point(setting, resistance(u) - mean + timed)
    shafts = _Shafts(screw, (revs0, torque0), setting.quiet)
    water, force = np.empty(n), np.empty(n)
    turns, pitch = np.empty((n, screw.shafts)), np.empty(n)
    one_t, one_u = np.empty(1), np.empty(1)
    for i in range(n):
        thrust = shafts.step(float(t[i]), u, dt)
        water[i], turns[i], pitch[i] = u, shafts.revs, shafts.pitch
        total = thrust - resistance(u) + outside(i, u)
        one_t[0], one_u[0] = t[i], u
        for each in setting.timed:
            total -= each(one_t, one_u)[0]
        force[i] = total
        rate = total / inertia - lag[i] / (1.0 + setting.n_r)
        after = u + rate * dt
        u = after - 0.5 * dt * (resistance(after) - resistance(u)) / inertia
    sideways = lateral * water
    ground = np.stack(
        [water * c - sideways * s + flow[:, 0], water * s + sideways * c + flow[:, 1]], axis=1
    )
    steps = 0.5 * (ground[1:] + ground[:-1]) * dt
    place = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    apparent = np.stack([wind_ahead - water - flow_ahead, wind_port - flow_port - sideways], 1)
    return Track(
        t, water, ground, place, heading, 2 * pi * turns, pitch, apparent, force, (revs0, torque0)
    )


class _Shafts:
    """The shafts of a ship, step by step."""

    def __init__(self, screw: Screw, steady: tuple[float, float], quiet: bool) -> None:
        self.screw, self.steady = screw, steady
        self.revs = [steady[0]] * screw.shafts
        self.pitch = screw.pitch
        self.inertia = screw.inertia_s * steady[1] / max(steady[0], 1e-9)
        self.quiet = quiet

    def step(self, t: float, u: float, dt: float) -> float:
        """
        Return the force of all propellers on the ship, and go on by a step.
        """
        screw, total = self.screw, 0.0
        if screw.drive == 'cpp':
            gone = min(max(t / screw.ramp_s, 0.0), 1.0)
            self.pitch = screw.pitch * (1.0 - gone)
        for k in range(screw.shafts):
            late = screw.stagger_s * k
            thrust = screw.loads(self.revs[k], u, self.pitch)[0]
            if screw.drive == 'folding' and t >= late:
                thrust = thrust * max(0.0, 1.0 - (t - late) / screw.ramp_s)
            total += thrust * (1.0 - screw.deduction) if thrust > 0.0 else thrust
            self.revs[k] = self._turn(self.revs[k], t, u, dt, late)
        return total

    def _turn(self, revs: float, t: float, u: float, dt: float, late: float) -> float:
        screw, steady = self.screw, self.steady
        since = t - late
        if screw.drive == 'cpp':
            gone = min(max(since / screw.ramp_s, 0.0), 1.0)
            return steady[0] * (1.0 - gone * (1.0 - screw.stopped))
        if screw.drive in ('locked', 'folding') and since >= 0.0:
            return max(0.0, steady[0] * (1.0 - since / screw.ramp_s))
        if since < 0.0 and screw.hold == 'revs':
            return steady[0]
        parts = ceil(12.0 * dt / screw.inertia_s)
        for _ in range(parts):
            drive = screw.engine(t, revs, steady, late)
            load = screw.loads(revs, u)[1]
            if since >= 0.0:
                load += screw.friction(revs, steady)
            revs += (drive - load) / self.inertia * dt / parts
            if revs <= 0.0:
                return 0.0
        return revs


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
