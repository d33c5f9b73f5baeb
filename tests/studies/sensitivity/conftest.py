# SPDX-License-Identifier: Apache-2.0
"""A study of each kind, made once."""

from __future__ import annotations

from pathlib import Path

import pytest

from shipdrag_ros.ship import Ship
from shipdrag_ros.studies.manoeuvring.ship import mariner
from shipdrag_ros.studies.manoeuvring.simulate import zigzag
from shipdrag_ros.studies.sensitivity.coast import coast_from
from shipdrag_ros.studies.sensitivity.coasting import study_coast
from shipdrag_ros.studies.sensitivity.steering import study

CARGO = Ship.load(Path(__file__).resolve().parents[3] / 'config' / 'vitus_bering.yaml')


@pytest.fixture(scope='session')
def steered():
    return study(mariner(), zigzag(15.0), keep=24)


@pytest.fixture(scope='session')
def coasted():
    return study_coast(CARGO, coast_from(CARGO))
