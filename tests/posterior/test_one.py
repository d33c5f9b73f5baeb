# SPDX-License-Identifier: Apache-2.0
"""The estimator of the one posterior: what must not matter, and what its band holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.estimation import estimate, estimate_final
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.ship.model import friction_n
from tests.posterior.conftest import window_of

ONE = Parameters(estimator='one')


def at(found: Estimate, speed_m_s: Float64) -> tuple[Float64, Float64]:
    """Return r and sigma at some speeds."""
    curve = found.curve
    return (
        np.interp(speed_m_s, curve.speed_m_s, curve.resistance_m_s2),
        np.interp(speed_m_s, curve.speed_m_s, curve.sigma_m_s2),
    )


SPEEDS = np.linspace(4.0, 7.8, 20)


@pytest.fixture(scope='module')
def found(ship: Ship) -> Estimate:
    return estimate_final(window_of(ship, seed=1), ship, ONE)


def test_live_and_final_agree(ship: Ship, found: Estimate) -> None:
    live = estimate(window_of(ship, seed=1), ship, ONE)
    r, sigma = at(found, SPEEDS)
    assert np.all(np.abs(at(live, SPEEDS)[0] - r) < 0.2 * sigma)
    assert found.estimator == live.estimator == 'one'


@pytest.mark.parametrize(
    'change', [{'shift_ns': 86_400_123_456_789}, {'turned_rad': 1.1}], ids=['later', 'turned']
)
def test_neither_date_nor_frame_of_the_positions_matter(ship, found, change):
    other = estimate_final(window_of(ship, seed=1, **change), ship, ONE)
    r, sigma = at(found, SPEEDS)
    np.testing.assert_allclose(at(other, SPEEDS)[0], r, rtol=0.0, atol=0.02 * sigma.min())


def test_readings_that_are_something_else_hardly_count(ship: Ship, found: Estimate) -> None:
    spiked = estimate_final(window_of(ship, seed=1, spikes=30), ship, ONE)
    r, sigma = at(found, SPEEDS)
    assert np.all(np.abs(at(spiked, SPEEDS)[0] - r) < 0.5 * sigma)


@pytest.mark.parametrize(('log_factor', 'rms'), [(-0.02, 0.61), (0.0, 0.25), (0.02, 0.25)])
def test_the_band_holds_the_truth_of_a_log_alone_that_is_off(ship, log_factor, rms):
    # N = 5, seeds 0 to 4, at 20 speeds each: r in sigma off, within 40 % of what it is
    truth = ship.resistance_n(SPEEDS) / ship.mass_kg
    squares = []
    for seed in range(5):
        window = window_of(ship, seed=seed, log_factor=log_factor, positions=False)
        r, sigma = at(estimate_final(window, ship, ONE), SPEEDS)
        squares.append(((r - truth) / sigma) ** 2)
    assert np.sqrt(np.mean(squares)) == pytest.approx(rms, rel=0.4)


@pytest.mark.parametrize('factor', [0.0, 0.3], ids=['as stated', 'fouled'])
def test_a_hull_that_differs_from_its_file_is_held(ship: Ship, factor: float) -> None:
    fouled = replace(
        ship, effects=(StatedEffect('fouling', {'friction_factor': Parameter(factor, 0.0)}),)
    )
    truth = (ship.resistance_n(SPEEDS) + factor * friction_n(ship, SPEEDS)) / ship.mass_kg
    r, sigma = at(estimate_final(window_of(fouled, seed=3), ship, ONE), SPEEDS)
    assert np.max(np.abs(r - truth) / sigma) < 3.0
    assert np.max(np.abs(r / truth - 1.0)) < 0.06


def test_without_a_baseline_the_band_is_wider_and_holds(ship: Ship, found: Estimate) -> None:
    bare = replace(ship, baseline=None)
    truth = ship.resistance_n(SPEEDS) / ship.mass_kg
    r, sigma = at(estimate_final(window_of(ship, seed=1), bare, ONE), SPEEDS)
    assert np.mean(sigma) > np.mean(at(found, SPEEDS)[1])
    assert np.max(np.abs(r - truth) / sigma) < 3.0
