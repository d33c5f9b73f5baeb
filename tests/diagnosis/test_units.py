# SPDX-License-Identifier: Apache-2.0
"""A log that is off by the ratio of two units is asked about them."""

from __future__ import annotations

import pytest

from shipdrag_ros.diagnosis.verdict import asked


@pytest.mark.parametrize(
    ('ratio', 'words'),
    [
        (1.94, 'knots over m/s'),
        (0.52, 'm/s over knots'),
        (3.55, 'km/h over m/s'),
        (1.85, 'km/h over knots'),
        (0.28, 'm/s over km/h'),
        (2.24, 'mph over m/s'),
        (1.15, 'mph over knots'),
        (0.62, 'mph over km/h'),
    ],
)
def test_a_ratio_of_two_units_is_asked_about(ratio: float, words: str) -> None:
    assert words in asked(ratio)
    assert '--map speed_through_water=COLUMN:kn' in asked(ratio)


@pytest.mark.parametrize('ratio', [1.0, 0.8, 1.2, 1.4, 0.4, 2.5, 0.0, -1.94, float('nan')])
def test_an_error_of_a_wheel_is_none(ratio: float) -> None:
    assert asked(ratio) == ''
