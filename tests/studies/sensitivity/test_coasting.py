# SPDX-License-Identifier: Apache-2.0
"""A coastdown as its instruments read it; which values of a ship file must be known well."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.errors import SensitivityError, ShipdragError
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship import ConstantAddedMass, Propulsion, Ship, StatedEffect, TableBaseline
from shipdrag_ros.simulation import Action, simulate
from shipdrag_ros.simulation.effects import LIBRARY
from shipdrag_ros.studies.sensitivity.coasting import (
    LOG_SD_M_S,
    WORST,
    coast_from,
    parse_coast,
    particulars,
    study_coast,
)
from shipdrag_ros.studies.sensitivity.face import coasting as words
from tests.runs import CARGO

CONFIG = Path(__file__).resolve().parents[3] / 'config'


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


def of(coasted, name):
    return coasted.losses.table[coasted.losses.names.index(name)]


def test_a_loss_is_the_change_of_log_and_position_in_their_sd(coasted):
    own = coasted.coast
    heavier = replace(CARGO, displaced_volume_m3=1.1 * CARGO.displaced_volume_m3)
    time_s = own.time_s[own.after_stop]
    one, other = (simulate(ship, own.scenario).at(time_s) for ship in (CARGO, heavier))
    log = (one.speed_through_water_m_s - other.speed_through_water_m_s) / 0.05
    ahead = (one.position_m - other.position_m)[:, 0] / 10.0
    expected = np.sqrt(np.mean(log**2 + ahead**2))
    assert of(coasted, 'displaced_volume_m3')[0] == pytest.approx(expected, rel=1e-3)


def test_a_stated_sd_is_a_change_by_that_much(coasted):
    # losses grow as the change: 2 and 10 per cent of C_V, 10 and 10 per cent of C_W
    friction, wave = of(coasted, 'baseline.C_V'), of(coasted, 'baseline.wave_coefficient')
    assert friction[4] == pytest.approx(friction[0] / 5.0, rel=0.1)
    np.testing.assert_allclose(wave[4:6], wave[:2], rtol=1e-12)
    assert np.all(np.isnan(of(coasted, 'length_m')[4:6]))


def test_what_must_be_known_well(coasted):
    kept = coasted.selection.kept
    # R / m is in proportion to the one and against the other
    assert {'displaced_volume_m3', 'wetted_surface_m2', 'baseline.C_V'} <= set(kept)
    assert {'air.drag_coefficient', 'water.density_kg_m3'} <= set(coasted.selection.dropped)
    small = coasted.losses.table[:, :2].mean(axis=1)
    by_default = {name for name, loss in zip(coasted.losses.names, small) if loss >= 1.0}
    assert len(kept) == len(by_default)
    importance = {one.particular.key: one for one in coasted.importance}
    assert importance['displaced_volume_m3'].stated == pytest.approx(1.0 / 0.9 - 1.0)
    # from a record r is -(1 + n_r) dv/dt
    estimated = {key for key, one in importance.items() if one.estimated > 1e-9}
    assert estimated == {'length_m', 'displaced_volume_m3', 'added_mass'}
    assert 0.005 < importance['added_mass'].estimated < 0.01
    # 10 per cent of the volume is far more than all that is stated as uncertain
    known = np.sqrt(sum(np.nan_to_num(row[4:6].mean()) ** 2 for row in coasted.losses.table))
    loss = of(coasted, 'displaced_volume_m3')[:2].mean()
    assert importance['displaced_volume_m3'].tolerable == pytest.approx(0.1 * known / loss)


def test_the_check_is_a_slower_run_with_all_that_was_dropped_wrong(coasted):
    assert coasted.check.coast.scenario.speed_m_s < coasted.coast.scenario.speed_m_s
    assert 0.0 < coasted.check.speed_m_s < 0.1
    fewer = study_coast(CARGO, coasted.coast, keep=1)
    assert len(fewer.selection.kept) == 1
    assert fewer.check.speed_m_s > 3.0 * coasted.check.speed_m_s
    all_kept = study_coast(CARGO, coasted.coast, keep=len(coasted.importance))
    assert all_kept.check.speed_m_s == all_kept.check.position_m == 0.0


def test_wrong_values_look_like_effects_of_the_hull_not_of_the_instruments(coasted):
    alike = {mimic.effect: mimic for mimic in coasted.mimics}
    for name in ('fouling', 'displacement', 'added_mass', 'towed_cable', 'shallow_water'):
        assert alike[name].left < 0.05
    # 12 % more mass and 10.7 % less resistance are the same but for air and thrust
    assert alike['displacement'].wrong_by == pytest.approx(1.0 / 1.12 - 1.0, abs=0.03)
    for name in ('log_scale', 'log_offset', 'current_change'):
        assert alike[name].left > 0.9
    lefts = [mimic.left for mimic in coasted.mimics]
    assert lefts == sorted(lefts)
    assert all(
        0.0 <= left <= 1.0 and abs(m.wrong_by) <= 0.5 for left, m in zip(lefts, coasted.mimics)
    )


def test_an_effect_that_is_stated_is_a_value_and_no_longer_missing():
    stated = StatedEffect('fouling', {'friction_factor': Parameter(0.2, 0.05)})
    ship = replace(CARGO, effects=(stated,))
    coasted = study_coast(ship, coast_from(ship))
    assert 'effects.fouling.friction_factor' in coasted.losses.names
    assert 'fouling' not in {mimic.effect for mimic in coasted.mimics}
    assert {mimic.effect for mimic in coasted.mimics} < set(LIBRARY)


def test_too_large_a_change_is_left_out_and_so_is_its_share_of_all_means(found):
    length = of(found, 'length_m')
    assert np.isnan(length[3])  # half as long, the Froude number leaves the baseline
    np.testing.assert_allclose(found.losses.mean, found.losses.table[:, :3].mean(axis=1))


def test_a_table_of_resistance_and_a_ship_without_sd():
    table = TableBaseline((0.0, 3.0, 6.0, 9.0), (0.0, 4e4, 1.5e5, 4e5), 0.0)
    bare = Ship(length_m=150.0, displaced_volume_m3=20200.0, baseline=table)
    ship = replace(bare, added_mass=replace(bare.added_mass, sd=0.0))
    coasted = study_coast(ship, coast_from(ship))
    assert {'baseline.resistance_n', 'displaced_volume_m3'} <= set(coasted.selection.kept)
    assert all(np.isnan(one.tolerable) for one in coasted.importance)


def mimics_of(ship: Ship):
    return {mimic.effect: mimic for mimic in study_coast(ship, coast_from(ship)).mimics}


def test_more_friction_is_fouling_where_nothing_else_is_viscous():
    bare = replace(CARGO.baseline, correlation_allowance=0.0)
    fouling = mimics_of(replace(CARGO, baseline=bare))['fouling']
    # as friction is nearly all there is, more of it is also less mass
    signs = {'baseline.C_V': 1.0, 'wetted_surface_m2': 1.0, 'displaced_volume_m3': -1.0}
    assert fouling.size == 0.25
    # linear about 0, where 25 per cent is large
    assert signs[fouling.value] * fouling.wrong_by == pytest.approx(0.21, abs=0.05)
    assert fouling.left < 0.02


def test_a_speed_that_is_not_known_explains_nothing_twice_and_errors_stay_in_what_may_be(coasted):
    # a log that is off and a place that is off leave what the rest of the record shows
    found = {mimic.effect: mimic for mimic in coasted.mimics}
    assert found['log_offset'].distance_sd > 1.0
    assert found['log_offset'].left > 0.9
    assert max(abs(mimic.wrong_by) for mimic in found.values()) == WORST
    assert abs(found['locked_propeller'].wrong_by) == WORST


def test_effects_that_cannot_act_or_move_nothing_are_left_out():
    found = mimics_of(replace(CARGO, propeller=None, propulsion=Propulsion(8.0)))
    assert {'locked_propeller', 'windmilling_propeller'}.isdisjoint(found)
    # she never goes as slowly as a log's dead band begins
    assert 'log_dead_band' in LIBRARY
    assert 'log_dead_band' not in found
    for mimic in found.values():
        assert np.isfinite([mimic.distance_sd, mimic.wrong_by, mimic.left]).all()


@pytest.fixture(scope='module')
def found():
    return study_coast(CARGO, coast_from(CARGO, 8.2))


def test_words_hold_the_figures(found):
    assert 'matter most are displaced_volume_m3, wetted_surface_m2, baseline.C_V' in (
        words.sentence(found)
    )
    seen = ' '.join(words.notes(found))
    assert 'from 8.20 m/s' in seen
    assert f'off by {found.check.speed_m_s:.3f} m/s' in seen
    assert 'fouling like' in seen
    assert 'log_scale like' not in seen
    assert 'leaves the table of the baseline' in seen


def test_a_row_a_value_with_dashes_where_nothing_is_known(found):
    table = words.loss_table(found)
    rows = {row[0]: row for row in table.rows}
    assert list(rows) == [*found.selection.kept, *found.selection.dropped]
    assert all(len(row) == len(table.columns) for row in table.rows)
    assert rows['length_m'][2] == rows['length_m'][6] == '-'
    assert rows['baseline.C_V'][1:3] == ('-', '2.0%')
    assert rows['air.drag_coefficient'][-2] == 'over 50%'


def test_a_row_an_effect(found):
    table = words.mimic_table(found)
    assert [row[0] for row in table.rows] == [mimic.effect for mimic in found.mimics]
    row = next(row for row in table.rows if row[0] == 'locked_propeller')
    assert row[4] == 'at least -50%'
    assert next(row for row in table.rows if row[0] == 'current')[1] == '0.4 m/s'
