# SPDX-License-Identifier: Apache-2.0
"""Where r(v) may be used."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.estimation.result import FroudeMax, ResistanceCurve, ValidRange, froude_max


def curve(froude: np.ndarray, slope: np.ndarray, slope_sigma: float) -> ResistanceCurve:
    unused = np.ones_like(froude)
    return ResistanceCurve(
        froude, unused, unused, unused, froude, slope, slope_sigma * unused, unused
    )


FROUDE = np.linspace(0.05, 0.25, 201)
HUMP = np.exp(-(((FROUDE - 0.16) / 0.02) ** 2))


@pytest.mark.parametrize(
    ('slope', 'slope_sigma', 'expected', 'by'),
    [
        (FROUDE + 0.5 * HUMP, 0.1, 0.16, FroudeMax.INFLECTION),
        # the same hump inside the band
        (FROUDE + 0.5 * HUMP, 0.3, 0.25, FroudeMax.BRANCH_TOP),
        # a wiggle before it does not count
        (FROUDE + 0.5 * HUMP + 0.05 * np.sin(300 * FROUDE), 0.1, 0.16, FroudeMax.INFLECTION),
        # from the bottom on it only falls: no maximum
        (-FROUDE, 1e-3, 0.25, FroudeMax.BRANCH_TOP),
        # a fall at the bottom, then the hump
        (0.5 * HUMP - 4.0 * np.minimum(FROUDE, 0.1), 0.05, 0.16, FroudeMax.INFLECTION),
        # a dip that is overcome before it is significant, then the transient
        (10.0 * FROUDE + 0.05 * HUMP, 0.1, 0.25, FroudeMax.BRANCH_TOP),
        # a significant wiggle at low speed, far exceeded further up
        (
            FROUDE + 0.5 * np.exp(-(((FROUDE - 0.06) / 0.005) ** 2)) + 5.0 * FROUDE,
            0.1,
            0.25,
            FroudeMax.BRANCH_TOP,
        ),
        (np.zeros(201), 0.1, 0.25, FroudeMax.BRANCH_TOP),
    ],
    ids=['hump', 'in the band', 'wiggle', 'falling', 'fall first', 'overcome', 'exceeded', 'flat'],
)
def test_upper_end(slope: np.ndarray, slope_sigma: float, expected: float, by: FroudeMax) -> None:
    top, rule = froude_max(curve(FROUDE, slope, slope_sigma))
    assert rule is by
    np.testing.assert_allclose(top, expected, rtol=0.0, atol=6e-3)


def test_valid_range_and_its_w() -> None:
    r = 1e-3 * FROUDE**2
    sigma = np.where(FROUDE > 0.2, 1.0, 1e-6)
    hump = replace(
        curve(FROUDE, FROUDE + 0.5 * HUMP, 0.1), resistance_m_s2=r, sigma_repeatable_m_s2=sigma
    )
    cut, whole = ValidRange.of_polynomial(hump), ValidRange.of_branch(hump)
    assert cut.froude_valid == (0.05, froude_max(hump)[0])
    assert cut.froude_max_by is FroudeMax.INFLECTION
    assert whole.froude_valid == (0.05, 0.25)
    assert whole.froude_max_by is FroudeMax.BRANCH_TOP
    assert (
        cut.froude_max_argmax == whole.froude_max_argmax == FROUDE[np.argmax(FROUDE + 0.5 * HUMP)]
    )
    # the wide band above the cut is not in the first one
    np.testing.assert_allclose(
        cut.max_relative_sigma, 1e-6 / r[cut.froude_valid[1] >= FROUDE].max(), rtol=1e-14
    )
    np.testing.assert_allclose(whole.max_relative_sigma, 1.0 / r.max(), rtol=1e-14)
