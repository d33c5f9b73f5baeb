# SPDX-License-Identifier: Apache-2.0
"""
What a measurement that is yet to be made would separate.

Each rival predicts it from the posterior given the existing runs; outcomes are
drawn under each in turn, and the verdict on every one of them is found as it
would be.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from shipdrag_ros.diagnosis.coast_terms import BaselineTerm, RunNuisance, SpeedErrorTerm, Term
from shipdrag_ros.diagnosis.context import Context
from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.measured import Measured
from shipdrag_ros.diagnosis.model import Hypothesis
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.simulated import CoastSimulation
from shipdrag_ros.diagnosis.terms import EffectTerm, scope_runs
from shipdrag_ros.inference.decision import Verdict, decide, probabilities
from shipdrag_ros.inference.decision import WeighedHypothesis as Rival
from shipdrag_ros.samples import Float64

_DRAWS = 300  # of all rivals, of each as many as it is probable
_SEED = 0


@dataclass(frozen=True)
class PredictedOutcome:
    """
    What one rival predicts of a measurement, whitened rows.

    Attributes
    ----------
    mean : (r,)
    slope : (p, r)
        By each unknown.
    covariance, precision : (p, p)
        Of the unknowns before the measurement; 0 in both where nothing is known.
    log_weight
        Of the ways in which the rival may go on, this one's part.
    """

    mean: Float64
    slope: Float64
    covariance: Float64
    precision: Float64
    log_weight: float = 0.0

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
        Return that of each outcome, less a constant that all rivals share.
        """
        away = outcomes - self.mean
        matrix = self.precision + self.slope @ self.slope.T
        falls = away @ self.slope.T
        explained = np.einsum('ai,ai->a', falls, np.linalg.solve(matrix, falls.T).T)
        known = np.diag(self.precision) > 0.0
        before = np.linalg.slogdet(self.precision[np.ix_(known, known)])[1]
        volume = before - np.linalg.slogdet(matrix)[1]
        squares = np.einsum('ai,ai->a', away, away)
        density: Float64 = 0.5 * (volume - squares + explained) + self.log_weight
        return density


def of_another_run(
    model: CoastSimulation, fits: Sequence[Fit], run: Observation
) -> list[list[PredictedOutcome]]:
    """
    Return what fitted hypotheses predict of a run that is yet to be made.

    Parameters
    ----------
    model
        The runs there are.
    fits
        Of hypotheses about them.
    run
        Values of its rows are 0.

    Returns
    -------
    list of list
        Of each hypothesis the ways in which it may go on: what belongs to single
        runs is there again, or is not.
    """
    tried = []
    for number, one in enumerate(fits):
        for hypothesis, log_weight in _transferred(one.hypothesis, runs=len(model.seen)):
            kept = _places(one.hypothesis, hypothesis)
            z = np.array([*(unknown.start for unknown in hypothesis.unknowns), run.speed_m_s])
            covariance = np.diag(
                [*(float(u.prior.weight(0.0) > 0.0) for u in hypothesis.unknowns), 0.0]
            )
            precision = covariance.copy()
            old, new = [pair[0] for pair in kept], [pair[1] for pair in kept]
            z[new] = one.best.z[old]
            learnt = one.covariance[np.ix_(old, old)]
            covariance[np.ix_(new, new)] = learnt
            precision[np.ix_(new, new)] = np.linalg.inv(learnt)
            tried.append((number, hypothesis, z, covariance, precision, log_weight))
    alone = replace(model, seen=(run,))
    linear = alone.linearise([each[1] for each in tried], [each[2] for each in tried])
    ways: list[list[PredictedOutcome]] = [[] for _ in fits]
    for (number, _, _, covariance, precision, log_weight), found in zip(
        tried, linear, strict=True
    ):
        table = found.tables[0]
        ways[number].append(
            PredictedOutcome(-table[0], table[1:], covariance, precision, log_weight)
        )
    return ways


def of_instrument(
    model: CoastSimulation, fits: Sequence[Fit], contexts: Sequence[Context]
) -> tuple[list[list[PredictedOutcome]], list[Float64]]:
    """
    Return what fitted hypotheses predict of an instrument in the runs there are.

    Parameters
    ----------
    model
        The runs there are.
    fits
        Of hypotheses about them.
    contexts
        One a run, with rows of the instrument alone.

    Returns
    -------
    outcomes : list of list
        One of each hypothesis.
    values : list of (r,)
        As predicted, and not whitened.
    """
    seen = tuple(
        replace(run, context=replace(context, value=np.zeros(len(context))))
        for run, context in zip(model.seen, contexts, strict=True)
    )
    found = replace(model, seen=seen).linearise(
        [one.hypothesis for one in fits], [one.best.z for one in fits]
    )
    outcomes, values = [], []
    for one, linear in zip(fits, found, strict=True):
        both = list(zip(linear.tables, linear.residuals, contexts, strict=True))
        table = np.hstack([table[:, table.shape[1] - len(c) :] for table, _, c in both])
        precision = np.asarray(np.linalg.inv(one.covariance), np.float64)
        outcomes.append([PredictedOutcome(-table[0], table[1:], one.covariance, precision)])
        values.append(-np.concatenate([left[len(left) - len(c) :] for _, left, c in both]))
    return outcomes, values


