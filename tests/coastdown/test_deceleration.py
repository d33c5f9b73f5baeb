# SPDX-License-Identifier: Apache-2.0
"""Where a speed begins to fall, and by which power of itself."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.coastdown.bins import Bins
from shipdrag_ros.coastdown.deceleration import begin_of_fall, bend, fit_deceleration
from shipdrag_ros.coastdown.filling import add, close
from shipdrag_ros.samples import Channel

S = 1_000_000_000
LOG = int(Channel.SPEED_THROUGH_WATER)


def binned(speed) -> Bins:
    bins = Bins.fresh(1000)
    for number, v in enumerate(speed):
        if bins.samples[LOG]:
            close(bins, LOG, 60)
        add(bins, LOG, number, number * S, float(v), 0.0)
    return bins


def test_a_change_point_is_found_in_noise() -> None:
    time = np.maximum(0.0, np.arange(300.0) - 170.0)
    found = []
    for seed in range(30):
        noise = 0.05 * np.random.default_rng(seed).standard_normal(300)
        found.append(begin_of_fall(binned(8.2 / (1 + time / 410) + noise), LOG, 50, 298, 2.0))
    # 30 records, each good to 2 s or so
    assert abs(np.mean(found) - 170.0) < 1.5
    assert np.std(found) < 4.0


def test_the_end_of_coasting_is_found_in_noise() -> None:
    time = np.arange(300.0)
    coasting = 8.2 / (1 + np.minimum(time, 200.0) / 410)
    speed = coasting + 0.01 * np.maximum(0.0, time - 200.0)
    speed += 0.02 * np.random.default_rng(1).standard_normal(300)
    found = bend(binned(speed), LOG, 0, 298, 2.0, degree=1, sign=-1)
    assert abs(found - 200) < 5


@pytest.mark.parametrize('p', [1.5, 2.0, 3.0])
def test_the_exponent_of_the_law(p: float) -> None:
    time = np.arange(120.0)
    grown = 1.0 + (p - 1.0) * 0.02 * time / 8.2
    found = fit_deceleration(time, 8.2 * grown ** (-1.0 / (p - 1.0)))
    np.testing.assert_allclose(found.exponent, p, rtol=0.05)
