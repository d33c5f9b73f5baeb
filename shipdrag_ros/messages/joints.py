# SPDX-License-Identifier: Apache-2.0
"""
Shafts, pitches and rudder out of the CDR bytes of JointState messages, compiled.

Which joint is which channel: see `joint_names`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.compiled import compiled
from shipdrag_ros.messages.gather import (
    BAD,
    BODY,
    COLUMNS,
    TIME_BYTES,
    GatherResult,
    aligned,
    float64,
    read_stamp,
    string_end,
    word,
)
from shipdrag_ros.messages.types import PADDING_BYTES
from shipdrag_ros.samples import PITCHES, SHAFTS, Channel, Float64, Int64, UInt8

PLACES = len(SHAFTS)
"""Slots of the shafts; those of the pitches follow, and `RUDDER`."""
RUDDER = len(SHAFTS) + len(PITCHES)
FREE = -1
BEYOND = -2
NOT_OURS = -3


def _name(text: bytes) -> UInt8:
    return np.frombuffer(text, np.uint8)


_SHAFT_NAME, _PITCH_NAME, _RUDDER_NAME = _name(b'shaft'), _name(b'pitch'), _name(b'rudder')
_PORT, _STARBOARD, _STBD = _name(b'port'), _name(b'starboard'), _name(b'stbd')
_CENTRE, _CENTER = _name(b'centre'), _name(b'center')
_LOWER = np.uint8(0x20)  # added to a capital; of other bytes, none becomes a letter by it


@compiled
def _begins(data: Any, start: int, end: int, name: Any) -> Any:
    """Say whether bytes begin with a name in small letters, capitals or not."""
    if end - start < len(name):
        return False
    same = True
    for i in range(len(name)):
        same &= data[_U(start + i)] | _LOWER == name[i]
    return same


@compiled
def _is_letter(byte: Any) -> Any:
    return 97 <= byte | _LOWER <= 122


@compiled
def _is_side(data: Any, start: int, end: int, name: Any) -> bool:
    if not _begins(data, start, end, name):
        return False
    after = start + len(name)
    return after == end or not _is_letter(data[_U(after)])


@compiled
def _place_of(data: Any, start: int, end: int) -> int:
    """Return the place, from 0, that the rest of a name says; `FREE` or `BEYOND`."""
    digits = end
    while digits > start and 48 <= data[_U(digits - 1)] <= 57:
        digits -= 1
    if digits < end:
        number = 0
        for i in range(digits, end):
            number = min(10 * number + data[_U(i)] - 48, PLACES + 1)
        if number > PLACES:
            return BEYOND
        return number - 1 if number else PLACES - 1
    while start < end and not _is_letter(data[_U(start)]):
        start += 1
    if start == end or _is_side(data, start, end, _PORT):
        return 0
    if _is_side(data, start, end, _STARBOARD) or _is_side(data, start, end, _STBD):
        return 1
    if _is_side(data, start, end, _CENTRE) or _is_side(data, start, end, _CENTER):
        return 2
    return FREE


@compiled
def slot_of(data: Any, start: int, end: int, rudder: bool) -> tuple[int, int]:
    """
    Return the first slot of a joint's kind, and its place among them.

    The place is one from 0, `FREE` for the first that is free, or `BEYOND`; the slot
    of another joint is `NOT_OURS`.
    """
    if rudder:
        if end - start == len(_RUDDER_NAME) and _begins(data, start, end, _RUDDER_NAME):
            return RUDDER, 0
    elif _begins(data, start, end, _SHAFT_NAME):
        return 0, _place_of(data, start + len(_SHAFT_NAME), end)
    elif _begins(data, start, end, _PITCH_NAME):
        return PLACES, _place_of(data, start + len(_PITCH_NAME), end)
    return NOT_OURS, 0


_CODES = np.array([*SHAFTS, *PITCHES, Channel.RUDDER], np.uint8)
_READ = int(GatherResult.READ)
_MALFORMED = int(GatherResult.MALFORMED)
_NO_JOINT = int(GatherResult.NO_JOINT)
_PADDING = PADDING_BYTES
_ARRAYS = 3  # position, velocity, effort
# what is found in one message: the joint of each slot; the shafts and the pitches that take a free
# place; length of each array, and where it begins
_WAITING = len(_CODES)
_LENGTH = _WAITING + 2 * PLACES
_FIRST = _LENGTH + _ARRAYS
_SCRATCH = _FIRST + _ARRAYS
_SHORTEST_STRING = 5  # its length, and its zero

_U = np.uint64


class Joints(NamedTuple):
    """
    What messages hold beyond their first joint.

    Attributes
    ----------
    message : (k,) intp
        Which message each further sample is from; samples of one are in the order of
        their channels.
    code : (k,) uint8
        Their `Channel`.
    value : (k,) float64
        Rate of turn [rad/s], or pitch.
    surplus
        Joints without a place.
    """

    message: NDArray[np.intp]
    code: UInt8
    value: Float64
    surplus: int


class MessageRows(NamedTuple):
    """
    What is read of n messages, to be filled.

    Attributes
    ----------
    code : (n,) uint8
        Channels; of the first joint where there are several.
    stamp_ns : (n,) int64
        Stamps [ns].
    value : (n, c) float64
        As `gather` fills them.
    found : (n,) uint8
        A `GatherResult` each.
    """

    code: UInt8
    stamp_ns: Int64
    value: Float64
    found: UInt8


def read_joints(
    data: UInt8,
    start: Int64,
    end: Int64,
    place: NDArray[np.intp],
    channel: Channel,
    rows: MessageRows,
) -> Joints:
    """
    Read the joints of some messages.

    Parameters
    ----------
    data : (b,) uint8
        The bytes they lie in.
    start, end : (n,) int64
        Where each begins and ends.
    place : (m,) intp
        Which of them to read.
    channel
        `SHAFT` for shafts and pitches, or `RUDDER`.
    rows
        Filled with the first joint of each.

    Returns
    -------
    Joints
        What there is besides the first joints.
    """
    rudder = channel is Channel.RUDDER
    room = 0 if rudder else (2 * PLACES - 1) * len(place)
    more = Joints(np.empty(room, np.intp), np.empty(room, np.uint8), np.empty(room), 0)
    scratch = np.empty(_SCRATCH, np.int64)
    count, surplus = _read_all(
        data,
        start,
        end,
        place,
        rudder,
        rows.stamp_ns,
        rows.code,
        rows.value,
        rows.found,
        scratch,
        *more[:3],
    )
    return Joints(more.message[:count], more.code[:count], more.value[:count], surplus)


@compiled(inline=True, uncounted=True)
def _give_places(scratch: Any, kind: int, waits: int, slots: int) -> tuple[int, int]:
    """Give free places to the joints of a kind; return the slots taken, and what is left."""
    given = 0
    for slot in range(kind * PLACES, (kind + 1) * PLACES):
        if not slots >> slot & 1 and given < min(waits, PLACES):
            scratch[_U(slot)] = scratch[_U(_WAITING + kind * PLACES + given)]
            slots |= 1 << slot
            given += 1
    return slots, waits - given


@compiled(inline=True, uncounted=True)
def _read_names(
    data: Any, body: int, at: int, size: int, big: bool, rudder: bool, scratch: Any
) -> tuple[int, int, int]:
    """
    Find the joint of each slot.

    Returns the end of the names, `BAD` if they are none; the slots that have a joint,
    one bit each; and how many joints have no place.
    """
    at = aligned(at, 4)
    if at + 4 > size:
        return BAD, 0, 0
    count: Any = np.int64(word(data, body + at, big))
    at += 4
    if at + count * _SHORTEST_STRING > size:
        return BAD, 0, 0
    slots = shafts = pitches = surplus = 0
    for each in range(count):
        at = aligned(at, 4)
        first = body + at + 4
        at = string_end(data, body, at, size, big)
        if at == BAD:
            return BAD, 0, 0
        kind, place = slot_of(data, first, body + at - 1, rudder)
        if kind == NOT_OURS:
            continue
        if place == BEYOND:
            surplus += 1
        elif place != FREE and not slots >> (kind + place) & 1:
            scratch[_U(kind + place)] = each
            slots |= 1 << (kind + place)
        elif kind == 0:
            scratch[_U(_WAITING + min(shafts, PLACES - 1))] = each
            shafts += 1
        elif kind == PLACES:
            scratch[_U(_WAITING + PLACES + min(pitches, PLACES - 1))] = each
            pitches += 1
    for kind, waits in ((0, shafts), (1, pitches)):
        if waits:
            slots, left = _give_places(scratch, kind, waits, slots)
            surplus += left
    return at, slots, surplus


@compiled(inline=True, uncounted=True)
def _read_arrays(data: Any, body: int, at: int, size: int, big: bool, scratch: Any) -> bool:
    """Find position, velocity and effort; False if they do not fill the message."""
    for k in range(_ARRAYS):
        at = aligned(at, 4)
        if at + 4 > size:
            return False
        count: Any = np.int64(word(data, body + at, big))
        at += 4
        if count > 0:
            at = aligned(at, 8)
        scratch[_U(_LENGTH + k)] = count
        scratch[_U(_FIRST + k)] = body + at
        at += 8 * count
        if at > size:
            return False
    return size - at <= _PADDING


_GIVEN = 'Array({}, 1, "C", readonly=True)'
_OCTETS, _PLACES = _GIVEN.format('u1'), _GIVEN.format('i8')


@compiled(
    f'UniTuple(i8, 2)({_OCTETS}, {_PLACES}, {_PLACES}, {_PLACES}, b1, '
    'i8[::1], u1[::1], f8[:, ::1], u1[::1], i8[::1], i8[::1], u1[::1], f8[::1])',
    uncounted=True,
)
def _read_all(
    data: UInt8,
    start: Int64,
    end: Int64,
    place: Int64,
    rudder: bool,
    stamp_ns: Int64,
    code: UInt8,
    rows: Float64,
    found: UInt8,
    scratch: Int64,
    more_message: Int64,
    more_code: UInt8,
    more_value: Float64,
) -> tuple[int, int]:
    """Read the joints of messages; return how many more there are, and how many surplus."""
    more = 0
    surplus = 0
    for k in range(len(place)):
        i = _U(place[_U(k)])
        body = start[i] + BODY
        size = end[i] - body
        found[i] = _MALFORMED
        if not read_stamp(data, start[i], end[i], i, stamp_ns):
            continue
        big = data[_U(start[i] + 1)] == 0
        at = string_end(data, body, TIME_BYTES, size, big)
        if at == BAD:
            continue
        at, slots, left = _read_names(data, body, at, size, big, rudder, scratch)
        if at == BAD or not _read_arrays(data, body, at, size, big, scratch):
            continue
        surplus += left
        found[i] = _NO_JOINT
        for slot in range(RUDDER + 1):
            which = 1 if slot < PLACES else 0  # the rate of a shaft, the angle of the others
            joint = scratch[_U(slot)]
            if not slots >> slot & 1 or joint >= scratch[_U(_LENGTH + which)]:
                continue
            value = float64(data, scratch[_U(_FIRST + which)] + 8 * joint, big)
            if found[i] != _READ:
                found[i] = _READ
                code[i] = _CODES[_U(slot)]
                rows[i, 0] = value
                rows[i, 1] = 0.0
                for column in range(2, COLUMNS):
                    rows[i, _U(column)] = np.nan
            else:
                more_message[_U(more)] = np.int64(i)
                more_code[_U(more)] = _CODES[_U(slot)]
                more_value[_U(more)] = value
                more += 1
    return more, surplus
