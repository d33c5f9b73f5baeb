# SPDX-License-Identifier: Apache-2.0
"""The node as a process among others: hearing, reporting, obeying."""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.messages import EventKind, encode, read_event
from shipdrag_ros.replay import replay
from shipdrag_ros.samples import Block, Channel
from tests.node.conftest import values
from tests.recorded import rows

pytest.importorskip('rclpy')

EVENT_TYPE = 'diagnostic_msgs/msg/DiagnosticArray'
SPEED_TYPE = 'geometry_msgs/msg/TwistWithCovarianceStamped'
QUATERNION = 'geometry_msgs/msg/QuaternionStamped'
IMU = 'sensor_msgs/msg/Imu'
UNUSED = 'not used, node inactive or without clock'


def speeds(*, count: int = 5, age_s: float = 0.0) -> Block:
    """Readings of a speed log, the last one now or a while ago."""
    now_ns = time.time_ns() - round(age_s * 1e9)
    stamps = now_ns - np.arange(count)[::-1] * 10**6
    return Block.of(Channel.SPEED_THROUGH_WATER, stamps, 5.0 + 1e-3 * np.arange(count))


def send(peer: Any) -> None:
    """Publish five readings of a speed log to a node that has found the topic."""
    block = speeds()
    peer.player.connect(block)
    peer.player.publish(block)


def topics_in(bag: Path) -> Counter[str]:
    return Counter(row.topic for row in rows(bag))


def the_bag(directory: Path) -> Path:
    (bag,) = (directory / 'bags').glob('*.mcap')
    return bag


def kinds(events: list[bytes]) -> list[EventKind]:
    return [read_event(payload).kind for payload in events]


def test_records_all_it_hears_and_counts_what_is_no_use(start_node, peer, diagnostics, tmp_path):
    node = start_node()
    peer.player.connect(speeds())
    block = speeds(age_s=1.5)
    peer.player.publish(block)
    peer.player.publish(block)
    publisher = peer.advertise('/speed_through_water', SPEED_TYPE)
    peer.wait_for_listener(publisher)
    diagnostics.wait_for('input speed_through_water', '2', value='publishers')
    publisher.publish(b'\x00\x01\x00\x00 too short')
    part = 'input speed_through_water'
    diagnostics.wait_for(part, '11', value='messages')
    diagnostics.wait_for(part, '5', value='used')
    diagnostics.wait_for(part, '1', value='rejected duplicate')
    diagnostics.wait_for(part, '4', value='rejected out_of_order')
    status = diagnostics.wait_for(part, '1', value='unreadable malformed')
    told = values(status)
    assert 1.5 < float(told['clock offset [s]']) < 30.0
    assert float(told['age [s]']) >= 0.0
    assert told['publishers'] == '2'
    status = diagnostics.wait_for(part, 'of 11 readings used')
    assert status.level == b'\x02'
    assert '5 out of order' in status.message or '4 out of order' in status.message
    diagnostics.wait_for('state', 'no input can be used: speed_through_water: ')
    assert node.stop() == 0
    assert topics_in(the_bag(tmp_path)) == {
        '/speed_through_water': 11,
        '/coastdown_node/events': 2,
    }


def test_inputs_are_recorded_by_their_own_name(start_node, peer, diagnostics, tmp_path):
    from sensor_msgs.msg import Range

    remapped = ('depth:=/sounder/depth', 'speed_through_water_2:=/log2/sped', '__ns:=/ship')
    node = start_node(*(word for each in remapped for word in ('-r', each)))
    # a further log that is remapped to where nobody publishes is spoken of
    status = diagnostics.wait_for('input speed_through_water_2', 'no')
    assert '/log2/sped' in values(status).values()
    assert diagnostics.of('input speed_through_water_3') is None
    publisher = peer.advertise('/sounder/depth', 'sensor_msgs/msg/Range')
    peer.wait_for_listener(publisher)
    diagnostics.wait_for('input depth', '1', value='publishers')
    publisher.publish(Range())
    diagnostics.wait_for('input depth', '1', value='messages')
    node.stop()
    assert topics_in(the_bag(tmp_path))['/ship/depth'] == 1


