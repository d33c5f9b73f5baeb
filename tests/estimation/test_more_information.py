# SPDX-License-Identifier: Apache-2.0
"""The more is known of a coastdown, the likelier is the true r(v)."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.accuracy import more_information as script

CASES = 4


def test_no_input_and_no_second_run_makes_it_worse() -> None:
    # N = 4, seed 0; a step may lose by chance, by less than two standard errors; the benchmark
    # N = 4, seed 0; a step may lose by chance, by less than two standard errors; the benchmark
    # has N = 30. 0.05: the shaft's priors hold all laws of the thrust, which costs a little
    found = np.array([script.scores(number, 0) for number in range(CASES)])
    assert np.isfinite(found).all()
    for gain, error in script.gains(found):
        assert gain + error > -0.05
    assert found[:, -1].mean() > found[:, 0].mean()


def test_gains_are_those_of_the_same_case() -> None:
    # the second set gains 1 and 3 on the first, the third nothing on the second
    (first, of_first), (second, of_second) = script.gains(
        np.array([[0.0, 1.0, 1.0], [10.0, 13.0, 13.0]])
    )
    assert first == pytest.approx(2.0)
    assert of_first == pytest.approx(2.0)
    assert (second, of_second) == (0.0, 0.0)
