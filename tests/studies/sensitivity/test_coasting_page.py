# SPDX-License-Identifier: Apache-2.0
"""What is said of a ship file is what was found."""

from __future__ import annotations

import pytest

from shipdrag_ros.studies.sensitivity.coast import coast_from
from shipdrag_ros.studies.sensitivity.coasting import study_coast
from shipdrag_ros.studies.sensitivity.face import coasting as words
from tests.runs import CARGO as SHIP


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
    assert [row[0] for row in table.rows] == [mimic.effect.name for mimic in found.mimics]
    row = next(row for row in table.rows if row[0] == 'locked_propeller')
    assert row[4] == 'at least -50%'
    assert next(row for row in table.rows if row[0] == 'current')[1] == '0.4 m/s'
