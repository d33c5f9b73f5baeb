# SPDX-License-Identifier: Apache-2.0
"""Where messages lie in a chunk: as plain Python finds them, whatever the bytes say."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.bags.message_index import CHANNELS, HEAD_BYTES, index_messages

MESSAGE, OTHER = 5, 6
ALL = np.ones(CHANNELS, np.uint8)
SHORTEST = 22  # bytes of a message without payload


def record(kind: int, content: bytes, length: int | None = None) -> bytes:
    stated = len(content) if length is None else length
    return struct.pack('<BQ', kind, stated % 2**64) + content


def message(channel: int, log_ns: int, payload: bytes = b'') -> bytes:
    head = struct.pack('<HIQQ', channel, 0, log_ns % 2**64, 0)
    return record(MESSAGE, head + payload)


def plainly(segment: bytes) -> tuple[list[tuple[int, int, bytes]], list[int], str]:
    """Messages (channel, log time, payload), places of other records, and the damage."""
    found, others, at = [], [], 0
    while at < len(segment):
        if at + HEAD_BYTES > len(segment):
            return found, others, 'cut off'
        kind, length = struct.unpack_from('<BQ', segment, at)
        content = segment[at + HEAD_BYTES : at + HEAD_BYTES + length]
        if kind == 0:
            return found, others, 'no record'
        if len(content) < length:
            return found, others, 'cut off'
        if kind == MESSAGE:
            if length < SHORTEST:
                return found, others, 'too short'
            channel, _, log_ns, _ = struct.unpack_from('<HIQQ', content)
            if log_ns >= 2**63:
                return found, others, 'no possible log time'
            found.append((channel, log_ns, content[SHORTEST:]))
        else:
            others.append(at)
        at += HEAD_BYTES + length
    return found, others, ''


def check(segments: list[bytes]) -> None:
    indexed = index_messages(segments, [100 * i for i in range(len(segments))], ALL)
    messages = indexed.messages
    expected, others, damage = [], [], []
    first = 0
    for i, segment in enumerate(segments):
        found, places, said = plainly(segment)
        expected += [(*one, 100 * i) for one in found]
        others += [first + place for place in places]
        damage += [said] if said else []
        first += len(segment)
    assert [
        (int(c), int(t), messages.payload(k), int(s))
        for k, (c, t, s) in enumerate(zip(messages.channel, messages.log_ns, messages.segment))
    ] == expected
    assert indexed.others.tolist() == others
    assert len(indexed.damage) == len(damage)
    for sentence, said in zip(indexed.damage, damage):
        assert said in sentence


RECORDS = st.one_of(
    st.builds(
        message, st.integers(0, CHANNELS - 1), st.integers(0, 2**64 - 1), st.binary(max_size=5)
    ),
    st.builds(record, st.sampled_from([0, OTHER, 255]), st.binary(max_size=4)),
    # a stated length that is wrong by little, or by much
    st.builds(
        lambda content, by: record(MESSAGE, content, len(content) + by),
        st.binary(min_size=SHORTEST - 2, max_size=SHORTEST + 2),
        st.sampled_from([-1, 1, 2**31, 2**62, 2**63 - SHORTEST, -(2**62)]),
    ),
)


@settings(max_examples=300, deadline=None)
@given(st.lists(st.lists(RECORDS, max_size=6).map(b''.join), min_size=1, max_size=3))
def test_any_records_are_found_as_plain_python_finds_them(segments: list[bytes]) -> None:
    check(segments)


def test_a_chunk_cut_at_each_of_its_bytes() -> None:
    whole = (
        message(7, 1, b'ab')
        + record(OTHER, b'xyz')
        + message(CHANNELS - 1, 2)
        + message(0, 3, b'c')
    )
    for length in range(len(whole) + 1):
        check([whole[:length], message(1, 9)])


@pytest.mark.parametrize('count', [1, 2, 100])
def test_the_shortest_records_fill_no_more_than_their_room(count: int) -> None:
    check([message(3, 5) * count])
    check([record(OTHER, b'') * count])
    check([record(OTHER, b'') * count, message(3, 5) * count])


def test_a_message_ends_where_its_record_ends() -> None:
    # the last byte of a payload is that of the buffer, and none of the next record
    check([message(1, 1, b'end')])
    check([message(1, 1, b'end'), b'\x05'])
    check([b'\x05' * HEAD_BYTES])


@pytest.mark.parametrize('log_ns', [0, 2**63 - 1, 2**63, 2**64 - 1])
def test_a_log_time_of_which_half_are_impossible(log_ns: int) -> None:
    check([message(1, log_ns)])


def test_only_the_channels_asked_for() -> None:
    wanted = np.zeros(CHANNELS, np.uint8)
    wanted[CHANNELS - 1] = 1
    indexed = index_messages([message(1, 1) + message(CHANNELS - 1, 2)], [0], wanted)
    assert indexed.messages.log_ns.tolist() == [2]
