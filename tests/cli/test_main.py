# SPDX-License-Identifier: Apache-2.0
"""Exit statuses, help, and errors without a traceback."""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import pytest

from shipdrag_ros import cli
from shipdrag_ros.cli import on_board
from shipdrag_ros.errors import BagError

SHIPDRAG = Path(sys.executable).with_name('shipdrag')


def run_verb(monkeypatch: pytest.MonkeyPatch, result: int | BaseException, *arguments: str) -> int:
    """Run a verb in whose place something else is done."""

    def run(options: argparse.Namespace) -> int:
        if isinstance(result, BaseException):
            raise result
        return result

    monkeypatch.setattr(on_board, 'run_node', run)
    return cli.main(['node', '--ship', 'a', '--out', 'b', *arguments])


def stopped(line: list[str]) -> int | str | None:
    """Return the status with which argparse ends the program."""
    with pytest.raises(SystemExit) as end:
        cli.main(line)
    return end.value.code


@pytest.mark.parametrize(
    ('result', 'status', 'said'),
    [
        (0, 0, ''),
        (1, 1, ''),
        (BagError("'a.mcap' is empty; record again"), 1, "ERROR: 'a.mcap' is empty; record again"),
        (FileNotFoundError(2, 'No such file', 'a'), 1, "ERROR: 'a': No such file; check the path"),
        (KeyboardInterrupt(), 130, ''),
    ],
)
def test_an_end_has_its_status(monkeypatch, capsys, result, status, said):
    assert run_verb(monkeypatch, result) == status
    captured = capsys.readouterr()
    assert captured.err.startswith(said)
    assert bool(captured.err) == bool(said)
    assert captured.out == ''


def test_a_defect_is_not_taken_for_a_user_error(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ZeroDivisionError):
        run_verb(monkeypatch, ZeroDivisionError())
    with pytest.raises(OSError, match='no path'):
        run_verb(monkeypatch, OSError('no path'))


@pytest.mark.parametrize(
    'line', [[], ['nonsense'], ['node'], ['node', '--nonsense'], ['--nonsense']]
)
def test_wrong_usage_is_2(line: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert stopped(line) == 2
    assert 'usage: shipdrag' in capsys.readouterr().err


def test_help_lists_the_verbs(capsys: pytest.CaptureFixture[str]) -> None:
    assert stopped(['--help']) == 0
    captured = capsys.readouterr().out
    for verb in cli.verbs():
        assert f'    {verb.name}' in captured
        assert verb.summary in ' '.join(captured.split())
    own, papers = captured.split('\npapers:\n')
    assert '    recover ' in own
    assert '    cable ' in papers


@pytest.mark.parametrize('verb', [verb.name for verb in cli.verbs()])
def test_each_verb_has_help(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert stopped([verb, '--help']) == 0
    captured = capsys.readouterr().out
    assert f'usage: shipdrag {verb}' in captured
    assert 'None' not in captured
    assert '--effects DIR' in captured or verb == 'effect'  # there it is of `list`, which runs


@pytest.mark.parametrize('verb', [verb.name for verb in cli.verbs()])
def test_each_option_is_explained(verb: str) -> None:
    top = cli.parser(verb)
    (verbs,) = [item for item in top._actions if isinstance(item, argparse._SubParsersAction)]
    for action in verbs.choices[verb]._actions:
        assert action.help, action.option_strings or action.dest
        # what is a number says in which unit, by name or in brackets
        if isinstance(action.default, float):
            assert '[' in action.help, action.option_strings


def test_values_of_options_are_called_as_the_docstring_of_the_verb_calls_them() -> None:
    (verbs,) = [
        item
        for item in cli.parser('replay')._actions
        if isinstance(item, argparse._SubParsersAction)
    ]
    called = {action.dest: action.metavar for action in verbs.choices['replay']._actions}
    assert (called['ship'], called['window']) == ('FILE', ('START', 'END'))
    assert called['compare'] is None


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert stopped(['--version']) == 0
    assert capsys.readouterr().out.startswith('shipdrag_ros 0.')


def test_help_is_there_at_once_and_needs_no_ros() -> None:
    loaded = subprocess.run(
        [
            sys.executable,
            '-c',
            'import sys; from shipdrag_ros.cli import parser; parser("").print_help(); '
            'print([name for name in ("numpy", "numba", "matplotlib", "rclpy", "mcap") '
            'if name in sys.modules])',
        ],
        capture_output=True,
        text=True,
        timeout=200,
        check=True,
    )
    assert loaded.stdout.splitlines()[-1] == '[]'


def test_a_reader_that_goes_away_is_no_error(ship_file: Path, tmp_path: Path) -> None:
    with subprocess.Popen(
        [SHIPDRAG, 'simulate', '--ship', ship_file, '-o', tmp_path / 'a.mcap', '--duration', '9'],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.wait(timeout=200) == 141
        assert process.stderr.read() == b''
