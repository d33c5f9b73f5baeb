# SPDX-License-Identifier: Apache-2.0
"""Rows condensed to their weighted means: nothing is lost or counted twice."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.estimation.ode_fit.condensing import means
from shipdrag_ros.inference.rows import LOG, POSITION, Rows


def test_means_are_weighted_and_in_ascending_time() -> None:
    rng = np.random.default_rng(0)
    time_s = np.sort(rng.uniform(-3.0, 100.0, 300))
    kind = rng.choice([LOG, POSITION], 300)
    residual, variance = rng.standard_normal(300), rng.uniform(0.5, 2.0, 300)
    grid_s = np.linspace(0.0, 90.0, 10)
    rows = Rows(time_s, kind, np.zeros(300))
    found, spread = means(rows, 20, residual, variance, grid_s)
    assert np.all(np.diff(found.time_s) >= 0.0)
    kept = np.arange(300) >= 20
    for of_kind in (LOG, POSITION):
        inside = kept & (kind == of_kind) & (time_s >= 30.0) & (time_s < 40.0)
        weight = 1.0 / variance[inside]
        at = np.flatnonzero(
            (found.kind == of_kind) & (found.time_s >= 30.0) & (found.time_s < 40.0)
        )
        assert len(at) == 1
        mean = (weight * residual[inside]).sum() / weight.sum()
        np.testing.assert_allclose(found.value[at[0]], mean, rtol=1e-12)
        np.testing.assert_allclose(spread[at[0]], 1.0 / weight.sum(), rtol=1e-12)
        total = (1.0 / variance[kept & (kind == of_kind)]).sum()
        np.testing.assert_allclose((1.0 / spread[found.kind == of_kind]).sum(), total, rtol=1e-12)
