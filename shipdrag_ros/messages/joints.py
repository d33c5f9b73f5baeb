# SPDX-License-Identifier: Apache-2.0
"""
Shafts, pitches and rudder out of the CDR bytes of JointState messages, compiled.

Which joint is which channel: see `joint_names`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np
from numba import njit
from numba import types as nb
from numpy.typing import NDArray

from shipdrag_ros.compiled import digest
from shipdrag_ros.messages.gather import (
    BAD,
    BODY,
    COLUMNS,
    TIME_BYTES,
    Found,
    aligned,
    float64,
    read_stamp,
    string_end,
    word,
)
from shipdrag_ros.messages.joint_names import BEYOND, FREE, NOT_OURS, PLACES, RUDDER, slot_of
from shipdrag_ros.messages.types import PADDING_BYTES
from shipdrag_ros.samples import PITCHES, SHAFTS, Channel, Float64, Int64, UInt8

_CODES = np.array([*SHAFTS, *PITCHES, Channel.RUDDER], np.uint8)
_READ = int(Found.READ)
_MALFORMED = int(Found.MALFORMED)
_NO_JOINT = int(Found.NO_JOINT)
_PADDING = PADDING_BYTES
_SOURCES = ('gather', 'joint_names', 'joints', 'types')
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


def read_joints(
    data: UInt8,
    start: Int64,
    end: Int64,
    place: NDArray[np.intp],
    channel: Channel,
    stamp_ns: Int64,
    code: UInt8,
    rows: Float64,
    found: UInt8,
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
    stamp_ns : (n,) int64
        Filled with the stamps [ns].
    code : (n,) uint8
        Filled with the channel of the first joint of each.
    rows : (n, c) float64
        Filled with the value of the first joint of each, and what `gather` fills for
        a single value without a variance.
    found : (n,) uint8
        Filled with a `Found` each.

    Returns
    -------
    Joints
        What there is besides the first joints.
    """
    rudder = channel is Channel.RUDDER
    room = 0 if rudder else (2 * PLACES - 1) * len(place)
    more = Joints(np.empty(room, np.intp), np.empty(room, np.uint8), np.empty(room), 0)
    count, surplus = _read_all(
        data, start, end, place, rudder, stamp_ns, code, rows, found, *more[:3]
    )
    return Joints(more.message[:count], more.code[:count], more.value[:count], surplus)


@njit
def _give_places(joint: Any, waiting: Any, waits: Any, surplus: Any) -> None:
    """Give the free places to the joints that have none by their name."""
    for kind in range(2):
        given = 0
        for slot in range(kind * PLACES, (kind + 1) * PLACES):
            if joint[slot] < 0 and given < min(waits[kind], PLACES):
                joint[slot] = waiting[kind, given]
                given += 1
        surplus[0] += waits[kind] - given


@njit
def _read_names(
    data: Any, body: int, at: int, size: int, big: bool, rudder: bool, found: Any
) -> int:
    """Find the joint of each slot; return the end of the names, `BAD` if they are none."""
    at = aligned(at, 4)
    if at + 4 > size:
        return BAD
    count = np.int64(word(data, body + at, big))
    at += 4
    if at + count * _SHORTEST_STRING > size:
        return BAD
    joint, waiting, waits, surplus = found
    joint[:] = -1
    waits[:] = 0
    surplus[0] = 0
    for each in range(count):
        at = aligned(at, 4)
        first = body + at + 4
        at = string_end(data, body, at, size, big)
        if at == BAD:
            return BAD
        kind, place = slot_of(data, first, body + at - 1, rudder)
        if kind == NOT_OURS:
            continue
        if place == BEYOND:
            surplus[0] += 1
        elif place != FREE and joint[kind + place] < 0:
            joint[kind + place] = each
        elif kind != RUDDER:  # of two rudders of the name, the first
            which = kind // PLACES
            if waits[which] < PLACES:
                waiting[which, waits[which]] = each
            waits[which] += 1
    _give_places(joint, waiting, waits, surplus)
    return at


@njit
def _read_arrays(
    data: Any, body: int, at: int, size: int, big: bool, count: Any, first: Any
) -> bool:
    """Find position, velocity and effort; False if they do not fill the message."""
    for k in range(3):
        at = aligned(at, 4)
        if at + 4 > size:
            return False
        count[k] = np.int64(word(data, body + at, big))
        at += 4
        if count[k] > 0:
            at = aligned(at, 8)
        if at + 8 * count[k] > size:
            return False
        first[k] = body + at
        at += 8 * count[k]
    return size - at <= _PADDING


_BUFFER = nb.Array(nb.uint8, 1, 'C', readonly=True)
_PLACES_READ = nb.Array(nb.int64, 1, 'C', readonly=True)


def _compile(sources: str) -> Callable[..., tuple[int, int]]:
    @njit(
        nb.UniTuple(nb.int64, 2)(
            _BUFFER,
            _PLACES_READ,
            _PLACES_READ,
            _PLACES_READ,
            nb.boolean,
            nb.int64[::1],
            nb.uint8[::1],
            nb.float64[:, ::1],
            nb.uint8[::1],
            nb.int64[::1],
            nb.uint8[::1],
            nb.float64[::1],
        ),
        cache=True,
    )
    def read_all(  # type: ignore[no-untyped-def]
        data,
        start,
        end,
        place,
        rudder,
        stamp_ns,
        code,
        rows,
        found,
        more_message,
        more_code,
        more_value,
    ):
        """Read the joints of messages; return how many more there are, and how many surplus."""
        sources  # noqa: B018  compiled anew when they change
        joint = np.empty(len(_CODES), np.int64)
        beyond = np.empty(1, np.int64)
        names = joint, np.empty((2, PLACES), np.int64), np.empty(2, np.int64), beyond
        count = np.empty(3, np.int64)
        first = np.empty(3, np.int64)
        more = 0
        surplus = 0
        for k in range(len(place)):
            i = place[k]
            body = start[i] + BODY
            size = end[i] - body
            found[i] = _MALFORMED
            if not read_stamp(data, start[i], end[i], i, stamp_ns):
                continue
            big = data[_U(start[i] + 1)] == 0
            at = string_end(data, body, TIME_BYTES, size, big)
            if at == BAD:
                continue
            at = _read_names(data, body, at, size, big, rudder, names)
            if at == BAD or not _read_arrays(data, body, at, size, big, count, first):
                continue
            surplus += beyond[0]
            samples = 0
            for slot in range(len(_CODES)):
                which = 1 if slot < PLACES else 0  # the rate of a shaft, the angle of the others
                if joint[slot] < 0 or joint[slot] >= count[which]:
                    continue
                value = float64(data, first[which] + 8 * joint[slot], big)
                if samples == 0:
                    code[i] = _CODES[slot]
                    rows[i, 0] = value
                    rows[i, 1] = 0.0
                    rows[i, 2:COLUMNS] = np.nan
                else:
                    more_message[more] = i
                    more_code[more] = _CODES[slot]
                    more_value[more] = value
                    more += 1
                samples += 1
            found[i] = _READ if samples else _NO_JOINT
        return more, surplus

    return cast(Callable[..., tuple[int, int]], read_all)


_read_all = _compile(digest('samples.py', *(f'messages/{name}.py' for name in _SOURCES)))
