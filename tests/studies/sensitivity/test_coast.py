# SPDX-License-Identifier: Apache-2.0
"""A coastdown as its instruments read it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.errors import SensitivityError, ShipdragError
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship import ConstantAddedMass, Propulsion, Ship, StatedEffect, TableBaseline
from shipdrag_ros.simulation import Action, simulate
from shipdrag_ros.studies.sensitivity.coasting import (
    LOG_SD_M_S,
    coast_from,
    parse_coast,
    particulars,
)
from tests.runs import CARGO


def test_the_coastdown_ends_where_the_ship_has_slowed_to_a_third():
    own = coast_from(CARGO, 8.0)
    truth = simulate(CARGO, own.scenario)
    assert truth.speed_through_water_m_s[-1] == pytest.approx(0.35 * 8.0, rel=0.05)
    assert own.name == 'coastdown:8'
    reading = own.read(CARGO, [Action(), Action(log_factor=0.1)])
    np.testing.assert_allclose(reading[1, :, 0], 1.1 * reading[0, :, 0])
    np.testing.assert_allclose(reading[0, 0, 0], 8.0 / LOG_SD_M_S)
    slower = own.read(CARGO, [Action()], speed_m_s=7.0)
    np.testing.assert_allclose(slower[0, 0, 0], 7.0 / LOG_SD_M_S)


def test_names_of_coastdowns():
    assert parse_coast(CARGO, 'coastdown:7.5').scenario.speed_m_s == 7.5
    top = CARGO.baseline_range_m_s[1]
    assert parse_coast(CARGO, 'coastdown').scenario.speed_m_s == pytest.approx(0.7 * top)
    for text in ('zigzag:15', 'coastdown:', 'coastdown:fast', 'coast'):
        with pytest.raises(SensitivityError, match='expected coastdown or coastdown:SPEED'):
            parse_coast(CARGO, text)
    for text in ('coastdown:20', 'coastdown:1', 'coastdown:nan', 'coastdown:-3'):
        with pytest.raises(SensitivityError, match=r'expected 2\.131\.\.9\.974 m/s'):
            parse_coast(CARGO, text)
    with pytest.raises(ShipdragError, match='no baseline'):
        parse_coast(replace(CARGO, baseline=None), 'coastdown')


def test_a_coastdown_stays_above_the_lowest_speed_of_a_table():
    table = TableBaseline((4.0, 6.0, 9.0), (7e4, 1.7e5, 4.2e5), 0.02)
    ship = replace(CARGO, baseline=table)
    own = coast_from(ship)
    assert np.all(np.isfinite(own.read(ship, [Action()])))
    assert simulate(ship, own.scenario).speed_through_water_m_s[-1] > 4.0
    with pytest.raises(SensitivityError, match=r'begins at 4\.5 m/s, expected 4\.889\.\.9'):
        coast_from(ship, 4.5)


SPEED = 7.0


def listed(ship: Ship):
    return {one.key: one for one in particulars(ship, speed_m_s=SPEED)}


def test_a_ship_file_has_these_values_with_their_stated_sd():
    found = listed(CARGO)
    assert list(found) == [
        'length_m',
        'displaced_volume_m3',
        'wetted_surface_m2',
        'water.density_kg_m3',
        'water.kinematic_viscosity_m2_s',
        'added_mass',
        'air.frontal_area_m2',
        'air.drag_coefficient',
        'propulsion.run_down_s',
        'baseline.form_factor',
        'baseline.correlation_allowance',
        'baseline.C_V',
        'baseline.wave_coefficient',
    ]
    known = {key: one.sd for key, one in found.items() if np.isfinite(one.sd)}
    assert known == pytest.approx(
        {
            'added_mass': 0.02 / float(CARGO.n_r(SPEED)),
            'propulsion.run_down_s': 0.25,
            'baseline.C_V': 0.02,
            'baseline.wave_coefficient': 0.1,
        }
    )
    assert found['water.density_kg_m3'].value == 1025.0


def test_each_is_changed_alone():
    for key, one in listed(CARGO).items():
        changed = listed(one.scaled(CARGO, 1.2))
        moved = {
            other
            for other, value in changed.items()
            if value.value != pytest.approx(listed(CARGO)[other].value, nan_ok=True, rel=1e-9)
        }
        also = {
            # n_r follows from both
            'length_m': {'added_mass'},
            'displaced_volume_m3': {'added_mass'},
            'baseline.C_V': {'baseline.form_factor', 'baseline.correlation_allowance'},
        }.get(key, set())
        own = set() if np.isnan(one.value) else {key}
        assert moved == own | also, key


@pytest.mark.parametrize(
    ('key', 'part'), [('baseline.C_V', 'viscous'), ('baseline.wave_coefficient', 'wave')]
)
def test_a_coefficient_as_a_whole_is_a_factor(key, part):
    changed = listed(CARGO)[key].scaled(CARGO, 1.3).baseline
    at = np.array([1e8, 1e9]) if part == 'viscous' else np.array([0.1, 0.2])
    np.testing.assert_allclose(
        getattr(changed, part)(at), 1.3 * getattr(CARGO.baseline, part)(at), rtol=1e-12
    )


@pytest.mark.parametrize('model', [CARGO.added_mass, ConstantAddedMass(value=0.08)])
def test_added_mass_of_any_model_is_a_factor_of_n_r(model):
    ship = replace(CARGO, added_mass=model)
    changed = listed(ship)['added_mass'].scaled(ship, 0.5)
    np.testing.assert_allclose(changed.n_r([1.0, 8.0]), 0.5 * ship.n_r([1.0, 8.0]), rtol=1e-12)


def test_a_table_has_one_value_and_effects_have_theirs():
    table = TableBaseline((0.0, 5.0, 9.0), (0.0, 1e5, 4e5), 0.03)
    effects = (
        StatedEffect('fouling', {'friction_factor': Parameter(0.2, 0.05)}),
        StatedEffect('current', {'along_track_m_s': Parameter(0.0, 0.1)}),
    )
    ship = replace(CARGO, baseline=table, effects=effects, air=None, propulsion=None)
    found = listed(ship)
    assert list(found)[-2:] == ['baseline.resistance_n', 'effects.fouling.friction_factor']
    assert found['baseline.resistance_n'].sd == 0.03
    assert found['effects.fouling.friction_factor'].sd == pytest.approx(0.25)
    np.testing.assert_allclose(
        found['baseline.resistance_n'].scaled(ship, 1.1).resistance_n(6.0),
        1.1 * ship.resistance_n(6.0),
    )
    changed = found['effects.fouling.friction_factor'].scaled(ship, 2.0)
    assert changed.effects[0].parameters['friction_factor'] == Parameter(0.4, 0.05)
    assert changed.effects[1] == effects[1]


def test_what_is_not_stated_is_no_sd_and_what_is_zero_is_left_out():
    learnt = replace(CARGO.baseline, relative_sd_of='retardation', correlation_allowance=0.0)
    ship = replace(CARGO, baseline=learnt, propulsion=Propulsion(5.0))
    found = listed(ship)
    # the retardation is known whatever n_r is
    assert np.isnan(found['added_mass'].sd)
    assert np.isnan(found['propulsion.run_down_s'].sd)
    assert 'baseline.correlation_allowance' not in found
    assert 'propulsion.run_down_s' not in listed(replace(CARGO, propulsion=Propulsion(0.0)))
