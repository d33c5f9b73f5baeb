# SPDX-License-Identifier: Apache-2.0
"""
The last accepted readings of the motion, and which next ones they make impossible.

A log reads 0 now and then, spikes and sticks; a fix jumps. A reading and the last accepted
one may be apart by what is learnt (six robust standard deviations of the differences, and for a
position the way that it has gone), by six that the reading itself states, and by what the ship
has been doing in the time between.

Any other needs proof. A boat brakes and leaps, a hull is caught, a radar takes another mark:
refused readings that follow each other as those of a craft of her length can are the truth,
once they are enough, and all of them are accepted after all. Those that repeat to the last
bit, as zeros do, are not, where the sensor did not repeat before.

The memory is of the last `KEPT` readings of a channel and of those refused since the last one,
so that what comes out does not depend on what was long before.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.rows import MAD_TO_SD
from shipdrag_ros.samples import ABSURD_SPEED_M_S, KIND, Channel, Float64, Int64

FIRST_TRACK = int(Channel.POSITION)  # this kind and those after it are positions
GEODETIC = int(Channel.POSITION_GEODETIC)
CHANNELS = len(Channel)
KEPT = 32  # accepted readings that the gate is learnt from
AGREED = 5  # readings that make a truth: those refused that follow each other
MIDDLE = 5  # readings in the median
SD = 6.0  # standard deviations of a difference, beyond which it is none of this motion
M_PER_DEGREE = 111_195.0
STUCK = 6  # repeats in a row that a sensor that does not repeat makes when it sticks
REPEATS = 2  # among the readings kept: a sensor that repeats more often does so by its nature

NEVER = -(2**62)  # a stamp before all stamps that leaves room for subtraction
_LEARN_NS = 128_000_000_000
_WITNESSES = 16  # readings before a run of repeats that say whether it is natural
_OF_QUARTILE = 1.1503  # its upper quartile
_OF_PLANE = 1.1774  # median of the length of a normal vector of the plane
# A step of 0.1 knots, the resolution of many logs, is never an outlier; and 2 % are not worth it.
_FLOOR_M_S = 0.06
_FLOOR_PART = 0.02
_DEAD_M_S = 0.7  # below it the wheel of a log may stand still, or a display show 0
_BAD = 2.0  # times the sd by the median that noise may have by the quartile
_FLOOR_M = 0.5
_FIRST_M = 500.0  # that the first fixes may be apart, besides what any ship can go


class Past(NamedTuple):
    """
    What is remembered of the channels of the motion.

    Attributes
    ----------
    value : (channels, KEPT, 2)
        The last accepted readings, number n in slot n % KEPT.
    stamp_ns : (channels, KEPT) int64
        Their stamps [ns].
    accepted : (channels,) int64
        How many were accepted since all was learnt anew.
    gate : (channels,)
        Difference of successive readings that noise explains [m/s or m]; inf while unknown.
    rate : (channels,)
        Of positions, the speed by the readings kept [m/s]; else 0.
    learn_ns : (channels,) int64
        Stamp from which on these are to be learnt again [ns].
    due_ns : (channels,) int64
        Stamp from which on an accepted reading is more than kept [ns]; `learn_ns`, or at once.
    repeats, stuck : (channels,) int64
        How often the last one has repeated, and 1 where that means that the sensor sticks.
    refused : (channels, 2)
        The last of the refused readings that follow each other.
    refused_count, refused_new : (channels,) int64
        How many they are, and how many of them differ from the one before.
    refused_ns : (channels, 2) int64
        Stamps of the first and of the last of them [ns].
    heard_ns : (channels,) int64
        Stamp of the last reading that was refused [ns].
    doubts, doubted_ns : (channels,) int64
        Readings refused more than accepted, and the stamp since which [ns].
    scratch : (KEPT,)
        Room to sort in: compiled code makes no arrays.
    """

    value: Float64
    stamp_ns: Int64
    accepted: Int64
    gate: Float64
    rate: Float64
    learn_ns: Int64
    due_ns: Int64
    repeats: Int64
    stuck: Int64
    refused: Float64
    refused_count: Int64
    refused_new: Int64
    refused_ns: Int64
    heard_ns: Int64
    doubts: Int64
    doubted_ns: Int64
    scratch: Float64

    @classmethod
    def fresh(cls) -> Past:
        """
        Return the memory before the first reading.
        """

        def none() -> Int64:
            return np.zeros(CHANNELS, np.int64)

        return cls(
            np.zeros((CHANNELS, KEPT, 2)),
            np.zeros((CHANNELS, KEPT), np.int64),
            none(),
            np.full(CHANNELS, np.inf),
            np.zeros(CHANNELS),
            none(),
            np.full(CHANNELS, NEVER),
            none(),
            none(),
            np.zeros((CHANNELS, 2)),
            none(),
            none(),
            np.zeros((CHANNELS, 2), np.int64),
            np.full(CHANNELS, NEVER),
            none(),
            none(),
            np.zeros(KEPT),
        )


@compiled(uncounted=True)
def learn_anew(past: Past, channel: int) -> None:
    """
    Forget all readings of a channel.
    """
    past.accepted[channel] = 0
    past.gate[channel] = np.inf
    past.rate[channel] = 0.0
    past.due_ns[channel] = NEVER
    past.repeats[channel] = 0
    past.stuck[channel] = 0
    past.refused_count[channel] = 0
    past.refused_new[channel] = 0
    past.doubts[channel] = 0


@compiled(inline=True, uncounted=True)
def keep(past: Past, channel: int, stamp: int, a: float, b: float) -> None:
    """
    Keep an accepted reading where nothing else is due.
    """
    count = past.accepted[channel]
    slot = count % KEPT
    past.value[channel, slot, 0] = a
    past.value[channel, slot, 1] = b
    past.stamp_ns[channel, slot] = stamp
    past.accepted[channel] = count + 1


@compiled(uncounted=True)
def keep_and_learn(past: Past, channel: int, stamp: int, a: float, b: float) -> None:
    """
    Keep an accepted reading, and learn from it what is due.
    """
    count = past.accepted[channel]
    if count > 0 and same_as_last(past, channel, a, b):
        past.repeats[channel] += 1
    else:
        past.repeats[channel] = 0
        past.stuck[channel] = 0
    keep(past, channel, stamp, a, b)
    if past.repeats[channel] == STUCK:
        past.stuck[channel] = _is_stuck(past, channel)
    if count < KEPT or stamp >= past.learn_ns[channel]:
        learn_gate(past, channel)
        past.learn_ns[channel] = (stamp // _LEARN_NS + 1) * _LEARN_NS
    quiet = count >= KEPT and past.repeats[channel] == 0 and past.doubts[channel] == 0
    past.due_ns[channel] = past.learn_ns[channel] if quiet else NEVER


@compiled(inline=True, uncounted=True)
def same_as_last(past: Past, channel: int, a: float, b: float) -> bool:
    """
    Say whether a reading is the last accepted one again; there must be one.
    """
    last = (past.accepted[channel] - 1) % KEPT
    return bool(
        a == past.value[channel, last, 0]
        and (KIND[channel] < FIRST_TRACK or b == past.value[channel, last, 1])
    )


@compiled(uncounted=True)
def apart(channel: int, a: float, b: float, other_a: float, other_b: float) -> float:
    """Return the distance of two readings [m/s or m]."""
    if KIND[channel] < FIRST_TRACK:
        return abs(a - other_a)
    x, y = a - other_a, b - other_b
    if KIND[channel] == GEODETIC:
        y -= 360.0 * np.round(y / 360.0)
        x *= M_PER_DEGREE
        y *= M_PER_DEGREE * math.cos(math.radians(other_a))
    return math.sqrt(x * x + y * y)


@compiled(uncounted=True)
def median(past: Past, channel: int, count: int, column: int, near: float) -> float:
    """Return the median of a column over the `MIDDLE` readings up to number `count` - 1."""
    scratch = past.scratch
    for i in range(MIDDLE):
        value = past.value[channel, (count - 1 - i) % KEPT, column]
        if KIND[channel] == GEODETIC and column == 1:
            value -= 360.0 * np.round((value - near) / 360.0)
        _insert(scratch, i, value)
    return float(scratch[MIDDLE // 2])


@compiled(inline=True, uncounted=True)
def _insert(scratch: Float64, count: int, value: float) -> None:
    """Put a value among the first `count`, ascending."""
    at = count
    while at > 0 and scratch[at - 1] > value:
        scratch[at] = scratch[at - 1]
        at -= 1
    scratch[at] = value


@compiled(uncounted=True)
def repeats_kept(past: Past, channel: int, kept: int, newest: int) -> int:
    """Count repeats among the readings kept, without the `newest` ones."""
    number, repeats = past.accepted[channel] - newest, 0
    for i in range(kept - newest - 1):
        one, other = (number - 1 - i) % KEPT, (number - 2 - i) % KEPT
        repeats += past.value[channel, one, 0] == past.value[channel, other, 0] and (
            KIND[channel] < FIRST_TRACK
            or past.value[channel, one, 1] == past.value[channel, other, 1]
        )
    return repeats


@compiled(uncounted=True)
def _is_stuck(past: Past, channel: int) -> int:
    """Say whether repeats that go on are odd for this sensor; 1 or 0."""
    kept, run = min(past.accepted[channel], KEPT), STUCK + 1
    if kept - run < _WITNESSES:
        return 0
    return int(repeats_kept(past, channel, kept, run) <= REPEATS)


@compiled(uncounted=True)
def learn_gate(past: Past, channel: int) -> None:
    """
    Learn the gate, and the speed of a track, from the readings kept.
    """
    count = past.accepted[channel]
    kept = min(count, KEPT)
    if kept < MIDDLE:
        if KIND[channel] >= FIRST_TRACK:
            past.gate[channel], past.rate[channel] = _FIRST_M, ABSURD_SPEED_M_S
        return
    if KIND[channel] < FIRST_TRACK:
        _learn_speed(past, channel, count, kept)
    else:
        _learn_track(past, channel, count, kept)


@compiled(uncounted=True)
def _learn_speed(past: Past, channel: int, count: int, kept: int) -> None:
    scratch, value = past.scratch, past.value[channel]
    known = 0
    for i in range(kept):
        if value[(count - 1 - i) % KEPT, 0] != 0.0:
            _insert(scratch, known, abs(value[(count - 1 - i) % KEPT, 0]))
            known += 1
    # zeros are no readings where the others stay far from them
    drops = known >= MIDDLE and scratch[0] > _DEAD_M_S
    known, other = 0, np.nan
    for i in range(kept):
        one = value[(count - 1 - i) % KEPT, 0]
        if one == 0.0 and drops:
            continue
        if not np.isnan(other):
            _insert(scratch, known, abs(one - other))
            known += 1
        other = one
    sd, wider = scratch[known // 2] * MAD_TO_SD, scratch[3 * known // 4] / _OF_QUARTILE
    # the quartile too: more than half of the readings of a coarse log repeat; but where it is
    # far more, bad readings are in it
    sd = max(sd, min(wider, _BAD * sd) if sd > 0.0 else wider)
    near = abs(median(past, channel, count, 0, 0.0))
    past.gate[channel] = max(_FLOOR_M_S + _FLOOR_PART * near, SD * sd)


@compiled(uncounted=True)
def _learn_track(past: Past, channel: int, count: int, kept: int) -> None:
    scratch, value = past.scratch, past.value[channel]
    last, first = (count - 1) % KEPT, (count - kept) % KEPT
    near = value[last, 1]
    # the way from median to median: a single jump is in neither
    new_a, new_b = median(past, channel, count, 0, 0.0), median(past, channel, count, 1, near)
    old = count - kept + MIDDLE
    old_a, old_b = median(past, channel, old, 0, 0.0), median(past, channel, old, 1, near)
    time = (past.stamp_ns[channel, last] - past.stamp_ns[channel, first]) * 1e-9
    time *= (kept - MIDDLE) / (kept - 1.0)
    rate_a = (new_a - old_a) / time if time > 0.0 else 0.0
    rate_b = (new_b - old_b) / time if time > 0.0 else 0.0
    for i in range(kept - 1):
        one, other = (count - 1 - i) % KEPT, (count - 2 - i) % KEPT
        step = (past.stamp_ns[channel, one] - past.stamp_ns[channel, other]) * 1e-9
        _insert(
            scratch,
            i,
            apart(
                channel,
                value[one, 0] - rate_a * step,
                value[one, 1] - rate_b * step,
                value[other, 0],
                value[other, 1],
            ),
        )
    known = kept - 1
    past.rate[channel] = apart(channel, old_a + rate_a, old_b + rate_b, old_a, old_b)
    past.gate[channel] = max(_FLOOR_M, SD * scratch[known // 2] / _OF_PLANE)


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
