# SPDX-License-Identifier: Apache-2.0
"""
Heading and course, read from the bins.

A turn spoils a coastdown; it is found by comparing the bins since the onset with
those before it.
"""

from __future__ import annotations

import math

from shipdrag_ros.coastdown.bins import (
    FIRST_TRACK,
    SOURCES,
    Bins,
    displacement,
    mean_place,
    newest_bin,
)
from shipdrag_ros.samples import Channel

HEADING_BEFORE_S = 60  # the heading of a coastdown is the mean over this long before it
_HEADING = int(Channel.HEADING)
_YAW_S = 5  # headings are averaged over this long: a ship yaws in the waves


def mean_heading(bins: Bins, last: int, width: int) -> float:
    """
    Return the circular mean of the heading as sent [rad]; NaN without any.
    """
    _, cosine, sine, count = mean_place(bins, _HEADING, last, width)
    return math.atan2(sine, cosine) if count else math.nan


def rep103_yaw(heading: float, convention: str) -> float:
    """
    Return the yaw from east, anticlockwise, in (-pi, pi] [rad].

    Parameters
    ----------
    heading
        As sent [rad].
    convention
        `Parameters.heading_convention`.
    """
    yaw = 0.5 * math.pi - heading if convention == 'compass' else heading
    return math.atan2(math.sin(yaw), math.cos(yaw))


def turned_at(bins: Bins, start: int, number: int, width: int, turn_rad: float) -> int | None:
    """
    Say whether the ship has turned since bin `start`.

    Parameters
    ----------
    start, number
        First bin of the coastdown and the bin that closed last.
    width
        Length of a slope window: a course is taken over twice a half of it.
    turn_rad
        Change that counts as a turn.

    Returns
    -------
    int or None
        The last bin before the turn, where half of the change was not exceeded;
        None where the ship has not turned, or nothing shows it.

    Notes
    -----
    The heading decides where there is one; the course over ground of a ship
    that slows down in a cross current changes without a turn. A fix that jumps,
    as when a radar takes another mark, is in a course for as long as the way
    that this is taken over: a turn is a change that outlasts it.
    """
    before = mean_heading(bins, start - 1, HEADING_BEFORE_S)
    way = 0
    if not math.isnan(before) and newest_bin(bins, _HEADING) > start:

        def change(at: int) -> float:
            return _apart(mean_heading(bins, at, _YAW_S), before)
    else:
        half = max(1, width // 2)
        tracks = _tracks(bins, start)
        if not tracks:
            return None
        track = tracks[0]
        way = 2 * half
        # two ways, as a jump may be in one of them; nothing need be known of the older
        courses = [_course(bins, track, start - 1 - back, half) for back in (0, way)]

        def change(at: int) -> float:
            # a way that begins before the onset shows nothing new
            if at < start + way:
                return math.nan
            now = _course(bins, track, at, half)
            return min(_apart(now, course) for course in courses)

    # at some of the bins between, too few fixes may show a course
    if not all(change(at) > turn_rad for at in (number, number - way)) or any(
        change(at) <= turn_rad for at in range(number - way, number)
    ):
        return None
    last = number
    while last > start and not change(last) <= 0.5 * turn_rad:
        last -= 1
    return last


def heading_is_known(bins: Bins, start: int) -> bool:
    """
    Say whether a heading or a course has come since bin `start`.
    """
    return newest_bin(bins, _HEADING) > start or bool(_tracks(bins, start))


def _tracks(bins: Bins, start: int) -> list[int]:
    return [track for track in range(FIRST_TRACK, SOURCES) if newest_bin(bins, track) > start]


def _course(bins: Bins, track: int, last: int, half: int) -> float:
    _, east, north = displacement(bins, track, last, half)
    return math.atan2(north, east)


def _apart(one: float, other: float) -> float:
    """Return the size of the angle between two directions [rad]."""
    return abs(math.remainder(one - other, 2.0 * math.pi))
