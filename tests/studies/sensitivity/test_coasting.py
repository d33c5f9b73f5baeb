# SPDX-License-Identifier: Apache-2.0
"""Which values of a ship file must be known well."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship import Propulsion, Ship, StatedEffect, TableBaseline
from shipdrag_ros.simulation import simulate
from shipdrag_ros.simulation.effects import LIBRARY
from shipdrag_ros.studies.sensitivity.coasting import WORST, coast_from, study_coast
from shipdrag_ros.studies.sensitivity.face import coasting as words
from tests.runs import CARGO
from tests.runs import CARGO as SHIP

CONFIG = Path(__file__).resolve().parents[3] / 'config'


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


def test_too_large_a_change_is_left_out_and_so_is_its_share_of_all_means():
    coasted = study_coast(CARGO, coast_from(CARGO, 8.2))
    length = of(coasted, 'length_m')
    assert np.isnan(length[3])  # half as long, the Froude number leaves the baseline
    np.testing.assert_allclose(coasted.mean, coasted.losses.table[:, :3].mean(axis=1))


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
    return study_coast(SHIP, coast_from(SHIP, 8.2))


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
