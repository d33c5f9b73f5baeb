# SPDX-License-Identifier: Apache-2.0
"""Every accepted type, both byte orders, alone and in batches, whole and broken."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from shipdrag_ros.messages import TOPICS, Source, Unreadable, decode, types
from shipdrag_ros.messages.types import is_stamped
from shipdrag_ros.samples import FURTHER, Block, Channel, concatenate

SOURCES = [Source(name, type_name) for name, accepted in TOPICS.items() for type_name in accepted]
OF_ROS = [source for source in SOURCES if source.type != types.DVL]
STAMP_NS = 1_700_000_000_123_456_789

finite = st.floats(allow_nan=False, allow_infinity=False, width=32)
any_float = st.floats(width=32)
stamps = st.integers(-(2**31) * 10**9, (2**31 - 1) * 10**9 + 999_999_999)
eight = st.lists(any_float, min_size=8, max_size=8)
frames = st.text(st.characters(codec='utf-8', exclude_characters='\0'), max_size=20)


def same_bits(one: Block, other: Block) -> bool:
    return all(
        np.array_equal(
            np.ascontiguousarray(getattr(one, name)).view(np.uint8),
            np.ascontiguousarray(getattr(other, name)).view(np.uint8),
        )
        for name in ('channel', 'stamp_ns', 'receive_ns', 'value', 'variance')
    )


def expected(source: Source, numbers: list[float]) -> tuple[Channel, list[float], list[float]]:
    """Say what each source gives, by scalar arithmetic."""
    a, b, c, d, e, f, g, _ = numbers
    nan = math.nan
    with_covariance = any(name in source.type for name in ('WithCovariance', 'Odometry', 'Dvl'))
    if source.input in FURTHER:  # further instruments are read as the first one
        first, *read = expected(Source(FURTHER[source.input], source.type), numbers)
        return Channel[f'{first.name}{source.input[-2:]}'], *read
    match source.input:
        case 'speed_through_water':
            return Channel.SPEED_THROUGH_WATER, [a, 0], [c if with_covariance else nan, nan]
        case 'speed_over_ground' if 'Dvl' in source.type:  # the one here is against the water
            return Channel.SPEED_OVER_GROUND, [nan, 0], [nan, nan]
        case 'speed_over_ground':
            return Channel.SPEED_OVER_GROUND, [math.hypot(a, b), 0], [nan, nan]
        case 'position' if 'NavSatFix' in source.type:
            return Channel.POSITION_GEODETIC, [a, b], [f, e]
        case 'position':
            return Channel.POSITION, [a, b], [c, e] if with_covariance else [nan, nan]
        case 'heading' if 'Float64' in source.type:
            return (
                Channel.HEADING,
                [math.remainder(math.radians(90.0 - a), math.tau), 0],
                [nan] * 2,
            )
        case 'heading':
            yaw = math.atan2(2 * (d * c + a * b), d * d + a * a - b * b - c * c)
            variance = g if 'Imu' in source.type else nan
            return Channel.HEADING, [yaw, 0], [variance, nan]
        case 'shaft':
            return Channel.SHAFT, [c, 0], [nan, nan]
        case 'rudder':
            return Channel.RUDDER, [b, 0], [nan, nan]
        case 'wind_apparent':
            return Channel.WIND_APPARENT, [a, b], [nan, nan]
        case 'depth':
            return Channel.DEPTH, [a, 0], [c, nan]
    raise AssertionError(source)


@pytest.mark.parametrize('source', SOURCES, ids=lambda s: f'{s.input}-{s.type.split("/")[2]}')
@pytest.mark.parametrize('little_endian', [True, False])
def test_every_accepted_type(reference: Any, source: Source, little_endian: bool) -> None:
    numbers = [0.1, 0.2, 0.3, math.sqrt(1 - 0.14), 0.5, 0.6, 0.7, 0.8]
    numbers = [float(np.float32(x)) for x in numbers]
    message = reference.message(source.type, STAMP_NS, 'a frame', numbers)
    payload = reference.serialize(source.type, message, little_endian=little_endian)
    channel, value, variance = expected(source, numbers)
    decoded = decode(source, [payload], [STAMP_NS + 7])
    assert decoded.block.channel.tolist() == [channel]
    assert channel.input == source.input
    # what holds no time counts from its arrival
    stamp_ns = STAMP_NS if is_stamped(source.type) else STAMP_NS + 7
    assert decoded.block.stamp_ns.tolist() == [stamp_ns]
    assert decoded.block.receive_ns.tolist() == [STAMP_NS + 7]
    np.testing.assert_allclose(decoded.block.value[0], value, rtol=1e-15, atol=0)
    if not source.input.startswith('speed_over_ground'):
        np.testing.assert_array_equal(decoded.block.variance[0], variance)
    assert not decoded.unreadable


@settings(max_examples=60, deadline=None)
@given(
    source=st.sampled_from(SOURCES),
    rows=st.lists(st.tuples(stamps, frames, eight, st.booleans()), min_size=1, max_size=40),
)
def test_a_batch_gives_the_bits_of_single_messages(
    reference: Any, source: Source, rows: list[tuple[int, str, list[float], bool]]
) -> None:
    payloads = [
        reference.serialize(
            source.type, reference.message(source.type, s, frame, numbers), little_endian=little
        )
        for s, frame, numbers, little in rows
    ]
    received = list(range(len(rows)))
    batch = decode(source, payloads, received).block
    singles = [decode(source, [p], [t]).block for p, t in zip(payloads, received, strict=True)]
    assert same_bits(batch, concatenate(singles))
    stated = [s for s, *_ in rows]
    assert batch.stamp_ns.tolist() == (stated if is_stamped(source.type) else received)
    read = [types.stated_stamp_ns(source.type, p, t) for p, t in zip(payloads, received)]
    assert batch.stamp_ns.tolist() == read


@settings(max_examples=60, deadline=None)
@given(source=st.sampled_from(OF_ROS), stamp_ns=stamps, frame=frames, numbers=eight)
def test_what_rclpy_sends_is_decoded_the_same(
    reference: Any, source: Source, stamp_ns: int, frame: str, numbers: list[float]
) -> None:
    serialization = pytest.importorskip('rclpy.serialization')
    # the largest of 32 bits are refused by rclpy's own messages, whose limit is rounded down
    large = [x for x in numbers if np.isfinite(x) and abs(x) > 3.4e38]
    assume(not (large and source.type == 'sensor_msgs/msg/Range'))
    package, _, name = source.type.split('/')
    kind = getattr(pytest.importorskip(f'{package}.msg'), name)
    ours = reference.serialize(
        source.type, reference.message(source.type, stamp_ns, frame, numbers)
    )
    theirs = serialization.serialize_message(serialization.deserialize_message(ours, kind))
    first, second = (decode(source, [payload], [0]) for payload in (ours, theirs))
    assert len(first.block) == 1
    assert same_bits(first.block, second.block)


def test_magnitudes_and_yaws_do_not_depend_on_the_batch(reference: Any) -> None:
    rng = np.random.default_rng(5)
    for source in (
        Source('speed_over_ground', 'geometry_msgs/msg/TwistStamped'),
        Source('heading', 'geometry_msgs/msg/QuaternionStamped'),
    ):
        numbers = rng.normal(size=(1000, 8))
        numbers[:, :4] /= np.linalg.norm(numbers[:, :4], axis=1, keepdims=True)
        payloads = [
            reference.serialize(source.type, reference.message(source.type, 0, '', row.tolist()))
            for row in numbers
        ]
        batch = decode(source, payloads, np.zeros(1000, np.int64)).block
        singles = [decode(source, [payload], [0]).block for payload in payloads]
        assert same_bits(batch, concatenate(singles))
        assert np.isfinite(batch.value).all()


@settings(max_examples=80, deadline=None)
@given(source=st.sampled_from(SOURCES), data=st.data())
def test_broken_bytes_are_counted_and_spoil_no_neighbour(
    reference: Any, source: Source, data: st.DataObject
) -> None:
    good = reference.serialize(
        source.type, reference.message(source.type, STAMP_NS, 'map', [0.5] * 8)
    )
    cut = data.draw(st.integers(0, len(good) - 5))
    flips = data.draw(st.lists(st.tuples(st.integers(0, 39), st.integers(0, 255)), max_size=6))
    flipped = bytearray(good)
    for place, byte in flips:
        flipped[place % len(flipped)] = byte
    junk = data.draw(st.binary(max_size=80))
    payloads = [good, good[:cut], bytes(flipped), junk, good]
    decoded = decode(source, payloads, [1, 2, 3, 4, 5])
    assert len(decoded.block) + sum(decoded.unreadable.values()) == 5
    assert {0, 4} <= set(decoded.kept.tolist())
    np.testing.assert_array_equal(decoded.block.receive_ns, decoded.kept + 1)
    # NaN where a DVL did not measure against this
    np.testing.assert_array_equal(decoded.block.value[0], decoded.block.value[-1])


def test_short_and_wrongly_encapsulated_messages_are_malformed(reference: Any) -> None:
    source = Source('speed_through_water', 'geometry_msgs/msg/TwistStamped')
    good = reference.serialize(source.type, reference.message(source.type, 1, '', [1.0] * 8))
    parameter_list = b'\x00\x03' + good[2:]
    unreadable = decode(
        source, [good[:-8], parameter_list, b'', good + bytes(16)], [0, 0, 0, 0]
    ).unreadable
    assert unreadable == {Unreadable.MALFORMED: 4}


@pytest.mark.parametrize(
    ('names', 'velocities'), [([], []), (['rudder'], [1.0]), (['a', 'shaft'], [1.0])]
)
def test_a_joint_that_is_not_there_is_counted(
    reference: Any, names: list[str], velocities: list[float]
) -> None:
    message = reference.make(
        'sensor_msgs/msg/JointState',
        header=reference.header(1),
        name=names,
        position=np.empty(0),
        velocity=np.array(velocities, np.float64),
        effort=np.empty(0),
    )
    source = Source('shaft', 'sensor_msgs/msg/JointState')
    decoded = decode(source, [reference.serialize(source.type, message)], [0])
    assert decoded.unreadable == {Unreadable.NO_JOINT: 1}
    assert len(decoded.block) == 0


@pytest.mark.parametrize('variance', [0.0, -1.0, math.nan, math.inf])
def test_a_variance_that_says_nothing_is_unknown(reference: Any, variance: float) -> None:
    source = Source('speed_through_water', 'geometry_msgs/msg/TwistWithCovarianceStamped')
    message = reference.message(source.type, 1, '', [1.0, 0.0, variance, 0, 0, 0, 0, 0])
    block = decode(source, [reference.serialize(source.type, message)], [0]).block
    assert np.isnan(block.variance).all()


def test_a_nan_of_either_kind_is_decoded_in_silence(reference: Any) -> None:
    message = reference.message(types.TWIST, 1, '', [1.0] * 8)
    good = reference.serialize(types.TWIST, message)
    for bits in (0x7FF8 << 48, (0x7FF0 << 48) + 1):  # the second one signals to the processor
        payload = good.replace(np.float64(1.0).tobytes(), bits.to_bytes(8, 'little'), 1)
        with warnings.catch_warnings():
            warnings.simplefilter('error')
            decoded = decode(Source('speed_over_ground', types.TWIST), [payload], [0])
        assert np.isnan(decoded.block.value[0, 0])


def test_variance_of_the_speed_over_ground_is_that_along_the_track(reference: Any) -> None:
    source = Source('speed_over_ground', 'geometry_msgs/msg/TwistWithCovarianceStamped')

    def variance(x: float, y: float, xx: float, xy: float, yy: float) -> float:
        message = reference.message(source.type, 1, '', [x, y, xx, xy, yy, 0, 0, 0])
        block = decode(source, [reference.serialize(source.type, message)], [0]).block
        return float(block.variance[0, 0])

    assert variance(3.0, 0.0, 0.04, 0.5, 9.0) == 0.04
    assert variance(3.0, 4.0, 1.0, 0.25, 4.0) == pytest.approx(
        (9 * 1.0 + 16 * 4.0 + 2 * 12 * 0.25) / 25, rel=1e-15
    )
    assert variance(0.0, 0.0, 1.0, 0.0, 3.0) == 3.0
    assert math.isnan(variance(3.0, 4.0, 1.0, 0.0, -1.0))
    # Monte Carlo of the first-order formula, N = 200 000, seed 3
    rng = np.random.default_rng(3)
    covariance = np.array([[0.01, 0.004], [0.004, 0.02]])
    drawn = rng.multivariate_normal([3.0, 4.0], covariance, 200_000)
    assert variance(3.0, 4.0, 0.01, 0.004, 0.02) == pytest.approx(
        np.hypot(*drawn.T).var(), rel=0.02
    )


@pytest.mark.parametrize(
    'quaternion', [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 2.0, 0.0), (math.nan, 0.0, 0.0, 1.0)]
)
def test_what_is_no_rotation_has_no_yaw(
    reference: Any, quaternion: tuple[float, float, float, float]
) -> None:
    source = Source('heading', 'geometry_msgs/msg/QuaternionStamped')
    message = reference.message(source.type, 1, '', [*quaternion, 0, 0, 0, 0])
    block = decode(source, [reference.serialize(source.type, message)], [0]).block
    assert math.isnan(block.value[0, 0])
    assert block.value[0, 1] == 0.0


@pytest.mark.parametrize('tilt', [(0.0, 0.0), (0.2, -0.1)])
def test_yaw_is_the_yaw_of_a_rolling_ship(reference: Any, tilt: tuple[float, float]) -> None:
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_euler('ZYX', [-2.5, *tilt])
    source = Source('heading', 'geometry_msgs/msg/QuaternionStamped')
    message = reference.message(source.type, 1, '', [*rotation.as_quat().tolist(), 0, 0, 0, 0])
    block = decode(source, [reference.serialize(source.type, message)], [0]).block
    assert block.value[0, 0] == pytest.approx(-2.5, abs=1e-14)


def test_an_imu_without_orientation_has_no_yaw(reference: Any) -> None:
    source = Source('heading', 'sensor_msgs/msg/Imu')
    message = reference.message(source.type, 1, '', [0.0, 0.0, 0.0, 1.0, -1.0, 0, 0.5, 0])
    block = decode(source, [reference.serialize(source.type, message)], [0]).block
    assert math.isnan(block.value[0, 0])


def test_a_fix_that_is_none_has_no_position(reference: Any) -> None:
    source = Source('position', 'sensor_msgs/msg/NavSatFix')
    message = reference.message(source.type, 1, '', [60.0, 5.0, 0, 0, 4.0, 9.0, 1.0, 0])
    message.status.status = -1
    block = decode(source, [reference.serialize(source.type, message)], [0]).block
    assert np.isnan(block.value).all()
    message.status.status = -2  # not set by the driver, as messages of Jazzy begin
    block = decode(source, [reference.serialize(source.type, message)], [0]).block
    assert block.value.tolist() == [[60.0, 5.0]]
    message.status.status = 0
    block = decode(source, [reference.serialize(source.type, message)], [0]).block
    assert block.variance.tolist() == [[9.0, 4.0]]  # north, east
    message.position_covariance_type = 0
    block = decode(source, [reference.serialize(source.type, message)], [0]).block
    assert np.isnan(block.variance).all()


def test_a_range_of_before_iron_is_read() -> None:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    time = store.types['builtin_interfaces/msg/Time'](sec=1, nanosec=2)
    message = store.types['sensor_msgs/msg/Range'](
        header=store.types['std_msgs/msg/Header'](stamp=time, frame_id='x'),
        radiation_type=0,
        field_of_view=0.0,
        min_range=0.0,
        max_range=9.0,
        range=4.5,
    )
    payload = bytes(store.serialize_cdr(message, 'sensor_msgs/msg/Range'))
    block = decode(Source('depth', 'sensor_msgs/msg/Range'), [payload], [0]).block
    assert block.value[0, 0] == 4.5
    assert block.stamp_ns.tolist() == [1_000_000_002]
    assert np.isnan(block.variance).all()


@pytest.mark.parametrize(
    ('compass_deg', 'yaw_deg'),
    [(0.0, 90.0), (90.0, 0.0), (180.0, -90.0), (359.0, 91.0), (-9.0, 99.0)],
)
def test_degrees_of_a_compass_become_yaw(
    reference: Any, compass_deg: float, yaw_deg: float
) -> None:
    source = Source('heading', 'std_msgs/msg/Float64')
    payload = reference.serialize(source.type, reference.make(source.type, data=compass_deg))
    block = decode(source, [payload], [5]).block
    assert np.degrees(block.value[0, 0]) == pytest.approx(yaw_deg, abs=1e-12)


def test_no_messages_give_no_samples() -> None:
    decoded = decode(SOURCES[0], [], [])
    assert len(decoded.block) == 0
