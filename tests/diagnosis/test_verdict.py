# SPDX-License-Identifier: Apache-2.0
"""Fits become probabilities, and these a verdict; nothing stands between."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.model import Hypothesis, Linear
from shipdrag_ros.diagnosis.posterior import posterior_of
from shipdrag_ros.diagnosis.search import likely
from shipdrag_ros.diagnosis.terms import EffectTerm
from shipdrag_ros.inference.decision import UNKNOWN, Verdict, decide
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import find


def fitted(*names: str, evidence: float, discrepancy: str = '') -> Fit:
    """Return a fit with some evidence."""
    hypothesis = Hypothesis(names, (), (), discrepancy=discrepancy)
    white = np.ones((1, 100))
    return Fit(Linear(hypothesis, np.zeros(0), (white,), (white[0],)), np.zeros((0, 0)), evidence)


def test_evidence_and_prior_are_all_that_counts() -> None:
    fits = fitted(evidence=0.0), fitted('current', evidence=1.0), fitted('wind', evidence=-1.0)
    found = posterior_of(fits)
    total = 1.0 + math.e + math.exp(-1.0)
    assert found.nothing == pytest.approx(1.0 / total)
    assert found.probability[('current',)] == pytest.approx(math.e / total)
    assert found.named() == [('current',), (), ('wind',)]


def test_several_starts_of_a_hypothesis_count_once() -> None:
    once = posterior_of([fitted(evidence=0.0), fitted('current', evidence=0.0)])
    twice = posterior_of([fitted(evidence=0.0), *[fitted('current', evidence=0.0)] * 3])
    assert once.probability == twice.probability


def test_ways_to_be_there_add_up(cargo: Ship) -> None:
    def turning(sign: float) -> Fit:
        term = EffectTerm(find('turning'), cargo, signs=(('rate_rad_s', sign),))
        hypothesis = Hypothesis(('turning',), (term,))
        white = np.ones((1, 100))
        linear = Linear(hypothesis, np.zeros(4), (white,), (white[0],))
        return Fit(linear, np.eye(4), 0.0)

    found = posterior_of([fitted(evidence=0.0), turning(1.0), turning(-1.0)])
    assert found.nothing == pytest.approx(1.0 / 3.0)


def test_a_name_with_something_smooth_besides_is_something_without_a_name() -> None:
    name, more = (fitted('current', evidence=e, discrepancy=d) for e, d in ((0, ''), (3, 'log')))
    found = posterior_of([fitted(evidence=-50.0), name, more])
    assert found.unnamed == pytest.approx(math.exp(3.0) / (1.0 + math.exp(3.0)))
    assert decide(found.probability).verdict is Verdict.UNKNOWN
    assert found.best[UNKNOWN] is more
    # only a name that is likely can have such a rival
    assert likely(found) == []
    assert likely(posterior_of([fitted(evidence=-50.0), name])) == [name]
