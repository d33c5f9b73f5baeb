# SPDX-License-Identifier: Apache-2.0
"""
Steps at unknown times: found one after the other, with a probability and a date.

The step that the runs ask for most is taken in where "one more step" is probable enough
(`one_more`), and the search goes on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.trend.hull_state import Growth, HullState, Runs, Steps
from shipdrag_ros.trend.one_more import OneMore

PROBABLE = 0.5  # of "one more step": what is reported
_DATED = 0.3  # of it within a month of its date
_SURE = 0.99  # of a step that is there in all that is said of the hull
_NEAR_YEARS = 31.0 / 365.25
_MOST = 20


@dataclass(frozen=True)
class FoundStep:
    """
    A step that no log book knows.

    Attributes
    ----------
    year
        Since the first run.
    probability
        That there is a step within a month of it.
    """

    year: float
    probability: float


@dataclass(frozen=True)
class Found:
    """
    What the runs of one ship show.

    Attributes
    ----------
    state
        With all steps, known and found.
    steps
        Those found, in the order of time.
    open
        The posterior in which the least certain step is not taken for granted.
    """

    state: HullState
    steps: tuple[FoundStep, ...]
    open: OneMore


def search(runs: Runs, known: Steps, growth: Growth) -> Found:
    """
    Find the steps that the runs ask for beside those that are known.

    Parameters
    ----------
    runs
        Of one ship.
    known
        Steps that a log book notes.
    growth
        Prior of the growth.
    """
    taken: list[float] = []
    state = HullState(runs, known, growth)
    more = OneMore(state)
    while len(taken) < _MOST and more.probability.sum() >= PROBABLE:
        year, probability = _most_likely(more)
        if probability < _DATED or year in taken:  # two at one time are one
            break
        taken.append(year)
        state = HullState(runs, _with(known, taken), growth, outlier=state.outlier)
        more = OneMore(state)
    found = []
    least = _SURE
    for year in sorted(taken):
        others = [each for each in taken if each != year]
        without = HullState(runs, _with(known, others), growth, outlier=state.outlier)
        one = OneMore(without)
        near = np.abs(one.years - year) <= _NEAR_YEARS
        found.append(FoundStep(year, float(one.probability[near].sum())))
        if found[-1].probability < least:
            least, more = found[-1].probability, one
    return Found(state, tuple(found), more)


def _with(known: Steps, taken: list[float]) -> Steps:
    return Steps(np.sort(np.append(known.years, taken)))


def _most_likely(more: OneMore) -> tuple[float, float]:
    """Return the place with most about it within a month, and how probable that is."""
    near = np.abs(more.years[:, None] - more.years[None, :]) <= _NEAR_YEARS
    within = near @ more.probability
    best = int((within + more.probability).argmax())  # the step itself, of all near it
    return float(more.years[best]), float(within[best])
