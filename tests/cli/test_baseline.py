# SPDX-License-Identifier: Apache-2.0
"""`shipdrag baseline`, from bags to a ship file that other verbs take."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from shipdrag_ros.cli import main
from shipdrag_ros.ship import Ship, TableBaseline


@pytest.fixture(scope='module')
def bags(ship_file: Path, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp('clean')
    made = []
    for seed, heading in ((1, '0'), (2, '3.1416')):
        made.append(str(folder / f'{seed}.mcap'))
        line = ['simulate', '--ship', str(ship_file), '-o', made[-1], '--duration', '900']
        line += ['--speed', '8', '--lead-in', '900', '--heading', heading]
        assert main([*line, '--seed', str(seed)]) == 0
    return made


def test_learns_from_two_bags_what_simulate_and_diagnose_take(bags, ship_file, tmp_path, capsys):
    out = tmp_path / 'learnt.yaml'
    capsys.readouterr()
    assert main(['baseline', *bags, '--ship', str(ship_file), '-o', str(out), '--json']) == 0
    shown = capsys.readouterr()
    found = json.loads(shown.out)
    assert [run['name'] for run in found['runs']] == bags
    for part in ('friction', 'wave'):
        factor = found['factors'][part]
        assert abs(factor['value'] - 1.0) < 3.0 * factor['sd']
    assert found['scatter']['value'] is None
    assert found['relative_sd']['before'] == {'friction': 0.02, 'wave': 0.1}
    assert 'WARNING: 2 run(s) do not show how runs differ' in shown.err
    assert 'Learnt baseline over the one before' in shown.err
    assert Ship.load(out).baseline != Ship.load(ship_file).baseline
    assert main(['diagnose', bags[0], '--ship', str(out), '--json']) == 0
    assert json.loads(capsys.readouterr().out)['verdict'] == 'none'
    bag = tmp_path / 'again.mcap'
    assert main(['simulate', '--ship', str(out), '-o', str(bag), '--duration', '60']) == 0


def test_a_ship_without_a_baseline_gets_a_table(bags, ship_file, tmp_path, capsys):
    bare, out = tmp_path / 'bare.yaml', tmp_path / 'learnt.yaml'
    stated = Ship.load(ship_file)
    bare.write_text(
        f'length_m: {stated.length_m}\ndisplaced_volume_m3: {stated.displaced_volume_m3}\n'
    )
    assert main(['baseline', *bags, '--ship', str(bare), '-o', str(out)]) == 0
    assert 'the ship file states no baseline' in capsys.readouterr().out
    assert isinstance(Ship.load(out).baseline, TableBaseline)


def test_an_existing_file_is_not_overwritten(ship_file, tmp_path, capsys):
    earlier = tmp_path / 'learnt.yaml'
    earlier.write_text('of last year')
    with pytest.raises(SystemExit) as ended:
        main(['baseline', 'any.mcap', '--ship', str(ship_file), '-o', str(earlier)])
    assert (ended.value.code, earlier.read_text()) == (2, 'of last year')
    assert 'exists; choose another name or remove it' in capsys.readouterr().err


def test_a_run_that_cannot_be_used_is_named(bags, steady_bag, ship_file, tmp_path, capsys):
    slow, out = tmp_path / 'slow.yaml', tmp_path / 'learnt.yaml'
    known = TableBaseline((0.0, 1.0, 3.0), (0.0, 1e4, 9e4), 0.02)
    slow.write_text(replace(Ship.load(ship_file), baseline=known).to_yaml())
    for bag, ship, why in (
        (steady_bag, ship_file, 'no coastdown was found in'),
        (bags[0], slow, 'ERROR: {}: speed_m_s is 7.9'),
    ):
        assert main(['baseline', str(bag), '--ship', str(ship), '-o', str(out)]) == 1
        assert why.format(bag) in capsys.readouterr().err
        assert not out.exists()
