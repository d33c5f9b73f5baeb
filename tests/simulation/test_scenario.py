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
        ({'turns': (Turn(0.0, 10.0, 0.1), Turn(5.0, 10.0, 0.1))}, 'turns are at'),
        ({'turns': (Turn(0.0, -1.0, 0.1),)}, 'turns are at'),
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
        speed_m_s=8.2,
        lead_in_s=100.0,
        orders=(STOP, EngineOrder(10.0, shaft=0.5, thrust=0.25)),
    )
    at = np.array([0.0, 99.9, 100.0, 105.0, 110.0, 115.0, 1000.0])
    left = np.exp(-1.0)
    expected = [1.0, 1.0, 1.0, np.exp(-0.5), left, 0.25 + (left - 0.25) * np.exp(-0.5), 0.25]
    np.testing.assert_allclose(scenario.thrust_fraction(at, run_down_s=10.0), expected, rtol=1e-12)
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
