# SPDX-License-Identifier: Apache-2.0
"""
How a hull moves in the plane, by an integrator of its own.

Surge and sway through the water, position over ground. What depends on the
speed is tabulated, what depends on the time is given on the steps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from benchmarks.worlds.hidden.hull import Array

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
