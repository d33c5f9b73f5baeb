# SPDX-License-Identifier: Apache-2.0
"""
CDR bytes to blocks, the same for one live message and for a bag's thousands.

Most messages of a topic have the same lengths and texts. Where the numbers lie is found in
the first of them, and the others that lie alike are read at once; what is computed from the
numbers is computed on float64 arrays, so that a message alone and the same message in a batch
agree to the last bit.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cache, cached_property
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shipdrag_ros.messages import types
from shipdrag_ros.messages.topics import Source
from shipdrag_ros.messages.types import MalformedMessage, MessageLayout
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
COLUMNS = 4  # two values and two variances
_CHANNELS = (*SHAFTS, *PITCHES, Channel.RUDDER)
"""Of each slot: of the shafts, of the pitches, and of the rudder."""
_RUDDER = len(_CHANNELS) - 1
_KIND = re.compile('(shaft|pitch)', re.IGNORECASE | re.ASCII)
_SIDE = re.compile(
    r'[^a-z]*(?:(port)|(starboard|stbd)|(centre|center)|\Z)(?![a-z])', re.IGNORECASE | re.ASCII
)
_WINDOW, _MOST = 64, 4096  # messages compared with the first: after others, and at first
_MOST_BYTES = 1 << 20  # of messages compared at once
_KEPT, _KEPT_BYTES = 256, 4096  # plans, by the size of their messages, none of a longer one

_Place = tuple[np.dtype[Any], int]
"""Form of a number, and where it lies in its message."""


class _Plan(NamedTuple):
    """
    How messages that lie alike are read.

    Attributes
    ----------
    fixed, content : (k,)
        Bytes that are the same in all, and what they are.
    stamp
        Of seconds and nanoseconds; none of a type that holds no time.
    samples
        Channel of each, and its numbers by column.
    surplus
        Joints without a slot.
    """

    fixed: NDArray[np.intp]
    content: UInt8
    stamp: list[_Place]
    samples: list[tuple[Channel, dict[int, _Place]]]
    surplus: int = 0


_known: dict[tuple[Source, int], _Plan] = {}


def _plan_of(source: Source, content: UInt8) -> _Plan | None:
    """Return the plan of a message, made now if it lies not as the last of its size."""
    key = source, len(content)
    known = _known.get(key)
    if known is None or (content[known.fixed] != known.content).any():
        known = _plan(_readings()[source], content)
        kept = len(content) <= _KEPT_BYTES and (key in _known or len(_known) < _KEPT)
        if known is not None and kept:
            _known[key] = known
    return known


def _plan(reading: _Reading, content: UInt8) -> _Plan | None:
    """Find where the numbers of a message lie; None of what is malformed."""
    for type_name, fields in reading.ways:
        try:
            layout = types.layout_of(type_name, content.tobytes())
        except MalformedMessage:
            continue
        stamp = [f'header.stamp.{part}' for part in ('sec', 'nanosec') if reading.stamped]
        samples, surplus = [(reading.channel, fields)], 0
        if not fields:
            samples, surplus = _joints(layout, rudder=reading.channel is Channel.RUDDER)
        return _Plan(
            layout.fixed,
            content[layout.fixed],
            [layout.number(path) for path in stamp],
            [
                (channel, {k: layout.number(path) for k, path in enumerate(paths) if path})
                for channel, paths in samples
            ],
            surplus,
        )
    return None


def _joints(
    layout: MessageLayout, *, rudder: bool
) -> tuple[list[tuple[Channel, Sequence[str]]], int]:
    """Return channel and value of the joints that have a slot, and how many have none left."""
    slots, surplus = _slots(layout.texts.get('name', []), rudder=rudder)
    found: list[tuple[Channel, Sequence[str]]] = []
    for slot, joint in sorted(slots.items()):
        # the rate of a shaft, the angle of the others
        array = 'velocity' if slot < PLACES else 'position'
        if joint < layout.arrays[array][2]:
            found.append((_CHANNELS[slot], [f'{array}[{joint}]']))
    return found, surplus


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


class _Samples(NamedTuple):
    """Samples of one channel: which message each came from, its stamp, values and variances."""

    message: NDArray[np.intp]
    channel: UInt8
    stamp_ns: Int64
    table: Float64


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
    nothing = np.empty(0, np.int64)
    found = [_Samples(nothing, np.empty(0, np.uint8), nothing, np.empty((0, COLUMNS)))]
    unreadable = []
    for i, source in enumerate(sources):
        counts: Counter[Unreadable] = Counter()
        left, width = np.flatnonzero(number == i), _MOST
        while len(left):
            first = left[0]
            plan = _plan_of(source, data[start[first] : end[first]])
            if plan is None:
                counts[Unreadable.MALFORMED] += 1
                left = left[1:]
                continue
            near = left[: max(min(width, _MOST_BYTES // len(plan.fixed)), 1)]
            alike = end[near] - start[near] == end[first] - start[first]
            fixed = data[start[near[alike]][:, np.newaxis] + plan.fixed]
            alike[alike] = (fixed == plan.content).all(axis=1)
            taken = near[alike]
            found += _read(_readings()[source], plan, data, start[taken], taken, receive_ns)
            counts[Unreadable.NO_JOINT] += 0 if plan.samples else len(taken)
            counts[Unreadable.SURPLUS_JOINT] += plan.surplus * len(taken)
            left = np.concatenate((near[~alike], left[len(near) :]))
            width = min(2 * width, _MOST) if alike.all() else _WINDOW
        unreadable.append(Counter({each: counts[each] for each in Unreadable if counts[each]}))
    message, code, stamp_ns, table = map(np.concatenate, zip(*found, strict=True))
    order = np.argsort(message, kind='stable')
    kept, table = message[order], table[order]
    block = Block(code[order], stamp_ns[order], receive_ns[kept], table[:, :2], table[:, 2:])
    return DecodedBatch(block, kept, tuple(unreadable))


def _read(
    reading: _Reading,
    plan: _Plan,
    data: UInt8,
    start: Int64,
    message: NDArray[np.intp],
    receive_ns: Int64,
) -> Iterator[_Samples]:
    """Yield the samples of messages that lie alike, those of a channel together."""

    def numbers(form: np.dtype[Any], at: int) -> NDArray[Any]:
        places = start[:, np.newaxis] + np.arange(at, at + form.itemsize)
        found: NDArray[Any] = data[places].view(form)[:, 0]
        return found

    stamp_ns = receive_ns[message]
    if plan.stamp:
        seconds, nanoseconds = (numbers(*place) for place in plan.stamp)
        stamp_ns = seconds.astype(np.int64) * SECOND_NS + nanoseconds
    for channel, places in plan.samples:
        table = np.full((len(message), reading.width), np.nan)
        table[:, :2] = 0.0
        for column, place in places.items():
            with np.errstate(invalid='ignore'):  # a NaN of float32 that signals
                table[:, column] = numbers(*place)
        table = table if reading.columns is None else reading.columns(table)
        variance = table[:, 2:]
        variance[~((variance > 0.0) & (variance < np.inf))] = np.nan
        yield _Samples(message, np.full(len(message), channel, np.uint8), stamp_ns, table)


Converted = Callable[[Float64], Float64]


@dataclass(frozen=True)
class _Reading:
    """
    How the messages of a source are read.

    Attributes
    ----------
    channel
        Of joints, which their names tell apart, that of the first.
    ways
        The type as it is, then as it was, and the field of each column; none of joints.
    columns
        Makes values and variances of these; None where they are as sent.
    """

    channel: Channel
    ways: tuple[tuple[str, Sequence[str]], ...]
    columns: Converted | None

    @cached_property
    def width(self) -> int:
        """Number of columns."""
        return COLUMNS if self.columns is None else len(self.ways[0][1])

    @cached_property
    def stamped(self) -> bool:
        """Whether the type holds a time; what has none counts from its arrival."""
        return types.is_stamped(self.ways[0][0])


def _table(*columns: Float64 | float) -> Float64:
    """Put two values and two variances side by side."""
    return np.stack(np.broadcast_arrays(*columns), axis=1)


def _fix(extra: Float64) -> Float64:
    """Return latitude and longitude [deg]; NaN where there is no fix."""
    latitude, longitude, variance_north, variance_east, status, covariance_type = extra.T
    table = _table(latitude, longitude, variance_north, variance_east)
    unknown = types.class_of(types.NAV_SAT_FIX).COVARIANCE_TYPE_UNKNOWN
    table[covariance_type == unknown, 2:] = np.nan
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
    ways: list[tuple[str, Sequence[str]]] = [(type_name, fields)]
    if older is not None:
        ways.append((older, [field for field in fields if field != 'variance']))
    return Source(channel.input, type_name), _Reading(channel, tuple(ways), columns)


@cache
def _readings() -> Mapping[Source, _Reading]:
    found = dict(_each_reading())
    for channel in Channel:  # further instruments are read as the first one
        for source, reading in tuple(found.items()):
            if reading.channel is channel.kind and channel.input in FURTHER:
                found[Source(channel.input, source.type)] = replace(reading, channel=channel)
    return found


def fields_of(channel: Channel, type_name: str) -> dict[str, int]:
    """Return the fields that hold values and variances of a channel, with the column of each."""
    ((_, fields), *_) = _readings()[Source(channel.input, type_name)].ways
    return {field: column for column, field in enumerate(fields[:COLUMNS]) if field}


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
