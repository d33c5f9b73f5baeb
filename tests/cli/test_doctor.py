# SPDX-License-Identifier: Apache-2.0
"""`doctor` says what works, and what to do about the rest."""

from __future__ import annotations

import json
import socket
from pathlib import Path

import pytest

from shipdrag_ros.cli import doctor, main
from shipdrag_ros.cli.doctor import CheckState, findings


def by_name(out: Path) -> dict[str, doctor.CheckResult]:
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
        monkeypatch.setattr(doctor, '_PAGE_PORT', port)
        assert by_name(tmp_path)[f'port {port}'].state is CheckState.LOOK


def test_a_missing_package_is_told_with_what_does_not_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doctor, '_OPTIONAL', {'no_such_package': 'the impossible'})
    found = by_name(tmp_path)['no_such_package']
    assert (found.state, found.found) == (
        CheckState.LOOK,
        'missing; does not work: the impossible',
    )
    monkeypatch.setattr(doctor, '_NEEDED', ('numpy', 'no.such.package'))
    assert by_name(tmp_path)['packages'].state is CheckState.BROKEN
    assert main(['doctor', '--out', str(tmp_path)]) == 1