def test_a_further_log_is_spoken_of_where_somebody_publishes_it_and_a_heading_in_degrees_counts(
    start_node: Any, peer: Any, diagnostics: Any, tmp_path: Path
) -> None:
    from std_msgs.msg import Float64

    node = start_node()
    diagnostics.wait_for('input depth', 'no')
    assert diagnostics.of('input speed_through_water_2') is None
    publisher = peer.advertise('/speed_through_water_2', SPEED_TYPE)
    peer.wait_for_listener(publisher)
    for message in encode(speeds()):
        publisher.publish(message.payload)
    diagnostics.wait_for('input speed_through_water_2', '5', value='used')
    assert diagnostics.of('input speed_through_water_3') is None

    publisher = peer.advertise('/heading', 'std_msgs/msg/Float64')
    peer.wait_for_listener(publisher)
    for degrees in (90.0, 91.0, 92.0):
        publisher.publish(Float64(data=degrees))
        peer.spin_for(0.05)
    status = diagnostics.wait_for('input heading', '3', value='used')
    assert status.level == b'\x00'
    assert status.message == 'receiving; its type holds no time: it counts from its arrival'
    told = values(status)
    assert (told['type'], told['clock offset [s]']) == ('std_msgs/msg/Float64', 'none')
    assert node.stop() == 0
    assert topics_in(the_bag(tmp_path))['/speed_through_water_2'] == 5
    (run,) = open_runs([the_bag(tmp_path)])
    assert replay(run).inputs['heading'].used == 3


def test_hears_a_publisher_of_any_quality_of_service(start_node, peer, diagnostics):
    from rclpy.duration import Duration
    from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy

    start_node()
    offered = (
        QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
        QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
        QoSProfile(depth=1, deadline=Duration(seconds=1.0), lifespan=Duration(seconds=9.0)),
        QoSProfile(depth=1, liveliness=LivelinessPolicy.MANUAL_BY_TOPIC),
    )
    publishers = [peer.advertise('/speed_through_water', SPEED_TYPE, qos) for qos in offered]
    part = 'input speed_through_water'
    diagnostics.wait_for(part, '4', value='publishers')
    for publisher, message in zip(publishers, encode(speeds(count=4))):
        peer.wait_for_listener(publisher)
        publisher.publish(message.payload)
    diagnostics.wait_for(part, '4', value='used')


def test_reports_why_an_input_is_silent(start_node: Any, peer: Any, diagnostics: Any) -> None:
    start_node(**{'heading.type': IMU})
    assert diagnostics.wait_for('state', 'is the driver running').level == b'\x02'

    peer.player.connect(speeds())
    diagnostics.wait_for('input speed_through_water', 'no data')
    diagnostics.wait_for('input speed_through_water', SPEED_TYPE, value='type')

    peer.advertise('/position', 'geometry_msgs/msg/Vector3Stamped')
    status = diagnostics.wait_for('input position', 'wrong type')
    assert status.level == b'\x02'
    assert 'geometry_msgs/msg/Vector3Stamped is published' in status.message
    assert 'sensor_msgs/msg/NavSatFix' in status.message

    peer.advertise('/heading', QUATERNION)
    status = diagnostics.wait_for('input heading', 'wrong type')
    assert f'heard is only {IMU}' in status.message

    other = type(peer)()  # one context cannot hold two types on a topic
    try:
        other.advertise('/speed_through_water', 'geometry_msgs/msg/TwistStamped')
        status = diagnostics.wait_for('input speed_through_water', 'wrong type')
    finally:
        other.close()
    assert 'also published as geometry_msgs/msg/TwistStamped' in status.message


def test_hears_reliably_what_is_sent_so_and_counts_what_is_lost(
    start_node: Any, peer: Any, diagnostics: Any, tmp_path: Path
) -> None:
    from rclpy.qos import QoSProfile, ReliabilityPolicy

    node = start_node()
    part = 'input speed_through_water'
    one = peer.advertise('/speed_through_water', SPEED_TYPE, QoSProfile(depth=1))
    diagnostics.wait_for(part, 'reliable', value='reliability')
    peer.wait_for_listener(one)
    sent = [message.payload for message in encode(speeds(count=400))]
    for payload in sent[:3]:
        one.publish(payload)
    diagnostics.wait_for(part, '3', value='messages')
    # a node that stands still hears of a flood no more than the publisher keeps
    node.pause()
    for payload in sent[3:]:
        one.publish(payload)
    node.go_on()

    def counted() -> int:
        told = values(diagnostics.of(part))
        return int(told['messages']) + int(told['messages lost'])

    peer.spin_until(lambda: counted() > 3)
    one.publish(sent[-1])
    peer.spin_until(lambda: counted() >= 401)
    assert counted() == 401
    told = values(diagnostics.of(part))
    heard, lost = int(told['messages']), int(told['messages lost'])

    other = type(peer)()
    try:
        two = other.advertise(
            '/speed_through_water',
            SPEED_TYPE,
            QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
        )
        diagnostics.wait_for(part, 'best effort', value='reliability')
        # the names of nodes come a little after their publishers
        diagnostics.wait_for(part, '2 publishers, /peer 2 times, are taken for one stream')
        other.wait_for_listener(two)
        two.publish(sent[0])
        diagnostics.wait_for(part, str(heard + 1), value='messages')
    finally:
        other.close()
    assert node.stop() == 0
    events = rows(the_bag(tmp_path), '/coastdown_node/events')
    notes = [read_event(row.payload) for row in events]
    said = [note.text for note in notes if note.kind is EventKind.MESSAGE_LOST]
    assert bool(said) is bool(lost)
    if lost:
        assert said[-1].endswith(f'{lost} so far')


