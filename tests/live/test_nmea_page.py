# SPDX-License-Identifier: Apache-2.0
"""NMEA over a real UDP socket, the node, the page in a real browser: what a mate reads."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.sources.log_samples import sentence

pytest.importorskip('rclpy')

import rclpy
from rosgraph_msgs.msg import Clock

SHIP = Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml'
GROUND = ('GPVTG,90.0,T,,M,10.2,N,18.9,K,A',)
LOG = ('IIVHW,90.0,T,,M,10.0,N,18.5,K',)
CONTEXT = (
    'HEHDT,90.0,T',
    'IIMWV,0.0,R,12.0,N,A',
    'SDDPT,120.0,0.0,',
    'IIRSA,1.0,A,,V',
    'IIRPM,S,1,60.0,,A',
)
START_S = 1_700_000_000.0
LATEST_S = 20.0  # by which a silence stands in the headline, on a machine that has much to do


class Talker:
    """A clock, and instruments that send their sentences once a second of it, from a thread."""

    def __init__(self) -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node('talker', context=self._context)
        self._clock = self._node.create_publisher(Clock, '/clock', 10)
        self.pace = 1.0  # times as fast as life
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(('127.0.0.1', 0))
            self.port = probe.getsockname()[1]
        self.sentences: tuple[str, ...] = ()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._talk)
        self._thread.start()

    def _talk(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            now_s, due_s, last_s = START_S, START_S, time.monotonic()
            while not self._ended.wait(0.05):
                now_s += self.pace * (time.monotonic() - last_s)
                last_s = time.monotonic()
                clock = Clock()
                clock.clock.sec, clock.clock.nanosec = int(now_s), int(now_s % 1.0 * 1e9)
                self._clock.publish(clock)
                if now_s < due_s:
                    continue
                due_s += 1.0
                for each in self.sentences:
                    line.sendto(f'{sentence(each)}\r\n'.encode(), ('127.0.0.1', self.port))

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)


@pytest.fixture
def talker(start: Any) -> Iterator[Talker]:  # in the domain of the node
    it = Talker()
    yield it
    it.close()


def checklist(viewer: Any) -> dict[str, str]:
    rows = viewer.page.query_selector_all('#checks li')
    return {row.query_selector('b').inner_text(): row.inner_text() for row in rows}


def test_what_instruments_say_by_nmea_is_what_a_mate_reads(start, view, talker, tmp_path):
    parameters = {
        'ship_file': str(SHIP),
        'use_sim_time': True,
        'output_directory': str(tmp_path / 'bags'),
        'nmea': f'udp://127.0.0.1:{talker.port}',
        'steady_s': 60.0,
        'slope_window_s': 5.0,
    }
    file = tmp_path / 'parameters.yaml'
    file.write_text(yaml.safe_dump({'/**': {'ros__parameters': parameters}}))
    node = start('shipdrag_ros.node.main', '--ros-args', '--params-file', file)
    watch = start('shipdrag_ros.cli', 'watch', '--port', '0')
    viewer = view(watch.wait_for(r'the page: (\S+)'))
    node.wait_for('ready to estimate')

    talker.sentences = GROUND
    viewer.wait_for('#figure-speed', '10.2 kn')
    assert viewer.text('#note-speed') == 'over ground'
    talker.sentences = (*GROUND, *LOG, *CONTEXT)
    viewer.wait_for('#figure-speed', '10.0 kn')
    assert viewer.text('#note-speed') == 'through water'
    viewer.wait_for('#shaft-say', 'Now: 60 rpm')
    viewer.wait_for('#checks', '120 m, at least 41 m')
    for name in ('Wind', 'Depth', 'Rudder', 'Course'):
        assert 'yes' in checklist(viewer)[name], checklist(viewer)
    viewer.wait_for('#inputs', '1.0 Hz')

    # one clock: the headline counts to where it says that the record is ready
    said = viewer.wait_for('#headline', 'of 1 min')
    assert said.startswith('STEADY 0 of 1 min')
    assert viewer.text('#action').endswith('Ready in 1 min.')
    assert ' of 1:00' in checklist(viewer)['Steady lead']
    talker.pace = 8.0
    viewer.wait_for('#headline', 'record ready')
    talker.pace = 1.0
    assert viewer.page.get_attribute('#state', 'data-tone') == 'good'
    assert 'yes' in checklist(viewer)['Steady lead']

    # the log dies: the speed is that over ground, and the page is green no longer
    talker.sentences = (*GROUND, *CONTEXT)
    died_s = time.monotonic()
    viewer.wait_for('#note-speed', 'over ground', within_s=LATEST_S)
    viewer.page.wait_for_selector('#state:not([data-tone=good])', timeout=LATEST_S * 1e3)
    assert 'speed through water: no data for' in viewer.text('#action')
    assert time.monotonic() - died_s < LATEST_S

    # all instruments die
    talker.sentences = ()
    viewer.wait_for('#headline', 'NO SPEED', within_s=LATEST_S)
    assert viewer.page.get_attribute('#state', 'data-tone') == 'bad'
    assert ' s old' in viewer.text('#note-speed')
    assert 'stale' in viewer.page.get_attribute('#figure-speed', 'class')
    # no topic of the node itself is offered, and the last figures are not those of now
    assert '/coastdown_node/nmea' not in viewer.text('#action')
    viewer.wait_for('#trace-say', 'Last: ', within_s=LATEST_S)
    viewer.wait_for('#shaft-say', 'Last: 60 rpm', within_s=LATEST_S)
    assert 'over ground' in viewer.text('#note-speed')
    viewer.wait_for('#checks', 'no reading now')
    for name in ('Wind', 'Depth', 'Rudder', 'Course'):
        assert 'no reading now: no data for' in checklist(viewer)[name]
    assert node.stop() == 0
    assert watch.stop() == 0
