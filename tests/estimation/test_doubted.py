# SPDX-License-Identifier: Apache-2.0
"""Where the log may be in a wrong scale, the band holds what r is with it and without it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.estimation.choice import averaged
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.simulation import START_NS, Scenario, sense, simulate, standard_sensors
from shipdrag_ros.simulation.effects import parse
from tests.runs import CARGO as SHIP

PARAMETERS = Parameters()
STOP_NS = START_NS + 900 * 10**9


@pytest.fixture(scope='module')
def window() -> Window:
    """A log that reads 0.7 times the speed, beside positions."""
    scenario = Scenario(speed_m_s=6.0, lead_in_s=900.0, duration_s=900.0)
    truth = simulate(SHIP, scenario, effects=[parse('log_scale=-0.3')])
    sensors = standard_sensors(rate_hz=1.0, noise=0.3, inputs=('speed_through_water', 'position'))
    block = sense(truth, sensors, seed=2)
    return Window.from_block(block, STOP_NS, int(block.stamp_ns.max()), before_ns=START_NS)


def test_the_band_holds_the_truth_where_the_log_is_doubted_and_it_is_said(window: Window) -> None:
    def away(doubt: float) -> float:
        found = averaged(estimate_final)(replace(window, log_doubt=doubt), SHIP, PARAMETERS)
        told = any('in a wrong scale: averaged over' in note for note in found.notes)
        assert told == (doubt > 0.05)
        curve = found.valid_conditions
        truth = SHIP.resistance_n(curve.speed_m_s) / SHIP.mass_kg
        return float(np.abs((curve.resistance_m_s2 - truth) / curve.sigma_m_s2).max())

    assert away(0.0) > 4.0
    assert away(0.3) < 2.0
    assert away(0.7) < 2.0


def test_the_parts_of_sigma_still_make_sigma_and_the_speeds_are_those_of_both(window):
    found = averaged(estimate_final)(replace(window, log_doubt=0.4), SHIP, PARAMETERS)
    squares = sum(np.square(part) for part in found.sigma_parts.values())
    assert np.sqrt(squares) == pytest.approx(found.calm.sigma_m_s2, rel=0.05)
    with_log = estimate_final(window, SHIP, PARAMETERS)
    assert found.valid_calm.speed_m_s[-1] <= with_log.valid_calm.speed_m_s[-1]


def test_without_an_estimate_from_the_rest_a_doubted_log_gives_none(window: Window) -> None:
    alone = window.without('position', 'none')
    with pytest.raises(EstimationError, match='in a wrong scale; without it'):
        averaged(estimate_final)(replace(alone, log_doubt=0.4), SHIP, PARAMETERS)
