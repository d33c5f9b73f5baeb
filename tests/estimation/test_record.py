# SPDX-License-Identifier: Apache-2.0
"""Means of readings: none is lost at either end, and none hides how the speed bends."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.estimation.record import condense, right
from shipdrag_ros.inference.rows import LOG, Rows


def test_the_first_readings_of_a_fast_fall_are_right() -> None:
    # 15 s apart, a tenth of the speed lost between two: far more than their noise of 0.05 m/s
    time_s = 15.0 * np.arange(100.0)
    rng = np.random.default_rng(0)
    value = 8.2 / (1.0 + time_s / 150.0) + 0.05 * rng.standard_normal(100)
    rows = Rows(time_s, np.full(100, LOG), value)
    _, variance = condense(rows, np.full(100, 0.05**2), 8.2, 150.0)
    assert variance[0] < 1.2 * 0.05**2
    assert variance[-1] < 1.2 * 0.05**2


def test_a_spike_is_not_right_wherever_it_stands() -> None:
    time_s = 2.0 * np.arange(200.0)
    rng = np.random.default_rng(1)
    for at in (0, 3, 100, 199):
        value = 8.0 / (1.0 + time_s / 300.0) + 0.02 * rng.standard_normal(200)
        value[at] += 2.0
        assert right(time_s, value, np.full(200, 0.02), 0.01)[at] < 1e-3


@pytest.mark.parametrize('halved_s', [20.0, 300.0])
def test_a_mean_is_the_speed_at_its_time(halved_s: float) -> None:
    # without noise: what is left is the bend of the speed within a mean, 3e-4 of it
    time_s = 0.2 * np.arange(round(40.0 * halved_s))
    speed = 3.0 / (1.0 + time_s / halved_s)
    rows = Rows(time_s, np.full(len(time_s), LOG), speed)
    means, _ = condense(rows, np.full(len(time_s), 0.02**2), 3.0, halved_s)
    exact = 3.0 / (1.0 + means.time_s / halved_s)
    np.testing.assert_allclose(means.value, exact, rtol=4e-4)
