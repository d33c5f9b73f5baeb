# SPDX-License-Identifier: Apache-2.0
"""From bags to the missing effect, to a ship file that has it, to a model that agrees."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.cli import main
from shipdrag_ros.cli.arguments import WindowedBag, open_windowed
from shipdrag_ros.cli.output import Output
from shipdrag_ros.diagnosis.document import read_earlier
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.library.diagnosing import coasts_of
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, sense, simulate, standard_sensors

ROOT = Path(__file__).resolve().parents[2]


def simulated(path: Path, ship_file: Path, *arguments: str) -> Path:
    """Write a coastdown after half an hour of steady sailing."""
    line = ['simulate', '--ship', str(ship_file), '-o', str(path), '--lead-in', '1800']
    assert main([*line, *arguments]) == 0
    return path


@pytest.fixture(scope='module')
def in_current(ship_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run in a current that the ship file does not state."""
    path = tmp_path_factory.mktemp('current') / 'out.mcap'
    return simulated(path, ship_file, '--effect', 'current=0.4', '--seed', '1')


def test_the_example_of_the_page_works_as_typed(tmp_path, monkeypatch, capsys) -> None:
    text = (ROOT / 'docs' / 'diagnosis.md').read_text(encoding='utf-8')
    typed = re.findall(r'^    \.venv/bin/shipdrag (.*?)(?: {2,}#.*)?$', text, flags=re.MULTILINE)
    (tmp_path / 'config').symlink_to(ROOT / 'config')
    monkeypatch.chdir(tmp_path)
    said = []
    for line in typed[:4]:
        assert main(line.split()) == 0, line
        said.append(capsys.readouterr().out)
    assert said[2].startswith('Missing in the model: current (along track (0.')
    assert 'each run predicted, with current learnt from the others' in said[2]
    assert said[3].startswith('Model and data agree')
    assert said[2].split(';')[0] in Path('diagnosis.html').read_text(encoding='utf-8')

    # what was written is a ship to sail
    (stated,) = Ship.load(Path('ship_now.yaml')).effects
    along = stated.parameters['along_track_m_s']
    assert abs(along.value - 0.4) < 3.0 * along.sd


def test_while_the_verdict_waits_no_figure_stands_beside_the_question(ship_file, tmp_path, capsys):
    bag = simulated(tmp_path / 'miles.mcap', ship_file, '--effect', 'log_scale=0.15')
    capsys.readouterr()
    document = tmp_path / 'found.json'
    assert main(['diagnose', str(bag), '--json', str(document)]) == 0
    found, said = json.loads(document.read_text()), capsys.readouterr().out
    assert (found['verdict'], found['effects']) == ('one_of', [])
    assert 'is the unit of one of them wrong?' in said.splitlines()[0]
    assert 'The verdict waits for the answer; if the unit is right: log ' in said.splitlines()[0]
    likeliest = found['candidates'][0]
    assert (likeliest['names'], likeliest['probability'] > 0.8) == (['log_scale'], True)
    # as an earlier diagnosis it says nothing yet
    with pytest.raises(DiagnosisError, match='waits for the answer'):
        read_earlier(document)
    for words in ('over the clean hull', 'resistance', 'disagree', 'How probable'):
        assert words not in said
    # the answer may be that the unit is right
    assert main(['diagnose', str(bag), '--fact', 'units_checked']) == 0
    assert capsys.readouterr().out.startswith('Missing in the model: log scale (factor 0.1')


def test_a_speed_that_no_baseline_reaches_is_a_question_too(ship_file, tmp_path, capsys):
    bag = simulated(tmp_path / 'knots.mcap', ship_file, '--effect', 'log_scale=0.944')
    assert main(['diagnose', str(bag), '--json', str(tmp_path / 'found.json')]) == 0
    found = json.loads((tmp_path / 'found.json').read_text())
    assert (found['verdict'], found['candidates']) == ('one_of', [])
    assert 'near knots over m/s' in found['question']
    assert f'if the unit is right: {bag}: speed_m_s is 15.5' in '; '.join(found['notes'])


def test_a_log_that_is_rejected_on_board_is_told_of_and_diagnosed(ship_file, tmp_path, capsys):
    ship = Ship.load(ship_file)
    sensors = standard_sensors(rate_hz=1.0, inputs=('speed_through_water', 'position'))
    scenario = Scenario(speed_m_s=8.2, lead_in_s=900.0, duration_s=400.0)
    block = sense(simulate(ship, scenario), sensors, seed=1)
    slow_ns = np.where(block.channel == Channel.SPEED_THROUGH_WATER, 20_000_000_000, 0)
    with BagWriter(tmp_path / 'slow.mcap') as bag:
        bag.write_samples(replace(block, stamp_ns=block.stamp_ns - slow_ns))
    bag = WindowedBag(tmp_path / 'slow.mcap', None)
    (coast,), _, _ = coasts_of(Output(), open_windowed([bag], remap={}, output=Output()), ship)
    assert len(coast.window.speed_through_water.value) > 350
    assert 'the clock of speed_through_water is too slow or too fast' in capsys.readouterr().err


