# SPDX-License-Identifier: Apache-2.0
"""
How fast this ship should slow down when its engine stops.

Only to examine a window that a person claims: whether she slows there as without an engine.
Nothing estimated depends on it.
"""

from __future__ import annotations

import math

import numpy as np

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.baseline import ittc57

# Without a baseline: R = 0.5 rho S v^2 C_T with S = 2.6 sqrt(V L), Taylor's wetted-surface
# coefficient of ordinary hulls, and C_T = 1.25 C_F + 0.0004, no wave making. Both are good
# to a quarter or so, and waves come on top.
_TAYLOR = 2.6
_ALLOWANCE = 4e-4
_FORM = 1.25


def expect(ship: Ship, speed_m_s: float) -> float:
    """
    Return the deceleration [m/s^2] without an engine, as far as the ship file says it.

    Notes
    -----
    From the baseline where it covers the speed, else from length and volume.
    """
    mass = ship.mass_kg * (1.0 + float(ship.n_r(speed_m_s)))
    try:
        low, high = ship.baseline_range_m_s
        if not low < speed_m_s <= high:
            raise ShipdragError('outside the baseline')
        resistance = ship.resistance_n(np.array(speed_m_s))
    except ShipdragError:
        surface = _TAYLOR * math.sqrt(ship.displaced_volume_m3 * ship.length_m)
        reynolds = speed_m_s * ship.length_m / ship.water.kinematic_viscosity_m2_s
        friction = float(ittc57(np.array(reynolds)))
        force = (
            0.5 * ship.water.density_kg_m3 * surface * speed_m_s**2
            * (_FORM * friction + _ALLOWANCE)
        )  # fmt: skip
        return force / mass
    return float(resistance) / mass
