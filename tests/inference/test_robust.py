# SPDX-License-Identifier: Apache-2.0
"""Robust scale and weights, held against draws and quadrature."""

from __future__ import annotations

import math

import pytest
from scipy.integrate import quad
from scipy.stats import norm

from shipdrag_ros.inference.robust import MAD_TO_SD, huber_square, huber_weight


def test_the_median_of_normal_noise_gives_its_standard_deviation() -> None:
    assert pytest.approx(1.0 / norm.ppf(0.75), rel=1e-12) == MAD_TO_SD


@pytest.mark.parametrize('limit', [0.5, 2.0, 2.5, 8.0])
def test_the_mean_of_the_cut_square(limit: float) -> None:
    cut = quad(
        lambda z: min(abs(z), limit) ** 2 * norm.pdf(z), -12.0, 12.0, points=[-limit, limit]
    )
    assert huber_square(limit) == pytest.approx(cut[0], rel=1e-9)


@pytest.mark.parametrize('size', [0.0, 1.0, 2.0, 2.1, 50.0])
def test_beyond_the_limit_a_residual_counts_by_its_sign(size: float) -> None:
    assert size * huber_weight(size, 2.0) == pytest.approx(min(size, 2.0))
    assert math.isfinite(huber_weight(size, 2.0))
