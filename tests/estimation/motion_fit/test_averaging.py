# SPDX-License-Identifier: Apache-2.0
"""One linearisation for all families gives what fits of each would give."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.estimation.motion_fit.averaging import average
from shipdrag_ros.estimation.motion_fit.coast import EXTRAS, LOG, V0, Rows, predict
from shipdrag_ros.estimation.motion_fit.families import Families
from shipdrag_ros.estimation.motion_fit.law import Law
from shipdrag_ros.estimation.motion_fit.solve import fit
from shipdrag_ros.estimation.motion_fit.whitening import CALM, Noise
from shipdrag_ros.samples import Float64

POWERS = np.array([1, 2, 3, 4])
LAW = Law(POWERS, 8.0, 0.0, np.array([0.05]))
GRID_S = np.linspace(0.0, 1500.0, 73)
N = 400


@pytest.fixture
def rows() -> Rows:
    time_s = np.linspace(0.0, 1500.0, N)
    kind = np.full(N, LOG)
    truth = np.array([0.0, 0.03, 0.01, 0.0, 8.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    empty = Rows(time_s, kind, np.zeros(N))
    _, speed = predict(LAW, truth, GRID_S, empty, np.zeros(0, np.int64))
    noise = 0.05 * np.random.default_rng(0).standard_normal(N)
    return Rows(time_s, kind, speed + noise)


def averaged(rows: Rows, included: list[list[int]]) -> tuple[bool, Float64, Float64]:
    start = np.array([0.0, 0.04, 0.0, 0.0, 8.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    calm = Noise(np.full(N, 0.05**2), CALM, np.ones(N), np.ones(N))
    families = Families(np.array(included, np.bool_), np.zeros((len(included), len(POWERS))))
    active = np.array([0, 1, 2, 3, len(POWERS) + V0])
    prior = np.zeros((2, len(start)))
    return average(LAW, start, GRID_S, rows, calm, active, prior, families, N)


def test_one_family_is_fitted_as_by_itself(rows: Rows) -> None:
    converged, unknowns, covariance = averaged(rows, [[0, 1, 1, 0]])
    law = LAW._replace(powers=np.array([2, 3]))
    calm = Noise(np.full(N, 0.05**2), CALM, np.ones(N), np.ones(N))
    start = np.array([0.04, 0.0, 8.1, *np.zeros(EXTRAS - 1)])
    active, prior = np.array([0, 1, 2]), np.zeros((2, len(start)))
    alone, _, expected, spread, _ = fit(law, start, GRID_S, rows, calm, active, prior, 30)
    assert converged
    assert alone
    assert unknowns[0] == unknowns[3] == 0.0
    sd = np.sqrt(np.diag(spread)[:3])
    # within the fall of chi^2 at which both stop, far below the noise
    np.testing.assert_allclose(unknowns[[1, 2, 4]], expected[:3], rtol=0.0, atol=0.1 * sd.min())
    np.testing.assert_allclose(np.diag(covariance)[[1, 2, 4]], sd**2, rtol=0.02)


def test_what_families_disagree_about_is_in_the_covariance(rows: Rows) -> None:
    low = averaged(rows, [[0, 1, 1, 0]])
    high = averaged(rows, [[0, 1, 0, 1]])
    both = averaged(rows, [[0, 1, 1, 0], [0, 1, 0, 1]])
    coefficient = [found[1][1] for found in (low, both, high)]
    assert min(coefficient[0], coefficient[2]) < coefficient[1] < max(coefficient)
    assert both[2][1, 1] > min(low[2][1, 1], high[2][1, 1])
    between = (coefficient[0] - coefficient[2]) ** 2
    assert both[2][1, 1] > min(low[2][1, 1], high[2][1, 1]) + 1e-3 * between


def test_twice_the_same_family_is_one(rows: Rows) -> None:
    once, twice = averaged(rows, [[0, 1, 1, 0]]), averaged(rows, [[0, 1, 1, 0]] * 2)
    np.testing.assert_allclose(twice[1], once[1], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(twice[2], once[2], rtol=1e-9, atol=1e-12)
