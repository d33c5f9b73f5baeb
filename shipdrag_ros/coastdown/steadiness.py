# SPDX-License-Identifier: Apache-2.0
"""
How much the speed of a steady ship wanders, learnt from the record itself.

At sea the noise of a slope is coloured, so its spread is measured, not derived
from the noise of a reading: slopes over `slope_window_s` are taken at points
aligned to absolute time, and the median size of the change from one slope to
the next neighbour that shares no sample gives a spread that neither a
coastdown in the record nor a slow trend spoils.
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

_MAD = 1.4826  # of a normal distribution: standard deviation over median absolute deviation
_STRIDES_PER_WINDOW = 4
# independent slopes that a window's length holds, as far as chance excursions go
_LOOKS_PER_WINDOW = 4.0
_FREEDOM_PER_WINDOW = 1.0  # degrees of freedom of the spread, per window's length of record
_WINDOWS_LEARNT = 6  # windows' lengths of record below which the spread is not trusted
# until then: how much larger than white noise the spread may be
_COLOUR = 3.0
SLOPE_FLOOR_M_S2 = 1e-7  # a record without noise must not divide by it


class Slopes(NamedTuple):
    """
    How slopes are taken, in bins of one second.

    Attributes
    ----------
    width
        Length of a slope window.
    stride, lag
        Distance of the points where slopes are kept; points from a slope to its neighbour.
    points
        Number of changes of slope that the spread is learnt from at most.
    quantile : (points + 1,)
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
        lag = math.ceil(width / stride)
        points = max(1, round(parameters.steady_s) // stride)
        chance = parameters.false_alarms_per_day * width / (86400.0 * _LOOKS_PER_WINDOW)
        windows = np.arange(points + 1) * (stride / width)
        learnt = windows >= _WINDOWS_LEARNT
        quantile = np.full(points + 1, np.inf)
        quantile[learnt] = stats.t.isf(chance, _FREEDOM_PER_WINDOW * windows[learnt])
        return cls(width, stride, lag, points, quantile, float(stats.norm.isf(chance)))


class Steadiness(NamedTuple):
    """
    The slopes kept and what they say.

    Attributes
    ----------
    slope : (sources, points + lag)
        Slopes at the points [m/s^2]; NaN where there were too few bins.
    done : (sources,) int64
        Newest point taken.
    limit : (sources,)
        Size of a slope that chance does not explain [m/s^2]; NaN while unknown.
    spread : (sources,)
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
            np.full((SOURCES, slopes.points + slopes.lag), np.nan),
            np.full(SOURCES, NEVER),
            np.full(SOURCES, np.nan),
            np.full(SOURCES, np.nan),
        )


@njit
def forget_steadiness(steadiness: Steadiness) -> None:
    """
    Return to the state before the first bin.
    """
    steadiness.slope[:] = np.nan
    steadiness.done[:] = NEVER
    steadiness.limit[:] = np.nan
    steadiness.spread[:] = np.nan


@njit
def learn(steadiness: Steadiness, slopes: Slopes, bins: Bins, source: int, number: int) -> None:
    """
    Bring the spread up to the last point at or before the closed bin `number`.

    The result depends on the bins of the last `points + lag` strides alone.
    """
    newest = (number + 1) // slopes.stride
    if newest == steadiness.done[source]:
        return
    kept = slopes.points + slopes.lag
    for point in range(max(steadiness.done[source] + 1, newest - kept + 1), newest + 1):
        slope = line(bins, source, point * slopes.stride - 1, slopes.width)[0]
        steadiness.slope[source, point % kept] = slope
    steadiness.done[source] = newest

    changes = np.empty(slopes.points)
    count = 0
    for point in range(newest - slopes.points + 1, newest + 1):
        change = abs(
            steadiness.slope[source, point % kept]
            - steadiness.slope[source, (point - slopes.lag) % kept]
        )
        if not np.isnan(change):
            changes[count] = change
            count += 1
    quantile = slopes.quantile[count]
    if quantile < np.inf:
        spread = _MAD * np.median(changes[:count]) / math.sqrt(2.0)
        limit = quantile * spread
    else:
        spread = _COLOUR * white_spread(bins, source, number, slopes.width)
        limit = slopes.white * spread
    steadiness.spread[source] = spread + SLOPE_FLOOR_M_S2
    steadiness.limit[source] = limit + SLOPE_FLOOR_M_S2


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
    reading = _MAD * np.median(changes) / math.sqrt(2.0)
    used = line(bins, source, last, width)[2] / apart
    return float(reading * math.sqrt(12.0 / max(used, 1.0)) / width)
