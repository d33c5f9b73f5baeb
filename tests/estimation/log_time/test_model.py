# SPDX-License-Identifier: Apache-2.0
"""The compiled model of the live estimator against plain numpy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Chebyshev

from shipdrag_ros.estimation.log_time.model import (
    CURRENT,
    SCALE,
    THRUST,
    coast_motion,
    combine,
    design,
)

TC, SPAN, POLYNOMIALS = 240.0, 1500.0, 12


def log_time(time_s: np.ndarray) -> np.ndarray:
    result: np.ndarray = 2.0 * np.log1p(time_s / TC) / np.log1p(SPAN / TC) - 1.0
    return result


def test_columns_are_those_of_plain_numpy() -> None:
    rng = np.random.default_rng(0)
    log, ground, position = (np.sort(rng.uniform(0.0, SPAN, n)) for n in (30, 20, 40))
    time_s = np.concatenate([log, ground, position])
    count = np.array([30, 20, 40])
    rows = design(time_s, count, TC, SPAN, 8.0, 12.0, POLYNOMIALS)
    speeds = np.concatenate([log, ground])
    ds_dt = 2.0 / np.log1p(SPAN / TC) / (TC + speeds)
    for j in range(POLYNOMIALS):
        one = Chebyshev.basis(j)
        rate = one.deriv()(log_time(speeds)) * ds_dt
        np.testing.assert_allclose(rows[j, 50:], one(log_time(position)), atol=1e-12)
        np.testing.assert_allclose(rows[j, :50] / np.ptp(ds_dt), rate / np.ptp(ds_dt), atol=1e-12)
    expected = np.zeros((THRUST + 1, 90))
    expected[CURRENT] = np.concatenate([np.zeros(30), np.ones(20), position])
    expected[SCALE, :30] = 8.0 * TC / (TC + log)
    left = 12.0 * np.exp(-time_s / 12.0)
    expected[THRUST] = np.where(np.arange(90) < 50, -left, 12.0 * left)
    np.testing.assert_allclose(rows[POLYNOMIALS:], expected, rtol=1e-12)
    p = rng.normal(size=len(rows))
    np.testing.assert_allclose(combine(rows, p), p @ rows, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize('drop', [-1.0, 0.0, 0.3])
def test_motion_is_that_of_plain_numpy(drop: float) -> None:
    # a quadratic coast with a small wave on it, sampled where the kernel samples it
    k, points = 6, 33
    scale = TC * 8.0 * np.log1p(SPAN / TC) / 2.0
    p = scale * np.array([1.0, 1.0, 0.01, 0.004, 0.002, -0.001])
    root = scale * 1e-3 * np.tril(np.random.default_rng(1).normal(size=(k, k)))
    values, errors = coast_motion(TC, SPAN, p, root, points, drop)

    length = np.log1p(SPAN / TC)
    s = np.linspace(-1.0, 1.0, points)
    rate = 1.0 / (TC * np.exp(0.5 * (s + 1.0) * length))
    by_u = np.array(
        [
            [Chebyshev.basis(j).deriv(d)(s) * (2.0 / length) ** d for j in range(k)]
            for d in (1, 2, 3)
        ]
    ).transpose(0, 2, 1)
    one, two, three = by_u
    rows = [
        rate[:, None] * one,
        rate[:, None] ** 2 * (two - one),
        rate[:, None] ** 3 * (three - 3.0 * two + 2.0 * one),
    ]
    plain = np.array([row @ p for row in rows])
    wrong = np.array([row @ root for row in rows])
    wrong[1] -= (plain[2] / plain[1])[:, None] * wrong[0]
    start = plain[0, 0] - drop
    if drop > 0.0:
        first = int(np.flatnonzero(plain[0] > start)[-1])
        share = (plain[0, first] - start) / (plain[0, first] - plain[0, first + 1])
        for each in (plain, wrong):
            each[:, first] += share * (each[:, first + 1] - each[:, first])
        plain, wrong = plain[:, first:], wrong[:, first:]
    assert values.shape == plain.shape
    for found, expected in ((values, plain), (errors, wrong)):
        for derivative in range(3):
            size = np.abs(expected[derivative]).max()
            np.testing.assert_allclose(
                found[derivative] / size, expected[derivative] / size, atol=1e-12
            )
