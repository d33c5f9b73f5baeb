# SPDX-License-Identifier: Apache-2.0
"""Hulls compared are all drawn."""

from __future__ import annotations

from shipdrag_ros.estimation.result import Estimate, FroudeMax
from shipdrag_ros.replay import pictures
from shipdrag_ros.replay.hulls import RankedHull


def test_hulls_beyond_the_colours_are_still_drawn(estimate: Estimate) -> None:
    hulls = [
        RankedHull(f'hull {n}', 0.1, FroudeMax.INFLECTION, (), estimate.valid_curve)
        for n in range(8)
    ]
    axis = pictures.comparison_picture(hulls).axes[0]
    assert [text.get_text() for text in axis.get_legend().get_texts()] == [
        hull.label for hull in hulls
    ]
    (dot,) = [line for line in axis.get_lines() if line.get_marker() == 'o'][:1]
    assert dot.get_xdata() == [0.1]
