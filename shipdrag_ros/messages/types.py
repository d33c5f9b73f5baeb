# SPDX-License-Identifier: Apache-2.0
"""
Message types: their names, and the one store that knows their layout.

The store is that of ROS 2 Jazzy and needs no ROS. It also holds the layout of
`sensor_msgs/Range` before Iron, which lacks the variance at its end, so that
older bags are read.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from functools import cache, reduce
from importlib import resources
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError

from shipdrag_ros.samples import SECOND_NS

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

ACCEL_WITH_COVARIANCE = 'geometry_msgs/msg/AccelWithCovarianceStamped'
DIAGNOSTIC_ARRAY = 'diagnostic_msgs/msg/DiagnosticArray'
DVL = 'marine_acoustic_msgs/msg/Dvl'
FLOAT64 = 'std_msgs/msg/Float64'
IMU = 'sensor_msgs/msg/Imu'
JOINT_STATE = 'sensor_msgs/msg/JointState'
NAV_SAT_FIX = 'sensor_msgs/msg/NavSatFix'
ODOMETRY = 'nav_msgs/msg/Odometry'
PATH = 'nav_msgs/msg/Path'
POINT = 'geometry_msgs/msg/PointStamped'
POINT_CLOUD = 'sensor_msgs/msg/PointCloud2'
POSE = 'geometry_msgs/msg/PoseStamped'
POSE_WITH_COVARIANCE = 'geometry_msgs/msg/PoseWithCovarianceStamped'
QUATERNION = 'geometry_msgs/msg/QuaternionStamped'
RANGE = 'sensor_msgs/msg/Range'
STRING = 'std_msgs/msg/String'
TWIST = 'geometry_msgs/msg/TwistStamped'
TWIST_WITH_COVARIANCE = 'geometry_msgs/msg/TwistWithCovarianceStamped'
VELOCITY = 'geometry_msgs/msg/VelocityStamped'

ENCAPSULATION_BYTES = 4
_BIG_ENDIAN = b'\x00\x00'
_LITTLE_ENDIAN = b'\x00\x01'
_ORDERS = {_BIG_ENDIAN: '>', _LITTLE_ENDIAN: '<'}
# Fast DDS counts an alignment to 8 behind each empty sequence of doubles and then writes none, so
# that up to 15 bytes follow a JointState; rosbags' own check would refuse what rclpy sends
PADDING_BYTES = 15
_LENGTH, _CHARACTER = np.dtype('u4'), np.dtype('u1')

_TIME = struct.Struct('iI')  # builtin_interfaces/Time: the first that a header holds

RANGE_BEFORE_IRON = 'shipdrag_ros/msg/RangeBeforeIron'
_FURTHER = {RANGE_BEFORE_IRON: 'RangeBeforeIron.msg', DVL: 'Dvl.msg'}
"""Not of ROS 2 Jazzy itself; what a bag holds is read without its package."""


@cache
def _store() -> Typestore:
    """Return the store, whose layouts take a while to import."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    for name, file in _FURTHER.items():
        text = (resources.files('shipdrag_ros') / 'data' / file).read_text(encoding='utf-8')
        store.register(get_types_from_msg(text, name))
    return store


class Leaf(NamedTuple):
    """
    A number, text, array or sequence at the end of a path through a type.

    `kind` is `float64` or `string` for instance; `length` is None for a sequence.
    """

    path: str
    kind: str
    length: int | None


class MalformedMessage(Exception):
    """Bytes that are not a message of the type they claim to be."""


def class_of(type_name: str) -> Any:
    """Return the class of a message type, for its constants."""
    return _store().types[type_name]


def make(type_name: str, fields: Mapping[str, Any] | None = None, /, **more: Any) -> Any:
    """
    Build a message; what is not given is zero or empty.

    Parameters
    ----------
    type_name
    fields
        By path: `twist.twist.linear.x` or `twist.covariance[7]` for instance.
    more
        The same of fields whose names are paths.
    """
    message = _blank(type_name)
    for path, value in {**(fields or {}), **more}.items():
        *way, last = path.split('.')
        owner = reduce(getattr, way, message)
        name, bracket, place = last.partition('[')
        if bracket:
            getattr(owner, name)[int(place.removesuffix(']'))] = value
        else:
            setattr(owner, name, value)
    return message


