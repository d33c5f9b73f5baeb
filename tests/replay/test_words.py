# SPDX-License-Identifier: Apache-2.0
"""Sentences say what the figures say."""

from __future__ import annotations

from dataclasses import replace

from shipdrag_ros.coastdown.events import ENDED_BY, EndedBy
from shipdrag_ros.replay import Recorded, words


def test_every_end_has_words() -> None:
    assert set(ENDED_BY) == set(EndedBy)


def test_the_comparison_with_the_bag_is_said() -> None:
    assert 'it holds none, or was replayed' in words.recorded_sentence(Recorded(0, 0, None))
    assert 'All 7 outputs' in words.recorded_sentence(Recorded(7, 7, None))
    differs = words.recorded_sentence(Recorded(7, 6, '/coastdown_node/speed at 12 ns', 0.1))
    assert '6 of 7' in differs
    assert 'first difference: /coastdown_node/speed at 12 ns' in differs
    rounding = words.recorded_sentence(Recorded(7, 6, 'x', 3e-14))
    assert 'more than 3e-14 of its value' in rounding


def test_a_coastdown_without_estimate_gives_its_reason(coastdown, ship):
    failed = replace(coastdown, estimate=None, failure='too few samples')
    assert words.summary(failed, ship) == ('No resistance could be estimated: too few samples.',)
    assert coastdown.estimate is not None
    assert words.summary(coastdown, ship) == coastdown.estimate.summary(ship)
