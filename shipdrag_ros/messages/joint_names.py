# SPDX-License-Identifier: Apache-2.0
"""
Which joint of a JointState is which shaft or pitch, by its name, compiled.

A joint's place follows from its message alone, so that live and replay agree, and
joints may come together or in messages of their own. The name is `shaft` or
`pitch` and a rest, capitals or not; its place, 1 to 4, is

1. the number that it ends with: `shaft_2`, `shaft2`; 0 is place 4, so that joints
   counted from 0 do not meet either, and 5 and more have no place
2. without a rest, 1
3. by the side: `shaft_port` 1, `shaft_starboard` or `shaft_stbd` 2,
   `shaft_centre` or `shaft_center` 3, whatever follows (`shaft_port_inner`)
4. otherwise, or where an earlier joint of the message has that place, the first one
   that no joint of the message has, in the order of the message

A joint without a place is counted as surplus. The rudder is the joint `rudder`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import PITCHES, SHAFTS, UInt8

PLACES = len(SHAFTS)
"""Slots of the shafts; those of the pitches follow, and `RUDDER`."""
RUDDER = len(SHAFTS) + len(PITCHES)
FREE = -1
BEYOND = -2
NOT_OURS = -3

_U = np.uint64


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
