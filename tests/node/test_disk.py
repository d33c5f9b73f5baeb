# SPDX-License-Identifier: Apache-2.0
"""The node as a process whose disk fails, or that is killed: what is there afterwards."""

from __future__ import annotations

import shutil
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.bags import Run, open_runs
from shipdrag_ros.samples import Block, Channel
from tests.node.conftest import values

pytest.importorskip('rclpy')

PART = 'recording'
INPUT = 'input speed_through_water'


def speeds(count: int) -> Block:
    """Readings of a speed log, the last one now."""
    stamps = time.time_ns() - np.arange(count)[::-1] * 10**4
    return Block.of(Channel.SPEED_THROUGH_WATER, stamps, np.full(count, 5.0))


class Ship:
    """What feeds the node, and what it says of its recording."""

    def __init__(self, peer: Any, diagnostics: Any, directory: Path) -> None:
        self.diagnostics = diagnostics
        self.peer = peer
        self.directory = directory
        self.sent = 0
        self._player = peer.player

    def send(self, count: int) -> None:
        """Publish readings, and return once they are used."""
        self._player.connect(speeds(1))
        self._player.publish(speeds(count))
        self.sent += count
        self.diagnostics.wait_for(INPUT, str(self.sent), value='used')

    def send_until_used(self) -> None:
        """Publish a reading a second, as a log does, until a node just started uses one."""
        self.diagnostics.forget()

        def used() -> bool:
            self._player.publish(speeds(1))
            self.peer.spin_for(1.0)
            status = self.diagnostics.of(INPUT)
            return status is not None and values(status)['used'] != '0'

        self.peer.spin_until(used)

    def wait_recorded(self) -> None:
        """Return once all that was sent is on the disk, and the first event."""
        self.diagnostics.wait_for(PART, str(self.sent + 1), value='messages')

    def said(self, key: str) -> str:
        return values(self.diagnostics.of(PART))[key]

    def bags(self) -> list[Path]:
        return sorted(self.directory.glob('*.mcap'))


@pytest.fixture
def ship(peer: Any, diagnostics: Any, tmp_path: Path) -> Ship:
    return Ship(peer, diagnostics, tmp_path / 'bags')


def speeds_in(run: Run) -> int:
    return {topic.topic: topic.messages for topic in run.topics}['/speed_through_water']


def test_killed_it_leaves_what_it_said_and_started_anew_it_overwrites_nothing(start_node, ship):
    node = start_node()
    ship.send(20)
    ship.wait_recorded()
    ship.send(5)
    node.kill()
    (first,) = ship.bags()
    left = first.read_bytes()
    (run,) = open_runs([first])
    assert 20 <= speeds_in(run) <= 25
    assert list(run.attachments) == ['ship.yaml', 'parameters.yaml']

    # the killed node still counts as a listener for some seconds, so that one reading may
    # go to it alone
    node = start_node()
    ship.send_until_used()
    assert node.stop() == 0
    assert first.read_bytes() == left
    assert len(ship.bags()) == 2


def test_a_full_disk_is_told_and_only_what_it_never_took_is_lost(start_node, peer, ship):
    node = start_node()
    ship.send(5)
    ship.wait_recorded()
    node.fill_disk(1000)
    ship.send(5)
    assert ship.diagnostics.wait_for(PART, 'File too large').level == b'\x02'
    ship.send(5)
    ship.diagnostics.wait_for(PART, '10', value='messages in memory only')
    assert ship.said('messages lost') == '0'
    node.fill_disk(None)
    ship.wait_recorded()
    assert ship.diagnostics.wait_for(PART, 'recording to ').level == b'\x00'

    node.fill_disk(1000)
    ship.send(5)
    ship.diagnostics.wait_for(PART, '5', value='messages in memory only')
    assert peer.change_state('deactivate')  # an event
    ship.diagnostics.wait_for(PART, 'recording failed, 6 message(s) lost, 0 kept')
    (run,) = open_runs(ship.bags())
    assert (len(run.paths), speeds_in(run)) == (2, 15)


def test_a_directory_that_vanishes_is_told_and_made_again(start_node: Any, ship: Ship) -> None:
    node = start_node()
    ship.send(5)
    ship.wait_recorded()
    shutil.rmtree(ship.directory)
    ship.send(5)
    ship.diagnostics.wait_for(PART, '5', value='messages')
    status = ship.diagnostics.wait_for(PART, 'recording to ')
    assert status.level == b'\x01'
    assert 'somebody removed 1 file(s)' in status.message
    assert ship.said('messages lost') == '6'  # five readings and an event were in it
    assert ship.said('part [1]') == '0'  # its name is free again
    assert node.stop() == 0
    assert 'somebody removed 1 file(s)' in node.log
    (run,) = open_runs(ship.bags())
    assert speeds_in(run) == 5


@pytest.mark.parametrize('limit', [{'part_duration_s': 1.0}, {'part_size_bytes': 100_000}])
def test_parts_stand_alone_and_are_read_as_one(start_node, ship, limit):
    node = start_node(**limit)
    ship.send(100)
    while ship.said('part [1]') < '2':
        ship.send(100)
    assert node.stop() == 0
    parts = ship.bags()
    assert len(parts) >= 3
    (run,) = open_runs(parts)
    assert run.warnings == ()
    assert speeds_in(run) == ship.sent
    for part in parts:
        (alone,) = open_runs([part])
        assert alone.attachments == run.attachments
