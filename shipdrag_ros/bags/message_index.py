# SPDX-License-Identifier: Apache-2.0
"""
Where the messages lie in unpacked chunks, found in compiled code.

Every length is checked; a segment is indexed up to its first damage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.compiled import compiled
from shipdrag_ros.messages.gather import OCTETS, PLACES, long_word
from shipdrag_ros.samples import Int64, UInt8

CHANNELS = 1 << 16
EVERY_CHANNEL = np.ones(CHANNELS, np.uint8)
HEAD_BYTES = 9
MESSAGE_HEAD_BYTES = 22
_MESSAGE = 5
_WHOLE, _CUT_OFF, _NO_RECORD, _TOO_SHORT, _NO_TIME = range(5)
_DAMAGE = {
    _CUT_OFF: 'a record is cut off',
    _NO_RECORD: 'no record',
    _TOO_SHORT: 'a message is too short',
    _NO_TIME: 'a message has no possible log time',
}

# an unsigned index spares the test for a negative one, and the bytes become one load
_U = np.uint64


@dataclass(frozen=True)
class Messages:
    """
    Messages in one buffer.

    Attributes
    ----------
    data : (b,) uint8
        The buffer.
    log_ns : (n,) int64
        Time of arrival [ns since the epoch].
    segment : (n,) int64
        Where in the file their chunk lies [bytes].
    channel : (n,) uint16
        Number of their channel.
    start, end : (n,) int64
        Where each payload lies in the buffer.
    """

    data: UInt8
    log_ns: Int64
    segment: Int64
    channel: NDArray[np.uint16]
    start: Int64
    end: Int64

    def __len__(self) -> int:
        return len(self.log_ns)

    def __getitem__(self, part: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Messages:
        return Messages(
            self.data,
            self.log_ns[part],
            self.segment[part],
            self.channel[part],
            self.start[part],
            self.end[part],
        )

    def payload(self, number: int) -> bytes:
        """
        Return the bytes of one message.
        """
        return self.data[self.start[number] : self.end[number]].tobytes()

    def packed(self) -> Messages:
        """
        Return the same in a buffer that holds nothing else.
        """
        ends = np.cumsum(self.end - self.start)
        data = np.empty(int(ends[-1]) if len(self) else 0, np.uint8)
        _pack(self.data, self.start, self.end, data)
        starts = ends - (self.end - self.start)
        return Messages(data, self.log_ns, self.segment, self.channel, starts, ends)

    def followed_by(self, other: Messages) -> Messages:
        """
        Return these and others in one buffer.
        """
        joined = [
            np.concatenate((getattr(self, field.name), getattr(other, field.name)))
            for field in fields(self)
        ]
        start, end = joined[-2:]
        start[len(self) :] += len(self.data)
        end[len(self) :] += len(self.data)
        return Messages(*joined)

    def in_arrival_order(self) -> Messages:
        """
        Sort by log time, then by place in the file.

        Those of one segment must be in the order of their places.
        """
        behind = self.log_ns[1:] < self.log_ns[:-1]
        if not behind.any() and (self.segment[1:] >= self.segment[:-1]).all():
            return self
        return self[np.lexsort((self.segment, self.log_ns))]


class Indexed(NamedTuple):
    """
    What was found in some segments.

    Attributes
    ----------
    messages
        In the order of the segments, then of place.
    others : (m,) int64
        Offsets of records that are no messages, in the buffer.
    damage
        A sentence for each segment that is not whole.
    """

    messages: Messages
    others: Int64
    damage: list[str]


def index_messages(
    segments: Sequence[bytes],
    offsets: Sequence[int],
    wanted: UInt8,
) -> Indexed:
    """
    Find the messages in the records of some segments.

    Parameters
    ----------
    segments
        Unpacked records.
    offsets
        Where each segment lies in the file [bytes].
    wanted : (CHANNELS,) uint8
        Not 0 at the numbers of the channels to find.
    """
    data = np.frombuffer(segments[0] if len(segments) == 1 else b''.join(segments), np.uint8)
    bounds = np.cumsum([0, *map(len, segments)], dtype=np.int64)
    # of these only what is filled takes memory
    most = len(data) // (HEAD_BYTES + MESSAGE_HEAD_BYTES) + 1
    found = Messages(
        data,
        log_ns=np.empty(most, np.int64),
        segment=np.empty(most, np.int64),
        channel=np.empty(most, np.uint16),
        start=np.empty(most, np.int64),
        end=np.empty(most, np.int64),
    )
    others = np.empty(len(data) // HEAD_BYTES + 1, np.int64)
    damage = np.empty((len(segments), 2), np.int64)
    n, m = _index(
        data,
        bounds,
        np.array(offsets, np.int64),
        wanted,
        found.log_ns,
        found.segment,
        found.channel,
        found.start,
        found.end,
        others,
        damage,
    )
    notes = [
        f'{_DAMAGE[kind]} at byte {place} of the chunk at byte {offset}: '
        'only what lies before it is used'
        for (kind, place), offset in zip(damage.tolist(), offsets, strict=True)
        if kind != _WHOLE
    ]
    return Indexed(found[:n], others[:m], notes)


@compiled(
    f'UniTuple(i8, 2)({OCTETS}, {PLACES}, {PLACES}, {OCTETS}, '
    'i8[::1], i8[::1], u2[::1], i8[::1], i8[::1], i8[::1], i8[:, ::1])',
    uncounted=True,
)
def _index(
    data: UInt8,
    bounds: Int64,
    offsets: Int64,
    wanted: UInt8,
    log_ns: Int64,
    segment: Int64,
    channel: NDArray[np.uint16],
    start: Int64,
    end: Int64,
    others: Int64,
    damage: Int64,
) -> tuple[int, int]:
    n = 0
    m = 0
    for s in range(len(offsets)):
        at, limit = bounds[s], bounds[s + 1]
        damage[s, 0] = _WHOLE
        while at < limit:
            content = at + HEAD_BYTES
            kind = _WHOLE
            length = np.int64(0)
            if content > limit:
                kind = _CUT_OFF
            else:
                length = np.int64(long_word(data, at + 1))
                if data[_U(at)] == 0:
                    kind = _NO_RECORD
                elif length < 0 or length > limit - content:  # from 2^63 on it is negative
                    kind = _CUT_OFF
            if kind == _WHOLE and data[_U(at)] != _MESSAGE:
                others[m] = at
                m += 1
            elif kind == _WHOLE:
                if length < MESSAGE_HEAD_BYTES:
                    kind = _TOO_SHORT
                else:
                    number = data[_U(content)] | np.uint16(data[_U(content + 1)]) << 8
                    time = np.int64(long_word(data, content + 6))
                    if time < 0:
                        kind = _NO_TIME
                    elif wanted[number]:
                        log_ns[n] = time
                        segment[n] = offsets[s]
                        channel[n] = number
                        start[n] = content + MESSAGE_HEAD_BYTES
                        end[n] = content + length
                        n += 1
            if kind != _WHOLE:
                damage[s, 0] = kind
                damage[s, 1] = at - bounds[s]
                break
            at = content + length
    return n, m


@compiled(f'void({OCTETS}, {PLACES}, {PLACES}, u1[::1])', uncounted=True)
def _pack(data: UInt8, start: Int64, end: Int64, packed: UInt8) -> None:
    at = 0
    for i in range(len(start)):
        for place in range(start[i], end[i]):
            packed[at] = data[_U(place)]
            at += 1
