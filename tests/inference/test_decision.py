# SPDX-License-Identifier: Apache-2.0
"""Bayes' rule over hypotheses, and the one decision that is read from it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from shipdrag_ros.inference.decision import (
    CERTAIN,
    LISTED,
    NONE,
    UNKNOWN,
    Verdict,
    Weighed,
    decide,
    marginals,
    mixture,
    names_one,
    probabilities,
    smallest_set,
)

A, B, BOTH = ('a',), ('b',), ('a', 'b')
LOGS = st.floats(-40.0, 40.0)
WAYS = st.lists(
    st.tuples(st.sampled_from([NONE, UNKNOWN, A, B, BOTH]), LOGS),
    min_size=1,
)


def test_probabilities_are_bayes_rule_to_the_digit() -> None:
    evidence = {NONE: -4.0, A: -1.5, BOTH: -1.0, UNKNOWN: -6.0}
    odds = {NONE: 0.0, A: -3.0, BOTH: -6.0, UNKNOWN: -4.0}
    found = probabilities([(n, evidence[n] + odds[n]) for n in evidence])
    weight = {n: math.exp(evidence[n] + odds[n]) for n in evidence}
    for names, p in found.items():
        assert p == pytest.approx(weight[names] / sum(weight.values()), rel=1e-12)


def test_a_weak_effect_keeps_its_probability() -> None:
    # a Bayes factor of 4 is no strong evidence, and is evidence all the same
    found = probabilities([(NONE, 0.0), (A, math.log(4.0))])
    assert found[A] == pytest.approx(0.8)


def test_ways_of_the_same_names_add_up() -> None:
    found = probabilities([(NONE, 0.0), *[(A, 0.0)] * 3])
    assert found[A] == pytest.approx(0.75)


def test_no_evidence_at_all_is_an_error() -> None:
    with pytest.raises(ValueError, match='nothing can be compared'):
        probabilities([(NONE, -math.inf)])


@given(WAYS)
def test_every_decision_follows_from_the_probabilities(ways: list[Weighed]) -> None:
    probability = probabilities(ways)
    assert math.fsum(probability.values()) == pytest.approx(1.0)
    found = decide(probability)
    sure = {name for name, p in marginals(probability).items() if p >= CERTAIN}
    assert set(found.effects) == sure
    assert (found.verdict is Verdict.NAMED) == bool(sure)
    assert (found.verdict is Verdict.NONE) == (probability.get(NONE, 0.0) >= CERTAIN)
    listed = [p for _, p in found.candidates]
    assert listed == sorted(listed, reverse=True)
    assert sum(listed) >= LISTED - 1e-9 > sum(listed[:-1]) - 1e-9


@given(st.lists(WAYS, min_size=1, max_size=5), st.sampled_from([(), [frozenset('ab')]]))
def test_many_probabilities_at_once_name_where_one_decision_does(several, inseparable):
    each = [probabilities(ways) for ways in several]
    sums = [p for one in each for p in marginals(one).values()]
    assume(all(abs(p - CERTAIN) > 1e-9 for p in sums))
    names = [NONE, UNKNOWN, A, B, BOTH]
    columns = np.array([[one.get(name, 0.0) for one in each] for name in names])
    named = [decide(one, inseparable).verdict is Verdict.NAMED for one in each]
    assert names_one(names, columns, inseparable).tolist() == named


@pytest.mark.parametrize(
    ('probability', 'verdict', 'named'),
    [
        ({NONE: 0.91, A: 0.09}, Verdict.NONE, []),
        ({NONE: 0.89, A: 0.11}, Verdict.ONE_OF, []),
        ({A: 0.91, NONE: 0.09}, Verdict.NAMED, ['a']),
        ({A: 0.89, NONE: 0.11}, Verdict.ONE_OF, []),
        ({A: 0.55, BOTH: 0.40, B: 0.05}, Verdict.NAMED, ['a']),
        ({BOTH: 0.95, A: 0.05}, Verdict.NAMED, ['a', 'b']),
        ({UNKNOWN: 0.51, A: 0.49}, Verdict.UNKNOWN, []),
        ({UNKNOWN: 0.49, A: 0.51}, Verdict.ONE_OF, []),
    ],
)
def test_where_the_line_is(probability, verdict, named):
    found = decide(probability)
    assert (found.verdict, sorted(found.effects)) == (verdict, named)


def test_what_no_record_separates_is_never_named() -> None:
    found = decide({A: 0.95, NONE: 0.05}, [frozenset('ab')])
    assert found.verdict is Verdict.ONE_OF
    assert not found.effects


def test_the_smallest_set_may_hold_nothing_and_something_without_a_name() -> None:
    probability = {NONE: 0.55, A: 0.3, UNKNOWN: 0.1, B: 0.05}
    assert [names for names, _ in smallest_set(probability, 0.9)] == [NONE, A, UNKNOWN]


def test_a_mixture_holds_the_spread_between_its_parts() -> None:
    assert mixture([(1.0, 0.0, 1.0), (1.0, 2.0, 1.0), (0.0, 9.0, 9.0)]) == (1.0, math.sqrt(2.0))
