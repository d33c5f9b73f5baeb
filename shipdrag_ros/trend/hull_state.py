# SPDX-License-Identifier: Apache-2.0
"""
The state of one hull against time: a Gaussian process with steps.

The added resistance x(t) of a hull, a fraction of the clean hull's, is modelled as

    x(t) = clean + fouling(t) + wander(t),  fouling(t) = level + growth t + changes at events
    y_i  = x(t_i) + covariates b + scatter + error of the run,

A known event keeps a share of the fouling before it and adds a step of unknown size: after
a docking nothing of it is left but the error of the clean hull (`KINDS`). Growth may change.
wander an integrated Brownian motion (growth that changes slowly) and a plain one (growth in
bursts, in port for instance), scatter and wander of unknown size. All of it is Gaussian once
the three sizes are given; these are averaged over
a grid by their posterior weight. A run far off is an outlier with a small prior
probability and is given less weight, not removed. Steps at unknown times are found by
their Bayes factors (`search`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import reduce

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from shipdrag_ros.parameter import Parameter
from shipdrag_ros.samples import Float64

LEVEL_SD = 0.4  # a hull when its first run is seen: from clean to heavily fouled
GROWTH_PER_YEAR = (0.10, 0.12)  # merchant hulls: 5 to 20 % a year between cleanings
CLEAN_SD = 0.05  # of the stated clean hull: model tests, added mass, the paint of a new hull
STEP_SD = 0.10  # that no log book notes: a cleaning, a sudden growth in port
GROWTH_CHANGE_SD = 0.10  # per year, after a step: new paint, another trade
COVARIATE_SD = 1.0  # relative resistance for a relative change of displacement
SEASON_SD = 0.005  # of a yearly wave: light, water and trade
SCATTER = np.array([0.004, 0.008, 0.014, 0.022, 0.035, 0.06, 0.11])
_SCATTER_PRIOR = np.exp(-0.5 * (np.log(SCATTER / 0.03) / 0.8) ** 2)
WANDER = np.array([0.0, 0.06, 0.18])  # growth per year, per square root of a year
_WANDER_PRIOR = np.array([0.4, 0.35, 0.25])
WALK = np.array([0.0, 0.015, 0.04])  # of the level, per square root of a year: growth in bursts
_WALK_PRIOR = np.array([0.5, 0.25, 0.25])
_OUTLIER_PROBABILITY, _OUTLIER_SCALE = 0.02, 6.0
KINDS = {
    'docking': (0.0, 0.07),  # blasted and painted: what is left differs from dock to dock
    'coating': (0.0, 0.07),
    'cleaning': (0.3, 0.08),  # divers leave 10 to 50 %
    'propeller_polish': (1.0, 0.02),  # the hull is as it was
}
"""Share of the fouling that an event keeps, and the sd of what it adds."""

_ROUNDS = 4
_NEGLIGIBLE = 1e-4  # weight of a setting
_GROWTH = 2  # the column of it


@dataclass(frozen=True)
class Runs:
    """
    The runs of one ship, in the order of time.

    Attributes
    ----------
    years : (n,)
        Time since the first run [years of 365.25 days].
    added, sd : (n,)
        Added resistance over the clean hull's, and its repeatable standard deviation.
    covariates : (n, k)
        What else moves the resistance, each about 0 on average.
    """

    years: Float64
    added: Float64
    sd: Float64
    covariates: Float64

    def __len__(self) -> int:
        return len(self.years)


@dataclass(frozen=True)
class Growth:
    """Prior of the growth of added resistance per year: mean and standard deviation."""

    mean: float = GROWTH_PER_YEAR[0]
    sd: float = GROWTH_PER_YEAR[1]


@dataclass(frozen=True)
class Steps:
    """
    Times at which the state of the hull may have jumped.

    Attributes
    ----------
    years : (m,)
        When, ascending; a run at that very time is after the step.
    kinds : tuple of str
        Of each, one of `KINDS`; '' where no log book notes it.
    """

    years: Float64 = field(default_factory=lambda: np.zeros(0))
    kinds: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.years)

    @property
    def keeps(self) -> Float64:
        """Share of the fouling that each keeps (m,)."""
        return np.array([KINDS.get(kind, (1.0, 0.0))[0] for kind in self._each()])

    @property
    def sd(self) -> Float64:
        """Standard deviation of what each adds (m,)."""
        return np.array([KINDS.get(kind, (1.0, STEP_SD))[1] for kind in self._each()])

    def with_one(self, year: float) -> Steps:
        """Return these and one that no log book notes."""
        place = int(np.searchsorted(self.years, year))
        kinds = list(self._each())
        kinds.insert(place, '')
        return Steps(np.insert(self.years, place, year), tuple(kinds))

    def carried(self, years: Float64, since: Float64) -> Float64:
        """Return how much of fouling that came at some times is left at others (n, m)."""
        left = (years[:, None] >= since[None, :]).astype(float)
        for when, keeps in zip(self.years, self.keeps):
            left[np.ix_(years >= when, since < when)] *= keeps
        return left

    def _each(self) -> tuple[str, ...]:
        return self.kinds or ('',) * len(self.years)


@dataclass(frozen=True)
class Mixture:
    """Mean and standard deviation of quantities, averaged over the sizes of the noise."""

    value: Float64
    sd: Float64

    @property
    def first(self) -> Parameter:
        """The first of them."""
        return Parameter(float(self.value[0]), float(self.sd[0]))


Part = tuple[Float64, Float64, Float64]  # weights (k,) or one; means and variances (m, k) or (m,)


def _mixed(parts: Iterable[Part]) -> Mixture:
    """Return the moments of what is a mixture of normal parts."""
    mean = second = np.zeros(1)
    for weight, value, variance in parts:
        mean = mean + np.dot(value, weight)
        second = second + np.dot(value**2 + variance, weight)
    return Mixture(mean, np.sqrt(np.maximum(second - mean**2, 0.0)))


@dataclass(frozen=True)
class Functional:
    """
    What is asked of the posterior: linear in the state of the hull.

    Attributes
    ----------
    columns : (m, p)
        Weights of the clean hull, level, growth, and of each step what it adds and the new growth.
    years : (m,)
        Where the wander counts; NaN: not at all.
    own : (m,)
        Divides the wander.
    """

    columns: Float64
    years: Float64
    own: Float64


class HullState:
    """
    The posterior of a hull's state, given the times of its steps.

    Parameters
    ----------
    runs
        At least one.
    steps
        When the state may have jumped.
    growth
        Prior of the growth.
    outlier : (n,)
        Where to begin the search for outliers.

    Attributes
    ----------
    weights : (g,)
        Posterior weight of each setting of scatter and wander; they sum to 1.
    log_evidence
        Of the runs, the sizes integrated out.
    outlier : (n,)
        Posterior probability that a run is an outlier.
    scatter
        Posterior mean of the scatter from run to run.
    """

    def __init__(
        self, runs: Runs, steps: Steps, growth: Growth, *, outlier: Float64 | None = None
    ) -> None:
        self.runs, self.steps, self.growth = runs, steps, growth
        self.outlier = np.zeros(len(runs)) if outlier is None else outlier
        self._settings = list(itertools.product(SCATTER.tolist(), WANDER.tolist(), WALK.tolist()))
        prior = itertools.product(_SCATTER_PRIOR, _WANDER_PRIOR, _WALK_PRIOR)
        self._log_prior = np.log([math.prod(each) for each in prior])
        mean, self._basis = self._prior(runs.years, runs.covariates)
        self._residual = runs.added - mean
        self._noise = [runs.sd**2 + scatter**2 for scatter, _, _ in self._settings]
        self._precision = [np.zeros((0, 0))] * len(self._settings)
        log_posterior = np.full(len(self._settings), -np.inf)
        solved: Sequence[int] = range(len(self._settings))
        for _ in range(_ROUNDS):
            self._solve(solved, log_posterior)
            before, self.outlier = self.outlier, self._outliers()
            if float(np.abs(self.outlier - before).max()) < 0.02:
                break
            # what weighs nothing says nothing of outliers
            solved = np.flatnonzero(self.weights > _NEGLIGIBLE).tolist()
        self._solve(range(len(self._settings)), log_posterior)
        self.scatter = float(self.weights @ np.array([each[0] for each in self._settings]))

    def _solve(self, numbers: Sequence[int], log_posterior: Float64) -> None:
        """Solve for some settings, set the weights of all, and the evidence."""
        for number in numbers:
            log_posterior[number] = self._solve_one(number)
        top = log_posterior.max()
        raw = np.exp(log_posterior - top)
        self.log_evidence = float(top + np.log(raw.sum()))
        self.weights = raw / raw.sum()

    def _solve_one(self, number: int) -> float:
        """Solve for a setting as outliers are now; return its log posterior but for a constant."""
        runs, (_, *sizes) = self.runs, self._settings[number]
        weight = 1.0 - self.outlier + self.outlier / _OUTLIER_SCALE**2
        covariance = self._basis + _wander(runs.years, runs.years, *sizes)
        covariance[np.diag_indices(len(runs))] += self._noise[number] / weight
        # hundreds of runs: LAPACK's; `inference.linear` is for the few unknowns of a fit
        factor, failed = lapack.dpotrf(covariance, lower=True)
        assert not failed, 'noise is never 0'
        half, _ = lapack.dpotri(factor, lower=True)
        precision = np.tril(half) + np.tril(half, -1).T
        self._precision[number] = precision
        return float(
            -0.5 * self._residual @ precision @ self._residual
            - np.log(np.diag(factor)).sum()
            # the weight stands for a wider normal: its own size is no evidence for it
            - 0.5 * np.log(weight).sum()
            + self._log_prior[number]
        )

    def _outliers(self) -> Float64:
        """Return how probable each run is an outlier, from what the others predict."""
        found = np.zeros(len(self.runs))
        for weight, precision, plain in zip(self.weights, self._precision, self._noise):
            if weight < _NEGLIGIBLE:
                continue
            diagonal = np.diag(precision)
            residual = (precision @ self._residual) / diagonal
            used = plain / (1.0 - self.outlier + self.outlier / _OUTLIER_SCALE**2)
            others = np.maximum(1.0 / diagonal - used, 0.0)
            prior = _OUTLIER_PROBABILITY / (1.0 - _OUTLIER_PROBABILITY)
            odds = prior * _normal(residual, others + plain * _OUTLIER_SCALE**2)
            found += weight * odds / (odds + _normal(residual, others + plain))
        return found

    def _columns(self, years: Float64) -> Float64:
        """Return clean hull, level, growth, and of each step what it adds and the new growth."""
        steps = self.steps
        later = np.maximum(years[:, None] - steps.years[None, :], 0.0)
        one = np.ones((len(years), 1))
        many = len(steps)
        found = np.hstack([one, one, years[:, None], np.zeros((len(years), many)), later])
        for number, jump in enumerate(self._jumps()):
            found[years >= steps.years[number]] += jump
        return found

    def _jumps(self) -> Float64:
        """Return what each step takes from the fouling before it and adds to it, as columns."""
        steps, many = self.steps, len(self.steps)
        jumps = np.zeros((many, 3 + 2 * many))
        for number, (when, keeps) in enumerate(zip(steps.years, steps.keeps)):
            before = jumps[:number].sum(axis=0)
            before[1:3] += (1.0, when)
            before[3 + many :] += np.maximum(when - steps.years, 0.0)
            jumps[number] = (keeps - 1.0) * before
            jumps[number, 3 + number] += 1.0
        return jumps

    def _sd(self) -> Float64:
        """Return the prior standard deviations of the columns."""
        change = np.full(len(self.steps), GROWTH_CHANGE_SD)
        first = (CLEAN_SD, math.sqrt(LEVEL_SD**2 - CLEAN_SD**2), self.growth.sd)
        return np.concatenate([first, self.steps.sd, change])

    def _prior(self, years: Float64, covariates: Float64) -> tuple[Float64, Float64]:
        """Return the prior mean of the runs and their covariance without noise and wander."""
        columns = self._columns(years)
        scaled, mean = columns * self._sd(), self.growth.mean * columns[:, _GROWTH]
        phase = 2.0 * np.pi * (years[:, None] - years[None, :])
        others = COVARIATE_SD**2 * covariates @ covariates.T + SEASON_SD**2 * np.cos(phase)
        return mean, scaled @ scaled.T + others

    def given(self, number: int, asked: Functional) -> tuple[Float64, Float64, Float64]:
        """
        Return the posterior of functionals under one setting of the sizes.

        Parameters
        ----------
        number
            Of the setting.
        asked
            The functionals.

        Returns
        -------
        value, variance : (m,)
            Of each.
        gain : (m, n)
            What each takes from each run.
        """
        runs, sd, sizes = self.runs, self._sd(), self._settings[number][1:]
        columns, own = asked.columns, asked.own
        wandering = np.isfinite(asked.years)
        at = np.where(wandering, asked.years, 0.0)  # where it began it is 0
        cross = (columns * sd**2) @ self._columns(runs.years).T
        cross += _wander(at, runs.years, *sizes) / own[:, None]
        gain = cross @ self._precision[number]
        value = columns[:, _GROWTH] * self.growth.mean + gain @ self._residual
        variance = (
            ((columns * sd) ** 2).sum(axis=1)
            + np.diag(_wander(at, at, *sizes)) / own**2
            - np.einsum('ij,ij->i', gain, cross)
        )
        return value, np.maximum(variance, 0.0), gain

    def _averaged(self, asked: Functional) -> Mixture:
        """Return the posterior of functionals, over all settings."""
        counting = np.flatnonzero(self.weights > _NEGLIGIBLE).tolist()
        parts = ((self.weights[number], *self.given(number, asked)[:2]) for number in counting)
        return _mixed(parts)

    def level(self, years: Float64) -> Mixture:
        """
        Return the added resistance at some times, covariates at their mean.

        Parameters
        ----------
        years : (m,)
            Since the first run, 0 or later.
        """
        return self._averaged(self.level_of(years))

    def level_of(self, years: Float64) -> Functional:
        """
        Return what the added resistance at some times is, as functionals.

        Parameters
        ----------
        years : (m,)
            Since the first run, 0 or later.
        """
        return Functional(self._columns(years), years, np.ones(len(years)))

    def growth_per_year(self) -> Mixture:
        """
        Return the mean growth between cleanings: the rise less what steps took away, over time.

        A step upwards is growth too: fouling in port, for instance.
        """
        return self._averaged(self.growth_of())

    def growth_of(self) -> Functional:
        """
        Return what the mean growth between cleanings is, as a functional.
        """
        end = max(float(self.runs.years[-1]), 1e-9)
        columns = self._columns(np.array([end])) - self._columns(np.zeros(1))
        columns -= self._jumps()[self.changes().value <= 0.0].sum(axis=0)
        return Functional(columns / end, np.array([end]), np.array([end]))

    def growth_since_last_step(self) -> Mixture:
        """
        Return the growth now, by the law since the last step.
        """
        columns = np.zeros((1, 3 + 2 * len(self.steps)))
        columns[0, _GROWTH] = 1.0
        columns[0, 3 + len(self.steps) :] = 1.0
        return self._averaged(Functional(columns, np.array([np.nan]), np.ones(1)))

    def changes(self) -> Mixture:
        """
        Return the jump at each step.
        """
        many = len(self.steps)
        return self._averaged(Functional(self._jumps(), np.full(many, np.nan), np.ones(many)))

    def keep(self, needed: NDArray[np.bool_]) -> None:
        """
        Forget the n x n numbers of settings that neither are needed nor weigh anything.

        Parameters
        ----------
        needed : (g,)
        """
        for number in np.flatnonzero(~needed & (self.weights <= _NEGLIGIBLE)).tolist():
            self._precision[number] = np.zeros((0, 0))

    def asked_for(self, number: int, after: Float64) -> tuple[Float64, Float64]:
        """
        Return how the runs ask for one more step under a setting, before its prior.

        Parameters
        ----------
        number
            Of the setting.
        after : (n, m)
            1 where a run is after the step, for each of some places.

        Returns
        -------
        tightness, pull : (m,)
            The likelihood of a jump x is exp(pull x - tightness x^2 / 2).
        """
        solved = self._precision[number] @ after
        tightness = np.einsum('ij,ij->j', after, solved)
        return tightness, np.asarray(self._residual @ solved)


def _wander(one: Float64, other: Float64, wander: float, walk: float) -> Float64:
    """Return the covariance of integrated and of plain Brownian motion of these strengths."""
    first = np.minimum(one[:, None], other[None, :])
    apart = np.abs(one[:, None] - other[None, :])
    integrated = first**3 / 3.0 + 0.5 * apart * first**2
    return np.asarray(wander**2 * integrated + walk**2 * first)


def _normal(residual: Float64, variance: Float64) -> Float64:
    """Return the normal density, far tails kept above zero."""
    exponent = np.minimum(0.5 * residual**2 / variance, 600.0)
    return np.asarray(np.exp(-exponent) / np.sqrt(variance))


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
_UNLIKELY = 1e-6


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
        down, up = ([-each for each in _SIZES], DOWN_PER_YEAR), (_SIZES, UP_PER_YEAR)
        self._kinds = np.array([(size, rate) for sizes, rate in (down, up) for size in sizes])
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
        self._share = self._none + self._odds.sum(axis=(1, 2))
        state.keep(self._share > _UNLIKELY)

    def level(self, years: Float64) -> Mixture:
        """
        Return the added resistance at some times, covariates at their mean.

        Parameters
        ----------
        years : (m,)
            Since the first run, 0 or later.
        """
        after = self.state.steps.carried(years, self.years)
        return _mixed(self._parts(self.state.level_of(years), after, after))

    def growth_per_year(self) -> Mixture:
        """
        Return the mean growth between cleanings; a step upwards is growth too.
        """
        end = max(float(self.state.runs.years[-1]), 1e-9)
        up = np.full((1, len(self.years)), 1.0 / end)
        return _mixed(self._parts(self.state.growth_of(), np.zeros_like(up), up))

    def _parts(self, asked: Functional, down: Float64, up: Float64) -> Iterator[Part]:
        """Yield functionals, in which a jump at each place counts as `down` or `up` (k, m) say."""
        for number in np.flatnonzero(self._share > _UNLIKELY).tolist():
            value, variance, gain = self.state.given(number, asked)
            yield self._none[number], value, variance
            seen = gain @ self._after
            for kind, (size, _) in enumerate(self._kinds):
                moves = (up if size > 0.0 else down) - seen
                moved = value[:, None] + moves * self._mean[number, kind]
                spread = variance[:, None] + moves**2 * self._variance[number, kind]
                yield self._odds[number, kind], moved, spread


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
        steps = reduce(Steps.with_one, taken, known)
        state = HullState(runs, steps, growth, outlier=state.outlier)
        more = OneMore(state)
    found = []
    least = _SURE
    for year in sorted(taken):
        others = [each for each in taken if each != year]
        steps = reduce(Steps.with_one, others, known)
        one = OneMore(HullState(runs, steps, growth, outlier=state.outlier))
        near = np.abs(one.years - year) <= _NEAR_YEARS
        found.append(FoundStep(year, float(one.probability[near].sum())))
        if found[-1].probability < least:
            least, more = found[-1].probability, one
    return Found(state, tuple(found), more)


def _most_likely(more: OneMore) -> tuple[float, float]:
    """Return the place with most about it within a month, and how probable that is."""
    near = np.abs(more.years[:, None] - more.years[None, :]) <= _NEAR_YEARS
    within = near @ more.probability
    best = int((within + more.probability).argmax())  # the step itself, of all near it
    return float(more.years[best]), float(within[best])
