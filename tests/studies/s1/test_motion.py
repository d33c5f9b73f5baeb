# SPDX-License-Identifier: Apache-2.0
"""r(v) from a motion: its branch and its slope."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.ship import ConstantAddedMass, Ship
from shipdrag_ros.studies.s1.motion import Motion, resistance_curve


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
