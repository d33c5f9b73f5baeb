# SPDX-License-Identifier: Apache-2.0
"""What several tests of the diagnosis share."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship
from tests.runs import CARGO as SHIP
from tests.runs import coasted


@pytest.fixture
def seen_of() -> Callable[..., Observation]:
    """Return what sees a run in which effects are hidden."""

    def see(*effects: str) -> Observation:
        run = coasted(*effects, heading_rad=0.7, reference_rad=0.7, seed=5)
        return Observation.of(run.window, SHIP, Parameters(), name='run')

    return see


@pytest.fixture(scope='package', name='cargo')
def cargo_fixture() -> Ship:
    """
    Return the ship of the reference experiment.
    """
    return SHIP
