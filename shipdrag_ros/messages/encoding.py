# SPDX-License-Identifier: Apache-2.0
"""
Blocks to CDR bytes: how samples of simulations, logs and NMEA become messages.

The inverse of `decode` for one type an input. A variance that the type cannot
carry is dropped; one that is unknown is sent as 0. Each shaft and each pitch has a
message of its own. All messages of a channel have one layout: its bytes are made
once, and numbers and times are filled in.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from math import cos, isnan, nan, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.messages import types
from shipdrag_ros.samples import PITCHES, SECOND_NS, SHAFTS, Block, Channel, Float64, Int64, UInt8

SentNumbers = tuple[NDArray[Any], ...]

_VEHICLE_FRAME = 'base_link'
_EARTH_FRAME = 'map'
_STAMP = 'iI'
# stand for the numbers of a message until its layout is known
_MARKS: dict[str, tuple[float, ...]] = {
    'd': tuple(1e-200 * k for k in range(1, 5)),
    'f': tuple(2.0**-k for k in range(60, 64)),
    'B': (0xA7,),
}


@dataclass(frozen=True)
class EncodedMessage:
    """An input message, ready to be written or published."""

    topic: str
    type: str
    payload: bytes
    log_ns: int
    publish_ns: int


class EncodedBatch(NamedTuple):
    """
    The messages of a block in one buffer.

    Attributes
    ----------
    data : (b,) uint8
        The buffer.
    start, end : (n,) int64
        Where each message lies in it, in the order of the block.
    """

    data: UInt8
    start: Int64
    end: Int64


def input_type(channel: Channel) -> str:
    """
    Return the type that samples of a channel are encoded in.
    """
    return _ENCODERS[channel].type


def encode(block: Block, *, namespace: str = '') -> Iterator[EncodedMessage]:
    """
    Turn samples into messages, in the order of the block.

    Parameters
    ----------
    block
        Samples; their receive time becomes the log time.
    namespace
        Put before the name of the input, `/ship` for instance.

    Returns
    -------
    iterator of EncodedMessage
        One a sample: topic, type, CDR bytes, log time and stamp [ns].

    Raises
    ------
    KeyError
        If a channel has no message type.
    ValueError
        If a stamp is beyond what a message can hold.

    Notes
    -----
    Source: ROS 2 message definitions, CDR little endian as in OMG DDS-XTypes.

    Examples
    --------
    >>> from shipdrag_ros.messages import encode
    >>> from shipdrag_ros.samples import Block, Channel
    >>> block = Block.of(Channel.SPEED_THROUGH_WATER, [0], [6.0])
    >>> message = next(encode(block))
    >>> message.topic, message.type
    ('/speed_through_water', 'geometry_msgs/msg/TwistWithCovarianceStamped')
    """
    batch = encode_batch(block)
    data = batch.data.tobytes()
    named = {
        code: (f'{namespace}/{Channel(code).input}', input_type(Channel(code)))
        for code in np.unique(block.channel).tolist()
    }
    for code, start, end, received, stamp in zip(
        block.channel.tolist(),
        batch.start.tolist(),
        batch.end.tolist(),
        block.receive_ns.tolist(),
        block.stamp_ns.tolist(),
        strict=True,
    ):
        yield EncodedMessage(*named[code], data[start:end], received, stamp)


def encode_batch(block: Block) -> EncodedBatch:
    """
    Turn samples into messages, all in one buffer.

    Raises
    ------
    KeyError, ValueError
        As `encode`.
    """
    start, end = np.empty(len(block), np.int64), np.empty(len(block), np.int64)
    parts, size = [np.empty(0, np.uint8)], 0
    for code in np.unique(block.channel).tolist():
        place = np.flatnonzero(block.channel == code)
        rows = _rows(Channel(code), block[place])
        start[place] = size + len(rows[0]) * np.arange(len(place))
        end[place] = start[place] + len(rows[0])
        size += rows.size
        parts.append(rows.reshape(-1))
    return EncodedBatch(np.concatenate(parts), start, end)


def _rows(channel: Channel, block: Block) -> NDArray[np.uint8]:
    """Return the messages of a channel, (n, bytes of one)."""
    payload, layout = _template(channel)
    rows = np.empty((len(block), len(payload)), np.uint8)
    rows[:] = np.frombuffer(payload, np.uint8)
    fields = rows.view(layout)[:, 0]
    seconds, nanoseconds = np.divmod(block.stamp_ns, SECOND_NS)
    if (seconds != seconds.astype(np.int32)).any():
        raise ValueError('a stamp is beyond what a message can hold, 1901 to 2038')
    numbers = _ENCODERS[channel].numbers(block.value, block.variance)
    for name, column in zip(layout.names or (), (seconds, nanoseconds, *numbers), strict=True):
        fields[name] = column
    return rows


@cache
def _template(channel: Channel) -> tuple[bytes, np.dtype[Any]]:
    """Return the bytes of a message of a channel, and where its time and numbers lie."""
    encoder = _ENCODERS[channel]
    marks = [
        _MARKS[form][encoder.forms[:place].count(form)] for place, form in enumerate(encoder.forms)
    ]
    payload = types.serialize(encoder.type, encoder.build(0, *marks))
    places = [types.ENCAPSULATION_BYTES, types.ENCAPSULATION_BYTES + 4]
    for form, mark in zip(encoder.forms, marks, strict=True):
        number = struct.pack(f'<{form}', mark)
        places.append(payload.index(number))
    layout = np.dtype(
        {
            'names': [f'{place}' for place in range(len(places))],
            'formats': [f'<{form}' if form != 'I' else '<u4' for form in _STAMP + encoder.forms],
            'offsets': places,
            'itemsize': len(payload),
        }
    )
    return payload, layout


def vector3(x: float, y: float) -> Any:
    """
    Build a geometry_msgs/Vector3 in the plane.
    """
    return types.make('geometry_msgs/msg/Vector3', x=x, y=y, z=0.0)


def covariance6(variance_x: float, variance_y: float = nan) -> Any:
    """
    Build a 6x6 covariance from two variances; unknown ones become 0.
    """
    matrix = np.zeros(36)
    matrix[0] = _known(variance_x)
    matrix[7] = _known(variance_y)
    return matrix


def _known(variance: float) -> float:
    return 0.0 if isnan(variance) else variance


def _twist(x: float, y: float) -> Any:
    return types.make('geometry_msgs/msg/Twist', linear=vector3(x, y), angular=vector3(0.0, 0.0))


def _speed(stamp_ns: int, x: float, variance: float) -> Any:
    return types.make(
        types.TWIST_WITH_COVARIANCE,
        header=types.header(stamp_ns, _VEHICLE_FRAME),
        twist=types.make(
            'geometry_msgs/msg/TwistWithCovariance',
            twist=_twist(x, 0.0),
            covariance=covariance6(variance),
        ),
    )


def _position(stamp_ns: int, x: float, y: float, *variances: float) -> Any:
    pose = types.make(
        'geometry_msgs/msg/Pose',
        position=types.make('geometry_msgs/msg/Point', x=x, y=y, z=0.0),
        orientation=_quaternion(0.0, 1.0),
    )
    return types.make(
        types.POSE_WITH_COVARIANCE,
        header=types.header(stamp_ns, _EARTH_FRAME),
        pose=types.make(
            'geometry_msgs/msg/PoseWithCovariance', pose=pose, covariance=covariance6(*variances)
        ),
    )


def _fix(stamp_ns: int, latitude: float, longitude: float, *more: float) -> Any:
    north, east, kind = more
    covariance = np.zeros(9)
    covariance[0], covariance[4] = east, north
    status = types.class_of('sensor_msgs/msg/NavSatStatus')
    return types.make(
        types.NAV_SAT_FIX,
        header=types.header(stamp_ns, _VEHICLE_FRAME),
        status=status(status=status.STATUS_FIX, service=status.SERVICE_UNKNOWN),
        latitude=latitude,
        longitude=longitude,
        altitude=nan,
        position_covariance=covariance,
        position_covariance_type=kind,
    )


def _quaternion(z: float, w: float) -> Any:
    return types.make('geometry_msgs/msg/Quaternion', x=0.0, y=0.0, z=z, w=w)


def _heading(stamp_ns: int, z: float, w: float) -> Any:
    return types.make(
        types.QUATERNION,
        header=types.header(stamp_ns, _VEHICLE_FRAME),
        quaternion=_quaternion(z, w),
    )


def _joint(name: str, *, moves: bool, stamp_ns: int, value: float) -> Any:
    return types.make(
        types.JOINT_STATE,
        header=types.header(stamp_ns, ''),
        name=[name],
        position=np.array([nan if moves else value]),
        velocity=np.array([value if moves else nan]),
        effort=np.empty(0),
    )


def _wind(stamp_ns: int, x: float, y: float) -> Any:
    return types.make(
        types.TWIST, header=types.header(stamp_ns, _VEHICLE_FRAME), twist=_twist(x, y)
    )


def _depth(stamp_ns: int, depth_m: float, variance: float) -> Any:
    return types.make(
        types.RANGE,
        header=types.header(stamp_ns, _VEHICLE_FRAME),
        radiation_type=types.class_of(types.RANGE).ULTRASOUND,
        field_of_view=0.0,
        min_range=0.0,
        max_range=float('inf'),
        range=depth_m,
        variance=variance,
    )


# the numbers that a message holds, of (n, 2) values and variances


def _one(value: Float64, variance: Float64) -> SentNumbers:
    return (value[:, 0],)


def _two(value: Float64, variance: Float64) -> SentNumbers:
    return value[:, 0], value[:, 1]


def _one_known(value: Float64, variance: Float64) -> SentNumbers:
    return value[:, 0], _zero(variance[:, 0])


def _two_known(value: Float64, variance: Float64) -> SentNumbers:
    return *_two(value, variance), _zero(variance[:, 0]), _zero(variance[:, 1])


def _fix_numbers(value: Float64, variance: Float64) -> SentNumbers:
    fix = types.class_of(types.NAV_SAT_FIX)
    known = _zero(variance).any(axis=1)
    kind = np.where(known, fix.COVARIANCE_TYPE_DIAGONAL_KNOWN, fix.COVARIANCE_TYPE_UNKNOWN)
    return *_two_known(value, variance), kind


def _half_angle(value: Float64, variance: Float64) -> SentNumbers:
    # of the C library, whose last bit is the same for one and for many
    half = (0.5 * value[:, 0]).tolist()
    return np.array([*map(sin, half)]), np.array([*map(cos, half)])


def _float32(value: Float64, variance: Float64) -> SentNumbers:
    with np.errstate(over='ignore'):  # too large for float32: infinite, and rejected as such
        depth, known = _one_known(value, variance)
        return depth.astype(np.float32), known.astype(np.float32)


def _zero(variance: Float64) -> Float64:
    return np.where(np.isnan(variance), 0.0, variance)


class _Encoder(NamedTuple):
    """
    How samples of a channel become messages.

    Attributes
    ----------
    type
    build
        Makes the message of a stamp and of the numbers it holds.
    forms
        Of these numbers, as `struct` writes them.
    numbers
        The numbers, (n,) each, of (n, 2) values and variances.
    """

    type: str
    build: Callable[..., Any]
    forms: str
    numbers: Callable[[Float64, Float64], SentNumbers]


def _of_joint(name: str, *, moves: bool) -> _Encoder:
    def build(stamp_ns: int, value: float) -> Any:
        return _joint(name, moves=moves, stamp_ns=stamp_ns, value=value)

    return _Encoder(types.JOINT_STATE, build, 'd', _one)


_ENCODERS: dict[Channel, _Encoder] = {
    Channel.SPEED_THROUGH_WATER: _Encoder(types.TWIST_WITH_COVARIANCE, _speed, 'dd', _one_known),
    Channel.SPEED_OVER_GROUND: _Encoder(types.TWIST_WITH_COVARIANCE, _speed, 'dd', _one_known),
    Channel.POSITION: _Encoder(types.POSE_WITH_COVARIANCE, _position, 'dddd', _two_known),
    Channel.POSITION_GEODETIC: _Encoder(types.NAV_SAT_FIX, _fix, 'ddddB', _fix_numbers),
    Channel.HEADING: _Encoder(types.QUATERNION, _heading, 'dd', _half_angle),
    **{each: _of_joint(each.name.lower(), moves=True) for each in SHAFTS},
    **{each: _of_joint(each.name.lower(), moves=False) for each in PITCHES},
    Channel.RUDDER: _of_joint('rudder', moves=False),
    Channel.WIND_APPARENT: _Encoder(types.TWIST, _wind, 'dd', _two),
    Channel.DEPTH: _Encoder(types.RANGE, _depth, 'ff', _float32),
}
