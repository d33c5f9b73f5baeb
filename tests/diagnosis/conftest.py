# SPDX-License-Identifier: Apache-2.0
"""What several tests of the diagnosis share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.estimation import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import STANDARD_INPUTS, Scenario, sense, simulate, standard_sensors
from shipdrag_ros.simulation.effects import parse

SHIP = Ship.load(Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml')


def seen_of(*effects: str) -> Observation:
    """See a run in which effects are hidden."""
    scenario = Scenario(speed_m_s=8.0, lead_in_s=1200.0, duration_s=1200.0, heading_rad=0.7)
    truth = simulate(SHIP, scenario, effects=[parse(text) for text in effects], reference_rad=0.7)
    block = sense(truth, standard_sensors(rate_hz=1.0, noise=1.0, inputs=STANDARD_INPUTS), seed=5)
    first = int(block.stamp_ns.min())
    window = Window.from_block(
        block, first + 1200 * 10**9, int(block.stamp_ns.max()), before_ns=first
    )
    return Observation.of(window, SHIP, Parameters(), name='run')


@pytest.fixture(name='seen_of')
def seen_of_fixture() -> Callable[..., Observation]:
    """
    Return what sees a run in which effects are hidden.
    """
    return seen_of


@pytest.fixture(scope='package', name='cargo')
def cargo_fixture() -> Ship:
    """
    Return the ship of the reference experiment.
    """
    return SHIP