def test_two_nodes_are_told_apart_and_silence_names_what_may_be_meant(
    start_node: Any, peer: Any, diagnostics: Any, ship_file: Path
) -> None:
    ship_file.write_text(f'name: Sea Worthy\n{ship_file.read_text()}')
    peer.advertise('/gps/speed_log', SPEED_TYPE)
    peer.advertise('/rudder_angle', 'sensor_msgs/msg/JointState')
    node = start_node('-r', '__ns:=/ship')
    status = diagnostics.wait_for('state', '/gps/speed_log')
    assert status.name == 'ship/coastdown_node: state'
    assert status.hardware_id == 'Sea Worthy'
    assert 'name one with -r speed_through_water:=/gps/speed_log' in status.message
    assert '/rudder_angle' not in status.message
    assert diagnostics.wait_for('input position', 'no publisher').level == b'\x01'
    assert diagnostics.wait_for('input depth', 'no publisher').level == b'\x00'
    node.wait_for_log('no input heard on any of')
    assert '/gps/speed_log' in node.log.partition('no input heard on any of')[2]


def test_reports_sim_time_without_a_clock(start_node: Any, peer: Any, diagnostics: Any) -> None:
    start_node(use_sim_time=True)
    diagnostics.wait_for('state', 'no /clock')
    send(peer)
    diagnostics.wait_for('input speed_through_water', '5', value=UNUSED)


def test_estimates_on_when_the_disk_does_not_take_it(start_node, peer, diagnostics):
    start_node(output_directory='/proc/nowhere')
    send(peer)
    diagnostics.wait_for('input speed_through_water', '5', value='used')
    diagnostics.wait_for('recording', '6', value='messages in memory only')
    assert diagnostics.wait_for('recording', 'recording failed').level == b'\x02'
    answer = peer.trigger('start_recording')
    assert not answer.success
    assert 'recording failed' in answer.message


def test_obeys_transitions_and_refuses_illegal_ones(start_node, peer, diagnostics, tmp_path):
    start_node()
    assert not peer.change_state('configure')
    assert not peer.change_state('no_such_transition')
    assert peer.state() == 'active'
    send(peer)
    diagnostics.wait_for('input speed_through_water', '5', value='messages')

    assert peer.change_state('deactivate')
    assert topics_in(the_bag(tmp_path))['/speed_through_water'] == 5
    peer.player.publish(speeds())
    diagnostics.wait_for('input speed_through_water', '5', value=UNUSED)

    for transition in ('cleanup', 'configure', 'activate'):
        assert peer.change_state(transition)
    assert len(list((tmp_path / 'bags').glob('*.mcap'))) == 1  # nothing heard, no file
    send(peer)
    diagnostics.wait_for('recording', '6', value='messages')
    assert len(list((tmp_path / 'bags').glob('*.mcap'))) == 2
    assert peer.change_state('shutdown')
    assert peer.state() == 'finalized'


