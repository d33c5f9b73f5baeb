# SPDX-License-Identifier: Apache-2.0
"""
The walk through the samples, compiled.

It accepts or rejects each sample, keeps and averages it, and looks for the
candidate of an onset each second. It returns where Python must act, always
BEFORE the sample in question is taken, and is then called again from that
sample on: how the record is cut into blocks cannot matter.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple, cast

import numpy as np
from numba import njit, typeof, types

from shipdrag_ros.coastdown.bins import (
    BINNED,
    SOURCES,
    Bins,
    line,
    mean_turning,
    newest_bin,
)
from shipdrag_ros.coastdown.filling import add, close
from shipdrag_ros.coastdown.ring import Store, append, first_store
from shipdrag_ros.coastdown.steadiness import (
    SCALES,
    Slopes,
    Steadiness,
    learn,
)
from shipdrag_ros.coastdown.validate import (
    ARRIVAL_JUMPED_BACK,
    CHANNEL_CODES,
    CHANNELS,
    NEVER,
    SECOND_NS,
    STAMP_JUMPED_BACK,
    STAMPS,
    VALUES,
    Guard,
    Limits,
    examine,
    remember,
)
from shipdrag_ros.compiled import INLINED, UNCOUNTED, digest
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Channel, Float64, Int64, Reason, UInt8

ALWAYS = 2**62  # a stamp after all stamps
RECENT = 16  # samples of each channel that its rate and clock offset are taken from
# A shaft that turns slower than this (5 rpm) drives no ship: whether it stops says nothing.
SHAFT_TURNING_RAD_S = 0.5

_SHAFT = int(Channel.SHAFT)
_ACCEPTED = int(Reason.ACCEPTED)


class Stop(IntEnum):
    """Why the walk stopped."""

    ARRIVAL_JUMPED_BACK = ARRIVAL_JUMPED_BACK
    STAMP_JUMPED_BACK = STAMP_JUMPED_BACK
    END = 0  # of the block
    FULL = 1  # the ring needs room
    UPDATE = 2  # an estimate is due
    SILENCE = 3  # the speed source has stopped
    BIN = 4  # a bin of the watched source has closed
    SLOPE = 5  # the speed falls faster than chance explains
    SHAFT = 6  # the shaft has slowed down


_FULL = int(Stop.FULL)
_UPDATE = int(Stop.UPDATE)
_SILENCE = int(Stop.SILENCE)
_BIN = int(Stop.BIN)
_SLOPE = int(Stop.SLOPE)
_SHAFT_SLOWED = int(Stop.SHAFT)


class Watch(NamedTuple):
    """
    What the walk looks out for, and what it saw; arrays of one but for `held`.

    Attributes
    ----------
    source : int64
        The speed source of a candidate or coastdown; NEVER while there is none.
    update_ns : int64
        When the next estimate is due; ALWAYS if none is.
    armed : int64
        0 after a candidate or coastdown until the speed has been steady again.
    held : (SCALES,) float64
        The limits of that candidate: it is part of the record that later limits are learnt
        from, and would make a fall that goes on look steady [m/s^2].
    seen_source, seen : int64
        Speed source and number of the bin looked at last.
    level : float64
        Speed there [m/s].
    shaft : float64
        Steady rate of turn before the shaft slowed down [rad/s].
    """

    source: Int64
    update_ns: Int64
    armed: Int64
    held: Float64
    seen_source: Int64
    seen: Int64
    level: Float64
    shaft: Float64

    @classmethod
    def fresh(cls) -> Watch:
        """
        Return the watch of a monitor that knows nothing.
        """
        return cls(
            np.full(1, NEVER),
            np.full(1, ALWAYS),
            np.ones(1, np.int64),
            np.full(SCALES, np.nan),
            np.full(1, NEVER),
            np.full(1, NEVER),
            np.full(1, np.nan),
            np.full(1, np.nan),
        )


class Tally(NamedTuple):
    """
    What the health of the inputs is told from; a reset of the clock spares it.

    Attributes
    ----------
    reasons : (channels, reasons) int64
        Samples by `Reason`.
    stamp_ns, arrival_ns : (channels, RECENT) int64
        Of the last accepted samples.
    """

    reasons: Int64
    stamp_ns: Int64
    arrival_ns: Int64

    @classmethod
    def fresh(cls) -> Tally:
        """
        Return the counts before the first sample.
        """
        return cls(
            np.zeros((CHANNELS, len(Reason)), np.int64),
            np.full((CHANNELS, RECENT), NEVER),
            np.full((CHANNELS, RECENT), NEVER),
        )


class Memory(NamedTuple):
    """All that a monitor remembers, besides a coastdown that runs."""

    guard: Guard
    bins: Bins
    steadiness: Steadiness
    watch: Watch
    tally: Tally
    store: Store

    @classmethod
    def fresh(cls, slopes: Slopes, *, seconds: int, tally: Tally) -> Memory:
        """
        Return the memory before the first sample, with bins for the last `seconds`.
        """
        return cls(
            Guard.fresh(),
            Bins.fresh(seconds),
            Steadiness.fresh(slopes),
            Watch.fresh(),
            tally,
            first_store(),
        )


class Tuning(NamedTuple):
    """
    What the walk needs of ship and parameters.

    Attributes
    ----------
    limits, slopes
        Of the tests and of the slopes.
    data_stop_ns
        Silence that stops a source [ns].
    shaft_stopped
        Fraction of the steady shaft speed.
    speed_min
        Speed below which nothing starts [m/s].
    """

    limits: Limits
    slopes: Slopes
    data_stop_ns: int
    shaft_stopped: float
    speed_min: float


@njit(**INLINED)
def _is_primary(bins: Bins, tuning: Tuning, source: int, number: int) -> bool:
    """Say whether no better source has delivered within data_stop_s."""
    oldest = number - tuning.data_stop_ns // SECOND_NS
    best = source
    for better in range(source):
        if newest_bin(bins, better) >= oldest:
            best = min(best, better)
    return best == source


@njit(**UNCOUNTED)
def _shaft_tells(bins: Bins, tuning: Tuning, number: int) -> bool:
    """Say whether a stop of the engine would show in the shaft speed."""
    last = newest_bin(bins, _SHAFT)
    if last < number - tuning.data_stop_ns // SECOND_NS:
        return False
    turning, count = mean_turning(bins, _SHAFT, last, tuning.slopes.width)
    return bool(count > 0 and turning >= SHAFT_TURNING_RAD_S)


@njit(**INLINED)
def _look_at_speed(
    bins: Bins, steadiness: Steadiness, watch: Watch, tuning: Tuning, source: int, number: int
) -> int:
    """Judge a closed bin of a speed source."""
    if watch.source[0] != NEVER:
        if watch.source[0] != source:
            return 0
        learn(steadiness, tuning.slopes, bins, source, number)
        return _BIN
    if not _is_primary(bins, tuning, source, number):
        return 0
    learn(steadiness, tuning.slopes, bins, source, number)
    watch.seen_source[0] = source
    watch.seen[0] = number
    limits = steadiness.limit[source]
    steady, falls = True, False
    for scale in range(SCALES):
        # a longer window changes more slowly: one look in two, one in four
        if number % (1 << scale) != 0:
            continue
        slope, level, _ = line(bins, source, number, tuning.slopes.width << scale)
        if scale == 0:
            watch.level[0] = level
        # a limit that was not known then is NaN and does not count
        falling = slope < -0.5 * limits[scale] or slope < -0.5 * watch.held[scale]
        steady = steady and not falling
        falls = falls or slope < -limits[scale]
    if steady and number % (1 << (SCALES - 1)) == 0:
        watch.armed[0] = 1
    if (
        falls
        and watch.armed[0]
        and watch.level[0] > tuning.speed_min
        and not _shaft_tells(bins, tuning, number)
    ):
        return _SLOPE
    return 0


@njit(**INLINED)
def _look_at_shaft(bins: Bins, watch: Watch, tuning: Tuning, number: int) -> int:
    """Judge a closed bin of the shaft speed."""
    if (
        watch.source[0] != NEVER
        or watch.seen[0] < number - tuning.data_stop_ns // SECOND_NS
        or not watch.level[0] > tuning.speed_min
    ):
        return 0
    # half a window ago, so that a shaft that runs down slowly is not its own measure
    width = tuning.slopes.width
    steady, count = mean_turning(bins, _SHAFT, number - (width + 1) // 2, width)
    if count < 3 or steady < SHAFT_TURNING_RAD_S:
        return 0
    if mean_turning(bins, _SHAFT, number, 1)[0] < tuning.shaft_stopped * steady:
        watch.shaft[0] = steady
        return _SHAFT_SLOWED
    return 0


@njit(**UNCOUNTED)
def _walk(
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
        The first sample not taken, and the `Stop` code.
    """
    guard, bins, steadiness, watch, tally, store = memory
    i, stop = start, 0
    # accepted samples go into the ring a run at a time, from the first one not yet there
    kept, room = start, len(store.stamp_ns) - store.end[0]
    while i < len(channel):
        c, stamp, arrival = int(channel[i]), stamp_ns[i], receive_ns[i]
        a, b = value[i, 0], value[i, 1]
        code = examine(guard, tuning.limits, c, stamp, arrival, a, b)
        if code < 0:
            stop = code
            break
        if code == _ACCEPTED:
            if i - kept == room:
                stop = _FULL
                break
            if stamp > watch.update_ns[0]:
                stop = _UPDATE
                break
            if (
                watch.source[0] != NEVER
                and stamp > guard.last_ns[watch.source[0]] + tuning.data_stop_ns
            ):
                stop = _SILENCE
                break
            if c < BINNED:
                number = stamp // SECOND_NS
                if bins.samples[c] > 0 and number > bins.filling[c]:
                    closed = close(bins, c, tuning.slopes.width)
                    if c < SOURCES:
                        stop = _look_at_speed(bins, steadiness, watch, tuning, c, closed)
                    elif c == _SHAFT:
                        stop = _look_at_shaft(bins, watch, tuning, closed)
                    if stop != 0:
                        break
                add(bins, c, number, stamp, a, b)
            remember(guard, c, stamp, a, b)
            recent = tally.reasons[c, _ACCEPTED] % RECENT
            tally.stamp_ns[c, recent] = stamp
            tally.arrival_ns[c, recent] = arrival
        else:
            append(store, channel, stamp_ns, receive_ns, value, variance, kept, i)
            room -= i - kept
            kept = i + 1
        tally.reasons[c, code] += 1
        guard.arrival_ns[0] = arrival
        i += 1
    append(store, channel, stamp_ns, receive_ns, value, variance, kept, i)
    return i, stop


_SLOPES = Slopes.of(Parameters())
_SIGNATURE = types.UniTuple(types.int64, 2)(
    typeof(Memory.fresh(_SLOPES, seconds=1, tally=Tally.fresh())),
    typeof(Tuning(Limits(0, 0), _SLOPES, 0, 0.0, 0.0)),
    CHANNEL_CODES,
    STAMPS,
    STAMPS,
    VALUES,
    VALUES,
    types.int64,
)


def _compile(sources: str) -> Callable[..., tuple[int, int]]:
    @njit(_SIGNATURE, **UNCOUNTED, cache=True)
    def compiled(memory, tuning, channel, stamp_ns, receive_ns, value, variance, start):  # type: ignore[no-untyped-def]
        _ = sources  # part of the key of the cache
        return _walk(memory, tuning, channel, stamp_ns, receive_ns, value, variance, start)

    return cast(Callable[..., tuple[int, int]], compiled)


_SOURCES = ('validate', 'bins', 'filling', 'ring', 'steadiness', 'kernel')

# compiled on import, so that no coastdown waits for it
walk = _compile(digest('samples.py', *(f'coastdown/{name}.py' for name in _SOURCES)))
