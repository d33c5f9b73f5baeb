# SPDX-License-Identifier: Apache-2.0
"""A study of each kind, made once."""

from __future__ import annotations

import pytest

from shipdrag_ros.studies.manoeuvring import mariner, zigzag
from shipdrag_ros.studies.sensitivity.coasting import coast_from, study_coast
from shipdrag_ros.studies.sensitivity.steering import study
from tests.runs import CARGO


@pytest.fixture(scope='session')
def steered():
    return study(mariner(), zigzag(15.0), keep=24)


@pytest.fixture(scope='session')
def coasted():
    return study_coast(CARGO, coast_from(CARGO))
