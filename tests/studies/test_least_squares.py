# SPDX-License-Identifier: Apache-2.0
"""Least squares on any columns, and what they leave open."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.studies.least_squares import inverse, least_squares, triangle


def polynomial(n: int = 40, p: int = 4) -> np.ndarray:
    return np.vander(np.linspace(-1.0, 1.0, n), p, increasing=True)


def test_against_numpy_and_textbook_formulas() -> None:
    rng = np.random.default_rng(1)
    columns = polynomial()
    values = columns @ [1.0, -2.0, 0.5, 3.0] + 0.1 * rng.normal(size=40)
    fit = least_squares(columns, values)
    expected, sse, rank, _ = np.linalg.lstsq(columns, values)
    np.testing.assert_allclose(fit.coefficients, expected, rtol=1e-11)
    np.testing.assert_allclose(fit.sse, sse[0], rtol=1e-11)
    assert (fit.rank, fit.freedom) == (rank, 36)
    inverse = np.linalg.inv(columns.T @ columns)
    np.testing.assert_allclose(fit.covariance, fit.sse / 36 * inverse, rtol=1e-9, atol=1e-12)
    hat = columns @ inverse @ columns.T
    np.testing.assert_allclose(fit.leverages, np.diag(hat), rtol=1e-10)
    np.testing.assert_allclose(fit.leverage(columns), np.diag(hat), rtol=1e-10)
    np.testing.assert_allclose(fit.predict(columns), values - fit.residuals, rtol=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-8.0, 8.0), min_size=4, max_size=4))
def test_the_unit_of_a_column_does_not_matter(exponents: list[float]) -> None:
    columns = polynomial()
    values = np.cos(3.0 * np.linspace(-1.0, 1.0, 40))
    units = 10.0 ** np.array(exponents)
    plain, scaled = least_squares(columns, values), least_squares(columns * units, values)
    np.testing.assert_allclose(scaled.coefficients * units, plain.coefficients, atol=1e-12)
    np.testing.assert_allclose(scaled.condition, plain.condition, rtol=1e-9)
    np.testing.assert_allclose(scaled.leverages, plain.leverages, rtol=1e-9)


def test_what_the_data_leave_open_is_told() -> None:
    # the third column is the sum of the others: five hulls cannot tell them apart
    a, b = np.array([1.0, 2.0, 3.0, 4.0, 5.0]), np.array([2.0, 1.0, 0.0, 1.0, 3.0])
    columns = np.column_stack([a, b, a + b])
    fit = least_squares(columns, 2.0 * a - b)
    assert fit.rank == 2
    assert fit.freedom == 3
    assert fit.condition > 1e14
    np.testing.assert_allclose(fit.predict(columns), 2.0 * a - b, atol=1e-12)
    along, across = fit.undetermined(np.array([[1.0, 1.0, 2.0], [1.0, 1.0, 0.0]]))
    assert along < 1e-12
    assert across > 0.1


def test_no_freedom_no_variance() -> None:
    fit = least_squares(polynomial(4), np.arange(4.0))
    assert fit.freedom == 0
    assert np.isnan(fit.variance)
    few = least_squares(polynomial(3), np.arange(3.0))
    assert few.rank == 3
    assert few.condition == np.inf


@pytest.mark.parametrize(
    ('columns', 'values', 'told'),
    [
        (np.ones((3, 2)), np.ones(2), 'expected n x p'),
        (np.ones(3), np.ones(3), 'expected n x p'),
        (np.ones((0, 2)), np.ones(0), 'expected n x p'),
        (np.full((3, 2), np.nan), np.ones(3), 'not all finite'),
        (np.ones((3, 2)), np.full(3, np.inf), 'not all finite'),
    ],
)
def test_refuses_what_cannot_be_fitted(columns: np.ndarray, values: np.ndarray, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        least_squares(columns, values)


@pytest.mark.parametrize('n', [1, 5, 127, 128, 129, 5000])
def test_same_gram_matrix(n: int) -> None:
    rows = np.random.default_rng(1).normal(size=(n, 6)) * 10.0 ** np.arange(6)
    factor = triangle(rows)
    assert factor.shape == (6, 6)
    np.testing.assert_array_equal(factor, np.triu(factor))
    size = np.linalg.norm(rows, axis=0)
    np.testing.assert_allclose(
        factor.T @ factor / np.outer(size, size),
        rows.T @ rows / np.outer(size, size),
        rtol=0.0,
        atol=1e-13,
    )


def test_residual_sum_without_cancellation() -> None:
    rng = np.random.default_rng(2)
    noise = rng.normal(size=2000)
    design = np.stack([np.ones(2000), np.linspace(-1.0, 1.0, 2000)], axis=1)
    noise -= design @ np.linalg.lstsq(design, noise)[0]
    data = design @ [1e7, 3e6] + noise
    factor = triangle(np.column_stack([design, data]))
    np.testing.assert_allclose(factor[2, 2] ** 2, noise @ noise, rtol=1e-8)


def test_many_columns() -> None:
    rows = np.random.default_rng(4).normal(size=(700, 165))
    factor = triangle(rows)
    np.testing.assert_allclose(factor.T @ factor, rows.T @ rows, rtol=0.0, atol=1e-10)


def test_inverse() -> None:
    upper = triangle(np.random.default_rng(3).normal(size=(60, 20)))
    np.testing.assert_allclose(inverse(upper) @ upper, np.eye(20), rtol=0.0, atol=1e-13)
    np.testing.assert_array_equal(inverse(upper), np.triu(inverse(upper)))


def test_threads_of_blas_change_no_bit() -> None:
    code = (
        'import numpy as np, zlib\n'
        'from shipdrag_ros.studies.least_squares import triangle\n'
        'rows = np.random.default_rng(0).normal(size=(30000, 41))\n'
        'print(zlib.crc32(triangle(rows).tobytes()))\n'
    )
    found = {
        subprocess.run(
            [sys.executable, '-c', code],
            env={**os.environ, 'OPENBLAS_NUM_THREADS': threads},
            capture_output=True,
            text=True,
            check=True,
            timeout=60,
        ).stdout
        for threads in ('1', '2')
    }
    assert len(found) == 1
