# SPDX-License-Identifier: Apache-2.0
"""What several tests of the diagnosis share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from shipdrag_ros.diagnosis import diagnose
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.estimation import estimate_final
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


@pytest.fixture(scope='package', name='found')
def in_a_current() -> DiagnosisResult:
    """A run with a current, that the ship file does not have."""
    run = coasted('current=0.4', name='<outward>', lead_in_s=1800.0, coast_s=1500.0)
    found = diagnose([run], SHIP, Parameters())
    return replace(found, estimates=(estimate_final(run.window, SHIP, Parameters()),))
