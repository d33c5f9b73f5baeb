# SPDX-License-Identifier: Apache-2.0
"""A coastdown that is dated late: what a craft did from her stop on is read all the same."""

import numpy as np
import pytest

from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS, Scenario, Sensor, sense, simulate

CRAFT = Ship.from_yaml(
    """
name: small craft
length_m: 24.5
displaced_volume_m3: 178.6
breadth_m: 6.5
draught_m: 2.5
added_mass: {model: constant, value: 0.12, sd: 0.02}
propulsion: {run_down_s: 2.0, sd: 0.5}
baseline:
  source: trials
  speed_m_s: [0, 1, 2, 3, 4, 5]
  resistance_n: [0, 650, 2300, 6300, 14600, 28000]
  relative_sd: 0.02
""",
    subject='small craft',
)
SPEED_M_S = 4.3


@pytest.mark.parametrize(
    'sensor',
    [
        Sensor(channel=Channel.SPEED_THROUGH_WATER, sd=0.02),
        Sensor(channel=Channel.POSITION, sd=0.3),
    ],
    ids=['log', 'fixes'],
)
def test_what_is_lost_before_the_onset_is_read(sensor: Sensor) -> None:
    scenario = Scenario(speed_m_s=SPEED_M_S, lead_in_s=900.0, duration_s=180.0)
    block = sense(simulate(CRAFT, scenario), (sensor,), seed=3)
    stop_ns = START_NS + 900 * SECOND_NS
    window = Window.from_block(
        block, stop_ns + 25 * SECOND_NS, stop_ns + 180 * SECOND_NS, before_ns=START_NS
    )
    curve = estimate_final(window, CRAFT, Parameters()).valid_curve
    true = CRAFT.resistance_n(curve.speed_m_s) / CRAFT.mass_kg
    assert curve.speed_m_s[-1] > 0.98 * SPEED_M_S  # a quarter of it is lost by the onset
    assert np.abs(curve.resistance_m_s2 - true).max() < 0.03 * true.max()
