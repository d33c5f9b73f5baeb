# SPDX-License-Identifier: Apache-2.0
"""
How samples become bins: averaged over their second, then taken into the totals.
"""

from __future__ import annotations

import math

import numpy as np

from shipdrag_ros.coastdown.bins import (
    COUNT,
    KINDS,
    PER_SECOND,
    PER_UNIT,
    SPEED,
    TIME,
    TIME_SPEED,
    TIME_TIME,
    UNIT,
    A,
    B,
    Bins,
    displacement,
    mean_place,
    smoothing,
)
from shipdrag_ros.coastdown.past import FIRST_TRACK, NEVER
from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import ABSURD_SPEED_M_S, KIND, SECOND_NS, Channel, Int64

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
