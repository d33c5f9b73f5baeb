# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.coastdown.memory import RingBuffer, append, make_room, since
from shipdrag_ros.samples import Block, Channel

LATE_NS = 5


def block_of(stamps) -> Block:
    stamps = np.asarray(list(stamps), np.int64)
    i = np.arange(len(stamps))
    value = np.column_stack([i, -i]).astype(float)
    variance = np.column_stack([np.full(len(i), 0.5), np.full(len(i), np.nan)])
    return Block((i % 9).astype(np.uint8), stamps, stamps + 1, value, variance)


def fill(
    stamps, *, capacity: int, keep_ns: int, first: int = 4, run: int = 1
) -> tuple[RingBuffer, int]:
    """Append samples in runs; return the store and the longest it ever was."""
    block = block_of(stamps)
    store = RingBuffer.fresh(first)
    longest, at = first, 0
    while at < len(block):
        room = len(store.stamp_ns) - int(store.end[0])
        if room == 0:
            store = make_room(store, keep_ns=keep_ns, late_ns=LATE_NS, capacity=capacity)
            longest = max(longest, len(store.stamp_ns))
            continue
        end = min(at + min(run, room), len(block))
        append(
            store,
            block.channel,
            block.stamp_ns,
            block.receive_ns,
            block.value,
            block.variance,
            at,
            end,
        )
        at = end
    return store, longest


@settings(max_examples=60, deadline=None)
@given(
    delays=st.lists(st.integers(0, LATE_NS), min_size=1, max_size=200),
    start=st.integers(0, 200),
    capacity=st.integers(4, 40),
    run=st.integers(1, 50),
)
def test_what_is_kept_is_what_came(delays, start: int, capacity: int, run: int) -> None:
    stamps = [i - delay for i, delay in enumerate(delays)]
    keep_ns = 50
    store, _ = fill(stamps, capacity=capacity, keep_ns=keep_ns, run=run)
    start_ns = max(start, max(stamps) - keep_ns)
    kept = since(store, start_ns, late_ns=LATE_NS, capacity=capacity)
    wanted = [i for i in range(len(stamps)) if stamps[i] >= start_ns][-capacity:]
    there = kept[kept.stamp_ns >= start_ns]
    # at most `capacity` samples reach back from the newest one, wanted or not
    wanted = [i for i in wanted if i >= len(stamps) - capacity]
    assert there.value[:, 0].tolist() == [float(i) for i in wanted]
    assert there.stamp_ns.tolist() == [stamps[i] for i in wanted]
    assert there.receive_ns.tolist() == [stamps[i] + 1 for i in wanted]
    np.testing.assert_array_equal(there.variance, np.tile([0.5, np.nan], (len(wanted), 1)))
    assert there.channel.tolist() == [Channel(i % 9) for i in wanted]


def test_memory_is_bounded_by_age() -> None:
    _, longest = fill(range(10_000), capacity=1 << 20, keep_ns=100)
    assert longest <= 512


def test_memory_is_bounded_by_count() -> None:
    store, longest = fill(range(10_000), capacity=64, keep_ns=10**9)
    assert longest == 128
    assert len(since(store, 0, late_ns=LATE_NS, capacity=64)) == 64


def test_a_window_is_not_copied() -> None:
    store, _ = fill(range(100), capacity=1 << 10, keep_ns=1000)
    assert np.shares_memory(since(store, 50, late_ns=0, capacity=1 << 10).value, store.value)
