# SPDX-License-Identifier: Apache-2.0
"""
One run: steady sailing, the stop, and the coast, with all that acts on it.

The hull moves in the plane by an integrator of its own: surge and sway through the water,
position over ground. What depends on the speed is tabulated, what depends on the time is given
on the steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit

from benchmarks.worlds.hidden.effect import Effect, Leg
from benchmarks.worlds.hidden.hull import SHAPE_TERMS, Array, Hull

TABLE_POINTS = 400


class Drive(NamedTuple):
    """
    What moves the hull; per unit of mass.

    Attributes
    ----------
    time_s : (n,)
        Ascending, 0 at the stop.
    push_m_s2 : (n,)
        Thrust and other forces along the ship that do not depend on its speed.
    drag_1_m : (n,)
        Further drag over the square of the speed.
    heading_rad : (n,)
    drift_m_s : (n,)
        Sway through the water that is approached.
    water_m_s : (n, 2)
        Velocity of the water, east and north.
    steady_m_s2, coasting_m_s2, inertia : (m,)
        Resistance before and after the stop, 1 + n_r, at speeds from 0 on.
    cell_m_s
        Between two speeds of the tables.
    sway_s
        Time constant of the sway.
    """

    time_s: Array
    push_m_s2: Array
    drag_1_m: Array
    heading_rad: Array
    drift_m_s: Array
    water_m_s: Array
    steady_m_s2: Array
    coasting_m_s2: Array
    inertia: Array
    cell_m_s: float
    sway_s: float


@njit(cache=True)
def integrate(drive: Drive, speed_m_s: float) -> Array:
    """
    Return surge, sway [m/s], east and north [m] at every time.

    Kutta's 3/8 rule; what is given on the steps is linear between them.

    Parameters
    ----------
    drive
    speed_m_s
        Surge through the water at the first time; the position is 0 there.

    Returns
    -------
    (n, 4)
    """
    time = drive.time_s
    path = np.zeros((len(time), 4))
    path[0, 0] = speed_m_s
    state = path[0].copy()
    for i in range(len(time) - 1):
        h = time[i + 1] - time[i]
        k1 = _slope(drive, i, 0.0, state)
        k2 = _slope(drive, i, 1.0 / 3.0, state + h / 3.0 * k1)
        k3 = _slope(drive, i, 2.0 / 3.0, state + h * (k2 - k1 / 3.0))
        k4 = _slope(drive, i, 1.0, state + h * (k1 - k2 + k3))
        state = state + h / 8.0 * (k1 + 3.0 * k2 + 3.0 * k3 + k4)
        path[i + 1] = state
    return path


@njit(cache=True)
def _slope(drive: Drive, i: int, part: float, state: Array) -> Array:
    rest = 1.0 - part
    u, v = state[0], state[1]
    resistance = drive.coasting_m_s2 if drive.time_s[i] >= 0.0 else drive.steady_m_s2
    heading = rest * drive.heading_rad[i] + part * drive.heading_rad[i + 1]
    sine, cosine = np.sin(heading), np.cos(heading)
    step = drive.time_s[i + 1] - drive.time_s[i]
    east = drive.water_m_s[i + 1, 0] - drive.water_m_s[i, 0]
    north = drive.water_m_s[i + 1, 1] - drive.water_m_s[i, 1]
    # water that accelerates takes the added mass along, not the ship
    lost = (east * cosine + north * sine) / step
    push = rest * drive.push_m_s2[i] + part * drive.push_m_s2[i + 1]
    area = rest * drive.drag_1_m[i] + part * drive.drag_1_m[i + 1]
    drift = rest * drive.drift_m_s[i] + part * drive.drift_m_s[i + 1]
    drag = np.sign(u) * _at(resistance, drive.cell_m_s, abs(u)) + area * u * abs(u)
    result = np.empty(4)
    result[0] = (push - drag - lost) / _at(drive.inertia, drive.cell_m_s, abs(u))
    result[1] = (drift - v) / drive.sway_s
    water_east = rest * drive.water_m_s[i, 0] + part * drive.water_m_s[i + 1, 0]
    water_north = rest * drive.water_m_s[i, 1] + part * drive.water_m_s[i + 1, 1]
    result[2] = u * cosine - v * sine + water_east
    result[3] = u * sine + v * cosine + water_north
    return result


@njit(cache=True)
def _at(table: Array, cell: float, speed: float) -> float:
    place = min(speed / cell, len(table) - 1.000001)
    k = int(place)
    return table[k] + (place - k) * (table[k + 1] - table[k])


LEAD_IN_S = 1800.0
_FINE_FROM_S = -10.0
_FREE_WHEEL = 0.35  # shaft speed of a free-wheeling propeller over that under power


@dataclass(frozen=True)
class World:
    """
    How the ship really differs from her file, effects apart.

    Attributes
    ----------
    friction, wave
        Relative errors of the stated coefficients.
    shape : (SHAPE_TERMS,)
        Relative error of the resistance, over the speeds.
    n_r, run_down_s
        Errors.
    """

    friction: float = 0.0
    wave: float = 0.0
    shape: tuple[float, ...] = (0.0,) * SHAPE_TERMS
    n_r: float = 0.0
    run_down_s: float = 0.0


@dataclass(frozen=True)
class Disturbance:
    """
    What is never still, on the times of `times`.

    Attributes
    ----------
    force_m_s2 : (n,)
        Gusts, over the mass.
    water_m_s : (n, 2)
        Slow current, east and north.
    swing_rad : (n,)
        Wander of the heading.
    """

    force_m_s2: Array
    water_m_s: Array
    swing_rad: Array

    @classmethod
    def none(cls, leg: Leg) -> Disturbance:
        """
        Return stillness.
        """
        n = len(times(leg))
        return cls(np.zeros(n), np.zeros((n, 2)), np.zeros(n))


@dataclass(frozen=True)
class Motion:
    """
    What happened, at times after the stop.

    Attributes
    ----------
    time_s : (n,)
    surge_m_s : (n,)
        Through the water.
    position_m : (n, 2)
        East and north of the start of the lead-in.
    heading_rad : (n,)
    shaft_rad_s : (n,)
    """

    time_s: Array
    surge_m_s: Array
    position_m: Array
    heading_rad: Array
    shaft_rad_s: Array


def times(leg: Leg) -> Array:
    """
    Return the steps of a run: coarse while it is steady.
    """
    coarse = np.arange(-LEAD_IN_S, _FINE_FROM_S, 5.0)
    return np.concatenate([coarse, np.arange(_FINE_FROM_S, leg.duration_s + 1.0)])


def sail(
    leg: Leg,
    effects: tuple[Effect, ...],
    *,
    heading_rad: float,
    first_heading_rad: float,
    world: World,
    disturbance: Disturbance,
) -> Motion:
    """
    Sail and coast.

    Parameters
    ----------
    leg
    effects
        That are hidden in it.
    heading_rad
        Of this run.
    first_heading_rad
        Of the first run, from which earth-fixed effects count.
    world, disturbance
    """
    time = times(leg)
    drive = _drive(leg, effects, time, world, first_heading_rad)
    drive = drive._replace(
        push_m_s2=drive.push_m_s2 + disturbance.force_m_s2,
        heading_rad=drive.heading_rad + heading_rad + disturbance.swing_rad,
        water_m_s=drive.water_m_s + disturbance.water_m_s,
    )
    path = integrate(drive, leg.speed_m_s)
    return Motion(
        time,
        path[:, 0],
        path[:, 2:],
        drive.heading_rad,
        _shaft(leg, effects, time, path[:, 0], world),
    )


def coasting_m_s2(
    leg: Leg,
    effects: tuple[Effect, ...],
    speed: Array,
    *,
    first_heading_rad: float,
    world: World,
) -> Array:
    """
    Return the true r [m/s^2] at speeds: of hull, stopped propeller and what else goes with speed.

    Helm, gusts and a current that changes are no part of it.
    """
    drive = _drive(leg, effects, times(leg), world, first_heading_rad)
    return np.interp(speed, _speeds(leg.hull), drive.coasting_m_s2)


def _drive(
    leg: Leg, effects: tuple[Effect, ...], time: Array, world: World, first_heading_rad: float
) -> Drive:
    hull = leg.hull
    n_r, heavier = world.n_r, 1.0
    for effect in effects:
        change, factor = effect.inertia(hull)
        n_r, heavier = n_r + change, heavier * factor
    mass = hull.mass_kg * heavier

    ahead, to_port = np.zeros_like(time), np.zeros_like(time)
    force, area, swing = np.zeros_like(time), np.zeros_like(time), np.zeros_like(time)
    residual, cross_wind = np.zeros_like(time), 0.0
    for effect in effects:
        along, across = effect.water_m_s(leg, time)
        ahead, to_port = ahead + along, to_port + across
        force = force + effect.force_n(leg, time)
        area = area + effect.drag_area_m2(leg, time)
        swing = swing + effect.swing_rad(leg, time)
        residual = residual + effect.thrust(leg, time)
        cross_wind += leg.sign * effect.wind_m_s()[1]

    speed = _speeds(hull)
    steady = _resistance_n(leg, effects, speed, world, leg.sign * float(ahead[0]))
    coasting = steady + sum(effect.coasting_drag_n(leg, speed) for effect in effects)
    at_start = np.interp(leg.speed_m_s, speed, steady)
    at_start += 0.5 * hull.density_kg_m3 * area[0] * leg.speed_m_s**2

    run_down_s = max(hull.run_down_s + world.run_down_s, 1.0)
    thrust = np.exp(-np.maximum(time, 0.0) / run_down_s) + residual
    yaw_rate = np.gradient(swing, time)
    sine, cosine = np.sin(first_heading_rad), np.cos(first_heading_rad)
    return Drive(
        time_s=time,
        push_m_s2=(thrust * at_start + force) / mass,
        drag_1_m=0.5 * hull.density_kg_m3 * area / mass,
        heading_rad=swing,
        # outwards in a turn, to leeward of a wind from port
        drift_m_s=-0.4 * hull.length_m * yaw_rate - 0.01 * cross_wind,
        water_m_s=np.column_stack(
            [ahead * cosine - to_port * sine, ahead * sine + to_port * cosine]
        ),
        steady_m_s2=steady / mass,
        coasting_m_s2=coasting / mass,
        inertia=1.0 + hull.added_mass(speed) + n_r,
        cell_m_s=float(speed[1]),
        sway_s=hull.length_m / hull.speed_m_s,
    )


def _speeds(hull: Hull) -> Array:
    return np.linspace(0.0, 1.25 * hull.speed_m_s, TABLE_POINTS)


@lru_cache(maxsize=4)
def _stated_n(hull: Hull) -> tuple[Array, Array]:
    """Return friction and wave resistance at the speeds of the table."""
    return hull.friction_n(_speeds(hull)), hull.wave_n(_speeds(hull))


def _resistance_n(
    leg: Leg, effects: tuple[Effect, ...], speed: Array, world: World, current_m_s: float
) -> Array:
    """Return the resistance [N] while sailing."""
    hull = leg.hull
    friction, wave = _stated_n(hull)
    water = (1.0 + world.friction) * friction + (1.0 + world.wave) * wave
    water *= 1.0 + hull.shape(speed, np.array(world.shape))
    # still air moves with the ground, not with the water
    total: Array = water + hull.air_n(speed + current_m_s)
    return total + sum(effect.drag_n(leg, speed) for effect in effects)


def _shaft(
    leg: Leg, effects: tuple[Effect, ...], time: Array, surge: Array, world: World
) -> Array:
    hull = leg.hull
    powered = hull.shaft_rad_s * surge / hull.speed_m_s
    free = _FREE_WHEEL * powered
    run_down_s = max(hull.run_down_s + world.run_down_s, 1.0)
    at_stop = np.interp(0.0, time, powered)
    after = np.exp(-np.maximum(time, 0.0) / run_down_s)
    shaft = np.where(time > 0.0, free + (at_stop - free) * after, powered)
    for effect in effects:
        shaft = effect.shaft(leg, time, surge, shaft)
    return shaft
