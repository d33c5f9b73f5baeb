# SPDX-License-Identifier: Apache-2.0
"""
The latest samples, in constant memory and in one piece.

They are those accepted and, marked, those that may turn out to be true: they keep their place.

Appending is compiled code's business; here room is made and windows are taken.
The buffer is up to twice as long as what is kept, so that samples move rarely
and a window is a view, not a copy.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import Block, Float64, Int64, UInt8

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
