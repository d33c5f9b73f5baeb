# SPDX-License-Identifier: Apache-2.0
"""
CDR bytes to blocks, the same for one live message and for a bag's thousands.

Whatever is computed from a message is computed on float64 arrays, so that a
message alone and the same message in a batch agree to the last bit.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial
from math import nan
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shipdrag_ros.messages import types
from shipdrag_ros.messages.topics import Source
from shipdrag_ros.samples import Block, Channel, Float64

# what is taken from a message: up to four numbers and a covariance, or two
# numbers, their variances and their covariance
Row = tuple[float, float, float, float, float]

# a quaternion whose squared norm is further from 1 is no rotation
QUATERNION_TOLERANCE = 0.1


class Unreadable(Enum):
    """Why a message gave no sample."""

    MALFORMED = 'malformed'
    NO_JOINT = 'no_joint'  # a JointState without the joint, or without its value


class _NoJoint(Exception):
    pass


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
    channel, read = _READERS[source]
    rows: list[Row] = []
    stamps: list[int] = []
    kept: list[int] = []
    unreadable: Counter[Unreadable] = Counter()
    for index, payload in enumerate(payloads):
        try:
            message = types.deserialize(source.type, payload)
            row = read(message)
        except types.MalformedMessage:
            unreadable[Unreadable.MALFORMED] += 1
        except _NoJoint:
            unreadable[Unreadable.NO_JOINT] += 1
        else:
            rows.append(row)
            stamps.append(types.stamp_ns(message))
            kept.append(index)
    places = np.array(kept, np.intp)
    value, variance = _columns(channel, np.array(rows, np.float64).reshape(-1, 5))
    variance[~((variance > 0) & (variance < np.inf))] = np.nan
    block = Block(
        np.full(len(rows), channel, np.uint8),
        np.array(stamps, np.int64),
        np.atleast_1d(np.asarray(receive_ns, np.int64))[places],
        value,
        variance,
    )
    return Decoded(block, places, unreadable)


def _columns(channel: Channel, rows: Float64) -> tuple[Float64, Float64]:
    """Return value and variance, (n, 2) each, of the rows read."""
    value = rows[:, 0:2].copy()
    variance = rows[:, 2:4].copy()
    if channel is Channel.SPEED_OVER_GROUND:
        value[:, 0], variance[:, 0] = _magnitude(rows)
    elif channel is Channel.HEADING:
        value[:, 0] = _yaw(rows[:, 0:4])
        variance[:, 0] = rows[:, 4]
    elif channel in (Channel.POSITION, Channel.POSITION_GEODETIC, Channel.WIND_APPARENT):
        return value, variance
    value[:, 1] = 0.0
    variance[:, 1] = np.nan
    return value, variance


def _magnitude(rows: Float64) -> tuple[Float64, Float64]:
    """
    Return length of a vector and its variance, to first order.

    Without a direction, at rest, the larger of the two variances.
    """
    x, y, variance_x, variance_y, covariance = rows.T
    speed = np.hypot(x, y)
    with np.errstate(divide='ignore', invalid='ignore'):
        c = x / speed
        s = y / speed
        along = c * c * variance_x + s * s * variance_y + 2.0 * c * s * covariance
    variance = np.where(speed > 0.0, along, np.maximum(variance_x, variance_y))
    # one negative variance says "unknown" for both
    return speed, np.where((variance_x < 0.0) | (variance_y < 0.0), np.nan, variance)


def _yaw(quaternions: Float64) -> Float64:
    """Return yaw [rad] of (n, 4) x, y, z, w; NaN where that is no rotation."""
    x, y, z, w = quaternions.T
    with np.errstate(over='ignore', invalid='ignore'):
        norm = x * x + y * y + z * z + w * w
        yaw = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return np.where(np.abs(norm - 1.0) <= QUATERNION_TOLERANCE, yaw, np.nan)


def _twist(message: Any) -> Row:
    linear = message.twist.linear
    return linear.x, linear.y, nan, nan, nan


def _twist_with_covariance(message: Any) -> Row:
    linear = message.twist.twist.linear
    covariance = message.twist.covariance
    return linear.x, linear.y, covariance[0], covariance[7], covariance[1]


def _pose(message: Any) -> Row:
    position = message.pose.position
    return position.x, position.y, nan, nan, nan


def _pose_with_covariance(message: Any) -> Row:
    position = message.pose.pose.position
    covariance = message.pose.covariance
    return position.x, position.y, covariance[0], covariance[7], nan


def _point(message: Any) -> Row:
    return message.point.x, message.point.y, nan, nan, nan


def _fix(message: Any) -> Row:
    if message.status.status < message.status.STATUS_FIX:
        return nan, nan, nan, nan, nan
    if message.position_covariance_type == message.COVARIANCE_TYPE_UNKNOWN:
        return message.latitude, message.longitude, nan, nan, nan
    # the covariance is in east, north, up
    covariance = message.position_covariance
    return message.latitude, message.longitude, covariance[4], covariance[0], nan


def _quaternion(message: Any) -> Row:
    q = message.quaternion
    return q.x, q.y, q.z, q.w, nan


def _imu(message: Any) -> Row:
    covariance = message.orientation_covariance
    if covariance[0] == -1.0:  # sensor_msgs/Imu: there is no orientation
        return nan, nan, nan, nan, nan
    q = message.orientation
    return q.x, q.y, q.z, q.w, covariance[8]


def _joint(message: Any, *, name: str, field: str) -> Row:
    values = getattr(message, field)
    if name not in message.name or message.name.index(name) >= len(values):
        raise _NoJoint
    return values[message.name.index(name)], 0.0, nan, nan, nan


def _range(message: Any) -> Row:
    return message.range, 0.0, getattr(message, 'variance', nan), nan, nan


_Reader = Callable[[Any], Row]
_POSITION_READERS: dict[str, _Reader] = {
    types.POSE_WITH_COVARIANCE: _pose_with_covariance,
    types.POSE: _pose,
    types.POINT: _point,
    types.ODOMETRY: _pose_with_covariance,
}
_READERS: dict[Source, tuple[Channel, _Reader]] = {
    Source('position', type_name): (Channel.POSITION, reader)
    for type_name, reader in _POSITION_READERS.items()
}
_READERS |= {
    Source(channel.input, type_name): (channel, reader)
    for channel in (Channel.SPEED_THROUGH_WATER, Channel.SPEED_OVER_GROUND)
    for type_name, reader in (
        (types.TWIST_WITH_COVARIANCE, _twist_with_covariance),
        (types.TWIST, _twist),
    )
}
_READERS |= {
    Source('position', types.NAV_SAT_FIX): (Channel.POSITION_GEODETIC, _fix),
    Source('heading', types.QUATERNION): (Channel.HEADING, _quaternion),
    Source('heading', types.IMU): (Channel.HEADING, _imu),
    Source('shaft', types.JOINT_STATE): (
        Channel.SHAFT,
        partial(_joint, name='shaft', field='velocity'),
    ),
    Source('rudder', types.JOINT_STATE): (
        Channel.RUDDER,
        partial(_joint, name='rudder', field='position'),
    ),
    Source('wind_apparent', types.TWIST): (Channel.WIND_APPARENT, _twist),
    Source('depth', types.RANGE): (Channel.DEPTH, _range),
}
