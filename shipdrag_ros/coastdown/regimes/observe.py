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
)
from shipdrag_ros.coastdown.past import FIRST_TRACK, NEVER
from shipdrag_ros.coastdown.regimes.state import ADVANCE, GROUND, LOG, RANGES, RATE, SHAFTS
from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import KIND, Channel, Float64

_LOG, _GROUND = int(Channel.SPEED_THROUGH_WATER), int(Channel.SPEED_OVER_GROUND)
_TRACKS = (int(Channel.POSITION), int(Channel.POSITION_GEODETIC))
_HEADING = int(Channel.HEADING)
_SHAFT, _SHAFT_2, _PITCH = int(Channel.SHAFT), int(Channel.SHAFT_2), int(Channel.PITCH)
_BESIDE = 120  # seconds over which two instruments are compared
_COURSE = 6  # bins of a way that shows a course


@compiled(inline=True, uncounted=True)
def _mean_speed(bins: Bins, source: int, last: int, width: int) -> float:
    totals = bins.speeds[source]
    mask = len(totals) - 1
    newest = bins.closed[source]
    before = max(last - width, newest - mask)
    last = max(before, min(last, newest))
    low, high = totals[before & mask], totals[last & mask]
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


@compiled('void(Bins, i8, i8, f8, f8[::1])', like={'Bins': Bins.fresh(1)}, uncounted=True)
def observe(bins: Bins, last: int, width: int, step_s: float, said: Float64) -> None:
    """
    Put what the bins last - width + 1 .. last say into `said`; NaN where they say nothing.
    """
    for k in range(len(said)):
        said[k] = np.nan
    log, ground = _speaking(bins, _LOG, last, width), _speaking(bins, _GROUND, last, width)
    said[LOG] = _mean_speed(bins, log, last, width) * _level(bins, log, _LOG)
    said[GROUND] = _mean_speed(bins, ground, last, width) * _level(bins, ground, _GROUND)
    said[RANGES] = _range(bins, log, last, width)
    said[RANGES + 1] = _range(bins, ground, last, width)
    for kind in _TRACKS:
        track = _speaking(bins, kind, last, width)
        if mean_place(bins, track, last, width)[3] == 0:
            continue
        time, east, north = displacement(bins, track, last, width)
        _, along, across = displacement(bins, track, last, _COURSE * width)
        way = math.hypot(along, across)
        if not np.isnan(time) and way > 0.0:
            advance = (east * along + north * across) / way * width / time
            said[ADVANCE] = advance
            _, old_east, old_north = displacement(bins, track, last - width, _COURSE * width)
            turned = _apart(math.atan2(across, along), math.atan2(old_north, old_east))
            if _is_one_way(bins, track, last, width):
                said[RATE] = turned / step_s
    _, cosine, sine, count = mean_place(bins, _HEADING, last, width)
    _, old_cosine, old_sine, old = mean_place(bins, _HEADING, last - width, width)
    if count > 0 and old > 0:
        said[RATE] = _apart(math.atan2(sine, cosine), math.atan2(old_sine, old_cosine)) / step_s
    for k in range(4):
        shaft = _SHAFT if k == 0 else _SHAFT_2 + k - 1
        turning, count = mean_turning(bins, shaft, last, width)
        if count > 0:
            pitch, known = mean_turning(bins, _PITCH + k, last, width)
            said[SHAFTS + k] = turning * pitch if known > 0 else turning
