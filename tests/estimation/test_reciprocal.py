# SPDX-License-Identifier: Apache-2.0
"""Runs on opposite headings: the current comes out, and what differs is said."""

from __future__ import annotations

import math
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.estimation.reciprocal import combine
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.words import combined_table
from shipdrag_ros.library.record import estimate as of
from shipdrag_ros.library.simulated import simulate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Channel
from shipdrag_ros.ship import Ship


def run(
    coast, ship, *, current_m_s: float, seed: int, log: bool, offset_m_s: float = 0.0
) -> Estimate:
    """A coastdown whose positions drift by the current along its track."""
    block = coast.block(500, position_sigma=1.0, seed=seed)
    rows = block.channel == Channel.POSITION
    time_s = (block.stamp_ns - block.stamp_ns[0]) * 1e-9
    block.value[rows] += current_m_s * time_s[rows, None] * [np.cos(0.7), np.sin(0.7)]
    block.value[~rows, 0] += offset_m_s
    if not log:
        block = block[rows]
    cut = Window.from_block(block, int(block.stamp_ns[0]), int(block.stamp_ns[-1]))
    return estimate_final(cut, ship, Parameters())


@pytest.mark.parametrize(('log', 'offset_m_s'), [(True, 0.0), (False, 0.0), (True, 0.2)])
def test_current_and_offset_are_taken_out(coast, ship, log: bool, offset_m_s: float) -> None:
    there = run(coast, ship, current_m_s=0.2, seed=1, log=log, offset_m_s=offset_m_s)
    back = run(coast, ship, current_m_s=-0.2, seed=2, log=log, offset_m_s=offset_m_s)
    both = combine([there, back], [0.7, 0.7 + math.pi])
    assert both.runs == 2
    assert both.current_m_s == pytest.approx(0.2, abs=0.05 if log else 0.1)
    assert abs(both.current_m_s - 0.2) < 1.96 * both.current_sigma_m_s
    truth = coast.resistance(both.speed_m_s, ship)
    error = both.resistance_m_s2 - truth
    assert np.sqrt(np.mean(error**2)) < (0.02 if log else 0.03) * truth.max()
    assert np.all(np.abs(error) < 1.96 * both.sigma_m_s2)


def test_runs_that_differ_widen_the_band(coast, ship) -> None:
    one = run(coast, ship, current_m_s=0.0, seed=1, log=True)
    more = replace(one, calm=replace(one.calm, resistance_m_s2=1.2 * one.calm.resistance_m_s2))
    alike = combine([one, one], [0.0, 0.0])
    apart = combine([one, more], [0.0, 0.0])
    np.testing.assert_allclose(alike.scatter_m_s2, 0.0, atol=1e-15)
    assert np.all(apart.sigma_repeatable_m_s2 > 3.0 * alike.sigma_repeatable_m_s2)
    np.testing.assert_allclose(
        apart.scatter_m_s2, 0.2 / math.sqrt(2.0) * alike.resistance_m_s2, rtol=1e-4
    )
    # the error of n_r is common to all runs and does not average out
    of_n_r = alike.sigma_m_s2**2 - alike.sigma_repeatable_m_s2**2
    expected = one.valid_calm.sigma_m_s2**2 - one.valid_calm.sigma_repeatable_m_s2**2
    np.testing.assert_allclose(of_n_r.max(), expected.max(), rtol=1e-6)


def test_what_runs_share_does_not_average_out(coast, ship) -> None:
    # the scale of her log, and what the file says of her curve, are the same in every run
    one = run(coast, ship, current_m_s=0.0, seed=1, log=True)
    eight = combine([one] * 8, [None] * 8)
    alone = one.valid_calm.sigma_repeatable_m_s2
    shared = np.minimum(one.sigma_shared_m_s2, alone)
    own = np.sqrt(alone**2 - shared**2)
    expected = np.sqrt(shared**2 + own**2 / 8.0)
    at = eight.speed_m_s, one.valid_calm.speed_m_s
    np.testing.assert_allclose(eight.sigma_repeatable_m_s2, np.interp(*at, expected), rtol=0.03)
    log_alone = replace(one, sigma_shared_m_s2=alone.copy())
    held = combine([log_alone] * 8, [None] * 8)
    np.testing.assert_allclose(held.sigma_repeatable_m_s2, np.interp(*at, alone), rtol=0.02)


