# SPDX-License-Identifier: Apache-2.0
"""A script gets the figures of the command line, to the last bit."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import shipdrag_ros as sd
from shipdrag_ros.cli import main
from shipdrag_ros.display import json_text

SCALE = {'name': 'log_scale', 'parameters': {'factor': {'value': -0.14, 'sd': 0.02}}}
THEN = {
    'candidates': [{'names': ['log_scale'], 'probability': 0.95, 'effects': [SCALE]}],
    'baseline': 'stated',
    'ship': {'name': 'Vitus Bering', 'length_m': 150.0, 'effects': []},
    'runs': [{'bag': 'then.mcap', 'time_ns': 1_777_600_000_000_000_000}],
    'earlier': [],
}


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
    record = sd.read(bag)
    found = sd.estimate(record)
    assert json_text(found.to_dict()) == out.read_text()
    whole = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert [json.loads(json.dumps(each.to_dict())) for each in found.coastdowns] == whole[
        'coastdowns'
    ]
    assert main(['info', str(bag), f'--json={out}']) == 0
    assert json.loads(json.dumps(record.to_dict())) == json.loads(out.read_text())


def test_what_is_learnt(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / 'learn.json'
    assert main(['learn', str(bag), '-o', str(tmp_path / 'x.yaml'), f'--json={out}']) == 0
    found = sd.learn(sd.read(bag), name='x')
    assert json.loads(json.dumps(found.to_dict())) == json.loads(out.read_text())
    printed = capsys.readouterr().out.splitlines()
    assert found.summary().splitlines() == printed[: len(found.summary().splitlines())]
    assert repr(found) == '<LearntEffect: nothing is learnt>'
    assert '<td>something smooth<' in found._repr_html_()
    assert found.to_frame().probability.sum() == pytest.approx(1.0)


def test_estimates_of_a_window(bag: Path, tmp_path: Path) -> None:
    out = tmp_path / 'replay.json'
    assert main(['replay', str(bag), '--window', '450', '1200', f'--json={out}']) == 0
    found = sd.estimate(sd.read(bag), window=(450.0, 1200.0))
    assert json_text(found.to_dict()) == out.read_text()
    (coastdown,) = found.coastdowns
    assert coastdown.ended_by == 'given'


def test_estimates_of_another_ship_and_a_stop(bag: Path, tmp_path: Path) -> None:
    out, file = tmp_path / 'replay.json', tmp_path / 'ship.yaml'
    file.write_text('length_m: 150.0\ndisplaced_volume_m3: 20200.0\n')
    line = ['replay', str(bag), '--ship', str(file), '--stop', '402']
    assert main([*line, f'--json={out}']) == 0
    found = sd.estimate(sd.read(bag), ship=sd.Ship.load(file), stop=402.0)
    assert json_text(found.to_dict()) == out.read_text()
    assert 'the stop that is given' in found.summary()
    assert 'check its time and zone' not in found.summary()


def test_a_diagnosis(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / 'diagnose.json'
    then = tmp_path / 'then.json'
    then.write_text(json.dumps(THEN))
    line = ['diagnose', str(bag), '--fact', 'no_towed_cable', '--earlier', str(then)]
    assert main([*line, f'--json={out}']) == 0
    found = sd.diagnose(sd.read(bag), facts=['no_towed_cable'], earlier=then)
    assert json_text(found.to_dict()) == out.read_text()
    printed = capsys.readouterr().out
    assert found.summary().splitlines()[0] in printed
    said = found.summary().splitlines()
    assert len(set(filter(None, said))) == len([*filter(None, said)])  # nothing is said twice
    answer = json.loads(out.read_text())
    assert answer['verdict'] == found.verdict
    # what is needed to be given to the next one
    assert answer['ship'] == {'name': 'Vitus Bering', 'length_m': 150.0, 'effects': []}
    assert [run['bag'] for run in answer['runs']] == [str(bag)]
    (counted,) = answer['earlier']
    assert (counted['file'], counted['used']) == (str(then), True)
    assert [each['name'] for each in counted['effects']] == ['log_scale']
    assert f'The earlier diagnosis {then} (2026-05-01' in printed
    with pytest.raises(sd.ShipdragError, match='counts here already'):
        sd.diagnose(sd.read(bag), earlier=[found])
    then.write_text('[')
    assert main(line) == 1
    assert f'ERROR: {then}: not JSON' in capsys.readouterr().err
