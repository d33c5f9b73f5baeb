# SPDX-License-Identifier: Apache-2.0
"""Facts are told on the command line, in the ship file and beside a bag."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from shipdrag_ros.cli import main

KNOWN = ('no_towed_cable', 'deep_water', 'draughts_read', 'shaft=free')


@pytest.fixture(scope='module')
def fouled(ship_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with a hull rougher than stated."""
    path = tmp_path_factory.mktemp('fouled') / 'run.mcap'
    line = ['simulate', '--ship', str(ship_file), '-o', str(path), '--lead-in', '1800']
    assert main([*line, '--effect', 'fouling=0.35', '--seed', '2']) == 0
    return path


def found(tmp_path: Path, *arguments: str) -> dict[str, Any]:
    document = tmp_path / 'found.json'
    assert main(['diagnose', *arguments, '--json', str(document)]) == 0
    answer: dict[str, Any] = json.loads(document.read_text())
    return answer


def test_facts_make_a_name_of_a_set_told_by_options_or_by_the_run_file_beside_a_bag(
    fouled: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bare = found(tmp_path, str(fouled))
    assert bare['verdict'] == 'one_of'
    assert bare['facts'] == []
    # every candidate has its size
    for each in bare['candidates']:
        names = [] if each['names'] == ['none'] else each['names']
        assert [effect['name'] for effect in each['effects']] == names
        for effect in each['effects']:
            assert all(size['sd'] >= 0.0 for size in effect['parameters'].values())
    capsys.readouterr()
    facts = [word for fact in KNOWN for word in ('--fact', fact)]
    told = found(tmp_path, str(fouled), *facts)
    assert [effect['name'] for effect in told['effects']] == ['fouling']
    assert [each['name'] for each in told['facts']][:2] == ['no_towed_cable', 'deep_water']
    assert not any(each['contradicted'] for each in told['facts'])
    said = capsys.readouterr().out
    assert 'Facts that were given' in said
    assert 'no cable, net or line was in the water' in said
    (lighter,) = told['effects']

    sheet = fouled.with_name('run.mcap.run.yaml')
    sheet.write_text(f'facts: [{", ".join(KNOWN)}]\ndisplaced_volume_m3: 21000.0\n')
    try:
        told = found(tmp_path, str(fouled))
        said = capsys.readouterr().err
    finally:
        sheet.unlink()
    assert f'{sheet} holds for this run' in said
    assert {each['bag'] for each in told['facts']} == {str(fouled)}
    # a ship that is 4 % heavier stops as much later: as much more resistance is missing
    (effect,) = told['effects']
    factor = 'friction_factor'
    assert effect['parameters'][factor]['value'] > lighter['parameters'][factor]['value'] + 0.02


@pytest.mark.parametrize(
    ('facts', 'wrong'),
    [
        (['fog'], 'known are no_towed_cable, deep_water'),
        (['shaft=off'], 'locked or free or driven'),
        (['calm', 'calm'], '--fact calm is given 2 times'),
    ],
)
def test_a_fact_that_is_none_is_an_error(facts, wrong, fouled, capsys):
    words = [word for fact in facts for word in ('--fact', fact)]
    assert main(['diagnose', str(fouled), *words]) == 1
    assert wrong in capsys.readouterr().err
