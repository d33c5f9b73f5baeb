# SPDX-License-Identifier: Apache-2.0
"""A window for each bag, where bags are given."""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path

import pytest

from shipdrag_ros.bags import WindowedRun
from shipdrag_ros.cli import main, watch
from shipdrag_ros.cli.output import Output
from shipdrag_ros.cli.windowed import WindowedBag, open_parts, open_windowed, windowed_bag
from shipdrag_ros.errors import BagError
from shipdrag_ros.library.replaying import refuse_mixed

ROOT = Path(__file__).resolve().parents[2]


def test_a_bag_may_carry_its_window(tmp_path: Path) -> None:
    assert windowed_bag('a.mcap') == WindowedBag(Path('a.mcap'), None)
    assert windowed_bag('a.mcap@12.5:90') == WindowedBag(Path('a.mcap'), (12.5, 90.0))
    assert windowed_bag('x@y/a.mcap@0:1e3') == WindowedBag(Path('x@y/a.mcap'), (0.0, 1000.0))
    assert windowed_bag('me@home.mcap') == WindowedBag(Path('me@home.mcap'), None)
    named = tmp_path / 'a@1:2'
    named.touch()
    assert windowed_bag(str(named)) == WindowedBag(named, None)
    assert windowed_bag(f'{named}@3:4') == WindowedBag(named, (3.0, 4.0))


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('a.mcap@90:12', 'runs from 90 to 12 s; expected 0 <= START < END'),
        ('a.mcap@5:5', 'runs from 5 to 5 s'),
        ('a.mcap@-1:5', 'runs from -1 to 5 s'),
        ('a.mcap@1:', "the window '1:' is not START:END in s"),
        ('a.mcap@1:x', "the window '1:x' is not START:END in s"),
        ('a.mcap@1:nan', 'is not START:END'),
        ('@1:2', 'is not START:END'),
        *((f'{__file__}@{window}', 'is not START:END in s') for window in ('', '10', 'START')),
    ],
)
def test_a_wrong_window_is_named(text: str, said: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as error:
        windowed_bag(text)
    assert said in str(error.value)


def test_runs_come_in_the_order_given(coastdown_bag: Path, tmp_path: Path) -> None:
    other = tmp_path / 'other.mcap'
    shutil.copy(coastdown_bag, other)
    given = [WindowedBag(other, (400.0, 900.0)), WindowedBag(coastdown_bag, None)]
    given.append(WindowedBag(other, (500.0, 1000.0)))
    found = open_windowed(given, remap={}, window=(450.0, 800.0), output=Output())
    assert [(run.name, window) for run, window in found] == [
        (str(other), (400.0, 900.0)),
        (str(coastdown_bag), (450.0, 800.0)),
        (str(other), (500.0, 1000.0)),
    ]


def test_watch_plays_the_part_that_is_given_and_says_what_holds_for_it(coastdown_bag, tmp_path):
    bag, sheet = shutil.copy(coastdown_bag, tmp_path / 'own.mcap'), tmp_path / 'run.yaml'
    sheet.write_text('facts: [calm]\n')
    parser = argparse.ArgumentParser()
    watch.add_arguments(parser)
    options = parser.parse_args([f'{bag}@400:460', str(bag)])
    part, whole = open_parts(options.bags, Output(), remap={})
    notes = ['before']
    with watch._source(options, None, [], Output(), notes) as (source, _):
        player = source.player()
    assert notes[:2] == ['before', f'{bag}: {sheet} holds for this run']
    assert player is not None
    assert (player['start_s'], player['end_s']) == tuple(each // 10**9 for each in part.span_ns)
    assert whole.span_ns[0] + 400 * 10**9 == part.span_ns[0]


def test_replay_takes_each_window_and_does_not_combine_what_overlaps(coastdown_bag, capsys):
    bags = [f'{coastdown_bag}@430:700', f'{coastdown_bag}@500:900']
    capsys.readouterr()
    assert main(['replay', *bags, '--window', '0', '1', '--json']) == 0
    told = capsys.readouterr()
    found = json.loads(told.out)
    first, second = ((it['end_ns'] - it['start_ns']) * 1e-9 for it in found['coastdowns'])
    assert (first, second) == (pytest.approx(270.0), pytest.approx(400.0))
    assert {each['ended_by'] for each in found['coastdowns']} == {'given'}
    assert found['combined'] is None
    assert 'Not combined: windows of' in told.err


@pytest.mark.parametrize('verb', ['diagnose', 'baseline'])
def test_a_part_that_is_given_twice_is_no_second_run(verb, coastdown_bag, tmp_path, capsys):
    words = [f'{coastdown_bag}@430:900', f'{coastdown_bag}@500:1200']
    if verb == 'baseline':
        ship = str(ROOT / 'config' / 'vitus_bering.yaml')
        words += ['--ship', ship, '-o', str(tmp_path / 'learnt.yaml')]
    assert main([verb, *words]) == 1
    told = ' '.join(capsys.readouterr().err.split())
    assert 'given twice, 430 to 900 s and 500 to 1200 s: they share a part' in told


def test_a_bag_beside_a_part_of_it_is_given_twice(coastdown_bag: Path) -> None:
    ((run, _),) = open_windowed([WindowedBag(coastdown_bag, None)], remap={}, output=Output())
    part = WindowedRun(run, (430.0, 900.0))
    with pytest.raises(BagError, match='given twice'):
        refuse_mixed([WindowedRun(run, None), part], None)
    refuse_mixed([WindowedRun(run, (0.0, 430.0)), part], None)


def test_a_window_may_hold_the_steady_lead(tmp_path, capsys) -> None:
    ship = str(ROOT / 'config' / 'vitus_bering.yaml')
    lead = tmp_path / 'lead.mcap'
    assert main(['simulate', '--ship', ship, '-o', str(lead), '--lead-in', '900']) == 0
    capsys.readouterr()
    assert main(['diagnose', f'{lead}@0:2400', '--ship', ship, '--json']) == 0
    assert json.loads(capsys.readouterr().out)['coastdowns_used'] == 1


def test_what_is_cut_is_said_first_in_text_and_report(coastdown_bag, tmp_path, capsys):
    page, document = tmp_path / 'a.html', tmp_path / 'a.json'
    line = ['replay', f'{coastdown_bag}@100:900', '--report', str(page), '--json', str(document)]
    assert main(line) == 0
    said = capsys.readouterr().out
    assert 'Of 100.0 s to 900.0 s only' in said
    assert said.index('is taken for a coastdown') < said.index('r(v) is known from')
    text = page.read_text(encoding='utf-8')
    assert text.index('is taken for a coastdown') < text.index('r(v) is known from')
    assert 'Hatched: what was cut, and why' in text
    found = json.loads(document.read_text())
    (coastdown,) = found['coastdowns']
    before = [each for each in found['not_coastdowns'] if each['reason'] == 'thrust']
    assert [each['end_ns'] for each in before] == [coastdown['start_ns']]
    assert 'the shaft turns as if it drove her' in before[0]['text']
