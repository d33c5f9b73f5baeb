# SPDX-License-Identifier: Apache-2.0
"""Values that do exactly what an effect does, and ones that do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.ship import Propulsion, Ship
from shipdrag_ros.simulation.effects import LIBRARY
from shipdrag_ros.studies.sensitivity.coast import coast_from
from shipdrag_ros.studies.sensitivity.coasting import WORST, study_coast
from tests.runs import CARGO


def mimics_of(ship: Ship):
    return {mimic.effect.name: mimic for mimic in study_coast(ship, coast_from(ship)).mimics}


def test_more_friction_is_fouling_where_nothing_else_is_viscous():
    bare = replace(CARGO.baseline, correlation_allowance=0.0)
    fouling = mimics_of(replace(CARGO, baseline=bare))['fouling']
    # as friction is nearly all there is, more of it is also less mass
    signs = {'baseline.C_V': 1.0, 'wetted_surface_m2': 1.0, 'displaced_volume_m3': -1.0}
    assert fouling.size == 0.25
    # linear about 0, where 25 per cent is large
    assert signs[fouling.particular.key] * fouling.error == pytest.approx(0.21, abs=0.05)
    assert fouling.left < 0.02


def test_a_speed_that_is_not_known_explains_nothing_twice_and_errors_stay_in_what_may_be(coasted):
    # a log that is off and a place that is off leave what the rest of the record shows
    found = {mimic.effect.name: mimic for mimic in coasted.mimics}
    assert found['log_offset'].distance > 1.0
    assert found['log_offset'].left > 0.9
    assert max(abs(mimic.error) for mimic in found.values()) == WORST
    assert abs(found['locked_propeller'].error) == WORST


def test_effects_that_cannot_act_or_move_nothing_are_left_out():
    found = mimics_of(replace(CARGO, propeller=None, propulsion=Propulsion(8.0)))
    assert {'locked_propeller', 'windmilling_propeller'}.isdisjoint(found)
    # she never goes as slowly as a log's dead band begins
    assert 'log_dead_band' in LIBRARY
    assert 'log_dead_band' not in found
    for mimic in found.values():
        assert np.isfinite([mimic.distance, mimic.error, mimic.left]).all()
