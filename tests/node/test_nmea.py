# SPDX-License-Identifier: Apache-2.0
"""NMEA 0183 heard by the node: fed, recorded raw, reported, replayed to the bit."""

from __future__ import annotations

import math
import socket
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.node.conftest import Instruments, values
from tests.recorded import rows
from tests.sources.log_samples import sentence

pytest.importorskip('rclpy')

from shipdrag_ros.bags import open_runs
from shipdrag_ros.messages import encode, types
from shipdrag_ros.replay import replay
from shipdrag_ros.samples import Block, Channel

SPEED_TYPE = 'geometry_msgs/msg/TwistWithCovarianceStamped'


def test_what_is_heard_is_used_recorded_and_replayed(
    start_node: Any, peer: Any, diagnostics: Any, instruments: Instruments, tmp_path: Path
) -> None:
    node = start_node(nmea=instruments.source)
    part = f'nmea {instruments.source}'
    diagnostics.wait_for(part, 'nothing heard yet')
    silent = diagnostics.wait_for('state', f'NMEA {instruments.source}: open, nothing heard yet')
    assert silent.level == b'\x02'
    diagnostics.wait_for('input position', 'no publisher, and nothing by NMEA so far')
    instruments.say(sentence('SDDPT,20.0,'))
    diagnostics.wait_for('state', '1 lines heard, none of use yet for speed or position (RMC, GGA')
    diagnostics.wait_for(part, 'depth is not used: set nmea_transducer_m')
    used = lambda: (  # noqa: E731
        diagnostics.of('input speed_through_water') is not None
        and int(values(diagnostics.of('input speed_through_water')).get('used', '0')) >= 5
    )
    instruments.until(used, peer, 'IIVHW,,T,,M,10.0,N,,K', 'HEHDT,90.0,T', 'IIRPM,S,1,60.0,,A')
    instruments.say(sentence('HEHDT,90.0,T')[:-2] + '00', sentence('GPXYZ,1'))
    status = diagnostics.wait_for(part, '1', value='rejected wrong checksum')
    found = values(status)
    assert found['of all sources: unknown sentence GPXYZ'] == '1'
    assert found['feeds speed_through_water'] == 'IIVHW'
    assert found['feeds shaft'] == 'IIRPM shaft 1'
    status = diagnostics.of('input speed_through_water')
    assert status.level == b'\x00'
    assert status.message == f'receiving, from NMEA {instruments.source}'
    assert values(status)['fed by'] == f'NMEA {instruments.source}'
    assert values(status)['type'] == SPEED_TYPE
    assert values(status)['topic'] == '/coastdown_node/nmea/speed_through_water'
    assert node.stop() == 0

    (bag,) = (tmp_path / 'bags').glob('*.mcap')
    lines = [types.deserialize(types.STRING, row.payload).data for row in rows(bag, '/nmea')]
    assert lines == instruments.sent
    speeds = rows(bag, '/speed_through_water')
    twist = types.deserialize(SPEED_TYPE, speeds[0].payload).twist.twist
    assert math.isclose(twist.linear.x, 10.0 * 1852.0 / 3600.0)
    (run,) = open_runs([bag])
    result = replay(run)
    assert result.inputs['speed_through_water'].messages == len(speeds)
    assert result.recorded.first_difference is None


def test_a_topic_that_is_there_feeds_and_nmea_is_counted(
    start_node: Any, peer: Any, diagnostics: Any, instruments: Instruments
) -> None:
    start_node(nmea=instruments.source)
    publisher = peer.advertise('/speed_through_water', SPEED_TYPE)
    peer.wait_for_listener(publisher)
    (good,) = encode(Block.of(Channel.SPEED_THROUGH_WATER, [time.time_ns()], [5.0]))
    assert good.type == SPEED_TYPE
    publisher.publish(good.payload)
    diagnostics.wait_for('input speed_through_water', '1', value='messages')
    part = f'nmea {instruments.source}'
    key = 'not used, a topic feeds speed_through_water'
    refused = lambda: key in values(diagnostics.wait_for(part, ''))  # noqa: E731
    instruments.until(refused, peer, 'IIVHW,,T,,M,10.0,N,,K', 'HEHDT,90.0,T')
    assert values(diagnostics.of('input speed_through_water'))['messages'] == '1'

    late = peer.advertise('/heading', 'geometry_msgs/msg/QuaternionStamped')
    peer.wait_for_listener(late)
    late.publish(b'\x00\x01\x00\x00 not used')
    status = diagnostics.wait_for(part, 'heading: also published as a topic, which is not used')
    assert status.level == b'\x01'


def test_a_line_is_not_blamed_for_the_noise_of_another(start_node, diagnostics, peer, instruments):
    with socket.create_server(('127.0.0.1', 0)) as server:
        noisy = f'tcp://127.0.0.1:{server.getsockname()[1]}'
        start_node(nmea=f'{instruments.source} {noisy}')
        line, _ = server.accept()
        with line:
            line.sendall(b'$IIVHW,,T,,M,10.0,N,,K\r\n' * 40)  # no checksum
            status = diagnostics.wait_for(f'nmea {noisy}', '40 of 40 lines are damaged')
            assert values(status)['rejected without checksum'] == '40'
            instruments.say(sentence('HEHDT,90.0,T'))
            part = f'nmea {instruments.source}'
            diagnostics.wait_for(part, '1', value='sentences')
            status = diagnostics.wait_for(part, 'nothing used yet')
            assert status.level == b'\x00'
            assert 'rejected without checksum' not in values(status)
            said = '40 lines heard, none a sentence (without checksum): look at what sends them'
            diagnostics.wait_for('state', said)


def test_of_two_lines_the_second_takes_over_when_the_first_is_cut(
    start_node: Any, peer: Any, diagnostics: Any, tmp_path: Path
) -> None:
    speed = sentence('VWVHW,,T,,M,9.0,N,,K').encode() + b'\r\n'
    with ExitStack() as open_lines:
        servers = [
            open_lines.enter_context(socket.create_server(('127.0.0.1', 0))) for _ in range(2)
        ]
        names = [f'tcp://127.0.0.1:{server.getsockname()[1]}' for server in servers]
        node = start_node(nmea=' '.join(names))
        lines = [open_lines.enter_context(server.accept()[0]) for server in servers]

        def fed_by() -> str:
            status = diagnostics.of('input speed_through_water')
            return '' if status is None else values(status).get('fed by', '').removeprefix('NMEA ')

        def speak_until(condition: Any, *lines: socket.socket) -> None:
            end = time.monotonic() + 100.0
            while not condition():
                assert time.monotonic() < end, fed_by()
                for line in lines:
                    line.sendall(speed)
                peer.spin_for(0.1)

        speak_until(fed_by, *lines)
        first = names.index(fed_by())
        before, after = names[first], names[1 - first]
        lines[first].sendall(speed[:9])
        lines[first].close()
        servers[first].close()
        began_s = time.monotonic()
        speak_until(lambda: fed_by() == after, lines[1 - first])
        assert time.monotonic() < began_s + 30.0
        status = diagnostics.of(f'nmea {before}')
        assert [key for key in values(status) if key.startswith('rejected')]
        assert node.stop() == 0
    said = f'speed_through_water: now from VWVHW on {after}, no longer from VWVHW on {before}'
    assert said in node.log
    (bag,) = (tmp_path / 'bags').glob('*.mcap')
    assert any(said.encode() in row.payload for row in rows(bag, '/coastdown_node/events'))
    assert any(speed[:9] in row.payload for row in rows(bag, '/nmea'))
