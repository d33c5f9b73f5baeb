# SPDX-License-Identifier: Apache-2.0
"""
When a coastdown is over, and where its record ends.

Judged each second on the bins, in this order: the shaft turns again, the ship
turns, the minimum speed is reached, the speed settles or rises. The record ends
where the cause began, not where it was noticed.
"""

from __future__ import annotations

from dataclasses import dataclass

from shipdrag_ros.coastdown.bins import Bins, line
from shipdrag_ros.coastdown.events import EndedBy
from shipdrag_ros.coastdown.memory import Tuning
from shipdrag_ros.coastdown.onset import Candidate, bend
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
    width, start, source = tuning.slopes.width, coasting.start, coasting.source
    earlier = number - width
    span = min(_EARLIER_WINDOWS * width, earlier - start)
    if span >= width:
        expected = _extrapolated(bins, source, earlier, span, level - 0.5 * slope * width)
        if slope - expected > coasting.limits[0]:
            return _bend(bins, coasting, tuning, earlier - width, number)
    confirm = round(parameters.confirm_s)
    long = 2 * confirm
    if number - long >= start + long:
        overall, newest, _ = line(bins, source, number, long)
        expected = _extrapolated(
            bins, source, start + long, confirm, newest - 0.5 * overall * long
        )
        # slopes over a longer span wander less, at least in proportion
        if overall - expected > coasting.limits[0] * width / long:
            return _bend(bins, coasting, tuning, start, number)
    return None


def _bend(bins: Bins, coasting: Candidate, tuning: Tuning, first: int, number: int) -> int:
    """Return the last bin before the speed began to settle or to rise."""
    first = max(first, coasting.start)
    at = bend(bins, coasting.source, first, number, tuning.speed_min, degree=1, sign=-1)
    # the thrust builds up before the speed shows it
    return max(first, at - tuning.slopes.width // 6)


def _extrapolated(bins: Bins, source: int, last: int, span: int, speed: float) -> float:
    """Return the gentlest slope that coasting on at `speed` explains [m/s^2]."""
    slope, level, _ = line(bins, source, last, span)
    middle = level - 0.5 * slope * span
    if not middle > 0.0:
        return 0.0
    return float(min(slope, 0.0) * min(1.0, max(0.0, speed / middle)) ** _EXPONENT)
