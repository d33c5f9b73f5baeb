# SPDX-License-Identifier: Apache-2.0
"""The page of a towed cable and its pictures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from shipdrag_ros.cli.output import Output
from shipdrag_ros.studies.cable.drag import Cable, CableSurface, Tangent, tangent_range
from shipdrag_ros.studies.cable.face import verb as words
from shipdrag_ros.studies.face import show

CABLE = Cable(50.0, 0.1, CableSurface.ROUGH)
TANGENT = Tangent(CABLE.in_water(1025.0), 2.0)


def test_the_page_stands_alone(tmp_path: Path, read_page: Callable[[Path], Any]) -> None:
    show(Output(), words.shown(CABLE, TANGENT, 0.25), tmp_path / 'page.html')
    page = read_page(tmp_path / 'page.html')
    assert page.links == []
    assert len(page.images) == 2
    assert 'A rough cable, 50 m by 0.1 m' in page.text
    assert 'within 25 % of it from 1.333 m/s to 4 m/s' in page.text
    assert '0.6667 1.333 -25.0 -25.0' in page.text


def test_an_open_range_is_told() -> None:
    rows = dict(words.facts(CABLE, TANGENT, 4.0).rows)
    assert rows['tangent within 400 %, u = V/V0'] == 'above 0.33333'
    assert rows['tangent within 400 %, V'] == 'above 0.66667 m/s'
    assert 'without upper end' in words.line(TANGENT, 4.0)


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
