# SPDX-License-Identifier: Apache-2.0
"""`shipdrag effect`, and learnt effects in `simulate` and `diagnose`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from shipdrag_ros.cli import main

ROOT = Path(__file__).resolve().parents[2]
WEED = ROOT / 'docs' / 'data' / 'effects' / 'weed.yaml'
SHIP = ROOT / 'config' / 'vitus_bering.yaml'


def test_a_sound_file_can_be_used(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['effect', 'check', str(WEED), '--json']) == 0
    document = json.loads(capsys.readouterr().out)
    assert document['effects'][0]['name'] == 'weed'


def test_a_wrong_file_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = tmp_path / 'wrong.yaml'
    wrong.write_text(WEED.read_text().replace('0.5*rho', '0.5*__import__("os")'))
    assert main(['effect', 'check', str(wrong)]) == 1
    said = capsys.readouterr().err
    assert said.startswith('ERROR:')
    assert '__import__' in said or 'YAML' in said


def test_the_list_shows_what_is_learnt(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['effect', 'list', '--effects', str(WEED.parent)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith('weed') and line.rstrip().endswith('learnt') for line in lines)
    assert any(line.startswith('fouling') for line in lines)


def test_a_learnt_effect_is_simulated_and_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag, effects = tmp_path / 'weed.mcap', ['--effects', str(WEED.parent)]
    line = ['simulate', '--ship', str(SHIP), '-o', str(bag), '--effect', 'weed=0.002']
    assert main(line) == 1  # without the folder it is not known
    assert main([*line, *effects]) == 0
    capsys.readouterr()
    assert main(['diagnose', str(bag), *effects, '--json']) == 0
    document = json.loads(capsys.readouterr().out)
    assert document['verdict'] == 'named'
    (found,) = document['effects']
    assert found['name'] == 'weed'
    size = found['parameters']['A']
    assert abs(size['value'] - 0.002) < 3.0 * size['sd']
