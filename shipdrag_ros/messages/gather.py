# SPDX-License-Identifier: Apache-2.0
"""
The numbers wanted out of the CDR bytes of many messages, compiled.

One message or thousands, either byte order, strings of any length; bytes that
are no message of the type are named and never read beyond. Of JointState, whose
names decide what is wanted, see `joints`.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Any

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.messages import types
from shipdrag_ros.messages.types import ENCAPSULATION_BYTES, PADDING_BYTES
from shipdrag_ros.samples import SECOND_NS, Float64, Int64, UInt8

# steps through the bytes, each with two operands: of a section, which has a fixed size, its
# alignment and its size; of a number its place in the section and its column. A type without a
# header begins with the last one.
_SECTION, _FLOAT64, _FLOAT32, _UINT8, _INT8, _STRING, _UNSTAMPED = range(7)
_TAKEN = {'float64': _FLOAT64, 'float32': _FLOAT32, 'uint8': _UINT8, 'int8': _INT8}


def steps(type_name: str, fields: Sequence[str]) -> Int64:
    """
    Return the steps through a message, behind its header if it has one.

    Parameters
    ----------
    type_name
        A type; where it has a `std_msgs/Header`, it begins with it.
    fields
        What goes into which column, `pose.pose.position.x` or `twist.covariance[7]`
        for instance; '' for nothing.

    Returns
    -------
    (k, 3) int64
        A step and its operands a row.
    """
    column = {field: number for number, field in enumerate(fields) if field}
    listed: list[list[int]] = []
    if not types.is_stamped(type_name):
        listed.append([_UNSTAMPED, 0, 0])
    section: list[int] = []  # the row of the one that is open
    for leaf in types.leaves(type_name):
        if leaf.path.startswith('header.'):
            continue
        if leaf.length is None:
            raise ValueError(f'{type_name}: {leaf.path} is a sequence, which has no fixed place')
        if leaf.kind == 'string':
            section = []
            listed.append([_STRING, 0, 0])
            continue
        size = np.dtype(leaf.kind).itemsize
        if not section or size > section[1]:
            section = [_SECTION, size, 0]
            listed.append(section)
        first = -(-section[2] // size) * size
        section[2] = first + size * leaf.length
        for i in range(leaf.length):
            name = leaf.path if leaf.length == 1 else f'{leaf.path}[{i}]'
            if name in column:
                listed.append([_TAKEN[leaf.kind], first + size * i, column.pop(name)])
    if column:
        raise ValueError(f'{type_name} has no {", ".join(column)}')
    return np.array(listed, np.int64)


class GatherResult(IntEnum):
    """What became of a message."""

    READ = 0
    MALFORMED = 1
    NO_JOINT = 2
    NOTHING = 3  # not read yet, or of no source


_READ = int(GatherResult.READ)
_MALFORMED = int(GatherResult.MALFORMED)
COLUMNS = 4  # two values and two variances, which the extra fields follow
_VARIANCES = 2  # from this column on
BODY = ENCAPSULATION_BYTES
TIME_BYTES = 8
BAD = -1

# an unsigned index spares the test for a negative one, and the eight bytes become one load
_U = np.uint64


@compiled(inline=True, uncounted=True)
def word(data: Any, place: int, big: bool) -> Any:
    at = _U(place)
    if big:
        return (
            _U(data[at]) << _U(24)
            | _U(data[at + _U(1)]) << _U(16)
            | _U(data[at + _U(2)]) << _U(8)
            | _U(data[at + _U(3)])
        )
    return (
        _U(data[at])
        | _U(data[at + _U(1)]) << _U(8)
        | _U(data[at + _U(2)]) << _U(16)
        | _U(data[at + _U(3)]) << _U(24)
    )


@compiled(inline=True, uncounted=True)
def _as_float64(bits: Any) -> Any:
    return _U(bits).view(np.float64)


@compiled(inline=True, uncounted=True)
def _as_float32(bits: Any) -> Any:
    return np.uint32(bits).view(np.float32)


@compiled(inline=True, uncounted=True)
def float64(data: Any, place: int, big: bool) -> Any:
    first = word(data, place, big)
    second = word(data, place + 4, big)
    if big:
        return _as_float64(first << _U(32) | second)
    return _as_float64(second << _U(32) | first)


@compiled(inline=True, uncounted=True)
def _float32(data: Any, place: int, big: bool) -> Any:
    return np.float64(_as_float32(word(data, place, big)))


@compiled(uncounted=True)
def _is_utf8(data: Any, start: int, end: int) -> bool:
    """Say whether bytes are UTF-8, as Python decodes it."""
    at = start
    while at < end:
        lead = data[_U(at)]
        at += 1
        if lead < 0x80:
            continue
        if lead < 0xC2 or lead > 0xF4:
            return False
        more = 1 if lead < 0xE0 else 2 if lead < 0xF0 else 3
        if at + more > end:
            return False
        # neither longer than need be, nor a surrogate, nor above U+10FFFF
        low = 0xA0 if lead == 0xE0 else 0x90 if lead == 0xF0 else 0x80
        high = 0x9F if lead == 0xED else 0x8F if lead == 0xF4 else 0xBF
        for _ in range(more):
            byte = data[_U(at)]
            if byte < low or byte > high:
                return False
            low, high = 0x80, 0xBF
            at += 1
    return True


@compiled(inline=True, uncounted=True)
def aligned(at: int, size: int) -> int:
    return (at + size - 1) & -size


@compiled(uncounted=True)
def string_end(data: Any, body: int, at: int, size: int, big: bool) -> Any:
    """Return the end of the string at a place, `BAD` if there is none."""
    if at + 4 > size:
        return BAD
    length = int(np.int64(word(data, body + at, big)))
    end = at + 4 + length
    if length < 1 or end > size or data[_U(body + end - 1)] != 0:
        return BAD
    return end if _is_utf8(data, body + at + 4, body + end - 1) else BAD


@compiled(inline=True, uncounted=True)
def _is_cdr(data: Any, start: int, end: int, least: int) -> bool:
    """Say whether bytes begin as a message does, with so many behind it at least."""
    return end - start - BODY >= least and data[_U(start)] == 0 and data[_U(start + 1)] <= 1


@compiled(inline=True, uncounted=True)
def read_stamp(data: Any, start: int, end: int, i: Any, stamp_ns: Any) -> bool:
    """Read the stamp of a message; False if it is none."""
    body = start + BODY
    if not _is_cdr(data, start, end, TIME_BYTES):
        return False
    big = data[_U(start + 1)] == 0
    seconds = np.int64(np.int32(word(data, body, big)))
    stamp_ns[i] = seconds * SECOND_NS + np.int64(word(data, body + 4, big))
    return True


@compiled(uncounted=True)
def _read(
    data: Any, start: int, end: int, steps: Any, i: Any, stamp_ns: Any, rows: Any, layout: Any
) -> int:
    """Read a message step by step, and note in `layout` where its numbers were."""
    unstamped = steps[0, 0] == _UNSTAMPED
    if unstamped:
        if not _is_cdr(data, start, end, 0):
            return _MALFORMED
    elif not read_stamp(data, start, end, i, stamp_ns):
        return _MALFORMED
    body = start + BODY
    size = end - body
    big = data[_U(start + 1)] == 0
    at = 0 if unstamped else string_end(data, body, TIME_BYTES, size, big)
    if at == BAD:
        return _MALFORMED
    base = strings_end = at
    count = 0
    for k in range(1 if unstamped else 0, len(steps)):
        step, first, second = steps[k, 0], steps[k, 1], steps[k, 2]
        if step == _SECTION:
            base = aligned(at, first)
            at = base + second
            if at > size:
                return _MALFORMED
            base += body
        elif step == _STRING:
            at = strings_end = string_end(data, body, aligned(at, 4), size, big)
            if at == BAD:
                return _MALFORMED
        else:
            _take(data, step, base + first, big, i, second, rows)
            count += 1
            layout[count, 0], layout[count, 1] = step, base + first - start
            layout[count, 2] = second
    layout[0, 0], layout[0, 1] = count, BODY + strings_end
    return _MALFORMED if size - at > PADDING_BYTES else _READ


@compiled(inline=True, uncounted=True)
def _take(data: Any, step: int, at: int, big: bool, i: Any, column: int, rows: Any) -> None:
    """Read one number."""
    if step == _FLOAT64:
        rows[i, _U(column)] = float64(data, at, big)
    elif step == _FLOAT32:
        rows[i, _U(column)] = _float32(data, at, big)
    elif step == _UINT8:
        rows[i, _U(column)] = np.float64(data[_U(at)])
    else:
        rows[i, _U(column)] = np.float64(np.int8(data[_U(at)]))


@compiled(inline=True, uncounted=True)
def _is_alike(data: Any, one: int, other: int, first: int, end: int) -> bool:
    """Say whether two messages have the same bytes from `first` to `end`."""
    at = first
    while at + 8 <= end:
        if long_word(data, one + at) != long_word(data, other + at):
            return False
        at += 8
    if at < end and end - first >= 8:  # the last eight, of which some are compared again
        return bool(long_word(data, one + end - 8) == long_word(data, other + end - 8))
    while at < end:
        if data[_U(one + at)] != data[_U(other + at)]:
            return False
        at += 1
    return True


@compiled(inline=True, uncounted=True)
def long_word(data: Any, at: int) -> Any:
    return word(data, at + 4, False) << _U(32) | word(data, at, False)


_GIVEN = 'Array({}, 1, "C", readonly=True)'
OCTETS, PLACES = _GIVEN.format('u1'), _GIVEN.format('i8')


@compiled(
    f'i8({OCTETS}, {PLACES}, {PLACES}, {PLACES}, Array(i8, 2, "C", readonly=True), '
    'i8[::1], f8[:, ::1], u1[::1])'
)
def gather(
    data: UInt8,
    start: Int64,
    end: Int64,
    place: Int64,
    steps: Int64,
    stamp_ns: Int64,
    rows: Float64,
    found: UInt8,
) -> int:
    """
    Read the stamp and the wanted numbers of some messages.

    Parameters
    ----------
    data : (b,) uint8
        The bytes they lie in.
    start, end : (n,) int64
        Where each begins and ends.
    place : (m,) int64
        Which of them to read.
    steps : (k, 3) int64
        From `layout.steps`.
    stamp_ns : (n,) int64
        Filled with the stamps [ns]; left as it is by a type that holds none.
    rows : (n, c) float64
        Filled with the fields. The first four are two values and two variances: a
        value that the type lacks is 0, a variance that says nothing NaN.
    found : (n,) uint8
        Filled with a `GatherResult` each.

    Returns
    -------
    int
        How many could not be read.
    """
    unstamped = steps[0, 0] == _UNSTAMPED
    numbers = BODY if unstamped else BODY + TIME_BYTES  # what stands before them is read already
    layout = np.zeros((len(steps) + 1, 3), np.int64)
    before, size, order, big = -1, 0, _U(0), False
    unread = 0
    for k in range(len(place)):
        i = _U(place[k])
        rows[i, 0] = rows[i, 1] = 0.0
        for column in range(_VARIANCES, rows.shape[1]):
            rows[i, _U(column)] = np.nan
        at = int(start[i])
        # of the same size, byte order and strings as the one before: its numbers lie as those do
        if (
            before >= 0
            and end[i] - at == size
            and word(data, at, False) == order
            and _is_alike(data, at, before, numbers, layout[0, 1])
        ):
            found[i] = _READ
            if not unstamped:
                read_stamp(data, at, end[i], i, stamp_ns)
            for j in range(1, layout[0, 0] + 1):
                _take(data, layout[j, 0], at + layout[j, 1], big, i, layout[j, 2], rows)
        else:
            found[i] = _read(data, at, end[i], steps, i, stamp_ns, rows, layout)
            before = at if found[i] == _READ else -1
            unread += before < 0
            if before >= 0:
                size, order, big = int(end[i]) - at, word(data, at, False), data[_U(at + 1)] == 0
        for column in range(_VARIANCES, COLUMNS):
            if not 0.0 < rows[i, _U(column)] < np.inf:
                rows[i, _U(column)] = np.nan
    return unread
