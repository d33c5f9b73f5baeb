# SPDX-License-Identifier: Apache-2.0
"""
CDR bytes to blocks, the same for one live message and for a bag's thousands.

The bytes are read by `gather`, message by message; what is computed from the
numbers is computed on float64 arrays, so that a message alone and the same
message in a batch agree to the last bit.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import accumulate

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shipdrag_ros.messages import types
from shipdrag_ros.messages.gather import Found, gather
from shipdrag_ros.messages.layout import steps
from shipdrag_ros.messages.topics import Source
from shipdrag_ros.samples import Block, Channel, Float64, Int64, UInt8

# a quaternion whose squared norm is further from 1 is no rotation
QUATERNION_TOLERANCE = 0.1


class Unreadable(Enum):
    """Why a message gave no sample."""

    MALFORMED = 'malformed'
    NO_JOINT = 'no_joint'  # a JointState without the joint, or without its value


@dataclass(frozen=True)
class Decoded:
    """
    The samples in some messages of one source.

    Attributes
    ----------
    block
        One sample a readable message, in the order given.
    kept : (n,) intp
        Which message each sample came from.
    unreadable
        Number of messages without a sample, by reason.
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

    Notes
    -----
    Variances follow the columns of the value; those of `POSITION_GEODETIC`
    are in m^2, to the north and to the east. A variance that is not positive
    and finite is unknown, NaN.
    """
    ends = np.fromiter(accumulate(map(len, payloads), initial=0), np.int64)
    data = np.frombuffer(b''.join(payloads), np.uint8)
    return decode_at(source, data, ends[:-1], ends[1:], receive_ns)


def decode_at(
    source: Source, data: UInt8, start: Int64, end: Int64, receive_ns: ArrayLike
) -> Decoded:
    """
    Turn messages of one source that lie in one buffer into samples.

    Parameters
    ----------
    source
        The input and the type that its messages have.
    data : (b,) uint8
        The buffer.
    start, end : (n,) int64
        Where each message begins and ends in it.
    receive_ns : (n,) integers
        Time of arrival of each [ns].
    """
    reading = _READINGS[source]
    stamp_ns, rows, found = _gather(reading, reading.steps, data, start, end)
    again = np.flatnonzero(found == Found.MALFORMED)
    if reading.older_steps is not None and len(again):
        stamp_ns[again], rows[again], found[again] = _gather(
            reading, reading.older_steps, data, start[again], end[again]
        )
    unreadable: Counter[Unreadable] = Counter()
    kept = np.flatnonzero(found == Found.READ)
    received = np.atleast_1d(np.asarray(receive_ns, np.int64))
    if len(kept) < len(found):
        stamp_ns, rows, received = stamp_ns[kept], rows[kept], received[kept]
        for code, reason in _UNREADABLE.items():
            unreadable[reason] += int(np.count_nonzero(found == code))
    value, variance = reading.columns(rows)
    known = (variance > 0.0) & (variance < np.inf)
    block = Block(
        np.full(len(kept), reading.channel, np.uint8),
        stamp_ns,
        received,
        value,
        np.where(known, variance, np.nan),
    )
    return Decoded(block, kept, +unreadable)


@dataclass(frozen=True)
class _Reading:
    """How the messages of a source are read; `older_steps` where these fit none."""

    channel: Channel
    width: int
    steps: Int64
    columns: Callable[[Float64], tuple[Float64, Float64]]
    joint: UInt8
    older_steps: Int64 | None = None


def _gather(
    reading: _Reading, by: Int64, data: UInt8, start: Int64, end: Int64
) -> tuple[Int64, Float64, UInt8]:
    """Return stamps, fields (NaN where the type has none) and `Found` of messages."""
    n = len(start)
    stamp_ns, found = np.empty(n, np.int64), np.empty(n, np.uint8)
    rows = np.full((n, reading.width), np.nan)
    gather(data, start, end, by, reading.joint, stamp_ns, rows, found)
    return stamp_ns, rows, found


def _pair(first: Float64 | float, second: Float64 | float, n: int) -> Float64:
    columns = np.empty((n, 2))
    columns[:, 0], columns[:, 1] = first, second
    return columns


def _scalar(rows: Float64) -> tuple[Float64, Float64]:
    n = len(rows)
    return _pair(rows[:, 0], 0.0, n), _pair(rows[:, 1], np.nan, n)


def _plane(rows: Float64) -> tuple[Float64, Float64]:
    return rows[:, 0:2].copy(), rows[:, 2:4].copy()


def _fix(rows: Float64) -> tuple[Float64, Float64]:
    """Return latitude and longitude; NaN where there is no fix."""
    value, variance = _plane(rows)
    status, covariance_type = rows[:, 4], rows[:, 5]
    variance[covariance_type == _FIX.COVARIANCE_TYPE_UNKNOWN] = np.nan
    value[status < _FIX_STATUS.STATUS_FIX] = np.nan
    variance[status < _FIX_STATUS.STATUS_FIX] = np.nan
    return value, variance


def _magnitude(rows: Float64) -> tuple[Float64, Float64]:
    """
    Return length of a vector and its variance, to first order.

    Without a direction, at rest, the larger of the two variances.
    """
    x, y, variance_x, variance_y, covariance = rows.T
    speed = np.hypot(x, y)
    with np.errstate(divide='ignore', over='ignore', invalid='ignore'):
        c = x / speed
        s = y / speed
        along = c * c * variance_x + s * s * variance_y + 2.0 * c * s * covariance
    variance = np.where(speed > 0.0, along, np.maximum(variance_x, variance_y))
    # one negative variance says "unknown" for both
    known = np.where((variance_x < 0.0) | (variance_y < 0.0), np.nan, variance)
    return _pair(speed, 0.0, len(rows)), _pair(known, np.nan, len(rows))


def _yaw(rows: Float64) -> tuple[Float64, Float64]:
    """Return yaw [rad] of x, y, z, w; NaN where that is no rotation."""
    x, y, z, w, variance = rows[:, :5].T
    with np.errstate(over='ignore', invalid='ignore'):
        norm = x * x + y * y + z * z + w * w
        yaw = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    yaw = np.where(np.abs(norm - 1.0) <= QUATERNION_TOLERANCE, yaw, np.nan)
    return _pair(yaw, 0.0, len(rows)), _pair(variance, np.nan, len(rows))


def _imu(rows: Float64) -> tuple[Float64, Float64]:
    value, variance = _yaw(rows)
    none = rows[:, 5] == -1.0  # sensor_msgs/Imu: there is no orientation
    value[none, 0] = variance[none, 0] = np.nan
    return value, variance


_FIX = types.class_of(types.NAV_SAT_FIX)
_FIX_STATUS = types.class_of('sensor_msgs/msg/NavSatStatus')
_UNREADABLE = {Found.MALFORMED: Unreadable.MALFORMED, Found.NO_JOINT: Unreadable.NO_JOINT}


def _reading(
    channel: Channel,
    type_name: str,
    columns: Callable[[Float64], tuple[Float64, Float64]],
    *fields: str,
    joint: bytes = b'',
    older: str | None = None,
) -> tuple[Source, _Reading]:
    """Pair a source with how it is read; '' is a column that the type does not have."""
    reading = _Reading(
        channel,
        len(fields),
        steps(type_name, fields),
        columns,
        np.frombuffer(joint, np.uint8),
        None if older is None else steps(older, [each for each in fields if each != 'variance']),
    )
    return Source(channel.input, type_name), reading


_POSE = (
    'pose.pose.position.x',
    'pose.pose.position.y',
    'pose.covariance[0]',
    'pose.covariance[7]',
)
_LINEAR = ('twist.twist.linear.x', 'twist.twist.linear.y')
_COVARIANCE = ('twist.covariance[0]', 'twist.covariance[7]', 'twist.covariance[1]')
_ROTATION = ('x', 'y', 'z', 'w')

_READINGS: dict[Source, _Reading] = dict(
    (
        _reading(
            Channel.SPEED_THROUGH_WATER,
            types.TWIST_WITH_COVARIANCE,
            _scalar,
            _LINEAR[0],
            _COVARIANCE[0],
        ),
        _reading(Channel.SPEED_THROUGH_WATER, types.TWIST, _scalar, 'twist.linear.x', ''),
        _reading(
            Channel.SPEED_OVER_GROUND,
            types.TWIST_WITH_COVARIANCE,
            _magnitude,
            *_LINEAR,
            *_COVARIANCE,
        ),
        _reading(
            Channel.SPEED_OVER_GROUND,
            types.TWIST,
            _magnitude,
            'twist.linear.x',
            'twist.linear.y',
            *('', '', ''),
        ),
        _reading(Channel.POSITION, types.POSE_WITH_COVARIANCE, _plane, *_POSE),
        _reading(Channel.POSITION, types.ODOMETRY, _plane, *_POSE),
        _reading(
            Channel.POSITION, types.POSE, _plane, 'pose.position.x', 'pose.position.y', '', ''
        ),
        _reading(Channel.POSITION, types.POINT, _plane, 'point.x', 'point.y', '', ''),
        _reading(
            Channel.POSITION_GEODETIC,
            types.NAV_SAT_FIX,
            _fix,
            'latitude',
            'longitude',
            'position_covariance[4]',  # the covariance is in east, north, up
            'position_covariance[0]',
            'status.status',
            'position_covariance_type',
        ),
        _reading(
            Channel.HEADING,
            types.QUATERNION,
            _yaw,
            *(f'quaternion.{each}' for each in _ROTATION),
            '',
        ),
        _reading(
            Channel.HEADING,
            types.IMU,
            _imu,
            *(f'orientation.{each}' for each in _ROTATION),
            'orientation_covariance[8]',
            'orientation_covariance[0]',
        ),
        _reading(Channel.SHAFT, types.JOINT_STATE, _scalar, 'velocity', '', joint=b'shaft'),
        _reading(Channel.RUDDER, types.JOINT_STATE, _scalar, 'position', '', joint=b'rudder'),
        _reading(
            Channel.WIND_APPARENT,
            types.TWIST,
            _plane,
            'twist.linear.x',
            'twist.linear.y',
            *('', ''),
        ),
        _reading(
            Channel.DEPTH,
            types.RANGE,
            _scalar,
            'range',
            'variance',
            older=types.RANGE_BEFORE_IRON,
        ),
    )
)
