# SPDX-License-Identifier: Apache-2.0
"""How the water slows a hull: from the baseline, else from length and volume alone."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.sections import ittc57

# Taylor's wetted-surface coefficient of ordinary hulls; C_T = 1.25 C_F + 0.0004
_TAYLOR, _FORM, _ALLOWANCE = 2.6, 1.25, 4e-4
_HUMP = 0.45  # Froude number from which on waves make no more
_POINTS = 64
_SPEEDS = (0.03, 1.2)  # Froude numbers of the table
_ANY_SPEEDS = (0.014, 1.2)


class HullPrior(NamedTuple):
    """
    ln of the resistance per moving mass against ln u, and what is known of both.

    Attributes
    ----------
    first, step
        ln u of the first point, and between two.
    curve : (points,)
        ln of the resistance per moving mass [m/s^2].
    level, level_var, exponent, exponent_var
        Of what comes on top: a constant and a power of u.
    length_m
        Of the hull.
    sails
        ln of the speed at which she is likely to sail.
    run_down : (run-downs,)
        Share of each run-down.
    """

    first: float
    step: float
    curve: Float64
    level: float
    level_var: float
    exponent: float
    exponent_var: float
    length_m: float
    sails: float
    run_down: Float64

    @property
    def bin_s(self) -> float:
        """Length of a bin that suits her [s]: a smaller craft is quicker."""
        return float(n.BIN_S) * min(1.0, math.sqrt(self.length_m / float(n.CRAFT_M)))

    @classmethod
    def of(cls, ship: Ship) -> HullPrior:
        """
        Take it from a ship file, with or without a baseline.
        """
        log_u = _points(ship, _SPEEDS)
        speed = np.exp(log_u)
        known = _baseline(ship, speed) or (_generic(ship, speed), n.RESISTANCE, n.EXPONENT)
        return cls._made(ship, log_u, *known)

    @classmethod
    def any_body(cls, ship: Ship) -> HullPrior:
        """
        Take it for whatever glides: a hull of length and volume has its friction at least.
        """
        log_u = _points(ship, _ANY_SPEEDS)
        return cls._made(ship, log_u, _friction(ship, np.exp(log_u)), n.ANY_BODY, n.ANY_EXPONENT)

    @classmethod
    def _made(
        cls, ship: Ship, log_u: Float64, curve: Float64, level: Float64, exponent: Float64
    ) -> HullPrior:
        return cls(
            float(log_u[0]),
            float(log_u[1] - log_u[0]),
            curve,
            float(level[0]),
            float(level[1] ** 2),
            float(exponent[0]),
            float(exponent[1] ** 2),
            ship.length_m,
            math.log(float(ship.speed(float(n.SAILS[0])))),
            _run_down(ship),
        )


def _points(ship: Ship, froude: tuple[float, float]) -> Float64:
    slow, fast = (math.log(float(ship.speed(each))) for each in froude)
    return np.linspace(slow, fast, _POINTS)


def _run_down(ship: Ship) -> Float64:
    """Return the shares of the run-downs; what the ship file says of them counts twice."""
    known = ship.propulsion
    if known is None or not known.run_down_s > 0.0:
        return n.RUN_DOWN_SHARE.copy()
    off = np.log(n.RUN_DOWN_S / (3.0 * known.run_down_s))
    sd = math.hypot(float(n.RUN_DOWN_FILE_SD), known.sd / known.run_down_s)
    share = n.RUN_DOWN_SHARE * np.exp(-0.5 * (off / sd) ** 2)
    return np.asarray(share / share.sum())


def _moving(ship: Ship, speed: Float64) -> Float64:
    return np.array([ship.mass_kg * (1.0 + float(ship.n_r(each))) for each in speed])


def _friction(ship: Ship, speed: Float64) -> Float64:
    surface = _TAYLOR * math.sqrt(ship.displaced_volume_m3 * ship.length_m)
    friction = ittc57(speed * ship.length_m / ship.water.kinematic_viscosity_m2_s)
    force = 0.5 * ship.water.density_kg_m3 * surface * speed**2 * (_FORM * friction + _ALLOWANCE)
    return np.asarray(np.log(force / _moving(ship, speed)))


def _generic(ship: Ship, speed: Float64) -> Float64:
    """Return the curve of a hull of which length and volume are known: friction and waves."""
    at_hump = np.minimum(speed, float(ship.speed(_HUMP)))
    waves = _friction(ship, at_hump) + 4.0 * np.log(at_hump / float(ship.speed(n.WAVES)))
    return np.logaddexp(_friction(ship, speed), waves)


def _baseline(ship: Ship, speed: Float64) -> tuple[Float64, Float64, Float64] | None:
    """Return curve and priors by the baseline; beyond its ends it goes on as the generic one."""
    try:
        low, high = ship.baseline_range_m_s
        low = max(low, speed[0])
        near = np.clip(speed, low, high)
        force = np.array([float(ship.resistance_n(each)) for each in near])
    except ShipdragError:
        return None
    if not np.all(force > 0.0):
        return None
    curve = np.log(force / _moving(ship, near))
    generic = _generic(ship, speed)
    inside = (speed >= low) & (speed <= high)
    if not inside.any():
        return None
    first, last = np.flatnonzero(inside)[[0, -1]]
    curve[:first] = curve[first] + generic[:first] - generic[first]
    curve[last:] = curve[last] + generic[last:] - generic[last]
    return curve, n.RESISTANCE_FILE, n.EXPONENT_FILE
