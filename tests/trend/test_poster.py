# SPDX-License-Identifier: Apache-2.0
"""Which runs a poster is made of."""

from pathlib import Path

from shipdrag_ros.ship import Ship
from shipdrag_ros.trend.poster import poster, write_poster
from tests.trend.conftest import row

SHIP = Ship(name='Test', length_m=80.0, displaced_volume_m3=4_000.0)


def test_copies_of_a_run_are_no_further_runs():
    rows = [row(0.0, 0.1), row(30.0, 0.3), row(60.0, 0.2)]
    found = poster(SHIP, [*rows, *(each | {'bag': 'copy'} for each in rows)])
    assert found == poster(SHIP, rows)
    assert {step.runs for step in found.steps} == {3}


def test_the_page_says_of_which_water_it_is(tmp_path: Path):
    write_poster(tmp_path / 'poster.html', [poster(SHIP, [row()])])
    assert 'in calm deep water' in (tmp_path / 'poster.html').read_text()
