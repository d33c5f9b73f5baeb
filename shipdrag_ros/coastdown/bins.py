# SPDX-License-Identifier: Apache-2.0
"""
Averages over whole seconds, the record that onset and end are judged on.

A bin is one second of one channel, numbered by floor(stamp / 1 s), so that a
monitor that starts later has the same bins. What is kept is not the bins but
their running totals, in whole milliseconds and millionths: the difference of
two totals is the sum over the bins between them, so that a mean or a line fit
costs the same over any length. Integers make it exact; running sums in floating
point would remember rounding errors from before.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.coastdown.past import CHANNELS, FIRST_TRACK, GEODETIC, NEVER
from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import ABSURD_SPEED_M_S, KIND, SECOND_NS, Channel, Float64, Int64

KINDS = GEODETIC + 1  # of these, a speed can be had from
SOURCES = np.argsort(KIND, kind='stable')[: int((KIND < KINDS).sum())]
"""Channels that a speed can be had from, best first."""
RANK = np.argsort(np.argsort(KIND, kind='stable'), kind='stable')
"""Of each channel, its place among `SOURCES`; of others, behind."""
EARTH_RADIUS_M = 6_371_008.8  # mean; the third digit of a speed does not matter here

# Far finer than any sensor, and coarse enough that the centred sums of a line over an hour and
# a half fit into 63 bits.
PER_SECOND = 1000
PER_UNIT = 1e6  # m/s, m, rad/s, cosine and sine
PER_DEGREE = 1e11
UNIT = np.array([PER_DEGREE if kind == GEODETIC else PER_UNIT for kind in KIND])
PITCH_LEAST = 1e-3  # a pitch below it is none

COUNT, TIME, A, B = range(4)
SPEED, TIME_TIME, TIME_SPEED = range(2, 5)


class Bins(NamedTuple):
    """
    The bins of the last seconds, as running totals in a ring of slots.

    Attributes
    ----------
    filling : (channels,) int64
        The newest bin that holds anything, whether it was closed or not; NEVER where none does.
    samples : (channels,) int64
        How many are in it.
    sums : (channels, 3)
        Their sums: time within the second [s] and the two columns.
    first : (channels,)
        Second column of its first sample, the branch of a longitude.
    closed : (channels,) int64
        The newest bin that is in the totals; NEVER where none is.
    places : (channels, slots, 4) int64
        Totals up to a bin: bins, time [ms] and the two columns; cosine and sine for a
        heading. Not of the speeds as read.
    speeds : (channels, slots, 5) int64
        Totals up to a bin: bins, time [ms], speed, time^2, time x speed. The speed from
        positions is by differences, left out where there are too few.

    Notes
    -----
    A total is modulo 2^64: it may overflow, the difference of two does not.
    A bin in which nothing came repeats the total before it.
    """

    filling: Int64
    samples: Int64
    sums: Float64
    first: Float64
    closed: Int64
    places: Int64
    speeds: Int64

    @classmethod
    def fresh(cls, size: int) -> Bins:
        """
        Return empty bins for at least the last `size` seconds.
        """
        slots = 1 << size.bit_length()  # the total before the oldest bin is needed too
        return cls(
            np.full(CHANNELS, NEVER),
            np.zeros(CHANNELS, np.int64),
            np.zeros((CHANNELS, 3)),
            np.zeros(CHANNELS),
            np.full(CHANNELS, NEVER),
            np.zeros((CHANNELS, slots, 4), np.int64),
            np.zeros((CHANNELS, slots, 5), np.int64),
        )


@compiled(uncounted=True)
def smoothing(width: int) -> int:
    """
    Return over how many bins positions are averaged before they make a speed.

    A sixth of the slope window: 10 s of 60 s.
    """
    return int(max(1, width // 6))


@compiled(inline=True, uncounted=True)
def span(bins: Bins, channel: int, last: int, width: int) -> tuple[int, int]:
    """
    Say whose totals differ by the bins last - width + 1 .. last, as far as these are kept.

    Returns
    -------
    before, last
        Bins; the first is the last one before the span.
    """
    newest = bins.closed[channel]
    before = max(last - width, newest - bins.places.shape[1] + 1)
    return before, max(before, min(last, newest))


@compiled(inline=True, uncounted=True)
def _mean(
    bins: Bins, channel: int, last: int, width: int, a: int, b: int
) -> tuple[float, float, float, int]:
    """Average as `mean_place`, from the integers `a` and `b` on, in seconds and integers."""
    places = bins.places[channel]
    mask = len(places) - 1
    before, newest = span(bins, channel, last, width)
    low, high = places[before & mask], places[newest & mask]
    count = high[COUNT] - low[COUNT]
    if count == 0:
        return np.nan, np.nan, np.nan, 0
    return (
        (high[TIME] - low[TIME] - count * last * PER_SECOND) / (count * PER_SECOND),
        (high[A] - low[A] - count * a) / count,
        (high[B] - low[B] - count * b) / count,
        count,
    )


@compiled(inline=True, uncounted=True)
def mean_place(bins: Bins, channel: int, last: int, width: int) -> tuple[float, float, float, int]:
    """
    Average two columns over the bins last - width + 1 .. last.

    Returns
    -------
    time, a, b, count
        The time [s] from the beginning of bin `last`; cosine and sine of a heading.
    """
    time, a, b, count = _mean(bins, channel, last, width, 0, 0)
    return time, a / UNIT[channel], b / UNIT[channel], count


@compiled(inline=True, uncounted=True)
def displacement(bins: Bins, channel: int, last: int, width: int) -> tuple[float, float, float]:
    """
    Return time [s] and way east and north [m] between two neighbouring spans.

    Parameters
    ----------
    last, width
        The spans are the `width` bins up to `last` and as many before them.
    """
    places = bins.places[channel]
    mask = len(places) - 1
    # from the newest place on: the branch of a longitude counts the turns since the start
    newest = min(last, bins.closed[channel])
    oldest = newest - width
    while newest > oldest and places[newest & mask, COUNT] == places[(newest - 1) & mask, COUNT]:
        newest -= 1
    a = places[newest & mask, A] - places[(newest - 1) & mask, A]
    b = places[newest & mask, B] - places[(newest - 1) & mask, B]
    t1, a1, b1, n1 = _mean(bins, channel, last, width, a, b)
    t0, a0, b0, n0 = _mean(bins, channel, last - width, width, a, b)
    if n0 == 0 or n1 == 0:
        return np.nan, np.nan, np.nan
    time = t1 - t0 + width
    if KIND[channel] == GEODETIC:
        north = math.radians((a1 - a0) / PER_DEGREE) * EARTH_RADIUS_M
        latitude = math.radians((a + a1) / PER_DEGREE)
        east = math.radians((b1 - b0) / PER_DEGREE) * math.cos(latitude) * EARTH_RADIUS_M
        return time, east, north
    return time, (a1 - a0) / PER_UNIT, (b1 - b0) / PER_UNIT


@compiled(inline=True, uncounted=True)
def line(bins: Bins, source: int, last: int, width: int) -> tuple[float, float, int]:
    """
    Fit a straight line to the speed over the bins last - width + 1 .. last.

    Returns
    -------
    slope, level, count
        Slope [m/s^2], speed at the newest bin [m/s] and bins used; NaN where
        fewer than four bins, or bins from less than 2/3 of the width, are there.

    Notes
    -----
    Where a gap leaves too few, but any, the window reaches back as far again: a
    record that goes on after a gap has a slope at once.
    """
    speeds = bins.speeds[source]
    mask = len(speeds) - 1
    for reach in (width, 2 * width):
        before, newest = span(bins, source, last, reach)
        low, high = speeds[before & mask], speeds[newest & mask]
        count = high[COUNT] - low[COUNT]
        if count == 0:
            return np.nan, np.nan, count
        if count < 4:
            continue
        while speeds[(newest - 1) & mask, COUNT] == high[COUNT]:
            newest -= 1
        oldest = before + 1
        while speeds[oldest & mask, COUNT] == low[COUNT]:
            oldest += 1
        latest = high[TIME] - speeds[(newest - 1) & mask, TIME]
        earliest = speeds[oldest & mask, TIME] - low[TIME]
        if 3 * (latest - earliest) >= 2 * (width - 1) * PER_SECOND:
            break
    else:
        return np.nan, np.nan, count
    # from the middle of the window and the newest speed on: the sums keep their digits
    middle = (last - width // 2) * PER_SECOND
    origin = high[SPEED] - speeds[(newest - 1) & mask, SPEED]
    time, speed = high[TIME] - low[TIME], high[SPEED] - low[SPEED]
    time_time = high[TIME_TIME] - low[TIME_TIME] - middle * (2 * time - count * middle)
    time_speed = (
        high[TIME_SPEED] - low[TIME_SPEED]
        - middle * speed - origin * (time - count * middle)
    )  # fmt: skip
    time -= count * middle
    speed -= count * origin
    mean_time, mean_speed = time / count, speed / count
    slope = (time_speed - time * mean_speed) / (time_time - time * mean_time)
    level = origin + mean_speed + slope * (latest - middle - mean_time)
    return slope * (PER_SECOND / PER_UNIT), level / PER_UNIT, count


@compiled(inline=True, uncounted=True)
def mean_turning(bins: Bins, channel: int, last: int, width: int) -> tuple[float, int]:
    """
    Return the mean of a shaft speed or pitch over the bins last - width + 1 .. last.
    """
    _, turning, _, count = mean_place(bins, channel, last, width)
    return turning, count


@compiled(uncounted=True)
def speeds_kept(bins: Bins, source: int, last: int, width: int, speeds: Float64) -> int:
    """
    Put the speeds [m/s] of the bins last - width + 1 .. last in an array.

    Returns
    -------
    int
        How many there are.
    """
    totals = bins.speeds[source]
    mask = len(totals) - 1
    before, newest = span(bins, source, last, width)
    count = 0
    for number in range(before + 1, newest + 1):
        low, high = totals[(number - 1) & mask], totals[number & mask]
        if high[COUNT] != low[COUNT]:
            speeds[count] = (high[SPEED] - low[SPEED]) / PER_UNIT
            count += 1
    return count


def mean_speeds(bins: Bins, source: int, edges: Int64) -> tuple[Int64, Float64]:
    """
    Return of each span between two edges the bins that are there, and the mean speed [m/s].

    Parameters
    ----------
    edges : (n + 1,)
        Bins with which the spans end, ascending or descending.
    """
    totals = bins.speeds[source]
    edges = np.minimum(edges, int(bins.closed[source])) & (len(totals) - 1)
    each = np.diff(totals[edges], axis=0)
    count = each[:, COUNT]
    with np.errstate(invalid='ignore'):
        return np.abs(count), each[:, SPEED] / (PER_UNIT * count)


def unread(bins: Bins, which: NDArray[np.bool_] | list[int]) -> Bins:
    """
    Return bins in which some channels were never read.
    """
    closed, filling = bins.closed.copy(), bins.filling.copy()
    closed[which] = filling[which] = NEVER
    return bins._replace(closed=closed, filling=filling)


def forget_speeds(bins: Bins, source: int) -> None:
    """
    Take the closed bins of a speed source out of the totals.
    """
    totals = bins.speeds[source]
    totals[:] = totals[int(bins.closed[source]) & (len(totals) - 1)].copy()


_CIRCLE = 360 * 10**11
_FARTHEST = 9e18  # beyond it there is no integer for a value
_FASTEST = int(ABSURD_SPEED_M_S * PER_UNIT)


@compiled(inline=True, uncounted=True)
def add(bins: Bins, channel: int, number: int, stamp: int, a: float, b: float) -> None:
    """
    Add an accepted sample to the bin being filled.
    """
    if bins.samples[channel] == 0:
        bins.filling[channel] = number
        bins.first[channel] = b
    if KIND[channel] == Channel.POSITION_GEODETIC:
        apart = b - bins.first[channel]
        if abs(apart) > 180.0:
            b -= 360.0 * np.round(apart / 360.0)
    elif channel == Channel.HEADING:
        a, b = math.cos(a), math.sin(a)
    bins.samples[channel] += 1
    bins.sums[channel, 0] += (stamp - number * SECOND_NS) * 1e-9
    bins.sums[channel, 1] += a
    bins.sums[channel, 2] += b


@compiled(inline=True, uncounted=True)
def close(bins: Bins, channel: int, width: int) -> int:
    """
    Close the bin being filled and return its number.

    Parameters
    ----------
    width
        Length of a slope window in bins; `smoothing` follows from it.
    """
    number, before = bins.filling[channel], bins.closed[channel]
    count = bins.samples[channel]
    unit = UNIT[channel]
    time = number * PER_SECOND + _whole(bins.sums[channel, 0] / count * PER_SECOND)
    a = _whole(bins.sums[channel, 1] / count * unit)
    b = _whole(bins.sums[channel, 2] / count * unit)
    bins.samples[channel] = 0
    bins.sums[channel] = 0.0
    bins.closed[channel] = number
    if KIND[channel] < FIRST_TRACK:
        _add_speed(bins, channel, before, number, time, a)
        return int(number)
    places = bins.places[channel]
    mask = len(places) - 1
    if KIND[channel] == Channel.POSITION_GEODETIC and before != NEVER:
        # on the branch of the bin before
        turned = places[before & mask, B] - places[(before - 1) & mask, B] - b
        b += (turned + _CIRCLE // 2) // _CIRCLE * _CIRCLE
    _repeat(places, before, number)
    total = places[number & mask]
    total[COUNT] += 1
    total[TIME] += time
    total[A] += a
    total[B] += b
    if KIND[channel] < KINDS:
        time, speed = _speed_of_track(bins, channel, number, smoothing(width))
        _add_speed(bins, channel, before, number, time, speed)
    return int(number)


@compiled(inline=True, uncounted=True)
def _add_speed(bins: Bins, source: int, before: int, number: int, time: int, speed: int) -> None:
    """Take the speed of a bin into the totals, unless it is faster than any ship."""
    speeds = bins.speeds[source]
    _repeat(speeds, before, number)
    if speed > _FASTEST:
        return
    total = speeds[number & (len(speeds) - 1)]
    total[COUNT] += 1
    total[TIME] += time
    total[SPEED] += speed
    total[TIME_TIME] += time * time
    total[TIME_SPEED] += time * speed


@compiled(inline=True, uncounted=True)
def _repeat(totals: Int64, before: int, number: int) -> None:
    """Repeat the total of the bin `before` up to the bin `number`."""
    mask = len(totals) - 1
    old = totals[before & mask]
    for empty in range(max(before, number - len(totals)) + 1, number + 1):
        total = totals[empty & mask]
        for i in range(totals.shape[1]):
            total[i] = old[i]


@compiled(inline=True, uncounted=True)
def _speed_of_track(bins: Bins, channel: int, number: int, width: int) -> tuple[int, int]:
    """Return time [ms] and speed from the means of 2 x `width` bins."""
    time, east, north = displacement(bins, channel, number, width)
    if not time > 0.0:
        return 0, _FASTEST + 1
    newest = mean_place(bins, channel, number, width)[0]
    speed = math.sqrt(east * east + north * north) / time
    middle = _whole((newest - 0.5 * time) * PER_SECOND)
    return number * PER_SECOND + middle, _whole(speed * PER_UNIT)


@compiled(inline=True, uncounted=True)
def _whole(value: float) -> int:
    """Return the nearest integer."""
    return int(np.rint(max(-_FARTHEST, min(_FARTHEST, value))))
