# SPDX-License-Identifier: Apache-2.0
"""
Where the messages lie in unpacked chunks, found in compiled code.

Every length is checked; a segment is indexed up to its first damage.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.compiled import compiled
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

_U = np.uint64  # an unsigned index spares the test for a negative one
_COLUMNS: tuple[Any, ...] = (np.int64, np.int64, np.uint16, np.int64, np.int64)


@dataclass(slots=True)
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

    @property
    def columns(self) -> tuple[NDArray[Any], ...]:
        """All but the buffer."""
        return self.log_ns, self.segment, self.channel, self.start, self.end

    def __getitem__(self, part: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Messages:
        return Messages(self.data, *(column[part] for column in self.columns))

    def payload(self, number: int) -> bytes:
        """Return the bytes of one message."""
        return self.data[self.start[number] : self.end[number]].tobytes()

    def holding(self, payloads: Sequence[bytes | memoryview]) -> Messages:
        """Return the same with these payloads, in a buffer that holds nothing else."""
        bounds = _bounds(payloads)
        data = np.frombuffer(b''.join(payloads), np.uint8)
        return replace(self, data=data, start=bounds[:-1], end=bounds[1:])

    def packed(self) -> Messages:
        """Return the same in a buffer that holds nothing else."""
        data = self.data.data
        spans = zip(self.start.tolist(), self.end.tolist(), strict=True)
        return self.holding([data[start:end] for start, end in spans])

    def followed_by(self, other: Messages) -> Messages:
        """Return these and others in one buffer."""
        data = np.concatenate((self.data, other.data))
        both = zip(self.columns, other.columns, strict=True)
        joined = [np.concatenate(pair) for pair in both]
        for places in joined[-2:]:
            places[len(self) :] += len(self.data)
        return Messages(data, *joined)

    def in_arrival_order(self) -> Messages:
        """
        Sort by log time, then by place in the file.

        Those of one segment must be in the order of their places.
        """
        behind = self.log_ns[1:] < self.log_ns[:-1]
        if not behind.any() and (self.segment[1:] >= self.segment[:-1]).all():
            return self
        return self[np.lexsort((self.segment, self.log_ns))]


def _bounds(pieces: Sequence[bytes | memoryview]) -> Int64:
    """Return where pieces lie one behind the other."""
    return np.fromiter(accumulate(map(len, pieces), initial=0), np.int64)


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


def index_messages(segments: Sequence[bytes], offsets: Sequence[int], wanted: UInt8) -> Indexed:
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
    # of these only what is filled takes memory
    most = len(data) // (HEAD_BYTES + MESSAGE_HEAD_BYTES) + 1
    found = Messages(data, *(np.empty(most, kind) for kind in _COLUMNS))
    others = np.empty(len(data) // HEAD_BYTES + 1, np.int64)
    damage = np.empty((len(segments), 3), np.int64)
    # the eight bytes from each place on as a number
    words = np.ndarray((max(len(data) - 7, 0),), _WORD, data, 0, (1,))
    places, bounds = np.array(offsets, np.int64), _bounds(segments)
    n, m, damaged = _index(data, words, bounds, places, wanted, others, damage, *found.columns)
    notes = [
        f'{_DAMAGE[kind]} at byte {at} of the chunk at byte {offset}: '
        'only what lies before it is used'
        for kind, at, offset in damage[:damaged].tolist()
    ]
    return Indexed(found[:n], others[:m], notes)


_GIVEN = 'Array({}, 1, "C", readonly=True)'
OCTETS, PLACES = _GIVEN.format('u1'), _GIVEN.format('i8')
_WORD = np.dtype('<i8')
_WORDS = 'Array(i8, 1, "A", readonly=True, aligned=False)'


@compiled(
    f'UniTuple(i8, 3)({OCTETS}, {_WORDS}, {PLACES}, {PLACES}, {OCTETS}, '
    'i8[::1], i8[:, ::1], i8[::1], i8[::1], u2[::1], i8[::1], i8[::1])',
    uncounted=True,
)
def _index(
    data: UInt8,
    words: Int64,
    bounds: Int64,
    offsets: Int64,
    wanted: UInt8,
    others: Int64,
    damage: Int64,
    log_ns: Int64,
    segment: Int64,
    channel: NDArray[np.uint16],
    start: Int64,
    end: Int64,
) -> tuple[int, int, int]:
    n = m = damaged = 0
    for s in range(len(offsets)):
        at, limit = bounds[s], bounds[s + 1]
        while at < limit:
            content = at + HEAD_BYTES
            kind = _WHOLE
            length = np.int64(0)
            if content > limit:
                kind = _CUT_OFF
            else:
                length = words[_U(at + 1)]
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
                    time = words[_U(content + 6)]
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
                damage[damaged, 0] = kind
                damage[damaged, 1] = at - bounds[s]
                damage[damaged, 2] = offsets[s]
                damaged += 1
                break
            at = content + length
    return n, m, damaged
