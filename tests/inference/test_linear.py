# SPDX-License-Identifier: Apache-2.0
"""Products, factors and solutions against plain numpy."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.inference.linear import cholesky, inverted, products_of, solve, substitute


@pytest.mark.parametrize('n', [1, 128, 129, 1000])
def test_products_are_those_of_plain_numpy(n: int) -> None:
    table = np.random.default_rng(n).normal(size=(7, n))
    size = np.abs(table) @ np.abs(table).T
    np.testing.assert_allclose(products_of(table) / size, table @ table.T / size, atol=1e-13)


def test_a_factor_solves() -> None:
    rng = np.random.default_rng(4)
    half = rng.normal(size=(6, 9)) * 10.0 ** np.arange(-3, 3)[:, np.newaxis]
    matrix, right = half @ half.T, rng.normal(size=(6, 2))
    solved, lower, scale = cholesky(matrix)
    assert solved
    x = substitute(lower, scale, right)
    np.testing.assert_allclose(matrix @ x, right, atol=1e-9)
    size = np.sqrt(np.diag(matrix))
    unit = inverted(lower, scale) @ matrix * np.outer(size, 1.0 / size)
    np.testing.assert_allclose(unit, np.eye(6), atol=1e-9)


@pytest.mark.parametrize('third', [[2.0, 0.0, 4.0], [2.0, 0.0, 3.0], [np.nan, 0.0, 1.0]])
def test_a_matrix_that_is_not_positive_is_refused(third: list[float]) -> None:
    matrix = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, 0.0], third])
    assert not cholesky(matrix)[0]


def test_rounding_of_a_huge_residual_is_no_evidence() -> None:
    rng = np.random.default_rng(3)
    beyond = []
    for _ in range(50):
        lines = rng.standard_normal((4, 200))
        lines[0] = 1e10 * (lines[1] + lines[2] - lines[3])
        products = np.array([lines @ lines.T])
        mean, precision = np.zeros((1, 3)), np.full((1, 3), 1e-20)
        beyond.append(solve(products, mean, precision, 0, 0)[0][0, 0])
    assert max(beyond) <= 1e-6
    assert min(beyond) == -np.inf
