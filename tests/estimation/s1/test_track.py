# SPDX-License-Identifier: Apache-2.0
"""Distance along the track: unbiased by noise, right where the track bends."""

from __future__ import annotations

import numpy as np
import pytest

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.s1.track import along_track
from shipdrag_ros.regression import OrthogonalBasis

TIME = np.linspace(-1.0, 1.0, 400)
BASIS = OrthogonalBasis.on(TIME, 12)
DISTANCE = 4000.0 * (1.0 - np.exp(-(TIME + 1.0)))


@pytest.mark.parametrize('course_rad', [0.0, 1.0, 2.5, -1.6])
def test_straight_track_is_a_projection(course_rad: float) -> None:
    direction = np.array([np.cos(course_rad), np.sin(course_rad)])
    position = DISTANCE[:, None] * direction + [5e5, -6e6]
    np.testing.assert_allclose(along_track(TIME, position, BASIS), DISTANCE, rtol=0.0, atol=1e-8)


def test_noise_does_not_lengthen_the_track() -> None:
    rng = np.random.default_rng(1)
    position = np.stack([DISTANCE, np.zeros(400)], axis=1) + 10.0 * rng.normal(size=(400, 2))
    length = np.diff(along_track(TIME, position, BASIS)[[0, -1]])[0]
    summed = np.hypot(*np.diff(position, axis=0).T).sum()
    assert abs(length - DISTANCE[-1]) < 5.0 * 10.0 * np.sqrt(2.0)
    assert summed > 1.5 * DISTANCE[-1]


@pytest.mark.parametrize('noise_m', [0.0, 2.0])
def test_bent_track_has_the_length_of_its_arc(noise_m: float) -> None:
    # a turn through 30 degrees: the projection alone is 1 % short
    bearing = 0.5 * DISTANCE / DISTANCE[-1]
    radius = DISTANCE[-1] / 0.5
    position = radius * np.stack([np.sin(bearing), 1.0 - np.cos(bearing)], axis=1)
    position += noise_m * np.random.default_rng(2).normal(size=(400, 2))
    fitted, _ = BASIS.fit(along_track(TIME, position, BASIS))
    smooth = fitted @ BASIS.columns
    error = smooth - smooth[0] - DISTANCE
    assert np.abs(error).max() < 0.1 + 2.0 * noise_m
    chord = np.hypot(*(position[-1] - position[0]))
    assert DISTANCE[-1] - chord > 30.0


def test_positions_without_a_direction_are_refused() -> None:
    with pytest.raises(EstimationError, match='without a direction of travel'):
        along_track(TIME, np.full((400, 2), 3.0), BASIS)
