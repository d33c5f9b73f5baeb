# SPDX-License-Identifier: Apache-2.0
"""Arguments are refused where they are given, with what was expected; a window for each bag."""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path

import pytest

from shipdrag_ros.bags import WindowedRun
from shipdrag_ros.cli import arguments, main, on_board
from shipdrag_ros.cli.arguments import WindowedBag, open_parts, open_windowed, windowed_bag
from shipdrag_ros.cli.output import Output
from shipdrag_ros.errors import BagError
from shipdrag_ros.library.replaying import refuse_mixed

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize('text', ['nan', 'inf', '-1', 'x', '', '0x10', '41'])
def test_a_number_outside_its_range_is_refused(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match=r'at least 0 and at most 40 \[m/s\]'):
        arguments.number(0.0, 40.0, unit='m/s')(text)


@pytest.mark.parametrize(
    ('read', 'text', 'value'),
    [
        (arguments.number(0.0, 40.0), '0', 0.0),
        (arguments.number(0.0, 40.0), '40', 40.0),
        (arguments.number(0.0), '1e9', 1e9),
        (arguments.number(-float('inf')), '-1e9', -1e9),
    ],
)
def test_a_number_inside_its_range_is_taken(read, text, value):
    assert read(text) == value


def test_an_open_end_excludes_itself() -> None:
    with pytest.raises(argparse.ArgumentTypeError, match='above 0'):
        arguments.number(0.0, above=True)('0')


@pytest.fixture
def parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(formatter_class=arguments.Help)
    parser.add_argument('--rate', default=1.0, help='rate [Hz]')
    parser.add_argument('--ship', help='ship file')
    parser.add_argument('--node', default='', help='name (default: the first)')
    parser.add_argument('bags', nargs='*')
    arguments.add(parser, '--json')
    return parser


def test_help_names_defaults_that_say_something(parser: argparse.ArgumentParser) -> None:
    text = parser.format_help()
    assert 'rate [Hz] (default: 1.0)' in text
    assert 'None' not in text
    assert text.count('(default: ') == 2


def test_json_goes_to_stdout_or_to_a_file(parser: argparse.ArgumentParser, tmp_path: Path) -> None:
    assert parser.parse_args([]).json is None
    assert parser.parse_args(['a.mcap', '--json']).json == '-'
    new = str(tmp_path / 'new')
    assert parser.parse_args(['--json', new, 'a.mcap']).json == new
    (tmp_path / 'old.json').write_text('{}')
    assert parser.parse_args(['--json', str(tmp_path / 'old.json')]).json
    assert parser.parse_args(['--json', '/dev/null']).json == '/dev/null'


def test_json_does_not_overwrite_what_is_no_json(parser, tmp_path, capsys):
    (tmp_path / 'ship.yaml').write_text('')
    for name in ('new.mcap', 'ship.yaml', '.'):
        with pytest.raises(SystemExit):
            parser.parse_args(['--json', str(tmp_path / name)])
        assert 'would be overwritten by the JSON; for stdout put' in capsys.readouterr().err


def test_no_remapping_takes_the_place_of_another(capsys: pytest.CaptureFixture[str]) -> None:
    parser = argparse.ArgumentParser()
    arguments.add(parser, '--remap')
    assert parser.parse_args([]).remap == {}
    line = ['--remap', 'depth:=/a', '--remap', '/b:=heading']
    assert parser.parse_args(line).remap == {'depth': '/a', '/b': 'heading'}
    with pytest.raises(SystemExit) as end:
        parser.parse_args([*line, '--remap', 'depth:=/c'])
    assert end.value.code == 2
    assert "'depth' is remapped twice" in capsys.readouterr().err


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
    on_board.add_watch(parser)
    options = parser.parse_args([f'{bag}@400:460', str(bag)])
    part, whole = open_parts(options.bags, Output(), remap={})
    notes = ['before']
    with on_board._source(options, None, [], Output(), notes) as (source, _):
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
