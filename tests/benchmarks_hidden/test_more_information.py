# SPDX-License-Identifier: Apache-2.0
"""Whether more information makes a diagnosis better: how it is counted."""

from __future__ import annotations

import json
import math

import pytest


def test_the_truth_outside_of_the_candidates_is_improbable_and_not_impossible() -> None:
    import more_information_diagnosis as script

    found = {
        'verdict': 'one_of',
        'effects': [],
        'candidates': [
            {'names': ['wind', 'fouling'], 'probability': 0.6},
            {'names': ['current'], 'probability': 0.39},
        ],
    }
    assert script.log_probability(found, ('fouling', 'wind')) == pytest.approx(math.log(0.6))
    assert script.log_probability(found, ('waves',)) == pytest.approx(math.log(1e-3))


def test_a_loss_beyond_chance_is_said_and_one_within_is_not() -> None:
    import more_information_diagnosis as script

    rows = [
        {'one run': -1.0, 'two runs': -1.0 + gain, 'three runs': -2.0 - gain}
        for gain in (0.1, -0.2, 0.3)
    ]
    given = {name: script.GIVEN[name] for name in rows[0]}
    assert list(script.lines(rows, given))[2:] == [
        '| one run | -1.00 | | | |',
        '| two runs | -0.93 | one run | +0.07 ± 0.29 | not lower |',
        '| three runs | -2.07 | one run | -1.07 ± 0.29 | LOWER |',
        '| three runs | -2.07 | two runs | -1.13 ± 0.58 | LOWER |',
    ]
    assert next(line for line in script.lines(rows[:1], given) if 'two' in line).endswith(
        '+0.10 ± inf | not lower |'
    )


def test_less_is_what_is_left_of_all_that_can_be_seen() -> None:
    import more_information_diagnosis as script
    from hidden.cases import Observation

    run = dict.fromkeys(
        ('speed_through_water', 'position_geodetic', 'depth', 'shaft', 'shaft_2', 'pitch_2'), 0
    )
    seen = Observation('ship', (run, run, run))
    bare = script.only(seen, script.Given())
    assert [set(each) for each in bare.runs] == [{'speed_through_water', 'position_geodetic'}]
    turned = script.only(seen, script.Given(2, ('shaft',)))
    assert len(turned.runs) == 2
    assert set(turned.runs[1]) == set(run) - {'depth'}
    assert script.only(seen, script.Given(3, ('depth',))).ship_file == 'ship'


def test_a_case_is_diagnosed_with_each_thing_given() -> None:
    import more_information_diagnosis as script
    from hidden import cases

    number = next(script.bare('a'))
    row = script.answers(('a', number, ['one run']))
    assert row['case'] == number
    (found,) = row['found'].values()
    assert found['verdict'] in ('none', 'named', 'one_of', 'unknown')
    names = cases.reveal(number).names
    assert row['log_probability'] == {
        'one run': script.log_probability({**found, 'effects': []}, names)
    }


def test_what_was_answered_is_not_asked_again(tmp_path, capsys) -> None:
    import more_information_diagnosis as script

    number = next(script.bare('a'))
    kept = dict.fromkeys(script.given_of('a'), -1.5)
    out = tmp_path / 'answers.jsonl'
    out.write_text(json.dumps({'case': number, 'log_probability': kept}) + '\n')
    script.main(['--count', '1', '--out', str(out)])
    printed = capsys.readouterr().out
    assert '1 cases of world a' in printed
    assert '| one run | -1.50 | | | |' in printed
    assert len(out.read_text().splitlines()) == 1


def test_the_cases_are_bare_runs_with_something_to_find() -> None:
    import more_information_diagnosis as script
    from hidden import cases

    numbers = [number for number, _ in zip(script.bare('a'), range(5))]
    for number in numbers:
        truth = cases.reveal(number)
        assert truth.kind in ('one', 'pair')
        assert not truth.condition.context
        assert truth.condition.runs == 1
