# SPDX-License-Identifier: Apache-2.0
"""`node` starts the node with what it was given, and says what is missing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from shipdrag_ros.cli import main

SHIPDRAG = Path(sys.executable).with_name('shipdrag')
LIMIT_S = 60.0


@pytest.mark.parametrize('verb', ['node', 'demo'])
def test_without_ros_it_says_how_to_get_it(
    verb: str,
    ship_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name in list(sys.modules):
        if name.startswith('shipdrag_ros.node'):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, 'rclpy', None)
    ship = ('--ship', str(ship_file)) if verb == 'node' else ()
    assert main([verb, *ship, '--out', str(tmp_path / 'out')]) == 1
    captured = capsys.readouterr()
    assert captured.err.startswith("ERROR: ROS 2 is not installed here (no module 'rclpy')")
    assert 'pip install .[ros]' in captured.err
    assert not (tmp_path / 'out').exists()


def test_a_bad_ship_file_is_told_before_ros_starts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['node', '--ship', 'no such.yaml', '--out', str(tmp_path)]) == 1
    assert 'no such.yaml: 1 problem' in capsys.readouterr().err


def test_it_records_where_it_was_told_and_ends_on_a_signal(
    ship_file: Path, tmp_path: Path
) -> None:
    pytest.importorskip('rclpy')
    worker = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0').removeprefix('gw'))
    environment = os.environ | {
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_DOMAIN_ID': str(10 + worker),
    }
    log = tmp_path / 'log'
    line = ['node', '--ship', ship_file, '--out', tmp_path / 'bags']
    with log.open('w') as file:
        node = subprocess.Popen(
            [SHIPDRAG, *line, '--ros-args', '-p', 'froude_min:=0.07'],
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            env=environment,
        )
    try:
        end_s = time.monotonic() + LIMIT_S
        while 'active; recording to' not in log.read_text():
            assert node.poll() is None, log.read_text()
            assert time.monotonic() < end_s
            time.sleep(0.1)
        node.send_signal(signal.SIGINT)
        assert node.wait(timeout=LIMIT_S) == 0
    finally:
        node.kill()
        node.wait()
    assert 'froude_min=0.07' in log.read_text()
    assert len(list((tmp_path / 'bags').glob('*.mcap'))) == 1
