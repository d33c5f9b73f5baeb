# SPDX-License-Identifier: Apache-2.0
"""
When a coastdown is over, and where its record ends.

Judged each second on the bins, in this order: the shaft turns again, the ship
turns, the minimum speed is reached, the speed settles or rises. The record ends
where the cause began, not where it was noticed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shipdrag_ros.coastdown.bins import Bins, line
from shipdrag_ros.coastdown.events import EndedBy
from shipdrag_ros.coastdown.kernel import Tuning
from shipdrag_ros.coastdown.onset import Candidate
from shipdrag_ros.coastdown.tracking import shaft_rose_at, shaft_speed, turned_at
from shipdrag_ros.parameters import Parameters

# A ship that coasts decelerates no less than by the fourth power of its falling speed: more
# than friction (2) and waves (3) make it.
_EXPONENT = 4.0
_EARLIER_WINDOWS = 3  # slope windows before the newest one that say how it decelerated


@dataclass(frozen=True)
class End:
    """
    The end of a coastdown: its cause and the last bin that belongs to it.
    """

    ended_by: EndedBy
    last: int


def end_of(
    coasting: Candidate, bins: Bins, tuning: Tuning, parameters: Parameters, number: int
) -> End | None:
    """
    Say whether the coastdown is over now that bin `number` has closed.

    Parameters
    ----------
    coasting
        The candidate as it was confirmed.
    """
    start, width = coasting.start, tuning.slopes.width
    steady = coasting.shaft
    if shaft_speed(bins, number) > parameters.shaft_stopped_fraction * steady:
        return End(EndedBy.ENGINE, shaft_rose_at(bins, start, number, steady, width))
    turned = turned_at(bins, start, number, width, parameters.turn_rad)
    if turned is not None:
        return End(EndedBy.TURN, turned)
    slope, level, _ = line(bins, coasting.source, number, width)
    if level < tuning.speed_min:
        return End(EndedBy.SPEED, number)
    settled = _settled_since(coasting, bins, tuning, parameters, number, slope, level)
    return None if settled is None else End(EndedBy.ENGINE, settled)


def _settled_since(
    coasting: Candidate,
    bins: Bins,
    tuning: Tuning,
    parameters: Parameters,
    number: int,
    slope: float,
    level: float,
) -> int | None:
    """Return the last bin before the speed settled or rose; None where it falls on."""
    width = tuning.slopes.width
    earlier = number - width
    span = min(_EARLIER_WINDOWS * width, earlier - coasting.start)
    if span >= width:
        was, last_speed, _ = line(bins, coasting.source, earlier, span)
        # both slopes are those of the middle of their span
        speed = last_speed - 0.5 * was * span
        ratio = max(0.0, (level - 0.5 * slope * width) / speed) if speed > 0.0 else 0.0
        expected = min(was, 0.0) * min(1.0, ratio) ** _EXPONENT
        if slope - expected > coasting.limit:
            return earlier
    long = 2 * round(parameters.confirm_s)
    if number - coasting.start >= long + width:
        overall, _, _ = line(bins, coasting.source, number, long)
        if not math.isnan(overall) and overall >= 0.0:
            return number - long
    return None
