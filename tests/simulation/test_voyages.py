# SPDX-License-Identifier: Apache-2.0
"""Hulls that foul, and the runs that show it."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.voyages import (
    DAY_NS,
    FLEET_START_NS,
    Fate,
    HullChange,
    HullHistory,
    plan_fleet,
)
from tests.runs import CARGO as PATTERN

YEAR = 365.25


def test_friction_grows_is_cleaned_and_grows_on() -> None:
    changes = (
        HullChange(YEAR, 'cleaning', known=True, keeps=0.25),
        HullChange(1.5 * YEAR, 'idle', known=False, adds=0.1),
        HullChange(2 * YEAR, 'docking', known=True, keeps=0.0, growth=0.5),
    )
    history = HullHistory(0.1, 0.2, changes)
    years = (0.0, 0.999999, 1.0, 1.5, 2.0, 3.0)
    found = [history.added_friction(year * YEAR) for year in years]
    np.testing.assert_allclose(found, [0.1, 0.3, 0.075, 0.275, 0.0, 0.1], atol=1e-6)


def test_a_plan_is_its_seed() -> None:
    one, same, other = (
        plan_fleet(PATTERN, ships=2, months=6, every_days=7, seed=seed) for seed in (1, 1, 2)
    )
    assert one == same
    assert one != other
    # a ship does not depend on how many others there are
    assert plan_fleet(PATTERN, ships=1, months=6, every_days=7, seed=1)[0] == one[0]


def test_some_changes_are_written_down_and_some_are_not() -> None:
    plan = plan_fleet(PATTERN, ships=3, months=12, every_days=7, seed=0)
    kinds = {(change.kind, change.known) for each in plan for change in each.history.changes}
    assert kinds == {('cleaning', True), ('cleaning', False), ('idle', False), ('docking', True)}
    assert len({each.ship.name for each in plan}) == 3
    for each in plan:
        assert all(0 < change.day < 360 for change in each.history.changes)
        assert len(each.runs) == 52
        days = [(run.start_ns - FLEET_START_NS) / DAY_NS for run in each.runs]
        assert all(0 <= day - 7 * number <= 1 for number, day in enumerate(days))


def test_few_files_meet_a_misfortune_and_none_where_that_is_asked() -> None:
    plan = plan_fleet(PATTERN, ships=20, months=12, every_days=7, seed=0)
    fates = Counter(run.fate for each in plan for run in each.runs)
    assert set(fates) == set(Fate)
    assert fates[Fate.SOUND] == pytest.approx(0.88 * fates.total(), rel=0.02)
    sound = plan_fleet(PATTERN, ships=2, months=12, every_days=7, seed=0, sound=True)
    assert {run.fate for each in sound for run in each.runs} == {Fate.SOUND}


def test_a_run_is_the_fouled_ship_of_that_day_by_the_clock_on_board() -> None:
    (planned,) = plan_fleet(PATTERN, ships=1, months=1, every_days=28, seed=3, sound=True)
    run = planned.runs[0]
    speed = np.linspace(3.0, 8.0, 5)
    added = run.fouled().resistance_n(speed) / run.ship.resistance_n(speed) - 1.0
    # friction is most of the resistance of this form, and all of it carries the scatter
    assert np.all((0.6 * run.added_friction < added) & (added < 1.1 * run.added_friction + 0.05))
    block = run.samples()
    assert block.stamp_ns[0] == run.start_ns
    log = block.value[block.channel == Channel.SPEED_THROUGH_WATER, 0][:300]
    expected = run.log_factor * run.scenario.speed_m_s
    assert log.mean() == pytest.approx(expected, abs=0.05)


def test_a_wrong_clock_stamps_another_date() -> None:
    plan = plan_fleet(PATTERN, ships=9, months=12, every_days=7, seed=0)
    wrong = [run for each in plan for run in each.runs if run.fate is Fate.WRONG_CLOCK]
    assert wrong
    assert {run.stamped_ns for run in wrong} == {946_684_800_000_000_000}


def test_a_pattern_without_coefficients_is_refused() -> None:
    bare = Ship.from_yaml('{length_m: 80.0, displaced_volume_m3: 4000.0}', subject='bare')
    with pytest.raises(SimulationError, match='no baseline of coefficients'):
        plan_fleet(bare, ships=1, months=1, every_days=7, seed=0)
