# SPDX-License-Identifier: Apache-2.0
"""
Compiled integration of the surge equation.

A day of record is 10^5 steps, and naming an effect needs thousands of records:
in compiled code both are a fraction of a second.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import Float64


class SurgeLaw(NamedTuple):
    """
    What all columns of a simulation share, per unit ship mass.

    Attributes
    ----------
    low_m_s, cell_m_s
        First speed and spacing of the table of resistance.
    resistance : (m, 4)
        Cubic of each cell, highest power first [m/s^2].
    extra_cell_m_s
        Spacing of the columns' tables of extra resistance.
    n_r : (k,)
        Polynomial of n_r in |u|, lowest power first.
    air_1_m
        Air drag over wind |wind|.
    """

    low_m_s: float
    cell_m_s: float
    resistance: Float64
    extra_cell_m_s: float
    n_r: Float64
    air_1_m: float


# what one column adds to the law, `later_s` after its legs say so; a wave's direction is a unit
# vector, its force and all else per unit of the stated mass
_OF_COLUMN = (
    *('speed_m_s', 'later_s', 'wind_east_m_s', 'wind_north_m_s'),
    *('wave_m_s2', 'wave_east', 'wave_north', 'wave_encounter_s_m'),
    *('current_east_m_s', 'current_north_m_s'),
    *('change_east_m_s2', 'change_north_m_s2', 'change_from_s'),
    *('run_down_s', 'residual_fraction', 'residual_decay_s', 'n_r_change', 'mass_fraction'),
)
COLUMN = np.dtype([(name, np.float64) for name in _OF_COLUMN])

# a stretch between two events; the thrust that is ordered is a fraction of the steady one,
# turning_1_m the resistance of turning over u |u|; this and the yaw rate change evenly
_OF_LEG = (
    *('start_s', 'step_s', 'steps', 'thrust_ordered'),
    *('yaw_rad', 'yaw_rate_rad_s', 'yaw_rate_rad_s2', 'turning_1_m', 'turning_1_m_s'),
)
LEG = np.dtype([(name, np.int64 if name == 'steps' else np.float64) for name in _OF_LEG])

Records = NDArray[np.void]


@compiled(inline=True, uncounted=True)
def _magnitude_m_s2(law: SurgeLaw, extra: Float64, magnitude: float) -> float:
    """Look up the resistance at a speed through water."""
    cell = int((magnitude - law.low_m_s) / law.cell_m_s)
    cell = min(max(cell, 0), len(law.resistance) - 1)
    offset = magnitude - law.low_m_s - cell * law.cell_m_s
    r = 0.0
    for power in range(4):
        r = r * offset + float(law.resistance[cell, power])
    if len(extra) == 0:
        return r
    # cubic through the four nearest points
    at = (magnitude - law.low_m_s) / law.extra_cell_m_s
    first = min(max(int(at) - 1, 0), len(extra) - 4)
    p = at - first
    p1, p2, p3 = p - 1.0, p - 2.0, p - 3.0
    added: float = (
        -extra[first] * p1 * p2 * p3 / 6.0
        + extra[first + 1] * p * p2 * p3 / 2.0
        - extra[first + 2] * p * p1 * p3 / 2.0
        + extra[first + 3] * p * p1 * p2 / 6.0
    )
    return r + added


@compiled(inline=True, uncounted=True)
def _retardation_m_s2(
    law: SurgeLaw,
    column: Any,
    extra: Float64,
    speed: float,
    ground: tuple[float, float],
    cos: float,
    sin: float,
    turning_1_m: float,
) -> float:
    """Return all forces but thrust and gusts, `ground` along the ship and to port."""
    magnitude = abs(speed)
    r = _magnitude_m_s2(law, extra, magnitude) + turning_1_m * magnitude * magnitude
    if speed < 0.0:
        r = -r
    # the baseline holds the still-air drag at the speed through water
    ahead = ground[0] - column.wind_east_m_s * cos - column.wind_north_m_s * sin
    abeam = ground[1] - column.wind_north_m_s * cos + column.wind_east_m_s * sin
    r += law.air_1_m * (ahead * np.sqrt(ahead * ahead + abeam * abeam) - speed * magnitude)
    if column.wave_m_s2 != 0.0:
        along = column.wave_east * cos + column.wave_north * sin
        encounter = 1.0 - column.wave_encounter_s_m * speed * along
        r -= column.wave_m_s2 * along * encounter * encounter
    retardation: float = r
    return retardation


@compiled(inline=True, uncounted=True)
def _current_m_s(column: Any, time_s: float) -> tuple[float, float]:
    """Return the velocity of the water to the east and to the north."""
    since = max(time_s - column.change_from_s, 0.0)
    return (
        column.current_east_m_s + column.change_east_m_s2 * since,
        column.current_north_m_s + column.change_north_m_s2 * since,
    )


@compiled(inline=True, uncounted=True)
def _heading(leg: Any, first: tuple[float, float], elapsed: float) -> tuple[float, float]:
    """Return cosine and sine of the heading within a leg; `first` are those at its start."""
    if leg.yaw_rate_rad_s == 0.0 and leg.yaw_rate_rad_s2 == 0.0:
        return first
    yaw = leg.yaw_rad + (leg.yaw_rate_rad_s + 0.5 * leg.yaw_rate_rad_s2 * elapsed) * elapsed
    return np.cos(yaw), np.sin(yaw)


@compiled(inline=True, uncounted=True)
def _rates(
    law: SurgeLaw,
    column: Any,
    extra: Float64,
    leg: Any,
    thrust: tuple[float, float, float],
    heading: tuple[float, float],
    elapsed: float,
    speed: float,
    gust: float,
    water: float,
    water_rate: float,
) -> tuple[float, float, float]:
    """
    Return du/dt, dx/dt and dy/dt.

    `thrust` is the one ordered and what is still above it, nominal and
    residual, at the start of the leg; `heading` cosine and sine of it then.
    """
    cos, sin = _heading(leg, heading, elapsed)
    turning_1_m = leg.turning_1_m + leg.turning_1_m_s * elapsed
    east, north = _current_m_s(column, leg.start_s + elapsed)
    over_ground = speed + water
    ground = (over_ground + east * cos + north * sin, north * cos - east * sin)
    force = thrust[0] + gust
    if thrust[1] != 0.0:
        force += thrust[1] * np.exp(-elapsed / column.run_down_s)
    if thrust[2] != 0.0:
        force += thrust[2] * np.exp(-elapsed / column.residual_decay_s)
    force -= _retardation_m_s2(law, column, extra, speed, ground, cos, sin, turning_1_m)
    if leg.start_s >= column.change_from_s:
        water_rate += column.change_east_m_s2 * cos + column.change_north_m_s2 * sin

    magnitude = abs(speed)
    n_r = 0.0
    for power in range(len(law.n_r) - 1, -1, -1):
        n_r = n_r * magnitude + law.n_r[power]
    # the ship's inertia is over ground, that of the added mass through water
    acceleration = force / (1.0 + column.mass_fraction) - water_rate
    return (
        acceleration / (1.0 + n_r + column.n_r_change),
        over_ground * cos + east,
        over_ground * sin + north,
    )


@compiled
def follow(
    law: SurgeLaw,
    column: Any,
    extra: Float64,
    legs: Records,
    gust_m_s2: Float64,
    water_m_s: Float64,
    time_s: Float64,
    path: Float64,
) -> None:
    """
    Follow one column from the start to the end of its legs.

    Parameters
    ----------
    extra : (e,) or (0,)
        Extra resistance at speeds `extra_cell_m_s` apart [m/s^2].
    legs : (l,)
        Records of `LEG`, one after the other.
    gust_m_s2, water_m_s : (n + 1,) or (0,)
        Disturbances at all steps, linear between.
    time_s : (m,)
        When to look, ascending, within the legs, `later_s` after they say so.
    path : (m, 5)
        Filled with speed through water, x, y, and the velocity over ground.

    Notes
    -----
    Runge-Kutta of fourth order with its interpolant of third order between
    the steps; all forces are smooth within a leg.
    """
    u, later = column.speed_m_s, column.later_s
    cos, sin = np.cos(legs[0].yaw_rad), np.sin(legs[0].yaw_rad)
    east, north = column.current_east_m_s, column.current_north_m_s
    x, y = later * (u * cos + east), later * (u * sin + north)
    ground = (u + east * cos + north * sin, north * cos - east * sin)
    steady = _retardation_m_s2(law, column, extra, u, ground, cos, sin, 0.0)
    nominal = residual = 1.0  # thrust over the steady one, were it all of this kind
    disturbed = len(gust_m_s2) > 0
    gust = gust_change = water = water_change = 0.0
    sample = done = 0
    for i_leg in range(len(legs)):
        leg = legs[i_leg]
        h = leg.step_s
        length = h * leg.steps
        heading = (np.cos(leg.yaw_rad), np.sin(leg.yaw_rad))
        ordered = leg.thrust_ordered
        above = nominal - ordered if column.run_down_s > 0.0 else 0.0
        above_residual = residual - ordered if column.residual_fraction != 0.0 else 0.0
        thrust = (
            steady * ordered,
            steady * above * (1.0 - column.residual_fraction),
            steady * above_residual * column.residual_fraction,
        )
        nominal = residual = ordered
        if above != 0.0:
            nominal += above * np.exp(-length / column.run_down_s)
        if above_residual != 0.0:
            residual += above_residual * np.exp(-length / column.residual_decay_s)
        for step in range(leg.steps):
            if disturbed:
                gust, water = gust_m_s2[done], water_m_s[done]
                gust_change = gust_m_s2[done + 1] - gust
                water_change = water_m_s[done + 1] - water
                done += 1
            start = step * h
            middle, end = start + 0.5 * h, start + h
            rate = water_change / h
            u1, x1, y1 = _rates(
                law, column, extra, leg, thrust, heading, start, u, gust, water, rate
            )
            g, w = gust + 0.5 * gust_change, water + 0.5 * water_change
            u2, x2, y2 = _rates(
                law, column, extra, leg, thrust, heading, middle, u + 0.5 * h * u1, g, w, rate
            )
            u3, x3, y3 = _rates(
                law, column, extra, leg, thrust, heading, middle, u + 0.5 * h * u2, g, w, rate
            )
            g, w = gust + gust_change, water + water_change
            u4, x4, y4 = _rates(
                law, column, extra, leg, thrust, heading, end, u + h * u3, g, w, rate
            )
            is_last = i_leg == len(legs) - 1 and step == leg.steps - 1
            while sample < len(time_s) and (is_last or time_s[sample] - later < leg.start_s + end):
                p = (time_s[sample] - later - leg.start_s - start) / h
                b1 = h * p * (1.0 - p * (1.5 - p * (2.0 / 3.0)))
                b2 = h * p * p * (1.0 - p * (2.0 / 3.0))
                b4 = h * p * p * (p * (2.0 / 3.0) - 0.5)
                path[sample, 0] = u + b1 * u1 + b2 * (u2 + u3) + b4 * u4
                path[sample, 1] = x + b1 * x1 + b2 * (x2 + x3) + b4 * x4
                path[sample, 2] = y + b1 * y1 + b2 * (y2 + y3) + b4 * y4
                along = path[sample, 0] + water + p * water_change
                at = start + p * h
                cos, sin = _heading(leg, heading, at)
                east, north = _current_m_s(column, leg.start_s + at)
                path[sample, 3] = along * cos + east
                path[sample, 4] = along * sin + north
                sample += 1
            u += h * (u1 + 2.0 * u2 + 2.0 * u3 + u4) / 6.0
            x += h * (x1 + 2.0 * x2 + 2.0 * x3 + x4) / 6.0
            y += h * (y1 + 2.0 * y2 + 2.0 * y3 + y4) / 6.0


@compiled
def follow_columns(
    law: SurgeLaw,
    columns: Records,
    extra: Float64,
    legs: Records,
    own_legs: NDArray[np.int64],
    time_s: Float64,
    paths: Float64,
) -> None:
    """
    Follow columns without disturbances.

    Parameters
    ----------
    columns : (k,)
        Records of `COLUMN`.
    extra : (k, e)
    legs : (l,)
    own_legs : (k, 2)
        Where the legs of each column begin and end.
    time_s : (m,)
    paths : (k, m, 5)
        Filled as `path` is there.
    """
    none = np.empty(0)
    for i in range(len(columns)):
        mine = legs[own_legs[i, 0] : own_legs[i, 1]]
        follow(law, columns[i], extra[i], mine, none, none, time_s, paths[i])
