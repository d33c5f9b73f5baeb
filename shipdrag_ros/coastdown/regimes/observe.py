# SPDX-License-Identifier: Apache-2.0
"""What a bin of the regimes says, taken from the bins of a second."""

from __future__ import annotations

import math

import numpy as np

from shipdrag_ros.coastdown.bins import (
    COUNT,
    PER_UNIT,
    SOURCES,
    SPEED,
    Bins,
    displacement,
    mean_place,
    mean_turning,
    span,
)
from shipdrag_ros.coastdown.past import FIRST_TRACK, NEVER
from shipdrag_ros.coastdown.regimes import state as s
from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import KIND, Channel, Float64

_BESIDE = 120  # seconds over which two instruments are compared
_COURSE = 6  # bins of a way that shows a course


@compiled(inline=True, uncounted=True)
def _mean_speed(bins: Bins, source: int, last: int, width: int) -> float:
    totals = bins.speeds[source]
    mask = len(totals) - 1
    before, newest = span(bins, source, last, width)
    low, high = totals[before & mask], totals[newest & mask]
    count = high[COUNT] - low[COUNT]
    return (high[SPEED] - low[SPEED]) / (PER_UNIT * count) if count > 0 else np.nan


@compiled(inline=True, uncounted=True)
def _range(bins: Bins, source: int, last: int, width: int) -> float:
    """Return the range of the speeds of the seconds of a bin and of the last one before it."""
    totals = bins.speeds[source]
    mask = len(totals) - 1
    newest = bins.closed[source]
    low, high = np.inf, -np.inf
    second, least = min(last, newest), max(last - 3 * width, newest - mask)
    while second > least:
        if totals[second & mask, COUNT] != totals[(second - 1) & mask, COUNT]:
            speed = (totals[second & mask, SPEED] - totals[(second - 1) & mask, SPEED]) / PER_UNIT
            low, high = min(low, speed), max(high, speed)
            if second <= last - width:
                break
        second -= 1
    return high - low if high >= low else np.nan


@compiled(inline=True, uncounted=True)
def _speaking(bins: Bins, kind: int, last: int, width: int) -> int:
    """Return the first instrument of a kind that says something in a bin, or the first."""
    for source in SOURCES:
        if KIND[source] == kind and (
            not np.isnan(_mean_speed(bins, source, last, width))
            if kind < FIRST_TRACK
            else mean_place(bins, source, last, width)[3] > 0
        ):
            return int(source)
    return kind


@compiled(inline=True, uncounted=True)
def _level(bins: Bins, source: int, first: int) -> float:
    """Return what the first of a kind read over what another did, when both were last heard."""
    until = bins.closed[first]
    if source == first or until == NEVER:
        return 1.0
    other = _mean_speed(bins, source, until, _BESIDE)
    # a step from one scale to the other would be a loss of speed
    level = _mean_speed(bins, first, until, _BESIDE) / other if other != 0.0 else np.nan
    return level if level > 0.0 else 1.0


@compiled(inline=True, uncounted=True)
def _apart(one: float, other: float) -> float:
    return math.atan2(math.sin(one - other), math.cos(one - other))


@compiled(uncounted=True)
def _is_one_way(bins: Bins, track: int, last: int, width: int) -> bool:
    """Say whether no fix is missing in two courses, and none is on another mark than before."""
    steps = 2 * _COURSE - 1
    east = north = most = total = 0.0
    for k in range(steps):
        time, e, n = displacement(bins, track, last - k * width, width)
        if np.isnan(time):
            return False
        east, north = east + e / time / steps, north + n / time / steps
    for k in range(steps):
        time, e, n = displacement(bins, track, last - k * width, width)
        off = math.hypot(e / time - east, n / time - north)
        most, total = max(most, off), total + off
    # no ship stops or reverses within a bin; the rest is noise of fixes
    return bool(most < math.hypot(east, north) + 4.0 * (total - most) / (steps - 1.0))


@compiled(inline=True, uncounted=True)
def _say_speed(bins: Bins, kind: int, last: int, width: int, said: Float64, column: int) -> None:
    """Put mean and range of the speed of an instrument that speaks into `said`."""
    source = _speaking(bins, kind, last, width)
    said[column] = _mean_speed(bins, source, last, width) * _level(bins, source, kind)
    said[s.RANGES + column] = _range(bins, source, last, width)


@compiled('void(Bins, i8, i8, f8, f8[::1])', like={'Bins': Bins.fresh(1)}, uncounted=True)
def observe(bins: Bins, last: int, width: int, step_s: float, said: Float64) -> None:
    """
    Put what the bins last - width + 1 .. last say into `said`; NaN where they say nothing.
    """
    said[:] = np.nan
    _say_speed(bins, Channel.SPEED_THROUGH_WATER, last, width, said, s.LOG)
    _say_speed(bins, Channel.SPEED_OVER_GROUND, last, width, said, s.GROUND)
    for kind in (Channel.POSITION, Channel.POSITION_GEODETIC):
        track = _speaking(bins, kind, last, width)
        if mean_place(bins, track, last, width)[3] == 0:
            continue
        time, east, north = displacement(bins, track, last, width)
        _, along, across = displacement(bins, track, last, _COURSE * width)
        way = math.hypot(along, across)
        if not np.isnan(time) and way > 0.0:
            advance = (east * along + north * across) / way * width / time
            said[s.ADVANCE] = advance
            _, old_east, old_north = displacement(bins, track, last - width, _COURSE * width)
            turned = _apart(math.atan2(across, along), math.atan2(old_north, old_east))
            if _is_one_way(bins, track, last, width):
                said[s.RATE] = turned / step_s
    _, cosine, sine, count = mean_place(bins, Channel.HEADING, last, width)
    _, old_cosine, old_sine, old = mean_place(bins, Channel.HEADING, last - width, width)
    if count > 0 and old > 0:
        said[s.RATE] = _apart(math.atan2(sine, cosine), math.atan2(old_sine, old_cosine)) / step_s
    for k in range(4):
        shaft = Channel.SHAFT if k == 0 else Channel.SHAFT_2 + k - 1
        turning, count = mean_turning(bins, shaft, last, width)
        if count > 0:
            pitch, known = mean_turning(bins, Channel.PITCH + k, last, width)
            said[s.SHAFTS + k] = turning * pitch if known > 0 else turning
