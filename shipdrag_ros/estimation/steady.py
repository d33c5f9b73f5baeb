# SPDX-License-Identifier: Apache-2.0
"""
The steady record before the onset: where it begins, and its means.

Sensor noise is what differs from sample to sample; what stays is left in the
means, for `learning`.
"""

from __future__ import annotations

import math

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.rows import MAD_TO_SD, OUTLIER
from shipdrag_ros.samples import Float64, Int64

BIN_S = 30.0  # a steady record is condensed to its means over this
FINE_S = 5.0  # near the stop
_BLOCK_S = 60.0
_UNSTEADY = 0.06  # of the speed: a block that differs by more ends the steady record
_TURNED_RAD = 0.15  # a block on another course does too


def display_sd(value: Float64, white_sd: float) -> float:
    """
    Return what the last digit of a display hides from a mean of a steady signal.

    Parameters
    ----------
    value : (n,) or (n, 2)
        Of a signal that moves.
    white_sd
        Of its noise, in which a coarse display is lost.

    Notes
    -----
    Rounding to q errs by up to q / 2 and always alike while the signal stands; noise
    averages that to a part exp(-2 pi^2 sd^2 / q^2) (Widrow's theorem, its first term).
    """
    if value.ndim == 2:  # a course due north has nothing in the east
        return max(display_sd(column, white_sd) for column in value.T)
    levels = np.unique(value)
    if len(levels) < 2:
        return 0.0
    quantum = float(np.median(np.diff(levels)))
    left = math.exp(-2.0 * (math.pi * white_sd / quantum) ** 2)
    return quantum / math.sqrt(12.0) * left


@compiled
def weighted_white_sd(value: Float64, weight: Float64) -> float:
    """
    Return the standard deviation of white noise on a smooth signal, at a weight of 1.

    Parameters
    ----------
    value, weight : (n,)
        In ascending time; the variance is that at a weight of 1 over the weight.

    Notes
    -----
    From second differences, whose outliers are clipped; 0 where n < 4.
    """
    if len(value) < 4:
        return 0.0
    second = value[2:] - 2.0 * value[1:-1] + value[:-2]
    spread = (1.0 / weight[2:] + 4.0 / weight[1:-1] + 1.0 / weight[:-2]) / 6.0
    size = np.abs(second) / np.sqrt(spread)
    typical = MAD_TO_SD * np.median(size)
    if typical > 0.0:
        size = size[size < 4.0 * typical]
    return float(np.sqrt(np.mean(size * size) / 6.0))


@compiled
def block_medians(value: Float64, edges: Int64) -> Float64:
    """
    Return the medians of parts of a record.

    Parameters
    ----------
    value : (n,)
    edges : (b + 1,)
        Where each part begins, and the end of the last; none is empty.

    Returns
    -------
    (b,)
    """
    result = np.empty(len(edges) - 1)
    for i in range(len(result)):
        result[i] = np.median(value[edges[i] : edges[i + 1]])
    return result


@compiled
def steady_since(time_s: Float64, speed: Float64, heading_s: Float64, heading: Float64) -> float:
    """
    Return the time from which a record has been steady to its end.

    Parameters
    ----------
    time_s, speed : (n,)
        Ascending.
    heading_s, heading : (m,)
        Yaw [rad]; may be empty.
    """
    if len(time_s) == 0:
        return np.inf
    # the stop may be earlier than it was taken for: the last block shows nothing of the speed
    late = settled = float(time_s[-1]) - _BLOCK_S
    last = np.searchsorted(time_s, late - 2.0 * _BLOCK_S, side='right')
    level = np.median(speed[last : np.searchsorted(time_s, late, side='right')])
    course = np.nan
    late += _BLOCK_S
    while late - _BLOCK_S > time_s[0]:
        early = late - _BLOCK_S
        first = np.searchsorted(time_s, early, side='right')
        end = np.searchsorted(time_s, late, side='right')
        differs = end > first and abs(np.median(speed[first:end]) - level) > _UNSTEADY * level
        if differs and late <= settled:
            return late
        first = np.searchsorted(heading_s, early, side='right')
        end = np.searchsorted(heading_s, late, side='right')
        if end > first:
            yaw = heading[first:end]
            mean = math.atan2(np.sin(yaw).mean(), np.cos(yaw).mean())
            if math.isnan(course):
                course = mean
            if abs(math.atan2(math.sin(mean - course), math.cos(mean - course))) > _TURNED_RAD:
                return late
        late = early
    return float(time_s[0])


@compiled
def steady_means(
    time_s: Float64, value: Float64, weight: Float64, bin_s: float, fine_s: float
) -> tuple[Float64, Float64, Float64]:
    """
    Return means over `bin_s` of a record that is steady.

    Parameters
    ----------
    time_s, value, weight : (n,)
        n >= 1; the weight is 1 for a sample that is as good as most.
    bin_s
    fine_s
        At the end of the record means are over `FINE_S` for so long: the stop
        may have been earlier than it was taken for.

    Returns
    -------
    time_s, value, weight : (b,)
        The weight is the sum of those of the samples.
    """
    # outliers are found by what is near in time: the record may drift, and at its end slow down
    edges = _edges(time_s, 2.0 * _BLOCK_S, fine_s)
    near = np.interp(time_s, block_medians(time_s, edges), block_medians(value, edges))
    away = np.abs(value - near)
    # of a coarse display most readings are the median itself: that does not show the scatter
    scatter = max(MAD_TO_SD * np.median(away), weighted_white_sd(value, np.ones(len(value))))
    keep = away <= OUTLIER * scatter
    time_s, value, weight = time_s[keep], value[keep], weight[keep]
    edges = _edges(time_s, bin_s, fine_s)
    bins = len(edges) - 1
    mean_s, mean, total = np.zeros(bins), np.zeros(bins), np.zeros(bins)
    for i in range(bins):
        for j in range(edges[i], edges[i + 1]):
            total[i] += weight[j]
            mean_s[i] += weight[j] * time_s[j]
            mean[i] += weight[j] * value[j]
    return mean_s / total, mean / total, total


@compiled
def _edges(time_s: Float64, length_s: float, fine_s: float) -> Int64:
    """Return where each part begins, of `FINE_S` in the last `fine_s`, and the end of the last."""
    split = len(time_s)
    if fine_s > 0.0:
        split = np.searchsorted(time_s, time_s[-1] - fine_s)
    edges = np.zeros(1, np.int64)
    if split > 0:
        edges = _parts(time_s[:split], length_s)
    if split < len(time_s):
        edges = np.concatenate((edges, split + _parts(time_s[split:], FINE_S)[1:]))
    return edges


@compiled
def _parts(time_s: Float64, length_s: float) -> Int64:
    """Return where each part of a length begins, and the end of the last."""
    edges = np.zeros(len(time_s) + 1, np.int64)
    last, number = 0, 0.0
    for i in range(len(time_s)):
        here = np.floor((time_s[i] - time_s[0]) / length_s)
        if here != number:
            number = here
            last += 1
            edges[last] = i
    edges[last + 1] = len(time_s)
    return edges[: last + 2]
