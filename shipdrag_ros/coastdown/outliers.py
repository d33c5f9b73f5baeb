# SPDX-License-Identifier: Apache-2.0
"""
Readings of the motion that the readings before them make impossible.

A log reads 0 now and then, spikes and sticks; a fix jumps. What is compared is the
newest reading with the last accepted one, and with the median of the last five, so
that one bad reading that was let in does not shut out the good ones after it. They
may be apart by what is learnt (`past`), by six standard deviations that the reading
itself states, and by what a ship can change in the time between.

The world jumps too: a hull is caught, a radar takes another mark. Refused readings
that agree with each other for long enough are the new truth. Those that repeat to the
last bit, as zeros do, are not, where the sensor did not repeat before.
"""

from __future__ import annotations

import math

import numpy as np

from shipdrag_ros.coastdown.past import (
    AGREED,
    CHANNELS,
    FIRST_TRACK,
    GEODETIC,
    KEPT,
    M_PER_DEGREE,
    MIDDLE,
    NEVER,
    REPEATS,
    SD,
    Past,
    apart,
    keep,
    keep_and_learn,
    learn_anew,
    learn_gate,
    median,
    repeats_kept,
    same_as_last,
)
from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import KIND

_ACCELERATION_M_S2 = 0.15  # that needs no proof: three times what a merchant ship coasts with
_FASTER = 1.5  # than by the last readings a ship may get, without proof
_BRAKE_M_S2 = 4.0  # between two readings that are refused
_AGREED_NS = 5_000_000_000
_SILENT_NS = 300_000_000_000  # after it nothing is compared with what was before
_DOUBTS = 64  # readings refused more than accepted, after which all is learnt anew
_DOUBTED_NS = 60_000_000_000


@compiled(uncounted=True)
def forget_past(past: Past) -> None:
    """
    Return to the state before the first reading.
    """
    past.heard_ns[:] = NEVER
    for channel in range(CHANNELS):
        learn_anew(past, channel)


@compiled(inline=True, uncounted=True)
def fits(
    past: Past, channel: int, stamp: int, a: float, b: float, variance_a: float, variance_b: float
) -> bool:
    """
    Say whether a reading of the motion may be one, by those before it.

    Changes nothing.
    """
    count = past.accepted[channel]
    last = (count - 1) % KEPT
    if KIND[channel] < FIRST_TRACK:
        if a != 0.0 and abs(a - past.value[channel, last, 0]) <= past.gate[channel]:
            return True
    elif KIND[channel] < GEODETIC:
        x, y = a - past.value[channel, last, 0], b - past.value[channel, last, 1]
        if abs(x) + abs(y) <= past.gate[channel]:
            return True
    else:
        x, y = a - past.value[channel, last, 0], b - past.value[channel, last, 1]
        if (abs(x) + abs(y)) * M_PER_DEGREE <= past.gate[channel]:
            return True
    return bool(_may_be(past, channel, stamp, a, b, variance_a, variance_b))


@compiled(inline=True, uncounted=True)
def sticks(past: Past, channel: int) -> bool:
    """
    Say whether the last reading, if it comes again, is that of a sensor that sticks.
    """
    return bool(past.stuck[channel])


@compiled(uncounted=True)
def repeats_refused(
    past: Past, channel: int, stamp: int, a: float, b: float, longest_ns: int
) -> bool:
    """
    Say whether a reading has been refused unchanged for longer than `longest_ns`.
    """
    return bool(
        past.refused_count[channel] > 0
        and past.refused_new[channel] == 0
        and _same_as_refused(past, channel, a, b)
        and stamp - past.refused_ns[channel, 0] > longest_ns
    )


@compiled(uncounted=True)
def _may_be(
    past: Past, channel: int, stamp: int, a: float, b: float, variance_a: float, variance_b: float
) -> bool:
    """Judge a reading with all there is."""
    return bool(
        _silent(past, channel, stamp)
        or _agrees_with_accepted(past, channel, stamp, a, b, variance_a, variance_b)
        or _is_new_truth(past, channel, stamp, a, b, variance_a, variance_b)
    )


