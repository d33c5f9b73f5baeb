# SPDX-License-Identifier: Apache-2.0
"""No attack by a file, or by a peer of the NMEA input, succeeds."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from pynmeagps.nmeahelpers import calc_checksum

from shipdrag_ros.bags.durable import DurableRecording, PartLimits
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.messages import EncodedMessage
from shipdrag_ros.nmea.interpreter import Interpreter
from shipdrag_ros.nmea.live import LiveNmea, parse_addresses
from shipdrag_ros.ship import Ship

SECRET = 'hunter2'
WITHIN_S = 5.0
SHIP_FILES: dict[str, Callable[[Path], object]] = {
    'a pipe that nobody writes': os.mkfifo,
    'a device that never ends': lambda path: path.symlink_to('/dev/zero'),
    'a terabyte of zeros': lambda path: (path.touch(), os.truncate(path, 2**40)),
    'another file, to read it in the error': lambda path: path.write_text(f'password: {SECRET}\n'),
    'another file that is no mapping': lambda path: path.write_text(f'root:x:{SECRET}:/bin/sh\n'),
}


@pytest.mark.parametrize('kind', SHIP_FILES)
def test_a_ship_file_is_refused_soon_without_a_word_of_what_is_in_it(kind, tmp_path) -> None:
    SHIP_FILES[kind](tmp_path / 'ship.yaml')
    begun_s = time.monotonic()
    with pytest.raises(ShipdragError) as refused:
        Ship.load(tmp_path / 'ship.yaml')
    assert time.monotonic() - begun_s < WITHIN_S
    assert SECRET not in str(refused.value)


def record(directory: Path) -> None:
    """Record one message into a folder."""
    it = DurableRecording(directory, stem='coastdown_x', attachments={}, limits=PartLimits())
    it.put(EncodedMessage('/depth', 'sensor_msgs/msg/Range', b'\x00\x01\x00\x00', 1, 1))
    time.sleep(0.5)
    it.stop()
    it.wait_ended(WITHIN_S)


def test_no_link_is_followed_where_recordings_are_written(tmp_path) -> None:
    target, victim = tmp_path / 'target', tmp_path / 'victim'
    target.mkdir()
    (tmp_path / 'linked').symlink_to(target)
    record(tmp_path / 'linked')
    assert not list(target.iterdir())
    victim.write_text('precious')
    (tmp_path / 'bags').mkdir()
    (tmp_path / 'bags' / 'coastdown_x_000.mcap').symlink_to(victim)
    record(tmp_path / 'bags')
    assert victim.read_text() == 'precious'
    assert [path for path in (tmp_path / 'bags').iterdir() if not path.is_symlink()]


def test_a_peer_that_closes_at_once_always_is_not_asked_without_pause() -> None:
    with socket.create_server(('127.0.0.1', 0)) as server:
        server.settimeout(0.2)
        sources = parse_addresses(f'tcp://127.0.0.1:{server.getsockname()[1]}')
        live = LiveNmea(sources, clock_ns=time.time_ns, wake=lambda: None)
        live.start()
        end_s = time.monotonic() + 3.0
        while time.monotonic() < end_s:
            try:
                server.accept()[0].close()
            except TimeoutError:
                continue
        (counts,) = live.counts().values()
        live.close()
    assert 1 < counts.opened < 20


def test_four_thousand_invented_sentences_take_no_memory_each() -> None:
    interpreter = Interpreter()
    for number in range(4096):
        content = f'GP{number:03X}'
        interpreter.messages(f'${content}*{calc_checksum(content)}', 'udp', 10**18)
    assert len(interpreter.unknown) < 100
