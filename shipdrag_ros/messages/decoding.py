# SPDX-License-Identifier: Apache-2.0
"""
CDR bytes to blocks, the same for one live message and for a bag's thousands.

The bytes are read by `gather`, message by message; what is computed from the
numbers is computed on float64 arrays, so that a message alone and the same
message in a batch agree to the last bit.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cache
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shipdrag_ros.messages import types
from shipdrag_ros.messages.gather import BODY, COLUMNS, TIME_BYTES, GatherResult, gather, steps
from shipdrag_ros.messages.topics import Source
from shipdrag_ros.messages.types import PADDING_BYTES, MalformedMessage
from shipdrag_ros.samples import (
    FURTHER,
    PITCHES,
    SECOND_NS,
    SHAFTS,
    Block,
    Channel,
    Float64,
    Int64,
    UInt8,
)

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


Further = tuple[NDArray[np.intp], int, Float64]
"""Joints beyond the first of their messages: places of these, one channel, and the values."""


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
    more: list[Further],
) -> int:
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
    more
        Lengthened by the others.

    Returns
    -------
    int
        How many joints had no place left.
    """
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
    return surplus


def _fill(
    rows: MessageRows,
    taken: NDArray[np.intp],
    messages: UInt8,
    layout: _JointLayout,
    more: list[Further],
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


# a quaternion whose squared norm is further from 1 is no rotation
QUATERNION_TOLERANCE = 0.1


class Unreadable(Enum):
    """Why a message, or a joint in one, gave no sample."""

    MALFORMED = 'malformed'
    NO_JOINT = 'no_joint'  # a JointState without a joint that is read, or without its value
    SURPLUS_JOINT = 'surplus_joint'  # not a message, but a joint in it that has no place


@dataclass(frozen=True)
class Decoded:
    """
    The samples in some messages of one source.

    Attributes
    ----------
    block
        The samples in the order of the messages: one of each that is readable, but of
        shafts and pitches one a joint, in the order of their channels.
    kept : (n,) intp
        Which message each sample came from; ascending.
    unreadable
        Number of messages without a sample, by reason; of `SURPLUS_JOINT`, joints.
    """

    block: Block
    kept: NDArray[np.intp]
    unreadable: Counter[Unreadable]


def decode(source: Source, payloads: Sequence[bytes], receive_ns: ArrayLike) -> Decoded:
    """
    Turn messages of one source into samples.

    Parameters
    ----------
    source
        The input and the type that its messages have.
    payloads
        CDR bytes as received, either byte order.
    receive_ns : (n,) integers
        Time of arrival of each [ns].

    Returns
    -------
    Decoded
        The samples (n,), the place of each among the messages, and how many messages could
        not be read: a message that is damaged is counted, not raised.

    Raises
    ------
    KeyError
        If the type is none that the input accepts.

    Notes
    -----
    Variances follow the columns of the value; those of `POSITION_GEODETIC`
    are in m^2, to the north and to the east. A variance that is not positive
    and finite is unknown, NaN.

    Examples
    --------
    >>> from shipdrag_ros.messages import Source, decode, encode
    >>> from shipdrag_ros.samples import Block, Channel
    >>> sent = next(encode(Block.of(Channel.SPEED_THROUGH_WATER, [0], [6.0])))
    >>> decoded = decode(Source('speed_through_water', sent.type), [sent.payload], [sent.log_ns])
    >>> float(decoded.block.value[0, 0])
    6.0
    """
    ends = np.fromiter(accumulate(map(len, payloads), initial=0), np.int64)
    data = np.frombuffer(b''.join(payloads), np.uint8)
    received = np.atleast_1d(np.asarray(receive_ns, np.int64))
    every = np.zeros(len(payloads), np.uint16)
    block, kept, (unreadable,) = decode_batch(
        (source,), every, data, ends[:-1], ends[1:], received
    )
    return Decoded(block, kept, unreadable)


class DecodedBatch(NamedTuple):
    """The same as `Decoded` of several sources, with what is unreadable of each."""

    block: Block
    kept: NDArray[np.intp]
    unreadable: tuple[Counter[Unreadable], ...]


def decode_batch(
    sources: Sequence[Source],
    number: NDArray[np.uint16],
    data: UInt8,
    start: Int64,
    end: Int64,
    receive_ns: Int64,
) -> DecodedBatch:
    """
    Turn messages of several sources, in one buffer, into samples in their order.

    Parameters
    ----------
    sources
        What is to be read.
    number : (n,) uint16
        Place of each message's source among them; messages beyond are left out.
    data : (b,) uint8
        The buffer.
    start, end : (n,) int64
        Where each message begins and ends in it.
    receive_ns : (n,) int64
        Time of arrival of each [ns].
    """
    n = len(start)
    code, found = np.empty(n, np.uint8), np.full(n, GatherResult.NOTHING, np.uint8)
    readings = [_readings()[source] for source in sources]
    width = max((reading.width for reading in readings), default=COLUMNS)
    stamp_ns, rows = np.empty(n, np.int64), np.empty((n, width))
    unreadable = []
    more: list[Further] = []
    for i, reading in enumerate(readings):
        place = np.flatnonzero(number == i)
        if not reading.steps:
            into = MessageRows(code, stamp_ns, rows, found)
            surplus = read_joints(data, start, end, place, reading.channel, into, more)
            unreadable.append(_count(found[place], surplus))
            continue
        code[place] = reading.channel
        if not reading.stamped:
            stamp_ns[place] = receive_ns[place]
        for by in reading.steps:
            unread = gather(data, start, end, place, by, stamp_ns, rows, found)
            if reading.columns is not None:
                computed = reading.columns(rows[place, COLUMNS : reading.width])
                rows[place, :COLUMNS] = computed
            if not unread:
                break
            place = place[found[place] != GatherResult.READ]
        unreadable.append(_count(found[place]) if unread else Counter())
    kept = np.flatnonzero(found == GatherResult.READ)
    if more:
        kept, code, rows = _with_more(kept, code, rows, more)
        stamp_ns, receive_ns = stamp_ns[kept], receive_ns[kept]
    elif len(kept) < n:
        code, stamp_ns, rows, receive_ns = code[kept], stamp_ns[kept], rows[kept], receive_ns[kept]
    block = Block(code, stamp_ns, receive_ns, rows[:, :2], rows[:, 2:COLUMNS])
    return DecodedBatch(block, kept, tuple(unreadable))


def _with_more(
    kept: NDArray[np.intp], code: UInt8, rows: Float64, more: Sequence[Further]
) -> tuple[NDArray[np.intp], UInt8, Float64]:
    """Put further joints behind the first one of their message."""
    message = np.concatenate([kept, *(messages for messages, _, _ in more)])
    order = np.argsort(message, kind='stable')
    message = message[order]
    code, rows = code[message], rows[message]
    further = np.flatnonzero(order >= len(kept))
    which = order[further] - len(kept)
    codes = [np.full(len(messages), channel, np.uint8) for messages, channel, _ in more]
    code[further] = np.concatenate(codes)[which]
    rows[further, 0] = np.concatenate([values for _, _, values in more])[which]
    return message, code, rows


def _count(found: UInt8, surplus: int = 0) -> Counter[Unreadable]:
    """Count what gave no sample."""
    results, times = np.unique(found[found != GatherResult.READ], return_counts=True)
    reasons = [Unreadable[GatherResult(each).name] for each in results]
    counts = Counter(dict(zip(reasons, times.tolist(), strict=True)))
    if surplus:
        counts[Unreadable.SURPLUS_JOINT] = surplus
    return counts


Converted = Callable[[Float64], Float64]


@dataclass(frozen=True)
class _Reading:
    """
    How the messages of a source are read.

    Attributes
    ----------
    steps
        Through the type as it is, then through the type as it was; none through
        JointState, which `read_joints` reads.
    columns
        Values and variances of the extra fields; None where they are as sent.
    width
        Number of values, variances and extra fields.
    stamped
        Whether the type holds a time; what has none counts from its arrival.
    """

    channel: Channel
    steps: tuple[Int64, ...]
    columns: Converted | None
    width: int
    stamped: bool


def _table(*columns: Float64 | float) -> Float64:
    """Put two values and two variances side by side; what says nothing is NaN."""
    table = np.stack(np.broadcast_arrays(*columns), axis=1)
    variance = table[:, 2:]
    variance[~((variance > 0.0) & (variance < np.inf))] = np.nan
    return table


def _fix(extra: Float64) -> Float64:
    """Return latitude and longitude [deg]; NaN where there is no fix."""
    latitude, longitude, variance_north, variance_east, status, covariance_type = extra.T
    table = _table(latitude, longitude, variance_north, variance_east)
    table[covariance_type == types.class_of(types.NAV_SAT_FIX).COVARIANCE_TYPE_UNKNOWN, 2:] = (
        np.nan
    )
    # a driver that leaves the status as it is by default, unknown, has not said that there is none
    of = types.class_of('sensor_msgs/msg/NavSatStatus')
    none = (status < of.STATUS_FIX) & (status != of.STATUS_UNKNOWN)
    table[none] = np.nan
    return table


def _magnitude(extra: Float64) -> Float64:
    """
    Return length of a vector and its variance, to first order.

    Without a direction, at rest, the larger of the two variances.
    """
    x, y, variance_x, variance_y, covariance = extra.T
    with np.errstate(divide='ignore', over='ignore', invalid='ignore'):
        speed = np.hypot(x, y)
        c = x / speed
        s = y / speed
        along = c * c * variance_x + s * s * variance_y + 2.0 * c * s * covariance
    variance = np.where(speed == 0.0, np.maximum(variance_x, variance_y), along)
    # one negative variance says "unknown" for both
    known = np.where((variance_x < 0.0) | (variance_y < 0.0), np.nan, variance)
    return _table(speed, 0.0, known, np.nan)


def _dvl_water(extra: Float64) -> Float64:
    """Return the speed ahead; NaN where it was measured against the bottom."""
    x, variance, mode = extra.T
    table = _table(x, 0.0, variance, np.nan)
    table[mode != types.class_of(types.DVL).DVL_MODE_WATER, ::2] = np.nan
    return table


def _dvl_ground(extra: Float64) -> Float64:
    """Return the speed; NaN where it was measured against the water."""
    table = _magnitude(extra[:, :5])
    table[extra[:, 5] != types.class_of(types.DVL).DVL_MODE_BOTTOM, ::2] = np.nan
    return table


def _yaw(extra: Float64) -> Float64:
    """Return yaw [rad] of x, y, z, w; NaN where that is no rotation."""
    x, y, z, w, variance = extra[:, :5].T
    with np.errstate(over='ignore', invalid='ignore'):
        norm = x * x + y * y + z * z + w * w
        yaw = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    yaw = np.where(np.abs(norm - 1.0) <= QUATERNION_TOLERANCE, yaw, np.nan)
    return _table(yaw, 0.0, variance, np.nan)


def _imu(extra: Float64) -> Float64:
    table = _yaw(extra)
    none = extra[:, 5] == -1.0  # sensor_msgs/Imu: there is no orientation
    table[none, 0] = table[none, 2] = np.nan
    return table


def _compass(extra: Float64) -> Float64:
    """Return yaw [rad] of degrees clockwise from north."""
    with np.errstate(invalid='ignore'):
        yaw_deg = np.remainder(270.0 - extra[:, 0], 360.0) - 180.0
    return _table(np.radians(yaw_deg), 0.0, np.nan, np.nan)


def _reading(
    channel: Channel,
    type_name: str,
    *fields: str,
    columns: Converted | None = None,
    older: str | None = None,
) -> tuple[Source, _Reading]:
    """Pair a source with its two values and two variances; `columns` makes them of the fields."""
    if columns is not None:
        fields = (*[''] * COLUMNS, *fields)
    ways = [steps(type_name, fields)] if fields else []  # joints are read otherwise
    if older is not None:
        ways.append(steps(older, [field for field in fields if field != 'variance']))
    width, stamped = max(len(fields), COLUMNS), types.is_stamped(type_name)
    return Source(channel.input, type_name), _Reading(
        channel, tuple(ways), columns, width, stamped
    )


@cache
def _readings() -> Mapping[Source, _Reading]:
    found = dict(_each_reading())
    for channel in Channel:  # further instruments are read as the first one
        for source, reading in tuple(found.items()):
            if reading.channel is channel.kind and channel.input in FURTHER:
                found[Source(channel.input, source.type)] = replace(reading, channel=channel)
    return found


def _each_reading() -> Iterator[tuple[Source, _Reading]]:
    speed, ground = Channel.SPEED_THROUGH_WATER, Channel.SPEED_OVER_GROUND
    linear, x, y = 'twist.twist.linear.x', 'twist.linear.x', 'twist.linear.y'
    cells = [f'twist.covariance[{i}]' for i in (0, 7, 1)]
    yield _reading(speed, types.TWIST_WITH_COVARIANCE, linear, '', cells[0])
    yield _reading(speed, types.TWIST, x)
    velocity = 'velocity.linear.x', 'velocity.linear.y'
    yield _reading(speed, types.VELOCITY, velocity[0])
    # the twist of an odometry has the place that it has in a TwistWithCovariance
    yield _reading(speed, types.ODOMETRY, linear, '', cells[0])
    both = (linear, 'twist.twist.linear.y', *cells)
    yield _reading(ground, types.TWIST_WITH_COVARIANCE, *both, columns=_magnitude)
    yield _reading(ground, types.ODOMETRY, *both, columns=_magnitude)
    yield _reading(ground, types.TWIST, x, y, '', '', '', columns=_magnitude)
    yield _reading(ground, types.VELOCITY, *velocity, '', '', '', columns=_magnitude)
    velocity, covariance = ('velocity.x', 'velocity.y'), 'velocity_covar[{}]'.format
    mode = 'velocity_mode'
    yield _reading(speed, types.DVL, velocity[0], covariance(0), mode, columns=_dvl_water)
    covariances = map(covariance, (0, 4, 1))
    yield _reading(ground, types.DVL, *velocity, *covariances, mode, columns=_dvl_ground)

    position = Channel.POSITION
    pose = ['pose.pose.position.x', 'pose.pose.position.y']
    pose += ['pose.covariance[0]', 'pose.covariance[7]']
    yield _reading(position, types.POSE_WITH_COVARIANCE, *pose)
    yield _reading(position, types.ODOMETRY, *pose)
    yield _reading(position, types.POSE, 'pose.position.x', 'pose.position.y')
    yield _reading(position, types.POINT, 'point.x', 'point.y')
    # the covariance is in east, north, up
    fix = ['latitude', 'longitude', 'position_covariance[4]', 'position_covariance[0]']
    fix += ['status.status', 'position_covariance_type']
    yield _reading(Channel.POSITION_GEODETIC, types.NAV_SAT_FIX, *fix, columns=_fix)

    quaternion = [f'quaternion.{axis}' for axis in 'xyzw']
    yield _reading(Channel.HEADING, types.QUATERNION, *quaternion, '', columns=_yaw)
    attitude = [f'pose.orientation.{axis}' for axis in 'xyzw']
    yield _reading(Channel.HEADING, types.POSE, *attitude, '', columns=_yaw)
    imu = [f'orientation.{axis}' for axis in 'xyzw']
    imu += [f'orientation_covariance[{i}]' for i in (8, 0)]
    yield _reading(Channel.HEADING, types.IMU, *imu, columns=_imu)

    yield _reading(Channel.HEADING, types.FLOAT64, 'data', columns=_compass)

    yield _reading(Channel.SHAFT, types.JOINT_STATE)
    yield _reading(Channel.RUDDER, types.JOINT_STATE)
    yield _reading(Channel.WIND_APPARENT, types.TWIST, x, y)
    depth = ('range', '', 'variance')
    yield _reading(Channel.DEPTH, types.RANGE, *depth, older=types.RANGE_BEFORE_IRON)
