# SPDX-License-Identifier: Apache-2.0
"""The probability that a measurement decides, against cases that are solved on paper."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ndtr

from shipdrag_ros.diagnosis.prospect import Prospect, resolving
from shipdrag_ros.diagnosis.verdict import CERTAIN

DRAWN = 0.08  # over twice the sd of a share of 200 draws


def prospect(mean: list[float], *, sd: float = 0.0) -> Prospect:
    """Rows with a mean that is uncertain in the first of them."""
    slope = np.zeros((1, len(mean)))
    slope[0, 0] = sd
    return Prospect(np.array(mean), slope, np.eye(1), np.eye(1))


@pytest.mark.parametrize('apart', [0.0, 1.0, 3.0, 6.0])
@pytest.mark.parametrize('first', [0.5, 0.8])
def test_two_known_means(apart: float, first: float) -> None:
    both = [prospect([0.0, 0.0]), prospect([0.0, apart])]
    found = resolving([both], [0, 0], [first, 1.0 - first])
    for own, of_truth in zip(found, (first, 1.0 - first), strict=True):
        # ln of the odds is normal, mean D/2 and variance D about what it was
        needed = math.log(CERTAIN / (1.0 - CERTAIN)) - math.log(of_truth / (1.0 - of_truth))
        expected = 0.0
        if apart > 0.0:
            expected = float(ndtr((0.5 * apart**2 - needed) / apart))
        assert own == pytest.approx(expected, abs=DRAWN)


def test_what_is_open_in_both_tells_nothing_apart() -> None:
    known = [prospect([0.0]), prospect([6.0])]
    blurred = [prospect([0.0], sd=50.0), prospect([6.0], sd=50.0)]
    assert min(resolving([known], [0, 0], [0.5, 0.5])) > 0.95
    assert max(resolving([blurred], [0, 0], [0.5, 0.5])) == 0.0


def test_each_truth_is_read_in_its_own_way() -> None:
    alike, apart = [prospect([0.0]), prospect([0.0])], [prospect([0.0]), prospect([9.0])]
    found = resolving([alike, apart], [0, 1], [0.5, 0.5])
    assert found[0] == 0.0
    assert found[1] > 0.95


def test_third_candidate_that_is_not_told_apart_keeps_a_set() -> None:
    three = [prospect([0.0]), prospect([8.0]), prospect([8.0])]
    first, *others = resolving([three], [0, 0, 0], [0.4, 0.3, 0.3])
    assert first > 0.95
    assert max(others) == 0.0
