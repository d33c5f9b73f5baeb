# SPDX-License-Identifier: Apache-2.0
"""The compiled refit against plain numpy."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.estimation.distance import (
    ALPHA,
    BETA,
    COEFFICIENT,
    SQUARED_NORM,
    SSE,
    evaluate,
    refit,
)
from shipdrag_ros.studies.orthogonal import OrthogonalBasis


@pytest.mark.parametrize('n', [13, 100, 500, 2000])
@pytest.mark.parametrize('even', [True, False])
def test_every_order_is_that_of_plain_numpy(n: int, even: bool) -> None:
    rng = np.random.default_rng(n)
    time = np.linspace(-1.0, 1.0, n) if even else np.sort(rng.uniform(-1.0, 1.0, n))
    value = np.exp(time) + rng.normal(size=n)
    table = refit(time, value, 12)
    basis = OrthogonalBasis.on(time, 12)
    coefficients, sse = basis.fit(value)
    tight = 1e-12 if n > 13 else 1e-9  # as many polynomials as times: hardly any residual
    np.testing.assert_allclose(table[SQUARED_NORM], basis.squared_norm, rtol=tight)
    np.testing.assert_allclose(table[ALPHA, :-1], basis.alpha[:-1], rtol=0.0, atol=tight)
    np.testing.assert_allclose(table[BETA, :-1], basis.beta[:-1], rtol=tight)
    scale = np.sqrt((value**2).sum() / basis.squared_norm)
    np.testing.assert_allclose(table[COEFFICIENT] / scale, coefficients / scale, atol=tight)
    np.testing.assert_allclose(table[SSE], sse, rtol=tight)


def test_an_offset_costs_no_digits() -> None:
    time = np.linspace(-1.0, 1.0, 500)
    noise = np.random.default_rng(1).normal(size=500)
    plain, offset = refit(time, noise, 6), refit(time, noise + 1e6, 6)
    np.testing.assert_allclose(offset[SSE], plain[SSE], rtol=1e-8)


def test_value_and_rate_follow_the_polynomial() -> None:
    time = np.linspace(-1.0, 1.0, 50)
    table = refit(time, 1.0 + 2.0 * time - 3.0 * time**3, 5)
    value, rate = evaluate(table, np.array([-0.3, 0.9]), 4)
    np.testing.assert_allclose(value, [1.0 - 0.6 + 0.081, 1.0 + 1.8 - 2.187], atol=1e-13)
    np.testing.assert_allclose(rate, [2.0 - 0.81, 2.0 - 7.29], atol=1e-12)
    value, _ = evaluate(table, time, 1)
    np.testing.assert_allclose(value, 1.0, atol=1e-13)
