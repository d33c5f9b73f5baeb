# SPDX-License-Identifier: Apache-2.0
"""Orthogonal polynomials, the motions that they are, and from these to r(v)."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.ship import ConstantAddedMass, Ship
from shipdrag_ros.studies.s1.motion import Motion, OrthogonalBasis, TimeScale, resistance_curve

START_NS = 1_700_000_000_123_456_789
EVEN = START_NS + np.round(np.linspace(0.0, 1500e9, 40)).astype(np.int64)
GAP = EVEN[(np.arange(40) < 8) | (np.arange(40) >= 35)]
LATE = np.concatenate(
    [START_NS + np.arange(40) * 10**10, START_NS + 10**9 * np.array([1480, 1500])]
)


def speeds(n: int, *, offset: float = 0.0) -> np.ndarray:
    rng = np.random.default_rng(3)
    return offset + 8.2 / (1.0 + np.linspace(0.0, 3.0, n)) + 0.05 * rng.normal(size=n)


def cosines(basis: OrthogonalBasis) -> float:
    """Largest |cos| between two columns, computed apart from the basis."""
    rows = basis.columns.copy()
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    return float(np.abs(rows @ rows.T - np.eye(len(rows))).max())


def exact(
    times: list[Fraction], values: list[Fraction], order: int
) -> tuple[list[Fraction], list[Fraction]]:
    """Coefficients and sums of squared residuals in rational arithmetic."""
    t, residual = np.array(times), np.array(values)
    coefficients, sse = [], []
    h, before, norm_before = t**0, 0 * t, Fraction(1)
    for _ in range(order):
        norm = h @ h
        coefficients.append(h @ residual / norm)
        residual = residual - coefficients[-1] * h
        sse.append(residual @ residual)
        alpha, beta = (t * h) @ h / norm, norm / norm_before
        h, before, norm_before = (t - alpha) * h - beta * before, h, norm
    return coefficients, sse


def digits(found: np.ndarray, truth: list[Fraction]) -> float:
    """Correct decimal digits of the worst entry."""
    worst = max(abs(float((Fraction(float(a)) - b) / b)) for a, b in zip(found, truth))
    return -math.log10(max(worst, 1e-17))


@pytest.mark.parametrize(
    ('time_ns', 'order', 'offset', 'reorthogonalised'),
    [
        (EVEN, 10, 0.0, False),
        (EVEN, 20, 0.0, False),
        (EVEN, 10, 1e6, False),
        (GAP, 8, 0.0, False),
        (LATE, 14, 0.0, True),
    ],
    ids=['even', 'order 20', 'offset 1e6', 'interior gap', 'late samples'],
)
def test_coefficients_against_rational_arithmetic(time_ns, order, offset, reorthogonalised):
    n = len(time_ns)
    scale = TimeScale.of(time_ns)
    values = speeds(n, offset=offset)
    basis = OrthogonalBasis.on(scale.normalise(time_ns), order)
    coefficients, sse = basis.fit(values)
    truth, truth_sse = exact(
        [Fraction(2 * (int(t) - scale.first_ns) - scale.span_ns, scale.span_ns) for t in time_ns],
        [Fraction(float(z)) for z in values],
        order,
    )
    assert (basis.reorthogonalised > 0) == reorthogonalised
    assert digits(coefficients, truth) > 12.0
    assert digits(sse, truth_sse) > 13.0


def test_a_gap_before_a_few_late_samples_is_caught_and_counted(monkeypatch) -> None:
    for early, late in ((-0.6, [0.98, 0.99, 1.0]), (-0.95, [0.9, 0.95, 1.0]), (-0.9, [1.0])):
        time = np.concatenate([np.linspace(-1.0, early, 497), late])
        basis = OrthogonalBasis.on(time, 20)
        assert basis.order == 20
        assert 0 < basis.reorthogonalised <= 10
        assert cosines(basis) < 1e-12
        with monkeypatch.context() as patch:
            # what the recurrence alone does with these times
            patch.setattr('shipdrag_ros.studies.s1.motion.ORTHOGONALITY_LOST', 1e9)
            assert cosines(OrthogonalBasis.on(time, 20)) > 1e-6


def test_evaluation_agrees_with_the_columns_also_where_reorthogonalised() -> None:
    time = np.concatenate([np.linspace(-1.0, -0.6, 497), [0.98, 0.99, 1.0]])
    basis = OrthogonalBasis.on(time, 20)
    assert basis.reorthogonalised
    scale = np.sqrt(basis.squared_norm)[:, None]
    again = basis.evaluate(time, derivatives=0)[0]
    np.testing.assert_allclose(again / scale, basis.columns / scale, rtol=0.0, atol=1e-14)
    first_five = basis.evaluate(time, derivatives=2, order=5)
    np.testing.assert_array_equal(first_five, basis.evaluate(time, derivatives=2)[:, :5])


def test_derivatives_against_numpy() -> None:
    rng = np.random.default_rng(5)
    time = np.sort(rng.uniform(-1.0, 1.0, 60))
    basis = OrthogonalBasis.on(time, 7)
    at = np.linspace(-1.0, 1.0, 31)
    rows = basis.evaluate(at, derivatives=3)
    for j in range(basis.order):
        polynomial = np.polynomial.Polynomial.fit(time, basis.columns[j], j, domain=[-1.0, 1.0])
        for derivative in range(4):
            expected = polynomial.deriv(derivative)(at) if derivative else polynomial(at)
            np.testing.assert_allclose(rows[derivative, j], expected, rtol=0.0, atol=2e-11)


def test_fewer_distinct_times_than_the_order_limit_it() -> None:
    repeated = np.repeat([-1.0, -0.2, 0.5, 1.0], 25)
    basis = OrthogonalBasis.on(repeated, 20)
    assert basis.order == 4
    assert cosines(basis) < 1e-12
    assert np.isfinite(basis.fit(speeds(100))[1]).all()
    # apart in the last bit only: as good as equal
    nearly = np.concatenate([repeated, np.nextafter(repeated, 0.0)])
    assert OrthogonalBasis.on(nearly, 20).order == 4
    assert OrthogonalBasis.on(np.zeros(3), 20).order == 1
    with pytest.raises(ValueError, match='expected 1 or more each'):
        OrthogonalBasis.on(np.empty(0), 3)
    with pytest.raises(ValueError, match='expected 1 or more each'):
        OrthogonalBasis.on(repeated, 0)


def test_time_scale_subtracts_integers_first() -> None:
    time_ns = START_NS + np.array([0, 1, 2, 3, 4], np.int64)
    scale = TimeScale.of(time_ns)
    np.testing.assert_array_equal(scale.normalise(time_ns), [-1.0, -0.5, 0.0, 0.5, 1.0])
    assert scale.half_s == 2e-9
    assert TimeScale.of(time_ns[:2], time_ns[3:]) == scale
    with pytest.raises(ValueError, match='all times are'):
        TimeScale.of(time_ns[:1])


@st.composite
def sample_times(draw: st.DrawFn) -> np.ndarray:
    """Times with jitter and a gap anywhere, in nanoseconds from 0."""
    n = draw(st.integers(25, 200))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    span = draw(st.sampled_from([10**8, 10**10, 3 * 10**12]))
    start, length = draw(st.floats(0.0, 1.0)), draw(st.floats(0.0, 0.97))
    fraction = rng.random(n)
    fraction = np.where(fraction < start * (1.0 - length), fraction, fraction * (1 - length))
    fraction = np.where(fraction >= start * (1.0 - length), fraction + length, fraction)
    return np.unique((fraction * span).astype(np.int64))


@settings(max_examples=60, deadline=None)
@given(sample_times(), st.integers(2, 20), st.integers(0, 2**61))
def test_any_times_are_orthogonal_and_the_epoch_changes_no_bit(time_ns, order, epoch):
    basis = OrthogonalBasis.on(TimeScale.of(time_ns).normalise(time_ns), order)
    assert basis.order == min(order, len(time_ns))
    assert cosines(basis) < 1e-12
    moved_ns = time_ns + epoch
    moved = OrthogonalBasis.on(TimeScale.of(moved_ns).normalise(moved_ns), order)
    np.testing.assert_array_equal(moved.columns, basis.columns)


@settings(max_examples=40, deadline=None)
@given(sample_times(), st.integers(-20, 20), st.floats(-1e4, 1e4))
def test_fit_is_equivariant(time_ns: np.ndarray, power: int, offset: float) -> None:
    basis = OrthogonalBasis.on(TimeScale.of(time_ns).normalise(time_ns), 12)
    values = speeds(len(time_ns))
    coefficients, sse = basis.fit(values)
    # a power of two changes the exponent alone
    scaled, scaled_sse = basis.fit(values * 2.0**power)
    np.testing.assert_array_equal(scaled, coefficients * 2.0**power)
    np.testing.assert_array_equal(scaled_sse, sse * 4.0**power)
    # an offset goes into the first coefficient
    shifted, shifted_sse = basis.fit(values + offset)
    size = np.sqrt(basis.squared_norm)
    np.testing.assert_allclose((shifted - coefficients)[1:] * size[1:], 0.0, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(shifted[0] - coefficients[0], offset, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(np.sqrt(shifted_sse), np.sqrt(sse), rtol=0.0, atol=1e-9)


def motion(time_s: np.ndarray, speed: np.polynomial.Polynomial, *, sigma: float = 1e-5) -> Motion:
    """A speed given as a polynomial of time, with independent errors of rising size."""
    n = len(time_s)
    one = np.zeros((n, 3))

    def error(column: int, size: float) -> np.ndarray:
        result = one.copy()
        result[:, column] = size
        return result

    return Motion(
        speed(time_s),
        speed.deriv()(time_s),
        speed.deriv(2)(time_s),
        error(0, 1e-3),
        error(1, sigma),
        error(2, 1e-8),
    )


FALL = np.polynomial.Polynomial([8.0, -0.012, 8e-6, -2e-9])


def test_curve_is_that_of_plain_numpy(ship: Ship) -> None:
    given = motion(np.linspace(0.0, 600.0, 50), FALL)
    rng = np.random.default_rng(2)
    given = replace(
        given,
        acceleration_error=1e-5 * rng.normal(size=(50, 4)),
        jerk_error=1e-7 * rng.normal(size=(50, 4)),
    )
    found = resistance_curve(given, ship, froude_min=0.05)
    n_r = np.polynomial.Polynomial(ship.n_r_polynomial())
    inertia, by_v = 1.0 + n_r(given.speed), n_r.deriv()(given.speed)
    a, jerk = given.acceleration, given.jerk
    slope = -(inertia * jerk / a + by_v * a)
    by_a = by_v - inertia * jerk / a**2
    error = (inertia / a)[:, None] * given.jerk_error + by_a[:, None] * given.acceleration_error
    one = float(ship.speed(1.0))
    for name, expected in (
        ('resistance_m_s2', -inertia * a),
        ('sigma_repeatable_m_s2', inertia * np.linalg.norm(given.acceleration_error, axis=1)),
        ('slope', one * slope),
        ('slope_sigma', one * np.linalg.norm(error, axis=1)),
    ):
        np.testing.assert_allclose(getattr(found, name), expected[::-1], rtol=1e-12)


def test_slope_sigma_by_simulation() -> None:
    """sd of dr/dFr over 4000 draws of the unit errors, seed 1: within 5 %, 4.5 sigma."""
    ship = Ship(
        length_m=100.0, displaced_volume_m3=8000.0, added_mass=ConstantAddedMass(value=0.05)
    )
    time_s = np.array([100.0, 200.0, 300.0])
    falling = motion(time_s, FALL)
    found = resistance_curve(falling, ship, froude_min=0.05)
    draws = np.random.default_rng(1).normal(size=(4000, 3))
    slopes = []
    for draw in draws:
        moved = replace(
            falling,
            acceleration=falling.acceleration + falling.acceleration_error @ draw,
            jerk=falling.jerk + falling.jerk_error @ draw,
        )
        slopes.append(resistance_curve(moved, ship, froude_min=0.05).slope)
    np.testing.assert_allclose(found.slope_sigma, np.std(slopes, axis=0), rtol=0.05)


def test_branch_is_the_longest_fall_above_the_minimum(ship: Ship) -> None:
    # rises, falls through zero, rises again
    swing = np.polynomial.Polynomial.fromroots([-200.0, 900.0, 1800.0]) * 1e-8
    time_s = np.linspace(-100.0, 1700.0, 500)
    found = resistance_curve(motion(time_s, swing), ship, froude_min=0.05)
    top = swing(time_s).max()
    assert found.froude[0] >= 0.05
    np.testing.assert_allclose(found.froude[0], 0.05, rtol=0.03)
    np.testing.assert_allclose(found.speed_m_s[-1], top, rtol=1e-3)
    assert np.all(found.resistance_m_s2 > 0.0)
    lower = resistance_curve(motion(time_s, swing), ship, froude_min=0.01)
    assert len(lower) > len(found)
    for name in ('slope', 'slope_sigma', 'sigma_m_s2', 'resistance_m_s2'):
        assert np.isfinite(getattr(found, name)).all()


@pytest.mark.parametrize('speed', [[3.0, 0.001], [3.0], [0.4, -1e-4], [-5.0, -0.001]], ids=str)
def test_no_branch_is_an_error_with_its_values(speed: list[float], ship: Ship) -> None:
    steady = motion(np.linspace(0.0, 300.0, 50), np.polynomial.Polynomial(speed))
    with pytest.raises(EstimationError, match=r'm/s \(Fr .* does not fall steadily above') as e:
        resistance_curve(steady, ship, froude_min=0.05)
    assert 'froude_min 0.05' in str(e.value)
