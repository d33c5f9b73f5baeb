# SPDX-License-Identifier: Apache-2.0
"""What runs share and how they scatter, against what they were made with."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from shipdrag_ros.diagnosis.shared_baseline import Normal, factor, share, tail_weight

ALONG = np.array([1.0, 1.0])
PRIOR = Normal(np.eye(2) * 1e-4, np.zeros(2))


def runs(
    count: int, *, scatter: float, seed: int, mean: tuple[float, float] = (0.04, -0.1)
) -> list[Normal]:
    """Draw runs, each of which knows both parts to about 0.01."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        rows = rng.normal(size=(20, 2))
        true = np.array(mean) + scatter * rng.standard_normal() * ALONG
        measured = rows @ true + 0.03 * rng.standard_normal(20)
        found.append(Normal(rows.T @ rows / 0.03**2, rows.T @ measured / 0.03**2))
    return found


def test_unknowns_of_a_run_alone_are_left_out_as_least_squares_does() -> None:
    rng = np.random.default_rng(0)
    rows, measured = rng.normal(size=(9, 3)), rng.normal(size=9)
    whole = np.linalg.lstsq(rows, measured, rcond=None)[0]
    part = Normal.without(rows.T @ rows, rows.T @ measured, 2)
    np.testing.assert_allclose(
        np.linalg.solve(part.matrix, part.negative_gradient), whole[:2], rtol=1e-9
    )


@pytest.mark.parametrize('scatter', [0.005, 0.02, 0.1])
def test_scatter_and_mean_are_found_with_many_runs(scatter: float) -> None:
    found = share(runs(60, scatter=scatter, seed=1), PRIOR, ALONG, usual_scatter=0.02)
    assert found.scatter == pytest.approx(scatter, rel=0.35)
    assert found.scatter_low < found.scatter < found.scatter_high
    away = found.step - [0.04, -0.1]
    assert float(away @ np.linalg.solve(found.covariance, away)) < 13.8  # 0.1 % by chance


def test_what_is_usual_holds_where_runs_tell_no_scatter() -> None:
    one = runs(1, scatter=0.0, seed=2)
    found = [share(one, PRIOR, ALONG, usual_scatter=usual).scatter for usual in (0.01, 0.05)]
    assert found[1] > 3.0 * found[0]


def test_a_run_that_differs_is_held_against_the_others() -> None:
    others = share(runs(8, scatter=0.01, seed=3), PRIOR, ALONG, usual_scatter=0.02)
    odd = runs(1, scatter=0.0, seed=4, mean=(0.04 + 0.2, -0.1 + 0.2))[0]
    found = factor(odd, others, ALONG)
    assert found.value == pytest.approx(0.2, abs=0.03)
    assert found.away > 8.0


@pytest.mark.parametrize('away', [-8.0, -2.5, 0.3, 1.0, 3.0, 20.0])
def test_a_baseline_may_be_three_times_worse_than_stated_in_one_case_of_ten(away: float) -> None:
    def log_density(z: float) -> float:
        return float(
            np.logaddexp(np.log(0.9) + norm.logpdf(z), np.log(0.1) + norm.logpdf(z, 0, 3))
        )

    slope = (log_density(away + 1e-5) - log_density(away - 1e-5)) / 2e-5
    assert tail_weight(np.array([away]))[0] * away == pytest.approx(-slope, rel=1e-4)
