# SPDX-License-Identifier: Apache-2.0
"""The reading of CDR against two other readers, on random messages and bytes."""

from __future__ import annotations

import importlib
import math
from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.messages import TOPICS, MalformedMessage, Source, Unreadable, decode, types
from shipdrag_ros.messages.decoding import decode_batch
from shipdrag_ros.samples import FURTHER, Channel, concatenate
from tests.messages.conftest import broken, reference

SOURCES = [
    Source(name, type_name)
    for name, accepted in TOPICS.items()
    for type_name in accepted
    if name != 'shaft'  # of one message several samples: test_joints.py
]
IDS = [f'{source.input}-{source.type.split("/")[2]}' for source in SOURCES]
# a further instrument is read as the first of its kind
FIRST = [source for source in SOURCES if source.input not in FURTHER]
each_source = pytest.mark.parametrize('source', FIRST)
EXAMPLES = settings(max_examples=25, deadline=None)

frames = st.text(st.characters(codec='utf-8', exclude_characters='\0'), max_size=12)
stamps = st.integers(-(2**31) * 10**9, (2**31 - 1) * 10**9 + 999_999_999)
eight = st.lists(st.floats(width=32), min_size=8, max_size=8)
numbers = st.lists(st.floats(), max_size=3)
names = st.lists(st.sampled_from(['rudder', 'rudde', 'rudder ', '', 'ü']), max_size=4)


def fields(source: Source, message: Any) -> list[float] | None:
    """Take value and variance from a message of any library; None without the joint."""
    nan = math.nan
    source = Source(FURTHER.get(source.input, source.input), source.type)
    match source.type.split('/')[2]:
        case 'TwistWithCovarianceStamped':
            linear, covariance = message.twist.twist.linear, message.twist.covariance
            taken = [linear.x, linear.y, covariance[0], covariance[7], covariance[1]]
        case 'TwistStamped':
            taken = [message.twist.linear.x, message.twist.linear.y, nan, nan, nan]
        case 'VelocityStamped':
            taken = [message.velocity.linear.x, message.velocity.linear.y, nan, nan, nan]
        case 'Dvl':
            at, covariance = message.velocity, message.velocity_covar
            over_water = source.input == 'speed_through_water'
            right = (message.velocity_mode == 2) is over_water
            taken = [at.x, at.y, covariance[0], covariance[4], covariance[1]]
            if not right:
                taken = [nan] * 5
        case 'Odometry' if source.input != 'position':
            linear, covariance = message.twist.twist.linear, message.twist.covariance
            taken = [linear.x, linear.y, covariance[0], covariance[7], covariance[1]]
        case 'PoseWithCovarianceStamped' | 'Odometry':
            at, covariance = message.pose.pose.position, message.pose.covariance
            taken = [at.x, at.y, covariance[0], covariance[7]]
        case 'PoseStamped' if source.input == 'position':
            taken = [message.pose.position.x, message.pose.position.y, nan, nan]
        case 'PointStamped':
            taken = [message.point.x, message.point.y, nan, nan]
        case 'NavSatFix':
            covariance = message.position_covariance
            taken = [message.latitude, message.longitude, covariance[4], covariance[0]]
        case 'QuaternionStamped' | 'Imu' | 'PoseStamped' as name:
            holder = message.pose if name == 'PoseStamped' else message
            q = holder.quaternion if name == 'QuaternionStamped' else holder.orientation
            yaw = nan
            with np.errstate(all='ignore'):
                x, y, z, w = (np.float64(c) for c in (q.x, q.y, q.z, q.w))
                if abs(x * x + y * y + z * z + w * w - 1) <= 0.1:
                    yaw = math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
            variance = nan
            if name == 'Imu':
                variance = message.orientation_covariance[8]
                if message.orientation_covariance[0] == -1:
                    yaw = variance = nan
            taken = [yaw, 0.0, variance, nan]
        case 'JointState':
            if 'rudder' not in message.name:
                return None
            joint = message.name.index('rudder')
            if joint >= len(message.position):
                return None
            taken = [message.position[joint], 0.0, nan, nan]
        case 'Float64':
            finite = math.isfinite(message.data)
            yaw_deg = (270.0 - message.data) % 360.0 - 180.0 if finite else nan
            taken = [math.radians(yaw_deg), 0.0, nan, nan]
        case 'Range':
            taken = [message.range, 0.0, message.variance, nan]
    if source.input == 'speed_through_water':
        taken = [taken[0], 0.0, taken[2], nan]
    if source.input == 'speed_over_ground':
        x, y, xx, yy, xy = taken
        taken = [math.hypot(x, y), 0.0, nan, nan]
        if not (xx < 0 or yy < 0 or math.isnan(xx) or math.isnan(yy)) and taken[0] == 0:
            taken[2] = max(xx, yy)
        elif not (xx < 0 or yy < 0):
            with np.errstate(all='ignore'):
                c, s = np.float64(x) / taken[0], np.float64(y) / taken[0]
                taken[2] = float(c * c * xx + s * s * yy + 2 * c * s * xy)
    return taken[:2] + [v if 0 < v < math.inf else nan for v in taken[2:4]]


