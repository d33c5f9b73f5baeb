# SPDX-License-Identifier: Apache-2.0
"""Arguments are refused where they are given, with what was expected."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest

from shipdrag_ros.cli import arguments


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
