# SPDX-License-Identifier: Apache-2.0
"""A script gets the figures of the command line, to the last bit."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import shipdrag_ros as sd
from shipdrag_ros.cli import diagnose_json, main, replay_json
from shipdrag_ros.cli.output import json_text


def test_simulated_readings_and_truth(record: sd.Record, tmp_path: Path) -> None:
    ship, out = tmp_path / 'ship.yaml', tmp_path / 'cli.mcap'
    ship.write_text(sd.Ship.example().to_yaml())
    line = ['simulate', '--ship', str(ship), '-o', str(out), '--duration', '900', '--seed', '3']
    assert main([*line, '--lead-in', '400', '--effect', 'log_scale=-0.15']) == 0
    told = sd.read(out)
    mine, theirs = record.samples(), told.samples()
    for name in ('channel', 'stamp_ns', 'receive_ns', 'value', 'variance'):
        assert getattr(mine, name).tobytes() == getattr(theirs, name).tobytes()
    assert record.truth is not None
    assert told.truth is not None
    assert record.truth.to_yaml() == told.truth.to_yaml()


def test_estimates(bag: Path, tmp_path: Path) -> None:
    out = tmp_path / 'replay.json'
    assert main(['replay', str(bag), f'--json={out}']) == 0
    found = sd.estimate(sd.read(bag))
    assert json_text(replay_json.document(found.runs)) == out.read_text()


def test_estimates_of_a_window(bag: Path, tmp_path: Path) -> None:
    out = tmp_path / 'replay.json'
    assert main(['replay', str(bag), '--window', '450', '1200', f'--json={out}']) == 0
    found = sd.estimate(sd.read(bag), window=(450.0, 1200.0))
    assert json_text(replay_json.document(found.runs)) == out.read_text()
    (coastdown,) = found.coastdowns
    assert coastdown.ended_by == 'given'


def test_a_diagnosis(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / 'diagnose.json'
    line = ['diagnose', str(bag), '--fact', 'no_towed_cable', f'--json={out}']
    assert main(line) == 0
    found = sd.diagnose(sd.read(bag), facts=['no_towed_cable'])
    assert json_text(diagnose_json.document(found.found)) == out.read_text()
    printed = capsys.readouterr().out
    assert found.summary()[0] in printed
    assert json.loads(out.read_text())['verdict'] == found.verdict
