# SPDX-License-Identifier: Apache-2.0
"""r(v) from a motion: its branch, its slope, and where it may be used."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.curve import Motion, ValidRange, froude_max, resistance_curve
from shipdrag_ros.estimation.result import FroudeMax, ResistanceCurve
from shipdrag_ros.ship import ConstantAddedMass, Ship


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


def curve(froude: np.ndarray, slope: np.ndarray, slope_sigma: float) -> ResistanceCurve:
    unused = np.ones_like(froude)
    return ResistanceCurve(
        froude, unused, unused, unused, froude, slope, np.full(len(froude), slope_sigma)
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


@pytest.mark.filterwarnings('error')
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
@pytest.mark.filterwarnings('error')
def test_no_branch_is_an_error_with_its_values(speed: list[float], ship: Ship) -> None:
    steady = motion(np.linspace(0.0, 300.0, 50), np.polynomial.Polynomial(speed))
    with pytest.raises(EstimationError, match=r'm/s \(Fr .* does not fall steadily above') as e:
        resistance_curve(steady, ship, froude_min=0.05)
    assert 'froude_min 0.05' in str(e.value)


FROUDE = np.linspace(0.05, 0.25, 201)
HUMP = np.exp(-(((FROUDE - 0.16) / 0.02) ** 2))


@pytest.mark.parametrize(
    ('slope', 'slope_sigma', 'expected', 'by'),
    [
        (FROUDE + 0.5 * HUMP, 0.1, 0.16, FroudeMax.INFLECTION),
        # the same hump inside the band
        (FROUDE + 0.5 * HUMP, 0.3, 0.25, FroudeMax.BRANCH_TOP),
        # a wiggle before it does not count
        (FROUDE + 0.5 * HUMP + 0.05 * np.sin(300 * FROUDE), 0.1, 0.16, FroudeMax.INFLECTION),
        # from the bottom on it only falls: no maximum
        (-FROUDE, 1e-3, 0.25, FroudeMax.BRANCH_TOP),
        # a fall at the bottom, then the hump
        (0.5 * HUMP - 4.0 * np.minimum(FROUDE, 0.1), 0.05, 0.16, FroudeMax.INFLECTION),
        # a dip that is overcome before it is significant, then the transient
        (10.0 * FROUDE + 0.05 * HUMP, 0.1, 0.25, FroudeMax.BRANCH_TOP),
        # a significant wiggle at low speed, far exceeded further up
        (
            FROUDE + 0.5 * np.exp(-(((FROUDE - 0.06) / 0.005) ** 2)) + 5.0 * FROUDE,
            0.1,
            0.25,
            FroudeMax.BRANCH_TOP,
        ),
        (np.zeros(201), 0.1, 0.25, FroudeMax.BRANCH_TOP),
    ],
    ids=['hump', 'in the band', 'wiggle', 'falling', 'fall first', 'overcome', 'exceeded', 'flat'],
)
def test_upper_end(slope: np.ndarray, slope_sigma: float, expected: float, by: FroudeMax) -> None:
    top, rule = froude_max(curve(FROUDE, slope, slope_sigma))
    assert rule is by
    np.testing.assert_allclose(top, expected, rtol=0.0, atol=6e-3)


def test_valid_range_and_its_w() -> None:
    r = 1e-3 * FROUDE**2
    sigma = np.where(FROUDE > 0.2, 1.0, 1e-6)
    hump = replace(
        curve(FROUDE, FROUDE + 0.5 * HUMP, 0.1), resistance_m_s2=r, sigma_repeatable_m_s2=sigma
    )
    cut, whole = ValidRange.of_polynomial(hump), ValidRange.of_branch(hump)
    assert cut.froude_valid == (0.05, froude_max(hump)[0])
    assert cut.froude_max_by is FroudeMax.INFLECTION
    assert whole.froude_valid == (0.05, 0.25)
    assert whole.froude_max_by is FroudeMax.BRANCH_TOP
    assert (
        cut.froude_max_argmax == whole.froude_max_argmax == FROUDE[np.argmax(FROUDE + 0.5 * HUMP)]
    )
    # the wide band above the cut is not in the first one
    np.testing.assert_allclose(
        cut.max_relative_sigma, 1e-6 / r[cut.froude_valid[1] >= FROUDE].max(), rtol=1e-14
    )
    np.testing.assert_allclose(whole.max_relative_sigma, 1.0 / r.max(), rtol=1e-14)
