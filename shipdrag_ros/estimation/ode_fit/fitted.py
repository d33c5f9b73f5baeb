# SPDX-License-Identifier: Apache-2.0
"""A fitted motion: r(v) and what else was unknown, with their errors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.estimation.ode_fit.families import PLAIN
from shipdrag_ros.estimation.ode_fit.law import Law, shape_table, sums_and_sd
from shipdrag_ros.inference.gaussian import cholesky_solve
from shipdrag_ros.samples import Float64

_TYPICAL_POWER = 2.5


@dataclass(frozen=True)
class FittedMotion:
    """
    One family fitted, or the average of a law under several priors.

    Attributes
    ----------
    law
        Powers and humps.
    unknowns
        See `coast`.
    covariance : (k + 8, k + 8)
        Of all unknowns, between priors too; rows of what was not fitted are 0.
    """

    law: Law
    unknowns: Float64
    covariance: Float64

    def resistance(self, speed_m_s: Float64) -> tuple[Float64, Float64]:
        """
        Return r and its standard deviation at (m,) speeds.
        """
        value, _ = shape_table(self.law, speed_m_s)
        result: tuple[Float64, Float64] = sums_and_sd(value, self.unknowns, self.covariance)
        return result

    def slope(self, speed_m_s: Float64) -> tuple[Float64, Float64]:
        """
        Return dr/dv and its standard deviation at (m,) speeds.
        """
        _, slope = shape_table(self.law, speed_m_s)
        result: tuple[Float64, Float64] = sums_and_sd(slope, self.unknowns, self.covariance)
        return result

    def unknown(self, which: int) -> tuple[float, float]:
        """
        Return one of the unknowns behind the coefficients, and its sd.
        """
        at = self.law.size + which
        return float(self.unknowns[at]), math.sqrt(self.covariance[at, at])

    def plainly(self, lowest: float) -> FittedMotion:
        """
        Return the motion with the nearest r of the plainest of families.

        Parameters
        ----------
        lowest
            Speed at the end over the reference speed.
        """
        s = np.linspace(lowest, 1.0, 64)
        r, _ = self.resistance(s * self.law.v_ref_m_s)
        columns = [s**power for power in PLAIN]
        products = np.array([[(a * b).sum() for b in (*columns, r)] for a in columns])
        _, nearest = cholesky_solve(products[:, :-1].copy(), products[:, -1:].copy(), 0.0)
        law = self.law._replace(powers=np.array(PLAIN, np.int64), humps=0)
        unknowns = np.concatenate([nearest[:, 0], self.unknowns[self.law.size :]])
        return FittedMotion(law, unknowns, np.zeros((len(unknowns), len(unknowns))))

    def damping(self, speed_m_s: Float64) -> tuple[Float64, Float64]:
        """
        Return dr/dv over 1 + n_r [1/s], and 1 + n_r, at (m,) speeds.

        Notes
        -----
        From r alone, as if it rose by `_TYPICAL_POWER` of the speed: between
        friction and wave making, and far steadier than a fitted slope.
        """
        n_r = np.polynomial.polynomial.polyval(speed_m_s, self.law.n_r)
        inertia = 1.0 + np.asarray(n_r, np.float64)
        r, _ = self.resistance(speed_m_s)
        damping = _TYPICAL_POWER * r / np.maximum(speed_m_s, 1e-3) / inertia
        damped: Float64 = np.maximum(damping, 1e-6)
        return damped, inertia
