# SPDX-License-Identifier: Apache-2.0
"""Messages kept for a recording that starts later."""

from __future__ import annotations

from shipdrag_ros.messages import EncodedMessage
from shipdrag_ros.node.recorder import SEGMENT_BYTES, RawRing

SECOND_NS = 10**9


def message(second: int, *, size: int = 100) -> EncodedMessage:
    return EncodedMessage(
        'depth', 'sensor_msgs/msg/Range', bytes(size), second * SECOND_NS, second
    )


def fill(ring: RawRing, count: int, *, size: int = 100) -> None:
    for second in range(count):
        ring.add(message(second, size=size))


def test_gives_back_what_it_took_in_order() -> None:
    ring = RawRing(10**6 * SECOND_NS)
    fill(ring, 2000)
    assert list(ring) == [message(second) for second in range(2000)]


def test_forgets_by_age_but_not_too_early() -> None:
    ring = RawRing(1000 * SECOND_NS)
    fill(ring, 10_000)
    seconds = [item.publish_ns for item in ring]
    segment = SEGMENT_BYTES // 100 + 1
    assert seconds[-1] == 9999
    assert 1000 <= len(seconds) <= 1000 + 2 * segment
    assert not ring.cut


def test_forgets_by_bytes_and_says_so() -> None:
    ring = RawRing(10**9 * SECOND_NS, limit_bytes=10_000)
    fill(ring, 50_000, size=1000)
    kept = [item.publish_ns for item in ring]
    assert kept == list(range(kept[0], 50_000))
    assert kept[0] > 0
    assert ring.cut


def test_forgets_all() -> None:
    ring = RawRing(SECOND_NS)
    fill(ring, 2000)
    ring.clear()
    assert list(ring) == []
