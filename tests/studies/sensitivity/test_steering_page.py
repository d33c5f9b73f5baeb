# SPDX-License-Identifier: Apache-2.0
"""What is said of derivatives is what was steered."""

from __future__ import annotations

import pytest

from shipdrag_ros.studies.manoeuvring.ship import mariner
from shipdrag_ros.studies.manoeuvring.simulate import turn, zigzag
from shipdrag_ros.studies.sensitivity.face import steering as words
from shipdrag_ros.studies.sensitivity.steering import experiment, study

SHIP = mariner()


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
