# SPDX-License-Identifier: Apache-2.0
"""Rows are averaged, and their noise is whitened."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from shipdrag_ros.inference.rows import (
    KIND_COUNT,
    LOG,
    MAD_TO_SD,
    POSITION,
    GaussMarkovNoise,
    Noise,
    Rows,
    bin_means,
    whiten,
)


def test_the_median_of_normal_noise_gives_its_standard_deviation() -> None:
    assert pytest.approx(1.0 / norm.ppf(0.75), rel=1e-12) == MAD_TO_SD


TIMES_S = np.array([90.0, 600.0, 50.0, 40.0])


def gauss_markov(time: np.ndarray, sd: float, time_s: float) -> np.ndarray:
    """Return the covariance of a Gauss-Markov process of first order."""
    return sd**2 * np.exp(-np.abs(time[:, None] - time[None, :]) / time_s)


def slow_noise(size: np.ndarray, time_s: np.ndarray) -> GaussMarkovNoise:
    """Return the noise of sizes and times of gust, water, log and place."""
    return GaussMarkovNoise(*np.column_stack([size, time_s]).ravel())


def whitener(rows: Rows, variance: np.ndarray, slow: GaussMarkovNoise) -> np.ndarray:
    """Return the matrix that whitens rows of a ship that answers slowly."""
    n = len(rows.time_s)
    table = np.eye(n)
    whiten(rows, table, Noise(variance, slow, np.full(n, 2e-3), np.full(n, 1.05)))
    return table.T


@pytest.mark.parametrize(('kind', 'which'), [(LOG, 2), (POSITION, 3)])
def test_the_colour_of_a_sensor_is_whitened_exactly(kind: int, which: int) -> None:
    time = np.cumsum(np.random.default_rng(1).uniform(0.5, 40.0, 60))
    rows = Rows(time, np.full(60, kind), np.zeros(60))
    size = np.zeros(4)
    size[which] = 0.7
    variance = np.full(60, 0.3)
    found = whitener(rows, variance, slow_noise(size, TIMES_S))
    covariance = gauss_markov(time, 0.7, TIMES_S[which]) + 0.3 * np.eye(60)
    np.testing.assert_allclose(found @ covariance @ found.T, np.eye(60), rtol=0, atol=1e-10)
    assert np.all(np.triu(found, 1) == 0.0)


@pytest.mark.parametrize(('kind', 'which'), [(LOG, 2), (POSITION, 3)])
def test_further_instruments_err_by_themselves(kind: int, which: int) -> None:
    time = np.cumsum(np.random.default_rng(1).uniform(0.5, 40.0, 60))
    number = np.resize([0, 1, 2, 1], 60)
    rows = Rows(time, kind + KIND_COUNT * number, np.zeros(60))
    size = np.zeros(4)
    size[which] = 0.7
    found = whitener(rows, np.full(60, 0.3), slow_noise(size, TIMES_S))
    covariance = gauss_markov(time, 0.7, TIMES_S[which]) * (number == number[:, None])
    covariance += 0.3 * np.eye(60)
    np.testing.assert_allclose(found @ covariance @ found.T, np.eye(60), rtol=0, atol=1e-10)


def test_water_that_moves_shifts_positions_by_its_integral() -> None:
    time = np.arange(0.0, 600.0, 5.0)
    n = len(time)
    rows = Rows(time, np.full(n, POSITION), np.zeros(n))
    found = whitener(rows, np.full(n, 1.0), slow_noise(np.array([0.0, 0.2, 0.0, 0.0]), TIMES_S))
    # dense: the integral of a fine process
    fine = np.arange(0.0, 595.1, 1.0)
    weights = np.array([[max(min(t - f, 1.0), 0.0) for f in fine] for t in time])
    covariance = weights @ gauss_markov(fine + 0.5, 0.2, 600.0) @ weights.T + np.eye(n)
    np.testing.assert_allclose(found @ covariance @ found.T, np.eye(n), rtol=0, atol=0.02)


def test_a_gust_moves_the_ship_and_its_position() -> None:
    """Of 400 simulated records (seed 2) the squares of whitened residuals have mean 1 +- 0.05."""
    rng = np.random.default_rng(2)
    step, rate, inertia, sd, time_s = 0.5, 2e-3, 1.05, 1e-3, 90.0
    steps = np.arange(0.0, 1200.0, step)
    gust = np.empty((400, len(steps)))
    gust[:, 0] = sd * rng.standard_normal(400)
    decay = np.exp(-step / time_s)
    for i in range(1, len(steps)):
        gust[:, i] = decay * gust[:, i - 1] + sd * np.sqrt(1 - decay**2) * rng.standard_normal(400)
    # long before, so that the speed is in its stationary state
    speed = np.zeros(400)
    for _ in range(2):
        for i in range(len(steps)):
            speed += step * (gust[:, i] / inertia - rate * speed)
    path = np.zeros(400)
    seen = []
    for i in range(len(steps)):
        if i % 40 == 0:
            seen.append(path + rng.standard_normal(400) * 0.5)
        path = path + step * speed
        speed = speed + step * (gust[:, i] / inertia - rate * speed)
    rows = Rows(steps[::40], np.full(len(seen), POSITION), np.zeros(len(seen)))
    table = np.array(seen).T.copy()
    n = len(seen)
    gusts = GaussMarkovNoise(gust_m_s2=sd, gust_s=time_s)
    whiten(rows, table, Noise(np.full(n, 0.25), gusts, np.full(n, rate), np.full(n, inertia)))
    # the first rows show whether the beginning is stationary; the chain above is only nearly so
    assert np.mean(table[:, 5:] ** 2) == pytest.approx(1.0, abs=0.05)


def test_a_gust_reaches_position_as_far_as_speed_carries_it() -> None:
    """Speed and position that are known together: 600 records, seed 4; squares 1 +- 0.05."""
    rng = np.random.default_rng(4)
    step, rate, inertia, sd, time_s, apart = 0.25, 2e-2, 1.05, 1e-2, 30.0, 12.0
    decay, runs = np.exp(-step / time_s), 600
    gust = sd * rng.standard_normal(runs)
    speed, path, seen = np.zeros(runs), np.zeros(runs), []
    for i in range(round(1000.0 / step)):
        if i == round(480.0 / step):
            path[:] = 0.0
        if i >= round(480.0 / step) and i % round(apart / step) == 0:
            # both are nearly exact: what a step adds to one must be what it adds to the other
            seen += [
                speed + 0.01 * rng.standard_normal(runs),
                path + 0.05 * rng.standard_normal(runs),
            ]
        push = 0.5 * gust / inertia
        gust = decay * gust + sd * np.sqrt(1 - decay**2) * rng.standard_normal(runs)
        push += 0.5 * gust / inertia
        before = speed
        speed = speed + step * (push - rate * speed)
        path += 0.5 * step * (before + speed)
    n = len(seen) // 2
    kind, variance = np.tile([LOG, POSITION], n), np.tile([1e-4, 2.5e-3], n)
    rows = Rows(np.repeat(apart * np.arange(n), 2), kind, np.zeros(2 * n))
    table = np.array(seen).T.copy()
    slow = GaussMarkovNoise(gust_m_s2=sd, gust_s=time_s)
    whiten(rows, table, Noise(variance, slow, np.full(2 * n, rate), np.full(2 * n, inertia)))
    assert np.mean(table[:, 4::2] ** 2) == pytest.approx(1.0, abs=0.05)
    assert np.mean(table[:, 5::2] ** 2) == pytest.approx(1.0, abs=0.05)


@given(st.lists(st.floats(0.0, 99.0), min_size=1, max_size=50))
def test_bins_hold_the_mean_of_what_falls_into_them(times: list[float]) -> None:
    time = np.array(times)
    value = np.column_stack([2.0 * time, time**2])
    edges = np.arange(0.0, 101.0, 10.0)
    found_s, found, count = bin_means(time, value, edges)
    assert count.sum() == len(time)
    np.testing.assert_allclose(found[:, 0], 2.0 * found_s, rtol=1e-9, atol=1e-9)
    for mean_s, mean, number in zip(found_s, found, count, strict=True):
        inside = np.searchsorted(edges, time) == np.searchsorted(edges, mean_s)
        if number == inside.sum():
            np.testing.assert_allclose(mean[1], (time[inside] ** 2).mean(), rtol=1e-9, atol=1e-9)
