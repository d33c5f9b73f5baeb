# SPDX-License-Identifier: Apache-2.0
"""
Was power cut, or only reduced? The whole of a deceleration shows better than its beginning.

A constant force beside that of the water, v' = -c v^p + d, is left-over thrust where d > 0
and a brake, or a reversed propeller, where d < 0. With the p that the ship should have, c and d
follow from a straight fit of the speed on the integral of v^p and on time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.coastdown.bins import Bins, speeds

_BINS_MIN = 30
# noise of the sea has a longer memory than a slope window: the sd that this window shows,
# continued as white noise, is too small by about so much
_CORRELATED = 1.5


@dataclass(frozen=True)
class ConstantForce:
    """
    The constant force beside that of the water.

    Attributes
    ----------
    fraction, sd
        Of the force of the water at the first speed; > 0 drives the ship.
    later
        By how much chi^2 falls if the force begins later, at the best time.
    """

    fraction: float
    sd: float
    later: float

    @property
    def low(self) -> float:
        """The fraction less two standard deviations; infinite where all of it drives."""
        return self.fraction if np.isinf(self.fraction) else self.fraction - 2.0 * self.sd

    @property
    def high(self) -> float:
        """The fraction and two standard deviations."""
        return self.fraction + 2.0 * self.sd


def constant_force(
    bins: Bins, source: int, first: int, last: int, *, exponent: float, slope_sd: float, width: int
) -> ConstantForce | None:
    """
    Fit the speed of the bins first .. last.

    Parameters
    ----------
    exponent
        The p that is expected of the water.
    slope_sd, width
        Standard deviation of a slope [m/s^2] over a slope window of this many bins.

    Returns
    -------
    Force or None
        None where there is too little to say.
    """
    time, speed = speeds(bins, source, first, last)
    if len(time) < _BINS_MIN or not speed.min() > 0.0:
        return None
    time = time - time[0]
    power = speed**exponent
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(time))])
    scale = float(np.median(speed[: max(3, len(speed) // 20)])) ** exponent
    # c is the force of the water at the first speed, per mass
    water = np.column_stack([np.ones(len(time)), -integral / scale])
    basis, triangle = np.linalg.qr(water)
    rest = speed - basis @ (basis.T @ speed)
    starts = time[:-5:5]
    ramps = np.maximum(0.0, time - starts[:, np.newaxis])
    free = ramps - (ramps @ basis) @ basis.T
    size = np.einsum('ij,ij->i', free, free)
    along = free @ rest
    noise = _CORRELATED**2 * slope_sd**2 * width**3 / 12.0 / np.mean(np.diff(time))
    gain = np.maximum(along, 0.0) ** 2 / size / noise
    d = float(along[0] / size[0])
    c = float(np.linalg.solve(triangle, basis.T @ (speed - d * ramps[0]))[1])
    if not c > 0.0:
        return ConstantForce(np.inf, np.inf, float(gain.max() - gain[0]))
    sd = float(np.sqrt(noise / size[0])) / c
    return ConstantForce(d / c, sd, float(gain.max() - gain[0]))
