# SPDX-License-Identifier: Apache-2.0
"""The node as a process among others: starting, hearing, reporting, ending."""

from __future__ import annotations

import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from shipdrag_ros.messages import EventKind, read_event
from shipdrag_ros.samples import Block, Channel

pytest.importorskip('rclpy')

EVENT_TYPE = 'diagnostic_msgs/msg/DiagnosticArray'


def speeds(*, count: int = 5, age_s: float = 0.0) -> Block:
    """Readings of a speed log, the last one now or a while ago."""
    now_ns = time.time_ns() - round(age_s * 1e9)
    stamps = now_ns - np.arange(count)[::-1] * 10**6
    return Block.of(Channel.SPEED_THROUGH_WATER, stamps, 5.0 + 1e-3 * np.arange(count))


def topics_in(bag: Path) -> dict[str, int]:
    """Messages of each topic."""
    counts: dict[str, int] = {}
    with bag.open('rb') as stream:
        for _, channel, _ in make_reader(stream).iter_messages():
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
    return counts


def the_bag(directory: Path) -> Path:
    (bag,) = (directory / 'bags').glob('*.mcap')
    return bag


def kinds(events: list[bytes]) -> list[EventKind]:
    return [read_event(payload).kind for payload in events]


class TestStart:
    def test_becomes_active_by_itself(self, start_node: Any, peer: Any) -> None:
        start_node()
        assert peer.state() == 'active'

    def test_waits_without_autostart(self, start_node: Any, peer: Any) -> None:
        start_node(autostart=False, up='waiting to be configured')
        assert peer.state() == 'unconfigured'
        assert peer.change_state('configure')
        assert peer.change_state('activate')
        assert peer.state() == 'active'

    def test_logs_the_effective_parameters(self, start_node: Any) -> None:
        node = start_node(window_s=600)
        assert 'window_s=600.0' in node.log
        assert 'late_s=5.0' in node.log

    @pytest.mark.parametrize(
        ('parameters', 'said'),
        [
            ({'windows_s': 600.0}, "'windows_s': unknown; known are autostart"),
            ({'window_s': 'long'}, "window_s: 'long' is of type str, expected float"),
            ({'window_s': 1.0}, 'window_s: 1.0, expected 60..21600 s'),
            ({'record': 1}, 'record: 1 is of type int, expected bool'),
            ({'depth.type': 'std_msgs/msg/Float64'}, 'expected one of sensor_msgs/msg/Range'),
            ({'ship_file': '/nowhere/ship.yaml'}, 'cannot be read'),
            ({'ship_file': ''}, 'expected the path of a ship file'),
        ],
    )
    def test_user_errors_end_the_process(
        self, start_node: Any, parameters: dict[str, object], said: str
    ) -> None:
        node = start_node(up=None, **parameters)
        assert node.wait() == 1
        assert said in node.log
        assert 'ERROR: ' in node.log
        assert 'Traceback' not in node.log

    def test_parameters_for_another_node_are_an_error(
        self, start_node: Any, tmp_path: Path
    ) -> None:
        file = tmp_path / 'other.yaml'
        file.write_text('coastdown:\n  ros__parameters: {window_s: 600.0}\n')
        node = start_node('--params-file', str(file), up=None)
        assert node.wait() == 1
        assert "expected one for '/coastdown_node'" in node.log

    @pytest.mark.parametrize(
        'arguments', [['--params-file', '/nowhere.yaml'], ['-p', 'window_s'], ['--no-such-flag']]
    )
    def test_bad_ros_arguments_are_user_errors(
        self, start_node: Any, arguments: list[str]
    ) -> None:
        node = start_node(*arguments, up=None)
        assert node.wait() == 1
        assert 'ERROR: ROS does not start' in node.log
        assert 'Traceback' not in node.log

    def test_stray_arguments_are_a_usage_error(self, start_node: Any) -> None:
        node = start_node('--', 'stray', up=None)
        assert node.wait() == 2
        assert 'usage: coastdown_node' in node.log


