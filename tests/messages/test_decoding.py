# SPDX-License-Identifier: Apache-2.0
"""What a message says that is not said by its numbers alone."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

from shipdrag_ros.messages import TOPICS, Source, Unreadable, decode, types
from tests.messages.conftest import reference

SOURCES = [Source(name, type_name) for name, accepted in TOPICS.items() for type_name in accepted]


def test_short_and_wrongly_encapsulated_messages_are_malformed() -> None:
    source = Source('speed_through_water', 'geometry_msgs/msg/TwistStamped')
    good = reference.serialize(source.type, reference.message(source.type, 1, '', [1.0] * 8))
    parameter_list = b'\x00\x03' + good[2:]
    unreadable = decode(
        source, [good[:-8], parameter_list, b'', good + bytes(16)], [0, 0, 0, 0]
    ).unreadable
    assert unreadable == {Unreadable.MALFORMED: 4}


def test_a_nan_of_either_kind_is_decoded_in_silence() -> None:
    message = reference.message(types.TWIST, 1, '', [1.0] * 8)
    good = reference.serialize(types.TWIST, message)
    for bits in (0x7FF8 << 48, (0x7FF0 << 48) + 1):  # the second one signals to the processor
        payload = good.replace(np.float64(1.0).tobytes(), bits.to_bytes(8, 'little'), 1)
        with warnings.catch_warnings():
            warnings.simplefilter('error')
            decoded = decode(Source('speed_over_ground', types.TWIST), [payload], [0])
        assert np.isnan(decoded.block.value[0, 0])


def test_variance_of_the_speed_over_ground_is_that_along_the_track() -> None:
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
def test_what_is_no_rotation_has_no_yaw(quaternion: tuple[float, float, float, float]) -> None:
    source = Source('heading', 'geometry_msgs/msg/QuaternionStamped')
    message = reference.message(source.type, 1, '', [*quaternion, 0, 0, 0, 0])
    block = decode(source, [reference.serialize(source.type, message)], [0]).block
    assert math.isnan(block.value[0, 0])
    assert block.value[0, 1] == 0.0


@pytest.mark.parametrize('tilt', [(0.0, 0.0), (0.2, -0.1)])
def test_yaw_is_the_yaw_of_a_rolling_ship(tilt: tuple[float, float]) -> None:
    from scipy.spatial.transform import Rotation

    rotation = Rotation.from_euler('ZYX', [-2.5, *tilt])
    source = Source('heading', 'geometry_msgs/msg/QuaternionStamped')
    message = reference.message(source.type, 1, '', [*rotation.as_quat().tolist(), 0, 0, 0, 0])
    block = decode(source, [reference.serialize(source.type, message)], [0]).block
    assert block.value[0, 0] == pytest.approx(-2.5, abs=1e-14)


def test_an_imu_without_orientation_has_no_yaw() -> None:
    source = Source('heading', 'sensor_msgs/msg/Imu')
    message = reference.message(source.type, 1, '', [0.0, 0.0, 0.0, 1.0, -1.0, 0, 0.5, 0])
    block = decode(source, [reference.serialize(source.type, message)], [0]).block
    assert math.isnan(block.value[0, 0])


def test_a_fix_that_is_none_has_no_position() -> None:
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
def test_degrees_of_a_compass_become_yaw(compass_deg: float, yaw_deg: float) -> None:
    source = Source('heading', 'std_msgs/msg/Float64')
    payload = reference.serialize(source.type, reference.make(source.type, data=compass_deg))
    block = decode(source, [payload], [5]).block
    assert np.degrees(block.value[0, 0]) == pytest.approx(yaw_deg, abs=1e-12)


def test_no_messages_give_no_samples() -> None:
    decoded = decode(SOURCES[0], [], [])
    assert len(decoded.block) == 0
