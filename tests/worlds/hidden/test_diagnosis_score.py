# SPDX-License-Identifier: Apache-2.0
"""The scoreboard counts what it says, and takes a diagnosis in either form."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.accuracy import diagnosis_score as score
from benchmarks.worlds.hidden import cases, scoring
from shipdrag_ros import cli
from shipdrag_ros.bags import open_runs
from shipdrag_ros.samples import Channel, concatenate


def _found(verdict, *, effects=(), candidates=(), held_out=None, parameters=None):
    return {
        'verdict': verdict,
        'effects': [
            {'name': name, 'probability': 0.99, 'parameters': parameters or {}} for name in effects
        ],
        'candidates': [{'names': list(names), 'probability': p} for names, p in candidates],
        'gap': {'held_out_after': {'chi2_per_sample': held_out}},
    }


def _trial(found, *names, kind='one', shelf=1, parameters=None):
    truth = cases.Truth(kind, shelf, names, parameters or {}, cases.CONDITIONS[0])
    return scoring.Trial(truth, scoring.parse(found), 1.0)


def _share(scores, name):
    return scores[name].count, scores[name].of


def test_names_sets_and_alarms_are_counted() -> None:
    named = _found('named', effects=['current'], candidates=[(['current'], 0.99)])
    pair = [(['current', 'fouling'], 0.6), (['current'], 0.4)]
    three = [(['wind'], 0.5), (['waves'], 0.3), (['current'], 0.2)]
    four = [*three[:2], (['fouling'], 0.15), (['current'], 0.05)]
    unknown = _found('unknown', candidates=[(['unknown'], 1.0)])
    scores = scoring.scores(
        [
            _trial(named, 'current'),
            _trial(named, 'wind'),
            _trial(_found('one_of', candidates=three), 'current'),
            _trial(_found('one_of', candidates=four), 'current'),
            _trial(_found('none', candidates=[([], 0.9)]), kind='none', shelf=0),
            _trial(named, kind='none', shelf=0),
            _trial(unknown, 'ice field', kind='outside', shelf=0),
            _trial(named, 'ice field', kind='outside', shelf=0),
            _trial(_found('one_of', candidates=pair), 'current', 'fouling', kind='pair'),
        ]
    )
    assert _share(scores, 'precision of a name') == (1, 2)
    assert _share(scores, 'precision, whatever is hidden') == (1, 4)
    assert _share(scores, 'named, first shelf') == (1, 4)
    assert _share(scores, 'name or set of <= 3 with the truth, first shelf') == (2, 4)
    assert _share(scores, 'alarm, nothing hidden') == (1, 2)
    assert _share(scores, 'false name, nothing hidden') == (1, 2)
    assert _share(scores, 'unknown, outside the library') == (1, 2)
    assert _share(scores, 'falsely named, outside the library') == (1, 2)
    assert _share(scores, 'pair in the answer') == (1, 1)


def test_parameters_and_held_out_runs_count_for_right_names_alone() -> None:
    parameters = {'along_track_m_s': {'value': 0.4, 'sd': 0.02}}
    found = _found('named', effects=['current'], held_out=1.05, parameters=parameters)
    near = {'current': {'along_track_m_s': 0.43, 'cross_track_m_s': 0.1}}
    far = {'current': {'along_track_m_s': 0.45}}
    scores = scoring.scores(
        [
            _trial(found, 'current', parameters=near),
            _trial(found, 'current', parameters=far),
            _trial(found, 'wind', parameters={'wind': {'head_m_s': 4.0}}),
        ]
    )
    assert _share(scores, 'parameters within 2 sd') == (1, 2)
    assert _share(scores, 'held-out chi^2 per sample <= 1.1') == (2, 2)


def test_calibration_error_of_honest_and_of_boastful_answers() -> None:
    honest = [(0.75, k % 4 > 0) for k in range(400)]
    boastful = [(0.99, k % 2 > 0) for k in range(400)]
    assert scoring.calibration_error(honest) == pytest.approx(0.0, abs=1e-12)
    assert scoring.calibration_error(boastful) == pytest.approx(0.49, abs=1e-12)


def test_blocks_and_bags_hold_the_same_samples(tmp_path: Path) -> None:
    seen = score.cases.observe(0)
    block = score.as_block(seen.runs[0])
    _, bags = score.write_bags(seen, tmp_path)
    (run,) = open_runs([bags[0]])
    read = concatenate(list(run.inputs()))
    np.testing.assert_array_equal(read.channel, block.channel)
    np.testing.assert_array_equal(read.stamp_ns, block.stamp_ns)
    np.testing.assert_array_equal(read.receive_ns, block.receive_ns)
    # a heading is sent as a quaternion, a depth with seven digits
    rounded = np.isin(block.channel, (Channel.HEADING, Channel.DEPTH))
    np.testing.assert_array_equal(read.value[~rounded], block.value[~rounded])
    np.testing.assert_allclose(read.value, block.value, rtol=1e-7, atol=1e-12)


FAKE = """
def diagnose(ship_file, runs):
    assert 'length_m' in ship_file and len(runs[0]) > 1000
    candidates = [{'names': [], 'probability': 1.0}]
    return {'verdict': 'none', 'effects': [], 'candidates': candidates}
"""


def test_ten_cases_are_scored_and_a_broken_run_goes_on(tmp_path, monkeypatch, capsys) -> None:
    (tmp_path / 'fake.py').write_text(FAKE, encoding='utf-8')
    monkeypatch.syspath_prepend(tmp_path)
    out = tmp_path / 'fake.jsonl'
    arguments = ['--by', 'fake:diagnose', '--out', str(out)]
    score.main([*arguments, '--count', '4'])
    first = out.read_text().splitlines()
    capsys.readouterr()
    score.main([*arguments, '--count', '10'])
    printed = capsys.readouterr().out
    lines = out.read_text().splitlines()
    assert lines[:4] == first
    assert [json.loads(line)['case'] for line in lines] == list(range(10))
    assert '10 of 996 cases, seed 20260601' in printed
    figures = scoring.scores(score.trials([json.loads(line) for line in lines]))
    assert _share(figures, 'alarm, nothing hidden') == (0, 4)
    assert figures['unknown, outside the library'].count == 0


def test_the_command_is_given_bags_and_a_ship_file_and_its_errors_are_told(monkeypatch) -> None:
    given = []

    def fake(arguments):
        given.append(arguments)
        if len(given) > 1:
            print('ERROR: no baseline', file=sys.stderr)
            return 1
        print(json.dumps(_found('none')))
        return 0

    monkeypatch.setattr(cli, 'main', fake)
    row = score.answer('command', 0)
    assert row['found']['verdict'] == 'none'
    assert given[0][0] == 'diagnose'
    assert given[0][-3] == '--ship'
    assert given[0][-1] == '--json'
    assert 'no baseline' in score._answer(('command', 0))['error']


def test_an_answer_that_fails_is_told_and_not_counted(tmp_path: Path) -> None:
    row = score._answer(('no_such_module:diagnose', 0))
    assert 'ModuleNotFoundError' in row['error']
    assert score.trials([row]) == []
