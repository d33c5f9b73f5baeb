# SPDX-License-Identifier: Apache-2.0
"""One bag to its rows."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.errors import BagError
from shipdrag_ros.fleet.find import BagToRead, Beside
from shipdrag_ros.fleet.job import _name, work
from shipdrag_ros.fleet.store import FROUDE, BagResult
from shipdrag_ros.ship import Ship
from tests.sources.log_samples import sentence

from .conftest import SHIP, job_of, only_source


def done(path: Path) -> BagResult:
    return work(job_of(only_source(path)))


def test_a_coastdown_is_a_row_with_its_curve_on_the_grid(bags: list[Path]) -> None:
    result = done(bags[0])
    assert result.bag['error'] is None
    assert (result.bag['ship'], result.bag['coastdowns']) == ('Vitus Bering', 1)
    assert result.bag['messages'] == 4 * 451
    (row,) = result.coastdowns
    assert row['bag'] == 'run 0.mcap'
    assert (row['error'], row['flags'], row['ended_by']) == (None, [], 'record_end')
    assert abs(row['time_ns'] - 1_767_225_600_000_000_000 - 400e9) < 5e9
    inside = (row['froude_valid_min'] <= FROUDE) & (row['froude_valid_max'] >= FROUDE)
    assert inside.sum() > 10
    for name in ('resistance_m_s2', 'sigma_m_s2', 'sigma_repeatable_m_s2'):
        np.testing.assert_array_equal(np.isfinite(row[name]), inside)
    assert row['clean_m_s2'] is not None
    apart = row['resistance_m_s2'][inside] / row['clean_m_s2'][inside] - 1.0
    # the ship is clean; one run, seed 0
    assert np.all(np.abs(apart) < 5.0 * row['sigma_m_s2'][inside] / row['clean_m_s2'][inside])
    assert row['verdict'] in ('none', 'one_of')
    assert json.loads(row['effects']) == []
    assert sum(each['probability'] for each in json.loads(row['candidates'])) > 0.9


def test_the_clean_hull_is_the_baseline_over_the_mass(bags: list[Path]) -> None:
    (row,) = done(bags[1]).coastdowns
    ship = Ship.load(SHIP)
    low, high = ship.baseline_range_m_s
    inside = (row['speed_m_s'] >= low) & (row['speed_m_s'] <= high)
    np.testing.assert_array_equal(np.isfinite(row['clean_m_s2']), inside)
    expected = ship.resistance_n(row['speed_m_s'][inside]) / ship.mass_kg
    np.testing.assert_allclose(row['clean_m_s2'][inside], expected)
    np.testing.assert_allclose(row['speed_m_s'], FROUDE * np.sqrt(9.81 * ship.length_m))


def test_too_little_for_a_diagnosis_is_said(bags: list[Path]) -> None:
    result = done(bags[1])
    (row,) = result.coastdowns
    assert (row['verdict'], row['effects'], row['flags']) == (None, None, ['no_diagnosis'])
    assert row['error'] is None
    assert any('is not diagnosed: run 1.mcap: 2' in each for each in result.bag['warnings'])


def test_the_run_file_says_how_she_was(bags: list[Path], tmp_path: Path) -> None:
    path = tmp_path / 'a.mcap'
    shutil.copy(bags[1], path)
    before = job_of(only_source(path))
    (tmp_path / 'a.mcap.run.yaml').write_text(
        '{draught_m: 8.0, displaced_volume_m3: 18700.0, facts: [no_towed_cable], '
        'water: {temperature_c: 5.0, density_kg_m3: 1010.0}}'
    )
    job = job_of(only_source(path))
    assert job.content_hash != before.content_hash
    (row,) = work(job).coastdowns
    assert (row['draught_m'], row['displaced_volume_m3']) == (8.0, 18700.0)
    assert (row['water_temperature_c'], row['water_density_kg_m3']) == (5.0, 1010.0)
    assert row['facts'] == ['no_towed_cable']
    (plain,) = work(before).coastdowns
    assert plain['water_temperature_c'] is None
    # the force is as the density, and so is the mass; less mass, and cold water is more viscous
    ratio = row['clean_m_s2'][30] / plain['clean_m_s2'][30]
    assert 20200 / 18700 < ratio < 1.05 * 20200 / 18700


def test_what_a_run_file_knows_counts_for_its_curve(bags: list[Path], tmp_path: Path) -> None:
    path = tmp_path / 'a.mcap'
    shutil.copy(bags[0], path)
    (before,) = done(path).coastdowns
    (tmp_path / 'a.mcap.run.yaml').write_text('facts: [calm, deep_water]')
    (row,) = done(path).coastdowns
    assert np.nanmean(row['sigma_m_s2']) < np.nanmean(before['sigma_m_s2'])


def test_a_ship_file_beside_speaks_for_its_own_ship_alone(bags: list[Path], tmp_path) -> None:
    shutil.copy(bags[1], tmp_path / 'a.mcap')
    beside = SHIP.read_text().replace('form_factor: 0.20', 'form_factor: 0.30')
    (tmp_path / 'ship.yaml').write_text(beside)
    result = done(tmp_path / 'a.mcap')
    (own,) = done(bags[1]).coastdowns
    assert result.ship_file == beside
    assert result.coastdowns[0]['clean_m_s2'][30] > 1.05 * own['clean_m_s2'][30]
    (tmp_path / 'ship.yaml').write_text(beside.replace('Vitus Bering', 'Another'))
    other = done(tmp_path / 'a.mcap')
    assert other.bag['ship'] == 'Vitus Bering'
    assert other.coastdowns[0]['clean_m_s2'][30] == own['clean_m_s2'][30]
    assert any("is of 'Another', the one attached of 'Vitus" in w for w in other.bag['warnings'])


def test_a_log_and_a_table_are_read_without_options(tmp_path: Path) -> None:
    shutil.copy(SHIP, tmp_path / 'ship.yaml')
    seconds = np.arange(750)
    speed = np.where(seconds < 250, 7.0, 7.0 / (1.0 + np.maximum(seconds - 250, 0) / 700.0))
    speed += np.random.default_rng(1).normal(0.0, 0.03, 750)
    rows = [f'{t + 1.8e9:.1f},{v:.4f}' for t, v in zip(seconds, speed, strict=True)]
    (tmp_path / 'log.csv').write_text('\n'.join(['time,speed_through_water', *rows]))
    lines = []
    for t, v in zip(seconds.tolist(), speed, strict=True):
        clock = f'{12 + t // 3600:02d}{t // 60 % 60:02d}{t % 60:02d}.00'
        lines.append(sentence(f'GPZDA,{clock},01,03,2026,00,00'))
        lines.append(sentence(f'VWVHW,,T,,M,{v / 0.514444:.3f},N,,K'))
    (tmp_path / 'day.nmea').write_text('\r\n'.join(lines) + '\r\n')
    for name in ('log.csv', 'day.nmea'):
        result = done(tmp_path / name)
        assert result.bag['error'] is None
        assert result.bag['messages'] == 750
        (row,) = result.coastdowns
        assert row['bag'] == name
        assert row['estimator'] is not None


@pytest.mark.parametrize(
    ('name', 'content', 'why'),
    [
        ('a.mcap', b'', 'is empty'),
        ('a.mcap', b'no bag at all', 'is no MCAP file'),
        ('a.nmea', b'no sentence\n', 'is of no format known here'),
        ('a.csv', b'port,price\n1,2\n', 'make a bag of it with `shipdrag import`'),
        ('a.bag', b'#ROSBAG V2.0\n', 'a.bag'),
    ],
)
def test_what_cannot_be_read_says_why_and_not_where(tmp_path, name, content, why):
    (tmp_path / name).write_bytes(content)
    result = done(tmp_path / name)
    assert result.coastdowns == ()
    assert why in result.bag['error']
    assert str(tmp_path) not in result.bag['error']


def test_a_bag_without_a_ship_file_says_where_to_put_one(bags: list[Path], tmp_path: Path) -> None:
    rows = '\n'.join(['time,speed_through_water', *(f'{t},7' for t in range(60))])
    (tmp_path / 'a.csv').write_text(rows)
    error = done(tmp_path / 'a.csv').bag['error']
    assert 'no ship.yaml is attached, and none lies beside it or in a folder above' in error


def test_a_bag_without_a_coastdown_is_no_error(tmp_path: Path) -> None:
    shutil.copy(SHIP, tmp_path / 'ship.yaml')
    rows = '\n'.join(['time,speed_through_water', *(f'{t},7' for t in range(600))])
    (tmp_path / 'a.csv').write_text(rows)
    result = done(tmp_path / 'a.csv')
    assert result.bag['error'] is None
    assert result.bag['coastdowns'] == 0
    assert any(each.startswith('no coastdown was found: ') for each in result.bag['warnings'])


@pytest.mark.parametrize('name', ['x' * 300, 'ü' * 41, 'a\nb', '\ud800'])
def test_a_name_that_no_folder_can_have_is_refused(name: str) -> None:
    with pytest.raises(BagError, match='give a shorter one in ship'):
        _name(replace(Ship.load(SHIP), name=name), BagToRead('', '', (), False, Beside()))
