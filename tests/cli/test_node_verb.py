# SPDX-License-Identifier: Apache-2.0
"""`node` starts the node with what it was given, and says what is missing."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest
import yaml

from shipdrag_ros.cli import main
from tests.processes import Process


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


@pytest.mark.parametrize('changed', [False, True])
def test_the_command_line_holds_over_a_parameter_file_and_ros_args(ship_file, tmp_path, changed):
    """The file as it is has no ship file and records into '.'."""
    pytest.importorskip('rclpy')
    tree = yaml.safe_load((ROOT / 'config' / 'parameters.yaml').read_text())
    more = {'output_directory': 'elsewhere'} if changed else {}
    tree['/**']['ros__parameters'] |= {**more, 'froude_min': 0.07}
    file = tmp_path / 'parameters.yaml'
    file.write_text(yaml.safe_dump(tree))
    line = ['node', '--ship', ship_file, '--out', tmp_path / 'bags', '--ros-args']
    line += ['--params-file', file, *(['-p', 'ship_file:=another.yaml'] if changed else [])]
    node = Process(tmp_path / 'log', '-m', 'shipdrag_ros.cli', *line)
    try:
        node.wait_for('active; recording to')
        assert node.stop(signal.SIGINT) == 0
    finally:
        node.kill()
    log = (tmp_path / 'log').read_text()
    assert f"ship_file='{ship_file}'" in log
    assert f"output_directory='{tmp_path / 'bags'}'" in log
    assert 'froude_min=0.07' in log  # the rest of the file holds
    assert list((tmp_path / 'bags').iterdir()) == []  # nothing was heard
    said = f"ship_file 'another.yaml' of -p is not used: --ship says '{ship_file}'"
    assert (said in log) == changed
    assert (f"output_directory 'elsewhere' of {file} is not used" in log) == changed
