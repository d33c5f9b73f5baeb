# SPDX-License-Identifier: Apache-2.0
"""Hulls compared are all drawn, and cuts are named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipdrag_ros.coastdown.events import Dismissal, EndedCoastdown, NotCoastdown, Regimes
from shipdrag_ros.coastdown.regimes.bank import OUT
from shipdrag_ros.estimation.result import Estimate, FroudeMax
from shipdrag_ros.replay import page
from shipdrag_ros.replay.together import RankedHull


def test_hulls_beyond_the_colours_are_still_drawn(estimate: Estimate) -> None:
    hulls = [
        RankedHull(f'hull {n}', 0.1, FroudeMax.INFLECTION, (), estimate.valid_curve)
        for n in range(8)
    ]
    axis = page.comparison_picture(hulls).axes[0]
    assert [text.get_text() for text in axis.get_legend().get_texts()] == [
        hull.label for hull in hulls
    ]
    (dot,) = [line for line in axis.get_lines() if line.get_marker() == 'o'][:1]
    assert dot.get_xdata() == [0.1]


def test_a_cut_is_named_where_there_is_room_for_its_name(coastdown: EndedCoastdown) -> None:
    start_ns, end_ns = coastdown.start_ns, coastdown.end_ns
    length_ns = end_ns - start_ns
    cuts = tuple(
        NotCoastdown(start_ns + round(a * length_ns), start_ns + round(b * length_ns), reason, '')
        for a, b, reason in ((0.5, 0.8, Dismissal.THRUST), (0.9, 0.91, Dismissal.TURN))
    )
    share = np.array([1.0, 0.0])
    regimes = Regimes(
        np.array([start_ns, end_ns]),
        np.array([8.0, 1.0]),
        {name: 1.0 - share if name == 'gliding' else 0.0 * share for name in OUT}
        | {'driven': share},
        0.0,
        0.5,
    )
    shown = replace(coastdown, cuts=cuts, regimes=regimes)
    axis, strip = page.cut_picture(shown, None, 2e7).axes
    assert [text.get_text() for text in axis.texts] == [cuts[0].reason.value]
    assert len(axis.patches) == len(cuts)
    assert axis.get_xlim() == pytest.approx((0.0, length_ns * 1e-9))
    assert [text.get_text() for text in strip.get_legend().get_texts()] == ['driven', 'gliding']
