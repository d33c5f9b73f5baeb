# SPDX-License-Identifier: Apache-2.0
"""What runs share and how they scatter, against what they were made with."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.diagnosis.learn_baseline import Normals, factor, share

ALONG = np.array([1.0, 1.0])
PRIOR = np.zeros(2)  # wide beside what the runs know, as its sd is 1


def runs(
    count: int, *, scatter: float, seed: int, mean: tuple[float, float] = (0.04, -0.1)
) -> Normals:
    """Draw runs, each of which knows both parts to about 0.01."""
    rng = np.random.default_rng(seed)
    matrices, gradients = [], []
    for _ in range(count):
        rows = rng.normal(size=(20, 2))
        true = np.array(mean) + scatter * rng.standard_normal() * ALONG
        measured = rows @ true + 0.03 * rng.standard_normal(20)
        matrices.append(rows.T @ rows / 0.03**2)
        gradients.append(rows.T @ measured / 0.03**2)
    return Normals(np.array(matrices), np.array(gradients))


def test_runs_that_scatter_are_one_joint_least_squares() -> None:
    # at the scatter that is found, each factor is an unknown with this prior sd
    seen = runs(6, scatter=0.1, seed=5)
    found = share(seen, PRIOR, ALONG, usual_scatter=1e-4 + 0.1)
    count = len(seen.matrix)
    whole = np.zeros((2 + count, 2 + count))
    gradient = np.zeros(2 + count)
    whole[:2, :2] = np.eye(2)
    for j, (matrix, push) in enumerate(zip(*seen, strict=True)):
        columns = np.zeros((2, 2 + count))
        columns[:, :2], columns[:, 2 + j] = np.eye(2), ALONG
        whole += columns.T @ matrix @ columns
        gradient += columns.T @ push
        whole[2 + j, 2 + j] += found.scatter**-2.0
    joint = np.linalg.solve(whole, gradient)[:2]
    np.testing.assert_allclose(found.step, joint, atol=2e-3)


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
    odd = runs(1, scatter=0.0, seed=4, mean=(0.04 + 0.2, -0.1 + 0.2))
    found = factor(odd.matrix[0], odd.gradient[0], others, ALONG)
    assert found.value == pytest.approx(0.2, abs=0.03)
    assert found.away > 8.0
