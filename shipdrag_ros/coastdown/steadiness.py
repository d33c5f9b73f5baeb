# SPDX-License-Identifier: Apache-2.0
"""
How much the speed of a steady ship wanders, learnt from the record itself.

At sea the noise of a slope is coloured, so its spread is measured, not derived
from the noise of a reading: slopes are taken at points aligned to absolute
time, and the size of the change from one slope to the neighbour that shares no
sample with it gives a spread that neither a coastdown in the record nor a slow
trend spoils. A short window finds a fast fall soon; a window four times as long
finds the slow one of a tanker, which the noise of the short one would hide.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy import stats

from shipdrag_ros.coastdown.bins import FIRST_TRACK, SOURCES, Bins, line, smoothing
from shipdrag_ros.coastdown.validate import NEVER
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64, Int64

SCALES = 3  # windows of one, two and four times slope_window_s
_STRIDES_PER_WINDOW = 4
# independent slopes that a window's length holds, as far as chance excursions go
_LOOKS_PER_WINDOW = 4.0
_FREEDOM_PER_WINDOW = 1.2  # degrees of freedom of the spread, per window's length of record
_WINDOWS_LEARNT = 6  # windows' lengths of record below which the spread is not trusted
# until then: how much larger than white noise the spread may be
_COLOUR = 3.0
_FEW = 1.5  # and how much too small the spread of a few slopes
SLOPE_FLOOR_M_S2 = 1e-7  # a record without noise must not divide by it
# The largest quarter may be the ends of coastdowns; of a normal distribution the rest has a
# root mean square of 1 / 1.6475 standard deviations.
_KEPT = 0.75
_TRIMMED = 1.6475


class Slopes(NamedTuple):
    """
    How slopes are taken, in bins of one second.

    Attributes
    ----------
    width
        Length of the shortest slope window.
    stride, lag
        Distance of the points where its slopes are kept; points from a slope to
        its neighbour. A window twice as long has a stride twice as long.
    points
        Number of changes of slope that the spread is learnt from at most.
    quantile : (SCALES, points + 1)
        Threshold in spreads against the number of changes known; inf where too few.
    white
        Threshold where the spread is guessed from white noise.
    """

    width: int
    stride: int
    lag: int
    points: int
    quantile: Float64
    white: float

    @classmethod
    def of(cls, parameters: Parameters) -> Slopes:
        """
        Lay out the slopes for `slope_window_s`, `steady_s`, `false_alarms_per_day`.

        Notes
        -----
        The spread is itself an estimate, from few independent windows: the
        threshold is a quantile of Student's t, not of the normal distribution.
        """
        width = round(parameters.slope_window_s)
        stride = max(1, width // _STRIDES_PER_WINDOW)
        points = max(1, round(parameters.steady_s) // stride)
        scale = 2.0 ** np.arange(SCALES)[:, np.newaxis]
        looks_per_day = 86400.0 * _LOOKS_PER_WINDOW / (width * scale)
        chance = parameters.false_alarms_per_day / (SCALES * looks_per_day)
        windows = np.arange(points + 1) * (stride / width)
        learnt = windows >= _WINDOWS_LEARNT
        quantile = np.full((SCALES, points + 1), np.inf)
        quantile[:, learnt] = stats.t.isf(chance, _FREEDOM_PER_WINDOW * windows[learnt])
        return cls(
            width,
            stride,
            math.ceil(width / stride),
            points,
            quantile,
            float(stats.norm.isf(chance[0, 0])),
        )


class Steadiness(NamedTuple):
    """
    The slopes kept and what they say.

    Attributes
    ----------
    slope : (sources, SCALES, points + lag)
        Slopes at the points [m/s^2]; NaN where there were too few bins.
    done : (sources, SCALES) int64
        Newest point taken.
    limit : (sources, SCALES)
        Size of a slope that chance does not explain [m/s^2]; NaN while unknown.
    spread : (sources, SCALES)
        Standard deviation of a slope [m/s^2].
    """

    slope: Float64
    done: Int64
    limit: Float64
    spread: Float64

    @classmethod
    def fresh(cls, slopes: Slopes) -> Steadiness:
        """
        Return the state before the first bin.
        """
        return cls(
            np.full((SOURCES, SCALES, slopes.points + slopes.lag), np.nan),
            np.full((SOURCES, SCALES), NEVER),
            np.full((SOURCES, SCALES), np.nan),
            np.full((SOURCES, SCALES), np.nan),
        )


@njit
def learn(steadiness: Steadiness, slopes: Slopes, bins: Bins, source: int, number: int) -> None:
    """
    Bring the spreads up to the last point at or before the closed bin `number`.

    The result depends on the bins of the last steady_s and two windows alone.
    """
    for scale in range(SCALES):
        stride = slopes.stride << scale
        if (number + 1) // stride != steadiness.done[source, scale]:
            _learn_scale(steadiness, slopes, bins, source, number, scale)


@njit
def _learn_scale(
    steadiness: Steadiness, slopes: Slopes, bins: Bins, source: int, number: int, scale: int
) -> None:
    width, stride, points = slopes.width << scale, slopes.stride << scale, slopes.points >> scale
    slope = steadiness.slope[source, scale]
    kept = points + slopes.lag
    newest = (number + 1) // stride
    for point in range(max(steadiness.done[source, scale] + 1, newest - kept + 1), newest + 1):
        slope[point % kept] = line(bins, source, point * stride - 1, width)[0]
    steadiness.done[source, scale] = newest

    changes = np.empty(points)
    count = 0
    for point in range(newest - points + 1, newest + 1):
        change = abs(slope[point % kept] - slope[(point - slopes.lag) % kept])
        if not np.isnan(change):
            changes[count] = change
            count += 1
    spread = _spread(changes[:count])
    threshold = slopes.quantile[scale, count]
    if threshold == np.inf:
        # a longer window would need a longer guess
        guess = np.nan
        if scale == 0:
            guess = _COLOUR * white_spread(bins, source, number, width)
        spread = guess if np.isnan(guess) else max(guess, _FEW * spread)
        threshold = slopes.white
    steadiness.spread[source, scale] = spread + SLOPE_FLOOR_M_S2
    steadiness.limit[source, scale] = threshold * spread + SLOPE_FLOOR_M_S2


@njit
def _spread(changes: Float64) -> float:
    """Return the sd of a slope from sizes of changes of slope; sorts them."""
    count = int(_KEPT * len(changes))
    if count == 0:
        return 0.0
    changes.sort()
    total = 0.0
    for change in changes[:count]:
        total += change * change
    return _TRIMMED * math.sqrt(0.5 * total / count)


@njit
def white_spread(bins: Bins, source: int, last: int, width: int) -> float:
    """
    Return the sd of a slope over `width` bins if successive bins differ by white noise.

    NaN while fewer than half a window's changes from bin to bin are known.
    """
    size = bins.number.shape[1]
    # speeds from positions are averages over this many bins, and so are their errors
    apart = 2 * smoothing(width) if source >= FIRST_TRACK else 1
    speed = np.full(4 * width, np.nan)
    known = 0
    for i in range(4 * width):
        number = last - 4 * width + 1 + i
        slot = number % size
        if bins.number[source, slot] == number and not np.isnan(bins.speed[source, slot]):
            speed[known] = bins.speed[source, slot]
            known += 1
    count = known - apart
    if 2 * count < width or count < 4:
        return np.nan
    changes = np.abs(speed[apart:known] - speed[:count])
    reading = _spread(changes)
    used = line(bins, source, last, width)[2] / apart
    return float(reading * math.sqrt(12.0 / max(used, 1.0)) / width)
