# SPDX-License-Identifier: Apache-2.0
"""The process around the node: user errors, signals, the ways to start it."""

from __future__ import annotations

import io
import json
import signal
from pathlib import Path
from typing import Any

import pytest

from shipdrag_ros.messages.topics import Health, Status
from shipdrag_ros.node.main import line, show
from tests.processes import Process
from tests.recorded import attachments, rows, summary

rclpy = pytest.importorskip('rclpy')
STATE = {
    'lifecycle': 'active',
    'monitor': 'steady',
    'steady lead [s]': '600',
    'steady lead used at most [s]': '1800',
}
FIGURES = {
    'speed through water [m/s]': '5.144444',
    'specific resistance [m/s^2]': '0.02',
    'standard deviation of it [m/s^2]': '0.0005',
}


from shipdrag_ros.node.main import main  # noqa: E402
from shipdrag_ros.node.node import CoastdownNode  # noqa: E402


@pytest.mark.parametrize(
    ('name', 'value', 'said'),
    [
        ('nmea', 'udp://here', "NMEA source 'udp://here': expected udp://ADDRESS:PORT"),
        ('record', 1, 'record: 1, expected true or false'),
        ('depth.type', 'std_msgs/msg/Float64', 'expected one of sensor_msgs/msg/Range'),
        ('ship_file', '', 'expected the path of a ship file'),
        ('forecast_speeds', [], 'forecast_speeds: None, expected a list'),
        ('windows_s', [], 'windows_s: unknown key'),
        ('use_sim_time', [], 'use_sim_time: None, expected true or false'),
        ('use_sim_time', 3, 'use_sim_time: 3, expected true or false'),
    ],
)
def test_bad_parameters_are_user_errors(capfd, name: str, value: object, said: str) -> None:
    line = ['coastdown_node', '--ros-args', '-p', f'{name}:={json.dumps(value)}']
    assert main(line) == 1
    error = capfd.readouterr().err
    assert 'ERROR: ' in error
    assert said in error


@pytest.mark.parametrize(
    ('section', 'namespace'),
    [
        ('/**', ''),
        ('coastdown_node', ''),
        ('/ship/coastdown_node', '/ship'),
        ('/*/coastdown_node', '/ship'),
        ('/**/coastdown_node', '/big/ship'),
    ],
)
def test_parameters_for_this_node_are_read(capfd, tmp_path, section: str, namespace: str) -> None:
    file = tmp_path / 'ours.yaml'
    file.write_text(f'{section}:\n  ros__parameters: {{windows_s: 600.0}}\n')
    line = ['coastdown_node', '--ros-args', '--params-file', str(file)]
    line += ['-r', f'__ns:={namespace or "/"}']
    assert main(line) == 1
    assert 'windows_s: unknown key' in capfd.readouterr().err


def test_signal_handlers_are_given_back() -> None:
    before = signal.getsignal(signal.SIGTERM)
    main(['coastdown_node', '--ros-args', '-p', 'ship_file:=/nowhere'])
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_a_readable_bag(start_node, peer, tmp_path, number):
    node = start_node()
    publisher = peer.advertise('/depth', 'sensor_msgs/msg/Range')
    peer.wait_for_listener(publisher)
    publisher.publish(b'\x00\x01\x00\x00 one input')
    node.wait_for_file(tmp_path / 'bags')
    assert node.stop(number) == 0
    (bag,) = (tmp_path / 'bags').glob('*.mcap')
    assert list(attachments(bag)) == ['ship.yaml', 'parameters.yaml']
    assert summary(bag).statistics.message_count == 3  # two events besides


def test_without_an_input_it_leaves_no_file(start_node: Any, tmp_path: Path) -> None:
    node = start_node()
    assert f'recordings are written to {tmp_path / "bags"}' in node.log
    assert 'where the first input makes a file' in node.log
    assert node.stop() == 0
    assert list((tmp_path / 'bags').iterdir()) == []


