# SPDX-License-Identifier: Apache-2.0
"""
Which samples may be used, and why not.

One rule for every way in, walked sample by sample so that the way a record is
cut cannot matter. Stamps decide; the time of arrival only separates a stamp from
the future and a clock that was set.

The tests, in this order; the first that fails names the reason:

1. arrival more than 10 s before the arrival of the sample before: clock set
2. stamp more than 2 s after its arrival: `FUTURE`
3. stamp more than 10 s before the last accepted one of the channel: `LATE`; clock set where
   `SET_BACK` of the channel in a row are, and ascend
4. equal to it: `DUPLICATE`; before it: `OUT_OF_ORDER`
5. more than `late_s` before the newest accepted stamp of any input: `LATE`
6. value: `NAN`, `INFINITE`, `ABSURD`, `FROZEN`, `OUTLIER`

`FROZEN` is a reading of the motion that repeats for longer than `frozen_s`, or half a
dozen times where the sensor did not repeat before; `OUTLIER` one that those before it
make impossible (`outliers`), unless those after it show that it was true: then it is
accepted after all.

A stamp comes before its value because a clock that was set is a fact whatever
the value says. After a clock was set everything is forgotten and the same
sample is tested again, as the first one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.past import (
    CHANNELS,
    NEVER,
    JudgedReading,
    Past,
    fits,
    proves_refused,
    quickness,
    refuse,
    repeats_refused,
    take,
)
from shipdrag_ros.compiled import compiled
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import (
    ABSURD_POSITION_M,
    ABSURD_SPEED_M_S,
    BACKWARD_JUMP_NS,
    FUTURE_NS,
    KIND,
    SECOND_NS,
    SET_BACK,
    Block,
    Channel,
    Float64,
    Int64,
    Reason,
    UInt8,
)

# not reasons of a sample: the clock was set, everything starts afresh
STAMP_JUMPED_BACK = -1
ARRIVAL_JUMPED_BACK = -2

# The motion of a ship at sea never repeats to the last bit; a stopped shaft, a rudder
# amidships, a steady depth and a course held by a coarse compass do, and rightly.
_MOTION = Channel.POSITION_GEODETIC  # this kind and those before it
_TWO_COLUMNS = np.array(
    [
        channel.kind in (Channel.POSITION, Channel.POSITION_GEODETIC, Channel.WIND_APPARENT)
        for channel in Channel
    ]
)

# Declared, so that a read-only array does not compile the kernels a second time; those that
# own their memory pass as well.
# an argument that is only read
STAMPS = 'Array(i8, 1, "C", readonly=True)'
CHANNEL_CODES = 'Array(u1, 1, "C", readonly=True)'
VALUES = 'Array(f8, 2, "A", readonly=True)'  # columns of a table, for instance


class CheckMemory(NamedTuple):
    """
    What the tests remember.

    Attributes
    ----------
    last_ns : (channels,) int64
        Stamp of the last accepted sample of each channel [ns].
    newest_ns : (1,) int64
        Newest accepted stamp of any channel [ns].
    arrival_ns : (1,) int64
        Arrival of the sample before, used or not [ns].
    back_ns, back : (channels,) int64
        Stamp of the last sample that was far behind, and how many were in a row [ns].
    held : (channels, 2)
        Value of the last accepted sample.
    held_since_ns : (channels,) int64
        Stamp since which it has not changed [ns].
    past
        What an outlier is known by.
    """

    last_ns: Int64
    newest_ns: Int64
    arrival_ns: Int64
    back_ns: Int64
    back: Int64
    held: Float64
    held_since_ns: Int64
    past: Past

    @classmethod
    def fresh(cls) -> CheckMemory:
        """
        Return the memory before the first sample.
        """
        return cls(
            np.full(CHANNELS, NEVER),
            np.full(1, NEVER),
            np.full(1, NEVER),
            np.full(CHANNELS, NEVER),
            np.zeros(CHANNELS, np.int64),
            np.full((CHANNELS, 2), np.nan),
            np.full(CHANNELS, NEVER),
            Past.fresh(),
        )


class Limits(NamedTuple):
    """`Parameters.frozen_s` and `late_s` in nanoseconds, and how quick she is [m/s^2]."""

    frozen_ns: int
    late_ns: int
    quick: float

    @classmethod
    def of(cls, parameters: Parameters, length_m: float) -> Limits:
        """
        Take the limits from the parameters and the length of the ship [m].
        """
        return cls(
            round(parameters.frozen_s * SECOND_NS),
            round(parameters.late_s * SECOND_NS),
            quickness(length_m),
        )


@compiled(inline=True, uncounted=True)
def reading_of(stamp_ns: Int64, value: Float64, variance: Float64, i: int) -> JudgedReading:
    """
    Return the reading that a sample is.
    """
    return JudgedReading(stamp_ns[i], value[i, 0], value[i, 1], variance[i, 0], variance[i, 1])


@compiled(inline=True, uncounted=True)
def examine(
    guard: CheckMemory,
    limits: Limits,
    channel: int,
    arrival: int,
    reading: JudgedReading,
) -> int:
    """
    Return the `Reason` of one sample, or that a clock was set.

    Changes nothing: `remember` and `reject` do, once it is decided.
    """
    stamp, a, b = reading.stamp, reading.a, reading.b
    if arrival < guard.arrival_ns[0] - BACKWARD_JUMP_NS:
        return ARRIVAL_JUMPED_BACK
    if stamp > arrival + FUTURE_NS:
        return Reason.FUTURE
    last = guard.last_ns[channel]
    if stamp <= last:
        if stamp < last - BACKWARD_JUMP_NS:
            agree = guard.back[channel] >= SET_BACK - 1 and stamp > guard.back_ns[channel]
            return STAMP_JUMPED_BACK if agree else Reason.LATE
        if stamp == last:
            return Reason.DUPLICATE
        return Reason.OUT_OF_ORDER
    if stamp < guard.newest_ns[0] - limits.late_ns:
        return Reason.LATE
    two = _TWO_COLUMNS[channel]
    if np.isnan(a) or (two and np.isnan(b)):
        return Reason.NAN
    if np.isinf(a) or (two and np.isinf(b)):
        return Reason.INFINITE
    if KIND[channel] <= Channel.SPEED_OVER_GROUND and abs(a) > ABSURD_SPEED_M_S:
        return Reason.ABSURD
    if KIND[channel] > _MOTION:
        return Reason.ACCEPTED
    if KIND[channel] == Channel.POSITION_GEODETIC and (abs(a) > 90.0 or abs(b) > 360.0):
        return Reason.ABSURD
    if KIND[channel] == Channel.POSITION and max(abs(a), abs(b)) > ABSURD_POSITION_M:
        return Reason.ABSURD
    stuck = guard.past.stuck[channel] != 0
    if (
        a == guard.held[channel, 0]
        and (not two or b == guard.held[channel, 1])
        and (stuck or stamp - guard.held_since_ns[channel] > limits.frozen_ns)
    ):
        return Reason.FROZEN
    if fits(guard.past, limits.quick, channel, reading):
        return Reason.ACCEPTED
    if repeats_refused(guard.past, channel, reading, limits.frozen_ns):
        return Reason.FROZEN
    return Reason.OUTLIER


@compiled(inline=True, uncounted=True)
def proves(guard: CheckMemory, limits: Limits, channel: int, reading: JudgedReading) -> bool:
    """
    Say whether an accepted sample shows that those refused before it were true.
    """
    return bool(
        guard.past.refused_count[channel] > 0
        and proves_refused(guard.past, limits.quick, channel, reading)
    )


@compiled(inline=True, uncounted=True)
def true_since(guard: CheckMemory, channel: int) -> int:
    """
    Let the refused samples wait no longer, and return the stamp of the first [ns].

    Those of it and since, `OUTLIER` so far, are then to be remembered in their order.
    """
    guard.past.refused_count[channel] = 0
    guard.past.refused_new[channel] = 0
    return int(guard.past.refused_ns[channel, 0])


@compiled(inline=True, uncounted=True)
def remember(guard: CheckMemory, channel: int, reading: JudgedReading) -> None:
    """
    Take an accepted sample into the memory of the tests.
    """
    stamp, a, b = reading.stamp, reading.a, reading.b
    if KIND[channel] <= _MOTION:
        take(guard.past, channel, reading)
    guard.back[channel] = 0
    guard.last_ns[channel] = stamp
    guard.newest_ns[0] = max(guard.newest_ns[0], stamp)
    same = a == guard.held[channel, 0] and (
        not _TWO_COLUMNS[channel] or b == guard.held[channel, 1]
    )
    if not same:
        guard.held[channel, 0] = a
        guard.held[channel, 1] = b
        guard.held_since_ns[channel] = stamp


@compiled(inline=True, uncounted=True)
def reject(
    guard: CheckMemory, limits: Limits, code: int, channel: int, reading: JudgedReading
) -> None:
    """
    Take a sample that was rejected into the memory of the tests.
    """
    stamp = reading.stamp
    if code == Reason.LATE and stamp < guard.last_ns[channel] - BACKWARD_JUMP_NS:
        ascends = stamp > guard.back_ns[channel]
        guard.back[channel] = guard.back[channel] + 1 if ascends else 1
        guard.back_ns[channel] = stamp
    if code >= Reason.FROZEN:
        refuse(guard.past, limits.quick, channel, reading)


@compiled(inline=True, uncounted=True)
def alive_ns(guard: CheckMemory, limits: Limits, channel: int) -> int:
    """
    Return the stamp up to which a channel of the motion has been delivering [ns].

    A sensor that sticks or drops out is not silent: it may be back in a while, but
    `frozen_s` of nothing else is as good as silence.
    """
    last = guard.last_ns[channel]
    return int(max(last, min(guard.past.heard_ns[channel], last + limits.frozen_ns)))


def validate(block: Block, parameters: Parameters, length_m: float) -> UInt8:
    """
    Return the `Reason` of every sample of a whole record.

    Parameters
    ----------
    block : n samples
        The record from its beginning, in arrival order.
    parameters
        `late_s` and `frozen_s` are used.
    length_m
        Of the ship [m]: a small craft is quick.

    Returns
    -------
    (n,) uint8
        `Reason.ACCEPTED` where a sample may be used.

    Notes
    -----
    Where a clock was set the tests start afresh, as in `Monitor`.
    """
    reasons = np.empty(len(block), np.uint8)
    limits, at = Limits.of(parameters, length_m), 0
    channel = np.ascontiguousarray(block.channel)
    stamp_ns = np.ascontiguousarray(block.stamp_ns)
    receive_ns = np.ascontiguousarray(block.receive_ns)
    value, variance = block.value, block.variance
    while at < len(block):
        fresh = CheckMemory.fresh()
        at = _walk(fresh, limits, channel, stamp_ns, receive_ns, value, variance, reasons, at)
    return reasons


@compiled(
    f'i8(Memory, Limits, {CHANNEL_CODES}, {STAMPS}, {STAMPS}, {VALUES}, {VALUES}, u1[::1], i8)',
    like={'Memory': CheckMemory.fresh(), 'Limits': Limits(0, 0, 1.0)},
    uncounted=True,
)
def _walk(
    guard: CheckMemory,
    limits: Limits,
    channel: UInt8,
    stamp_ns: Int64,
    receive_ns: Int64,
    value: Float64,
    variance: Float64,
    reasons: UInt8,
    start: int,
) -> int:
    """Judge samples from `start` on until a clock was set; return the first one not judged."""
    for i in range(start, len(channel)):
        c, arrival = int(channel[i]), receive_ns[i]
        reading = reading_of(stamp_ns, value, variance, i)
        code = examine(guard, limits, c, arrival, reading)
        if code < 0:
            return i
        if code == Reason.ACCEPTED and proves(guard, limits, c, reading):
            _accept_refused(guard, c, i, channel, stamp_ns, value, variance, reasons)
            code = examine(guard, limits, c, arrival, reading)
        if code == Reason.ACCEPTED:
            remember(guard, c, reading)
        else:
            reject(guard, limits, code, c, reading)
        guard.arrival_ns[0] = arrival
        reasons[i] = code
    return len(channel)


@compiled(uncounted=True)
def _accept_refused(
    guard: CheckMemory,
    channel: int,
    end: int,
    channels: UInt8,
    stamp_ns: Int64,
    value: Float64,
    variance: Float64,
    reasons: UInt8,
) -> None:
    """Accept the samples before `end` that were refused, and are true."""
    first = true_since(guard, channel)
    begin = end
    while begin > 0 and not (
        channels[begin - 1] == channel
        and (
            reasons[begin - 1] == Reason.ACCEPTED
            or (reasons[begin - 1] == Reason.OUTLIER and stamp_ns[begin - 1] < first)
        )
    ):
        begin -= 1
    for i in range(begin, end):
        if (
            channels[i] == channel
            and reasons[i] == Reason.OUTLIER
            and stamp_ns[i] > guard.last_ns[channel]
        ):
            remember(guard, channel, reading_of(stamp_ns, value, variance, i))
            reasons[i] = Reason.ACCEPTED


def clock_set(memory: CheckMemory, code: int, channel: int, stamp_ns: int, receive_ns: int) -> str:
    """
    Say which clock went back before a sample, and by how much.

    Parameters
    ----------
    memory
        What was before the sample.
    code
        `STAMP_JUMPED_BACK` or `ARRIVAL_JUMPED_BACK`.
    channel, stamp_ns, receive_ns
        The sample.
    """
    if code == STAMP_JUMPED_BACK:
        back = int(memory.last_ns[channel]) - stamp_ns
        return f'{Channel(channel).input}: the stamp went back by {back * 1e-9:.3f} s'
    back = int(memory.arrival_ns[0]) - receive_ns
    return f'the time of arrival went back by {back * 1e-9:.3f} s'
