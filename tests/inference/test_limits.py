# SPDX-License-Identifier: Apache-2.0
"""Upper limits of sizes, and the size that would have been named, against drawn records."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import halfnorm, norm

from shipdrag_ros.inference.decision import (
    NONE,
    Sensitivity,
    SizePosterior,
    WeighedHypothesis,
    decide,
    named_from,
    probabilities,
    quantile,
)
from shipdrag_ros.parameter import half_normal, log_normal, normal


def test_the_last_digit_of_a_weight_moves_no_limit() -> None:
    sizes = [
        SizePosterior(w, z, 0.7, normal(0.1)) for w, z in ((0.4, -1.0), (0.3, 0.5), (0.3, 2.0))
    ]
    moved = [each._replace(weight=each.weight * (1.0 + 1e-13 * k)) for k, each in enumerate(sizes)]
    for share in (0.05, 0.5, 0.95):
        assert quantile(moved, share) == pytest.approx(quantile(sizes, share), rel=1e-9)
    # one hypothesis: a share that falls between two of its points
    for factor in (1.0 - 1e-12, 1.0 + 1e-12):
        alone = quantile([SizePosterior(0.3 * factor, 0.0, 1.0, half_normal(1.0))], 0.95)
        assert alone == pytest.approx(1.95996, rel=1e-4)


def test_the_limit_of_a_size_is_the_quantile_of_its_distribution() -> None:
    alone = quantile([SizePosterior(0.3, 0.0, 1.0, normal(0.1))], 0.95)
    assert alone == pytest.approx(0.1 * norm.ppf(0.975), rel=0.02)
    # one-sided: what is beyond the end is none of it
    one_sided = quantile([SizePosterior(1.0, 0.0, 1.0, half_normal(0.1))], 0.95)
    assert one_sided == pytest.approx(0.1 * halfnorm.ppf(0.95), rel=0.02)
    # given that it is there: how improbable that is does not matter
    improbable = quantile([SizePosterior(3e-312, 0.0, 1.0, half_normal(0.1))], 0.95)
    assert improbable == pytest.approx(one_sided, rel=1e-6)
    # of a mean far beyond the end an exponential tail is left
    beyond = quantile([SizePosterior(1.0, -40.0, 1.0, half_normal(0.1))], 0.95)
    assert beyond == pytest.approx(-0.1 * math.log(0.05) / 40.0, rel=0.02)
    deep = quantile([SizePosterior(1.0, 0.0, 1.0, log_normal(20.0, 0.35))], 0.05)
    assert deep == pytest.approx(20.0 * math.exp(0.35 * norm.ppf(0.05)), rel=0.02)
    both = [SizePosterior(0.9, 1.0, 1e-6, normal(1.0)), SizePosterior(0.1, 3.0, 1e-6, normal(1.0))]
    assert quantile(both, 0.85) == pytest.approx(1.0, abs=1e-4)
    assert quantile(both, 0.95) == pytest.approx(3.0, abs=1e-4)
    with pytest.raises(ValueError, match='no distribution'):
        quantile([], 0.95)


def test_nine_of_ten_records_of_that_size_name_it() -> None:
    # N = 4000 records of 40 rows, seed 0; binomial sd 0.5 %, to first order within 4 %
    rng = np.random.default_rng(0)
    rows = np.linspace(0.0, 1.0, 40)
    responses = np.array([np.ones(40), rows, rows**2 * 1.2])
    information = responses @ responses.T
    known = Sensitivity(information, np.zeros(3), np.ones(3), np.full(3, math.log(0.05)))
    amounts = named_from(known)
    assert np.isfinite(amounts).all()
    own = np.diag(information)
    for e, amount in enumerate(amounts):
        named = 0
        for _ in range(4000):
            score = responses @ (amount * responses[e] + rng.standard_normal(40))
            gain = 0.5 * score**2 / (own + 1.0) - 0.5 * np.log(own + 1.0)
            ways = [WeighedHypothesis((f'e{f}',), gain[f], known.log_odds[f]) for f in range(3)]
            found = decide(probabilities([WeighedHypothesis(NONE, 0.0, 0.0), *ways]))
            named += list(found.effects) == [f'e{e}']
        assert named / 4000 == pytest.approx(0.9, abs=0.04)


def test_no_size_is_named_where_another_has_the_same_trace() -> None:
    twins = np.array([[9.0, 9.0, 0.0], [9.0, 9.0, 0.0], [0.0, 0.0, 9.0]])
    known = Sensitivity(twins, np.zeros(3), np.ones(3), np.full(3, math.log(0.05)))
    first, second, third = named_from(known)
    assert first == second == math.inf
    assert math.isfinite(third)
