# SPDX-License-Identifier: Apache-2.0
"""Stopping without engine, from a store."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.cli import main
from shipdrag_ros.fleet.store import BagResult, Store
from shipdrag_ros.ship import Ship
from tests.conftest import fleet_result

NAME = 'Test <b>ship</b>'


@pytest.fixture
def store(fleet_store: Path, tmp_path: Path) -> Path:
    """Twelve runs, each 1 % of r above the one before, and the ship file."""
    path = Path(shutil.copytree(fleet_store, tmp_path / 'store'))
    ship = Ship(name=NAME, length_m=80.0, displaced_volume_m3=4_000.0)
    Store(path).keep_ship(NAME, {'ship.yaml': ship.to_yaml()})
    return path


def test_times_and_ways_are_those_of_the_curves(store: Path, tmp_path: Path) -> None:
    out, page = tmp_path / 'poster.json', tmp_path / 'poster.html'
    assert main(['poster', str(store), f'--json={out}', '--report', str(page)]) == 0
    (ship,) = json.loads(out.read_text())['ships']
    assert ship['coastdowns'] == 12
    made = Ship(name=NAME, length_m=80.0, displaced_volume_m3=4_000.0)
    for step in ship['steps']:
        u = np.linspace(step['to_m_s'], step['from_m_s'], 2001)
        # r of the middle run, 1.055 of a square
        per_a = (1.0 + made.n_r(u)) / (1.055e-3 * u**2)
        assert step['runs'] == 12
        assert step['time_s']['median'] == pytest.approx(np.trapezoid(per_a, u), rel=0.01)
        assert step['distance_m']['median'] == pytest.approx(np.trapezoid(u * per_a, u), rel=0.01)
        for band in (step['time_s'], step['distance_m']):
            # twelve runs that differ by 3.4 %, their sigma of 3 %, gusts of 4 %
            assert 0.05 < band['high'] / band['median'] - 1.0 < 0.2
            assert band['low'] < band['median']
    text = page.read_text()
    assert 'Stopping without engine' in text
    assert 'A.601(15)' in text
    assert '<b>ship</b>' not in text


def test_coastdowns_without_a_table_are_those_of_the_ship(store: Path, capsys) -> None:
    slow = fleet_result(50, 0.0)
    rows = tuple(row | {'speed_m_s': 0.01 * row['speed_m_s']} for row in slow.coastdowns)
    Store(store).write(BagResult(slow.bag | {'ship': 'Slow'}, rows))
    text = Ship(name='Slow', length_m=80.0, displaced_volume_m3=4_000.0).to_yaml()
    Store(store).keep_ship('Slow', {'ship.yaml': text})
    assert main(['poster', str(store)]) == 0
    assert 'None of 1 coastdowns' in capsys.readouterr().out


def test_a_ship_without_a_file_is_named(fleet_store: Path, capsys) -> None:
    assert main(['poster', str(fleet_store)]) == 0
    assert 'keeps no ship file' in capsys.readouterr().out
