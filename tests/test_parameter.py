# SPDX-License-Identifier: Apache-2.0
"""Priors: z is standard normal before the data, whatever their units."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipdrag_ros.parameter import (
    Prior,
    Shape,
    either_sign,
    flat,
    half_normal,
    log_normal,
    normal,
    uniform,
)

PRIORS = [
    normal(0.3, mean=0.1),
    half_normal(0.2),
    log_normal(2.0, 0.5),
    log_normal(-2.0, 0.5),
    uniform(-1.0, 4.0),
]
FITTED = [
    *PRIORS,
    normal(0.02, mean=1.0),
    flat(),
    either_sign(0.3, 0.4).of_sign(-1.0),
]


@given(st.sampled_from(FITTED), st.floats(-2.5, 2.5))
def test_the_slope_is_that_of_the_value(prior: Prior, z: float) -> None:
    step = 1e-5
    slope = (prior.at(z + step) - prior.at(z - step)) / (2.0 * step)
    assert prior.slope(z) == pytest.approx(slope, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize('prior', PRIORS, ids=lambda prior: prior.shape)
def test_z_is_standard_normal_where_the_prior_is_drawn(prior: Prior) -> None:
    """N = 4000 draws (seed 1): quantiles of the prior and of z agree within 5 % of its spread."""
    rng = np.random.default_rng(1)
    drawn = [prior.draw(rng) for _ in range(4000)]
    z = rng.standard_normal(4000)
    made = [prior.at(abs(x) if prior.shape is Shape.HALF_NORMAL else x) for x in z]
    levels = [0.1, 0.25, 0.5, 0.75, 0.9]
    spread = np.subtract(*np.quantile(drawn, [0.75, 0.25]))
    np.testing.assert_allclose(
        np.quantile(made, levels), np.quantile(drawn, levels), rtol=0, atol=0.1 * spread
    )


def test_a_flat_prior_cannot_be_drawn_from_and_a_choice_cannot_be_fitted() -> None:
    with pytest.raises(ValueError, match='flat'):
        flat().draw(np.random.default_rng(1))
    with pytest.raises(ValueError, match='choice'):
        Prior(Shape.CHOICE, 1.0, -1.0).at(0.0)


@pytest.mark.parametrize('prior', [normal(0.3, mean=0.1), log_normal(2.0, 0.5)])
def test_moments_are_those_of_draws(prior: Prior) -> None:
    """N = 100 000, seed 1: within four standard errors of the mean, and 2 % of the sd."""
    rng = np.random.default_rng(1)
    drawn = np.array([prior.draw(rng) for _ in range(100_000)])
    mean, sd = prior.moments()
    assert mean == pytest.approx(drawn.mean(), abs=4.0 * sd / 100_000**0.5)
    assert sd == pytest.approx(drawn.std(), rel=0.02)
    with pytest.raises(ValueError, match='no moments'):
        either_sign(0.3, 0.4).moments()
