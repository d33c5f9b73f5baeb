# SPDX-License-Identifier: Apache-2.0
"""
Families of r(v): sums of powers of the speed, averaged by AICc.

No single family is right: friction is nearly quadratic, wave making rises by
the fourth to the sixth power. Too small a family is biased, too large a one
noisy; how well each explains the samples decides its weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.estimation.motion_fit.coast import Law
from shipdrag_ros.samples import Float64

# In the order of fitting; the first is fitted first and finds the outliers.
FAMILIES: tuple[tuple[int, ...], ...] = (
    (1, 2, 3, 4),
    (2, 3, 4),
    (2, 3, 5),
    (2, 3, 6),
    (2, 4, 6),
    (1, 2, 3, 5),
    (1, 2, 4, 6),
    (1, 2, 3, 4, 5),
)
_TYPICAL_POWER = 2.5
LARGEST = 9  # powers of the largest family that many samples may ask for
GROWTH = 0.3  # weight of the largest family from which a larger one is tried


@dataclass(frozen=True)
class FamilyFit:
    """
    One family fitted.

    Attributes
    ----------
    law
        Its powers.
    unknowns
        See `coast`.
    covariance : (k + 6, k + 6)
        Of all unknowns; rows of what was not fitted are 0.
    chi2
        Sum of the squares of the whitened residuals.
    rows
        Number of rows.
    parameters
        Number of unknowns fitted.
    """

    law: Law
    unknowns: Float64
    covariance: Float64
    chi2: float
    rows: int
    parameters: int

    @property
    def aicc(self) -> float:
        """Akaike's criterion with the correction for few samples."""
        p = self.parameters
        return self.chi2 + 2.0 * p * self.rows / max(self.rows - p - 1, 1)

    def resistance(self, speed_m_s: Float64) -> tuple[Float64, Float64]:
        """
        Return r and its standard deviation at (m,) speeds.
        """
        return self._linear(self._powers(speed_m_s))

    def slope(self, speed_m_s: Float64) -> tuple[Float64, Float64]:
        """
        Return dr/dv and its standard deviation at (m,) speeds.
        """
        powers = self.law.powers
        s = speed_m_s[:, None] / self.law.v_ref_m_s
        return self._linear(powers * s ** (powers - 1) / self.law.v_ref_m_s)

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

    def _powers(self, speed_m_s: Float64) -> Float64:
        result: Float64 = (speed_m_s[:, None] / self.law.v_ref_m_s) ** self.law.powers
        return result

    def _linear(self, columns: Float64) -> tuple[Float64, Float64]:
        k = columns.shape[1]
        value = np.einsum('mk,k->m', columns, self.unknowns[:k])
        variance = np.einsum('mj,jk,mk->m', columns, self.covariance[:k, :k], columns)
        return value, np.sqrt(np.maximum(variance, 0.0))


@dataclass(frozen=True)
class Average:
    """
    Families with their weights.

    Attributes
    ----------
    fits, weights
        The weights sum to 1.
    """

    fits: tuple[FamilyFit, ...]
    weights: Float64

    @classmethod
    def of(cls, fits: tuple[FamilyFit, ...]) -> Average:
        """
        Weigh families by AICc.
        """
        criterion = np.array([fit.aicc for fit in fits])
        weights = np.exp(-0.5 * (criterion - criterion.min()))
        return cls(fits, weights / weights.sum())

    @property
    def best(self) -> FamilyFit:
        """The family of the largest weight."""
        return self.fits[int(np.argmax(self.weights))]

    def resistance(self, speed_m_s: Float64) -> tuple[Float64, Float64]:
        """
        Return r and its standard deviation, between families too.
        """
        return self._mix([fit.resistance(speed_m_s) for fit in self.fits])

    def slope(self, speed_m_s: Float64) -> tuple[Float64, Float64]:
        """
        Return dr/dv and its standard deviation, between families too.
        """
        return self._mix([fit.slope(speed_m_s) for fit in self.fits])

    def unknown(self, which: int) -> tuple[float, float]:
        """
        Return one of the unknowns behind the coefficients, and its sd.
        """
        pairs = []
        for fit in self.fits:
            at = len(fit.law.powers) + which
            value, variance = fit.unknowns[at], fit.covariance[at, at]
            pairs.append((np.array([value]), np.array([np.sqrt(variance)])))
        value, sigma = self._mix(pairs)
        return float(value[0]), float(sigma[0])

    def _mix(self, pairs: list[tuple[Float64, Float64]]) -> tuple[Float64, Float64]:
        values = np.array([value for value, _ in pairs])
        sigmas = np.array([sigma for _, sigma in pairs])
        mean = np.einsum('f,fm->m', self.weights, values)
        variance = np.einsum('f,fm->m', self.weights, sigmas**2 + (values - mean) ** 2)
        return mean, np.sqrt(variance)
