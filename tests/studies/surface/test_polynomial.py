# SPDX-License-Identifier: Apache-2.0
"""Polynomials in several variables: values, derivatives, raw powers, source."""

from __future__ import annotations

from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.studies.surface.fit import Polynomial, monomials, terms_up_to


def some(variables: int, degree: int, seed: int) -> tuple[Polynomial, np.ndarray]:
    """A polynomial with random coefficients, and points around its centre."""
    rng = np.random.default_rng(seed)
    powers = terms_up_to(degree, [degree] * variables)
    centre, half = rng.uniform(-3.0, 3.0, variables), rng.uniform(0.5, 4.0, variables)
    points = centre + half * rng.uniform(-1.0, 1.0, (7, variables))
    return Polynomial(powers, rng.normal(size=len(powers)), centre, half), points


def test_terms() -> None:
    expected = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1], [0, 2]]
    assert terms_up_to(2, [2, 2]).tolist() == expected
    assert len(terms_up_to(4, [9, 9, 9])) == comb(4 + 3, 3)
    assert terms_up_to(4, [4, 1])[:, 1].max() == 1
    # the terms of a lower degree come first: degrees are nested
    assert terms_up_to(5, [5, 5])[:15].tolist() == terms_up_to(4, [4, 4]).tolist()


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 4), st.integers(0, 5), st.integers(0, 10**6))
def test_derivatives_raw_powers_and_source(variables: int, degree: int, seed: int) -> None:
    polynomial, points = some(variables, degree, seed)
    value = polynomial(points)
    size = np.abs(polynomial.coefficients).sum()
    step = 1e-5 * polynomial.half
    for j in range(variables):
        along = np.zeros(variables)
        along[j] = step[j]
        slope = (polynomial(points + along) - polynomial(points - along)) / (2.0 * step[j])
        np.testing.assert_allclose(
            polynomial.gradient(points)[:, j], slope, atol=1e-8 * size / polynomial.half[j]
        )
        np.testing.assert_allclose(
            polynomial.derivative(j)(points),
            polynomial.gradient(points)[:, j],
            atol=1e-12 * size / polynomial.half[j],
        )
    raw = polynomial.raw() @ polynomial.coefficients
    terms = monomials(points, polynomial.powers) * raw
    # raw powers cancel: hence the scaling inside
    np.testing.assert_allclose(terms.sum(axis=1), value, atol=1e-12 * np.abs(terms).sum())
    names = [f'x{i}' for i in range(variables)]
    space: dict[str, object] = {}
    exec(polynomial.source('c', names, 'Note.'), space)
    call = space['c']
    assert callable(call)
    assert call.__doc__ == 'Note.'
    np.testing.assert_allclose(call(*points.T), value, atol=1e-13 * size)
    np.testing.assert_allclose(call(*points[0].tolist()), value[0], atol=1e-13 * size)


def test_keeps_its_digits_far_from_zero() -> None:
    powers = terms_up_to(6, [6])
    polynomial = Polynomial(powers, np.ones(7), np.array([1e6]), np.array([1.0]))
    assert polynomial(np.array([[1e6 + 1.0]]))[0] == pytest.approx(7.0, abs=1e-12)
