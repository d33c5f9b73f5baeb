# SPDX-License-Identifier: Apache-2.0
"""
The latest messages as received, kept for a recording that starts later.

A replay of that recording then knows what the running node knew.
"""

from __future__ import annotations

import pickle
import zlib
from collections import deque
from collections.abc import Iterable, Iterator
from typing import NamedTuple

SEGMENT_BYTES = 64 * 1024  # packed at once: a millisecond or two
LIMIT_BYTES = 128 * 1024 * 1024


class RawMessage(NamedTuple):
    """
    A message as received.

    `type` is a ROS type name; `stamp_ns` is the arrival where the message was not understood.
    """

    input: str
    type: str
    data: bytes
    receive_ns: int
    stamp_ns: int


class _Segment(NamedTuple):
    newest_ns: int
    packed: bytes


class RawRing:
    """
    Messages in arrival order, bounded by time and by bytes.

    Parameters
    ----------
    keep_ns
        Age at which a message may be forgotten [ns].
    limit_bytes
        Memory for packed messages; the oldest go first.

    Attributes
    ----------
    cut
        Whether the limit of bytes, rather than age, took messages away.
    """

    def __init__(self, keep_ns: int, *, limit_bytes: int = LIMIT_BYTES) -> None:
        self._keep_ns = keep_ns
        self._limit_bytes = limit_bytes
        self._segments: deque[_Segment] = deque()
        self._open: list[RawMessage] = []
        self._open_bytes = 0
        self._packed_bytes = 0
        self.cut = False

    def add(self, message: RawMessage) -> None:
        """
        Take the newest message.
        """
        self._open.append(message)
        self._open_bytes += len(message.data)
        if self._open_bytes >= SEGMENT_BYTES:
            self._pack()
            self._forget(message.receive_ns)

    def clear(self) -> None:
        """
        Forget everything.
        """
        self._segments.clear()
        self._open.clear()
        self._open_bytes = self._packed_bytes = 0
        self.cut = False

    def __iter__(self) -> Iterator[RawMessage]:
        """Give the messages of this moment, whatever is added while they are read."""
        return _unpack(tuple(self._segments), tuple(self._open))

    def _pack(self) -> None:
        plain = [tuple(message) for message in self._open]
        packed = zlib.compress(pickle.dumps(plain, protocol=5), level=1)
        self._segments.append(_Segment(self._open[-1].receive_ns, packed))
        self._packed_bytes += len(packed)
        self._open.clear()
        self._open_bytes = 0

    def _forget(self, now_ns: int) -> None:
        while self._segments:
            too_many = self._packed_bytes > self._limit_bytes
            if not too_many and now_ns - self._segments[0].newest_ns <= self._keep_ns:
                return
            self.cut = self.cut or too_many
            self._packed_bytes -= len(self._segments.popleft().packed)


def _unpack(segments: Iterable[_Segment], behind: Iterable[RawMessage]) -> Iterator[RawMessage]:
    for segment in segments:
        yield from map(RawMessage._make, pickle.loads(zlib.decompress(segment.packed)))
    yield from behind
