# SPDX-License-Identifier: Apache-2.0
"""
What is known of r(v) before any measurement: powers of the speed, and humps of wave making.

Friction is nearly quadratic; wave making rises by the fourth to the eighth
power, with humps and hollows where the waves of bow and stern meet, and is small
at low Froude numbers. Humps are B-splines. How large the parts may be is averaged
over, so that what counts grows with what the samples show.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from shipdrag_ros.samples import Float64

FIRST = (1, 2, 3, 4)  # powers fitted first, to find the outliers
PLAIN = (2, 3)  # hardly ever negative, and right enough to show how a force is damped
POWERS = (1, 2, 3, 4, 6, 8)  # of the law
# Standard deviations of parts of r, over r at the start. Of the quadratic one nothing is known.
LINEAR_SDS = (0.1, 1.0)  # one or the other
CUBIC_SD = 0.3
# Of each of `WAVES` powers above: wave making only adds, about as much as its standard deviation.
WAVES = 3
_WAVE_SD, _WAVE_FROUDE, _WAVE_POWER = 0.1, 0.2, 4  # growing with the Froude number, up to there
HUMP_SIZES = (0.1, 0.3, 1.0)  # over the sizes of `Humps`

_SPACING_FROUDE = 0.02  # of the humps: about a quarter wave of the pattern at Fr 0.2
_MOST = 14  # humps
_HUMP_SD = 0.2  # of r, at _HUMP_FROUDE
_HUMP_FROUDE, _LARGEST_FROUDE = 0.25, 0.3
_HUMP_POWER = 5  # by which they grow with the Froude number
_LEAST_SD = 1e-4  # of r
_ABOVE, _BELOW = 1.05, 0.9  # of the speeds of the coastdown, where humps still matter


class Priors(NamedTuple):
    """
    Priors of the coefficients of `POWERS` and humps.

    Attributes
    ----------
    mean : (f, k)
    precision : (f, k)
        1 over the variance; 0: not known.
    """

    mean: Float64
    precision: Float64


@dataclass(frozen=True)
class Humps:
    """
    Where humps may be, and how large wave making is before any measurement.

    Attributes
    ----------
    first, spacing
        Of their middles, over the reference speed.
    sd : (h,)
        Standard deviation of each, over r / v^2.
    waves
        Of each power of wave making, over r at the reference speed.
    """

    first: float
    spacing: float
    sd: Float64
    waves: float

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
        waves = _WAVE_SD * min(1.0, (froude / _WAVE_FROUDE) ** _WAVE_POWER)
        return cls(first, spacing, np.maximum(sd, _LEAST_SD), waves)

    def priors(self, unit_m_s2: float) -> Priors:
        """
        Return all priors.

        Parameters
        ----------
        unit_m_s2
            r at the reference speed.
        """
        k = len(POWERS)
        pairs = list(product(LINEAR_SDS, HUMP_SIZES))
        mean, precision = np.zeros((2, len(pairs), k + len(self.sd)))
        mean[:, k - WAVES : k] = unit_m_s2 * self.waves
        for row, (linear, size) in enumerate(pairs):
            sd = np.concatenate(
                [(linear, np.inf, CUBIC_SD), (self.waves,) * WAVES, size * self.sd]
            )
            precision[row] = 1.0 / (unit_m_s2 * sd) ** 2
        return Priors(mean, precision)
