# SPDX-License-Identifier: Apache-2.0
"""A run file stands beside its bag, and overrides the ship file for that run."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shipdrag_ros.errors import ShipFileError
from shipdrag_ros.ship import Fact, RunSheet, Ship
from shipdrag_ros.ship.run_sheet import kinematic_viscosity

SHIP = Ship(length_m=80.0, displaced_volume_m3=4000.0, breadth_m=13.0, draught_m=5.5)
SHEET = """
facts: [calm]
draught_m: 6.0
displaced_volume_m3: 4400
water: {temperature_c: 25, density: 1010}
"""


def test_what_is_stated_of_a_run_overrides_the_ship_file() -> None:
    sheet = RunSheet.from_yaml(SHEET, subject='run.yaml')
    ship = sheet.of(replace(SHIP, facts=(Fact('calm', rate=0.3),)), subject='run.yaml')
    assert sheet.facts == ship.facts == (Fact('calm'),)
    assert (ship.draught_m, ship.displaced_volume_m3) == (6.0, 4400.0)
    assert ship.water.density_kg_m3 == 1010.0
    assert ship.water.kinematic_viscosity_m2_s == kinematic_viscosity(25.0, 1010.0)
    was = replace(ship, draught_m=5.5, displaced_volume_m3=4000.0, water=SHIP.water, facts=())
    assert was == SHIP
    assert RunSheet().of(SHIP, subject='none') == SHIP


@pytest.mark.parametrize(
    ('temperature_c', 'density', 'expected'),
    # ITTC 7.5-02-01-03: fresh and sea water
    [(15.0, 999.1, 1.1386e-6), (15.0, 1026.0, 1.1892e-6), (5.0, 1027.7, 1.5617e-6)],
)
def test_viscosity_is_that_of_the_tables(temperature_c, density, expected):
    assert kinematic_viscosity(temperature_c, density) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(
    ('text', 'wrong'),
    [
        ('{speed: 3}', 'speed: unknown key'),
        ('{draught_m: deep}', "draught_m: 'deep', expected a number"),
        ('{facts: [fog]}', "'fog' is no known fact"),
        ('{water: {density: 1000, density_kg_m3: 1025}}', 'keep one'),
        ('[1]', 'expected the keys'),
        ('{', 'not YAML'),
    ],
)
def test_a_wrong_run_file_says_what_is_wrong(text: str, wrong: str) -> None:
    with pytest.raises(ShipFileError) as refused:
        RunSheet.from_yaml(text, subject='run.yaml')
    assert wrong in str(refused.value)


def test_a_volume_that_cannot_be_hers_is_refused() -> None:
    with pytest.raises(ShipFileError, match=r'run\.yaml'):
        RunSheet(displaced_volume_m3=40.0).of(SHIP, subject='run.yaml')
