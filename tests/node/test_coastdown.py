# SPDX-License-Identifier: Apache-2.0
"""A simulated coastdown over DDS: estimates arrive, and replay gives them again."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.coastdown.events import EndedBy
from shipdrag_ros.messages import EventKind, read_event
from shipdrag_ros.replay import replay
from shipdrag_ros.samples import Block
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, Truth, sense, simulate, standard_sensors
from tests.node.conftest import values
from tests.recorded import rows

pytest.importorskip('rclpy')

SHIP_FILE = Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml'
LEAD_IN_S = 300.0
PARAMETERS = {
    'ship_file': str(SHIP_FILE),
    'use_sim_time': True,
    'steady_s': 120.0,
    'slope_window_s': 30.0,
    'window_s': 600.0,
    'forecast_speeds': [3.0, 1.5],
}
SPEED = 100.0  # times as fast as life
TYPES = {
    'speed': 'geometry_msgs/msg/TwistWithCovarianceStamped',
    'resistance': 'geometry_msgs/msg/AccelWithCovarianceStamped',
    'resistance_curve': 'sensor_msgs/msg/PointCloud2',
    'forecast': 'sensor_msgs/msg/PointCloud2',
    'forecast_path': 'nav_msgs/msg/Path',
    'events': 'diagnostic_msgs/msg/DiagnosticArray',
}


@cache
def truth() -> Truth:
    scenario = Scenario(speed_m_s=8.2, lead_in_s=LEAD_IN_S, duration_s=400.0)
    return simulate(Ship.load(SHIP_FILE), scenario)


@cache
def record() -> Block:
    return sense(truth(), standard_sensors(), seed=1)


def until(block: Block, time_s: float) -> int:
    """How many samples arrive before a time of the record."""
    return int(np.searchsorted(block.receive_ns - block.receive_ns[0], time_s * 1e9))


def topics_of(peer: Any) -> dict[str, list[bytes]]:
    heard = {
        name: peer.listen(f'/coastdown_node/{name}', type_name, raw=True)
        for name, type_name in TYPES.items()
    }
    for name in TYPES:
        peer.spin_until(lambda name=name: peer.node.count_publishers(f'/coastdown_node/{name}'))
    return heard


def on_the_wire(payload: bytes) -> bytes:
    """DDS fills a message up to a multiple of four bytes."""
    return payload + bytes(-len(payload) % 4)


def assert_replayed(path: Path, *, at_least: int) -> Any:
    (run,) = open_runs([path])
    result = replay(run)
    assert result.recorded.first_difference is None
    assert result.recorded.compared == result.recorded.identical >= at_least
    return result


def test_live_figures_are_recorded_and_replayed(start_node, peer, diagnostics, tmp_path):
    from geometry_msgs.msg import AccelWithCovarianceStamped, TwistWithCovarianceStamped
    from nav_msgs.msg import Path as Ahead
    from rclpy.serialization import deserialize_message
    from sensor_msgs.msg import PointCloud2

    node = start_node(**PARAMETERS)
    heard = topics_of(peer)
    block = record()
    peer.player.connect(block)
    peer.player.play(block, speed=SPEED)
    diagnostics.wait_for('input heading', '0', value='rate [Hz]')  # all has been heard
    assert 'specific resistance [m/s^2]' in values(diagnostics.of('estimate'))

    late = peer.listen(
        '/coastdown_node/resistance_curve', TYPES['resistance_curve'], latched=True, raw=True
    )
    peer.spin_until(lambda: late)
    assert node.stop() == 0

    (bag,) = (tmp_path / 'bags').glob('*.mcap')
    names = ('speed', 'resistance', 'resistance_curve', 'forecast', 'forecast_path')
    sent = {name: len(rows(bag, f'/coastdown_node/{name}')) for name in names}
    peer.spin_until(lambda: all(len(heard[name]) >= sent[name] for name in names))
    peer.spin_until(lambda: read_event(heard['events'][-1]).kind is EventKind.COASTDOWN)
    for name in names:
        assert len(heard[name]) > 20
        assert heard[name] == [
            on_the_wire(row.payload) for row in rows(bag, f'/coastdown_node/{name}')
        ]
    assert heard['resistance_curve'][-2] == late[0]
    *_, made, withdrawn = (deserialize_message(each, PointCloud2) for each in heard['forecast'])
    assert made.width > 0 == withdrawn.width
    *_, made, withdrawn = (deserialize_message(each, Ahead) for each in heard['forecast_path'])
    assert len(made.poses) > 0 == len(withdrawn.poses)
    kinds = [read_event(payload).kind for payload in heard['events']]
    # first what is too vague to be given, and says so
    vague = kinds.count(EventKind.NO_ESTIMATE)
    assert kinds[1 : 1 + vague] == [EventKind.NO_ESTIMATE] * vague
    assert [kind for kind in kinds if kind is not EventKind.NO_ESTIMATE] == [
        EventKind.ONSET,
        EventKind.LIFECYCLE,
        EventKind.COASTDOWN,
    ]

    assert 'a coastdown began at' in node.log
    assert 'record_end: the node stops). In SI: r(v) is known from' in node.log
    assert '(two standard deviations)' in node.log
    result = assert_replayed(bag, at_least=60)
    assert [it.ended_by for it in result.coastdowns] == [EndedBy.RECORD_END]

    # the messages as any ROS node reads them
    speed = deserialize_message(heard['speed'][-1], TwistWithCovarianceStamped)
    resistance = deserialize_message(heard['resistance'][-1], AccelWithCovarianceStamped)
    curve = deserialize_message(heard['resistance_curve'][-1], PointCloud2)
    assert speed.header.stamp == resistance.header.stamp
    sigma = np.sqrt(speed.twist.covariance[0])
    true_speed = np.interp(
        speed.header.stamp.sec + speed.header.stamp.nanosec * 1e-9,
        block.stamp_ns[0] * 1e-9 + truth().time_s,
        truth().speed_through_water_m_s,
    )
    assert abs(speed.twist.twist.linear.x - true_speed) < 5.0 * sigma
    assert resistance.accel.accel.linear.x > 0.0
    assert [field.name for field in curve.fields] == ['speed', 'resistance', 'sigma', 'froude']


def test_silence_ends_a_coastdown_by_the_clock(start_node, peer, diagnostics, tmp_path):
    node = start_node(**PARAMETERS, data_stop_s=8.0)
    block = record()
    peer.player.connect(block)
    end = until(block, LEAD_IN_S + 200.0)
    peer.player.play(block[:end], speed=SPEED)
    node.wait_for_log('a coastdown began')
    # nothing comes, and then the clock goes on
    diagnostics.wait_for('input heading', '0', value='rate [Hz]')
    peer.spin_for(3.0)
    diagnostics.set_clock(int(block.receive_ns[end - 1]) + 60 * 10**9)
    node.wait_for_log('(silence: all sources of speed fell silent). In SI: r(v) is known')
    assert node.stop() == 0
    (bag,) = (tmp_path / 'bags').glob('*.mcap')
    result = assert_replayed(bag, at_least=10)
    assert [it.ended_by for it in result.coastdowns] == [EndedBy.SILENCE]
