# SPDX-License-Identifier: Apache-2.0
"""
What the figures are worth on a ship with wave making, over many records.

Each claim has its N, its seeds and its bound; runs are independent, the speeds
of one run are not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks.accuracy import more_information as script
from benchmarks.accuracy._thrust_law import CARGO, LAWS, YACHT, Hull, score
from benchmarks.accuracy._thrust_law import CASES as LAW_CASES
from shipdrag_ros.estimation import Window, estimate, estimate_final
from shipdrag_ros.estimation.record import stated_weight
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Channel, Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS, Scenario, Sensor, Truth, sense, simulate
from shipdrag_ros.simulation.scenario import GaussMarkov

CONFIG = Path(__file__).parents[2] / 'config'
SPEED, SPAN_S, STEADY_S, N = 8.2, 1500.0, 1800.0, 500
LOG_SD, POSITION_SD = 0.05, 10.0
RUNS = 60


@dataclass(frozen=True)
class Errors:
    """Of r, in parts of the largest r; whether the band holds it; (runs, speeds)."""

    error: Float64
    held: np.ndarray

    @property
    def rmse(self) -> float:
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def top(self) -> float:
        return float(np.sqrt(np.mean(self.error[:, -1] ** 2)))


@cache
def cargo_ship() -> Ship:
    return replace(Ship.load(CONFIG / 'vitus_bering.yaml'), propulsion=None)


def record(truth: Truth, seed: int) -> Window:
    start_s = truth.scenario.lead_in_s
    rate_hz = (N - 1 + 1e-6) / SPAN_S
    sensors = [
        Sensor(channel=Channel.SPEED_THROUGH_WATER, rate_hz=rate_hz, sd=LOG_SD),
        Sensor(channel=Channel.POSITION, rate_hz=rate_hz, sd=POSITION_SD),
    ]
    start_ns = START_NS + round(start_s * 1e9)
    return Window.from_block(
        sense(truth, sensors, seed=seed),
        start_ns,
        start_ns + round(SPAN_S * 1e9),
        before_ns=START_NS if start_s else None,
    )


def errors(method, name: str, *, gust_n: float = 0.0, runs: int = RUNS) -> Errors:
    """Run one estimator on seeds 0..runs - 1; a gust comes with the record before the stop."""
    ship, found, held = cargo_ship(), [], []
    largest = float(ship.resistance_n(SPEED)) / ship.mass_kg
    truth = None
    for seed in range(runs):
        if truth is None or gust_n:
            scenario = Scenario(
                speed_m_s=SPEED,
                lead_in_s=STEADY_S if gust_n else 0.0,
                duration_s=SPAN_S,
                gust_force=GaussMarkov(gust_n, 300.0) if gust_n else None,
                seed=seed,
            )
            truth = simulate(ship, scenario)
        curve = method(record(truth, seed), ship, Parameters(estimator=name)).valid_curve
        speed = np.linspace(curve.speed_m_s[0], curve.speed_m_s[-1], 200)
        r = np.interp(speed, curve.speed_m_s, curve.resistance_m_s2)
        sigma = np.interp(speed, curve.speed_m_s, curve.sigma_repeatable_m_s2)
        off = r - truth.specific_resistance(np.minimum(speed, SPEED))
        found.append(off / largest)
        held.append(np.abs(off) <= 2.0 * sigma)
    return Errors(np.array(found), np.array(held))


def test_the_live_figure_in_white_noise() -> None:
    # N = 60, seeds 0..59; aimed at: RMSE 1.0 %, 3.5 % at the top, 92 % held
    live = errors(estimate, 'one')
    assert live.rmse < 0.010
    assert live.top < 0.035
    assert live.held.mean() > 0.92
    published = errors(estimate, 's1_joint')
    assert live.rmse < 0.6 * published.rmse
    assert live.top < 0.6 * published.top


def test_the_final_figure_in_white_noise() -> None:
    # N = 60, seeds 0..59; aimed at: RMSE 1.0 %, 3.5 % at the top, 92 % held
    final = errors(estimate_final, 'one')
    assert final.rmse < 0.010
    assert final.top < 0.035
    assert final.held.mean() > 0.92


def test_the_band_holds_under_gusts_that_are_learnt() -> None:
    # N = 30, seeds 0..29; aimed at: 90 % held, the covariance learnt from 30 min before the stop
    ship = cargo_ship()
    # a force that moves the steady ship by 0.05 m/s
    slope = float(ship.resistance_n(1.01 * SPEED) - ship.resistance_n(0.99 * SPEED))
    inertia = 1.0 + float(ship.n_r(SPEED))
    damping = slope / (0.02 * SPEED) / ship.mass_kg / inertia
    gust_n = 0.05 * inertia * np.sqrt(damping * (damping + 1.0 / 300.0)) * ship.mass_kg
    for method in (estimate, estimate_final):
        found = errors(method, 'one', gust_n=gust_n, runs=30)
        assert found.held.mean() > 0.90


CASES = 4


def test_no_input_and_no_second_run_makes_it_worse() -> None:
    # N = 4, seed 0; a step may lose by chance, by less than two standard errors; the benchmark
    # N = 4, seed 0; a step may lose by chance, by less than two standard errors; the benchmark
    # has N = 30. 0.05: the shaft's priors hold all laws of the thrust, which costs a little
    found = np.array([script.scores(number, 0) for number in range(CASES)])
    assert np.isfinite(found).all()
    for gain, error in script.gains(found):
        assert gain + error > -0.05
    assert found[:, -1].mean() > found[:, 0].mean()


def test_gains_are_those_of_the_same_case() -> None:
    # the second set gains 1 and 3 on the first, the third nothing on the second
    (first, of_first), (second, of_second) = script.gains(
        np.array([[0.0, 1.0, 1.0], [10.0, 13.0, 13.0]])
    )
    assert first == pytest.approx(2.0)
    assert of_first == pytest.approx(2.0)
    assert (second, of_second) == (0.0, 0.0)


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
