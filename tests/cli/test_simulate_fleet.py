# SPDX-License-Identifier: Apache-2.0
"""A folder of months: what `fleet` reads of it, and what is true."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from shipdrag_ros.cli import main
from shipdrag_ros.fleet.find import find
from shipdrag_ros.fleet.store import read_events
from shipdrag_ros.ship import RunSheet, Ship


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp('simulated') / 'fleet'
    line = ['simulate-fleet', '-o', str(out), '--ships', '3', '--months', '2', '--seed', '2']
    assert main([*line, '--every', '20', '--json', str(out) + '.json']) == 0
    return out


def truth(folder: Path) -> list[dict[str, str]]:
    with (folder / 'truth.csv').open() as file:
        return list(csv.DictReader(file))


def test_fleet_finds_the_bags_and_not_the_truth(folder: Path) -> None:
    found = find([str(folder)])
    rows = truth(folder)
    assert json.loads(Path(f'{folder}.json').read_text())['runs'] == len(rows) == 9
    left = [row['bag'] for row in rows if row['file'] != 'lost']
    assert [source.bag for source in found.sources] == sorted(left)
    assert (found.skipped, found.notes) == ((), ())
    assert found.left_alone == 1  # truth.yaml


def test_each_bag_has_its_ship_and_its_load(folder: Path) -> None:
    rows = {row['bag']: row for row in truth(folder)}
    for source in find([str(folder)]).sources:
        ship = Ship.from_yaml(source.beside.ship, subject='ship')
        row = rows[source.bag]
        assert ship.name == row['ship']
        sheet = RunSheet.from_yaml(source.run, subject='run')
        assert sheet.of(ship, subject='run').draught_m == float(row['draught_m'])
        assert sheet.water is not None
        assert sheet.water.temperature_c == float(row['water_temperature_c'])


def test_events_tell_what_is_known_alone(folder: Path) -> None:
    found = {}
    for name in ('alder', 'birch', 'cedar'):
        events, problems = read_events((folder / name / 'events.csv').read_text())
        assert problems == ()
        found[name] = [event.kind for event in events]
    assert found == {'alder': ['cleaning'], 'birch': [], 'cedar': ['docking']}


def test_the_same_seed_gives_the_same_files(folder: Path, tmp_path: Path) -> None:
    line = ['simulate-fleet', '-o', str(tmp_path), '--ships', '1', '--months', '2', '--seed', '2']
    assert main([*line, '--every', '20']) == 0
    for path in sorted((tmp_path / 'alder').iterdir()):
        assert path.read_bytes() == (folder / 'alder' / path.name).read_bytes(), path.name


def test_a_folder_that_holds_something_is_left_alone(folder: Path, capsys) -> None:
    assert main(['simulate-fleet', '-o', str(folder)]) == 1
    assert 'is not empty; give a new folder' in capsys.readouterr().err
