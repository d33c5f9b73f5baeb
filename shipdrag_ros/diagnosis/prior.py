# SPDX-License-Identifier: Apache-2.0
"""
How probable effects are before any data.

Each is missing or not whatever the others are, so that a pair is as probable as
the odds of its two say, if it can be; three at once are not looked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from shipdrag_ros.simulation.effect import Effect

UNNAMED_ODDS = 0.015  # of something that is none of the library, in each place where it can be


def nothing_missing(effects: Sequence[Effect], *, places: int) -> float:
    """
    Return the probability that nothing is missing.

    Parameters
    ----------
    effects
        That may be.
    places
        Where something unnamed may be besides.
    """
    ones = sum(effect.odds for effect in effects)
    pairs = sum(a.odds * b.odds for a, b in combinations(effects, 2) if a.goes_with(b))
    return 1.0 / (1.0 + ones + pairs + places * UNNAMED_ODDS)
