# SPDX-License-Identifier: Apache-2.0
"""The benchmark of calibration draws records that can be fitted, and its ranks are spread."""

from __future__ import annotations

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]


def test_the_true_r_is_inside_the_band() -> None:
    """N = 16, seed 11: with 95 % inside, 11 or fewer of 16 are inside once in 2000 times."""
    spec = spec_from_file_location('calibration', ROOT / 'benchmarks' / 'calibration.py')
    assert spec is not None
    assert spec.loader is not None
    calibration = module_from_spec(spec)
    sys.modules['calibration'] = calibration
    spec.loader.exec_module(calibration)
    found, failed = calibration.ranks(16, 11)
    assert failed <= 2
    inside = np.abs(found - 0.5) < 0.475
    assert inside.sum() >= 12 - failed
    # on either side of the truth, and not all in the middle
    assert found.min() < 0.4
    assert found.max() > 0.6
    assert np.std(found) > 0.15
