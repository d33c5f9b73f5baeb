# SPDX-License-Identifier: Apache-2.0
"""
Averages over whole seconds, the record that onset and end are judged on.

A bin is one second of one channel, numbered by floor(stamp / 1 s), so that a
monitor that starts later has the same bins. Every statistic is computed from
the last N bins alone, in ascending order: running sums would remember rounding
errors from before.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from shipdrag_ros.coastdown.validate import NEVER, SECOND_NS
from shipdrag_ros.samples import Channel, Float64, Int64

BINNED = int(Channel.SHAFT) + 1  # this many first channels are averaged
SOURCES = int(Channel.POSITION_GEODETIC) + 1  # of these, a speed can be had from; best first
EARTH_RADIUS_M = 6_371_008.8  # mean; the third digit of a speed does not matter here

FIRST_TRACK = int(Channel.POSITION)  # this source and those after it are positions
_GEODETIC = int(Channel.POSITION_GEODETIC)
_HEADING = int(Channel.HEADING)


class Bins(NamedTuple):
    """
    The bins of the last seconds, a ring of `size` slots a channel.

    Attributes
    ----------
    filling : (channels,) int64
        The bin being filled; NEVER where none is.
    samples : (channels,) int64
        How many are in it.
    sums : (channels, 3)
        Their sums: time within the second [s] and the two columns.
    first : (channels,)
        Second column of its first sample, the branch of a longitude.
    number : (channels, size) int64
        Which bin is in a slot.
    offset : (channels, size)
        Mean time of its samples, from the beginning of its second [s].
    a, b : (channels, size)
        Mean of the two columns; cosine and sine for a heading.
    speed : (sources, size)
        Speed [m/s]; from positions by differences, NaN where there are too few.
    speed_offset : (sources, size)
        Its time, from the beginning of the bin's second [s].
    """

    filling: Int64
    samples: Int64
    sums: Float64
    first: Float64
    number: Int64
    offset: Float64
    a: Float64
    b: Float64
    speed: Float64
    speed_offset: Float64

    @classmethod
    def fresh(cls, size: int) -> Bins:
        """
        Return empty bins for the last `size` seconds.
        """
        return cls(
            np.full(BINNED, NEVER),
            np.zeros(BINNED, np.int64),
            np.zeros((BINNED, 3)),
            np.zeros(BINNED),
            np.full((BINNED, size), NEVER),
            np.zeros((BINNED, size)),
            np.zeros((BINNED, size)),
            np.zeros((BINNED, size)),
            np.full((SOURCES, size), np.nan),
            np.zeros((SOURCES, size)),
        )


@njit
def smoothing(width: int) -> int:
    """
    Return over how many bins positions are averaged before they make a speed.

    A sixth of the slope window: 10 s of 60 s.
    """
    return int(max(1, width // 6))


@njit
def add(bins: Bins, channel: int, number: int, stamp: int, a: float, b: float) -> None:
    """
    Add an accepted sample to the bin being filled.
    """
    if bins.samples[channel] == 0:
        bins.filling[channel] = number
        bins.first[channel] = b
    if channel == _GEODETIC:
        b -= 360.0 * np.round((b - bins.first[channel]) / 360.0)
    elif channel == _HEADING:
        a, b = math.cos(a), math.sin(a)
    bins.samples[channel] += 1
    bins.sums[channel, 0] += (stamp - number * SECOND_NS) * 1e-9
    bins.sums[channel, 1] += a
    bins.sums[channel, 2] += b


@njit
def close(bins: Bins, channel: int, width: int) -> int:
    """
    Close the bin being filled and return its number.

    Parameters
    ----------
    width
        Length of a slope window in bins; `smoothing` follows from it.
    """
    number = bins.filling[channel]
    slot = number % bins.number.shape[1]
    count = bins.samples[channel]
    bins.number[channel, slot] = number
    bins.offset[channel, slot] = bins.sums[channel, 0] / count
    bins.a[channel, slot] = bins.sums[channel, 1] / count
    bins.b[channel, slot] = bins.sums[channel, 2] / count
    bins.samples[channel] = 0
    bins.sums[channel] = 0.0
    if channel < FIRST_TRACK:
        bins.speed[channel, slot] = bins.a[channel, slot]
        bins.speed_offset[channel, slot] = bins.offset[channel, slot]
    elif channel < SOURCES:
        bins.speed_offset[channel, slot], bins.speed[channel, slot] = _speed_of_track(
            bins, channel, number, smoothing(width)
        )
    return int(number)


@njit(cache=True)
def mean_place(bins: Bins, channel: int, last: int, width: int) -> tuple[float, float, float, int]:
    """
    Average positions (or cosine and sine) over the bins last - width + 1 .. last.

    Returns
    -------
    time, a, b, count
        The time [s] from the beginning of bin `last`; a longitude is on the
        branch of the newest bin.
    """
    size = bins.number.shape[1]
    time, sum_a, sum_b, count = 0.0, 0.0, 0.0, 0
    newest = np.nan
    for number in range(last, last - width, -1):
        slot = number % size
        if bins.number[channel, slot] != number:
            continue
        b = bins.b[channel, slot]
        if count == 0:
            newest = b
        if channel == _GEODETIC:
            b -= 360.0 * np.round((b - newest) / 360.0)
        time += number - last + bins.offset[channel, slot]
        sum_a += bins.a[channel, slot]
        sum_b += b
        count += 1
    if count == 0:
        return np.nan, np.nan, np.nan, 0
    return time / count, sum_a / count, sum_b / count, count


@njit(cache=True)
def displacement(bins: Bins, channel: int, last: int, width: int) -> tuple[float, float, float]:
    """
    Return time [s] and way east and north [m] between two neighbouring spans.

    Parameters
    ----------
    last, width
        The spans are the `width` bins up to `last` and as many before them.
    """
    t1, a1, b1, n1 = mean_place(bins, channel, last, width)
    t0, a0, b0, n0 = mean_place(bins, channel, last - width, width)
    if n0 == 0 or n1 == 0:
        return np.nan, np.nan, np.nan
    time = t1 - t0 + width
    if channel == _GEODETIC:
        turn = (b1 - b0) - 360.0 * np.round((b1 - b0) / 360.0)
        north = math.radians(a1 - a0) * EARTH_RADIUS_M
        east = math.radians(turn) * math.cos(math.radians(a1)) * EARTH_RADIUS_M
        return time, east, north
    return time, a1 - a0, b1 - b0


@njit
def _speed_of_track(bins: Bins, channel: int, number: int, width: int) -> tuple[float, float]:
    """Return offset [s] and speed [m/s] from the means of 2 x `width` bins."""
    time, east, north = displacement(bins, channel, number, width)
    if not time > 0.0:
        return 0.0, np.nan
    newest = mean_place(bins, channel, number, width)[0]
    return newest - 0.5 * time, math.sqrt(east * east + north * north) / time


@njit(cache=True)
def line(bins: Bins, source: int, last: int, width: int) -> tuple[float, float, int]:
    """
    Fit a straight line to the speed over the bins last - width + 1 .. last.

    Returns
    -------
    slope, level, count
        Slope [m/s^2], speed at the newest bin [m/s] and bins used; NaN where
        fewer than four bins, or bins from less than 2/3 of the width, are there.
    """
    size = bins.number.shape[1]
    numbers, speeds, offsets = bins.number[source], bins.speed[source], bins.speed_offset[source]
    count = 0
    sum_t, sum_v, sum_tt, sum_tv = 0.0, 0.0, 0.0, 0.0
    origin, oldest, newest = 0.0, 0.0, 0.0
    first = last - width + 1
    slot = first % size
    for number in range(first, last + 1):
        v = speeds[slot]
        if numbers[slot] == number and not np.isnan(v):
            newest = number - last + offsets[slot]
            if count == 0:
                # differences from one of the speeds: the sums keep their digits
                oldest, origin = newest, v
            v -= origin
            count += 1
            sum_t += newest
            sum_v += v
            sum_tt += newest * newest
            sum_tv += newest * v
        slot += 1
        if slot == size:
            slot = 0
    if count < 4 or 1.5 * (newest - oldest) < width - 1:
        return np.nan, np.nan, count
    mean_t, mean_v = sum_t / count, sum_v / count
    slope = (sum_tv - sum_t * mean_v) / (sum_tt - sum_t * mean_t)
    return slope, origin + mean_v + slope * (newest - mean_t), count


@njit(cache=True)
def mean_turning(bins: Bins, channel: int, last: int, width: int) -> tuple[float, int]:
    """
    Return the mean of |first column| over the bins last - width + 1 .. last.
    """
    size = bins.number.shape[1]
    total, count = 0.0, 0
    for number in range(last - width + 1, last + 1):
        slot = number % size
        if bins.number[channel, slot] == number:
            total += abs(bins.a[channel, slot])
            count += 1
    if count == 0:
        return np.nan, 0
    return total / count, count


@njit(cache=True)
def newest_bin(bins: Bins, channel: int) -> int:
    """
    Return the number of the last bin that holds anything; NEVER if none does.

    `filling` stays at the number of a bin that was closed.
    """
    return int(bins.filling[channel])


def speeds(bins: Bins, source: int, first: int, last: int) -> tuple[Float64, Float64]:
    """
    Return times [s], from the beginning of bin `last`, and speeds [m/s].
    """
    numbers = np.arange(first, last + 1)
    slots = numbers % bins.number.shape[1]
    speed = bins.speed[source, slots]
    there = (bins.number[source, slots] == numbers) & ~np.isnan(speed)
    time = (numbers - last) + bins.speed_offset[source, slots]
    return time[there], speed[there]


def warm(bins: Bins) -> None:
    """
    Compile what Python calls, so that no coastdown waits for it.
    """
    line(bins, 0, 0, 1)
    mean_place(bins, 0, 0, 1)
    displacement(bins, 0, 0, 1)
    mean_turning(bins, 0, 0, 1)
    newest_bin(bins, 0)
