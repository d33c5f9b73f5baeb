# SPDX-License-Identifier: Apache-2.0
"""Whether more information makes a diagnosis better: how it is counted."""

from __future__ import annotations

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

    rows = [{'as it is': -1.0, 'depth': gain, 'heading': -gain - 1.0} for gain in (0.1, -0.2, 0.3)]
    assert list(script.lines(rows)) == [
        'as it is: -1.00 +- 0.00',
        'depth: +0.07 +- 0.29, not lower',
        'heading: -1.07 +- 0.29, LOWER',
    ]


def test_the_cases_are_bare_runs_with_something_to_find() -> None:
    import more_information_diagnosis as script
    from hidden import cases

    numbers = [number for number, _ in zip(script.bare('a'), range(5))]
    for number in numbers:
        truth = cases.reveal(number)
        assert truth.kind in ('one', 'pair')
        assert not truth.condition.context
        assert truth.condition.runs == 1
