# SPDX-License-Identifier: Apache-2.0
"""What is learnt of the noise, and what is not."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.inference.learning import KEPT, Seen, learn, of_steady, prior
from shipdrag_ros.inference.rows import (
    LOG,
    OVER_GROUND,
    POSITION,
    NoisePosterior,
    Rows,
    noise_of,
    whiten,
)
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.scenario import GaussMarkov

RATE, INERTIA, SPEED = 7e-3, 1.1, 8.0


def steady(value: Float64, time_s: Float64, sd: float, kind: int = LOG) -> Seen:
    rows = Rows(time_s, np.full(len(time_s), kind), value)
    return of_steady(rows, np.full(len(time_s), sd**2), RATE, INERTIA)


def spread(found: NoisePosterior) -> float:
    """Standard deviation of the logarithm of the size of what the log shows."""
    log, gust = found.settings.slow[:, 4], found.settings.slow[:, 0]
    total = np.log(np.hypot(log, gust / INERTIA / RATE))
    mean = found.settings.weight @ total
    return float(np.sqrt(found.settings.weight @ (total - mean) ** 2))


def test_a_wandering_log_is_learnt_and_a_quiet_one_found_quiet() -> None:
    """N = 20, seeds 0..19; the median of the typical size within 0.6 .. 1.7 of the true one."""
    time_s = np.arange(5.0, 1800.0, 10.0)
    sd = 0.02
    ratio, quiet = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        white = 8.0 + sd * rng.standard_normal(len(time_s))
        wander = GaussMarkov(0.05, 200.0).sample(time_s, rng)
        for value, found in ((white + wander, ratio), (white, quiet)):
            slow = learn(steady(value, time_s, sd), SPEED).slow
            # in a log alone the same wander may be a force
            by_gust = slow.gust_m_s2 / INERTIA / np.sqrt(RATE * (RATE + 1.0 / slow.gust_s))
            found.append(np.hypot(slow.log_m_s, by_gust) / 0.05)
    assert 0.6 < np.median(ratio) < 1.7
    # not shown is not none, but well below the white noise of a row
    assert 0.0 < np.median(quiet) < 0.3


def test_a_longer_record_leaves_less_doubt() -> None:
    """N = 8, seeds 0..7: the spread of sizes over settings."""
    found = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        time_s = np.arange(0.0, 7200.0, 15.0)
        value = 8.0 + GaussMarkov(0.05, 60.0).sample(time_s, rng)
        value += 0.01 * rng.standard_normal(len(time_s))
        part = len(time_s) // 12
        found.append(
            [
                spread(learn(steady(value[:n], time_s[:n], 0.01), SPEED))
                for n in (part, len(time_s))
            ]
        )
    short, long = np.median(found, axis=0)
    assert long < 0.7 * short


def test_a_short_record_is_mostly_the_prior_and_says_so() -> None:
    time_s = np.arange(0.0, 280.0, 10.0)
    value = 8.0 + 0.02 * np.random.default_rng(0).standard_normal(len(time_s))
    seen = steady(value, time_s, 0.02)
    found, before = learn(seen, SPEED), prior(seen, SPEED)
    assert not found.learnt
    assert not before.learnt
    # sizes that a quiet record makes impossible weigh little
    assert found.slow.log_m_s < before.slow.log_m_s


def test_what_no_setting_explains_is_given_the_settings_of_the_prior() -> None:
    time_s = np.arange(0.0, 900.0, 10.0)
    value = np.full(len(time_s), np.nan)
    found = learn(steady(value, time_s, 0.02), SPEED)
    assert not found.learnt
    assert np.all(np.isfinite(found.settings.slow))


def test_settings_are_few_and_weighed_and_always_the_same() -> None:
    rng = np.random.default_rng(1)
    time_s = np.arange(0.0, 1800.0, 15.0)
    seen = steady(8.0 + 0.02 * rng.standard_normal(len(time_s)), time_s, 0.02)
    found, again = learn(seen, SPEED), learn(seen, SPEED)
    weight = found.settings.weight
    assert weight.sum() == pytest.approx(1.0)
    assert 5 < len(weight) <= KEPT
    assert np.all(np.diff(weight) <= 0.0)
    for one, other in zip(found.settings, again.settings):
        np.testing.assert_array_equal(one, other)


def test_sources_that_no_input_shows_are_off() -> None:
    time_s = np.arange(0.0, 900.0, 10.0)
    rng = np.random.default_rng(2)
    value = 8.0 + 0.02 * rng.standard_normal(len(time_s))
    log = learn(steady(value, time_s, 0.02), SPEED).slow
    assert log.water_m_s == log.place_m == 0.0 < min(log.log_m_s, log.gust_m_s2)
    place = learn(steady(8.0 * time_s, time_s, 5.0, POSITION), SPEED).slow
    assert place.log_m_s == 0.0 < min(place.place_m, place.water_m_s)
    # without a log, a log's noise is that of the speed over ground
    ground = learn(steady(value, time_s, 0.02, OVER_GROUND), SPEED).slow
    assert ground.place_m == 0.0 < min(ground.log_m_s, ground.water_m_s)


def test_an_engine_that_holds_damps_the_steady_rows_alone() -> None:
    time_s = np.arange(0.0, 900.0, 10.0)
    seen = steady(np.full(len(time_s), 8.0), time_s, 0.02)
    settings = prior(seen, SPEED).typical
    noise = noise_of(settings, 0, seen.rows, seen.noise, 50)
    np.testing.assert_allclose(noise.damping_1_s[:50], settings.hold[0] * RATE)
    np.testing.assert_array_equal(noise.damping_1_s[50:], RATE)


def test_wander_of_speed_over_ground_is_whitened_where_there_is_no_log() -> None:
    time_s = np.array([0.0, 4.0, 9.0, 30.0])
    rows = Rows(time_s, np.full(4, OVER_GROUND), np.arange(4.0))
    seen = of_steady(rows, np.full(4, 0.1), 0.01, 1.0)
    settings = prior(seen, SPEED).typical
    slow = settings.slow[0].copy()
    slow[:] = 0.0, 60.0, 0.2, 500.0, 0.3, 20.0, 0.0, 60.0
    settings = settings._replace(slow=slow[None], white=np.ones((1, 3)))
    apart = np.abs(time_s[:, None] - time_s)
    covariance = 0.09 * np.exp(-apart / 20.0) + 0.04 * np.exp(-apart / 500.0) + 0.1 * np.eye(4)
    table = rows.value.reshape(1, -1).copy()
    log_det = whiten(rows, table, noise_of(settings, 0, rows, seen.noise, 0))
    expected = rows.value @ np.linalg.inv(covariance) @ rows.value
    assert float((table**2).sum()) == pytest.approx(expected, rel=1e-12)
    assert log_det == pytest.approx(np.linalg.slogdet(covariance)[1], rel=1e-12)
