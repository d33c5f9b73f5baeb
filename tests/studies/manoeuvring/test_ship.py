# SPDX-License-Identifier: Apache-2.0
"""The values that come with the package."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.studies.manoeuvring.ship import FORM, mariner


def test_the_form_has_forty_derivatives_and_the_file_a_value_of_each():
    ship = mariner()
    assert [sum(name[0] == axis for name in FORM) for axis in 'XYN'] == [10, 15, 15]
    assert set(ship.viscous) == set(FORM)
    np.testing.assert_array_equal(ship.values, [ship.viscous[name] for name in FORM])


def test_fourteen_are_exact_multiples_of_others_and_belong_to_the_same_force():
    ship = mariner()
    assert len(ship.multiples) == 14
    for name, other in ship.multiples.items():
        ratio = ship.viscous[name] / ship.viscous[other]
        assert name[0] == other[0]
        assert ratio == pytest.approx(round(ratio), rel=1e-12)
    assert len(ship.groups) == 26
    assert sorted(sum(ship.groups, ())) == sorted(FORM)


def test_a_published_table_has_the_same_values():
    folder = os.environ.get('SHIPDRAG_DATA')
    if not folder:
        pytest.skip('SHIPDRAG_DATA is not set')
    ship = mariner()
    stated = {**ship.viscous, **vars(ship.inertial)}
    with (Path(folder) / 'mariner_derivatives.csv').open(encoding='utf-8') as file:
        table = {
            row['derivative']: float(row['value']) * float(row['unit_factor'])
            for row in csv.DictReader(file)
        }
    assert set(table) == set(stated)
    for name, value in table.items():
        assert stated[name] == pytest.approx(value, rel=1e-12), name
