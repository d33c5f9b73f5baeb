# SPDX-License-Identifier: Apache-2.0
"""
Steps at unknown times: found by their Bayes factors, with a probability and a date.

Between each two runs there may be a step, with a prior probability in proportion to the
time between them. The step that the runs ask for most is taken in where all places
together make "one more step" probable enough, and the search goes on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.samples import Float64
from shipdrag_ros.trend.hull_state import Growth, HullState, Runs, Steps

STEPS_PER_YEAR = 0.5  # cleanings, surprises in port, that nobody wrote down
PROBABLE = 0.5  # of "one more step": what is reported
_NEAR_YEARS = 31.0 / 365.25
_AT_LEAST_RUNS = 2  # on either side: one run alone is an outlier as well
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


def search(runs: Runs, known: Steps, growth: Growth) -> tuple[HullState, list[FoundStep]]:
    """
    Find the steps that the runs ask for beside those that are known.

    Parameters
    ----------
    runs
        Of one ship.
    known
        Steps that a log book tells.
    growth
        Prior of the growth.

    Returns
    -------
    state, found
        The state with all steps, and those that were found, in the order of time.
    """
    taken: list[float] = []
    state = HullState(runs, known, growth)
    while len(taken) < _MOST:
        years, probability = _one_more(state)
        if probability.sum() < PROBABLE:
            break
        taken.append(float(years[int(probability.argmax())]))
        steps = Steps(np.sort(np.append(known.years, taken)))
        state = HullState(runs, steps, growth, outlier=state.outlier)
    found = []
    for year in sorted(taken):
        others = [each for each in taken if each != year]
        steps = Steps(np.sort(np.append(known.years, others)))
        without = HullState(runs, steps, growth, outlier=state.outlier)
        years, probability = _one_more(without)
        near = np.abs(years - year) <= _NEAR_YEARS
        found.append(FoundStep(year, float(probability[near].sum())))
    return state, found


def _one_more(state: HullState) -> tuple[Float64, Float64]:
    """Return the places of one more step, and the probability of each."""
    years = state.runs.years
    places = np.arange(_AT_LEAST_RUNS, len(years) - _AT_LEAST_RUNS + 1)
    if len(places) == 0:
        return np.zeros(0), np.zeros(0)
    gaps = np.maximum(years[places] - years[places - 1], 1e-6)
    after = (np.arange(len(years))[:, None] >= places[None, :]).astype(float)
    log_odds = state.log_bayes_factors(after) + np.log(STEPS_PER_YEAR * gaps)
    top = max(float(log_odds.max()), 0.0)
    odds = np.exp(log_odds - top)
    middle = 0.5 * (years[places] + years[places - 1])
    return middle, np.asarray(odds / (odds.sum() + np.exp(-top)))
