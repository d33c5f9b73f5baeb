# SPDX-License-Identifier: Apache-2.0
"""Effects are missing or not whatever the others are."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import pytest

from shipdrag_ros.diagnosis.model import UNNAMED_ODDS, nothing_missing
from shipdrag_ros.simulation.effects import LIBRARY


def test_all_that_may_be_adds_up_to_one() -> None:
    effects = [replace(one, odds=0.01 * k) for k, one in enumerate(LIBRARY.values(), start=1)]
    nothing = nothing_missing(effects, places=3)
    ones = sum(nothing * effect.odds for effect in effects)
    together = [(a, b) for a, b in combinations(effects, 2) if a.goes_with(b)]
    assert len(together) == len(effects) * (len(effects) - 1) // 2 - 3  # states of a propeller
    pairs = sum(nothing * one.odds * other.odds for one, other in together)
    assert nothing + ones + pairs + 3 * nothing * UNNAMED_ODDS == pytest.approx(1.0)


def test_that_nothing_is_missing_is_as_probable_as_not() -> None:
    assert 0.4 < nothing_missing(list(LIBRARY.values()), places=3) < 0.6
