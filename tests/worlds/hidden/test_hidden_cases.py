# SPDX-License-Identifier: Apache-2.0
"""The hidden cases share nothing with what they score, and are what they say they are."""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from benchmarks.worlds.hidden import cases
from benchmarks.worlds.hidden.effect import Leg
from benchmarks.worlds.hidden.sailing import Disturbance, World, coasting_m_s2, sail
from shipdrag_ros.ship import Ship
from tests.test_architecture import imports

FOLDER = Path(__file__).resolve().parents[3] / 'benchmarks' / 'worlds' / 'hidden'


@pytest.mark.parametrize('path', sorted(FOLDER.glob('*.py')), ids=lambda path: path.name)
def test_nothing_is_imported_from_the_package(path: Path) -> None:
    assert not [name for name in imports(path) if name.partition('.')[0] == 'shipdrag_ros']


def test_there_are_enough_of_every_kind() -> None:
    truths = [cases.reveal(number) for number in range(cases.count())]
    kinds = Counter(truth.kind for truth in truths)
    first = {truth.names for truth in truths if truth.kind == 'one' and truth.shelf == 1}
    assert len(truths) >= 900
    assert kinds['none'] >= 300
    assert kinds['outside'] >= 150
    assert kinds['pair'] >= 40
    assert len(first) >= 13
    for condition in cases.CONDITIONS:
        here = [truth for truth in truths if truth.condition == condition]
        assert {truth.names for truth in here if truth.kind == 'one'} >= first


def test_a_case_is_the_same_whenever_it_is_made() -> None:
    first = cases.observe(3)
    cases.observe(4)
    again = cases.observe(3)
    assert first.ship_file == again.ship_file
    for one, other in zip(first.runs, again.runs, strict=True):
        for name in one:
            np.testing.assert_array_equal(one[name].value, other[name].value)
            np.testing.assert_array_equal(one[name].stamp_ns, other[name].stamp_ns)


def test_the_ship_file_is_one_and_states_the_baseline_that_sails() -> None:
    seen = cases.observe(1)
    ship = Ship.from_yaml(seen.ship_file, subject='hidden')
    hull = cases._case(1).hull
    speeds = np.linspace(1.0, hull.speed_m_s, 20)
    np.testing.assert_allclose(ship.resistance_n(speeds), hull.still_n(speeds), rtol=1e-9)
    np.testing.assert_allclose(ship.n_r(speeds), hull.added_mass(speeds), rtol=1e-9)


def test_stamps_ascend_and_never_lie_ahead_of_their_arrival() -> None:
    for number in range(12):
        for run in cases.observe(number).runs:
            for series in run.values():
                assert np.all(np.diff(series.stamp_ns) > 0)
                assert np.all(series.receive_ns >= series.stamp_ns)
                assert np.all(np.isfinite(series.value))


def test_the_baseline_is_as_uncertain_as_stated_and_three_times_in_its_own_block() -> None:
    numbers = range(0, cases.count(), 3)
    worlds = {True: [], False: []}
    for number in numbers:
        misstated = cases.reveal(number).condition.misstated
        worlds[misstated].append(cases._case(number).world.friction)
    # 300 and 25 draws: the relative error of a standard deviation is below 4 % and 15 %
    assert np.std(worlds[False]) == pytest.approx(0.02, rel=0.15)
    assert np.std(worlds[True]) == pytest.approx(0.06, rel=0.45)


def test_a_case_is_made_quickly() -> None:
    cases.observe(0)
    start = time.process_time()
    for number in range(1, 11):
        cases.observe(number)
    assert time.process_time() - start < 10 * 0.2


def test_the_true_r_is_what_slows_the_ship_at_last() -> None:
    hull = cases._case(7).hull
    leg, world = Leg(hull, 1.0, 1500.0, hull.speed_m_s), World(friction=0.02, shape=(0.01,) * 4)
    motion = sail(
        leg,
        (),
        heading_rad=0.0,
        first_heading_rad=0.0,
        world=world,
        disturbance=Disturbance.none(leg),
    )
    late = motion.time_s > 20.0 * hull.run_down_s  # of the thrust 2e-9 are left
    speed = motion.surge_m_s[late]
    slowing = -np.gradient(speed, motion.time_s[late]) * (1.0 + hull.added_mass(speed))
    r = coasting_m_s2(leg, (), speed, first_heading_rad=0.0, world=world)
    np.testing.assert_allclose(slowing[1:-1], r[1:-1], rtol=1e-3)
