# SPDX-License-Identifier: Apache-2.0
"""Estimators that disagree, and correlated residuals widen the band and are said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.estimation import Window, estimate, estimate_final, ode_fit
from shipdrag_ros.estimation.agreement import widened
from shipdrag_ros.estimation.ode_fit.batch_means import batch_means
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.simulation.noise import GaussMarkov


def cut(block: Block) -> Window:
    return Window.from_block(block, int(block.stamp_ns[0]), int(block.stamp_ns[-1]))


def test_a_second_estimate_that_is_far_off_is_in_the_band(coast, ship) -> None:
    window = cut(coast.block(500))
    found = ode_fit.estimate(window, ship, Parameters())
    other = estimate(window, ship, Parameters())
    assert widened(found, other, np.inf) is found
    twice = replace(
        other, curve=replace(other.curve, resistance_m_s2=2.0 * other.curve.resistance_m_s2)
    )
    wide = widened(found, twice, np.inf)
    assert 'two estimators disagree' in wide.notes[-1]
    middle = len(wide.curve) // 2
    r, sigma = wide.curve.resistance_m_s2, wide.curve.sigma_repeatable_m_s2
    np.testing.assert_array_equal(r, found.curve.resistance_m_s2)
    assert sigma[middle] == pytest.approx(r[middle], rel=0.2)
    assert wide.max_relative_sigma > 0.3
    # where the other is not compared the band stays
    low = widened(found, twice, 4.0).curve
    above = found.curve.speed_m_s > 8.0
    assert low.sigma_repeatable_m_s2[-1] >= found.curve.sigma_repeatable_m_s2[-1]
    assert np.all(low.resistance_m_s2[above] == r[above])


def test_clean_records_are_left_alone(coast, ship) -> None:
    # seeds 0..19; of 1000 clean coastdowns of the benchmarks 1 was flagged
    for seed in range(20):
        found = estimate_final(cut(coast.block(300, seed=seed)), ship, Parameters())
        assert not any('disagree' in note for note in found.notes)


def test_independent_residuals_are_not_inflated_and_slow_ones_are() -> None:
    # N = 400, seed 0: at most 2 % false alarms
    rng = np.random.default_rng(0)
    false = sum(batch_means(rng.standard_normal(500)).inflation > 1.0 for _ in range(400))
    assert false <= 8
    time_s = 3.0 * np.arange(500)
    slow = GaussMarkov(1.0, 60.0).sample(time_s, rng) + rng.standard_normal(500)
    assert batch_means(slow).inflation > 4.0


def test_a_log_that_errs_slowly_widens_the_band_and_is_said(coast, ship) -> None:
    # N = 20, seeds 0..19: the share of the range inside +-2 sigma is 0.84 (0.5 if not widened)
    covered, said = [], 0
    for seed in range(20):
        block = coast.block(500, seed=seed)
        rows = np.flatnonzero(block.channel == Channel.SPEED_THROUGH_WATER)
        time_s = (block.stamp_ns[rows] - block.stamp_ns[0]) * 1e-9
        block.value[rows, 0] += GaussMarkov(0.05, 60.0).sample(time_s, np.random.default_rng(seed))
        found = estimate_final(cut(block), ship, Parameters())
        curve = found.valid_curve
        away = curve.resistance_m_s2 - coast.resistance(curve.speed_m_s, ship)
        covered.append(np.mean(np.abs(away) <= 2.0 * curve.sigma_repeatable_m_s2))
        said += any('slow disturbances learnt' in note for note in found.notes)
    assert said >= 18
    assert np.mean(covered) > 0.7
