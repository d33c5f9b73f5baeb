# SPDX-License-Identifier: Apache-2.0
"""The page of a towed cable and its pictures."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.studies.cable.drag import Cable, CableSurface, Tangent, tangent_range
from shipdrag_ros.studies.cable.face import verb as words

CABLE = Cable(50.0, 0.1, CableSurface.ROUGH)
TANGENT = Tangent(CABLE.in_water(1025.0), 2.0)


def test_the_picture_shows_the_lines_and_the_range() -> None:
    for tolerance in (0.1, 2.0):
        top, bottom = words.tangent_picture(TANGENT, tolerance).axes
        drag, touching, naive = (np.asarray(line.get_data()) for line in top.get_lines()[:3])
        np.testing.assert_allclose(drag[1], TANGENT.drag.force_n(drag[0]), rtol=1e-14)
        assert np.all(touching[1] <= drag[1] + 1e-9)
        np.testing.assert_allclose(
            naive[1], naive[0] * TANGENT.drag.force_n(np.ones(1)), rtol=1e-14
        )
        (shaded,) = bottom.patches
        low, high = tangent_range(tolerance)
        assert shaded.get_x() == low * 2.0
        np.testing.assert_allclose(
            shaded.get_x() + shaded.get_width(), min(high, 2.5) * 2.0, rtol=1e-14
        )


def test_the_cable_is_marked_among_the_coefficients() -> None:
    (axis,) = words.coefficient_picture(CABLE).axes
    *_, mark = axis.get_lines()
    assert (mark.get_xdata()[0], mark.get_ydata()[0]) == (CABLE.slenderness, CABLE.c0)
