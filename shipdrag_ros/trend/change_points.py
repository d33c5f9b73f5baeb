# SPDX-License-Identifier: Apache-2.0
"""
Steps at unknown times: found one after the other, with a probability and a date.

The step that the runs ask for most is taken in where "one more step" is probable enough
(`OneMore`), and the search goes on.

Between each two runs there may be a step that nobody wrote down: a cleaning takes away, a
stay in port adds. The prior probability of each is in proportion to the time between the
runs. What is said of growth and level is the mean over "no step" and a step at each place,
by their probabilities, so that a cleaning that may have been widens the band of the growth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.samples import Float64
from shipdrag_ros.trend.hull_state import Functional, Growth, HullState, Mixture, Runs, Steps

PROBABLE = 0.5  # of "one more step": what is reported
_DATED = 0.3  # of it within a month of its date
_SURE = 0.99  # of a step that is there in all that is said of the hull
_NEAR_YEARS = 31.0 / 365.25
_MOST = 20
DOWN_PER_YEAR = 1.0  # cleanings that nobody wrote down
UP_PER_YEAR = 0.1  # sudden growth, in port for instance
_SIZES = (0.05, 0.1, 0.2)  # of a step, equally likely
_SIZE_SD = 0.4  # of each, as a share of it: together from 3 to 30 %, and none about 0
_AT_LEAST_RUNS = 2  # on either side: one run alone is an outlier as well
_NEGLIGIBLE = 1e-6


class OneMore:
    """
    The posterior of a hull's state where there may be one step more.

    Parameters
    ----------
    state
        Without it.

    Attributes
    ----------
    years : (m,)
        Where it may be: the middle between the runs around it.
    probability : (m,)
        Of a step at each place; what is missing to 1 is that there is none.
    """

    def __init__(self, state: HullState) -> None:
        self.state = state
        times = state.runs.years
        self._places = np.arange(_AT_LEAST_RUNS, max(len(times) - 1, _AT_LEAST_RUNS))
        before = times[self._places - 1]
        gaps = np.maximum(times[self._places] - before, 1e-6)
        self.years = before + 0.5 * gaps
        self._after = state.steps.carried(times, self.years)
        self._kinds = np.array(
            [(-size, DOWN_PER_YEAR) for size in _SIZES] + [(size, UP_PER_YEAR) for size in _SIZES]
        )
        shape = len(state.weights), len(self._kinds), len(self.years)
        log_odds = np.full(shape, -np.inf)
        self._mean, self._variance = np.zeros(shape), np.zeros(shape)
        size, rate = self._kinds.T[:, :, None]
        sd = _SIZE_SD * np.abs(size)
        log_prior = np.log(rate / len(_SIZES) * gaps)
        for number, weight in enumerate(state.weights):
            # no setting is too improbable: what the step explains was scatter without it
            tightness, pull = state.asked_for(number, self._after)
            variance = 1.0 / (tightness + sd**-2)
            mean = variance * (pull + size / sd**2)
            fit = 0.5 * (np.log(variance / sd**2) + mean**2 / variance - (size / sd) ** 2)
            log_odds[number] = np.log(max(float(weight), 1e-300)) + log_prior + fit
            self._mean[number], self._variance[number] = mean, variance
        top = max(float(log_odds.max(initial=-np.inf)), 0.0)
        odds, none = np.exp(log_odds - top), state.weights * np.exp(-top)
        total = odds.sum() + none.sum()
        self._odds, self._none = odds / total, none / total
        self.probability = self._odds.sum(axis=(0, 1))

    def level(self, years: Float64) -> Mixture:
        """
        Return the added resistance at some times, covariates at their mean.

        Parameters
        ----------
        years : (m,)
            Since the first run, 0 or later.
        """
        after = self.state.steps.carried(years, self.years)
        return self._over_all(self.state.level_of(years), after, after)

    def growth_per_year(self) -> Mixture:
        """
        Return the mean growth between cleanings; a step upwards is growth too.
        """
        end = max(float(self.state.runs.years[-1]), 1e-9)
        up = np.full((1, len(self.years)), 1.0 / end)
        return self._over_all(self.state.growth_of(), np.zeros_like(up), up)

    def _over_all(self, asked: Functional, down: Float64, up: Float64) -> Mixture:
        """
        Return the posterior of functionals, in which a jump counts as stated.

        Parameters
        ----------
        asked
            Of the state without the step.
        down, up : (k, m)
            How much a jump at each place counts in each.
        """
        mean = np.zeros(len(asked.columns))
        second = np.zeros(len(asked.columns))
        share = self._none + self._odds.sum(axis=(1, 2))
        for number in np.flatnonzero(share > _NEGLIGIBLE).tolist():
            value, variance, gain = self.state.given(number, asked)
            mean += self._none[number] * value
            second += self._none[number] * (value**2 + variance)
            seen = gain @ self._after
            for kind, (size, _) in enumerate(self._kinds):
                odds = self._odds[number, kind]
                moves = (up if size > 0.0 else down) - seen
                moved = value[:, None] + moves * self._mean[number, kind]
                spread = variance[:, None] + moves**2 * self._variance[number, kind]
                mean += moved @ odds
                second += (moved**2 + spread) @ odds
        return Mixture(mean, np.sqrt(np.maximum(second - mean**2, 0.0)))


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
    for year in taken:
        known = known.with_one(year)
    return known


def _most_likely(more: OneMore) -> tuple[float, float]:
    """Return the place with most about it within a month, and how probable that is."""
    near = np.abs(more.years[:, None] - more.years[None, :]) <= _NEAR_YEARS
    within = near @ more.probability
    best = int((within + more.probability).argmax())  # the step itself, of all near it
    return float(more.years[best]), float(within[best])
