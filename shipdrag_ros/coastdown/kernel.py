# SPDX-License-Identifier: Apache-2.0
"""
The walk through the samples, compiled.

It accepts or rejects each sample, keeps and averages it, and looks each
second for what wakes the regimes. It returns where Python must act, always
BEFORE the sample in question is taken, and is then called again from that
sample on: how the record is cut into blocks cannot matter.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from shipdrag_ros.coastdown.bins import (
    KINDS,
    PITCH_LEAST,
    RANK,
    SOURCES,
    Bins,
    add,
    close,
    line,
    mean_turning,
)
from shipdrag_ros.coastdown.memory import REFUSED, InputTally, Memory, Tuning, append
from shipdrag_ros.coastdown.past import NEVER
from shipdrag_ros.coastdown.steadiness import SCALES, Slopes, Steadiness, update_limits
from shipdrag_ros.coastdown.validate import (
    ARRIVAL_JUMPED_BACK,
    CHANNEL_CODES,
    STAMP_JUMPED_BACK,
    STAMPS,
    VALUES,
    Limits,
    alive_ns,
    examine,
    proves,
    reading_of,
    reject,
    remember,
    true_since,
)
from shipdrag_ros.compiled import compiled
from shipdrag_ros.estimation.run_down import STANDS_RAD_S
from shipdrag_ros.samples import KIND, SECOND_NS, Channel, Float64, Int64, Reason, UInt8

_SLOWED = 0.85  # of the steady shaft speed or pitch: worth a look at the speed


class WalkEvent(IntEnum):
    """Why the walk stopped."""

    ARRIVAL_JUMPED_BACK = ARRIVAL_JUMPED_BACK
    STAMP_JUMPED_BACK = STAMP_JUMPED_BACK
    END = 0  # of the block
    FULL = 1  # the ring needs room
    UPDATE = 2  # an estimate is due
    SILENCE = 3  # the speed source has stopped
    BIN = 4  # a bin of the watched source has closed
    SLOPE = 5  # the speed falls faster than chance explains
    SHAFT = 6  # a shaft has slowed down, or its pitch was taken back
    LOOK = 7  # log and track are to be compared


@compiled(inline=True, uncounted=True)
def _is_primary(bins: Bins, watch: np.record, tuning: Tuning, source: int, number: int) -> bool:
    """Say whether no better source that is not doubted has delivered within data_stop_s."""
    oldest = number - tuning.data_stop_ns // SECOND_NS
    doubted, primary = watch.doubted[source] > number, True
    for other in SOURCES:
        better = (
            RANK[other] < RANK[source] if (watch.doubted[other] > number) == doubted else doubted
        )
        primary = primary and not (better and bins.filling[other] >= oldest)
    return bool(primary)


@compiled(inline=True, uncounted=True)
def _wakes(
    bins: Bins, steadiness: Steadiness, watch: np.record, tuning: Tuning, source: int, number: int
) -> bool:
    """Say whether a source beside the primary one falls faster than chance explains."""
    update_limits(steadiness, tuning.slopes, bins, source, number)
    falls = False
    for scale in range(SCALES):
        slope, level, _ = line(bins, source, number, tuning.slopes.width << scale)
        falls = falls or (slope < -steadiness.limit[source, scale] and level > tuning.speed_min)
    return falls and watch.armed != 0 and watch.doubted[source] <= number


@compiled(inline=True, uncounted=True)
def _look_at_speed(
    bins: Bins, steadiness: Steadiness, watch: np.record, tuning: Tuning, source: int, number: int
) -> int:
    """Judge a closed bin of a speed source; return a `WalkEvent` code, 0 to go on."""
    watched = watch.source
    if watched == NEVER:
        if not _is_primary(bins, watch, tuning, source, number):
            wakes = _wakes(bins, steadiness, watch, tuning, source, number)
            return WalkEvent.SLOPE if wakes else 0
    elif watched != source:
        # should the one watched fail
        update_limits(steadiness, tuning.slopes, bins, source, number)
        return 0
    update_limits(steadiness, tuning.slopes, bins, source, number)
    before = watch.seen if watch.seen_source == source else NEVER
    watch.seen_source = source
    watch.seen = number
    limits = steadiness.limit[source]
    steady, falls = True, False
    for scale in range(SCALES):
        # a longer window changes more slowly: one look in two seconds, one in four; a sensor
        # may read at odd seconds only
        if number >> scale == before >> scale:
            continue
        slope, level, _ = line(bins, source, number, tuning.slopes.width << scale)
        if scale == 0:
            watch.level = level
        # comparisons with NaN are False: neither an unknown limit nor a slope of too few bins
        # says anything
        falls = falls or slope < -limits[scale]
        if slope < -0.5 * limits[scale]:
            steady = False
    if steady and number >> (SCALES - 1) != before >> (SCALES - 1):  # all were looked at
        watch.armed = 1
    fast = watch.level > tuning.speed_min
    falls = falls and watch.armed != 0 and fast
    if watched != NEVER or falls or not fast or watch.armed == 0:
        watch.steady_since = NEVER
    else:
        if watch.steady_since == NEVER:
            watch.steady_since = number
        watch.steady_most = max(watch.steady_most, number - watch.steady_since)
    if watched != NEVER:
        return WalkEvent.BIN
    return WalkEvent.SLOPE if falls else 0


@compiled(inline=True, uncounted=True)
def _look_at_shaft(bins: Bins, watch: np.record, tuning: Tuning, channel: int, number: int) -> int:
    """Judge a closed bin of a shaft speed or a pitch; return a `WalkEvent` code, 0 to go on."""
    if (
        watch.source != NEVER
        or watch.armed == 0
        or watch.seen < number - tuning.data_stop_ns // SECOND_NS
        or not watch.level > tuning.speed_min
    ):
        return 0
    # half a window ago, so that a shaft that runs down slowly is not its own measure
    width = tuning.slopes.width
    steady, count = mean_turning(bins, channel, number - (width + 1) // 2, width)
    least = PITCH_LEAST if KIND[channel] == Channel.PITCH else STANDS_RAD_S
    if count < 3 or abs(steady) < least:
        return 0
    if mean_turning(bins, channel, number, 1)[0] / steady < _SLOWED:
        return WalkEvent.SHAFT
    return 0


@compiled(inline=True, uncounted=True)
def _count(tally: InputTally, channel: int, stamp: int, arrival: int) -> None:
    """Count an accepted sample."""
    tally.clock_ns[channel] = stamp - arrival
    tally.reasons[channel, Reason.ACCEPTED] += 1


@compiled(uncounted=True)
def _accept_refused(memory: Memory, width: int, channel: int) -> None:
    """Accept the samples of the store that were refused, and are true."""
    guard, bins, tally, store = memory.guard, memory.bins, memory.tally, memory.store
    first = true_since(guard, channel)
    end = begin = store.end[0]
    while begin > 0 and not (
        store.channel[begin - 1] == channel
        or (store.channel[begin - 1] == channel + REFUSED and store.stamp_ns[begin - 1] < first)
    ):
        begin -= 1
    for i in range(begin, end):
        reading = reading_of(store.stamp_ns, store.value, store.variance, i)
        stamp = reading.stamp
        if store.channel[i] == channel + REFUSED and stamp > guard.last_ns[channel]:
            store.channel[i] = channel
            number = stamp // SECOND_NS
            if bins.samples[channel] > 0 and number > bins.filling[channel]:
                close(bins, channel, width)
            add(bins, channel, number, stamp, reading.a, reading.b)
            remember(guard, channel, reading)
            tally.reasons[channel, Reason.OUTLIER] -= 1
            _count(tally, channel, stamp, store.receive_ns[i])


_SLOPES = Slopes(1, 1, 1, 1, np.zeros((SCALES, 1)), 0.0)  # its types are all that counts


@compiled(
    f'UniTuple(i8, 2)'
    f'(Memory, Tuning, {CHANNEL_CODES}, {STAMPS}, {STAMPS}, {VALUES}, {VALUES}, i8)',
    like={
        'Memory': Memory.fresh(_SLOPES, seconds=1, tally=InputTally.fresh()),
        'Tuning': Tuning(Limits(0, 0, 1.0), _SLOPES, 0, 0.0),
    },
    uncounted=True,
)
def walk(
    memory: Memory,
    tuning: Tuning,
    channel: UInt8,
    stamp_ns: Int64,
    receive_ns: Int64,
    value: Float64,
    variance: Float64,
    start: int,
) -> tuple[int, int]:
    """
    Take samples from `start` on until Python must act.

    Returns
    -------
    sample, stop
        The first sample not taken, and the `WalkEvent` code.
    """
    guard, bins, steadiness, _, tally, store = memory
    watch = memory.watch[0]
    i, stop = start, 0
    # accepted samples go into the ring a run at a time, from the first one not yet there
    kept, room = start, len(store.stamp_ns) - store.end[0]
    while i < len(channel):
        c, stamp, arrival = int(channel[i]), stamp_ns[i], receive_ns[i]
        reading = reading_of(stamp_ns, value, variance, i)
        code = examine(guard, tuning.limits, c, arrival, reading)
        if code < 0:
            stop = code
            break
        if i - kept == room:
            stop = WalkEvent.FULL
            break
        if code == Reason.ACCEPTED:
            if proves(guard, tuning.limits, c, reading):
                _accept_refused(memory, tuning.slopes.width, c)
                continue
            if stamp > watch.update_ns:
                stop = WalkEvent.UPDATE
                break
            if (
                watch.source != NEVER
                and stamp
                > max(alive_ns(guard, tuning.limits, watch.source), watch.silent_ns)
                + tuning.data_stop_ns
            ):
                stop = WalkEvent.SILENCE
                break
            number = stamp // SECOND_NS
            if number >= watch.look:
                stop = WalkEvent.LOOK
                break
            if bins.samples[c] > 0 and number > bins.filling[c]:
                closed = close(bins, c, tuning.slopes.width)
                if KIND[c] < KINDS:
                    stop = _look_at_speed(bins, steadiness, watch, tuning, c, closed)
                elif KIND[c] == Channel.SHAFT or KIND[c] == Channel.PITCH:
                    stop = _look_at_shaft(bins, watch, tuning, c, closed)
                if stop != 0:
                    break
            add(bins, c, number, stamp, reading.a, reading.b)
            remember(guard, c, reading)
            _count(tally, c, stamp, arrival)
        else:
            reject(guard, tuning.limits, code, c, reading)
            last = i + (code == Reason.OUTLIER)
            append(store, channel, stamp_ns, receive_ns, value, variance, kept, last)
            if code == Reason.OUTLIER:  # it may turn out to be true
                store.channel[store.end[0] - 1] += REFUSED
            room -= last - kept
            kept = i + 1
            tally.reasons[c, code] += 1
        guard.arrival_ns[0] = arrival
        i += 1
    append(store, channel, stamp_ns, receive_ns, value, variance, kept, i)
    return i, stop