@compiled(uncounted=True)
def _width(past: Past, channel: int, gap_ns: int, variance_a: float, variance_b: float) -> float:
    """Return how far two readings so far apart in time may be apart."""
    gap = gap_ns * 1e-9
    stated = 0.0
    if variance_a > 0.0 and variance_a < np.inf:
        stated += variance_a
    if KIND[channel] < FIRST_TRACK:
        way = max(_ACCELERATION_M_S2, _FASTER * _latest_rate(past, channel)) * gap
    else:
        if variance_b > 0.0 and variance_b < np.inf:
            stated += variance_b
        rate = max(past.rate[channel], _latest_rate(past, channel))
        way = (_FASTER * rate + _ACCELERATION_M_S2 * gap) * gap
    return float(max(past.gate[channel], SD * math.sqrt(stated)) + way)


@compiled(uncounted=True)
def _latest_rate(past: Past, channel: int) -> float:
    """Return the change a second over the last `MIDDLE` readings: a ship may get under way."""
    count = past.accepted[channel]
    if count < MIDDLE:
        return 0.0
    last, first = (count - 1) % KEPT, (count - MIDDLE) % KEPT
    new, old = past.value[channel, last], past.value[channel, first]
    time = (past.stamp_ns[channel, last] - past.stamp_ns[channel, first]) * 1e-9
    return float(apart(channel, new[0], new[1], old[0], old[1]) / time) if time > 0.0 else 0.0


