# SPDX-License-Identifier: Apache-2.0
"""What a shaft does to r, whatever law the thrust has."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.accuracy._thrust_law import CARGO, CASES, LAWS, YACHT, Hull, score

RUNS = 3  # seeds 0..2
SHAFT, WITHOUT, DOUBLED = range(3)  # of CASES


@pytest.mark.parametrize(('hull', 'rmse', 'worse'), [(CARGO, 0.013, 0.0), (YACHT, 0.015, 0.005)])
def test_a_shaft_hardly_makes_r_worse(hull: Hull, rmse: float, worse: float) -> None:
    # N = 18, seeds 0 to 2 of six laws. The yacht: 1.0 % of r with a shaft, 0.6 without one, where
    # the prior of the run-down has hers as its median
    seen, unseen = (
        [score(hull, law, CASES[i], 500, RUNS) for law in LAWS] for i in (SHAFT, WITHOUT)
    )
    squares = [np.mean([one.rmse**2 for one in each]) for each in (seen, unseen)]
    assert np.sqrt(squares[0]) < rmse
    # three seeds of six laws scatter by about a sixth
    assert np.sqrt(squares[0]) < np.sqrt(1.3 * squares[1]) + worse
    assert np.mean([one.covered for one in seen]) > 0.88
    assert all(one.failed == 0 for one in seen)


def test_a_run_down_that_is_stated_twice_too_long_does_no_harm() -> None:
    found = [score(CARGO, law, CASES[DOUBLED], 500, RUNS) for law in LAWS]
    assert np.sqrt(np.mean([one.rmse**2 for one in found])) < 0.015
    assert np.mean([one.covered for one in found]) > 0.88