def with_known(
    outcomes: Sequence[Sequence[PredictedOutcome]],
    fits: Sequence[Fit],
    sd: Mapping[str, Sequence[float]],
) -> list[list[PredictedOutcome]]:
    """
    Return the same where a measurement shows some unknowns directly.

    Parameters
    ----------
    outcomes
        Of each hypothesis its ways.
    fits
        Of the hypotheses.
    sd
        By the name of an unknown of the baseline or of a run, one a run; 0: shows
        nothing.

    Returns
    -------
    list of list
        With one row more for each unknown that is shown.
    """
    found = []
    for ways, one in zip(outcomes, fits, strict=True):
        mean, slope = [], []
        for part, place in one.hypothesis.parts:
            if not isinstance(part, BaselineTerm | RunNuisance):
                continue
            run = part.run if isinstance(part, RunNuisance) else 0
            for at, unknown in enumerate(part.unknowns, place):
                known = sd[unknown.name][run] if unknown.name in sd else 0.0
                if known > 0.0:
                    z = float(one.best.z[at])
                    mean.append(unknown.prior.at(z) / known)
                    slope.append(np.zeros(len(one.best.z)))
                    slope[-1][at] = unknown.prior.slope(z) / known
        rows = np.array(slope).reshape(len(mean), len(one.best.z)).T
        found.append(
            [
                replace(
                    way,
                    mean=np.concatenate([way.mean, mean]),
                    slope=np.hstack([way.slope, rows]),
                )
                for way in ways
            ]
        )
    return found


def probability_of_naming(
    settings: Sequence[Sequence[Sequence[PredictedOutcome]]],
    setting: Sequence[int],
    rivals: Sequence[Rival],
    *,
    inseparable: Sequence[frozenset[str]],
) -> float:
    """
    Return how probably something is named after a measurement.

    Parameters
    ----------
    settings
        Predicted outcomes of all rivals, for each way in which the measurement may be
        read.
    setting
        The way it is read where each rival is the truth.
    rivals
        Each of other names.
    inseparable
        Effects that no record can separate.

    Returns
    -------
    float
        Averaged over the rivals by their probabilities; 300 draws of a fixed seed.
    """
    rng = np.random.default_rng(_SEED)
    probability = probabilities(rivals)
    share = np.array([probability[rival.names] for rival in rivals])
    counts = np.diff(np.round(_DRAWS * np.concatenate([[0.0], np.cumsum(share)])).astype(int))
    named = 0
    for truth, (way, count) in enumerate(zip(setting, counts, strict=True)):
        if count == 0:
            continue
        outcomes = _drawn(settings[way][truth], int(count), rng)
        evidence = [
            rival.log_evidence + np.logaddexp.reduce([one.log_density(outcomes) for one in ways])
            for rival, ways in zip(rivals, settings[way], strict=True)
        ]
        for log in np.array(evidence).T.tolist():
            after = [
                replace(rival, log_evidence=each) for rival, each in zip(rivals, log, strict=True)
            ]
            named += decide(probabilities(after), inseparable).verdict is Verdict.NAMED
    return named / int(counts.sum())


def _drawn(ways: Sequence[PredictedOutcome], count: int, rng: np.random.Generator) -> Float64:
    """Return outcomes of a rival, of each way as many as it is probable."""
    weight = np.exp([one.log_weight for one in ways])
    of_way = rng.multinomial(count, weight / weight.sum())
    return np.vstack([one.draw(int(n), rng) for one, n in zip(ways, of_way, strict=True)])


def empty(measured: Measured) -> Measured:
    """
    Return rows whose values are 0.

    Parameters
    ----------
    measured
        Rows of a run.

    Returns
    -------
    Measured
        The same rows.
    """
    rows = measured.rows
    return replace(measured, rows=rows._replace(value=np.zeros(len(rows.value))))


def _transferred(hypothesis: Hypothesis, *, runs: int) -> list[tuple[Hypothesis, float]]:
    """
    Return a hypothesis about some runs as such about another one alone.

    What belongs to single runs was in one of them, or is in all: each way with its
    part of the prior, as it is among one run more.
    """
    baseline, *others = hypothesis.terms
    assert isinstance(baseline, BaselineTerm)
    first: Term = replace(baseline, run_down_change_s=baseline.run_down_change_s[:1])
    # others of the same kind: where the first run began, and what was amiss with a sensor in
    # it, is not known of the next
    rows = tuple(
        replace(term)
        for term in hypothesis.measurement_terms
        if isinstance(term, RunNuisance | SpeedErrorTerm) and term.run == 0
    )
    log_weight = 0.0
    choices: list[list[list[Term]]] = []
    for term in others:
        if not (isinstance(term, EffectTerm) and term.of_single_run):
            choices.append([[term]])
            continue
        places = len(scope_runs(term.effect, runs)), len(scope_runs(term.effect, runs + 1))
        log_weight += math.log(places[0] / places[1])
        if runs == 1:
            choices.append([[term], []])
        else:
            choices.append([[term] if term.only_run is None else []])
    found = []
    for chosen in product(*choices):
        kept = (first, *(term for terms in chosen for term in terms))
        forms = tuple(
            form for form in hypothesis.model_errors if any(form.term is t for t in kept)
        )
        found.append((Hypothesis(hypothesis.names, kept, rows, forms), log_weight))
    return found


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
