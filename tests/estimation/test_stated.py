# SPDX-License-Identifier: Apache-2.0
"""Stated variances weigh as far as the scatter bears them out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.estimation import Window, estimate, estimate_final
from shipdrag_ros.estimation.record import stated_weight
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

N, GOOD, BAD = 500, 0.05, 0.3
SD = np.where(np.arange(N) % 2 == 0, GOOD, BAD)
RUNS = 20  # seeds 0..19


def window(coast, seed: int, sd: Float64, stated: Float64) -> Window:
    block = coast.block(N, speed_sigma=0.0, seed=seed)
    cut = Window.from_block(block, int(block.stamp_ns[0]), int(block.stamp_ns[-1]))
    noise = sd * np.random.default_rng(1000 + seed).standard_normal(N)
    log = cut.speed_through_water
    return replace(
        cut, speed_through_water=replace(log, value=log.value + noise, variance=stated**2)
    )


def rmse(coast, ship: Ship, estimator, stated: Float64) -> float:
    squares = []
    for seed in range(RUNS):
        found: Estimate = estimator(window(coast, seed, SD, stated), ship, Parameters())
        curve = found.valid_curve
        away = curve.resistance_m_s2 - coast.resistance(curve.speed_m_s, ship)
        squares.append(np.mean(away**2))
    return float(np.sqrt(np.mean(squares)))


@pytest.mark.parametrize('estimator', [estimate, estimate_final])
def test_good_readings_among_bad_ones_count_and_a_wrong_statement_does_no_harm(
    coast, ship, estimator
) -> None:
    unknown, right, inverted = (
        rmse(coast, ship, estimator, stated) for stated in (np.full(N, np.nan), SD, SD[::-1])
    )
    # measured: 1.2 % of the largest r without, 0.74 with, as with the good half alone
    assert right < 0.8 * unknown
    assert inverted < 1.05 * unknown


@pytest.mark.parametrize('estimator', [estimate, estimate_final])
def test_one_variance_for_all_changes_no_bit(coast, ship, estimator) -> None:
    curves = [
        estimator(window(coast, 0, SD, stated), ship, Parameters()).curve
        for stated in (np.full(N, np.nan), np.full(N, 3.0))
    ]
    assert np.array_equal(curves[0].resistance_m_s2, curves[1].resistance_m_s2)
    assert np.array_equal(curves[0].sigma_m_s2, curves[1].sigma_m_s2)


def test_the_weight_is_the_power_that_the_scatter_shows() -> None:
    rng = np.random.default_rng(0)
    time_s = np.arange(2000.0)
    sd = np.where(np.arange(2000) % 2 == 0, 0.1, 0.6)
    noise = rng.standard_normal(2000)
    for true_sd, low, high in ((sd, 25.0, 40.0), (np.sqrt(sd), 4.0, 9.0), (1.0 / sd, 1.0, 1.0)):
        weight = stated_weight(time_s, 5.0 - 1e-3 * time_s + true_sd * noise, sd**2)
        assert low <= weight[0] / weight[1] <= high
    some = np.where(time_s == 7.0, np.nan, sd**2)
    assert np.all(stated_weight(time_s, noise, some) == 1.0)
