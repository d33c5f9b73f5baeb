# SPDX-License-Identifier: Apache-2.0
"""A ROS peer that sends what no instrument would: counted, not recorded, and the node goes on."""

from __future__ import annotations

import math
import random
import struct
import time
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.messages import encode
from shipdrag_ros.samples import Block, Channel
from tests.node.conftest import values

pytest.importorskip('rclpy')

SPEED = 'geometry_msgs/msg/TwistWithCovarianceStamped'
JOINTS = 'sensor_msgs/msg/JointState'
HEAD = b'\x00\x01\x00\x00' + struct.pack('<iI', 1_700_000_000, 0)
LYING = [HEAD + struct.pack('<I', size) + b'x' * 300 for size in (2**32 - 1, 2**31, 400)]
NUMBERS = [math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324]


def readings(values: list[float], ahead_s: float = 0.0) -> list[bytes]:
    """Readings of a speed log, stamped now or ahead."""
    stamps = time.time_ns() + round(ahead_s * 1e9) + np.arange(len(values)) * 10**3
    block = Block.of(Channel.SPEED_THROUGH_WATER, stamps, np.array(values))
    return [message.payload for message in encode(block)]


def odd_stamps() -> list[Any]:
    """Stamps before 1970 and beyond a second, variances that are none."""
    from shipdrag_ros.node.inputs import message_class

    made = []
    for sec, nanosec in ((-(2**31), 0), (-5, 2**32 - 1), (2**31 - 1, 2**32 - 1)):
        message = message_class(SPEED)()
        message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec
        message.twist.covariance = [math.nan] * 18 + [-math.inf] * 18
        made.append(message)
    return made


def test_it_harms_neither_the_node_nor_its_recording(start_node, peer, diagnostics, tmp_path):
    from shipdrag_ros.node.inputs import message_class

    node = start_node()
    log = peer.advertise('/speed_through_water', SPEED, 1000)
    shaft = peer.advertise('/shaft', JOINTS, 10)
    for publisher in (log, shaft):
        peer.wait_for_listener(publisher)
    long_name, joints = message_class(SPEED)(), message_class(JOINTS)()
    long_name.header.frame_id = 'x' * 200_000
    joints.name, joints.velocity = ['shaft'] * 10**6, [10.0] * 10**6
    draw = random.Random(3)
    noise = [draw.randbytes(n) for n in range(1, 400, 40)]
    for message in (*LYING, *noise, *readings(NUMBERS), *readings([5.0], 3e7), *odd_stamps()):
        log.publish(message)
    for _ in range(20):
        log.publish(long_name)
    shaft.publish(joints)
    diagnostics.wait_for('input speed_through_water', '20', value='unreadable too_long')
    diagnostics.wait_for('input shaft', '1', value='unreadable too_long')
    diagnostics.wait_for('input speed_through_water', '1', value='rejected nan')
    told = values(diagnostics.of('input speed_through_water'))
    assert int(told['unreadable malformed']) >= len(LYING)
    assert int(told['used']) <= 2  # one of the numbers is a speed
    assert peer.state() == 'active'
    assert node.stop() == 0
    assert sum(bag.stat().st_size for bag in (tmp_path / 'bags').glob('*.mcap')) < 2**20


def test_a_health_that_names_no_topic_stops_no_page(peer: Any) -> None:
    """Whoever publishes /diagnostics under the node's name may write anything there."""
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

    from shipdrag_ros.node.spectator import Spectator

    def status(part: str, **values: str) -> DiagnosticStatus:
        pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
        return DiagnosticStatus(name=f'coastdown_node: {part}', level=b'\0', values=pairs)

    publisher = peer.advertise('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray')
    heard: list[Any] = []
    with Spectator(heard.append):
        peer.wait_for_listener(publisher)
        for topic in ('not a topic!', '/sound'):
            heard.clear()
            parts = [
                status('state', lifecycle='active', monitor='steady'),
                status('input heading', topic=topic, type='geometry_msgs/msg/QuaternionStamped'),
            ]

            def again(parts: list[DiagnosticStatus] = parts) -> bool:
                publisher.publish(DiagnosticArray(status=parts))
                peer.spin_for(0.2)
                return bool(heard)

            if topic == '/sound':
                peer.spin_until(again)
            else:
                again()


def test_a_curve_at_the_root_hides_no_node(peer: Any) -> None:
    from shipdrag_ros.messages.topics import RESISTANCE_CURVE
    from shipdrag_ros.node.spectator import Spectator

    for node in ('', '/a_node'):
        peer.advertise(f'{node}/resistance_curve', RESISTANCE_CURVE.type)
    with Spectator(lambda heard: None) as spectator:
        peer.spin_until(lambda: spectator.node == '/a_node')