def test_the_result_reads_well_and_says_the_same_to_the_machine(
    in_current, steady_bag, tmp_path, capsys
):
    capsys.readouterr()
    line = ['diagnose', str(in_current), str(steady_bag)]
    assert main([*line, '--json', str(tmp_path / 'found.json')]) == 0
    said = capsys.readouterr().out
    # of the bag without a coastdown beside the one with it
    assert f"no coastdown was found in '{steady_bag}': by speed_through_water nothing" in said
    found = json.loads((tmp_path / 'found.json').read_text())
    assert found['verdict'] == 'named'
    assert found['coastdowns_used'] == 1
    assert found['examined'] == ['force', 'log_track']
    assert found['no_coastdown'] is None
    (effect,) = found['effects']
    assert effect['name'] == 'current'
    assert found['gap']['before']['chi2_per_sample'] > 3.0
    assert found['gap']['after']['chi2_per_sample'] < 1.2
    assert said.startswith('Missing in the model: current (along track (0.')
    for words in (
        'How probable',
        'something without a name',
        f'{effect["parameters"]["along_track_m_s"]["value"]:.2f}',
        'velocity of the water along the heading of the first run',
        'Gap between model and data',
        f'{found["gap"]["before"]["rms_position_m"]:.1f}',
        'with current',
    ):
        assert words in said, words
    assert 'predicted' not in said  # from one run nothing is


def test_the_log_alone_is_enough_and_nothing_named_is_not_written(ship_file, tmp_path, capsys):
    clean = simulated(tmp_path / 'clean.mcap', ship_file, '--inputs', 'speed_through_water')
    capsys.readouterr()
    written = tmp_path / 'ship.yaml'
    assert main(['diagnose', str(clean), '--write', str(written)]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith('Nothing is missing (')
    assert 'Examined: the force on the ship; not examined: the log against' in captured.out
    assert 'is not written' in captured.err
    assert not written.exists()


def test_neither_a_coastdown_nor_enough_sailing_is_an_error(steady_bag: Path, capsys) -> None:
    assert main(['diagnose', str(steady_bag)]) == 1
    said = capsys.readouterr().err
    assert '\nERROR: No coastdown was found in ' in said
    assert 'by speed_through_water nothing slowed' in said
    assert 'give a longer record' in said


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (('--write', 'ship.yaml'), 'exists'),
        (('--write', 'new.txt'), 'ends in .yaml'),
        (('--report', 'page.pdf'), 'ends in .html'),
    ],
)
def test_files_are_checked_before_the_work(arguments, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'ship.yaml').write_text('precious')
    with pytest.raises(SystemExit) as stopped:
        main(['diagnose', 'a.mcap', *arguments])
    assert stopped.value.code == 2
    assert said in capsys.readouterr().err
    assert (tmp_path / 'ship.yaml').read_text() == 'precious'


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
    power = re.search(r'resistance (\S+) ± ', said)

    sheet = fouled.with_name('run.mcap.run.yaml')
    sheet.write_text(f'facts: [{", ".join(KNOWN)}]\ndisplaced_volume_m3: 21000.0\n')
    try:
        told = found(tmp_path, str(fouled))
        out, said = capsys.readouterr()
    finally:
        sheet.unlink()
    assert f'{sheet} holds for this run' in said
    heavier = re.search(r'resistance (\S+) ± ', out)
    assert power
    assert heavier
    assert float(heavier[1]) == pytest.approx(21.0 / 20.2 * float(power[1]), rel=0.01)
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
    return sailed(tmp_path / 'sailing.mcap', 0.93)


def sailed(path: Path, factor: float) -> Path:
    """Write an hour up and down, at two speeds, with a log that reads so many times the speed."""
    rng = np.random.default_rng(1)
    time = np.arange(3600.0)
    leg = (time // 600.0).astype(int)
    speed = np.where(leg % 3 == 0, 3.0, 6.0) + 0.1 * np.sin(time / 200.0)
    east = np.where(leg % 2 == 0, speed, -speed)
    place = np.array([np.cumsum(east), np.zeros(len(time))]).T
    place += rng.normal(0.0, 1.0, place.shape)
    log = factor * speed + rng.normal(0.0, 0.05, len(time))
    return bag(path, time, speed_through_water=log, position=place)


def test_a_run_file_answers_the_question_about_a_unit_without_a_coastdown(tmp_path, capsys):
    path, ship = sailed(tmp_path / 'miles.mcap', 0.868), tmp_path / 'ship.yaml'
    ship.write_text(MODEL)
    sheet, asked = tmp_path / 'miles.mcap.run.yaml', 'is the unit of one of them wrong?'
    for line in (['diagnose', str(path)], ['diagnose', str(path), '--ship', str(ship)]):
        assert main(line) == 0
        assert asked in capsys.readouterr().out
        sheet.write_text('facts: [units_checked]\n')
        assert main(line) == 0
        assert asked not in capsys.readouterr().out
        sheet.unlink()


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
    ship.write_text('length_m: 60.0\ndisplaced_volume_m3: 2000.0\n')
    page = tmp_path / 'page.html'
    line = ['diagnose', str(sailed), '--ship', str(ship), '--report', str(page)]
    assert main([*line, '--json', str(document)]) == 0
    first, second, *_ = capsys.readouterr().out.splitlines()
    why = 'nothing slowed: the speed never fell by more than'
    if slowing:
        why = 'it was none (brake): something but the water slowed her'
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
    assert 'fouling, a propeller or a cable may be the hull' in capsys.readouterr().out
    assert 'compared with all hulls of her length and volume' in page.read_text(encoding='utf-8')
    found = json.loads(document.read_text())
    assert found['baseline'] == 'fitted_here'
    assert found['coastdowns_used'] == 1
    assert found['examined'] == ['force', 'log_track']
    assert {'fouling', 'towed_cable'} <= set(found['limits'])  # by the force
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
