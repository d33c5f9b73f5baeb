# SPDX-License-Identifier: Apache-2.0
"""S3's analysis of a Mariner-class ship, and what it says."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.errors import SensitivityError
from shipdrag_ros.studies.manoeuvring import FORM, Manoeuvre, mariner, steer, turn, zigzag
from shipdrag_ros.studies.sensitivity.face import coasting
from shipdrag_ros.studies.sensitivity.face import verb as words
from shipdrag_ros.studies.sensitivity.loss import CHANGES, Norm
from shipdrag_ros.studies.sensitivity.steering import (
    DESIGN,
    Observations,
    check,
    experiment,
    respond,
    study,
)

SHIP = mariner()
ZIGZAG = zigzag(15.0)


def test_a_loss_is_that_of_two_manoeuvres(steered):
    i, change = FORM.index('Nd'), CHANGES[2]
    values = SHIP.values
    values[i] *= 1.0 + change
    one, other = (steer(SHIP, ZIGZAG, v, control_s=0.0)[0] for v in (SHIP.values, values))
    length_s = SHIP.length_m / SHIP.speed_m_s
    squares = ((one.speeds[:, 0] - other.speeds[:, 0]) / SHIP.speed_m_s) ** 2
    squares += ((one.speeds[:, 1] - other.speeds[:, 1]) / SHIP.speed_m_s) ** 2
    squares += ((one.speeds[:, 2] - other.speeds[:, 2]) * length_s) ** 2
    assert len(squares) == 1200
    assert steered.losses.table[i, 2] == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-12)
    assert steered.mean_norms.table[i, 2] == pytest.approx(np.mean(np.sqrt(squares)), rel=1e-12)


def test_what_the_paper_saw_is_there_with_both_norms(steered):
    for losses in (steered.losses, steered.mean_norms):
        seen = Observations.of(losses)
        assert seen.unlike[0] < 0.01  # + and - 10 % alike
        assert seen.unlike[0] < seen.unlike[1] < 0.05  # + and - 50 % less so
        assert seen.growth == pytest.approx(5.0, abs=0.02)
        assert losses.mean.min() < 1e-4 * losses.mean.max()  # some are nearly 0
    assert steered.norms_agree


def test_a_helmsman_who_looks_now_and_then_hides_small_changes():
    seen = Observations.of(respond(SHIP, ZIGZAG, control_s=0.5).losses())
    assert seen.unlike[0] > 0.1
    assert seen.growth < 4.5


def test_twenty_four_derivatives_are_eighteen_measurements(steered):
    assert len(steered.selection.kept) == 24
    assert len(steered.selection.dropped) == 16
    assert {'Nd', 'Yv', 'Yr', 'Nr', 'Nv', 'Xu', 'Xrv', 'Xvv'} <= set(steered.selection.kept)
    assert {'Yvdd', 'Nvdd', 'Yddd', 'Yuud', 'Y0uu', 'N0uu'} <= set(steered.selection.dropped)
    assert steered.independent == 18
    assert len(steered.group_derivatives) == 29


def test_the_reduced_model_is_close_and_closer_by_measurements(steered):
    full, reduced = np.degrees(steered.check.overshoots_rad)
    np.testing.assert_allclose(full, [8.85, 7.01], rtol=0, atol=0.006)
    np.testing.assert_allclose(reduced, full, rtol=0, atol=1.0)
    by_group = np.degrees(steered.group_check.overshoots_rad[1])
    assert np.max(np.abs(by_group - full)) < 0.2 < np.max(np.abs(reduced - full))
    for name, value in steered.group_check.rms_difference.items():
        assert value < steered.check.rms_difference[name]


def test_keeping_all_changes_nothing():
    assert set(check(SHIP, FORM).rms_difference.values()) == {0.0}


def test_a_model_without_nearly_everything_still_has_an_answer():
    few = study(SHIP, ZIGZAG, keep=1)
    assert few.selection.kept == ('Nd',)
    assert len(few.check.overshoots_rad[1]) <= 2
    with pytest.raises(SensitivityError, match=r'keep is 41, expected 1\.\.40'):
        study(SHIP, ZIGZAG, keep=41)


def test_groups_change_together():
    groups = respond(SHIP, ZIGZAG, together=True)
    assert len(groups.names) == 26
    values = SHIP.values
    for name in ('Nd', 'Nud', 'Nuud'):
        values[FORM.index(name)] *= 1.1
    both = steer(SHIP, ZIGZAG, np.array([SHIP.values, values]), control_s=0.0).speeds
    scale = np.array([1.0, 1.0, 1.0 / SHIP.length_m]) * SHIP.speed_m_s
    expected = Norm.ROOT_MEAN_SQUARE.of((both[1] - both[0]) / scale)
    losses = groups.losses().table[groups.names.index('Nd')]
    assert losses[0] == pytest.approx(expected, rel=1e-9)
    halves = respond(SHIP, ZIGZAG, together=True, changes=(0.05,)).losses()
    assert halves.table[halves.names.index('Nd')][0] == pytest.approx(expected / 2.0, rel=0.1)
    alone = respond(SHIP, ZIGZAG, changes=(0.1,)).losses()
    i = FORM.index('Nd')
    assert alone.table.shape == (40, 1)
    assert alone.table[i, 0] == respond(SHIP, ZIGZAG).losses().table[i, 0]


def test_which_manoeuvre_shows_which_derivative():
    chosen: tuple[Manoeuvre, ...] = (zigzag(5.0), zigzag(35.0), turn(35.0))
    shown = experiment(SHIP, chosen)
    assert set(chosen) <= set(DESIGN)
    best = dict(zip(shown.names, shown.best))
    # the propeller's side force in the gentlest, what grows with powers of the rudder in the
    # hardest manoeuvre
    assert best['N0'] == best['Y0'] == zigzag(5.0)
    assert best['Nddd'] == best['Xdd'] == zigzag(35.0)
    single = shown.partial_contribution
    assert single.shape == (40, 3)
    assert np.all((single >= 0.0) & (single <= 1.0))
    # a steady circle is a handful of numbers, from which forty cannot be told
    assert np.median(single[:, 2]) < 1e-3 < np.median(single[:, 1])
    assert np.median(shown.partial_contribution_together) > np.median(single[:, 1])


def names(labels) -> list[str]:
    return [label.get_text() for label in labels]


def test_bars_of_kept_and_dropped_derivatives(steered):
    axis = words.ranking_picture(steered).axes[0]
    shown = [label.split()[-1] for label in names(axis.get_yticklabels())]
    assert shown == list(steered.losses.ranking)
    assert names(axis.get_yticklabels())[0] == 'yaw moment by rudder  Nd'
    kept, dropped = axis.containers
    assert (len(kept), len(dropped)) == (24, 16)
    assert kept[0].get_width() == pytest.approx(float(np.max(steered.losses.mean)))


def test_three_models_in_four_panels(steered):
    figure = words.check_picture(steered)
    assert [len(axis.lines) for axis in figure.axes] == [3, 3, 3, 3]
    legend = names(figure.legends[0].get_texts())
    assert legend == ['full', '24 derivatives kept', '18 measurements kept']
    full = figure.axes[0].lines[0].get_ydata()
    np.testing.assert_array_equal(full, np.degrees(steered.check.full.heading_rad))


def test_a_map_with_a_dot_at_the_best_manoeuvre():
    shown = experiment(mariner(), (zigzag(10.0), turn(35.0)))
    axis = words.design_picture(shown).axes[0]
    assert names(axis.get_yticklabels()) == ['zigzag:10', 'turn:35']
    dots = axis.lines[0].get_ydata()
    assert [shown.manoeuvres[int(i)] for i in dots] == list(shown.best)


def test_bars_of_values_and_of_effects(coasted):
    axis = coasting.particulars_picture(coasted).axes[0]
    order = [*coasted.selection.kept, *coasted.selection.dropped]
    assert names(axis.get_yticklabels()) == order
    wide = {bar.get_y(): bar.get_width() for bar in axis.containers[0]}
    assert wide[max(wide)] == max(wide.values())
    axis = coasting.mimic_picture(coasted).axes[0]
    assert names(axis.get_yticklabels()) == [mimic.effect for mimic in coasted.mimics]
    assert axis.texts[0].get_text().startswith(coasted.mimics[0].value)


def test_words_hold_the_figures(steered):
    assert 'of 40 derivatives 24' in words.sentence(steered)
    seen = ' '.join(words.notes(steered))
    assert '50 % costs 5.00 times 10 %' in seen
    assert 'it keeps the same 24' in seen
    assert '26 measurements: the 24 kept hold 18' in seen
    assert '5 of the dropped ones follow from a kept one' in seen
    assert 'the same 18 are 29 derivatives' in seen
    assert 'not quite the same' in ' '.join(words.notes(study(SHIP, zigzag(15.0), keep=12)))


def test_losses_are_in_the_order_of_what_is_kept(steered):
    table = words.loss_table(steered)
    assert [row[0] for row in table.rows] == list(steered.losses.ranking)
    assert [row[-2] for row in table.rows] == ['yes'] * 24 + ['no'] * 16
    row = next(row for row in table.rows if row[0] == 'Nud')
    assert row[-1] == 'Nd'
    i = steered.losses.names.index('Nud')
    assert float(row[1]) == pytest.approx(1e3 * steered.losses.table[i, 0], abs=1e-3)


def test_the_check_has_a_row_a_model_even_where_one_does_not_turn(steered):
    full, kept, by_group = words.check_table(steered).rows
    assert full[:5] == ('full', '40', '26', '8.85', '7.01')
    assert kept[:3] == ('kept', '24', '18')
    assert by_group[:3] == ('kept by measurement', '29', '18')
    assert float(by_group[-1]) < float(kept[-1])
    lone = words.check_table(study(SHIP, zigzag(15.0), keep=1)).rows[1]
    assert len(lone) == len(full)


def test_the_design_names_the_best_manoeuvre_of_each():
    shown = experiment(SHIP, (zigzag(10.0), turn(35.0)))
    table = words.design_table(shown)
    assert table.columns[1:3] == ('zigzag:10', 'turn:35')
    for row in table.rows:
        larger = 'zigzag:10' if float(row[1]) > float(row[2]) else 'turn:35'
        if row[1] != row[2]:
            assert row[3] == larger
