# SPDX-License-Identifier: Apache-2.0
"""Statistics of the slow disturbances."""

import numpy as np
import pytest

from shipdrag_ros.simulation import GaussMarkov


@pytest.mark.parametrize('step_s', [1.0, 7.0])
def test_sd_and_correlation_do_not_depend_on_the_step(step_s):
    # N = 200 000 at correlation time 20 s, seed 3; the bounds are 5 standard errors
    n, tau = 200_000, 20.0
    noise = GaussMarkov(0.3, tau).sample(step_s * np.arange(n), np.random.default_rng(3))
    independent = n * step_s / (2.0 * tau)
    np.testing.assert_allclose(np.std(noise), 0.3, rtol=5.0 / np.sqrt(2.0 * independent))
    assert abs(np.mean(noise)) < 5.0 * 0.3 / np.sqrt(independent)
    lag = round(tau / step_s)
    correlation = np.corrcoef(noise[:-lag], noise[lag:])[0, 1]
    assert abs(correlation - np.exp(-lag * step_s / tau)) < 5.0 / np.sqrt(independent)


def test_uneven_times_are_correlated_by_their_distance():
    # N = 100 000 pairs 2 s apart, 1000 s between pairs, seed 5; bound 5 standard errors
    pairs = 100_000
    times = (1000.0 * np.arange(pairs)[:, None] + [0.0, 2.0]).ravel()
    noise = GaussMarkov(1.0, 10.0).sample(times, np.random.default_rng(5)).reshape(-1, 2)
    expected = np.exp(-0.2)
    error = (1.0 - expected**2) / np.sqrt(pairs)
    assert abs(np.corrcoef(noise.T)[0, 1] - expected) < 5.0 * error
