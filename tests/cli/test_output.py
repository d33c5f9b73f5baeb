# SPDX-License-Identifier: Apache-2.0
"""Results and logs go to their own streams, and nothing is cut."""

from __future__ import annotations

import json

import numpy as np
import pytest

from shipdrag_ros.cli.output import Output
from shipdrag_ros.display import Table


def test_results_go_to_stdout_and_logs_to_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    output = Output()
    output.say('result')
    output.log('log')
    output.json({'a': 1})
    assert capsys.readouterr() == ('result\n', 'log\n')


def test_json_has_stdout_for_itself(capsys: pytest.CaptureFixture[str]) -> None:
    output = Output('-')
    output.say('result')
    output.json({'a': 1})
    captured = capsys.readouterr()
    assert json.loads(captured.out) == {'a': 1}
    assert captured.err == 'result\n'


def test_json_in_a_file_leaves_stdout_to_the_reader(capsys, tmp_path) -> None:
    output = Output(str(tmp_path / 'a.json'))
    output.say('result')
    output.json({'a': 1})
    assert json.loads((tmp_path / 'a.json').read_text()) == {'a': 1}
    assert capsys.readouterr().out == 'result\n'


def test_what_is_not_finite_is_null(capsys: pytest.CaptureFixture[str]) -> None:
    Output('-').json(
        {
            'array': np.array([1.0, np.nan]),
            'scalar': np.float64(np.inf),
            'deep': [{'x': float('-inf')}],
            'integer': np.int64(2**62),
            'pair': (0.05, 0.18),
            'nothing': None,
        }
    )
    assert json.loads(capsys.readouterr().out) == {
        'array': [1.0, None],
        'scalar': None,
        'deep': [{'x': None}],
        'integer': 2**62,
        'pair': [0.05, 0.18],
        'nothing': None,
    }


def test_names_from_outside_are_not_markup(capsys: pytest.CaptureFixture[str]) -> None:
    Output().say('[red]a[/] :smile: 2.5')
    Output().table(Table(('[b]',), (('[link=x]y[/link]',),)))
    captured = capsys.readouterr().out
    assert '[red]a[/] :smile: 2.5' in captured
    assert '[link=x]y[/link]' in captured


def test_a_long_line_is_not_cut(capsys: pytest.CaptureFixture[str]) -> None:
    Output().say('word ' * 100)
    assert capsys.readouterr().out == 'word ' * 100 + '\n'


def test_figures_stand_to_the_right(capsys: pytest.CaptureFixture[str]) -> None:
    Output().table(Table(('name', 'n'), (('a', '1'), ('b', '1000'))))
    assert capsys.readouterr().out.splitlines()[1:] == ['a        1', 'b     1000']


def test_progress_is_silent_where_nobody_looks(capsys: pytest.CaptureFixture[str]) -> None:
    with Output().progress('reading') as done:
        done(1, 2)
    assert capsys.readouterr() == ('', '')
