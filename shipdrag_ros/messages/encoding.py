# SPDX-License-Identifier: Apache-2.0
"""
Blocks to CDR bytes: how simulated and imported samples become messages.

The inverse of `decode` for one type an input. A variance that the type cannot
carry is dropped; one that is unknown is sent as 0. Each shaft and each pitch has a
message of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import cos, isnan, nan, sin
from typing import Any

import numpy as np

from shipdrag_ros.messages import types
from shipdrag_ros.samples import PITCHES, SHAFTS, Block, Channel

Pair = tuple[float, float]

_VEHICLE_FRAME = 'base_link'
_EARTH_FRAME = 'map'


@dataclass(frozen=True)
class EncodedMessage:
    """An input message, ready to be written or published."""

    topic: str
    type: str
    payload: bytes
    log_ns: int
    publish_ns: int


def input_type(channel: Channel) -> str:
    """
    Return the type that samples of a channel are encoded in.
    """
    return _ENCODERS[channel][0]


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
    for code, stamp, received, value, variance in zip(
        block.channel.tolist(),
        block.stamp_ns.tolist(),
        block.receive_ns.tolist(),
        block.value.tolist(),
        block.variance.tolist(),
        strict=True,
    ):
        channel = Channel(code)
        type_name, build = _ENCODERS[channel]
        yield EncodedMessage(
            f'{namespace}/{channel.input}',
            type_name,
            types.serialize(type_name, build(stamp, tuple(value), tuple(variance))),
            received,
            stamp,
        )


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


def _speed(stamp_ns: int, value: Pair, variance: Pair) -> Any:
    return types.make(
        types.TWIST_WITH_COVARIANCE,
        header=types.header(stamp_ns, _VEHICLE_FRAME),
        twist=types.make(
            'geometry_msgs/msg/TwistWithCovariance',
            twist=_twist(value[0], 0.0),
            covariance=covariance6(variance[0]),
        ),
    )


def _position(stamp_ns: int, value: Pair, variance: Pair) -> Any:
    pose = types.make(
        'geometry_msgs/msg/Pose',
        position=types.make('geometry_msgs/msg/Point', x=value[0], y=value[1], z=0.0),
        orientation=_quaternion(0.0),
    )
    return types.make(
        types.POSE_WITH_COVARIANCE,
        header=types.header(stamp_ns, _EARTH_FRAME),
        pose=types.make(
            'geometry_msgs/msg/PoseWithCovariance', pose=pose, covariance=covariance6(*variance)
        ),
    )


def _fix(stamp_ns: int, value: Pair, variance: Pair) -> Any:
    north, east = variance
    covariance = np.zeros(9)
    covariance[0] = _known(east)
    covariance[4] = _known(north)
    fix = types.class_of(types.NAV_SAT_FIX)
    status = types.class_of('sensor_msgs/msg/NavSatStatus')
    return fix(
        header=types.header(stamp_ns, _VEHICLE_FRAME),
        status=status(status=status.STATUS_FIX, service=status.SERVICE_UNKNOWN),
        latitude=value[0],
        longitude=value[1],
        altitude=nan,
        position_covariance=covariance,
        position_covariance_type=(
            fix.COVARIANCE_TYPE_DIAGONAL_KNOWN if covariance.any() else fix.COVARIANCE_TYPE_UNKNOWN
        ),
    )


def _quaternion(yaw: float) -> Any:
    return types.make(
        'geometry_msgs/msg/Quaternion', x=0.0, y=0.0, z=sin(0.5 * yaw), w=cos(0.5 * yaw)
    )


def _heading(stamp_ns: int, value: Pair, variance: Pair) -> Any:
    return types.make(
        types.QUATERNION,
        header=types.header(stamp_ns, _VEHICLE_FRAME),
        quaternion=_quaternion(value[0]),
    )


def _joint(stamp_ns: int, name: str, *, position: float, velocity: float) -> Any:
    return types.make(
        types.JOINT_STATE,
        header=types.header(stamp_ns, ''),
        name=[name],
        position=np.array([position]),
        velocity=np.array([velocity]),
        effort=np.empty(0),
    )


def _shaft(name: str, stamp_ns: int, value: Pair, variance: Pair) -> Any:
    return _joint(stamp_ns, name, position=nan, velocity=value[0])


def _pitch(name: str, stamp_ns: int, value: Pair, variance: Pair) -> Any:
    return _joint(stamp_ns, name, position=value[0], velocity=nan)


def _rudder(stamp_ns: int, value: Pair, variance: Pair) -> Any:
    return _joint(stamp_ns, 'rudder', position=value[0], velocity=nan)


def _wind(stamp_ns: int, value: Pair, variance: Pair) -> Any:
    return types.make(
        types.TWIST, header=types.header(stamp_ns, _VEHICLE_FRAME), twist=_twist(*value)
    )


def _depth(stamp_ns: int, value: Pair, variance: Pair) -> Any:
    with np.errstate(over='ignore'):  # too large for float32: infinite, and rejected as such
        depth = float(np.float32(value[0]))
        depth_variance = float(np.float32(_known(variance[0])))
    return types.make(
        types.RANGE,
        header=types.header(stamp_ns, _VEHICLE_FRAME),
        radiation_type=types.class_of(types.RANGE).ULTRASOUND,
        field_of_view=0.0,
        min_range=0.0,
        max_range=float('inf'),
        range=depth,
        variance=depth_variance,
    )


_ENCODERS: dict[Channel, tuple[str, Callable[[int, Pair, Pair], Any]]] = {
    Channel.SPEED_THROUGH_WATER: (types.TWIST_WITH_COVARIANCE, _speed),
    Channel.SPEED_OVER_GROUND: (types.TWIST_WITH_COVARIANCE, _speed),
    Channel.POSITION: (types.POSE_WITH_COVARIANCE, _position),
    Channel.POSITION_GEODETIC: (types.NAV_SAT_FIX, _fix),
    Channel.HEADING: (types.QUATERNION, _heading),
    **{each: (types.JOINT_STATE, partial(_shaft, each.name.lower())) for each in SHAFTS},
    **{each: (types.JOINT_STATE, partial(_pitch, each.name.lower())) for each in PITCHES},
    Channel.RUDDER: (types.JOINT_STATE, _rudder),
    Channel.WIND_APPARENT: (types.TWIST, _wind),
    Channel.DEPTH: (types.RANGE, _depth),
}
