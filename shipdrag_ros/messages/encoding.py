# SPDX-License-Identifier: Apache-2.0
"""
Blocks to CDR bytes: how samples of simulations, logs and NMEA become messages.

The inverse of `decode` for one type an input. A variance that the type cannot
carry is dropped; one that is unknown is sent as 0. Each shaft and each pitch has a
message of its own. All messages of a channel have one layout: its bytes are made
once, and numbers and times are filled in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from math import cos, inf, nan, sin
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.messages import types
from shipdrag_ros.messages.decoding import fields_of
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

FieldNumbers = int | Callable[[Float64], Float64]
"""A column of (n, 4) values and variances, 0 where not known, or the (n,) numbers made of them."""
_X, _VARIANCE_X = 0, 2


class EncodedMessage(NamedTuple):
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
    """Return the type that samples of a channel are encoded in."""
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
    fields['seconds'], fields['nanoseconds'] = seconds, nanoseconds
    given = np.hstack((block.value, np.where(np.isnan(block.variance), 0.0, block.variance)))
    with np.errstate(over='ignore'):  # too large for float32: infinite, and rejected as such
        for path, numbers in _ENCODERS[channel].numbers.items():
            fields[path] = given[:, numbers] if isinstance(numbers, int) else numbers(given)
    return rows


@cache
def _template(channel: Channel) -> tuple[bytes, np.dtype[Any]]:
    """Return the bytes of a message of a channel, and where its time and numbers lie."""
    encoder = _ENCODERS[channel]
    constants = {'header': types.header(0, encoder.frame), **encoder.constants}
    payload = types.serialize(encoder.type, types.make(encoder.type, constants))
    number = types.layout_of(encoder.type, payload).number
    paths = {path: path for path in encoder.numbers}
    paths |= {'seconds': 'header.stamp.sec', 'nanoseconds': 'header.stamp.nanosec'}
    forms, offsets = zip(*map(number, paths.values()), strict=True)
    size, names = len(payload), list(paths)
    return payload, np.dtype(
        {'names': names, 'formats': list(forms), 'offsets': list(offsets), 'itemsize': size}
    )


def _kind_of_covariance(given: Float64) -> Float64:
    fix = types.class_of(types.NAV_SAT_FIX)
    known = given[:, _VARIANCE_X:].any(axis=1)
    kinds = fix.COVARIANCE_TYPE_UNKNOWN, fix.COVARIANCE_TYPE_DIAGONAL_KNOWN
    return np.take(np.array(kinds, np.float64), known.astype(np.intp))


# of the C library, whose last bit is the same for one and for many
def _of_half(function: Callable[[float], float]) -> FieldNumbers:
    return lambda given: np.array([*map(function, (0.5 * given[:, _X]).tolist())])


class _Encoder(NamedTuple):
    """
    How samples of a channel become messages.

    Attributes
    ----------
    type
    frame
        In which they are measured.
    numbers
        Of each message, by the path of the field that holds them.
    constants
        The same in all messages, by path; other fields are zero or empty.
    """

    type: str
    frame: str
    numbers: Mapping[str, FieldNumbers]
    constants: Mapping[str, Any] = MappingProxyType({})


def _of_joint(name: str, *, moves: bool) -> _Encoder:
    joint = {'name': [name], 'position': np.array([nan]), 'velocity': np.array([nan])}
    moving = 'velocity[0]' if moves else 'position[0]'
    return _Encoder(types.JOINT_STATE, '', {moving: _X}, joint)


def _as_read(
    channel: Channel, type_name: str, constants: Mapping[str, Any] = MappingProxyType({})
) -> _Encoder:
    """Return how samples become messages of which `decode` reads every field as it is."""
    frame = 'map' if channel is Channel.POSITION else 'base_link'
    return _Encoder(type_name, frame, fields_of(channel, type_name), constants)


_SPEED = _as_read(Channel.SPEED_THROUGH_WATER, types.TWIST_WITH_COVARIANCE)
_FIX = _as_read(Channel.POSITION_GEODETIC, types.NAV_SAT_FIX, {'altitude': nan})
_ENCODERS: dict[Channel, _Encoder] = {
    Channel.SPEED_THROUGH_WATER: _SPEED,
    Channel.SPEED_OVER_GROUND: _SPEED,
    Channel.POSITION: _as_read(
        Channel.POSITION, types.POSE_WITH_COVARIANCE, {'pose.pose.orientation.w': 1.0}
    ),
    # and 0: STATUS_FIX, SERVICE_UNKNOWN
    Channel.POSITION_GEODETIC: _FIX._replace(
        numbers={**_FIX.numbers, 'position_covariance_type': _kind_of_covariance}
    ),
    Channel.HEADING: _Encoder(
        types.QUATERNION,
        'base_link',
        {'quaternion.z': _of_half(sin), 'quaternion.w': _of_half(cos)},
    ),
    **{each: _of_joint(each.name.lower(), moves=True) for each in SHAFTS},
    **{each: _of_joint(each.name.lower(), moves=False) for each in PITCHES},
    Channel.RUDDER: _of_joint('rudder', moves=False),
    Channel.WIND_APPARENT: _as_read(Channel.WIND_APPARENT, types.TWIST),
    # and 0: ULTRASOUND
    Channel.DEPTH: _as_read(Channel.DEPTH, types.RANGE, {'max_range': inf}),
}
_ENCODERS |= {each: _ENCODERS[each.kind] for each in Channel if each.input in FURTHER}
