# SPDX-License-Identifier: Apache-2.0
"""The final figure: exact where it can be, near the truth and honest where there is noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.steady import weighted_white_sd
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.scenario import GaussMarkov


def cut(block: Block) -> Window:
    return Window.from_block(block, int(block.stamp_ns[0]), int(block.stamp_ns[-1]))


def window(coast, n: int = 500, **noise: float) -> Window:
    return cut(coast.block(n, **noise))


def error(found: Estimate, coast, ship: Ship) -> Float64:
    curve = found.valid_curve
    return curve.resistance_m_s2 - coast.resistance(curve.speed_m_s, ship)


def test_quadratic_drag_is_found_without_noise(coast, ship) -> None:
    plain = replace(ship, added_mass=replace(ship.added_mass))
    found = estimate_final(window(coast, speed_sigma=0.0, position_sigma=0.0), plain, Parameters())
    largest = float(found.curve.resistance_m_s2.max())
    # filter, scale and offset of the log stay open: 1 % at the top
    assert np.abs(error(found, coast, ship)).max() < 0.015 * largest
    assert found.estimator == 'one'
    assert found.order is None


def test_outliers_hardly_matter(coast, ship) -> None:
    block = coast.block(500, seed=3)
    clean = estimate_final(
        Window.from_block(block, int(block.stamp_ns[0]), int(block.stamp_ns[-1])),
        ship,
        Parameters(),
    )
    rows = np.flatnonzero(block.channel == Channel.SPEED_THROUGH_WATER)
    block.value[rows[7::33], 0] += 2.0
    found = estimate_final(
        Window.from_block(block, int(block.stamp_ns[0]), int(block.stamp_ns[-1])),
        ship,
        Parameters(),
    )
    assert found.noise_sd['speed_through_water'] < 2.0 * clean.noise_sd['speed_through_water']
    largest = float(clean.curve.resistance_m_s2.max())
    assert np.sqrt(np.mean(error(found, coast, ship) ** 2)) < 0.015 * largest


def test_a_first_reading_that_is_wrong_is_not_followed(coast, ship) -> None:
    # N = 20, seeds 0..19; five of a hundred are wrong, the first among them, which powers of the
    # speed could run up to: 2.2 % measured, 1.5 % without, over 100 % if the first is followed
    largest = float(coast.resistance(np.array(coast.speed_m_s), ship))
    squares = []
    for seed in range(20):
        block = coast.block(100, seed=seed)
        rows = np.flatnonzero(block.channel == Channel.SPEED_THROUGH_WATER)
        block.value[rows[::20], 0] += 2.4
        found = estimate_final(cut(block), ship, Parameters())
        squares.append(np.mean(error(found, coast, ship) ** 2))
    assert np.sqrt(np.mean(squares)) < 0.03 * largest


def test_a_late_onset_is_found_with_all_families(coast, ship) -> None:
    # the window starts 8 s before the stop: the averaging must settle on the onset
    for seed in range(4):
        block = coast.block(500, seed=seed)
        rng = np.random.default_rng(100 + seed)
        steady_s = np.arange(-900.0, 0.0, 3.0)
        both = in_arrival_order(
            [
                Block.of(
                    Channel.SPEED_THROUGH_WATER,
                    block.stamp_ns[0] + np.round(steady_s * 1e9).astype(np.int64),
                    coast.speed_m_s + 0.05 * rng.normal(size=len(steady_s)),
                ),
                block[block.channel == Channel.SPEED_THROUGH_WATER],
            ]
        )
        start_ns = int(block.stamp_ns[0]) - 8_000_000_000
        cut = Window.from_block(
            both, start_ns, int(block.stamp_ns[-1]), before_ns=int(both.stamp_ns[0])
        )
        found = estimate_final(cut, ship, Parameters())
        away = error(found, coast, ship)
        largest = float(found.curve.resistance_m_s2.max())
        assert np.sqrt(np.mean(away**2)) < 0.03 * largest


LAG_S, LEAD_S, PACE_S = 6.0, 1000.0, 1.0


def filtered_and_wandering(coast, seed: int) -> Block:
    """Steady, then a coastdown: a log with a filter, whose noise it colours; positions wander."""
    time_s = np.arange(-LEAD_S, 700.0, PACE_S)
    rng = np.random.default_rng(seed)
    coasting = np.maximum(time_s, 0.0)
    noise = 0.02 * np.sqrt(2.0 * LAG_S / PACE_S) * rng.standard_normal(len(time_s))
    log = np.full(len(time_s), coast.speed_m_s)
    given = coast.speed(coasting) + noise
    for i in range(1, len(time_s)):
        log[i] = log[i - 1] + PACE_S / LAG_S * (given[i] - log[i - 1])
    along = np.where(time_s < 0.0, coast.speed_m_s * time_s, coast.distance(coasting))
    along = along + GaussMarkov(1.2, 120.0).sample(time_s, rng)
    along += 0.4 * rng.standard_normal(len(time_s))
    stamps = np.round((time_s + LEAD_S) * 1e9).astype(np.int64)
    return in_arrival_order(
        [
            Block.of(Channel.SPEED_THROUGH_WATER, stamps, log),
            Block.of(Channel.POSITION, stamps, np.column_stack([along, 0.0 * along])),
        ]
    )


def test_log_and_positions_are_no_worse_than_either(coast, ship) -> None:
    # N = 12, seeds 0..11: of log, of positions, of both
    start_ns = round(LEAD_S * 1e9)
    rms = []
    for seed in range(12):
        block = filtered_and_wandering(coast, seed)
        parts = [
            block[block.channel == Channel.SPEED_THROUGH_WATER],
            block[block.channel == Channel.POSITION],
            block,
        ]
        one = []
        for part in parts:
            cut = Window.from_block(part, start_ns, int(part.stamp_ns[-1]), before_ns=0)
            found = estimate_final(cut, ship, Parameters())
            largest = float(found.curve.resistance_m_s2.max())
            one.append(np.sqrt(np.mean(error(found, coast, ship) ** 2)) / largest)
        rms.append(one)
    print(np.array(rms))
    log, positions, both = np.sqrt(np.mean(np.square(rms), axis=0))
    assert both < 1.1 * min(log, positions)


def test_white_noise_is_told_from_a_smooth_signal() -> None:
    rng = np.random.default_rng(1)
    signal = 8.0 / (1.0 + 0.003 * np.arange(500.0)) + 0.05 * rng.standard_normal(500)
    signal[::40] += 3.0
    assert weighted_white_sd(signal, np.ones(len(signal))) == pytest.approx(0.05, rel=0.15)


def test_a_short_coast_over_few_speeds_is_fitted() -> None:
    # N = 12, seeds 0..11: 9 s in which a ferry slows by a fifth, read behind a filter of 0.3 s.
    # None fails, RMSE below 20 % of the largest r (18 % found: a log's offset is that of
    # ships), and +-2 sigma holds 70 % or more.
    ferry = Ship(length_m=5.0, displaced_volume_m3=1.76)
    time_s, decay = 0.05 * np.arange(181), np.exp(-0.05 / 0.3)
    stamps = np.round(time_s * 1e9).astype(np.int64)
    squares, covered = [], []
    for seed in range(12):
        slow = np.random.default_rng(seed).standard_normal(len(time_s))
        slow[1:] *= np.sqrt(1.0 - decay**2)
        for i in range(1, len(slow)):
            slow[i] += decay * slow[i - 1]
        speed = 0.13 / (1.0 + 0.13 * 0.24 * time_s)
        read = Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed + 0.003 * slow)
        curve = estimate_final(cut(read), ferry, Parameters(froude_min=0.001)).curve
        v = curve.speed_m_s
        away = curve.resistance_m_s2 - 0.24 * v**2 * (1.0 + ferry.n_r(v))
        squares.append(np.mean(away**2))
        covered.append(np.mean(np.abs(away) <= 2.0 * curve.sigma_repeatable_m_s2))
    largest = 0.24 * 0.13**2 * (1.0 + float(ferry.n_r(0.13)))
    assert np.sqrt(np.mean(squares)) < 0.2 * largest
    assert np.mean(covered) > 0.7