def agree(source: Source, payload: bytes, message: Any) -> None:
    decoded = decode(source, [payload], [5])
    expected = fields(source, message)
    if expected is None:
        assert decoded.unreadable == {Unreadable.NO_JOINT: 1}
        return
    assert not decoded.unreadable
    block = decoded.block
    stamp_ns = 5  # of arrival, if nothing is stated
    if types.is_stamped(source.type):
        stamp = message.header.stamp
        stamp_ns = stamp.sec * 10**9 + stamp.nanosec
    assert block.stamp_ns.tolist() == [stamp_ns]
    assert types.stated_stamp_ns(source.type, payload, 5) == stamp_ns
    assert [Channel(code).input for code in block.channel] == [source.input]
    found = [*block.value[0].tolist(), *block.variance[0].tolist()]
    if FURTHER.get(source.input, source.input) in (
        'heading',
        'speed_over_ground',
    ):  # numpy's functions against libm's
        np.testing.assert_allclose(found, expected, rtol=1e-14, atol=0)
    else:
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize('source', SOURCES, ids=IDS)
@pytest.mark.parametrize('little', [True, False])
def test_a_rotation_and_plain_numbers(source: Source, little: bool) -> None:
    numbers = [0.1, 0.2, 0.3, math.sqrt(1 - 0.14), 0.5, 0.6, 0.7, 0.8]
    message = reference.message(source.type, 10**18 + 7, 'a frame', numbers)
    agree(source, reference.serialize(source.type, message, little_endian=little), message)
    over_water = 'Dvl' in source.type and source.input.startswith('speed_over_ground')
    assert math.isnan(fields(source, message)[0]) is over_water


@each_source
@EXAMPLES
@given(data=st.data(), stamp_ns=stamps, frame=frames, values=eight, little=st.booleans())
def test_fields_agree_with_rosbags_and_rclpy(source, data, stamp_ns, frame, values, little):
    message = reference.message(source.type, stamp_ns, frame, values)
    if 'JointState' in source.type:
        message = reference.make(
            source.type,
            header=message.header,
            name=data.draw(names),
            **{name: np.array(data.draw(numbers)) for name in ('position', 'velocity', 'effort')},
        )
    payload = reference.serialize(source.type, message, little_endian=little)
    agree(source, payload, reference.deserialize(source.type, payload) if little else message)

    serialization = pytest.importorskip('rclpy.serialization')
    package, _, name = source.type.split('/')
    if source.type == types.DVL:
        return  # its package is no part of what the tests need
    kind = getattr(importlib.import_module(f'{package}.msg'), name)
    theirs = serialization.deserialize_message(payload, kind)
    agree(source, payload, theirs)
    agree(source, serialization.serialize_message(theirs), theirs)  # with its padding


@each_source
@EXAMPLES
@given(data=st.data())
def test_what_is_malformed_is_malformed_to_the_other_reader(source, data):
    frame = data.draw(frames)
    little = data.draw(st.booleans())
    good = reference.serialize(
        source.type, reference.message(source.type, 1, frame, [0.5] * 8), little_endian=little
    )
    for payload in broken(data.draw, good, 90):
        decoded = decode(source, [payload], [0])
        try:
            types.deserialize(source.type, payload)
        except MalformedMessage:
            assert decoded.unreadable == {Unreadable.MALFORMED: 1}
        else:
            assert Unreadable.MALFORMED not in decoded.unreadable


