# SPDX-License-Identifier: Apache-2.0
"""Products, factors and solutions against plain numpy."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.inference.linear import ALONE, evidences, products_of, solve


@pytest.mark.parametrize('n', [1, 128, 129, 1000])
def test_products_are_those_of_plain_numpy(n: int) -> None:
    table = np.random.default_rng(n).normal(size=(7, n))
    size = np.abs(table) @ np.abs(table).T
    np.testing.assert_allclose(products_of(table) / size, table @ table.T / size, atol=1e-13)


@pytest.mark.parametrize(('first', 'count'), [(0, 6), (2, 3), (0, 0)])
def test_each_model_is_solved_as_if_it_stood_alone(first: int, count: int) -> None:
    rng = np.random.default_rng(4)
    unit = 10.0 ** np.arange(-3, 4)[:, np.newaxis]
    products = np.array([half @ half.T for half in unit * rng.normal(size=(2, 7, 9))])
    f = 6
    mean, precision = np.zeros((f, 6)), np.ones((f, 6))
    mean[:, 4], precision[:, 3] = rng.normal(size=f), rng.uniform(0.5, 2.0, f)
    precision[3:, 1], precision[2, 5], mean[5, 2] = 3.0, np.inf, 1.0
    wanted = np.arange(2 * f).reshape(2, f) % 5 > 0
    logs = evidences(products, mean, precision)
    some, steps, covariances = solve(products, mean, precision, wanted, first, count)
    np.testing.assert_allclose(some, logs[wanted], rtol=1e-12)
    for log, step, covariance, (k, q) in zip(some, steps, covariances, np.argwhere(wanted)):
        held = precision[q] < np.inf
        known, of = precision[q][held], products[k, 1:, 1:][np.ix_(held, held)]
        exact = np.zeros((6, 6))
        exact[np.ix_(held, held)] = np.linalg.inv(of + np.diag(known))
        right = products[k, 1:, 0] + np.where(held, precision[q], 0.0) * mean[q]
        np.testing.assert_allclose(step, exact @ right, rtol=1e-7, atol=1e-12)
        part = exact[first : first + count, first : first + count]
        np.testing.assert_allclose(covariance, part, rtol=1e-7, atol=1e-12)
        ends = known @ mean[q][held] ** 2 + products[k, 0, 0] - right @ exact @ right
        open_ = exact[np.ix_(held, held)]
        wider = np.linalg.slogdet(open_)[1] + np.log(known).sum()
        assert log == pytest.approx(0.5 * (wider - ends), rel=1e-9)


@pytest.mark.parametrize('third', [4.0, np.nan])
def test_a_model_that_is_not_positive_is_refused_and_the_next_is_not(third: float) -> None:
    products = np.eye(4)[None] * 5.0
    products[0, 1:, 1:] = [[1.0, 0.0, 2.0], [0.0, 1.0, 0.0], [2.0, 0.0, third]]
    precision = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 3.0]])
    refused, after = evidences(products, np.zeros((2, 3)), precision)[0]
    assert refused == -np.inf
    alone, *_ = solve(products, np.zeros((1, 3)), precision[1:], ALONE, 0, 0)
    assert after == alone[0]
    assert np.isfinite(after) == np.isfinite(third)


def test_rounding_of_a_huge_residual_is_no_evidence() -> None:
    rng = np.random.default_rng(3)
    beyond = []
    for _ in range(50):
        lines = rng.standard_normal((4, 200))
        lines[0] = 1e10 * (lines[1] + lines[2] - lines[3])
        products = np.array([lines @ lines.T])
        mean, precision = np.zeros((1, 3)), np.full((1, 3), 1e-20)
        beyond.append(evidences(products, mean, precision)[0, 0])
    assert max(beyond) <= 1e-6
    assert min(beyond) == -np.inf
