# SPDX-License-Identifier: Apache-2.0
"""The heading of a coastdown, read from the bins."""

from __future__ import annotations

import math

from shipdrag_ros.coastdown.bins import Bins, mean_place
from shipdrag_ros.samples import Channel

HEADING_BEFORE_S = 60  # the heading of a coastdown is the mean over this long before it
_HEADING = int(Channel.HEADING)


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
