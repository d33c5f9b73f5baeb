# SPDX-License-Identifier: Apache-2.0
"""
Families of r(v): powers of the speed, with or without humps of wave making.

No single family is right: friction is nearly quadratic, wave making rises by
the fourth to the sixth power, with humps and hollows where the waves of bow and
stern meet. Humps are B-splines whose sizes are known beforehand, before any
measurement, to be small at low Froude numbers; how many of them count grows
with what the samples tell.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipdrag_ros.samples import Float64

FIRST = (1, 2, 3, 4)  # powers fitted first, to find the outliers
PLAIN = (2, 3)  # hardly ever negative, and right enough to tell how a force is damped
POWERS = (1, 2, 3, 4, 6)  # of any family
_OF_FAMILY = [np.isin(POWERS, own) for own in ((2, 3, 4), (2, 4, 6), (1, 2, 4, 6))]
_HUMP_SIZES = (0.0, 0.3, 1.0)  # of a family, over the sizes of `Humps`

_SPACING_FROUDE = 0.02  # of the humps: about a quarter wave of the pattern at Fr 0.2
_MOST = 14  # humps
_HUMP_SD = 0.2  # of r, at _HUMP_FROUDE
_HUMP_FROUDE, _LARGEST_FROUDE = 0.25, 0.3
_HUMP_POWER = 5  # by which they grow with the Froude number
_LEAST_SD = 1e-4  # of r
_ABOVE, _BELOW = 1.05, 0.9  # of the speeds of the coastdown, where humps still matter


class Families(NamedTuple):
    """
    Families as choices among `POWERS` and humps.

    Attributes
    ----------
    included : (f, k)
        Which of the k coefficients each of f families has.
    precision : (f, k)
        1 over the variance that a coefficient has before any measurement, about
        0; 0: not known.
    """

    included: np.ndarray
    precision: Float64


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

    def families(self, unit_m_s2: float) -> Families:
        """
        Return all families.

        Parameters
        ----------
        unit_m_s2
            r that the sizes of the humps are relative to, at the reference speed.
        """
        unknown = np.zeros(len(POWERS))
        included, precision = [], []
        for size in _HUMP_SIZES:
            has = np.full(len(self.sd), size > 0.0)
            known = 1.0 / (size * unit_m_s2 * self.sd) ** 2 if size > 0.0 else 0.0 * self.sd
            for powers in _OF_FAMILY:
                included.append(np.concatenate([powers, has]))
                precision.append(np.concatenate([unknown, known]))
        return Families(np.array(included), np.array(precision))
