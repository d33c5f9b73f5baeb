# SPDX-License-Identifier: Apache-2.0
"""The order table and its rule, for polynomials in time and for surfaces."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from shipdrag_ros.studies.order import SIGNIFICANCE, OrderTable, fit_orders
from shipdrag_ros.studies.orthogonal import OrthogonalBasis


def plateau_order(table: OrderTable) -> int:
    """How many coefficients the smallest fit in the plateau has."""
    return int(table.coefficients[table.plateau()])


def test_published_surface_degrees() -> None:
    # m_x on 17 x 17 points at degrees 3, 4, 5: S5 keeps 4
    table = OrderTable.of([10, 15, 21], [0.002438, 6.776e-5, 6.506e-5], rows=289)
    np.testing.assert_allclose(
        np.sqrt(table.variance), [0.002956, 0.0004973, 0.0004927], rtol=2e-4
    )
    np.testing.assert_allclose(table.f[2], 1.85, rtol=5e-3)
    np.testing.assert_allclose(table.p[2], 0.09, rtol=2e-2)
    assert table.plateau() == 1
    assert plateau_order(table) == 15


def test_probabilities_against_scipy_stats() -> None:
    table = OrderTable.of([2, 3, 6], [10.0, 8.0, 7.0], rows=30)
    assert np.isnan(table.f[0])
    assert np.isnan(table.p[0])
    np.testing.assert_allclose(table.f[1:], [2.0 / (8.0 / 27), (1.0 / 3) / (7.0 / 24)], rtol=1e-12)
    np.testing.assert_allclose(table.p[1:], stats.f.sf(table.f[1:], [1, 3], [27, 24]), rtol=1e-10)


def test_a_stricter_test_stops_earlier() -> None:
    table = OrderTable.of(range(1, 6), [100.0, 50.0, 48.0, 47.9, 47.8], rows=100)
    assert 0.01 < table.p[2] < SIGNIFICANCE
    assert (table.plateau(), table.plateau(significance=0.01)) == (2, 1)


def test_one_idle_step_is_not_a_plateau() -> None:
    # an odd term after an even one that is not there
    table = OrderTable.of(range(1, 6), [100.0, 99.9, 1.0, 0.999, 0.998], rows=100)
    assert table.p[1] > SIGNIFICANCE > table.p[2]
    assert plateau_order(table) == 3


def test_exact_fits_are_rounding_not_steps() -> None:
    table = OrderTable.of(range(1, 6), [10.0, 4.0, 1e-28, 1e-29, 0.0], rows=9, rounding=1e-26)
    assert table.f[2] == np.inf
    np.testing.assert_array_equal(table.p[2:], [0.0, 1.0, 1.0])
    assert plateau_order(table) == 3
    assert plateau_order(OrderTable.of([1, 2], [0.0, 0.0], rows=5)) == 1


def test_polynomials_of_known_degree_without_noise() -> None:
    time = np.linspace(-1.0, 1.0, 50)
    basis = OrthogonalBasis.on(time, 20)
    for degree in (1, 3, 6):
        values = 1e3 + np.polynomial.Chebyshev(0.2 ** np.arange(degree + 1))(time)
        assert plateau_order(fit_orders(basis, values)[1]) == degree + 1


def test_known_variance() -> None:
    rng = np.random.default_rng(8)
    time = np.linspace(-1.0, 1.0, 200)
    values = 1.0 + time + 0.2 * time**3 + 0.05 * rng.normal(size=200)
    _, table = fit_orders(OrthogonalBasis.on(time, 12), values)
    row = table.plateau_at(0.05**2)
    assert row == table.plateau() == 3
    assert not table.is_below(3, 0.05**2)
    # more noise claimed is noticed; with less no fit is good enough
    assert table.plateau_at(0.1**2) == 3
    assert table.is_below(3, 0.1**2)
    assert table.plateau_at(0.02**2) is None


def test_a_plateau_above_the_known_variance_is_not_the_last() -> None:
    # a term of high order behind idle ones
    table = OrderTable.of(range(1, 8), [1e4, 110.0, 109.0, 108.0, 107.0, 52.0, 51.5], rows=60)
    assert plateau_order(table) == 2
    assert table.coefficients[table.plateau_at(1.0)] == 6


def test_refuses_what_is_no_table() -> None:
    with pytest.raises(ValueError, match='ascending and below 5'):
        OrderTable.of([3, 5], [2.0, 1.0], rows=5)
    with pytest.raises(ValueError, match='ascending'):
        OrderTable.of([3, 2], [2.0, 1.0], rows=5)


def test_false_choice_rate() -> None:
    """
    Too high an order in 7..11 % of records, as two tests of 5 % let expect; with terms
    at 8 sigma none is missed. N = 2000, seed 1, 99.9 % binomial bounds.
    """
    rng = np.random.default_rng(1)
    time = np.linspace(-1.0, 1.0, 100)
    basis = OrthogonalBasis.on(time, 20)
    size = np.sqrt(basis.squared_norm)
    truth = ((8.0 / size)[:5, None] * basis.columns[:5]).sum(axis=0)
    runs = 2000
    orders = np.array(
        [
            plateau_order(fit_orders(basis, truth + noise)[1])
            for noise in rng.normal(size=(runs, 100))
        ]
    )
    assert stats.binom.cdf((orders < 5).sum(), runs, 1e-4) < 0.999
    low, high = stats.binom.ppf([0.0005, 0.9995], runs, [0.07, 0.11])
    assert low <= (orders > 5).sum() <= high
