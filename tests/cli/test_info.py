# SPDX-License-Identifier: Apache-2.0
"""`info` shows what is in a bag, or in a log."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from shipdrag_ros import __version__
from shipdrag_ros.bags import BagWriter
from shipdrag_ros.cli import main


def test_the_words(steady_bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(['info', str(steady_bag)]) == 0
    captured = capsys.readouterr().out
    assert f'recorded by  shipdrag_ros {__version__}' in captured
    assert 'ship.yaml (' in captured
    assert '/shaft' in captured
    assert 'sensor_msgs/msg/JointState' in captured
    assert 'not there: speed_over_ground, rudder, wind_apparent, depth' in captured


def test_the_json(steady_bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(['info', str(steady_bag), '--json']) == 0
    (about,) = json.loads(capsys.readouterr().out)['bags']
    assert about['bag'] == str(steady_bag)
    assert about['duration_s'] == 301.0
    assert about['messages'] == 4 * 302
    assert about['indexed']
    assert (about['compression'], about['software']) == ('zstd', __version__)
    assert about['size_bytes'] == steady_bag.stat().st_size
    assert about['end_ns'] - about['start_ns'] == 301 * 10**9
    assert about['warnings'] == []
    shaft = next(topic for topic in about['topics'] if topic['topic'] == '/shaft')
    assert (shaft['input'], shaft['messages'], shaft['rate_hz']) == ('shaft', 302, 1.0)


def test_an_attachment_is_told_with_its_size_in_bytes(tmp_path: Path, capsys) -> None:
    with BagWriter(tmp_path / 'a.mcap') as bag:
        bag.attach('ship.yaml', 'é')
    assert main(['info', str(tmp_path / 'a.mcap'), '--json']) == 0
    (about,) = json.loads(capsys.readouterr().out)['bags']
    assert about['attachments'] == {'ship.yaml': 2}


def test_a_remapping_changes_what_is_heard(steady_bag: Path, capsys) -> None:
    line = ['info', str(steady_bag), '--remap', '/speed_through_water:=speed_over_ground']
    capsys.readouterr()
    assert main([*line, '--json']) == 0
    (about,) = json.loads(capsys.readouterr().out)['bags']
    assert 'speed_through_water' in about['missing_inputs']


def test_of_a_part_only_what_is_in_it_is_shown(steady_bag: Path, capsys) -> None:
    capsys.readouterr()
    assert main(['info', f'{steady_bag}@100:150', str(steady_bag), '--json']) == 0
    part, whole = json.loads(capsys.readouterr().out)['bags']
    assert whole['messages'] == 4 * 302
    assert (part['duration_s'], part['messages']) == (50.0, 4 * 51)
    assert part['start_ns'] - whole['start_ns'] == 100 * 10**9
    assert {topic['rate_hz'] for topic in part['topics']} == {1.0}


def test_a_log_is_shown_as_its_bag_would_be(tmp_path, capsys) -> None:
    log = tmp_path / 'log.csv'
    log.write_text('time,STW [kn]\n0,12.0\n1,11.9\n')
    capsys.readouterr()
    assert main(['info', str(log), '--json']) == 0
    captured = capsys.readouterr()
    assert "speed_through_water <- 'STW [kn]'" in captured.err
    (about,) = json.loads(captured.out)['bags']
    assert about['files'] == [str(log)]
    assert (about['duration_s'], about['messages']) == (1.0, 2)
    assert (about['compression'], about['software']) == ('none', None)


def test_no_bag_is_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['info', 'no such.mcap']) == 1
    assert capsys.readouterr().err.startswith("ERROR: 'no such.mcap' does not exist")
