# SPDX-License-Identifier: Apache-2.0
"""Runs drawn from the priors of the model: bands and probabilities mean what they say."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from benchmarks.accuracy import posterior_calibration as script
from shipdrag_ros.errors import EstimationError


def test_bands_and_probabilities_of_drawn_runs() -> None:
    # N = 30, seed 7. Cover within a run is all or nothing at worst: sd 0.95 0.05 / 30 -> 0.04,
    # so 0.83 is three of them below 0.95; probability said and share right differ by 3 sd = 0.24
    found = []
    for number in range(30):
        with suppress(EstimationError):  # a fit that does not settle is refused
            found.append(script.place(np.random.default_rng([7, number])))
    assert len(found) >= 29
    assert np.mean([each.cover for each in found]) > 0.83
    assert np.mean([each.chi2 for each in found]) < 2.0
    said = np.mean([each.best_chance for each in found])
    right = np.mean([each.best == each.name for each in found])
    assert abs(said - right) < 0.24
