# SPDX-License-Identifier: Apache-2.0
"""`shipdrag learn`: exit 0 and no file where nothing may be written."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import shipdrag_ros as sd
from shipdrag_ros.bags import open_runs
from shipdrag_ros.cli import main
from shipdrag_ros.errors import EffectFileError
from shipdrag_ros.fleet.store import BagResult, Store, bag_row
from tests.runs import write_run

SHIP = Path(__file__).resolve().parents[2] / 'config' / 'vitus_bering.yaml'


@pytest.mark.parametrize('name', ['fouling', 'Kelp', '../kelp'])
def test_a_name_that_cannot_be_is_refused_before_the_work(name: str, tmp_path, capsys) -> None:
    line = ['learn', str(tmp_path / 'none.mcap'), '-o', str(tmp_path / 'a.yaml'), '--name', name]
    assert main(line) == 1
    assert 'name' in capsys.readouterr().err


def test_a_script_is_told_of_a_name_before_the_work() -> None:
    record = sd.simulate(sd.Ship.example(), duration_s=10.0, lead_in_s=60.0)
    with pytest.raises(EffectFileError, match='an effect of the library'):
        sd.learn(record, name='fouling')


@pytest.fixture(scope='module')
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that holds `bags/run.mcap`, and a store that lists it as the fleet does."""
    folder = tmp_path_factory.mktemp('fleet')
    bag = folder / 'bags' / 'run.mcap'
    bag.parent.mkdir()
    line = ['simulate', '--ship', str(SHIP), '-o', str(bag), '--lead-in', '700']
    assert main([*line, '--duration', '900']) == 0
    store = folder / 'store'
    (store / 'coastdowns').mkdir(parents=True)
    Store(store).write(BagResult({**bag_row('bags', 'run.mcap', 'a' * 64), 'coastdowns': 1}))
    return folder


def test_one_clean_run_of_a_store_is_found_from_anywhere_and_writes_no_file(
    fleet, tmp_path, monkeypatch, capsys
) -> None:
    out, page = tmp_path / 'new.yaml', tmp_path / 'page.html'
    monkeypatch.chdir(tmp_path)
    assert (
        main(['learn', str(fleet / 'store'), '-o', str(out), '--report', str(page), '--json']) == 0
    )
    said = capsys.readouterr()
    document = json.loads(said.out)
    assert len(document['runs']) == 1
    assert document['learnt'] is None
    assert 'nothing is missing' in document['reason']
    assert document['where'] is None
    assert 'is not written' in said.err
    assert document['likeliest'] in said.err
    of = 'the resistance' if document['likeliest'].startswith('force') else 'a reading of the log'
    assert f'{document["largest_percent"]:.0f} % of {of}.' in said.err
    assert not out.exists()
    assert '<h1>No effect is learnt' in page.read_text()


def bare(fleet: Path, folder: Path, *ships: str) -> Path:
    """A store of a bag with no ship file attached, kept in the store for each ship."""
    (folder / 'bags').mkdir()
    store = Store(folder / 'store')
    (run,) = open_runs([fleet / 'bags' / 'run.mcap'])
    whole = run.inputs().block()
    for number, ship in enumerate(ships):
        bag = write_run(folder / 'bags' / f'{number}.mcap', whole)
        row = bag_row('bags', bag.name, f'{number}' * 64)
        store.write(BagResult({**row, 'ship': ship, 'coastdowns': 1}))
        store.keep_ship(ship, {'ship.yaml': SHIP.read_text()})
    return store.path


def test_a_window_and_a_ship_file_beside_the_bags_of_a_store_count(fleet, tmp_path, capsys):
    store = bare(fleet, tmp_path, 'Vitus Bering')
    for given in (store, fleet / 'bags' / 'run.mcap'):
        assert main(['learn', f'{given}@0:200', '-o', str(tmp_path / 'a.yaml')]) == 1
        assert 'no coastdown from 0 to 200 s' in capsys.readouterr().err  # else: give --ship


def test_a_store_of_two_ships_names_them(fleet: Path, tmp_path, capsys) -> None:
    store = bare(fleet, tmp_path, 'Alder', 'Birch')
    assert main(['learn', str(store), '-o', str(tmp_path / 'a.yaml')]) == 1
    assert "the store holds 'Alder', 'Birch'" in capsys.readouterr().err


def test_a_bag_of_a_store_that_is_gone_is_named(fleet, tmp_path, monkeypatch, capsys):
    store = (fleet / 'store').rename(tmp_path / 'moved')
    try:
        monkeypatch.chdir(tmp_path)
        assert main(['learn', str(store), '-o', 'a.yaml']) == 1
    finally:
        store.rename(fleet / 'store')
    said = capsys.readouterr().err
    assert "'bags/run.mcap' of the store" in said
    assert 'give the bags themselves' in said


def test_a_store_without_a_coastdown_is_an_error(tmp_path, capsys) -> None:
    store = tmp_path / 'store'
    (store / 'coastdowns').mkdir(parents=True)
    Store(store).write(BagResult(bag_row('bags', 'run.mcap', 'a' * 64)))
    assert main(['learn', str(store), '-o', str(tmp_path / 'a.yaml')]) == 1
    assert 'holds no coastdown' in capsys.readouterr().err