class TestHearing:
    def test_records_what_it_receives(self, start_node: Any, peer: Any, tmp_path: Path) -> None:
        node = start_node()
        block = speeds()
        peer.player.connect(block)
        peer.player.publish(block)
        peer.spin_for(0.5)
        assert node.stop() == 0
        assert topics_in(the_bag(tmp_path)) == {
            '/speed_through_water': 5,
            '/coastdown_node/events': 2,
        }

    def test_rejected_and_broken_messages_are_recorded_and_counted(
        self, start_node: Any, peer: Any, diagnostics: Any, tmp_path: Path
    ) -> None:
        node = start_node()
        block = speeds()
        peer.player.connect(block)
        peer.player.publish(block)
        peer.player.publish(block)
        publisher = peer.advertise(
            '/speed_through_water', 'geometry_msgs/msg/TwistWithCovarianceStamped'
        )
        peer.spin_until(publisher.get_subscription_count)
        publisher.publish(b'\x00\x01\x00\x00 too short')
        part = 'input speed_through_water'
        diagnostics.wait_for(part, '11', value='messages')
        diagnostics.wait_for(part, '1', value='unreadable malformed')
        diagnostics.wait_for(part, '1', value='rejected duplicate')
        diagnostics.wait_for(part, '4', value='rejected out_of_order')
        node.stop()
        assert topics_in(the_bag(tmp_path))['/speed_through_water'] == 11

    def test_inputs_are_recorded_by_their_own_name(
        self, start_node: Any, peer: Any, tmp_path: Path
    ) -> None:
        node = start_node('-r', 'depth:=/sounder/depth', '-r', '__ns:=/ship')
        publisher = peer.advertise('/sounder/depth', 'sensor_msgs/msg/Range')
        peer.spin_until(publisher.get_subscription_count)
        from sensor_msgs.msg import Range

        publisher.publish(Range())
        peer.spin_for(0.3)
        node.stop()
        assert topics_in(the_bag(tmp_path))['/ship/depth'] == 1

    def test_the_clock_offset_of_a_source_is_told(
        self, start_node: Any, peer: Any, diagnostics: Any
    ) -> None:
        start_node()
        block = speeds(age_s=1.5)
        peer.player.connect(block)

        def offset() -> bool:
            peer.player.publish(speeds(age_s=1.5))
            status = diagnostics.of('input speed_through_water')
            values = {} if status is None else {item.key: item.value for item in status.values}
            offset_s = values.get('clock offset [s]', 'none')
            return offset_s != 'none' and 1.4 < float(offset_s) < 2.0

        peer.spin_until(offset)


class TestReports:
    def test_no_data(self, start_node: Any, diagnostics: Any) -> None:
        start_node()
        status = diagnostics.wait_for('state', 'no data')
        assert status.level == b'\x02'

    def test_a_publisher_without_messages(
        self, start_node: Any, peer: Any, diagnostics: Any
    ) -> None:
        start_node()
        peer.player.connect(speeds())
        diagnostics.wait_for('input speed_through_water', 'no data')

    def test_a_type_that_cannot_be_used(
        self, start_node: Any, peer: Any, diagnostics: Any
    ) -> None:
        start_node()
        peer.advertise('/speed_through_water', 'geometry_msgs/msg/Vector3Stamped')
        status = diagnostics.wait_for('input speed_through_water', 'wrong type')
        assert status.level == b'\x02'
        assert 'geometry_msgs/msg/Vector3Stamped' in status.message
        assert 'geometry_msgs/msg/TwistStamped' in status.message

    def test_a_later_publisher_of_another_type(
        self, start_node: Any, peer: Any, diagnostics: Any
    ) -> None:
        start_node(**{'heading.type': 'sensor_msgs/msg/Imu'})
        peer.advertise('/heading', 'geometry_msgs/msg/QuaternionStamped')
        status = diagnostics.wait_for('input heading', 'wrong type')
        assert 'heard is only sensor_msgs/msg/Imu' in status.message

    def test_sim_time_without_clock(self, start_node: Any, peer: Any, diagnostics: Any) -> None:
        start_node(use_sim_time=True)
        diagnostics.wait_for('state', 'no /clock')
        block = speeds()
        peer.player.connect(block)
        peer.player.publish(block)
        key = 'not used, node inactive or without clock'
        diagnostics.wait_for('input speed_through_water', '5', value=key)

    def test_a_full_disk(self, start_node: Any, peer: Any, diagnostics: Any) -> None:
        start_node(output_directory='/proc/nowhere')
        block = speeds()
        peer.player.connect(block)
        peer.player.publish(block)
        status = diagnostics.wait_for('recording', 'recording failed')
        assert status.level == b'\x02'
        diagnostics.wait_for('recording', '6', value='messages not written')
        diagnostics.wait_for('input speed_through_water', '5', value='messages')


