# SPDX-License-Identifier: Apache-2.0
"""
How probable effects are before any data.

Each is missing or not whatever the others are, so that a pair is as probable as
the odds of its two say; three at once are not looked for.
"""

from __future__ import annotations

from collections.abc import Sequence

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
    pairs = 0.5 * (ones**2 - sum(effect.odds**2 for effect in effects))
    return 1.0 / (1.0 + ones + pairs + places * UNNAMED_ODDS)
