# SPDX-License-Identifier: Apache-2.0
"""Impossible scenarios are refused, naming every value."""

import numpy as np
import pytest

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.simulation import STOP, EngineOrder, GaussMarkov, Scenario, Turn


@pytest.mark.parametrize(
    ('keys', 'message'),
    [
        ({'speed_m_s': 0.0}, 'must not be 0'),
        ({'speed_m_s': -1.0}, 'speed_m_s is -1.0'),
        ({'speed_m_s': np.nan}, 'speed_m_s is nan'),
        ({'lead_in_s': -1.0}, 'lead_in_s is -1.0'),
        ({'lead_in_s': 0.0, 'duration_s': 0.0}, 'must not be 0'),
        ({'heading_rad': np.inf}, 'heading_rad is inf'),
        ({'current_m_s': (0.0, np.nan)}, 'current_m_s'),
        ({'depth_m': -3.0}, 'depth_m is -3.0'),
        ({'orders': (EngineOrder(5.0, 0.5, 0.25), STOP)}, 'orders are at'),
        ({'orders': (EngineOrder(-601.0, 0.0, 0.0),)}, 'orders are at'),
        ({'orders': (EngineOrder(0.0, np.nan, 0.0),)}, 'finite fractions'),
        ({'turns': (Turn(0.0, 10.0, 0.1, edge_s=11.0),)}, 'a turn is at'),
        ({'turns': (Turn(0.0, -1.0, 0.1),)}, 'a turn is at'),
        ({'turns': (Turn(-601.0, 1.0, 0.1),)}, 'a turn is at'),
        ({'turns': (Turn(0.0, 1.0, np.inf),)}, 'finite values'),
        ({'water_speed': GaussMarkov(0.1, 0.0)}, 'water_speed: correlation_time_s is 0.0'),
        ({'gust_force': GaussMarkov(-1.0, 1.0)}, 'gust_force: sd is -1.0'),
    ],
)
def test_an_impossible_value_is_named(keys, message):
    with pytest.raises(SimulationError, match=message):
        Scenario(**{'speed_m_s': 8.2, **keys})


def test_all_problems_are_in_one_message():
    with pytest.raises(SimulationError) as caught:
        Scenario(speed_m_s=-1.0, duration_s=-2.0, depth_m=-3.0)
    for value in ('-1.0', '-2.0', '-3.0'):
        assert value in str(caught.value)


def test_orders_are_approached_one_after_the_other():
    scenario = Scenario(
        speed_m_s=8.2, lead_in_s=100.0, orders=(STOP, EngineOrder(10.0, shaft=0.5, thrust=0.25))
    )
    at = np.array([0.0, 99.9, 100.0, 105.0, 110.0, 115.0, 1000.0])
    left = np.exp(-1.0)
    expected = [1.0, 1.0, 1.0, np.exp(-0.5), left, 0.5 + (left - 0.5) * np.exp(-0.5), 0.5]
    np.testing.assert_allclose(scenario.shaft_fraction(at, run_down_s=10.0), expected, rtol=1e-12)
    np.testing.assert_array_equal(
        scenario.shaft_fraction(at, run_down_s=0.0), [1.0, 1.0, 0.0, 0.0, 0.5, 0.5, 0.5]
    )


def test_the_rudder_is_laid_while_turning():
    scenario = Scenario(
        speed_m_s=8.2, lead_in_s=100.0, turns=(Turn(5.0, 10.0, 0.02, rudder_rad=0.3),)
    )
    np.testing.assert_array_equal(
        scenario.rudder([104.9, 105.0, 114.9, 115.0]), [0.0, 0.3, 0.3, 0.0]
    )


@pytest.mark.parametrize('edge_s', [0.0, 4.0, 10.0])
def test_a_turn_changes_the_course_by_rate_times_duration_whatever_its_edges(edge_s):
    turn = Turn(5.0, 10.0, 0.02, edge_s=edge_s)
    assert turn.turned_rad(1e3) == pytest.approx(0.2, rel=1e-12)
    assert turn.turned_rad(-5.0) == 0.0
    times = np.linspace(0.0, 20.0, 20001)
    rate = np.gradient(turn.turned_rad(times), times)
    away = np.abs(times[:, None] - np.array(turn.corners_s)).min(axis=1) > 0.01
    np.testing.assert_allclose(rate[away], 0.02 * turn.share(times)[away], rtol=0, atol=1e-9)


def test_half_of_an_edge_is_before_the_start():
    turn = Turn(5.0, 10.0, 0.02, edge_s=4.0)
    np.testing.assert_allclose(
        turn.share([2.9, 4.0, 5.0, 7.0, 13.0, 15.0, 17.1]), [0, 0.25, 0.5, 1, 1, 0.5, 0]
    )


def test_turns_that_overlap_add():
    first, second = Turn(0.0, 20.0, 0.01, rudder_rad=0.1), Turn(10.0, 20.0, 0.02, rudder_rad=0.2)
    scenario = Scenario(speed_m_s=8.2, lead_in_s=100.0, turns=(first, second))
    np.testing.assert_allclose(scenario.heading([105.0, 115.0, 200.0]), [0.05, 0.25, 0.6])
    np.testing.assert_allclose(scenario.rudder([105.0, 115.0, 125.0]), [0.1, 0.3, 0.2])


@pytest.mark.parametrize('step_s', [1.0, 7.0])
def test_sd_and_correlation_do_not_depend_on_the_step(step_s):
    # N = 200 000 at correlation time 20 s, seed 3; the bounds are 5 standard errors
    n, tau = 200_000, 20.0
    noise = GaussMarkov(0.3, tau).sample(step_s * np.arange(n), np.random.default_rng(3))
    independent = n * step_s / (2.0 * tau)
    np.testing.assert_allclose(np.std(noise), 0.3, rtol=5.0 / np.sqrt(2.0 * independent))
    assert abs(np.mean(noise)) < 5.0 * 0.3 / np.sqrt(independent)
    lag = round(tau / step_s)
    correlation = np.corrcoef(noise[:-lag], noise[lag:])[0, 1]
    assert abs(correlation - np.exp(-lag * step_s / tau)) < 5.0 / np.sqrt(independent)


def test_uneven_times_are_correlated_by_their_distance():
    # N = 100 000 pairs 2 s apart, 1000 s between pairs, seed 5; bound 5 standard errors
    pairs = 100_000
    times = (1000.0 * np.arange(pairs)[:, None] + [0.0, 2.0]).ravel()
    noise = GaussMarkov(1.0, 10.0).sample(times, np.random.default_rng(5)).reshape(-1, 2)
    expected = np.exp(-0.2)
    error = (1.0 - expected**2) / np.sqrt(pairs)
    assert abs(np.corrcoef(noise.T)[0, 1] - expected) < 5.0 * error
