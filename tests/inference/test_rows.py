# SPDX-License-Identifier: Apache-2.0
"""Robust scale, against the normal distribution."""

import pytest
from scipy.stats import norm

from shipdrag_ros.inference.rows import MAD_TO_SD


def test_the_median_of_normal_noise_gives_its_standard_deviation() -> None:
    assert pytest.approx(1.0 / norm.ppf(0.75), rel=1e-12) == MAD_TO_SD
