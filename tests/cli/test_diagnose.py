# SPDX-License-Identifier: Apache-2.0
"""From bags to the missing effect, to a ship file that has it, to a model that agrees."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.cli import main
from shipdrag_ros.cli.output import Output
from shipdrag_ros.cli.windowed import WindowedBag, open_windowed
from shipdrag_ros.library.diagnosing import coasts_of
from shipdrag_ros.samples import Channel
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

    # what was written is a ship to sail, and the bag carries it
    (stated,) = Ship.load(Path('ship_now.yaml')).effects
    along = stated.parameters['along_track_m_s']
    assert abs(along.value - 0.4) < 3.0 * along.sd
    sea = simulated(tmp_path / 'sea.mcap', Path('ship_now.yaml'), '--seed', '5')
    capsys.readouterr()
    assert main(['diagnose', str(sea)]) == 0
    assert capsys.readouterr().out.startswith('Model and data agree')


def test_while_the_verdict_waits_no_figure_stands_beside_the_question(ship_file, tmp_path, capsys):
    bag = simulated(tmp_path / 'knots.mcap', ship_file, '--effect', 'log_scale=0.944')
    capsys.readouterr()
    document = tmp_path / 'found.json'
    assert main(['diagnose', str(bag), '--json', str(document)]) == 0
    found, said = json.loads(document.read_text()), capsys.readouterr().out
    assert (found['verdict'], found['effects']) == ('one_of', [])
    assert 'is the unit of one of them wrong?' in said.splitlines()[0]
    assert 'The verdict waits for the answer.' in said.splitlines()[0]
    for words in ('over the clean hull', 'resistance', 'Examined', 'How probable'):
        assert words not in said


def test_a_log_that_is_rejected_on_board_is_told_of_and_diagnosed(ship_file, tmp_path, capsys):
    ship = Ship.load(ship_file)
    sensors = standard_sensors(rate_hz=1.0, inputs=('speed_through_water', 'position'))
    scenario = Scenario(speed_m_s=8.2, lead_in_s=900.0, duration_s=400.0)
    block = sense(simulate(ship, scenario), sensors, seed=1)
    slow_ns = np.where(block.channel == Channel.SPEED_THROUGH_WATER, 20_000_000_000, 0)
    with BagWriter(tmp_path / 'slow.mcap') as bag:
        bag.write_samples(replace(block, stamp_ns=block.stamp_ns - slow_ns))
    bag = WindowedBag(tmp_path / 'slow.mcap', None)
    (coast,), _, _ = coasts_of(Output(), open_windowed([bag], remap={}), ship)
    assert len(coast.window.speed_through_water.value) > 350
    assert 'the clock of speed_through_water is too slow or too fast' in capsys.readouterr().err


def test_the_result_reads_well_and_says_the_same_to_the_machine(in_current, tmp_path, capsys):
    capsys.readouterr()
    assert main(['diagnose', str(in_current), '--json', str(tmp_path / 'found.json')]) == 0
    said = capsys.readouterr().out
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


def test_too_little_steady_sailing_is_an_error(ship_file: Path, tmp_path, capsys) -> None:
    short = simulated(tmp_path / 'short.mcap', ship_file, '--lead-in', '120')
    assert main(['diagnose', str(short)]) == 1
    assert 's of steady sailing before the stop' in capsys.readouterr().err


def test_neither_a_coastdown_nor_enough_sailing_is_an_error(steady_bag: Path, capsys) -> None:
    assert main(['diagnose', str(steady_bag)]) == 1
    said = capsys.readouterr().err
    assert '\nERROR: No coastdown was found in ' in said
    assert 'by speed_through_water nothing slowed' in said
    assert 'give a longer record' in said


def test_a_bag_without_a_coastdown_beside_one_with_is_told_of(in_current, steady_bag, capsys):
    capsys.readouterr()
    assert main(['diagnose', str(in_current), str(steady_bag)]) == 0
    said = capsys.readouterr().out
    assert said.startswith('Missing in the model: current')
    assert f"no coastdown was found in '{steady_bag}': by speed_through_water nothing" in said


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
