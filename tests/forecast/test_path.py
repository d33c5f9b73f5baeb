# SPDX-License-Identifier: Apache-2.0
"""Where she will be: ahead on her course over ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipdrag_ros.estimation import Window, estimate
from shipdrag_ros.forecast.foretell import foretell
from shipdrag_ros.forecast.result import PathAhead
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS, Scenario, sense, simulate, standard_sensors

STOP_NS = START_NS + 300 * SECOND_NS
MADE_S = 400.0


def test_she_is_where_she_was_foretold_to_be() -> None:
    ship = Ship.example()
    scenario = Scenario(
        speed_m_s=8.0, lead_in_s=300.0, duration_s=1500.0, heading_rad=0.7, current_m_s=(0.3, -0.2)
    )
    truth = simulate(ship, scenario)
    block = sense(truth, standard_sensors(), seed=2)
    end_ns = STOP_NS + round(MADE_S * SECOND_NS)
    window = Window.from_block(block, STOP_NS, end_ns, before_ns=START_NS)
    forecast = foretell(estimate(window, ship, Parameters()), ship)
    path = PathAhead.of(window, forecast)
    assert path is not None
    assert path.time_ns[0] == forecast.made_ns
    at_s = (path.time_ns - START_NS) * 1e-9
    seen = at_s < truth.time_s[-1]
    was = np.column_stack(
        [np.interp(at_s[seen], truth.time_s, axis) for axis in truth.position_m.T]
    )
    off = np.hypot(*(path.position_m[seen] - was).T)
    gone = np.hypot(*(was - was[0]).T)
    assert off[0] < 15.0
    assert off[-1] < 0.1 * gone[-1]


def test_without_positions_there_is_none() -> None:
    ship = Ship.example()
    truth = simulate(ship, Scenario(speed_m_s=8.0, lead_in_s=300.0, duration_s=500.0))
    block = sense(truth, standard_sensors(), seed=2)
    log = block[np.flatnonzero(block.channel == Channel.SPEED_THROUGH_WATER)]
    window = Window.from_block(log, STOP_NS, STOP_NS + 400 * SECOND_NS, before_ns=START_NS)
    forecast = foretell(estimate(window, ship, Parameters()), ship)
    assert not forecast.over_ground
    assert PathAhead.of(window, forecast) is None


def test_of_two_antennas_the_first_that_still_speaks_shows_the_course() -> None:
    ship = Ship.example()
    truth = simulate(ship, Scenario(speed_m_s=8.0, lead_in_s=300.0, duration_s=500.0))
    block = sense(truth, standard_sensors(), seed=2)
    end_ns = STOP_NS + 400 * SECOND_NS
    window = Window.from_block(block, STOP_NS, end_ns, before_ns=START_NS)
    other = replace(window.position, value=window.position.value + np.array([1e5, 0.0]))
    silent = window.part(STOP_NS, STOP_NS + 100 * SECOND_NS).position
    forecast = foretell(estimate(window, ship, Parameters()), ship)
    both = replace(window, further={'position_2': other})
    path, first, second = (
        PathAhead.of(each, forecast) for each in (window, both, replace(both, position=silent))
    )
    assert path is not None
    assert first is not None
    assert second is not None
    assert np.array_equal(first.position_m, path.position_m)
    assert np.allclose(second.position_m - path.position_m, [1e5, 0.0], atol=1e-3)
