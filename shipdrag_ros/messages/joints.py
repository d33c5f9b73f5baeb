# SPDX-License-Identifier: Apache-2.0
"""
Shafts, pitches and rudder out of the CDR bytes of JointState messages.

Where the values lie in a message is found once for all that follow with the same bytes but for
stamp and values, as those of one publisher have them.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.messages import types
from shipdrag_ros.messages.gather import BODY, COLUMNS, TIME_BYTES, GatherResult
from shipdrag_ros.messages.types import PADDING_BYTES, MalformedMessage
from shipdrag_ros.samples import PITCHES, SECOND_NS, SHAFTS, Channel, Float64, Int64, UInt8

PLACES = len(SHAFTS)
_CHANNELS = (*SHAFTS, *PITCHES, Channel.RUDDER)
"""Of each slot: of the shafts, of the pitches, and of the rudder."""
_RUDDER = len(_CHANNELS) - 1
_KIND = re.compile('(shaft|pitch)', re.IGNORECASE | re.ASCII)
_SIDE = re.compile(
    r'[^a-z]*(?:(port)|(starboard|stbd)|(centre|center)|\Z)(?![a-z])', re.IGNORECASE | re.ASCII
)
_WINDOW, _MOST = 64, 4096  # messages compared with the first; twice as many where all are alike
_MOST_BYTES = 1 << 20  # of messages compared at once
_KEPT, _KEPT_BYTES = 64, 4096  # layouts, by the size of their messages, none of a longer one


class Joints(NamedTuple):
    """
    What messages hold beyond their first joint.

    Attributes
    ----------
    message : (m,) int64
        Place of the message of each.
    code : (m,) uint8
        Its channel.
    value : (m,)
    surplus
        How many joints had no place left.
    """

    message: NDArray[np.intp]
    code: UInt8
    value: Float64
    surplus: int


class MessageRows(NamedTuple):
    """
    What is read of n messages, to be filled.
    """

    code: UInt8
    stamp_ns: Int64
    value: Float64
    found: UInt8


class _JointLayout(NamedTuple):
    """Channel and place of each value, joints without a slot, and bytes that may not differ."""

    channels: list[Channel]
    places: list[int]
    surplus: int
    fixed: NDArray[np.intp]
    content: UInt8


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
        Holds the messages.
    start, end : (n,) int64
        Where each message begins and ends.
    place : (k,) intp
        Which messages are read.
    channel
        Of the rudder, or of any shaft.
    rows
        Filled with the first joint of each.
    """
    more: list[tuple[NDArray[np.intp], int, Float64]] = []
    surplus, left, width = 0, place, _WINDOW
    while len(left):
        first = left[0]
        content = data[start[first] : end[first]]
        layout = _layout_of(content, rudder=channel is Channel.RUDDER)
        if layout is None:
            rows.found[first] = GatherResult.MALFORMED
            left = left[1:]
            continue
        near = left[: max(min(width, _MOST_BYTES // len(content)), 1)]
        alike = end[near] - start[near] == len(content)
        messages = data[start[near[alike]][:, np.newaxis] + np.arange(len(content))]
        same = (messages[:, layout.fixed] == layout.content).all(axis=1)
        alike[alike] = same
        taken, messages = near[alike], messages[same]
        _fill(rows, taken, messages, layout, more)
        surplus += layout.surplus * len(taken)
        left = np.concatenate((near[~alike], left[len(near) :]))
        width = min(2 * width, _MOST) if alike.all() else _WINDOW
    codes = [np.full(len(messages), code, np.uint8) for messages, code, _ in more]
    return Joints(
        np.concatenate([np.empty(0, np.intp), *(messages for messages, _, _ in more)]),
        np.concatenate([np.empty(0, np.uint8), *codes]),
        np.concatenate([np.empty(0), *(values for _, _, values in more)]),
        surplus,
    )


def _fill(
    rows: MessageRows,
    taken: NDArray[np.intp],
    messages: UInt8,
    layout: _JointLayout,
    more: list[tuple[NDArray[np.intp], int, Float64]],
) -> None:
    """Read messages of one layout, (n, bytes of each)."""
    order = '>' if messages[0, 1] == 0 else '<'
    rows.found[taken] = GatherResult.READ if layout.channels else GatherResult.NO_JOINT
    seconds, nanoseconds = (
        np.ascontiguousarray(messages[:, at : at + 4]).view(f'{order}{kind}')[:, 0]
        for at, kind in ((BODY, 'i4'), (BODY + 4, 'u4'))
    )
    rows.stamp_ns[taken] = seconds.astype(np.int64) * SECOND_NS + nanoseconds
    for number, (channel, at) in enumerate(zip(layout.channels, layout.places, strict=True)):
        values = np.ascontiguousarray(messages[:, at : at + 8]).view(f'{order}f8')[:, 0]
        if number:
            more.append((taken, channel, values.astype(np.float64)))
            continue
        rows.code[taken] = channel
        rows.value[taken, 0], rows.value[taken, 1] = values, 0.0
        rows.value[taken, 2:COLUMNS] = np.nan


_known: dict[tuple[int, bool], _JointLayout] = {}


def _layout_of(content: UInt8, *, rudder: bool) -> _JointLayout | None:
    """Return where the values of a message lie, found now if it is not as the last of its size."""
    key = len(content), rudder
    known = _known.get(key)
    if known is None or (content[known.fixed] != known.content).any():
        known = _layout(content, rudder=rudder)
        kept = len(content) <= _KEPT_BYTES and (key in _known or len(_known) < _KEPT)
        if known is not None and kept:
            _known[key] = known
    return known


def _layout(content: UInt8, *, rudder: bool) -> _JointLayout | None:
    """Find where the values of a message lie; None of what is no JointState."""
    try:
        sent = types.deserialize(types.JOINT_STATE, content.tobytes())
    except MalformedMessage:
        return None
    joints, surplus = _slots(sent.name, rudder=rudder)
    at = _behind(TIME_BYTES, sent.header.frame_id)
    at = _aligned(at, 4) + 4
    for name in sent.name:
        at = _behind(at, name)
    varies = np.zeros(len(content), np.bool_)
    varies[BODY : BODY + TIME_BYTES] = True
    firsts = []
    for values in (sent.position, sent.velocity, sent.effort):
        at = _aligned(at, 4) + 4
        at = _aligned(at, 8) if len(values) else at
        firsts.append(BODY + at)
        at += 8 * len(values)
        varies[firsts[-1] : BODY + at] = True
    if not 0 <= len(content) - (BODY + at) <= PADDING_BYTES:
        return None
    found = [
        (_CHANNELS[slot], firsts[moves] + 8 * joint)
        for slot, joint in sorted(joints.items())
        for moves in [slot < PLACES]  # the rate of a shaft, the angle of the others
        if joint < len(sent.velocity if moves else sent.position)
    ]
    fixed = np.flatnonzero(~varies)
    places = [place for _, place in found]
    return _JointLayout([each for each, _ in found], places, surplus, fixed, content[fixed])


def _behind(at: int, text: str) -> int:
    """Return where a string ends that begins at a place, or at the next that is aligned."""
    return _aligned(at, 4) + 4 + len(text.encode()) + 1


def _aligned(at: int, size: int) -> int:
    return -(-at // size) * size


def _slots(names: list[str], *, rudder: bool) -> tuple[dict[int, int], int]:
    """Return which joint has each slot, and how many have none left."""
    if rudder:
        joints = [number for number, name in enumerate(names) if name.lower() == 'rudder']
        return dict.fromkeys([_RUDDER], joints[0]) if joints else {}, 0
    slots: dict[int, int] = {}
    waiting: dict[int, list[int]] = {0: [], PLACES: []}
    surplus = 0
    for number, name in enumerate(names):
        kind = _KIND.match(name)
        if kind is None:
            continue
        first = 0 if kind[0].lower() == 'shaft' else PLACES
        place = _place(name[kind.end() :])
        if place is not None and place >= PLACES:
            surplus += 1
        elif place is None or first + place in slots:
            waiting[first].append(number)
        else:
            slots[first + place] = number
    for first, joints in waiting.items():
        free = [slot for slot in range(first, first + PLACES) if slot not in slots]
        slots |= dict(zip(free, joints))
        surplus += max(len(joints) - len(free), 0)
    return slots, surplus


def _place(rest: str) -> int | None:
    """Return the place, from 0, that the rest of a name says; None: the first that is free."""
    # no pattern: a name of a stranger may be long, and a search for its end takes the square of it
    if digits := rest[len(rest.rstrip('0123456789')) :]:
        return (int(digits.lstrip('0')[:4] or 0) or PLACES) - 1
    side = _SIDE.match(rest)
    if side is None:
        return None
    return next((place for place in (1, 2) if side[place + 1]), 0)
