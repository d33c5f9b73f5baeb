# SPDX-License-Identifier: Apache-2.0
"""What is expected of a coastdown, against a motion that is integrated plainly."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Chebyshev

from shipdrag_ros.estimation.log_time.prior import FREE, coast_priors
from shipdrag_ros.samples import Float64

LENGTH, SPEED, TC, K = 1.6, 8.0, 240.0, 12
EXTRAS = 3
STEPS = 20_000


def priors(froude: float) -> tuple[Float64, Float64]:
    mean, sd = np.zeros(K + EXTRAS), np.zeros(K + EXTRAS)
    mean[:FREE] = 7.0, 5.0
    mean[-1], sd[K:], sd[:FREE] = 0.3, (1.0, 0.02, 0.1), 1e4
    return coast_priors(LENGTH, SPEED, TC, froude, mean, sd)


def distance(power: int, part: float) -> tuple[Float64, Float64]:
    """Warped time and distance of a coast, a part of its drag by another power of the speed."""
    u, h = np.linspace(0.0, LENGTH, STEPS + 1, retstep=True)

    def slope(u: float, v: float) -> float:
        s = v / SPEED
        # dt = tc exp(u) du
        return float(-SPEED * np.exp(u) * (s**2 + part * s**power))

    v = np.empty(STEPS + 1)
    v[0] = SPEED
    for i in range(STEPS):
        middle = v[i] + 0.5 * h * slope(u[i], v[i])
        v[i + 1] = v[i] + h * slope(u[i] + 0.5 * h, middle)
    rate = v * TC * np.exp(u)
    return u, np.concatenate([[0.0], np.cumsum(0.5 * h * (rate[1:] + rate[:-1]))])


@pytest.mark.parametrize('froude', [0.12, 0.2, 0.4])
def test_the_mean_bends_as_wave_making_does(froude: float) -> None:
    means, _ = priors(froude)
    assert np.all(means == means[0]), 'friction and humps go either way'
    waves = 0.1 * min(1.0, (froude / 0.2) ** 4)
    expected = np.zeros(STEPS + 1)
    for power in (5, 7, 9):
        u, some = distance(power, 1e-3)
        expected += waves * 1e3 * (some - distance(power, 0.0)[1])
    s = 2.0 * u / LENGTH - 1.0
    # what is free is not held, so not compared
    fitted = Chebyshev.fit(s, expected, K - 1, domain=[-1.0, 1.0]).coef
    size = np.abs(fitted[FREE:]).max()
    np.testing.assert_allclose(means[0, FREE:K] / size, fitted[FREE:] / size, atol=5e-3)
    assert np.array_equal(means[0, :FREE], [7.0, 5.0])
    assert np.array_equal(means[0, K:], [0.0, 0.0, 0.3])


def test_roots_hold_the_polynomials_and_leave_the_rest_apart() -> None:
    _, roots = priors(0.2)
    assert np.all(np.triu(roots, 1) == 0.0)
    held = roots[:, FREE:K, FREE:K]
    assert np.all(np.diagonal(held, axis1=1, axis2=2) > 0.0)
    rest = roots.copy()
    rest[:, FREE:K, FREE:K] = 0.0
    diagonal = np.zeros(K + EXTRAS)
    diagonal[:FREE], diagonal[K:] = 1e4, (1.0, 0.02, 0.1)
    assert np.array_equal(rest, np.tile(np.diag(diagonal), (len(roots), 1, 1)))
    covariance = held @ held.transpose(0, 2, 1)
    sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    # later ones are held more firmly; larger humps and friction less
    assert np.all(sd[:, 0] > 10.0 * sd[:, -1])
    assert np.all(np.diff(sd[:3], axis=0) > 0.0)
    assert np.all(sd[3:] > sd[:3])


def test_a_slow_ship_makes_no_waves() -> None:
    slow, fast = (priors(froude) for froude in (0.08, 0.25))
    assert np.abs(slow[0][0, FREE:K]).max() < 0.03 * np.abs(fast[0][0, FREE:K]).max()
    sd = [np.linalg.norm(roots[0, FREE:K], axis=1) for _, roots in (slow, fast)]
    assert np.all(sd[0] < sd[1])
