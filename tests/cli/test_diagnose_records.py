# SPDX-License-Identifier: Apache-2.0
"""`diagnose` of records without a coastdown, and of a ship without a baseline."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.cli import main
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order

MODEL = 'length_m: 1.1\ndisplaced_volume_m3: 0.015\nadded_mass: {model: constant, value: 0.1}\n'
GAPS = {'before', 'after', 'held_out_before', 'held_out_after'}


def bag(path: Path, time_s: Float64, **values: Float64) -> Path:
    """Write inputs, sampled at the same times."""
    stamps = np.round(time_s * 1e9).astype(np.int64) + 10**18
    blocks = [Block.of(Channel[name.upper()], stamps, value) for name, value in values.items()]
    with BagWriter(path) as writer:
        writer.write_samples(in_arrival_order(blocks))
    return path


@pytest.fixture
def sailing(tmp_path: Path) -> Path:
    """An hour up and down, at two speeds, with a log that reads 7 % too little."""
    rng = np.random.default_rng(1)
    time = np.arange(3600.0)
    leg = (time // 600.0).astype(int)
    speed = np.where(leg % 3 == 0, 3.0, 6.0) + 0.1 * np.sin(time / 200.0)
    east = np.where(leg % 2 == 0, speed, -speed)
    place = np.array([np.cumsum(east), np.zeros(len(time))]).T
    place += rng.normal(0.0, 1.0, place.shape)
    log = 0.93 * speed + rng.normal(0.0, 0.05, len(time))
    return bag(tmp_path / 'sailing.mcap', time, speed_through_water=log, position=place)


def test_without_coastdown_and_ship_file_log_and_positions_are_compared(sailing, tmp_path, capsys):
    document = tmp_path / 'diagnosis.json'
    assert main(['diagnose', str(sailing), '--json', str(document)]) == 0
    found = json.loads(document.read_text())
    assert found['baseline'] == 'none'
    assert found['candidates'][0]['names'] == ['log_scale']
    assert set(found['gap']) == GAPS
    assert found['gap']['held_out_before'] is None
    assert found['gap']['before']['rms_position_m'] is None
    assert found['coastdowns_used'] == 0
    assert found['examined'] == ['log_track']
    said = capsys.readouterr().out
    first = 'No coastdown was found: without a ship file none is looked for; give one with --ship'
    assert said.startswith(first)
    assert 'Examined: the log against the way over ground; not examined: the force' in said


def sound(path: Path, slowing: bool) -> Path:
    """An hour up and down with a log that reads right; slower by half in a turn if so asked."""
    rng = np.random.default_rng(1)
    time = np.arange(3600.0)
    speed = np.full(len(time), 5.0)
    if slowing:
        speed = np.interp(time, [1820.0, 1880.0, 2400.0, 2460.0], [5.0, 2.5, 2.5, 5.0])
    east = np.where(time // 600.0 % 2 == 0, speed, -speed)
    place = np.array([np.cumsum(east), np.zeros(len(time))]).T
    place += rng.normal(0.0, 1.0, place.shape)
    log = speed + rng.normal(0.0, 0.05, len(time))
    return bag(path, time, speed_through_water=log, position=place)


@pytest.mark.parametrize('slowing', [False, True])
def test_the_first_word_is_that_there_is_no_coastdown_and_why(slowing, tmp_path, capsys):
    sailed = sound(tmp_path / 'sailed.mcap', slowing)
    ship, document = tmp_path / 'ship.yaml', tmp_path / 'found.json'
    ship.write_text(MODEL)
    page = tmp_path / 'page.html'
    line = ['diagnose', str(sailed), '--ship', str(ship), '--report', str(page)]
    assert main([*line, '--json', str(document)]) == 0
    first, second, *_ = capsys.readouterr().out.splitlines()
    why = 'nothing slowed: the speed never fell by more than'
    if slowing:
        why = 'it was none (settled): power was reduced, not cut'
    assert first.startswith(f"No coastdown was found in '{sailed}': ")
    assert why in first
    assert 'nothing is missing' not in second.lower()
    assert second.startswith('Log and track agree')
    found = json.loads(document.read_text())
    # legs of another speed leave room for something without a name: at 0.9 or near it
    assert found['verdict'] in ('none', 'one_of')
    assert found['candidates'][0]['names'] == ['none']
    assert found['coastdowns_used'] == 0
    assert found['examined'] == ['log_track']
    assert found['no_coastdown'] == first
    text = page.read_text(encoding='utf-8')
    assert text.index('No coastdown was found in') < text.index('Log and track agree')
    assert 'not examined: the force on the ship' in text


def test_what_needs_a_ship_file_says_so(sailing: Path, tmp_path, capsys) -> None:
    out = tmp_path / 'ship.yaml'
    assert main(['diagnose', str(sailing), '--write', str(out)]) == 1
    assert '--write needs one' in capsys.readouterr().err
    assert not out.exists()


def test_without_coastdown_and_positions_it_says_what_to_give(tmp_path, capsys) -> None:
    time = np.arange(3600.0)
    log = 4.0 + 0.1 * np.sin(time / 200.0)
    path = bag(tmp_path / 'log.mcap', time, speed_through_water=log)
    assert main(['diagnose', str(path)]) == 1
    error = capsys.readouterr().err
    assert 'ERROR: ' in error
    assert 'No coastdown was found' in error
    assert '--window' in error


def test_a_coast_without_steady_sailing_before_it_says_what_to_give(tmp_path, capsys) -> None:
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 35.0, 0.1)
    # v' = -0.3 v^2 after 5 s of steady speed
    speed = 0.25 / (1.0 + 0.3 * 0.25 * np.maximum(time - 5.0, 0.0))
    speed = speed + rng.normal(0.0, 0.001, len(time))
    path = bag(tmp_path / 'model.mcap', time, speed_through_water=speed)
    ship = tmp_path / 'model.yaml'
    ship.write_text(MODEL)
    assert main(['diagnose', str(path), '--ship', str(ship), '--window', '5', '35']) == 1
    error = capsys.readouterr().err
    assert 'No coastdown could be diagnosed' in error
    assert 'give a record that begins earlier' in error


def test_a_ship_file_of_two_values_does_not_hide_a_current(tmp_path, ship_file, capsys):
    path, document = tmp_path / 'run.mcap', tmp_path / 'found.json'
    line = ['simulate', '--ship', str(ship_file), '-o', str(path), '--lead-in', '1800']
    assert main([*line, '--effect', 'current=0.4', '--seed', '3']) == 0
    two = tmp_path / 'two.yaml'
    two.write_text('length_m: 150.0\ndisplaced_volume_m3: 20200.0\n')
    page = tmp_path / 'page.html'
    line = ['diagnose', str(path), '--ship', str(two), '--report', str(page)]
    assert main([*line, '--json', str(document)]) == 0
    assert 'the ship file has no baseline' in capsys.readouterr().out
    assert 'compared with all hulls of her length and volume' in page.read_text(encoding='utf-8')
    found = json.loads(document.read_text())
    assert found['baseline'] == 'fitted_here'
    assert found['coastdowns_used'] == 1
    assert found['examined'] == ['force', 'log_track']
    # on one course a current and an offset of the log are the same
    assert found['verdict'] == 'one_of'
    alone = [each for each in found['candidates'] if len(each['effects']) == 1]
    sizes = {each['names'][0]: each['effects'][0]['parameters'] for each in alone}
    assert {'current', 'log_offset'} <= set(sizes)
    assert {each['names'][0] for each in found['candidates'][:2]} == {'current', 'log_offset'}
    along = sizes['current']['along_track_m_s']
    assert abs(along['value'] - 0.4) < 3.0 * along['sd']
    assert along['sd'] < 0.1
    assert found['would_decide'][0] == 'a leg on another course'
    assert 'a leg on another course' in page.read_text(encoding='utf-8')


def test_a_log_in_knots_is_asked_about_its_unit(tmp_path, capsys) -> None:
    rng = np.random.default_rng(1)
    time = np.arange(3600.0)
    speed = np.where(time // 600.0 % 3 == 0, 3.0, 6.0)
    east = np.where(time // 600.0 % 2 == 0, speed, -speed)
    place = np.array([np.cumsum(east), np.zeros(len(time))]).T + rng.normal(0.0, 1.0, (3600, 2))
    log = speed / 0.5144 + rng.normal(0.0, 0.05, len(time))
    path = bag(tmp_path / 'knots.mcap', time, speed_through_water=log, position=place)
    assert main(['diagnose', str(path)]) == 0
    said = capsys.readouterr().out
    assert 'the log reads 1.94 times the way over ground, near knots over m/s' in said
