# SPDX-License-Identifier: Apache-2.0
"""
Families of r(v): powers of the speed, with or without humps of wave making.

No single family is right: friction is nearly quadratic, wave making rises by
the fourth to the sixth power, with humps and hollows where the waves of bow and
stern meet. Humps are B-splines whose sizes are known beforehand, before any
measurement, to be small at low Froude numbers; how many of them count grows
with what the samples tell. How well each family explains the samples decides
its weight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipdrag_ros.estimation.motion_fit.coast import Law, shape_table, spread
from shipdrag_ros.samples import Float64

_TYPICAL_POWER = 2.5
_SPACING_FROUDE = 0.02  # of the humps: about a quarter wave of the pattern at Fr 0.2
_MOST = 14  # humps
_HUMP_SD = 0.2  # of r, at _HUMP_FROUDE
_HUMP_FROUDE, _LARGEST_FROUDE = 0.25, 0.3
_HUMP_POWER = 5  # by which they grow with the Froude number
_LEAST_SD = 1e-4  # of r
_ABOVE, _BELOW = 1.05, 0.9  # of the speeds of the coastdown, where humps still matter


class Family(NamedTuple):
    """
    One family of r(v).

    Attributes
    ----------
    powers
        Of the speed.
    humpy
        Whether humps are added.
    """

    powers: tuple[int, ...]
    humpy: bool = False


FIRST = Family((1, 2, 3, 4))  # fitted first, finds the outliers
FAMILIES = tuple(
    Family(powers, humpy)
    for powers in ((2, 3, 4), (2, 4, 6), (1, 2, 4, 6))
    for humpy in (False, True)
)


@dataclass(frozen=True)
class Humps:
    """
    Where humps may be, and how large they are before any measurement.

    Attributes
    ----------
    first, spacing
        Of their middles, over the reference speed.
    sd : (h,)
        Standard deviation of each, over r / v^2.
    """

    first: float
    spacing: float
    sd: Float64

    @classmethod
    def between(cls, lowest: float, froude: float) -> Humps:
        """
        Return those of a coastdown.

        Parameters
        ----------
        lowest
            Speed at the end over the reference speed.
        froude
            Froude number of the reference speed.

        Notes
        -----
        What waves of bow and stern do to each other is a part of the wave
        resistance, whose coefficient grows by about the fifth power.
        """
        low = _BELOW * lowest
        spacing = max(_SPACING_FROUDE / froude, (_ABOVE - low) / (_MOST - 1))
        count = math.ceil((_ABOVE - low) / spacing) + 1
        first = _ABOVE - (count - 1) * spacing
        at = np.minimum(froude * (first + spacing * np.arange(count)), _LARGEST_FROUDE)
        sd = _HUMP_SD * np.maximum(at / _HUMP_FROUDE, 0.0) ** _HUMP_POWER
        return cls(first, spacing, np.maximum(sd, _LEAST_SD))


@dataclass(frozen=True)
class FamilyFit:
    """
    One family fitted.

    Attributes
    ----------
    law
        Its powers and humps.
    unknowns
        See `coast`.
    covariance : (k + 6, k + 6)
        Of all unknowns; rows of what was not fitted are 0.
    chi2
        Sum of the squares of the whitened residuals.
    samples
        How many were fitted.
    parameters
        Number of unknowns, a hump by how much of it the samples tell.
    """

    law: Law
    unknowns: Float64
    covariance: Float64
    chi2: float
    samples: int
    parameters: float

    @property
    def aicc(self) -> float:
        """Akaike's criterion with the correction for few samples."""
        p = self.parameters
        return self.chi2 + 2.0 * p * self.samples / max(self.samples - p - 1.0, 1.0)

    def resistance(self, speed_m_s: Float64) -> tuple[Float64, Float64]:
        """
        Return r and its standard deviation at (m,) speeds.
        """
        value, _ = shape_table(self.law, speed_m_s)
        result: tuple[Float64, Float64] = spread(value, self.unknowns, self.covariance)
        return result

    def slope(self, speed_m_s: Float64) -> tuple[Float64, Float64]:
        """
        Return dr/dv and its standard deviation at (m,) speeds.
        """
        _, slope = shape_table(self.law, speed_m_s)
        result: tuple[Float64, Float64] = spread(slope, self.unknowns, self.covariance)
        return result

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
            at = fit.law.size + which
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
