# SPDX-License-Identifier: Apache-2.0
"""One linearisation for all priors gives what fits under each would give."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.estimation.ode_fit.averaging import Disturbed, average
from shipdrag_ros.estimation.ode_fit.coast import EXTRAS, V0, predict
from shipdrag_ros.estimation.ode_fit.families import Priors
from shipdrag_ros.estimation.ode_fit.law import Law
from shipdrag_ros.estimation.ode_fit.solve import fit
from shipdrag_ros.inference.noise import WHITE, GaussMarkovNoise, Noise
from shipdrag_ros.inference.rows import LOG, Rows
from shipdrag_ros.inference.settings import SENSORS_ALONE, Settings
from shipdrag_ros.samples import Float64

POWERS = np.array([1, 2, 3, 4])
LAW = Law(POWERS, 8.0, 0.0, np.array([0.05]))
GRID_S = np.linspace(0.0, 1500.0, 73)
N = 400


@pytest.fixture
def rows() -> Rows:
    time_s = np.linspace(0.0, 1500.0, N)
    kind = np.full(N, LOG)
    truth = np.array([0.0, 0.03, 0.01, 0.0, 8.0, *np.zeros(EXTRAS - 1)])
    empty = Rows(time_s, kind, np.zeros(N))
    _, speed = predict(LAW, truth, GRID_S, empty, np.zeros(0, np.int64))
    noise = 0.05 * np.random.default_rng(0).standard_normal(N)
    return Rows(time_s, kind, speed + noise)


def averaged(
    rows: Rows,
    precision: list[list[float]],
    mean: list[list[float]] | None = None,
    settings: Settings = SENSORS_ALONE,
) -> tuple[bool, Float64, Float64]:
    start = np.array([0.0, 0.04, 0.0, 0.0, 8.1, *np.zeros(EXTRAS - 1)])
    calm = Noise(np.full(N, 0.05**2), WHITE, np.ones(N), np.ones(N))
    held = np.array(precision)
    priors = Priors(np.zeros_like(held) if mean is None else np.array(mean), held)
    active = np.array([0, 1, 2, 3, len(POWERS) + V0])
    prior = np.zeros((2, len(start)))
    record = Disturbed(rows, calm, settings, 0)
    return average(LAW, start, GRID_S, record, active, prior, priors)


OUT = 1e14  # precision of what is known to be 0
LOW, HIGH = [OUT, 0.0, 0.0, OUT], [OUT, 0.0, OUT, 0.0]


def test_one_prior_is_fitted_as_by_itself(rows: Rows) -> None:
    converged, unknowns, covariance = averaged(rows, [LOW])
    law = LAW._replace(powers=np.array([2, 3]))
    calm = Noise(np.full(N, 0.05**2), WHITE, np.ones(N), np.ones(N))
    start = np.array([0.04, 0.0, 8.1, *np.zeros(EXTRAS - 1)])
    active, prior = np.array([0, 1, 2]), np.zeros((2, len(start)))
    alone, _, expected, spread, _ = fit(law, start, GRID_S, rows, calm, active, prior, 30)
    assert converged
    assert alone
    np.testing.assert_allclose(unknowns[[0, 3]], 0.0, atol=1e-7)
    sd = np.sqrt(np.diag(spread)[:3])
    # within the fall of chi^2 at which both stop, far below the noise
    np.testing.assert_allclose(unknowns[[1, 2, 4]], expected[:3], rtol=0.0, atol=0.1 * sd.min())
    np.testing.assert_allclose(np.diag(covariance)[[1, 2, 4]], sd**2, rtol=0.02)


def test_what_priors_disagree_about_is_in_the_covariance(rows: Rows) -> None:
    low, high, both = (averaged(rows, some) for some in ([LOW], [HIGH], [LOW, HIGH]))
    coefficient = [found[1][1] for found in (low, both, high)]
    assert min(coefficient[0], coefficient[2]) < coefficient[1] < max(coefficient)
    between = (coefficient[0] - coefficient[2]) ** 2
    assert both[2][1, 1] > min(low[2][1, 1], high[2][1, 1]) + 1e-3 * between


def test_settings_are_mixed_with_the_variance_between_them(rows: Rows) -> None:
    log = GaussMarkovNoise(log_m_s=0.05, log_s=100.0)
    sizes = np.array([WHITE, log])
    ones = np.ones((2, 3)), np.ones(2)
    alone = [
        averaged(rows, [LOW], settings=Settings(sizes[i : i + 1], *(x[:1] for x in ones), one))
        for i, one in ((0, np.ones(1)), (1, np.ones(1)))
    ]
    _, mean, covariance = averaged(
        rows, [LOW], settings=Settings(sizes, *ones, np.array([0.25, 0.75]))
    )
    weight = 0.25, 0.75
    expected = sum(w * one[1] for w, one in zip(weight, alone))
    within = sum(w * np.diag(one[2]) for w, one in zip(weight, alone))
    between = 0.25 * 0.75 * (alone[0][1] - alone[1][1]) ** 2
    sd = np.sqrt(within[[1, 2, 4]])
    np.testing.assert_allclose(mean[[1, 2, 4]], expected[[1, 2, 4]], rtol=0.0, atol=0.1 * sd.min())
    np.testing.assert_allclose(np.diag(covariance), within + between, rtol=0.03, atol=1e-12)
    assert np.all(np.diag(alone[1][2])[[1, 2, 4]] > 1.5 * np.diag(alone[0][2])[[1, 2, 4]])


def test_a_setting_that_fails_is_left_out(rows: Rows) -> None:
    sizes = np.array([WHITE, GaussMarkovNoise(log_m_s=np.inf, log_s=100.0)])
    both = Settings(sizes, np.ones((2, 3)), np.ones(2), np.array([0.5, 0.5]))
    one, two = averaged(rows, [LOW]), averaged(rows, [LOW], settings=both)
    np.testing.assert_array_equal(two[1], one[1])
    none = Settings(sizes[1:], np.ones((1, 3)), np.ones(1), np.ones(1))
    assert not averaged(rows, [LOW], settings=none)[0]


def test_twice_the_same_prior_is_one(rows: Rows) -> None:
    once, twice = averaged(rows, [LOW]), averaged(rows, [LOW] * 2)
    np.testing.assert_allclose(twice[1], once[1], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(twice[2], once[2], rtol=1e-9, atol=1e-12)


def test_the_mixture_is_that_of_the_marginal_likelihoods(rows: Rows) -> None:
    sd = np.array([[0.01, 0.1, 0.01, 0.01], [0.002, 0.1, 0.05, 0.003]])
    mean = np.array([[0.0, 0.03, 0.0, 0.0], [0.0, 0.03, 0.0, 0.004]])
    converged, unknowns, covariance = averaged(rows, (1.0 / sd**2).tolist(), mean.tolist())
    assert converged
    # the motion, linear about the answer; its starting speed hardly held
    active = np.array([0, 1, 2, 3, len(POWERS) + V0])
    table, _ = predict(LAW, unknowns, GRID_S, rows, active)
    h, now = table[1:], unknowns[active]
    logs, means, seconds = [], [], []
    for one, about in zip(sd, mean):
        prior = np.diag([*one, 100.0]) ** 2
        off = np.array([*about, 8.0]) - now
        data = 0.05**2 * np.eye(N) + h.T @ prior @ h
        left = table[0] - h.T @ off
        gain = prior @ h @ np.linalg.inv(data)
        logs.append(-0.5 * left @ np.linalg.solve(data, left) - 0.5 * np.linalg.slogdet(data)[1])
        means.append(off + gain @ left)
        seconds.append(prior - gain @ h.T @ prior + np.outer(means[-1], means[-1]))
    weight = np.exp(np.array(logs) - max(logs))
    weight /= weight.sum()
    assert weight.min() > 0.01, 'a prior that counts for nothing tests nothing'
    step = weight @ np.array(means)
    expected = np.einsum('m,mij->ij', weight, np.array(seconds)) - np.outer(step, step)
    of_active = covariance[np.ix_(active, active)]
    spread = np.sqrt(np.diag(expected))
    # it stops where the next step is small against the noise
    np.testing.assert_allclose(step / spread, 0.0, atol=0.1)
    np.testing.assert_allclose(np.sqrt(np.diag(of_active)), spread, rtol=0.05)