def _blank(type_name: str) -> Any:
    """Return a message of zeros, empty texts and empty sequences."""
    fields = _store().fielddefs[type_name][1]
    return class_of(type_name)(**{name: _blank_field(*each) for name, each in fields})


def _blank_field(node: Nodetype, about: Any) -> Any:
    if node is Nodetype.NAME:
        return _blank(about)
    if node is Nodetype.BASE:
        kind = about[0]
        return '' if kind == 'string' else np.dtype(kind).type(0).item()
    (inner, of), length = about
    count = length if node is Nodetype.ARRAY else 0
    if inner is Nodetype.BASE and of[0] != 'string':
        return np.zeros(count, of[0])
    return [_blank_field(inner, of) for _ in range(count)]


def header(stamp_ns: int, frame_id: str) -> Any:
    """Build a std_msgs/Header."""
    seconds, nanoseconds = divmod(int(stamp_ns), SECOND_NS)
    stamp = make('builtin_interfaces/msg/Time', sec=seconds, nanosec=nanoseconds)
    return make('std_msgs/msg/Header', stamp=stamp, frame_id=frame_id)


def stamp_ns(message: Any) -> int:
    """Return the time in the header of a message [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec) * SECOND_NS + int(stamp.nanosec)


def serialize(type_name: str, message: Any) -> bytes:
    """Return the CDR bytes of a message, little endian."""
    return bytes(_store().serialize_cdr(message, type_name, little_endian=True))


def deserialize(type_name: str, payload: bytes) -> Any:
    """
    Return the message in CDR bytes of either byte order.

    Raises
    ------
    MalformedMessage
        If the bytes are not such a message.
    """
    try:
        return _deserialize(type_name, payload)
    except MalformedMessage:
        if type_name != RANGE:
            raise
        return _deserialize(RANGE_BEFORE_IRON, payload)


def _deserialize(type_name: str, payload: bytes) -> Any:
    if payload[:2] not in (_BIG_ENDIAN, _LITTLE_ENDIAN) or len(payload) < ENCAPSULATION_BYTES:
        raise MalformedMessage(f'unknown encapsulation {payload[:2]!r}')
    definition = _store().get_msgdef(type_name)
    little = payload[:2] == _LITTLE_ENDIAN
    read = definition.deserialize_cdr_le if little else definition.deserialize_cdr_be
    body = payload[ENCAPSULATION_BYTES:]
    try:
        message, end = read(body, 0, definition.cls, _store())
    except (SerdeError, struct.error, ValueError) as error:
        raise MalformedMessage(f'not a {type_name}: {error}') from error
    if len(body) - end > PADDING_BYTES:
        raise MalformedMessage(f'not a {type_name}: {len(body) - end} bytes too long')
    return message


def leaves(type_name: str, path: str = '') -> Iterator[Leaf]:
    """Yield the fields of a type in their order, those of its fields in their place."""
    for name, (node, about) in _store().fielddefs[type_name][1]:
        match node:
            case Nodetype.NAME:
                yield from leaves(about, f'{path}{name}.')
            case Nodetype.BASE:
                yield Leaf(path + name, about[0], 1)
            case Nodetype.ARRAY if about[0][0] is Nodetype.NAME:
                (_, kind), length = about
                for i in range(length):
                    yield from leaves(kind, f'{path}{name}[{i}].')
            case _:  # the element, a number or text, and how many
                (_, (kind, _)), length = about
                yield Leaf(path + name, kind, length if node is Nodetype.ARRAY else None)


class MessageLayout(NamedTuple):
    """
    Where the parts of a message lie in its bytes.

    Attributes
    ----------
    arrays
        Form for numpy, first byte and count of numbers, by path.
    texts
        By path.
    fixed : (k,) intp
        Bytes of lengths and texts: a message of the same size with the same ones lies alike.
    """

    arrays: dict[str, tuple[np.dtype[Any], int, int]]
    texts: dict[str, list[str]]
    fixed: NDArray[np.intp]

    def number(self, path: str) -> tuple[np.dtype[Any], int]:
        """Return form and place of a number, `twist.linear.x` or `covariance[7]` for instance."""
        name, bracket, which = path.partition('[')
        form, first, count = self.arrays[name]
        index = int(which.removesuffix(']')) if bracket else 0
        if index >= count:
            raise KeyError(path)
        return form, first + form.itemsize * index


@cache
def _leaves(type_name: str) -> tuple[Leaf, ...]:
    return tuple(leaves(type_name))


def layout_of(type_name: str, payload: bytes) -> MessageLayout:
    """
    Find where the parts of a message lie in CDR bytes of either byte order.

    Raises
    ------
    MalformedMessage
        If the bytes are not such a message.
    """
    order = _ORDERS.get(payload[:2], '')
    if not order or len(payload) < ENCAPSULATION_BYTES:
        raise MalformedMessage(f'unknown encapsulation {payload[:2]!r}')
    body, at = payload[ENCAPSULATION_BYTES:], 0
    arrays: dict[str, tuple[np.dtype[Any], int, int]] = {}
    texts: dict[str, list[str]] = {}
    fixed = np.zeros(len(payload), np.bool_)
    fixed[: len(_BIG_ENDIAN)] = True

    def taken(count: int, form: np.dtype[Any], *, fixes: bool = False) -> int:
        """Return where so many numbers or characters lie, behind what was taken before."""
        nonlocal at
        first = -(-at // form.itemsize) * form.itemsize if count else at
        at = first + form.itemsize * count
        if at > len(body):
            raise MalformedMessage(f'not a {type_name}: it ends too early')
        fixed[ENCAPSULATION_BYTES + first : ENCAPSULATION_BYTES + at] = fixes
        return first

    def length() -> int:
        first = taken(1, _LENGTH, fixes=True)
        return int.from_bytes(body[first:at], 'big' if order == '>' else 'little')

    for path, kind, many in _leaves(type_name):
        count = length() if many is None else many
        if kind != 'string':
            form = np.dtype(f'{order}{np.dtype(kind).str[1:]}')
            arrays[path] = form, ENCAPSULATION_BYTES + taken(count, form), count
            continue
        for _ in range(count):
            text = body[taken(length(), _CHARACTER, fixes=True) : at]
            try:
                if text[-1:] != b'\0':
                    raise ValueError('a text without an end')
                texts.setdefault(path, []).append(text[:-1].decode())
            except ValueError as error:
                raise MalformedMessage(f'not a {type_name}: {error}') from error
    if len(body) - at > PADDING_BYTES:
        raise MalformedMessage(f'not a {type_name}: {len(body) - at} bytes too long')
    return MessageLayout(arrays, texts, np.flatnonzero(fixed))


def definition(type_name: str) -> str:
    """Return the full `ros2msg` text of a type, dependencies included."""
    return str(_store().generate_msgdef(type_name, ros_version=2)[0])


def type_hash(type_name: str) -> str:
    """Return the RIHS01 hash by which ROS 2 knows definitions."""
    return str(_store().hash_rihs01(type_name))


def is_stamped(type_name: str) -> bool:
    """Say whether a type begins with a header, which holds the time of measurement."""
    return any(name == 'header' for name, _ in _store().fielddefs[type_name][1][:1])


def from_ros1(type_name: str, payload: bytes) -> bytes:
    """
    Return the CDR bytes of a message of ROS 1.

    Raises
    ------
    MalformedMessage
        If it is none of this type.
    """
    name = RANGE_BEFORE_IRON if type_name == RANGE else type_name
    try:
        return bytes(_store().ros1_to_cdr(payload, name))
    except Exception as error:  # the code that is generated for a type raises what it happens to
        raise MalformedMessage(f'{type(error).__name__}: {error}') from error


def stated_stamp_ns(type_name: str, payload: bytes, arrival_ns: int) -> int:
    """
    Return the time that CDR bytes state, without looking at the rest of them.

    Parameters
    ----------
    arrival_ns
        For a type that holds no time, and for bytes that are too short [ns].
    """
    if not is_stamped(type_name) or len(payload) < ENCAPSULATION_BYTES + _TIME.size:
        return arrival_ns
    order = '<' if payload[:2] == _LITTLE_ENDIAN else '>'
    seconds, nanoseconds = struct.unpack_from(order + _TIME.format, payload, ENCAPSULATION_BYTES)
    return int(seconds * SECOND_NS + nanoseconds)


def is_known(type_name: str) -> bool:
    """Say whether the store has a definition of this type."""
    return type_name in _store().fielddefs
