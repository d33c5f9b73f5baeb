# SPDX-License-Identifier: Apache-2.0
"""Distance along the track: as plain polynomials have it, unbiased, right in a bend."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.distance import (
    ALPHA,
    BETA,
    COEFFICIENT,
    SQUARED_NORM,
    SSE,
    along_track,
    evaluate,
    refit,
)
from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.s1.motion import OrthogonalBasis

LINE, MOST = 2, 8  # coefficients of a bend
TIME = np.linspace(-1.0, 1.0, 400)
DISTANCE = 4000.0 * (1.0 - np.exp(-(TIME + 1.0)))


def fitted(time: Float64, value: Float64) -> Polynomial:
    """The polynomial of least AICc (Hurvich and Tsai 1989), a line at least."""
    n = len(time)
    best, least = None, np.inf
    for order in range(LINE, min(MOST, n - 2) + 1):
        k = order + 1  # the variance is fitted too
        if n <= k + 1:
            break
        trial = Polynomial.fit(time, value, order - 1, domain=[-1.0, 1.0])
        sse = ((value - trial(time)) ** 2).sum()
        criterion = n * np.log(sse / n) + 2.0 * k + 2.0 * k * (k + 1.0) / (n - k - 1.0)
        if criterion < least:
            best, least = trial, criterion
    assert best is not None
    return best


def plainly(time: Float64, position: Float64) -> tuple[Float64, bool]:
    """Distance along, and whether the track is taken to bend."""
    away = position - position[0]
    way = np.array([Polynomial.fit(time, column, 1).convert().coef[1] for column in away.T])
    way /= np.hypot(*way)
    ahead, across = away @ way, away @ [-way[1], way[0]]
    bend = fitted(time, across)
    if bend.degree() < LINE:
        return ahead, False
    x, y = fitted(time, ahead).deriv(), bend.deriv()
    fine = np.linspace(-1.0, 1.0, 4001)
    rate = np.hypot(x(fine), y(fine)) - np.abs(x(fine))
    excess = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(fine))])
    return ahead + np.interp(time, fine, excess), True


@pytest.mark.parametrize('n', [9, 12, 40])
@pytest.mark.parametrize('bend_m', [0.0, 40.0, 300.0])
def test_as_plain_polynomials_have_it(n: int, bend_m: float) -> None:
    # 40 seeds each; in a short record AIC alone would see bends that are noise
    bent = 0
    for seed in range(40):
        rng = np.random.default_rng([seed, n])
        time = np.sort(np.concatenate([[-1.0, 1.0], rng.uniform(-1.0, 1.0, n - 2)]))
        position = np.column_stack([2000.0 * time - 200.0 * time**2, bend_m * time**2])
        position += 10.0 * rng.normal(size=(n, 2))
        expected, bends = plainly(time, position)
        bent += bends
        np.testing.assert_allclose(along_track(time, position), expected, rtol=0.0, atol=0.05)
    if bend_m == 0.0:
        assert bent <= 12
    elif bend_m == 300.0:
        assert bent == 40


@pytest.mark.parametrize('noise_m', [0.0, 2.0])
def test_bent_track_has_the_length_of_its_arc(noise_m: float) -> None:
    # a turn through 30 degrees: the projection alone is 1 % short
    bearing = 0.5 * DISTANCE / DISTANCE[-1]
    radius = DISTANCE[-1] / 0.5
    position = radius * np.stack([np.sin(bearing), 1.0 - np.cos(bearing)], axis=1)
    position += noise_m * np.random.default_rng(2).normal(size=(400, 2))
    smooth = Polynomial.fit(TIME, along_track(TIME, position), 11)(TIME)
    error = smooth - smooth[0] - DISTANCE
    assert np.abs(error).max() < 0.1 + 2.0 * noise_m
    chord = np.hypot(*(position[-1] - position[0]))
    assert DISTANCE[-1] - chord > 30.0


def test_positions_without_a_direction_are_refused() -> None:
    with pytest.raises(EstimationError, match='without a direction of travel'):
        along_track(TIME, np.full((400, 2), 3.0))


@pytest.mark.parametrize('n', [13, 100, 500, 2000])
@pytest.mark.parametrize('even', [True, False])
def test_every_order_is_that_of_plain_numpy(n: int, even: bool) -> None:
    rng = np.random.default_rng(n)
    time = np.linspace(-1.0, 1.0, n) if even else np.sort(rng.uniform(-1.0, 1.0, n))
    value = np.exp(time) + rng.normal(size=n)
    table = refit(time, value, 12)
    basis = OrthogonalBasis.on(time, 12)
    coefficients, sse = basis.fit(value)
    tight = 1e-12 if n > 13 else 1e-9  # as many polynomials as times: hardly any residual
    np.testing.assert_allclose(table[SQUARED_NORM], basis.squared_norm, rtol=tight)
    np.testing.assert_allclose(table[ALPHA, :-1], basis.alpha[:-1], rtol=0.0, atol=tight)
    np.testing.assert_allclose(table[BETA, :-1], basis.beta[:-1], rtol=tight)
    scale = np.sqrt((value**2).sum() / basis.squared_norm)
    np.testing.assert_allclose(table[COEFFICIENT] / scale, coefficients / scale, atol=tight)
    np.testing.assert_allclose(table[SSE], sse, rtol=tight)


def test_an_offset_costs_no_digits() -> None:
    time = np.linspace(-1.0, 1.0, 500)
    noise = np.random.default_rng(1).normal(size=500)
    plain, offset = refit(time, noise, 6), refit(time, noise + 1e6, 6)
    np.testing.assert_allclose(offset[SSE], plain[SSE], rtol=1e-8)


def test_value_and_rate_follow_the_polynomial() -> None:
    time = np.linspace(-1.0, 1.0, 50)
    table = refit(time, 1.0 + 2.0 * time - 3.0 * time**3, 5)
    value, rate = evaluate(table, np.array([-0.3, 0.9]), 4)
    np.testing.assert_allclose(value, [1.0 - 0.6 + 0.081, 1.0 + 1.8 - 2.187], atol=1e-13)
    np.testing.assert_allclose(rate, [2.0 - 0.81, 2.0 - 7.29], atol=1e-12)
    value, _ = evaluate(table, time, 1)
    np.testing.assert_allclose(value, 1.0, atol=1e-13)
