# SPDX-License-Identifier: Apache-2.0
"""The values that come with the package, and how they are read."""

from __future__ import annotations

import csv
import os
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.errors import ShipFileError
from shipdrag_ros.studies.manoeuvring.ship import FORM, SteeredShip, mariner

TEXT = files('shipdrag_ros').joinpath('data', 'mariner.yaml').read_text(encoding='utf-8')


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


@pytest.mark.parametrize(
    ('old', 'new', 'message'),
    [
        ('  Xuu: -110.0e-5\n', '', 'Xuu missing or unknown'),
        ('  Xuu:', '  Xu4:', 'Xu4, Xuu missing or unknown'),
        ('mass: 798.0e-5', 'mass: 798', 'mass: 798, expected'),
        ('lag_s: 1.0', 'lag_s: 0', 'rudder.lag_s: 0'),
        ('  Xudd: Xdd', '  Xudd: 3', 'multiples.Xudd: 3'),
    ],
)
def test_a_file_that_cannot_be_used_is_told_by_its_key(old, new, message):
    assert old in TEXT
    with pytest.raises(ShipFileError, match=message):
        SteeredShip.from_yaml(TEXT.replace(old, new), subject='changed')
