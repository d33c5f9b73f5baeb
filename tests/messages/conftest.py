# SPDX-License-Identifier: Apache-2.0
"""Messages of every accepted type, built by the reference library."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
DVL = 'marine_acoustic_msgs/msg/Dvl'
# by its page, https://docs.ros.org/en/api/marine_acoustic_msgs/html/msg/Dvl.html
_DVL_FIELDS = """
std_msgs/Header header
uint8 velocity_mode
uint8 dvl_type
geometry_msgs/Vector3 velocity
float64[9] velocity_covar
float64 altitude
float64 course_gnd
float64 speed_gnd
uint8 num_good_beams
float32 sound_speed
bool beam_ranges_valid
bool beam_velocities_valid
geometry_msgs/Vector3[4] beam_unit_vec
float64[4] range
float32[4] range_covar
float32[4] beam_quality
float32[4] beam_velocity
float32[4] beam_velocity_covar
"""
STORE.register(get_types_from_msg(_DVL_FIELDS, DVL))


class Reference:
    """Builds and serializes messages through rosbags, independently of the package."""

    def make(self, type_name: str, /, **fields: Any) -> Any:
        return STORE.types[type_name](**fields)

    def header(self, stamp_ns: int, frame_id: str = '') -> Any:
        time = self.make(
            'builtin_interfaces/msg/Time', sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9
        )
        return self.make('std_msgs/msg/Header', stamp=time, frame_id=frame_id)

    def vector(self, x: float, y: float) -> Any:
        return self.make('geometry_msgs/msg/Vector3', x=x, y=y, z=3.0)

    def message(self, type_name: str, stamp_ns: int, frame_id: str, numbers: list[float]) -> Any:
        """Fill a message of an accepted type with eight numbers."""
        a, b, c, d, e, f, g, h = numbers
        if type_name == 'std_msgs/msg/Float64':
            return self.make(type_name, data=a)
        covariance = np.arange(36.0)
        covariance[[0, 1, 6, 7]] = c, d, d, e
        twist = self.make(
            'geometry_msgs/msg/Twist', linear=self.vector(a, b), angular=self.vector(f, g)
        )
        quaternion = self.make('geometry_msgs/msg/Quaternion', x=a, y=b, z=c, w=d)
        point = self.make('geometry_msgs/msg/Point', x=a, y=b, z=h)
        pose = self.make('geometry_msgs/msg/Pose', position=point, orientation=quaternion)
        pose_with_covariance = self.make(
            'geometry_msgs/msg/PoseWithCovariance', pose=pose, covariance=covariance
        )
        twist_with_covariance = self.make(
            'geometry_msgs/msg/TwistWithCovariance', twist=twist, covariance=covariance
        )
        nine = np.array([e, 0, 0, 0, f, 0, 0, 0, g])
        bodies: dict[str, dict[str, Any]] = {
            'geometry_msgs/msg/TwistStamped': {'twist': twist},
            'geometry_msgs/msg/TwistWithCovarianceStamped': {'twist': twist_with_covariance},
            'geometry_msgs/msg/VelocityStamped': {
                'body_frame_id': frame_id[::-1],
                'reference_frame_id': frame_id,
                'velocity': twist,
            },
            'geometry_msgs/msg/PoseStamped': {'pose': pose},
            'geometry_msgs/msg/PoseWithCovarianceStamped': {'pose': pose_with_covariance},
            'geometry_msgs/msg/PointStamped': {'point': point},
            'geometry_msgs/msg/QuaternionStamped': {'quaternion': quaternion},
            'nav_msgs/msg/Odometry': {
                'child_frame_id': frame_id[::-1],
                'pose': pose_with_covariance,
                'twist': twist_with_covariance,
            },
            'sensor_msgs/msg/NavSatFix': {
                'status': self.make('sensor_msgs/msg/NavSatStatus', status=0, service=1),
                'latitude': a,
                'longitude': b,
                'altitude': c,
                'position_covariance': nine,
                'position_covariance_type': 2,
            },
            'sensor_msgs/msg/Imu': {
                'orientation': quaternion,
                'orientation_covariance': nine,
                'angular_velocity': self.vector(a, b),
                'angular_velocity_covariance': nine,
                'linear_acceleration': self.vector(a, b),
                'linear_acceleration_covariance': nine,
            },
            'sensor_msgs/msg/JointState': {
                'name': ['other', 'shaft', 'rudder'],
                'position': np.array([0.0, a, b]),
                'velocity': np.array([0.0, c, d]),
                'effort': np.empty(0),
            },
            DVL: {
                'velocity_mode': 2 if h > 0.0 else 1,
                'dvl_type': 0,
                'velocity': self.vector(a, b),
                'velocity_covar': np.array([c, d, 0, d, e, 0, 0, 0, f]),
                'altitude': f,
                'course_gnd': 0.0,
                'speed_gnd': 0.0,
                'num_good_beams': 4,
                'sound_speed': 1500.0,
                'beam_ranges_valid': True,
                'beam_velocities_valid': True,
                'beam_unit_vec': [self.vector(a, g)] * 4,
                'range': np.arange(4.0),
                **{
                    name: np.arange(4, dtype=np.float32)
                    for name in (
                        'range_covar',
                        'beam_quality',
                        'beam_velocity',
                        'beam_velocity_covar',
                    )
                },
            },
            'sensor_msgs/msg/Range': {
                'radiation_type': 0,
                'field_of_view': 0.1,
                'min_range': 0.0,
                'max_range': 100.0,
                'range': float(np.float32(a)),
                'variance': float(np.float32(c)),
            },
        }
        return self.make(type_name, header=self.header(stamp_ns, frame_id), **bodies[type_name])

    def serialize(self, type_name: str, message: Any, *, little_endian: bool = True) -> bytes:
        return bytes(STORE.serialize_cdr(message, type_name, little_endian=little_endian))

    def deserialize(self, type_name: str, payload: bytes) -> Any:
        return STORE.deserialize_cdr(payload, type_name)


reference = Reference()


def broken(draw: Any, good: bytes, last: int) -> list[bytes]:
    """Draw messages that are cut or too long, with some of their first bytes changed."""
    payloads = []
    for _ in range(8):
        changed = bytearray(good[: draw(st.integers(0, len(good) + 20))])
        changed += draw(st.binary(max_size=24))
        if changed:
            for place in draw(st.lists(st.integers(0, last), max_size=4)):
                changed[place % len(changed)] = draw(st.integers(0, 255))
        payloads.append(bytes(changed))
    return payloads
