# SPDX-License-Identifier: Apache-2.0
"""
What the figures are worth on a ship with wave making, over many records.

Each claim has its N, its seeds and its bound; runs are independent, the speeds
of one run are not.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.accuracy._coasts import (
    CARGO,
    CONFIG,
    YACHT,
    Case,
    Compared,
    Hull,
    coasts,
    cut,
    rms,
)
from benchmarks.accuracy._thrust_law import CASES as LAW_CASES
from benchmarks.accuracy._thrust_law import LAWS, score
from shipdrag_ros.estimation import Window, estimate, estimate_final
from shipdrag_ros.estimation.reciprocal import combine
from shipdrag_ros.estimation.record import stated_weight
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Channel, Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, Sensor, sense, simulate
from shipdrag_ros.simulation.scenario import GaussMarkov

RUNS = 60


def compared(method, name: str, *, runs: int = RUNS, **case: Any) -> Compared:
    """Run one estimator on seeds 0..runs - 1, errors in parts of the largest r."""

    def estimated(window: Window, ship: Ship, _: Parameters) -> Estimate:
        return method(window, ship, Parameters(estimator=name))

    seen = [(one.window, one.truth.ship, one.resists) for one in coasts(Case(**case), runs)]
    return Compared.of(estimated, float(seen[0][2](np.array(CARGO.speed_m_s))), seen)


def top(found: Compared) -> float:
    return rms(found.error[:, -1])


def test_the_live_figure_in_white_noise() -> None:
    # N = 60, seeds 0..59; aimed at: RMSE 1.0 %, 3.5 % at the top, 92 % held
    live = compared(estimate, 'one')
    assert live.rmse < 0.010
    assert top(live) < 0.035
    assert live.covered > 0.92
    published = compared(estimate, 's1_joint')
    assert live.rmse < 0.6 * published.rmse
    assert top(live) < 0.6 * top(published)


def test_the_final_figure_in_white_noise() -> None:
    # N = 60, seeds 0..59; aimed at: RMSE 1.0 %, 3.5 % at the top, 92 % held
    final = compared(estimate_final, 'one')
    assert final.rmse < 0.010
    assert top(final) < 0.035
    assert final.covered > 0.92


def test_the_band_holds_under_gusts_that_are_learnt() -> None:
    # N = 30, seeds 0..29; aimed at: 90 % held, the covariance learnt from 30 min before the stop;
    # a force that moves the steady ship by 0.05 m/s
    for method in (estimate, estimate_final):
        found = compared(method, 'one', runs=30, steady=True, gust_m_s=0.05)
        assert found.failed == 0
        assert found.covered > 0.90


HULLS = (('vitus_bering', 8.2, 1500.0), ('kvlcc2', 7.97, 1800.0))  # speed [m/s], coastdown [s]
LEAD_S, RATE_HZ = 1800.0, 0.5
_CHANNELS = (Channel.SPEED_THROUGH_WATER, Channel.POSITION, Channel.SHAFT)
_SPEEDS = 50

Curve = tuple[Float64, Float64, Float64]
"""Speed, r and its repeatable standard deviation."""


def scores(number: int, seed: int) -> Float64:
    """
    Return the mean logarithm of the density of the true r over the largest r.

    Of the log alone, with positions, with the shaft, and with a second run on the reciprocal
    heading; sizes and times of gusts, current and errors of the log are drawn.
    """
    rng = np.random.default_rng([seed, number])
    name, speed_m_s, duration_s = HULLS[number % len(HULLS)]
    # the air at rest is part of the ship's resistance, over ground: none, for one truth
    ship = replace(Ship.load(CONFIG / f'{name}.yaml'), air=None)
    largest = float(ship.resistance_n(speed_m_s)) / ship.mass_kg
    gust = 0.012 * largest * math.exp(0.6 * rng.standard_normal()) * ship.mass_kg
    gust_s = 150.0 * math.exp(0.6 * rng.standard_normal())
    log = GaussMarkov(0.02 * math.exp(0.6 * rng.standard_normal()), rng.uniform(20.0, 200.0))
    current_m_s = 0.3 * rng.standard_normal()

    def windows(run: int) -> list[Window]:
        scenario = Scenario(
            speed_m_s=speed_m_s,
            lead_in_s=LEAD_S,
            duration_s=duration_s,
            heading_rad=run * math.pi,
            current_m_s=(current_m_s, 0.0),
            gust_force=GaussMarkov(gust, gust_s),
            seed=int(rng.integers(2**31)),
        )
        sensors = [
            Sensor(channel=_CHANNELS[0], rate_hz=RATE_HZ, sd=0.05, coloured=log),
            Sensor(channel=_CHANNELS[1], rate_hz=RATE_HZ, sd=5.0),
            Sensor(channel=_CHANNELS[2], rate_hz=RATE_HZ, sd=0.02),
        ]
        truth, noise = simulate(ship, scenario), int(rng.integers(2**31))
        blocks = (sense(truth, sensors[:count], seed=noise) for count in (1, 2, 3))
        return [cut(block, LEAD_S, duration_s) for block in blocks]

    found = [estimate_final(each, ship, Parameters()) for each in windows(0)]
    second = estimate_final(windows(1)[-1], ship, Parameters())
    both = combine([found[-1], second], [0.0, math.pi])
    curves: list[Curve] = [
        (each.speed_m_s, each.resistance_m_s2, each.sigma_repeatable_m_s2)
        for each in (*(one.valid_curve for one in found), both)
    ]
    low, high = max(each[0][0] for each in curves), min(each[0][-1] for each in curves)
    speed = np.linspace(low, min(high, speed_m_s), _SPEEDS)
    true = np.asarray(ship.resistance_n(speed)) / ship.mass_kg
    return np.array([_log_density(each, speed, true, largest) for each in curves])


def _log_density(curve: Curve, speed: Float64, true: Float64, unit: float) -> float:
    r, sd = (np.interp(speed, curve[0], each) for each in curve[1:])
    return float(np.mean(-0.5 * ((r - true) / sd) ** 2 - np.log(sd / unit)))


def gains(found: Float64) -> list[tuple[float, float]]:
    """
    Return what each set has gained on the one before, with two standard errors.

    Parameters
    ----------
    found : (n, s)
        Scores of n cases.
    """
    steps = np.diff(found, axis=1)
    error = 2.0 * steps.std(axis=0, ddof=1) / math.sqrt(len(steps))
    return list(zip(steps.mean(axis=0).tolist(), error.tolist()))


CASES = 4


def test_no_input_and_no_second_run_makes_it_worse() -> None:
    # N = 4, seed 0; a step may lose by chance, by less than two standard errors. 0.05: the
    # shaft's priors hold all laws of the thrust, which costs a little
    found = np.array([scores(number, 0) for number in range(CASES)])
    assert np.isfinite(found).all()
    for gain, error in gains(found):
        assert gain + error > -0.05
    assert found[:, -1].mean() > found[:, 0].mean()


READINGS, GOOD, BAD = 500, 0.05, 0.3
SD = np.where(np.arange(READINGS) % 2 == 0, GOOD, BAD)
STATED_RUNS = 20  # seeds 0..19


def window(coast, seed: int, sd: Float64, stated: Float64) -> Window:
    block = coast.block(READINGS, speed_sigma=0.0, seed=seed)
    cut = Window.from_block(block, int(block.stamp_ns[0]), int(block.stamp_ns[-1]))
    noise = sd * np.random.default_rng(1000 + seed).standard_normal(READINGS)
    log = cut.speed_through_water
    return replace(
        cut, speed_through_water=replace(log, value=log.value + noise, variance=stated**2)
    )


def rmse(coast, ship: Ship, stated: Float64) -> float:
    squares = []
    for seed in range(STATED_RUNS):
        curve = estimate(window(coast, seed, SD, stated), ship, Parameters()).valid_curve
        away = curve.resistance_m_s2 - coast.resistance(curve.speed_m_s, ship)
        squares.append(np.mean(away**2))
    return float(np.sqrt(np.mean(squares)))


def test_good_readings_among_bad_ones_count_and_a_wrong_statement_does_no_harm(
    coast, ship
) -> None:
    # the readings are weighed before the estimators, live and final, part
    unknown, right, inverted = (
        rmse(coast, ship, stated) for stated in (np.full(READINGS, np.nan), SD, SD[::-1])
    )
    # measured: 1.2 % of the largest r without, 0.74 with, as with the good half alone
    assert right < 0.8 * unknown
    assert inverted < 1.05 * unknown


def test_one_variance_for_all_changes_no_bit(coast, ship) -> None:
    curves = [
        estimate(window(coast, 0, SD, stated), ship, Parameters()).curve
        for stated in (np.full(READINGS, np.nan), np.full(READINGS, 3.0))
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


LAW_RUNS = 3  # seeds 0..2
SHAFT, WITHOUT, DOUBLED = range(3)  # of LAW_CASES


@pytest.mark.parametrize(('hull', 'rmse', 'worse'), [(CARGO, 0.013, 0.0), (YACHT, 0.015, 0.005)])
def test_a_shaft_hardly_makes_r_worse(hull: Hull, rmse: float, worse: float) -> None:
    # N = 18, seeds 0 to 2 of six laws. The yacht: 1.0 % of r with a shaft, 0.6 without one, where
    # the prior of the run-down has hers as its median
    seen, unseen = (
        [score(hull, law, LAW_CASES[i], 500, LAW_RUNS) for law in LAWS] for i in (SHAFT, WITHOUT)
    )
    squares = [np.mean([one.rmse**2 for one in each]) for each in (seen, unseen)]
    assert np.sqrt(squares[0]) < rmse
    # three seeds of six laws scatter by about a sixth
    assert np.sqrt(squares[0]) < np.sqrt(1.3 * squares[1]) + worse
    assert np.mean([one.covered for one in seen]) > 0.88
    assert all(one.failed == 0 for one in seen)


def test_a_run_down_that_is_stated_twice_too_long_does_no_harm() -> None:
    found = [score(CARGO, law, LAW_CASES[DOUBLED], 500, LAW_RUNS) for law in LAWS]
    assert np.sqrt(np.mean([one.rmse**2 for one in found])) < 0.015
    assert np.mean([one.covered for one in found]) > 0.88
