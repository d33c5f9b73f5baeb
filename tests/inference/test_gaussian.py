# SPDX-License-Identifier: Apache-2.0
"""Posterior, evidence and averages against the textbook, by dense matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from shipdrag_ros.inference.averaging import average
from shipdrag_ros.inference.gaussian import Factored, condense, deviations, posterior, root
from shipdrag_ros.samples import Float64

K, N = 5, 40


@dataclass(frozen=True)
class Problem:
    rows: Float64
    value: Float64
    weight: Float64
    mean: Float64
    sd: Float64


@pytest.fixture
def problem() -> Problem:
    rng = np.random.default_rng(3)
    return Problem(
        rng.normal(size=(K, N)),
        rng.normal(size=N),
        rng.uniform(0.5, 2.0, N),
        np.array([0.0, 0.0, 0.0, 0.3, 0.0]),
        np.array([10.0, 2.0, 0.3, 0.2, 0.1]),
    )


def dense(
    given: Problem, columns: list[int], mean: Float64, prior: Float64
) -> tuple[Float64, Float64, float]:
    """Mean, covariance and log marginal likelihood, from the covariance of the data."""
    h, mean, prior = given.rows[columns], mean[columns], prior[np.ix_(columns, columns)]
    data = np.diag(1.0 / given.weight) + h.T @ prior @ h
    gain = prior @ h @ np.linalg.inv(data)
    off = given.value - mean @ h
    log_likelihood = -0.5 * off @ np.linalg.solve(data, off) - 0.5 * np.linalg.slogdet(data)[1]
    return mean + gain @ off, prior - gain @ h.T @ prior, float(log_likelihood)


def test_one_model_is_the_textbook(problem: Problem) -> None:
    evidences, expected = [], []
    for columns in ([0, 1, 2, 3, 4], [0, 1, 3], [0]):
        start = np.zeros(K)
        start[0] = 0.7  # the choice of the start must not matter
        products = condense(problem.rows, problem.value - start @ problem.rows, problem.weight)
        evidence, step, lower = posterior(
            products, start, np.array(columns), problem.mean, problem.sd
        )
        mean, covariance, likelihood = dense(
            problem, columns, problem.mean, np.diag(problem.sd**2)
        )
        np.testing.assert_allclose(start[columns] + step, mean, rtol=1e-11, atol=1e-13)
        triangle = np.tril(lower)
        np.testing.assert_allclose(np.linalg.inv(triangle @ triangle.T), covariance, atol=1e-12)
        evidences.append(evidence)
        expected.append(likelihood)
    np.testing.assert_allclose(np.diff(evidences), np.diff(expected), rtol=1e-10)


def test_the_average_is_the_mixture(problem: Problem) -> None:
    families = np.array([[True] * 5, [True, True, True, False, False]])
    # the second prior holds what all families have together, about another mean
    roots = np.array([np.diag(problem.sd)] * 2)
    roots[1, :3, :3] = np.tril(np.random.default_rng(5).normal(size=(3, 3)))
    given = np.array([problem.mean] * 2)
    given[1, :3] = 0.2, -0.1, 0.4
    chance = np.array([1.0, 3.0])
    start = np.zeros(K)
    start[0] = 0.7  # the choice of the start must not matter
    products = condense(problem.rows, problem.value - start @ problem.rows, problem.weight)
    coefficients, covariance, weight = average(products, start, families, chance, given, roots)
    means, seconds, logs = [], [], []
    for family, share in zip(families, chance):
        for about, half in zip(given, roots):
            columns = np.flatnonzero(family).tolist()
            mean, inside, likelihood = dense(problem, columns, about, half @ half.T)
            whole, spread = np.zeros(K), np.zeros((K, K))
            whole[columns] = mean
            spread[np.ix_(columns, columns)] = inside
            means.append(whole)
            seconds.append(spread + np.outer(whole, whole))
            logs.append(likelihood + np.log(share))
    w = np.exp(np.array(logs) - max(logs))
    w /= w.sum()
    assert w.min() > 1e-3, 'a model that counts for nothing tests nothing'
    np.testing.assert_allclose(weight.ravel(), w, rtol=1e-9)
    np.testing.assert_allclose(coefficients, w @ np.array(means), rtol=1e-9)
    expected = np.einsum('m,mij->ij', w, np.array(seconds)) - np.outer(coefficients, coefficients)
    np.testing.assert_allclose(covariance, expected, atol=1e-11)


def test_the_root_is_one_also_of_a_singular_covariance() -> None:
    half = np.random.default_rng(1).normal(size=(4, 2))
    covariance = half @ half.T
    covariance[3] = covariance[:, 3] = 0.0
    lower = root(covariance)
    np.testing.assert_allclose(lower @ lower.T, covariance, atol=1e-12)
    assert not lower[3].any()


@pytest.mark.parametrize('n', [1, 128, 129, 1000])
def test_products_are_those_of_plain_numpy(n: int) -> None:
    rng = np.random.default_rng(n)
    rows, residual, weight = rng.normal(size=(7, n)), rng.normal(size=n), rng.uniform(0.5, 2.0, n)
    plain = np.vstack([rows, residual]) * weight @ rows.T
    size = np.vstack([np.abs(rows), np.abs(residual)]) * weight @ np.abs(rows).T
    np.testing.assert_allclose(condense(rows, residual, weight) / size, plain / size, atol=1e-13)


def test_deviations_are_the_roots_of_the_covariance(problem: Problem) -> None:
    columns = [0, 1, 3]
    products = condense(problem.rows, problem.value, problem.weight)
    found = deviations(products, np.zeros(K), np.array(columns), problem.mean, problem.sd)
    h = problem.rows[columns]
    precision = h * problem.weight @ h.T + np.diag(problem.sd[columns] ** -2.0)
    expected = np.sqrt(np.diag(np.linalg.inv(precision)))
    np.testing.assert_allclose(found[columns], expected, rtol=1e-12)
    assert found[2] == found[4] == 0.0


def test_a_factored_matrix_solves_inverts_and_has_its_determinant() -> None:
    rng = np.random.default_rng(4)
    half = rng.normal(size=(6, 9)) * 10.0 ** np.arange(-3, 3)[:, np.newaxis]
    matrix, right = half @ half.T, rng.normal(size=(6, 2))
    found = Factored.of(matrix)
    np.testing.assert_allclose(matrix @ found.solve(right), right, atol=1e-9)
    np.testing.assert_allclose(found.inverse, np.linalg.inv(matrix), rtol=1e-7)
    assert found.log_det == pytest.approx(np.linalg.slogdet(matrix)[1], rel=1e-12)


@pytest.mark.parametrize('third', [[2.0, 0.0, 4.0], [2.0, 0.0, 3.0], [np.nan, 0.0, 1.0]])
def test_a_matrix_that_is_not_positive_is_refused(third: list[float]) -> None:
    matrix = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, 0.0], third])
    with pytest.raises(np.linalg.LinAlgError, match='not positive'):
        Factored.of(matrix)
