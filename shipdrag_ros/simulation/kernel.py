# SPDX-License-Identifier: Apache-2.0
"""
Compiled integration of the surge equation.

A day of record is 10^5 steps and a benchmark needs hundreds of records: in
compiled code both are a fraction of a second.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from shipdrag_ros.samples import Float64


class Law(NamedTuple):
    """
    What does not change during a record, per unit ship mass.

    Attributes
    ----------
    low_m_s, cell_m_s
        First speed and spacing of the table of resistance.
    resistance : (4, m)
        Cubic of each cell, highest power first [m/s^2].
    n_r : (k,)
        Polynomial of n_r in |u|, lowest power first.
    air_1_m
        Air drag over wind |wind|.
    current_m_s : (2,)
        East and north.
    """

    low_m_s: float
    cell_m_s: float
    resistance: Float64
    n_r: Float64
    air_1_m: float
    current_m_s: Float64


class Leg(NamedTuple):
    """
    A stretch between two events; times count from its start.

    Attributes
    ----------
    step_s
        Length of a step.
    thrust_m_s2, thrust_excess_m_s2, run_down_s
        Thrust is the first, plus the second times exp(-t / run_down_s).
    yaw_rad, yaw_rate_rad_s
    turning_1_m
        Resistance of turning over u |u|.
    gust_m_s2, water_m_s : (n + 1,)
        Disturbances at the steps, linear between.
    """

    step_s: float
    thrust_m_s2: float
    thrust_excess_m_s2: float
    run_down_s: float
    yaw_rad: float
    yaw_rate_rad_s: float
    turning_1_m: float
    gust_m_s2: Float64
    water_m_s: Float64


@njit(cache=True)
def _rates(law: Law, leg: Leg, step: int, part: float, speed: float) -> tuple[float, float, float]:
    """Return du/dt, dx/dt and dy/dt at a part of a step."""
    elapsed = (step + part) * leg.step_s
    gust = leg.gust_m_s2[step] + part * (leg.gust_m_s2[step + 1] - leg.gust_m_s2[step])
    change = leg.water_m_s[step + 1] - leg.water_m_s[step]
    water = leg.water_m_s[step] + part * change
    yaw = leg.yaw_rad + leg.yaw_rate_rad_s * elapsed
    cos, sin = np.cos(yaw), np.sin(yaw)
    ground = speed + water + law.current_m_s[0] * cos + law.current_m_s[1] * sin

    magnitude = abs(speed)
    cell = int((magnitude - law.low_m_s) / law.cell_m_s)
    cell = min(max(cell, 0), law.resistance.shape[1] - 1)
    offset = magnitude - law.low_m_s - cell * law.cell_m_s
    r = 0.0
    for power in range(4):
        r = r * offset + law.resistance[power, cell]
    r += leg.turning_1_m * magnitude * magnitude
    if speed < 0.0:
        r = -r
    # the baseline holds the still-air drag at the speed through water
    r += law.air_1_m * (ground * abs(ground) - speed * magnitude)

    n_r = 0.0
    for power in range(len(law.n_r) - 1, -1, -1):
        n_r = n_r * magnitude + law.n_r[power]
    thrust = leg.thrust_m_s2
    if leg.thrust_excess_m_s2 != 0.0:
        thrust += leg.thrust_excess_m_s2 * np.exp(-elapsed / leg.run_down_s)
    # the ship's inertia is over ground, that of the added mass through water
    acceleration = (thrust + gust - r - change / leg.step_s) / (1.0 + n_r)
    over_ground = speed + water
    return (
        acceleration,
        over_ground * cos + law.current_m_s[0],
        over_ground * sin + law.current_m_s[1],
    )


@njit(cache=True)
def integrate(law: Law, leg: Leg, speed: float, x: float, y: float) -> Float64:
    """
    Follow one leg from its initial state.

    Returns
    -------
    (n + 1, 3)
        Speed through water, x and y at the steps.

    Notes
    -----
    Runge-Kutta of fourth order; all forces are smooth within a step.
    """
    n = len(leg.gust_m_s2) - 1
    h = leg.step_s
    path = np.empty((n + 1, 3))
    path[0, 0], path[0, 1], path[0, 2] = speed, x, y
    for i in range(n):
        u = path[i, 0]
        u1, x1, y1 = _rates(law, leg, i, 0.0, u)
        u2, x2, y2 = _rates(law, leg, i, 0.5, u + 0.5 * h * u1)
        u3, x3, y3 = _rates(law, leg, i, 0.5, u + 0.5 * h * u2)
        u4, x4, y4 = _rates(law, leg, i, 1.0, u + h * u3)
        path[i + 1, 0] = u + h * (u1 + 2.0 * u2 + 2.0 * u3 + u4) / 6.0
        path[i + 1, 1] = path[i, 1] + h * (x1 + 2.0 * x2 + 2.0 * x3 + x4) / 6.0
        path[i + 1, 2] = path[i, 2] + h * (y1 + 2.0 * y2 + 2.0 * y3 + y4) / 6.0
    return path