@compiled(uncounted=True)
def _agrees_with_accepted(
    past: Past, channel: int, stamp: int, a: float, b: float, variance_a: float, variance_b: float
) -> bool:
    """Say whether a reading is near the last accepted one, or the median of the last few."""
    count = past.accepted[channel]
    if count == 0:
        return True
    last = (count - 1) % KEPT
    last_a, last_b = past.value[channel, last, 0], past.value[channel, last, 1]
    gap = stamp - past.stamp_ns[channel, last]
    if KIND[channel] < FIRST_TRACK and a == 0.0:
        gap = 0  # no ship stops between two readings: the classic drop-out of a log
    width = _width(past, channel, gap, variance_a, variance_b)
    if apart(channel, a, b, last_a, last_b) <= width:
        return True
    if count < MIDDLE:
        return False
    if KIND[channel] >= FIRST_TRACK:
        middle = (count - 1 - MIDDLE // 2) % KEPT
        gap = stamp - past.stamp_ns[channel, middle]
        width = _width(past, channel, gap, variance_a, variance_b)
    middle_a = median(past, channel, count, 0, last_a)
    middle_b = median(past, channel, count, 1, last_b)
    return bool(apart(channel, a, b, middle_a, middle_b) <= width)


@compiled(uncounted=True)
def _same_as_refused(past: Past, channel: int, a: float, b: float) -> bool:
    last = (past.refused_count[channel] - 1) % AGREED
    return bool(
        a == past.refused[channel, last, 0]
        and (KIND[channel] < FIRST_TRACK or b == past.refused[channel, last, 1])
    )


@compiled(uncounted=True)
def _agrees_with_refused(
    past: Past, channel: int, stamp: int, a: float, b: float, variance_a: float, variance_b: float
) -> bool:
    """Say whether a reading is near the last one that was refused."""
    count = past.refused_count[channel]
    if count == 0:
        return False
    last = (count - 1) % AGREED
    gap = stamp - past.refused_ns[channel, 1]
    width = _width(past, channel, gap, variance_a, variance_b)
    last_a, last_b = past.refused[channel, last, 0], past.refused[channel, last, 1]
    if KIND[channel] < FIRST_TRACK:
        if count == 1:
            width += _BRAKE_M_S2 * gap * 1e-9
        else:  # a car that brakes goes on as it did
            lasted = past.refused_ns[channel, 1] - past.refused_ns[channel, 0]
            steps = gap * (count - 1) / max(1, lasted)  # stamps may be equal
            going_on = (last_a - past.refused[channel, (count - 2) % AGREED, 0]) * steps
            if abs(a - last_a - going_on) <= width:
                return True
    return bool(apart(channel, a, b, last_a, last_b) <= width)


@compiled(uncounted=True)
def _is_new_truth(
    past: Past, channel: int, stamp: int, a: float, b: float, variance_a: float, variance_b: float
) -> bool:
    """Say whether a reading is one of those that were refused for too long."""
    count = past.refused_count[channel]
    if (
        count + 1 < AGREED
        or stamp - past.refused_ns[channel, 0] < _AGREED_NS
        or not _agrees_with_refused(past, channel, stamp, a, b, variance_a, variance_b)
    ):
        return False
    new = past.refused_new[channel] + (not _same_as_refused(past, channel, a, b))
    if 2 * new >= AGREED - 1:
        return True
    natural = repeats_kept(past, channel, min(past.accepted[channel], KEPT), 0) > REPEATS
    return natural and (KIND[channel] >= FIRST_TRACK or a != 0.0)


@compiled(inline=True, uncounted=True)
def take(
    past: Past, channel: int, stamp: int, a: float, b: float, variance_a: float, variance_b: float
) -> None:
    """
    Remember an accepted reading.
    """
    if stamp < past.due_ns[channel] and not same_as_last(past, channel, a, b):
        keep(past, channel, stamp, a, b)
    else:
        _take(past, channel, stamp, a, b, variance_a, variance_b)


@compiled(uncounted=True)
def _take(
    past: Past, channel: int, stamp: int, a: float, b: float, variance_a: float, variance_b: float
) -> None:
    if _silent(past, channel, stamp):
        learn_anew(past, channel)
    if past.refused_count[channel] > 0:
        _settle(past, channel, stamp, a, b, variance_a, variance_b)
    past.doubts[channel] = max(0, past.doubts[channel] - 1)
    keep_and_learn(past, channel, stamp, a, b)


@compiled(uncounted=True)
def _silent(past: Past, channel: int, stamp: int) -> bool:
    """Say whether so long nothing was heard that what was before says nothing."""
    count = past.accepted[channel]
    if count == 0:
        return False
    heard = max(past.stamp_ns[channel, (count - 1) % KEPT], past.heard_ns[channel])
    return bool(stamp - heard > _SILENT_NS)


@compiled(uncounted=True)
def _settle(
    past: Past, channel: int, stamp: int, a: float, b: float, variance_a: float, variance_b: float
) -> None:
    """Draw the consequence of an accepted reading after refused ones."""
    refused = past.refused_count[channel]
    if not _agrees_with_accepted(past, channel, stamp, a, b, variance_a, variance_b):
        first, last = past.refused_ns[channel, 0], past.refused_ns[channel, 1]
        learn_anew(past, channel)
        kept = min(refused, AGREED)
        for i in range(kept):
            slot = (refused - kept + i) % AGREED
            at = last - (last - first) * (kept - 1 - i) // max(1, refused - 1)
            keep_and_learn(
                past, channel, at, past.refused[channel, slot, 0], past.refused[channel, slot, 1]
            )
    past.refused_count[channel] = 0
    past.refused_new[channel] = 0


@compiled(uncounted=True)
def refuse(
    past: Past, channel: int, stamp: int, a: float, b: float, variance_a: float, variance_b: float
) -> None:
    """
    Remember a reading that was refused for its value.
    """
    past.heard_ns[channel] = stamp
    past.due_ns[channel] = NEVER
    learn_gate(past, channel)  # the last time may be long ago
    if past.accepted[channel] > 0 and same_as_last(past, channel, a, b):
        return  # a sensor that sticks where it was
    refused = past.refused_count[channel]
    same = refused > 0 and _same_as_refused(past, channel, a, b)
    if _agrees_with_refused(past, channel, stamp, a, b, variance_a, variance_b):
        past.refused_new[channel] += not same
    else:
        refused = 0
        past.refused_new[channel] = 0
        past.refused_ns[channel, 0] = stamp
    past.refused[channel, refused % AGREED, 0] = a
    past.refused[channel, refused % AGREED, 1] = b
    past.refused_count[channel] = refused + 1
    past.refused_ns[channel, 1] = stamp
    if same:
        return
    if past.doubts[channel] == 0:
        past.doubted_ns[channel] = stamp
    past.doubts[channel] += 1
    if past.doubts[channel] >= _DOUBTS and stamp - past.doubted_ns[channel] > _DOUBTED_NS:
        learn_anew(past, channel)
