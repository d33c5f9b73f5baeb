# SPDX-License-Identifier: Apache-2.0
"""`doctor` says what works, and what to do about the rest."""

from __future__ import annotations

import json
import os
import socket
import tempfile
from pathlib import Path

import pytest

from shipdrag_ros.cli import demo, installation, main
from shipdrag_ros.cli.installation import findings
from shipdrag_ros.cli.output import CheckState


def by_name(out: Path) -> dict[str, installation.CheckResult]:
    return {each.what: each for each in findings(out)}


def test_json_and_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['doctor', '--out', str(tmp_path), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['works'] is True
    assert {'packages', 'compiled code', 'disk', 'clock', 'port 8088'} <= {
        each['what'] for each in found['findings']
    }
    assert all(each['do'] for each in found['findings'] if each['state'] != 'fine')
    assert main(['doctor', '--out', str(tmp_path)]) == 0
    assert 'what to do' in capsys.readouterr().out


def test_a_folder_to_come_is_judged_by_where_it_will_be(tmp_path: Path) -> None:
    assert by_name(tmp_path / 'new' / 'deeper')['disk'].state is CheckState.FINE


def test_a_port_in_use_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as taken:
        taken.bind(('127.0.0.1', 0))
        taken.listen()
        port = taken.getsockname()[1]
        monkeypatch.setattr(installation, '_PAGE_PORT', port)
        assert by_name(tmp_path)[f'port {port}'].state is CheckState.LOOK


def test_a_missing_package_is_told_with_what_does_not_work(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(installation, '_OPTIONAL', {'no_such_package': 'the impossible'})
    found = by_name(tmp_path)['no_such_package']
    assert (found.state, found.found) == (
        CheckState.LOOK,
        'missing; does not work: the impossible',
    )
    monkeypatch.setattr(installation, '_NEEDED', ('numpy', 'no.such.package'))
    assert by_name(tmp_path)['packages'].state is CheckState.BROKEN
    assert main(['doctor', '--out', str(tmp_path)]) == 1


@pytest.fixture
def own_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What a run sets is put back; it leaves its files in a folder of the test."""
    for name in ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE'):
        monkeypatch.setenv(name, os.environ[name])
    monkeypatch.setenv('ROS_LOG_DIR', str(tmp_path / 'ros'))
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))


@pytest.mark.usefixtures('own_environment')
def test_a_ship_sails_past_the_node_and_live_is_replay(tmp_path, capsys) -> None:
    pytest.importorskip('rclpy')
    assert main(['doctor', '--run', '--out', str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert said.splitlines()[-1] == 'PASS'
    for part in ('simulated ship', 'node', 'bag', 'replay', 'figures'):
        assert f'run: {part}' in said
    assert list(tmp_path.glob('shipdrag-doctor-*')) == []


@pytest.mark.usefixtures('own_environment')
def test_a_node_that_fails_is_told_with_its_log(tmp_path, capsys, monkeypatch) -> None:
    pytest.importorskip('rclpy')
    monkeypatch.setattr(demo, 'TRIAL_SETTINGS', ('steady_s:=nonsense',))
    assert main(['doctor', '--run', '--out', str(tmp_path), '--json']) == 1
    found = json.loads(capsys.readouterr().out)
    assert found['works'] is False
    failed = found['findings'][-1]
    assert (failed['what'], failed['state']) == ('run: node', 'broken')
    assert 'steady_s' in failed['found']
    folder = Path(failed['found'].rpartition('files in ')[2])
    assert (folder / 'node.log').is_file()
    assert folder.parent == tmp_path