@settings(max_examples=300, deadline=None)
@given(
    name=st.one_of(
        st.binary(max_size=6),
        st.lists(
            st.sampled_from([0x41, 0x80, 0x8F, 0x90, 0x9F, 0xA0, 0xBF, 0xC1, 0xC2, 0xDF, 0xE0])
            | st.sampled_from([0xED, 0xEF, 0xF0, 0xF4, 0xF5]),
            max_size=5,
        ).map(bytes),
    )
)
def test_a_frame_id_is_utf8_or_the_message_is_malformed(name: bytes) -> None:
    source = Source('position', types.POINT)
    text = len(name) + 1
    body = bytes(8) + text.to_bytes(4, 'little') + name + b'\0'
    body += bytes(-len(body) % 8) + np.array([1.0, 2.0, 3.0]).tobytes()
    decoded = decode(source, [b'\0\1\0\0' + body], [0])
    try:
        name.decode()
    except UnicodeDecodeError:
        assert decoded.unreadable == {Unreadable.MALFORMED: 1}
    else:
        assert decoded.block.value.tolist() == [[1.0, 2.0]]


@each_source
@settings(max_examples=10, deadline=None)
@given(data=st.data())
def test_a_message_reads_the_same_alone_and_behind_others(source, data):
    """Numbers are read where those of the message before lay, where they lie there again."""
    pool = []
    for frame in ('log', 'gps', 'base', 'ü'):
        for little in (True, False):
            message = reference.message(source.type, 7, frame, data.draw(eight))
            good = reference.serialize(source.type, message, little_endian=little)
            changed = bytearray(good)
            changed[data.draw(st.integers(0, 30)) % len(good)] ^= data.draw(st.integers(1, 255))
            pool += [good, good, bytes(changed), good[:-1], good + b'\0\0\0', good + bytes(4)]
    payloads = data.draw(st.lists(st.sampled_from(pool), min_size=2, max_size=40))
    together = decode(source, payloads, np.arange(len(payloads)))
    alone = [decode(source, [payload], [n]) for n, payload in enumerate(payloads)]
    assert together.unreadable == sum((each.unreadable for each in alone), Counter())
    expected = concatenate([each.block for each in alone])
    for field in ('channel', 'stamp_ns', 'receive_ns', 'value', 'variance'):
        found, single = getattr(together.block, field), getattr(expected, field)
        assert found.tobytes() == single.tobytes(), field


def test_messages_may_lie_anywhere_in_a_buffer_and_at_any_alignment() -> None:
    source = Source('position', types.POINT)
    payloads = [
        reference.serialize(
            types.POINT, reference.message(types.POINT, i, 'f' * i, [float(i)] * 8)
        )
        for i in range(9)
    ]
    data = bytearray()
    start, end = [], []
    for i, payload in enumerate(payloads):
        data += b'\xff' * (i % 3)
        start.append(len(data))
        data += payload
        end.append(len(data))
    order = [3, 1, 8, 0, 5]
    decoded = decode_batch(
        (source, Source('position', types.POSE)),
        np.array([0, 0, 0, 0, 2], np.uint16),  # the last is of no source
        np.frombuffer(bytes(data), np.uint8),
        np.array(start)[order],
        np.array(end)[order],
        np.arange(5),
    )
    assert decoded.block.stamp_ns.tolist() == order[:4]
    assert decoded.block.value[:, 0].tolist() == order[:4]
    assert decoded.kept.tolist() == [0, 1, 2, 3]
    assert decoded.unreadable == ({}, {})


def test_a_field_that_the_type_lacks_is_a_defect() -> None:
    payload = reference.serialize(types.POINT, reference.message(types.POINT, 1, '', [0.5] * 8))
    layout = types.layout_of(types.POINT, payload)
    assert layout.number('point.x')[1] == 20
    for path in ('point.w', 'point.x[1]'):
        with pytest.raises(KeyError):
            layout.number(path)