def test_starts_from_a_call_with_any_path(tmp_path, ship_file, monkeypatch) -> None:
    ship = ship_file.rename(tmp_path / "ship: 'no 1' #.yaml")
    code = (
        'import sys; from shipdrag_ros.node.main import run\n'
        f'sys.exit(run({str(ship)!r}, "123", settings={{"keep_days": 2.0}}, '
        'ros_arguments=["-p", "window_s:=600", "-p", "keep_days:=1.0"]))'
    )
    monkeypatch.chdir(tmp_path)
    node = Process(tmp_path / 'log', '-c', code)
    try:
        node.wait_for('active;')
        assert node.stop(signal.SIGINT) == 0
    finally:
        node.kill()
    said = (tmp_path / 'log').read_text()
    assert f'recording to {tmp_path / "123"}' in said
    assert 'window_s=600.0' in said
    assert 'keep_days=2.0' in said


def test_a_start_without_compiled_code_hears_records_and_ends_when_asked(
    start_node: Any, peer: Any, diagnostics: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('SHIPDRAG_CACHE_DIR', str(tmp_path / 'nothing compiled'))
    node = start_node(up='active;', fresh=True)
    publisher = peer.advertise('/speed_through_water', 'geometry_msgs/msg/TwistStamped')
    peer.wait_for_listener(publisher)
    sent = [b'\x00\x01\x00\x00' + bytes([k, 0, 0, 101]) + bytes(60) for k in range(5)]
    for payload in sent:
        publisher.publish(payload)
    status = diagnostics.wait_for('state', '5 messages are recorded and wait')
    assert status.message.startswith('compiling, ')
    assert status.level == b'\x01'
    diagnostics.wait_for('input speed_through_water', '5', value='messages')
    diagnostics.wait_for('recording', '6', value='messages')
    node.wait_for_log('compiling, as on the first start')
    assert peer.trigger('start_recording').success
    assert node.stop() == 0
    assert 'ready to estimate' not in node.log
    (bag,) = (tmp_path / 'bags').glob('*.mcap')
    assert [row.payload for row in rows(bag, '/speed_through_water')] == sent


def test_the_bag_is_closed_also_when_ros_is_gone(tmp_path: Path, ship_file: Path) -> None:
    context = rclpy.Context()
    line = ['--ros-args', '-p', f'ship_file:={ship_file}', '-p', f'output_directory:={tmp_path}']
    line += ['-p', 'nmea:=udp://127.0.0.1:10110']
    rclpy.init(args=line, context=context)
    node = CoastdownNode(context=context, arguments=line)
    node.start()
    rclpy.shutdown(context=context)
    node.close()
    assert list(tmp_path.glob('*.mcap')) == []


def test_it_holds_state_figure_and_inputs() -> None:
    health = Health(
        (
            Status('n', 'state', 0, 'steady', STATE),
            Status('n', 'input heading', 1, 'frozen', {'messages': '5'}),
            Status('n', 'input depth', 0, 'no publisher', {'messages': '0'}),
            Status('n', 'estimate', 0, '', FIGURES),
        )
    )
    assert line(health) == (
        'steady 10 min: record ready | last at 10.0 kn: r 0.0200 m/s² ± 5 % | '
        '1 inputs, not well: heading'
    )


def test_what_keeps_it_from_estimating_comes_first() -> None:
    health = Health((Status('n', 'state', 2, 'no data: nothing on any of a', STATE),))
    assert line(health).startswith('no data: nothing on any of a |')


def test_an_input_that_is_not_well_hides_no_state() -> None:
    state = Status('n', 'state', 1, 'steady; not well, heading: stuck', STATE)
    assert line(Health((state,))).startswith('steady 10 min: record ready |')


def test_without_a_terminal_there_is_no_line() -> None:
    stream = io.StringIO()
    show(Health(()), stream)
    assert stream.getvalue() == ''


def test_stray_arguments_are_a_usage_error(capfd: pytest.CaptureFixture[str]) -> None:
    assert main(['coastdown_node', 'stray']) == 2
    assert 'usage: coastdown_node' in capfd.readouterr().err
