# SPDX-License-Identifier: Apache-2.0
"""How a speed falls: where it begins to, and by which power of itself."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shipdrag_ros.coastdown.bins import Bins, speeds
from shipdrag_ros.samples import Float64

_BEND_BINS_MIN = 6


def begin_of_fall(bins: Bins, source: int, first: int, last: int, speed_min: float) -> int:
    """
    Return the bin at which a constant speed turns into a coastdown.

    Parameters
    ----------
    first, last
        Bins to look at; the second half of the coastdown is not needed.
    speed_min
        A speed below half of it is taken as half of it [m/s].

    Notes
    -----
    Quadratic drag makes 1/v rise linearly.
    """
    return bend(bins, source, first, last, speed_min, degree=0, sign=1)


def bend(
    bins: Bins, source: int, first: int, last: int, speed_min: float, *, degree: int, sign: int
) -> int:
    """
    Return the bin at which 1/v bends most.

    Parameters
    ----------
    degree
        Of the polynomial that 1/v follows before: 0 steady, 1 coasting.
    sign
        1: where it begins to rise faster, -1: slower.

    Notes
    -----
    Least squares of 1/v = polynomial + c max(0, t - s), s searched over all bins, and over
    each second of a gap between them.
    """
    time, speed = speeds(bins, source, first, last)
    if len(time) < _BEND_BINS_MIN:  # too few to bend: what is there is all of it
        return first
    inverse = 1.0 / np.maximum(speed, 0.5 * speed_min)
    hinges = np.concatenate([np.arange(one, other - 0.5) for one, other in pairwise(time[2:-1])])
    ramp = np.maximum(0.0, time - hinges[:, np.newaxis])
    # what the polynomial explains is taken out of both
    basis, _ = np.linalg.qr(np.vander(time, degree + 1))
    inverse = inverse - basis @ (basis.T @ inverse)
    ramp -= (ramp @ basis) @ basis.T
    gain = np.maximum(0.0, sign * (ramp @ inverse)) ** 2 / np.einsum('ij,ij->i', ramp, ramp)
    return last + math.floor(float(hinges[np.argmax(gain)]))


@dataclass(frozen=True)
class DecelerationFit:
    """
    Deceleration of a span of record, from a parabola through the speed.

    Attributes
    ----------
    speed, slope, curvature
        In the middle of the span [m/s, m/s^2, m/s^3].
    """

    speed: float
    slope: float
    curvature: float

    @property
    def exponent(self) -> float:
        """The p of v' = -c v^p: p = v'' v / v'^2."""
        return self.curvature * self.speed / self.slope**2


def fit_deceleration(time: Float64, speed: Float64) -> DecelerationFit:
    """
    Fit v = a + b t + c t^2 / 2 about the middle of the span.
    """
    middle = 0.5 * (time[0] + time[-1])
    c, b, a = np.polyfit(time - middle, speed, 2)
    return DecelerationFit(float(a), float(b), 2.0 * float(c))
