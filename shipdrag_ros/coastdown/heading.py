# SPDX-License-Identifier: Apache-2.0
"""
The heading of a coastdown, and compared with the course: is it of the convention stated?

Drivers send compass angles as yaw and the other way round. A ship that makes way
goes about where she points.
"""

from __future__ import annotations

import math

from shipdrag_ros.coastdown.bins import (
    SOURCES,
    Bins,
    displacement,
    mean_place,
)
from shipdrag_ros.coastdown.past import FIRST_TRACK
from shipdrag_ros.samples import KIND, Channel

HEADING_BEFORE_S = 60  # the heading of a coastdown is the mean over this long before it
_SPAN_S = 20  # heading and course are means over so long
_LOOKS = 4  # one after the other, all of which must say the same
_SPEED_M_S = 1.0  # below, a current may set her anywhere
_APART_RAD = 0.6  # more than drift and set make of a ship under way
_SAME_RAD = 0.35
_OTHER = {'rep103': 'compass', 'compass': 'rep103'}


def mean_heading(bins: Bins, last: int, width: int) -> float:
    """
    Return the circular mean of the heading as sent [rad]; NaN without any.
    """
    _, cosine, sine, count = mean_place(bins, Channel.HEADING, last, width)
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


def heading_doubt(bins: Bins, convention: str) -> str:
    """
    Say what is wrong with the heading, by the course of the last 80 s and more.

    Parameters
    ----------
    bins
        What the monitor keeps.
    convention
        `Parameters.heading_convention`.

    Returns
    -------
    str
        '' where they agree, or where nothing can be said: no track, no way, a turn.
    """
    newest = bins.filling[Channel.HEADING]
    tracks = [
        track
        for track in SOURCES
        if KIND[track] >= FIRST_TRACK and bins.filling[track] > newest - 5
    ]
    if newest < 0 or not tracks:
        return ''
    stated, other = [], []
    for look in range(_LOOKS):
        last = newest - 2 - look * _SPAN_S
        span, east, north = displacement(bins, tracks[0], last, _SPAN_S)
        if not math.hypot(east, north) > _SPEED_M_S * span:  # NaN too
            return ''
        # the course is that of the time between the middles of its two spans
        _, cosine, sine, count = mean_place(bins, Channel.HEADING, last, 2 * _SPAN_S)
        if not count or math.hypot(cosine, sine) < 0.9:
            return ''
        sent, course = math.atan2(sine, cosine), math.atan2(north, east)
        stated.append(_apart(rep103_yaw(sent, convention), course))
        other.append(_apart(rep103_yaw(sent, _OTHER[convention]), course))
    if min(abs(each) for each in stated) < _APART_RAD or max(stated) - min(stated) > _SAME_RAD:
        return ''
    degrees = math.degrees(abs(stated[0]))
    text = f'the heading is {degrees:.0f} degrees off the course over ground'
    if max(abs(each) for each in other) < _SAME_RAD:
        return (
            f'{text}, and agrees with it as {_NAMES[_OTHER[convention]]}: set heading_convention '
            f'to {_OTHER[convention]}, or mend the driver'
        )
    return f'{text}: look at its sign, its zero, and the axes of the position'


_NAMES = {'rep103': 'yaw from east, anticlockwise', 'compass': 'a compass angle'}


def _apart(one: float, other: float) -> float:
    return math.remainder(one - other, 2.0 * math.pi)
