# SPDX-License-Identifier: Apache-2.0
"""
How much the speed of a steady ship wanders, learnt from the record itself.

At sea the noise of a slope is correlated, so its sd is measured, not derived
from the noise of a reading: slopes are taken at points aligned to absolute
time, and the size of the change from one slope to the neighbour that shares no
sample with it gives an sd that neither a coastdown in the record nor a slow
trend spoils. A short window finds a fast fall soon; a window four times as long
finds the slow one of a tanker, which the noise of the short one would hide.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.bins import Bins, line, smoothing, speeds_kept
from shipdrag_ros.coastdown.past import CHANNELS, FIRST_TRACK, NEVER
from shipdrag_ros.compiled import compiled
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import KIND, Float64, Int64

SCALES = 3  # windows of one, two and four times slope_window_s
_STRIDES_PER_WINDOW = 4
# independent slopes that a window's length holds, as far as chance excursions go
_LOOKS_PER_WINDOW = 4.0
_FREEDOM_PER_WINDOW = 1.2  # degrees of freedom of the sd, per window's length of record
_WINDOWS_LEARNT = 6  # windows' lengths of record below which the sd is not trusted
# until then: how much larger than white noise the sd may be
_COLOUR = 3.0
_FEW = 1.5  # and how much too small the sd of a few slopes
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
        Number of changes of slope that the sd is learnt from at most.
    quantile : (SCALES, points + 1)
        Threshold in sd against the number of changes known; inf where too few.
    white
        Threshold where the sd is guessed from white noise.
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
        The sd is itself an estimate, from few independent windows: the
        threshold is a quantile of Student's t, not of the normal distribution.
        """
        from scipy.special import ndtri, stdtrit  # slow to import

        width = round(parameters.slope_window_s)
        stride = max(1, width // _STRIDES_PER_WINDOW)
        points = max(1, round(parameters.steady_s) // stride)
        scale = 2.0 ** np.arange(SCALES)[:, np.newaxis]
        looks_per_day = 86400.0 * _LOOKS_PER_WINDOW / (width * scale)
        chance = parameters.false_alarms_per_day / (SCALES * looks_per_day)
        windows = np.arange(points + 1) * (stride / width)
        learnt = windows >= _WINDOWS_LEARNT
        quantile = np.full((SCALES, points + 1), np.inf)
        quantile[:, learnt] = -stdtrit(_FREEDOM_PER_WINDOW * windows[learnt], chance)
        return cls(
            width,
            stride,
            math.ceil(width / stride),
            points,
            quantile,
            -float(ndtri(chance[0, 0])),
        )


class Steadiness(NamedTuple):
    """
    The slopes kept and what they say.

    Attributes
    ----------
    slope : (channels, SCALES, points + 2 lag + 1)
        Slopes at the points [m/s^2]; NaN where there were too few bins.
    changes : (channels, SCALES, points)
        Sizes of the changes between the last of them, ascending; inf for those unknown.
    due : (channels, SCALES) int64
        The bin that completes the next point.
    limit : (channels, SCALES)
        Size of a slope that chance does not explain [m/s^2]; NaN while unknown.
    slope_sd : (channels, SCALES)
        Standard deviation of a slope [m/s^2].
    scratch : (4 width,)
        Room to sort in: compiled code makes no arrays.
    """

    slope: Float64
    changes: Float64
    due: Int64
    limit: Float64
    slope_sd: Float64
    scratch: Float64

    @classmethod
    def fresh(cls, slopes: Slopes) -> Steadiness:
        """
        Return the state before the first bin.
        """
        return cls(
            np.full((CHANNELS, SCALES, slopes.points + 2 * slopes.lag + 1), np.nan),
            np.full((CHANNELS, SCALES, slopes.points), np.inf),
            np.full((CHANNELS, SCALES), NEVER),
            np.full((CHANNELS, SCALES), np.nan),
            np.full((CHANNELS, SCALES), np.nan),
            np.empty(4 * slopes.width),
        )

    def forget(self, source: int) -> None:
        """Return a source to the state before its first bin."""
        self.slope[source] = self.limit[source] = self.slope_sd[source] = np.nan
        self.changes[source], self.due[source] = np.inf, NEVER


@compiled(inline=True, uncounted=True)
def update_limits(
    steadiness: Steadiness, slopes: Slopes, bins: Bins, source: int, number: int
) -> None:
    """
    Bring the sd up to the last point at or before the closed bin `number`.

    The result depends on the bins of the last steady_s and three windows alone.
    """
    for scale in range(SCALES):
        if number >= steadiness.due[source, scale]:
            _update_scale(steadiness, slopes, bins, source, number, scale)


@compiled(uncounted=True)
def _update_scale(
    steadiness: Steadiness, slopes: Slopes, bins: Bins, source: int, number: int, scale: int
) -> None:
    width, stride, points = slopes.width << scale, slopes.stride << scale, slopes.points >> scale
    slope = steadiness.slope[source, scale]
    changes = steadiness.changes[source, scale, :points]
    newest = (number + 1) // stride
    first = (steadiness.due[source, scale] + 1) // stride
    if newest - first >= len(slope) - 1:
        # none of those before is still needed
        first = newest - len(slope) + 1
        slope[:] = np.nan
        changes[:] = np.inf
    for point in range(first, newest + 1):
        # what falls now must not teach what is chance: a slope counts a window's length later
        at = point - slopes.lag
        gone = _change(slope, slopes.lag, at - points)
        slope[point % len(slope)] = line(bins, source, point * stride - 1, width)[0]
        _replace(changes, gone, _change(slope, slopes.lag, at))
    steadiness.due[source, scale] = (newest + 1) * stride - 1

    count = int(np.searchsorted(changes, np.inf))
    sd = _sd_of_changes(changes, count)
    threshold = slopes.quantile[scale, count]
    if threshold == np.inf:
        # a longer window of a log would need a longer guess: its errors are no white noise there
        guess = np.nan
        if scale == 0 or KIND[source] >= FIRST_TRACK:
            white = white_sd_of_slopes(
                bins, source, number, slopes.width, width, steadiness.scratch
            )
            guess = _COLOUR * white
        sd = guess if np.isnan(guess) else max(guess, _FEW * sd)
        threshold = slopes.white
    steadiness.slope_sd[source, scale] = sd + SLOPE_FLOOR_M_S2
    steadiness.limit[source, scale] = threshold * sd + SLOPE_FLOOR_M_S2


@compiled(uncounted=True)
def _change(slope: Float64, lag: int, point: int) -> float:
    """Return the size of the change of slope at a point; inf where it is not known."""
    change = abs(slope[point % len(slope)] - slope[(point - lag) % len(slope)])
    return np.inf if np.isnan(change) else change


@compiled(uncounted=True)
def _replace(ascending: Float64, gone: float, come: float) -> None:
    """Replace one number by another in an ascending array."""
    i = np.searchsorted(ascending, gone)
    while i + 1 < len(ascending) and ascending[i + 1] < come:
        ascending[i] = ascending[i + 1]
        i += 1
    while i > 0 and ascending[i - 1] > come:
        ascending[i] = ascending[i - 1]
        i -= 1
    ascending[i] = come


@compiled(uncounted=True)
def _sd_of_changes(changes: Float64, known: int) -> float:
    """Return the sd of a slope from the first `known`, ascending sizes of changes of slope."""
    count = int(_KEPT * known)
    if count == 0:
        return 0.0
    total = 0.0
    for i in range(count):
        total += changes[i] * changes[i]
    return _TRIMMED * math.sqrt(0.5 * total / count)


@compiled(uncounted=True)
def white_sd_of_slopes(
    bins: Bins, source: int, last: int, shortest: int, width: int, scratch: Float64
) -> float:
    """
    Return the sd of a slope over `width` bins if readings differ by white noise.

    That of a log is of speeds, that of a track of places, of whose means the speeds are
    differences. NaN while fewer than half the shortest window's changes from bin to bin are known.
    """
    averaged = smoothing(shortest) if KIND[source] >= FIRST_TRACK else 0
    apart = max(2 * averaged, 1)
    count = speeds_kept(bins, source, last, 4 * shortest, scratch) - apart
    if 2 * count < shortest or count < 4:
        return np.nan
    for i in range(count):
        change, at = abs(scratch[i + apart] - scratch[i]), i
        while at > 0 and scratch[at - 1] > change:
            scratch[at] = scratch[at - 1]
            at -= 1
        scratch[at] = change
    reading = _sd_of_changes(scratch, count)
    if averaged > 0:
        # errors of means within the window cancel but for those at its ends
        part = averaged / width
        return float(reading * part * math.sqrt(24.0 + 72.0 * part) / width)
    used = line(bins, source, last, width)[2]
    return float(reading * math.sqrt(12.0 / max(used, 1.0)) / width)
