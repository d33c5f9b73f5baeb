# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.coastdown.ring import Store, append, make_room, since
from shipdrag_ros.samples import Channel

LATE_NS = 5


def fill(stamps, *, capacity: int, keep_ns: int, first: int = 4) -> tuple[Store, int]:
    """Append one sample a stamp; return the store and the longest it ever was."""
    store = Store.fresh(first)
    longest = first
    for i, stamp in enumerate(stamps):
        if store.end[0] == len(store.stamp_ns):
            store = make_room(store, keep_ns=keep_ns, late_ns=LATE_NS, capacity=capacity)
            longest = max(longest, len(store.stamp_ns))
        append(store, i % 9, stamp, stamp + 1, float(i), -float(i), 0.5, np.nan)
    return store, longest


@settings(max_examples=60, deadline=None)
@given(
    delays=st.lists(st.integers(0, LATE_NS), min_size=1, max_size=200),
    start=st.integers(0, 200),
    capacity=st.integers(4, 40),
)
def test_what_is_kept_is_what_came(delays, start: int, capacity: int) -> None:
    stamps = [i - delay for i, delay in enumerate(delays)]
    keep_ns = 50
    store, _ = fill(stamps, capacity=capacity, keep_ns=keep_ns)
    start_ns = max(start, max(stamps) - keep_ns)
    kept = since(store, start_ns, late_ns=LATE_NS, capacity=capacity)
    wanted = [i for i in range(len(stamps)) if stamps[i] >= start_ns][-capacity:]
    there = kept[kept.stamp_ns >= start_ns]
    # at most `capacity` samples reach back from the newest one, wanted or not
    wanted = [i for i in wanted if i >= len(stamps) - capacity]
    assert there.value[:, 0].tolist() == [float(i) for i in wanted]
    assert there.stamp_ns.tolist() == [stamps[i] for i in wanted]
    assert there.receive_ns.tolist() == [stamps[i] + 1 for i in wanted]
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
