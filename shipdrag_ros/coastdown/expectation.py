# SPDX-License-Identifier: Apache-2.0
"""
How fast this ship should slow down when its engine stops.

Only to examine a window that a person claims: whether she slows there as without an engine.
Nothing estimated depends on it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

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
_EXPONENT = 2.5  # of the resistance of a hull of which nothing is known


@dataclass(frozen=True)
class Coasting:
    """
    What is expected of a coastdown at one speed.

    Attributes
    ----------
    deceleration_m_s2
        At that speed.
    exponent
        The p of v' = -c v^p about that speed.
    fraction_min
        Fraction of the expected deceleration below which power may be on.
    """

    deceleration_m_s2: float
    exponent: float
    fraction_min: float

    def loss(self, speed_m_s: float, time_s: float) -> float:
        """
        Return the expected loss of speed [m/s] after a time, v' = -c v^p.
        """
        p = max(self.exponent, 1.01)
        grown = 1.0 + (p - 1.0) * self.deceleration_m_s2 * time_s / speed_m_s
        return float(speed_m_s * (1.0 - grown ** (-1.0 / (p - 1.0))))

    def time_s(self, speed_m_s: float, *, left: float) -> float:
        """
        Return the expected time [s] after which this part of a speed is left.
        """
        p = max(self.exponent, 1.01)
        grown = left ** (1.0 - p)
        return float((grown - 1.0) / (p - 1.0) * speed_m_s / self.deceleration_m_s2)


def expect(ship: Ship, speed_m_s: float) -> Coasting:
    """
    Return what the ship file says of a coastdown from a speed.

    Notes
    -----
    From the baseline where it covers the speed, else from length and volume.
    """
    mass = ship.mass_kg * (1.0 + float(ship.n_r(speed_m_s)))
    try:
        low, high = ship.baseline_range_m_s
        near = np.clip(speed_m_s * np.array([0.9, 1.0]), low, high)
        slower, faster = ship.resistance_n(near)
        if not low < speed_m_s <= high:
            raise ShipdragError('outside the baseline')
    except ShipdragError:
        surface = _TAYLOR * math.sqrt(ship.displaced_volume_m3 * ship.length_m)
        reynolds = speed_m_s * ship.length_m / ship.water.kinematic_viscosity_m2_s
        friction = float(ittc57(np.array(reynolds)))
        force = (
            0.5 * ship.water.density_kg_m3 * surface * speed_m_s**2
            * (_FORM * friction + _ALLOWANCE)
        )  # fmt: skip
        return Coasting(force / mass, _EXPONENT, 0.5)
    exponent = math.log(faster / slower) / math.log(near[1] / near[0])
    return Coasting(float(faster) / mass, float(exponent), 0.7)
