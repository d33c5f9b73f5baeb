# SPDX-License-Identifier: Apache-2.0
"""The engine stop as the shaft shows it."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.estimation.motion_fit.run_down import RunDown
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship

SHIP = Ship.from_yaml(
    'length_m: 150.0\ndisplaced_volume_m3: 20200.0\npropulsion: {run_down_s: 10.0, sd: 5.0}\n',
    subject='ship',
)
STOP_S = 600.0


@pytest.mark.parametrize('turned', [0.0, 0.4, 0.7])
def test_a_propeller_that_the_water_turns_does_not_hide_the_run_down(turned: float) -> None:
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 2100.0)
    after = np.maximum(time - STOP_S, 0.0)
    # the ship slows down to a third, and the water turns the propeller with it
    by_water = turned / (1.0 + after / 700.0)
    shaft = by_water + (1.0 - by_water) * np.exp(-after / 10.0)
    shaft[time < STOP_S] = 1.0
    values = 12.0 * shaft + rng.normal(0.0, 0.02, len(time))
    block = Block.of(Channel.SHAFT, (time * 1e9).astype(np.int64), values)
    onset_s = STOP_S + 15.0
    window = Window.from_block(block, round(onset_s * 1e9), round(2100 * 1e9), before_ns=0)
    found = RunDown.of(window, SHIP)
    assert found.shaft_s == found.run_down_s
    assert found.run_down_s == pytest.approx(10.0, rel=0.1)
    assert found.stop_ns * 1e-9 == pytest.approx(STOP_S, abs=1.0)
