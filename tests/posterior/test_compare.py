# SPDX-License-Identifier: Apache-2.0
"""Hypotheses are compared at their best, and by what was reached there."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.accuracy import diagnosis_score
from shipdrag_ros.diagnosis.diagnose import observed
from shipdrag_ros.diagnosis.observation import ship_runs
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.compare import ComparedHypotheses, Comparing, Fitted
from shipdrag_ros.posterior.hypotheses import Explanation
from shipdrag_ros.progress import silent
from shipdrag_ros.simulation import START_NS
from shipdrag_ros.simulation.effects import LIBRARY
from tests.runs import CARGO, coasted


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


@pytest.mark.parametrize('days', [0, 4])
def test_what_may_differ_is_as_probable_as_what_may_not(days: int) -> None:
    starts = START_NS, START_NS + days * 86400 * 10**9
    runs = [coasted(name=str(j), start_ns=at, seed=j) for j, at in enumerate(starts)]
    seen, _ = observed(runs, CARGO, Parameters(), silent)
    effects = [LIBRARY['wind'], LIBRARY['fouling']]
    comparing = Comparing(ship_runs(seen, CARGO), CARGO, effects, may_differ=effects)
    odds: dict[str, list[float]] = {each.name: [] for each in effects}
    for fit in comparing.compare().fitted:
        if len(fit.hypothesis.names) == 1:
            total = sum(way.log_odds for way in fit.hypothesis.ways)
            odds[fit.hypothesis.names[0]].append(total)
    for each in effects:  # alike, and a size for each run
        assert np.exp([max(odds[each.name]), min(odds[each.name])]).sum() == pytest.approx(
            each.odds
        )
