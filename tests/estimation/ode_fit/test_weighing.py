# SPDX-License-Identifier: Apache-2.0
"""Each input's noise is as it scatters, and outliers weigh little."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.estimation.ode_fit.weighing import drop_gross, weigh
from shipdrag_ros.inference.rows import LOG, OVER_GROUND, POSITION


def test_variances_by_input_and_weights_by_size() -> None:
    # N = 4000 of each input, seed 0: variances within 8 %, over 3 standard errors
    n, steady = 4000, 100
    kind = np.tile([LOG, POSITION, OVER_GROUND], n)
    white = np.random.default_rng(0).standard_normal(3 * n)
    white[kind == POSITION] *= 2.0
    white[-3], white[-6] = 50.0, 5.0
    kind[:steady] = LOG
    base, weight = np.ones(3 * n), np.ones(3 * n)
    for _ in range(4):
        weigh(white / np.sqrt(base / weight), kind, steady, 8, base, weight)
    for of_kind, expected in ((LOG, 1.0), (POSITION, 4.0), (OVER_GROUND, 1.0)):
        np.testing.assert_allclose(base[kind == of_kind], expected, rtol=0.08)
    assert weight[-3] < 1e-5
    np.testing.assert_allclose(weight[-6], 0.5, rtol=0.1)
    assert np.mean(weight == 1.0) > 0.98


def test_a_reading_far_from_a_crude_answer_is_dropped_by_the_scatter_of_its_input() -> None:
    rng = np.random.default_rng(1)
    kind = np.tile([LOG, POSITION], 100)
    residual = rng.standard_normal(200) * np.where(kind == LOG, 0.1, 30.0)
    residual[0], residual[1] = 2.0, 200.0
    weight = np.ones(200)
    drop_gross(residual, kind, weight)
    assert weight[0] < 1e-5
    assert np.all(weight[1:] == 1.0)