def test_wind_that_is_measured_is_out_of_the_mean_though_the_depth_is_not_known() -> None:
    ship = Ship.load(resources.files('shipdrag_ros') / 'data' / 'vitus_bering.yaml')
    wind = {'head_m_s': 6.0, 'cross_m_s': 0.0}
    inputs = ('speed_through_water', 'wind_apparent')
    runs = [simulate(ship, {'wind': wind}, seed=seed, inputs=inputs) for seed in range(2)]
    found = [of(each).coastdowns[0].event.estimate for each in runs]
    assert all(each.reference.unknown == ('depth',) for each in found)
    both = combine(found, [0.0, 0.0])
    clean = ship.resistance_n(both.speed_m_s) / ship.mass_kg
    np.testing.assert_allclose(both.resistance_m_s2, clean, rtol=0.03)


def test_a_short_run_takes_nothing_from_a_long_one(coast, ship) -> None:
    one, other = (run(coast, ship, current_m_s=0.0, seed=seed, log=True) for seed in (1, 2))
    low, high = one.froude_valid
    short = replace(other, froude_valid=(0.5 * (low + high), high))
    both = combine([one, short], [0.0, 0.0])
    np.testing.assert_allclose(both.speed_m_s[[0, -1]], one.valid_calm.speed_m_s[[0, -1]])
    alone = both.speed_m_s < 0.99 * short.valid_calm.speed_m_s[0]
    assert np.isnan(both.scatter_m_s2[alone]).all()
    of_one = np.interp(both.speed_m_s, one.calm.speed_m_s, one.calm.resistance_m_s2)
    np.testing.assert_allclose(both.resistance_m_s2[alone], of_one[alone], rtol=1e-3)
    assert combined_table(both).rows[0][-1] == '-'
    # speeds that one run alone reaches say nothing of how runs differ
    less = replace(short, calm=replace(short.calm, resistance_m_s2=0.8 * one.calm.resistance_m_s2))
    apart, whole = (
        combine([one, each], [0.0, 0.0])
        for each in (less, replace(less, froude_valid=(low, high)))
    )
    top = both.speed_m_s[-2]
    part, full = (np.interp(top, c.speed_m_s, c.sigma_repeatable_m_s2) for c in (apart, whole))
    assert part == pytest.approx(full, rel=0.2)


def test_no_heading_no_current(coast, ship) -> None:
    runs = [run(coast, ship, current_m_s=0.0, seed=seed, log=False) for seed in (1, 2)]
    assert combine(runs, [None, None]).current_m_s is None


def test_a_current_that_would_part_the_ranges_is_not_that_of_the_runs(coast, ship) -> None:
    runs = [run(coast, ship, current_m_s=0.0, seed=seed, log=True) for seed in (1, 2)]
    low, high = runs[0].froude_valid
    least, most = (low + each * (high - low) for each in (0.25, 0.3))
    # as an estimator over ground that finds no current
    there, back = (
        replace(
            one,
            samples={'position': 500},
            current_m_s=None,
            current_sigma_m_s=None,
            froude_valid=valid,
        )
        for one, valid in zip(runs, ((least, high), (low, most)))
    )
    both = combine([there, back], [0.0, math.pi])
    assert both.current_m_s == pytest.approx(0.0, abs=0.15)
    truth = coast.resistance(both.speed_m_s, ship)
    assert np.all(np.abs(both.resistance_m_s2 - truth) < 0.1 * truth.max())


def test_refusals_say_why(coast, ship) -> None:
    one = run(coast, ship, current_m_s=0.0, seed=1, log=True)
    with pytest.raises(EstimationError, match='two or more'):
        combine([one], [0.0])
    low, high = one.froude_valid
    middle = 0.5 * (low + high)
    less, more = 0.999 * middle, 1.001 * middle  # a gap narrower than the grid is one
    halves = [replace(one, froude_valid=(low, less)), replace(one, froude_valid=(more, high))]
    with pytest.raises(EstimationError, match='do not overlap'):
        combine(halves, [0.0, 0.0])


def test_positions_without_a_record_before_the_stop_show_her_first_speed(coast, ship) -> None:
    for seed in (1, 2):
        found = run(coast, ship, current_m_s=0.0, seed=seed, log=False).valid_calm
        truth = coast.resistance(found.speed_m_s, ship)
        assert np.all(np.abs(found.resistance_m_s2 - truth) < 1.96 * found.sigma_m_s2)
        assert found.resistance_m_s2[-1] > 1.01 * found.resistance_m_s2[-3]
