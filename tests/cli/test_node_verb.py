# SPDX-License-Identifier: Apache-2.0
"""`node` starts the node with what it was given, and says what is missing."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from shipdrag_ros.cli import main

SHIPDRAG = Path(sys.executable).with_name('shipdrag')
LIMIT_S = 240.0


@pytest.mark.parametrize('verb', ['node', 'demo'])
def test_without_ros_it_says_how_to_get_it(verb, ship_file, tmp_path, monkeypatch, capsys):
    # what is imported anew here is forgotten afterwards, by the package above it too
    monkeypatch.setattr('shipdrag_ros.node', None, raising=False)
    for name in list(sys.modules):
        if name.startswith('shipdrag_ros.node'):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, 'rclpy', None)
    ship = ('--ship', str(ship_file)) if verb == 'node' else ()
    assert main([verb, *ship, '--out', str(tmp_path / 'out')]) == 1
    captured = capsys.readouterr()
    assert "ROS 2 is not installed here (no module 'rclpy')" in captured.err
    assert "pip install 'shipdrag_ros[ros]'" in captured.err
    assert not (tmp_path / 'out').exists()


def test_a_bad_ship_file_is_told_before_ros_starts(tmp_path, capsys) -> None:
    assert main(['node', '--ship', 'no such.yaml', '--out', str(tmp_path)]) == 1
    assert 'no such.yaml: 1 problem' in capsys.readouterr().err
    ship = tmp_path / 'ship.yaml'
    effect = 'effects: [{name: foulng, parameters: {friction_factor: {value: 0.3, sd: 0.1}}}]\n'
    ship.write_text(f'length_m: 150.0\ndisplaced_volume_m3: 20200.0\n{effect}')
    assert main(['node', '--ship', str(ship), '--out', str(tmp_path)]) == 1
    assert "effects: 'foulng' is not known" in capsys.readouterr().err


ROOT = Path(__file__).resolve().parents[2]


def node_log(tmp_path: Path, ship: Path, *ros_arguments: str) -> str:
    """Start the node, end it by a signal once it records, and return what it said."""
    pytest.importorskip('rclpy')
    log = tmp_path / 'log'
    line = [SHIPDRAG, 'node', '--ship', ship, '--out', tmp_path / 'bags', '--ros-args']
    with log.open('w') as file:
        node = subprocess.Popen(
            [*line, *ros_arguments],
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
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
    return log.read_text()


@pytest.mark.parametrize(
    ('changed', 'said'),
    [
        ({}, False),  # the file as it is: no ship file, recordings into '.'
        ({'ship_file': 'another.yaml', 'output_directory': 'elsewhere'}, True),
    ],
)
def test_the_command_line_holds_over_a_parameter_file(ship_file, tmp_path, changed, said):
    tree = yaml.safe_load((ROOT / 'config' / 'parameters.yaml').read_text())
    tree['/**']['ros__parameters'] |= {**changed, 'froude_min': 0.07}
    file = tmp_path / 'parameters.yaml'
    file.write_text(yaml.safe_dump(tree))
    log = node_log(tmp_path, ship_file, '--params-file', str(file))
    assert f"ship_file='{ship_file}'" in log
    assert f"output_directory='{tmp_path / 'bags'}'" in log
    assert 'froude_min=0.07' in log  # the rest of the file holds
    assert list((tmp_path / 'bags').iterdir()) == []  # nothing was heard
    line = f"ship_file 'another.yaml' of {file} is not used: --ship says '{ship_file}'"
    assert (line in log) == said
    assert ("output_directory 'elsewhere'" in log) == said


def test_the_command_line_holds_over_what_follows_ros_args(ship_file: Path, tmp_path) -> None:
    log = node_log(tmp_path, ship_file, '-p', 'ship_file:=another.yaml')
    assert f"ship_file='{ship_file}'" in log
    assert "ship_file 'another.yaml' of -p is not used" in log
