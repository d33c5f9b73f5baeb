# SPDX-License-Identifier: Apache-2.0
"""A name only where the data can tell."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shipdrag_ros.diagnosis.coast_terms import ModelErrorTerm
from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.model import Hypothesis, Linear
from shipdrag_ros.diagnosis.posterior import posterior_of, prune_by_bayes_factor
from shipdrag_ros.diagnosis.result import Verdict
from shipdrag_ros.diagnosis.terms import EffectTerm
from shipdrag_ros.diagnosis.verdict import (
    decide,
    exceeds_noise,
    has_residual_structure,
    outside_prior,
)
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import find

TWINS = [frozenset(('added_mass', 'displacement'))]


def fitted(
    *names: str, evidence: float, discrepancy: str = '', chi2: float = 100.0, rows: int = 100
) -> Fit:
    """Return a fit with some evidence."""
    hypothesis = Hypothesis(names, (), (), discrepancy=discrepancy)
    white = np.full((1, rows), math.sqrt(chi2 / rows))
    return Fit(Linear(hypothesis, np.zeros(0), (white,), (white[0],)), np.zeros((0, 0)), evidence)


def verdict(*fits: Fit, lacking: bool = False) -> Verdict:
    """Decide on fits."""
    return decide(posterior_of(fits), lacking=lacking, inseparable=TWINS)[0]


def test_one_that_stands_out_is_named() -> None:
    fits = fitted(evidence=-9.0), fitted('current', evidence=0.0), fitted('wind', evidence=-5.0)
    assert verdict(*fits) is Verdict.NAMED


def test_two_that_are_alike_stay_a_set_of_both() -> None:
    fits = fitted(evidence=-9.0), fitted('fouling', evidence=0.0), fitted('cable', evidence=-0.3)
    found, candidates = decide(posterior_of(fits), lacking=False, inseparable=TWINS)
    assert found is Verdict.ONE_OF
    assert [each.names for each in candidates] == [('fouling',), ('cable',)]
    assert sum(each.probability for each in candidates) >= 0.99


def test_no_alarm_while_nothing_may_be_missing() -> None:
    assert verdict(fitted(evidence=-2.0), fitted('current', evidence=0.0)) is Verdict.NONE
    assert verdict(fitted(evidence=-2.5), fitted('current', evidence=0.0)) is Verdict.NAMED


def test_what_leaves_more_than_noise_is_unknown() -> None:
    fits = fitted(evidence=-50.0), fitted('current', evidence=0.0)
    assert verdict(*fits, lacking=True) is Verdict.UNKNOWN
    unnamed = fitted(evidence=8.0, discrepancy='force')
    assert verdict(*fits, unnamed) is Verdict.UNKNOWN


def test_a_doubted_name_gives_way_to_something_unnamed() -> None:
    sure = posterior_of([fitted(evidence=-50.0), fitted('current', evidence=0.0)])
    doubted = sure.doubted()
    assert doubted.unnamed == pytest.approx(0.9)
    assert doubted.probability[('current',)] == pytest.approx(0.1)
    assert sum(doubted.probability.values()) == pytest.approx(1.0)
    assert doubted.doubted() is doubted


def test_twins_are_never_named_alone() -> None:
    fits = fitted(evidence=-50.0), fitted('added_mass', evidence=0.0)
    assert verdict(*fits) is Verdict.ONE_OF


def test_an_effect_that_the_data_do_not_ask_for_is_left_to_what_is_simpler() -> None:
    odds = {(): 0.0, ('a',): -3.0, ('b',): -3.0, ('a', 'b'): -6.0}
    # a is asked for by 10 nats; b, and b beside a, by none
    found = prune_by_bayes_factor({(): 0.0, ('a',): 7.0, ('b',): -3.0, ('a', 'b'): 4.0}, odds)
    assert set(found) == {(), ('a',)}
    assert found[()] == pytest.approx((1.0 + math.exp(-3.0)) / sum(map(math.exp, (0, 7, -3, 4))))
    assert sum(found.values()) == pytest.approx(1.0)
    # b beside a is asked for by 3 nats more than its odds
    found = prune_by_bayes_factor({(): 0.0, ('a',): 7.0, ('b',): -3.0, ('a', 'b'): 7.0}, odds)
    assert set(found) == {(), ('a',), ('a', 'b')}


def test_several_starts_of_a_hypothesis_count_once() -> None:
    once = posterior_of([fitted(evidence=0.0), fitted('current', evidence=0.0)])
    twice = posterior_of([fitted(evidence=0.0), *[fitted('current', evidence=0.0)] * 3])
    assert once.probability == twice.probability


def test_something_smooth_besides_takes_a_name_back() -> None:
    name = fitted('current', evidence=0.0)
    assert not has_residual_structure(name, [fitted('current', evidence=4.0, discrepancy='log')])
    assert has_residual_structure(name, [fitted('current', evidence=6.0, discrepancy='log')])
    assert has_residual_structure(fitted('current', evidence=0.0, chi2=200.0), [])


@pytest.mark.parametrize(('rows', 'limit'), [(100, 1.77), (400, 1.48)])
def test_what_is_more_than_noise_depends_on_the_number_of_rows(rows: int, limit: float) -> None:
    assert exceeds_noise(limit + 0.01, rows)
    assert not exceeds_noise(limit - 0.01, rows)


@pytest.mark.parametrize(
    ('name', 'parameter', 'sd', 'outside'),
    [
        ('turning', 'duration_s', 3.0, True),
        ('turning', 'drag_area_m2', 3.0, False),
        ('turning', 'drag_area_m2', 6.0, True),
        ('current', 'cross_track_m_s', 6.0, False),
        ('log_scale', 'factor', 6.0, False),
    ],
    ids=['shape', 'size', 'size of no such ship', 'component of a size', 'size of either sign'],
)
def test_a_shape_beyond_its_prior_is_not_what_an_effect_is_known_as(
    name: str, parameter: str, sd: float, outside: bool, cargo: Ship
) -> None:
    term = EffectTerm(find(name), cargo)
    z = np.array([sd * (unknown.name == parameter) for unknown in term.unknowns])
    linear = Linear(Hypothesis((name,), (term,)), z, (np.zeros((1, 9)),), (np.zeros(9),))
    assert outside_prior(Fit(linear, np.eye(len(z)), 0.0)) is outside


@pytest.mark.parametrize(('sd', 'outside'), [(3.0, False), (4.0, True)])
def test_an_effect_far_from_its_formula_is_another(sd: float, outside: bool, cargo: Ship) -> None:
    error = ModelErrorTerm(EffectTerm(find('towed_cable'), cargo), 0.05)
    hypothesis = Hypothesis(('towed_cable',), (error.term,), model_errors=(error,))
    z = np.zeros(len(hypothesis.unknowns))
    z[-1] = -sd
    linear = Linear(hypothesis, z, (np.zeros((1, 9)),), (np.zeros(9),))
    assert outside_prior(Fit(linear, np.eye(len(z)), 0.0)) is outside