def test_waits_to_be_configured_without_autostart(start_node, peer, ship_file):
    from rcl_interfaces.srv import DescribeParameters, SetParameters
    from rclpy.parameter import Parameter

    def set_window(value: float) -> Any:
        request = SetParameters.Request()
        request.parameters = [Parameter('window_s', value=value).to_parameter_msg()]
        answer = peer.call('/coastdown_node/set_parameters', request, SetParameters)
        return answer.results[0]

    good = ship_file.read_text()
    ship_file.write_text('length_m: -1.0\n')
    node = start_node(autostart=False, up='waiting to be configured')
    assert peer.state() == 'unconfigured'
    for name in ('start_recording', 'stop_recording', 'engine_stopped', 'reset'):
        answer = peer.trigger(name)
        assert not answer.success
        assert answer.message == 'the node is not active'

    assert set_window(900.0).successful
    assert not set_window(-1.0).successful
    assert not peer.change_state('configure')
    assert 'length_m' in node.log
    ship_file.write_text(good)
    assert peer.change_state('configure')
    assert 'window_s=900.0' in node.log
    assert 'late_s=5.0' in node.log
    refused = set_window(800.0)
    assert not refused.successful
    assert 'read-only while configured' in refused.reason

    request = DescribeParameters.Request(names=['window_s', 'order_max'])
    answer = peer.call('/coastdown_node/describe_parameters', request, DescribeParameters)
    window, order = answer.descriptors
    assert '[s]' in window.description
    assert window.floating_point_range[0].to_value == 21600.0
    assert order.integer_range[0].from_value == 3
    assert peer.change_state('activate')
    assert peer.state() == 'active'


def test_services_record_and_reset(start_node: Any, peer: Any, diagnostics: Any, tmp_path) -> None:
    node = start_node()
    events = peer.listen('/coastdown_node/events', EVENT_TYPE, raw=True)
    peer.spin_until(lambda: peer.node.count_publishers('/coastdown_node/events'))
    send(peer)
    diagnostics.wait_for('input speed_through_water', '5', value='messages')
    answer = peer.trigger('stop_recording')
    assert answer.success
    assert answer.message == 'not recording'
    first = the_bag(tmp_path)
    peer.player.publish(speeds())
    diagnostics.wait_for('input speed_through_water', '10', value='messages')
    answer = peer.trigger('start_recording')
    assert answer.success
    assert answer.message.startswith('recording to ')
    assert peer.trigger('reset').success
    peer.spin_until(lambda: EventKind.RESET in kinds(events))
    assert kinds(events)[-2:] == [EventKind.RESET_REQUEST, EventKind.RESET]
    assert node.stop() == 0
    (second,) = set((tmp_path / 'bags').glob('*.mcap')) - {first}
    assert topics_in(first)['/speed_through_water'] == 5
    # the latest messages come first, those from before the stop among them
    assert topics_in(second)['/speed_through_water'] == 10


def test_a_clock_that_goes_back_begins_a_new_bag(start_node, peer, diagnostics, tmp_path):
    node = start_node(use_sim_time=True)
    epoch_ns = 1_700_000_000 * 10**9
    block = Block.of(Channel.SPEED_THROUGH_WATER, epoch_ns + np.arange(3) * 10**8, [5, 6, 7])
    peer.player.connect(block)
    for start_ns, heard in ((0, '3'), (-3600 * 10**9, '6')):
        moved = Block.of(Channel.SPEED_THROUGH_WATER, block.stamp_ns + start_ns, [5, 6, 7])
        diagnostics.set_clock(int(moved.stamp_ns[-1]))
        peer.player.publish(moved)
        diagnostics.wait_for('input speed_through_water', heard, value='messages')
    assert node.stop() == 0
    bags = sorted((tmp_path / 'bags').glob('*.mcap'))
    assert [topics_in(bag)['/speed_through_water'] for bag in bags] == [3, 3]
    first, *_ = rows(bags[1], '/coastdown_node/events')
    assert read_event(first.payload).kind is EventKind.CLOCK_JUMP


def test_nobody_on_the_network_chooses_files_or_clock(start_node, peer, tmp_path):
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    def refusals(**values: object) -> list[str]:
        request = SetParameters.Request()
        request.parameters = [
            Parameter(name, value=value).to_parameter_msg() for name, value in values.items()
        ]
        answer = peer.call('/coastdown_node/set_parameters', request, SetParameters)
        assert not any(one.successful for one in answer.results)
        return [one.reason for one in answer.results]

    secret = tmp_path / 'secret.yaml'
    secret.write_text('password: hunter2\n')
    paths = {'ship_file': str(secret), 'output_directory': '/tmp/elsewhere', 'nmea': 'tcp://a:1'}
    paths |= {'keep_days': 1.0, 'keep_bytes': 10**9, 'path_roots': '/tmp'}
    node = start_node()
    assert 'read-only while configured' in refusals(use_sim_time=True)[0]
    refusals(**paths)
    for transition in ('deactivate', 'cleanup'):
        assert peer.change_state(transition)
    refusals(**paths)
    assert peer.change_state('configure')
    assert 'hunter2' not in node.log
    assert peer.state() == 'inactive'