class TestLifecycle:
    def test_an_illegal_transition_is_refused_and_survived(
        self, start_node: Any, peer: Any
    ) -> None:
        start_node()
        assert not peer.change_state('configure')
        assert not peer.change_state('no_such_transition')
        assert peer.state() == 'active'

    def test_stops_and_starts_again(
        self, start_node: Any, peer: Any, diagnostics: Any, tmp_path: Path
    ) -> None:
        start_node()
        block = speeds()
        peer.player.connect(block)
        peer.player.publish(block)
        diagnostics.wait_for('input speed_through_water', '5', value='messages')
        assert peer.change_state('deactivate')
        assert topics_in(the_bag(tmp_path))['/speed_through_water'] == 5
        peer.player.publish(speeds())
        key = 'not used, node inactive or without clock'
        diagnostics.wait_for('input speed_through_water', '5', value=key)
        assert peer.change_state('cleanup')
        assert peer.change_state('configure')
        assert peer.change_state('activate')
        assert len(list((tmp_path / 'bags').glob('*.mcap'))) == 2
        assert peer.change_state('shutdown')
        assert peer.state() == 'finalized'

    def test_parameters_are_read_only_while_configured(self, start_node: Any, peer: Any) -> None:
        from rcl_interfaces.srv import DescribeParameters, SetParameters
        from rclpy.parameter import Parameter

        start_node(autostart=False, up='waiting to be configured')

        def set_window(value: float) -> Any:
            request = SetParameters.Request()
            request.parameters = [Parameter('window_s', value=value).to_parameter_msg()]
            answer = peer.call('/coastdown_node/set_parameters', request, SetParameters)
            return answer.results[0]

        assert set_window(900.0).successful
        assert not set_window(-1.0).successful
        assert peer.change_state('configure')
        refused = set_window(800.0)
        assert not refused.successful
        assert 'read-only while configured' in refused.reason
        request = DescribeParameters.Request(names=['window_s', 'order_max'])
        answer = peer.call('/coastdown_node/describe_parameters', request, DescribeParameters)
        window, order = answer.descriptors
        assert '[s]' in window.description
        assert window.floating_point_range[0].to_value == 21600.0
        assert order.integer_range[0].from_value == 3

    def test_a_bad_ship_file_leaves_a_node_to_be_configured_again(
        self, start_node: Any, peer: Any, ship_file: Path
    ) -> None:
        good = ship_file.read_text()
        ship_file.write_text('length_m: -1.0\n')
        start_node(autostart=False, up='waiting to be configured')
        assert not peer.change_state('configure')
        ship_file.write_text(good)
        assert peer.change_state('configure')


class TestEnd:
    @pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
    def test_a_signal_closes_the_bag(
        self, start_node: Any, peer: Any, diagnostics: Any, tmp_path: Path, number: signal.Signals
    ) -> None:
        node = start_node()
        block = speeds()
        peer.player.connect(block)
        peer.player.publish(block)
        diagnostics.wait_for('input speed_through_water', '5', value='messages')
        assert node.stop(number) == 0
        with the_bag(tmp_path).open('rb') as stream:
            reader = make_reader(stream, validate_crcs=True)
            names = [attachment.name for attachment in reader.iter_attachments()]
            assert names == ['ship.yaml', 'parameters.yaml']
            assert reader.get_summary() is not None
        assert topics_in(the_bag(tmp_path))['/speed_through_water'] == 5


class TestServices:
    def test_recording_stops_and_starts(self, start_node: Any, peer: Any, tmp_path: Path) -> None:
        node = start_node()
        block = speeds()
        peer.player.connect(block)
        peer.player.publish(block)
        peer.spin_for(0.3)
        answer = peer.trigger('stop_recording')
        assert answer.success
        assert answer.message == 'not recording'
        first = the_bag(tmp_path)
        later = speeds()
        peer.player.publish(later)
        peer.spin_for(0.3)
        answer = peer.trigger('start_recording')
        assert answer.success
        assert answer.message.startswith('recording to ')
        assert node.stop() == 0
        (second,) = set((tmp_path / 'bags').glob('*.mcap')) - {first}
        assert topics_in(first)['/speed_through_water'] == 5
        # the latest messages come first, those of the stop among them
        assert topics_in(second)['/speed_through_water'] == 10

    def test_reset_is_reported(self, start_node: Any, peer: Any) -> None:
        start_node()
        events = peer.listen('/coastdown_node/events', EVENT_TYPE, raw=True)
        peer.spin_until(lambda: peer.node.count_publishers('/coastdown_node/events'))
        peer.spin_for(0.3)
        assert peer.trigger('reset').success
        peer.spin_until(lambda: len(events) >= 2)
        assert kinds(events)[:2] == [EventKind.RESET_REQUEST, EventKind.RESET]

    def test_services_need_an_active_node(self, start_node: Any, peer: Any) -> None:
        start_node(autostart=False, up='waiting to be configured')
        for name in ('start_recording', 'stop_recording', 'reset'):
            answer = peer.trigger(name)
            assert not answer.success
            assert answer.message == 'the node is not active'


class TestClock:
    def test_a_clock_that_goes_back_begins_a_new_bag(
        self, start_node: Any, peer: Any, diagnostics: Any, tmp_path: Path
    ) -> None:
        node = start_node(use_sim_time=True)
        events = peer.listen('/coastdown_node/events', EVENT_TYPE, raw=True)
        epoch_ns = 1_700_000_000 * 10**9
        block = Block.of(Channel.SPEED_THROUGH_WATER, epoch_ns + np.arange(3) * 10**8, [5, 6, 7])
        peer.player.connect(block)
        for start_ns in (0, -3600 * 10**9):
            moved = Block.of(Channel.SPEED_THROUGH_WATER, block.stamp_ns + start_ns, [5, 6, 7])
            peer.player.set_clock(int(moved.stamp_ns[-1]))
            peer.spin_for(0.3)
            peer.player.publish(moved)
            peer.spin_for(0.3)
        peer.spin_until(lambda: EventKind.CLOCK_JUMP in kinds(events))
        diagnostics.wait_for('input speed_through_water', '6', value='messages')
        assert node.stop() == 0
        bags = sorted((tmp_path / 'bags').glob('*.mcap'))
        assert [topics_in(bag)['/speed_through_water'] for bag in bags] == [3, 3]
