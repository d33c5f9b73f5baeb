# SPDX-License-Identifier: Apache-2.0
"""
Readings of the motion that the readings before them make impossible.

A log reads 0 now and then, spikes and sticks; a fix jumps. A reading and the last accepted
one may be apart by what is learnt (`past`), by six standard deviations that the reading
itself states, and by what the ship has been doing in the time between.

Any other needs proof. A boat brakes and leaps, a hull is caught, a radar takes another mark:
refused readings that follow each other as those of a craft of her length can are the truth,
once they are enough, and all of them are accepted after all. Those that repeat to the last
bit, as zeros do, are not, where the sensor did not repeat before.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.past import (
    AGREED,
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
    repeats_kept,
    same_as_last,
)
from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import KIND

# A hull loses 0.3 g at a Froude number of 1 and above, and as its square below; an engine may
# push as hard as the hull would resist at the speed that the fastest have.
_FASTEST_M_S = 15.0
_LOSES_M_S2 = 0.3 * 9.81
_FASTER = 1.5  # than by the last readings a ship may get, without proof
_AGREED_NS = 5_000_000_000
_DOUBTS = 64  # readings refused more than accepted, after which all is learnt anew
_DOUBTED_NS = 60_000_000_000


class JudgedReading(NamedTuple):
    """Stamp [ns], values and variances of a sample; of one column, the second is unused."""

    stamp: int
    a: float
    b: float
    variance_a: float
    variance_b: float


def quickness(length_m: float) -> float:
    """
    Return what a craft may get faster or slower by in a second [m/s^2], by her length.
    """
    froude_square = _FASTEST_M_S**2 / (9.81 * length_m)
    return _LOSES_M_S2 * min(froude_square, 1.0)


@compiled(inline=True, uncounted=True)
def fits(past: Past, quick: float, channel: int, reading: JudgedReading) -> bool:
    """
    Say whether a reading of the motion may be one, by those before it.

    Changes nothing.
    """
    last, a, b = (past.accepted[channel] - 1) % KEPT, reading.a, reading.b
    off = abs(a - past.value[channel, last, 0])
    if KIND[channel] < FIRST_TRACK:
        near = a != 0.0 and off <= past.gate[channel]
    else:
        off += abs(b - past.value[channel, last, 1])
        near = off * (M_PER_DEGREE if KIND[channel] == GEODETIC else 1.0) <= past.gate[channel]
    return bool(near or _may_be(past, quick, channel, reading))


@compiled(uncounted=True)
def repeats_refused(past: Past, channel: int, reading: JudgedReading, longest_ns: int) -> bool:
    """
    Say whether a reading has been refused unchanged for longer than `longest_ns`.
    """
    return bool(
        past.refused_count[channel] > 0
        and past.refused_new[channel] == 0
        and _same_as_refused(past, channel, reading)
        and reading.stamp - past.refused_ns[channel, 0] > longest_ns
    )


@compiled(uncounted=True)
def _may_be(past: Past, quick: float, channel: int, reading: JudgedReading) -> bool:
    """Judge a reading with all there is."""
    count = past.accepted[channel]
    if count == 0:
        return True
    gap = reading.stamp - past.stamp_ns[channel, (count - 1) % KEPT]
    if KIND[channel] < FIRST_TRACK and reading.a == 0.0:
        gap = 0  # no ship stops between two readings: the classic drop-out of a log
    width = _width(past, 0.0, 0.0, channel, gap, reading)
    return bool(
        _off_accepted(past, channel, reading) <= width
        or (
            past.refused_count[channel] + 1 >= AGREED
            and reading.stamp - past.refused_ns[channel, 0] >= _AGREED_NS
            and _goes_on(past, quick, channel, reading)
        )
    )


@compiled(uncounted=True)
def _off_accepted(past: Past, channel: int, reading: JudgedReading) -> float:
    """Return how far a reading is from the last accepted one [m/s or m]."""
    last = past.value[channel, (past.accepted[channel] - 1) % KEPT]
    return apart(channel, reading.a, reading.b, last[0], last[1])


@compiled(uncounted=True)
def _width(
    past: Past, quick: float, least: float, channel: int, gap_ns: int, reading: JudgedReading
) -> float:
    """Return how far readings may be apart of a ship that is so quick, and at least so fast."""
    gap, own, other = gap_ns * 1e-9, reading.variance_a, reading.variance_b
    stated = own if 0.0 < own < np.inf else 0.0
    rate = _latest_rate(past, channel)
    if KIND[channel] < FIRST_TRACK:
        way = max(quick, _FASTER * rate) * gap
    else:
        stated += other if 0.0 < other < np.inf else 0.0
        way = (_FASTER * max(past.rate[channel], rate, least) + quick * gap) * gap
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
def _same_as_refused(past: Past, channel: int, reading: JudgedReading) -> bool:
    return bool(
        reading.a == past.refused[channel, 0]
        and (KIND[channel] < FIRST_TRACK or reading.b == past.refused[channel, 1])
    )


@compiled(uncounted=True)
def _follows(past: Past, quick: float, channel: int, reading: JudgedReading) -> bool:
    """Say whether a reading may follow the last one that was refused."""
    gap = abs(reading.stamp - past.refused_ns[channel, 1])  # two senders may cross
    width = _width(past, quick, _FASTEST_M_S, channel, gap, reading)
    return past.refused_count[channel] > 0 and _off_refused(past, channel, reading) <= width


@compiled(uncounted=True)
def _off_refused(past: Past, channel: int, reading: JudgedReading) -> float:
    """Return how far a reading is from the last refused one [m/s or m]."""
    last = past.refused[channel]
    return apart(channel, reading.a, reading.b, last[0], last[1])


@compiled(uncounted=True)
def _goes_on(past: Past, quick: float, channel: int, reading: JudgedReading) -> bool:
    """Say whether a reading follows on from refused ones, and not as one that repeats."""
    if not _follows(past, quick, channel, reading):
        return False
    new = past.refused_new[channel] + (not _same_as_refused(past, channel, reading))
    if 2 * new >= min(past.refused_count[channel], AGREED - 1):
        return True
    natural = repeats_kept(past, channel, min(past.accepted[channel], KEPT), 0) > REPEATS
    return natural and (KIND[channel] >= FIRST_TRACK or reading.a != 0.0)


@compiled(uncounted=True)
def proves_refused(past: Past, quick: float, channel: int, reading: JudgedReading) -> bool:
    """
    Say whether an accepted reading goes on from those refused rather than from those before.
    """
    return bool(
        _off_refused(past, channel, reading) < _off_accepted(past, channel, reading)
        and _goes_on(past, quick, channel, reading)
    )


@compiled(inline=True, uncounted=True)
def take(past: Past, channel: int, reading: JudgedReading) -> None:
    """
    Remember an accepted reading.
    """
    stamp, a, b = reading.stamp, reading.a, reading.b
    if stamp < past.due_ns[channel] and not same_as_last(past, channel, a, b):
        keep(past, channel, stamp, a, b)
    else:
        past.refused_count[channel] = 0
        past.refused_new[channel] = 0
        past.doubts[channel] = max(0, past.doubts[channel] - 1)
        keep_and_learn(past, channel, stamp, a, b)


@compiled(uncounted=True)
def refuse(past: Past, quick: float, channel: int, reading: JudgedReading) -> None:
    """
    Remember a reading that was refused for its value.
    """
    stamp, a, b = reading.stamp, reading.a, reading.b
    past.heard_ns[channel] = stamp
    past.due_ns[channel] = NEVER
    learn_gate(past, channel)  # the last time may be long ago
    if past.accepted[channel] > 0 and same_as_last(past, channel, a, b):
        return  # a sensor that sticks where it was
    same = past.refused_count[channel] > 0 and _same_as_refused(past, channel, reading)
    if _follows(past, quick, channel, reading):
        past.refused_new[channel] += not same
        past.refused_ns[channel, 0] = min(past.refused_ns[channel, 0], stamp)
    else:
        past.refused_count[channel] = 0
        past.refused_new[channel] = 0
        past.refused_ns[channel, 0] = stamp
    past.refused[channel, 0] = a
    past.refused[channel, 1] = b
    past.refused_count[channel] += 1
    past.refused_ns[channel, 1] = stamp
    if same:
        return
    if past.doubts[channel] == 0:
        past.doubted_ns[channel] = stamp
    past.doubts[channel] += 1
    if past.doubts[channel] >= _DOUBTS and stamp - past.doubted_ns[channel] > _DOUBTED_NS:
        learn_anew(past, channel)
