# SPDX-License-Identifier: Apache-2.0
"""`shipdrag sensitivity`, of a manoeuvring model and of a ship file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from shipdrag_ros.cli import main
from shipdrag_ros.studies.manoeuvring import FORM

CHANGES = {'+10', '-10', '+50', '-50', 'mean'}


def result(capsys: pytest.CaptureFixture[str], *line: str) -> tuple[dict[str, Any], str]:
    assert main(['sensitivity', *line, '--json']) == 0
    shown = capsys.readouterr()
    return json.loads(shown.out), shown.err


def test_json_to_the_letter(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / 'mariner.html'
    found, told = result(capsys, '--report', str(page))
    assert set(found) >= {'loss', 'kept', 'dropped', 'threshold', 'check'}
    assert set(found['loss']) == set(FORM)
    for losses in found['loss'].values():
        assert set(losses) >= CHANGES
        four = [losses[key] for key in ('+10', '-10', '+50', '-50')]
        assert losses['mean'] == pytest.approx(sum(four) / 4.0)
    assert len(found['kept']) == 24
    assert sorted([*found['kept'], *found['dropped']]) == sorted(FORM)
    means = {name: losses['mean'] for name, losses in found['loss'].items()}
    assert min(means[name] for name in found['kept']) > found['threshold']
    assert max(means[name] for name in found['dropped']) < found['threshold']
    check = found['check']
    assert set(check) == {
        'manoeuvre',
        'overshoot_full_deg',
        'overshoot_reduced_deg',
        'rms_difference',
    }
    assert check['manoeuvre'] == 'zigzag:25'
    assert check['overshoot_full_deg'] == pytest.approx([8.85, 7.01], abs=0.06)
    assert len(check['overshoot_reduced_deg']) == 2
    assert all(value > 0.0 for value in check['rms_difference'].values())
    assert found['independent'] == 18
    assert 'Nd (yaw moment by rudder) matters most' in told
    assert '14 of the 40' in told
    text = page.read_text(encoding='utf-8')
    assert text.count('data:image/svg+xml') == 3
    assert 'Chislett' in text


def test_manoeuvre_and_number_kept_count(capsys: pytest.CaptureFixture[str]) -> None:
    circle, _ = result(capsys, '--manoeuvre', 'turn:35', '--model', 'mariner', '--keep', '30')
    assert circle['manoeuvre'] == 'turn:35'
    assert len(circle['kept']) == 30
    # of a circle, in which the rudder is hard over all the time
    assert circle['loss']['Nuud']['+10'] > circle['loss']['Nvvd']['+10']
    assert circle['check']['manoeuvre'] == 'zigzag:25'


def test_a_ship_file_coasts(ship_file: Path, tmp_path, capsys) -> None:
    page = tmp_path / 'ship.html'
    found, told = result(capsys, '--ship', str(ship_file), '--report', str(page))
    assert found['manoeuvre'].startswith('coastdown:')
    for losses in found['loss'].values():
        assert set(losses) >= CHANGES
    assert found['loss']['length_m']['+sd'] is None
    assert found['kept'][0] == 'displaced_volume_m3'
    assert found['check']['overshoot_full_deg'] == []
    assert set(found['check']['rms_difference']) == {'speed_m_s', 'position_m'}
    assert found['resistance']['length_m']['estimated'] > 0.01
    assert {mimic['effect'] for mimic in found['mimics']} >= {'fouling', 'current'}
    assert 'fouling like' in told
    assert page.read_text(encoding='utf-8').count('data:image/svg+xml') == 2
    faster, _ = result(
        capsys, '--ship', str(ship_file), '--manoeuvre', 'coastdown:8.2', '--keep', '4'
    )
    assert faster['loss']['length_m']['-50'] is None
    assert len(faster['kept']) == 4


@pytest.mark.parametrize(
    ('line', 'message'),
    [
        (['--keep', '0'], 'keep is 0, expected 1..40'),
        (['--keep', '41'], 'keep is 41, expected 1..40'),
        (['--manoeuvre', 'spiral:15'], "manoeuvre 'spiral:15', expected zigzag:ANGLE or turn"),
        (['--manoeuvre', 'zigzag:0'], 'more than 0 and at most 40 degrees of rudder'),
        (['--manoeuvre', 'turn:45'], 'at most 40 degrees of rudder, which is as far as it goes'),
        (['--manoeuvre', 'coastdown'], 'expected zigzag:ANGLE or turn:ANGLE'),
        (['--manoeuvre', ''], "manoeuvre '', expected zigzag:ANGLE"),
        (['--ship', 'SHIP', '--manoeuvre', ''], "manoeuvre ''"),
        (['--ship', 'SHIP', '--manoeuvre', 'zigzag:15'], 'for zigzag and turn leave out --ship'),
        (['--ship', 'SHIP', '--manoeuvre', 'coastdown:30'], 'begins at 30 m/s, expected'),
        (['--ship', 'SHIP', '--keep', '99'], 'keep is 99, expected 1..13'),
        (['--ship', 'BARE'], 'has no baseline resistance; add `baseline`'),
    ],
)
def test_what_cannot_be_answered_is_told(line, message, ship_file, tmp_path, capsys):
    bare = tmp_path / 'bare.yaml'
    bare.write_text('length_m: 150.0\ndisplaced_volume_m3: 20200.0\n')
    files = {'SHIP': str(ship_file), 'BARE': str(bare)}
    assert main(['sensitivity', *(files.get(word, word) for word in line)]) == 1
    shown = capsys.readouterr()
    assert shown.err.startswith('ERROR: ')
    assert message in shown.err
    assert shown.out == ''


@pytest.mark.parametrize(
    'line', [['--keep', 'many'], ['--model', 'tanker'], ['--model', 'mariner', '--ship', 'x']]
)
def test_wrong_usage_is_told(line: list[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(['sensitivity', *line])
    assert stopped.value.code == 2
