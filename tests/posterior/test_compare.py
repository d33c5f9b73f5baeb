# SPDX-License-Identifier: Apache-2.0
"""Hypotheses are compared at their best, and by what was reached there."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.accuracy import diagnosis_score
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.posterior.compare import ComparedHypotheses, Fitted
from shipdrag_ros.posterior.hypotheses import Explanation


def test_no_effect_is_named_by_a_fit_that_did_not_settle() -> None:
    # two runs of a sound ship; waves that were fitted half way promised more than they reach
    found = diagnosis_score.answer('command', 992, 'b')['found']
    probability = {tuple(each['names']): each['probability'] for each in found['candidates']}
    assert not found['effects']
    assert max(probability, key=lambda names: probability[names]) == ('none',)
    assert probability['none',] > 0.7


@pytest.mark.parametrize('number', [1006, 1015])
def test_a_force_without_a_name_is_not_taken_for_noise(number: int) -> None:
    # it swings within two minutes; it holds her in one run of three
    found = diagnosis_score.answer('command', number, 'b')['found']
    assert found['verdict'] == 'unknown'


def test_explanations_none_of_which_has_evidence_are_refused_in_words() -> None:
    far = ComparedHypotheses((), (Fitted(Explanation(), np.zeros(0)),))
    with pytest.raises(DiagnosisError, match='no explanation comes near what was read'):
        far.probability  # noqa: B018
