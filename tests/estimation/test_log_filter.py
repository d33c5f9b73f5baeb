# SPDX-License-Identifier: Apache-2.0
"""A log whose filter is slow is no current, however short the steady record was."""

from __future__ import annotations

import pytest

from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS, Scenario, sense, simulate, standard_sensors
from shipdrag_ros.simulation.effects import parse

FERRY = Ship.from_yaml(
    """
    name: ferry
    length_m: 70.0
    displaced_volume_m3: 1800.0
    wetted_surface_m2: 1000.0
    propulsion: {run_down_s: 5.0, sd: 2.0}
    baseline:
      form_factor: 0.25
      correlation_allowance: 4.0e-4
      wave_froude: [0.0, 0.15, 0.22, 0.28, 0.34]
      wave_coefficient: [0.0, 5.0e-5, 4.0e-4, 1.2e-3, 3.0e-3]
      relative_sd: {friction: 0.02, wave: 0.10}
    """,
    subject='ferry',
)


@pytest.mark.parametrize('steady_s', [150.0, 250.0])  # too short to learn slow noise from
def test_a_log_that_lags_is_no_current(steady_s: float) -> None:
    scenario = Scenario(speed_m_s=7.5, lead_in_s=steady_s, duration_s=700.0, heading_rad=0.4)
    truth = simulate(FERRY, scenario, effects=[parse('log_lag=8')])
    inputs = ('speed_through_water', 'position')
    block = sense(truth, standard_sensors(rate_hz=1.0, noise=1.0, inputs=inputs), seed=1)
    stop_ns = START_NS + round((steady_s + 9.0) * 1e9)  # found late, as the log shows it late
    end_ns = int(block.stamp_ns.max())
    window = Window.from_block(block, stop_ns, end_ns, before_ns=START_NS)
    found = estimate_final(window, FERRY, Parameters())
    assert found.current_m_s is not None
    assert abs(found.current_m_s) < 0.04  # 0.06 to 0.09 where the log is taken at its word
