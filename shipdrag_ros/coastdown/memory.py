# SPDX-License-Identifier: Apache-2.0
"""
All that a monitor remembers, in arrays that compiled code writes to.

One tuple, so that a reset is a new one; apart from the walk, so that what only
reads it need not compile the walk.

The latest samples stand in constant memory and in one piece: those accepted and, marked, those
that may turn out to be true, so that they keep their place. Appending is compiled code's business;
here room is made and windows are taken. The buffer is up to twice as long as what is kept, so
that samples move rarely and a window is a view, not a copy.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.coastdown.bins import Bins
from shipdrag_ros.coastdown.events import InputCounts
from shipdrag_ros.coastdown.past import CHANNELS, NEVER
from shipdrag_ros.coastdown.steadiness import Slopes, Steadiness
from shipdrag_ros.coastdown.validate import CheckMemory, Limits
from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import FURTHER, INPUTS, Block, Channel, Float64, Int64, Reason, UInt8

CAPACITY = 1 << 21  # samples kept at most, 100 MB: 5400 s of 390 samples a second
FIRST_CAPACITY = 1 << 12
REFUSED = 128  # added to the channel of a sample that was refused


class RingBuffer(NamedTuple):
    """
    The buffer; `end[0]` is where the next sample goes.

    The other attributes are those of a `Block`.
    """

    channel: UInt8
    stamp_ns: Int64
    receive_ns: Int64
    value: Float64
    variance: Float64
    end: Int64

    @classmethod
    def fresh(cls, capacity: int) -> RingBuffer:
        """
        Return an empty buffer.
        """
        return cls(
            np.empty(capacity, np.uint8),
            np.empty(capacity, np.int64),
            np.empty(capacity, np.int64),
            np.empty((capacity, 2)),
            np.empty((capacity, 2)),
            np.zeros(1, np.int64),
        )


@compiled(uncounted=True)
def append(
    store: RingBuffer,
    channel: UInt8,
    stamp_ns: Int64,
    receive_ns: Int64,
    value: Float64,
    variance: Float64,
    first: int,
    last: int,
) -> None:
    """
    Keep the samples first .. last - 1 of a block; there must be room.
    """
    end, count = store.end[0], last - first
    # one array after the other: each is then one move of memory
    for i in range(count):
        store.channel[end + i] = channel[first + i]
    for i in range(count):
        store.stamp_ns[end + i] = stamp_ns[first + i]
    for i in range(count):
        store.receive_ns[end + i] = receive_ns[first + i]
    for i in range(count):
        store.value[end + i, 0] = value[first + i, 0]
        store.value[end + i, 1] = value[first + i, 1]
    for i in range(count):
        store.variance[end + i, 0] = variance[first + i, 0]
        store.variance[end + i, 1] = variance[first + i, 1]
    store.end[0] = end + count


def make_room(store: RingBuffer, *, keep_ns: int, late_ns: int, capacity: int) -> RingBuffer:
    """
    Drop what is older than `keep_ns`, or grow; return the store to go on with.

    Parameters
    ----------
    keep_ns
        Age before the newest stamp up to which samples are kept [ns].
    late_ns
        How far a stamp may be behind one before it [ns].
    capacity
        Number of samples that are kept at most, whatever their age.
    """
    end = int(store.end[0])
    sound = store.stamp_ns[:end][store.channel[:end] < REFUSED]
    newest = int(sound.max()) if len(sound) else 0
    begin = max(_before(store, newest - keep_ns, late_ns), end - capacity)
    room = len(store.stamp_ns)
    grown = store
    if 2 * (end - begin) > room:
        grown = RingBuffer.fresh(min(2 * room, 2 * capacity))
    for name in RingBuffer._fields[:-1]:
        getattr(grown, name)[: end - begin] = getattr(store, name)[begin:end]
    grown.end[0] = end - begin
    return grown


def since(store: RingBuffer, start_ns: int, *, late_ns: int, capacity: int) -> Block:
    """
    Return the samples accepted from `start_ns` on, without copying them where none was refused.

    A few older ones may come first; the window leaves them out by their stamps.
    """
    end = int(store.end[0])
    begin = max(_before(store, start_ns, late_ns), end - capacity)
    block = Block(
        store.channel[begin:end],
        store.stamp_ns[begin:end],
        store.receive_ns[begin:end],
        store.value[begin:end],
        store.variance[begin:end],
    )
    sound = block.channel < REFUSED
    return block if sound.all() else block[sound]


def _before(store: RingBuffer, stamp_ns: int, late_ns: int) -> int:
    """Return an index before which all stamps are older than `stamp_ns`."""
    # The stamps are sorted but for late_ns. A bisection for stamp_ns - late_ns drops what is
    # in front of a stamp older than that, and all in front of it is older than stamp_ns. One that
    # was refused and is ahead of all only keeps more.
    end = int(store.end[0])
    return int(np.searchsorted(store.stamp_ns[:end], stamp_ns - late_ns))


ALWAYS = 2**62  # a stamp after all stamps
WATCH = np.dtype(
    [
        ('source', 'i8'),  # that the regimes follow; NEVER while they sleep
        ('update_ns', 'i8'),  # when the next estimate is due; ALWAYS if none is
        ('armed', 'i8'),  # 0 after the regimes were awake until the speed has been steady again
        ('seen_source', 'i8'),  # speed source looked at last
        ('seen', 'i8'),  # and number of its bin
        ('level', 'f8'),  # speed there [m/s]
        ('steady_since', 'i8'),  # bin; NEVER if she is not
        ('steady_most', 'i8'),  # the longest that she was [bins]
        ('silent_ns', 'i8'),  # when the source watched was found silent last; NEVER if it was not
        ('look', 'i8'),  # bin at whose first sample log and track are compared next
        ('doubted', 'i8', (CHANNELS,)),  # up to which each source is not used: another contradicts
    ],
    align=True,
)
"""What the walk looks out for, and what it saw."""


def fresh_watch() -> NDArray[np.void]:
    """
    Return the watch of a monitor that knows nothing.
    """
    watch = np.zeros(1, np.dtype((np.record, WATCH)))
    made = watch[0]
    made.source = made.seen_source = made.seen = made.steady_since = made.look = NEVER
    made.silent_ns = NEVER
    made.doubted[:] = NEVER
    made.update_ns, made.armed, made.level = ALWAYS, 1, np.nan
    return watch


class InputTally(NamedTuple):
    """
    What became of the samples; a reset of the clock spares it.

    Attributes
    ----------
    reasons : (channels, reasons) int64
        Samples by `Reason`.
    clock_ns : (channels,) int64
        Stamp less arrival of the last accepted sample.
    """

    reasons: Int64
    clock_ns: Int64

    @classmethod
    def fresh(cls) -> InputTally:
        """
        Return the counts before the first sample.
        """
        return cls(np.zeros((CHANNELS, len(Reason)), np.int64), np.zeros(CHANNELS, np.int64))

    def counts(self) -> dict[str, InputCounts]:
        """
        Return what became of the samples of every input; of further instruments, of those heard.
        """
        found = {}
        for name in INPUTS:
            channels = [channel for channel in Channel if channel.input == name]
            times = self.reasons[channels].sum(axis=0).tolist()
            if any(times) or name not in FURTHER:
                why = {r.name.lower(): n for r, n in zip(Reason, times, strict=True) if n}
                used = why.pop(Reason.ACCEPTED.name.lower(), 0)
                found[name] = InputCounts(sum(times), used, why)
        return found


class Memory(NamedTuple):
    """All that a monitor remembers, besides a coastdown that runs."""

    guard: CheckMemory
    bins: Bins
    steadiness: Steadiness
    watch: NDArray[np.void]
    tally: InputTally
    store: RingBuffer

    @classmethod
    def fresh(cls, slopes: Slopes, *, seconds: int, tally: InputTally) -> Memory:
        """
        Return the memory before the first sample, with bins for the last `seconds`.
        """
        return cls(
            CheckMemory.fresh(),
            Bins.fresh(seconds),
            Steadiness.fresh(slopes),
            fresh_watch(),
            tally,
            RingBuffer.fresh(FIRST_CAPACITY),
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
    speed_min
        Speed below which nothing starts [m/s].
    """

    limits: Limits
    slopes: Slopes
    data_stop_ns: int
    speed_min: float
