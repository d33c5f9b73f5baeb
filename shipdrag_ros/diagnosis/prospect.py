# SPDX-License-Identifier: Apache-2.0
"""
What a measurement that is yet to be made would tell apart.

Each candidate predicts it, as well as the runs that there are let it; outcomes
are drawn under each in turn, and all are weighed by them as they would be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shipdrag_ros.diagnosis.context import Context
from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.linear import Hypothesis, Problem
from shipdrag_ros.diagnosis.observation import Measured, Observation
from shipdrag_ros.diagnosis.terms import (
    BaselineTerm,
    EffectTerm,
    PlaceTerm,
    SpeedErrorTerm,
    Term,
)
from shipdrag_ros.diagnosis.verdict import CERTAIN
from shipdrag_ros.samples import Float64

_DRAWS = 200  # of each candidate
_SEED = 0


@dataclass(frozen=True)
class Prospect:
    """
    What one candidate predicts of a measurement, whitened rows.

    Attributes
    ----------
    mean : (r,)
    slope : (p, r)
        By each unknown.
    covariance, precision : (p, p)
        Of the unknowns before the measurement; 0 in both where nothing is known.
    """

    mean: Float64
    slope: Float64
    covariance: Float64
    precision: Float64

    def draw(self, count: int, rng: np.random.Generator) -> Float64:
        """
        Return outcomes, (count, r).
        """
        size, axes = np.linalg.eigh(self.covariance)
        root = axes * np.sqrt(np.maximum(size, 0.0))
        unknown = rng.standard_normal((count, len(root))) @ root.T
        noise = rng.standard_normal((count, len(self.mean)))
        drawn: Float64 = self.mean + unknown @ self.slope + noise
        return drawn

    def log_density(self, outcomes: Float64) -> Float64:
        """
        Return that of each outcome, less a constant that all candidates share.
        """
        away = outcomes - self.mean
        matrix = self.precision + self.slope @ self.slope.T
        falls = away @ self.slope.T
        explained = np.einsum('ai,ai->a', falls, np.linalg.solve(matrix, falls.T).T)
        known = np.diag(self.precision) > 0.0
        before = np.linalg.slogdet(self.precision[np.ix_(known, known)])[1]
        volume = before - np.linalg.slogdet(matrix)[1]
        squares = np.einsum('ai,ai->a', away, away)
        density: Float64 = 0.5 * (volume - squares + explained)
        return density


def of_another_run(problem: Problem, fits: Sequence[Fit], run: Observation) -> list[Prospect]:
    """
    Return what fitted hypotheses predict of a run that is yet to be made.

    Parameters
    ----------
    run
        Values of its rows are 0. What belonged to a single run is not in it.
    """
    there = [_transferred(one.hypothesis) for one in fits]
    at, before = [], []
    for one, hypothesis in zip(fits, there, strict=True):
        kept = _places(one.hypothesis, hypothesis)
        z = np.array([*(unknown.start for unknown in hypothesis.unknowns), run.speed_m_s])
        covariance = np.diag([*(float(u.weight(0.0) > 0.0) for u in hypothesis.unknowns), 0.0])
        precision = covariance.copy()
        old, new = [pair[0] for pair in kept], [pair[1] for pair in kept]
        z[new] = one.best.z[old]
        learnt = one.covariance[np.ix_(old, old)]
        covariance[np.ix_(new, new)] = learnt
        precision[np.ix_(new, new)] = np.linalg.inv(learnt)
        at.append(z)
        before.append((covariance, precision))
    linear = replace(problem, seen=(run,)).linearise(there, at)
    return [
        Prospect(-found.tables[0][0], found.tables[0][1:], covariance, precision)
        for found, (covariance, precision) in zip(linear, before, strict=True)
    ]


def of_instrument(
    problem: Problem, fits: Sequence[Fit], contexts: Sequence[Context]
) -> tuple[list[Prospect], list[Float64]]:
    """
    Return what fitted hypotheses predict of an instrument in the runs there are.

    Parameters
    ----------
    contexts
        One a run, with rows of the instrument alone.

    Returns
    -------
    prospects
    values
        (r,) of each, as predicted and not whitened.
    """
    seen = tuple(
        replace(run, context=replace(context, value=np.zeros(len(context))))
        for run, context in zip(problem.seen, contexts, strict=True)
    )
    found = replace(problem, seen=seen).linearise(
        [one.hypothesis for one in fits], [one.best.z for one in fits]
    )
    prospects, values = [], []
    for one, linear in zip(fits, found, strict=True):
        both = list(zip(linear.tables, linear.residuals, contexts, strict=True))
        table = np.hstack([table[:, table.shape[1] - len(c) :] for table, _, c in both])
        precision = np.asarray(np.linalg.inv(one.covariance), np.float64)
        prospects.append(Prospect(-table[0], table[1:], one.covariance, precision))
        values.append(-np.concatenate([left[len(left) - len(c) :] for _, left, c in both]))
    return prospects, values


def resolving(
    settings: Sequence[Sequence[Prospect]], setting: Sequence[int], probability: Sequence[float]
) -> list[float]:
    """
    Return how probably each candidate is certain after a measurement, if it is the truth.

    Parameters
    ----------
    settings
        Prospects of all candidates, for each way in which the measurement may
        be read.
    setting
        The way it is read where each candidate is the truth.
    probability
        Of each candidate before.
    """
    rng = np.random.default_rng(_SEED)
    prior = np.log(np.maximum(probability, 1e-300))
    found = []
    for truth, way in enumerate(setting):
        outcomes = settings[way][truth].draw(_DRAWS, rng)
        log = np.array([one.log_density(outcomes) for one in settings[way]]) + prior[:, None]
        odds = np.exp(log - log[truth])
        found.append(float(np.mean(1.0 / odds.sum(axis=0) >= CERTAIN)))
    return found


def empty(measured: Measured) -> Measured:
    """
    Return rows whose values are 0.
    """
    rows = measured.rows
    return replace(measured, rows=rows._replace(value=np.zeros(len(rows.value))))


def _transferred(hypothesis: Hypothesis) -> Hypothesis:
    """Return a hypothesis about some runs as one about another one alone."""
    baseline, *others = hypothesis.terms
    assert isinstance(baseline, BaselineTerm)
    kept: list[Term] = [replace(baseline, run_down_change_s=baseline.run_down_change_s[:1])]
    kept += [term for term in others if not _of_single_run(term)]
    forms = tuple(form for form in hypothesis.forms if not form.term.of_single_run)
    # others of the same kind: where the first run began, and what was amiss with a sensor in
    # it, is not known of the next
    of_first = (
        term
        for term in hypothesis.row_terms
        if isinstance(term, PlaceTerm | SpeedErrorTerm) and term.run == 0
    )
    rows = tuple(replace(term) for term in of_first)
    return Hypothesis(hypothesis.names, tuple(kept), rows, forms)


def _of_single_run(term: Term) -> bool:
    return isinstance(term, EffectTerm) and term.of_single_run


def _places(old: Hypothesis, new: Hypothesis) -> list[tuple[int, int]]:
    """Return places of the unknowns that two hypotheses share."""
    known = {id(part): place for part, place in old.parts}
    known[id(new.terms[0])] = 0
    return [
        (known[id(part)] + i, place + i)
        for part, place in new.parts
        if id(part) in known
        for i in range(len(part.unknowns))
    ]
