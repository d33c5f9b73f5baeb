# SPDX-License-Identifier: Apache-2.0
"""
What a measurement that is yet to be made would separate.

Each rival predicts it from the posterior given the existing runs; outcomes are
drawn under each in turn, and the verdict on every one of them is found as it
would be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import softmax

from shipdrag_ros.inference.decision import WeighedHypothesis, names_one, probabilities
from shipdrag_ros.posterior.compare import Comparing, Fitted
from shipdrag_ros.posterior.hypotheses import Explanation, RunSight, ShipRuns
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.effect import Scope

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
        density: Float64 = 0.5 * (volume - squares + explained)
        return density


def of_another_run(
    comparing: Comparing, fits: Sequence[Fitted], run: RunSight
) -> list[PredictedOutcome]:
    """
    Return what fitted hypotheses predict of a run that is yet to be made.

    Parameters
    ----------
    comparing
        Of the runs there are.
    fits
        Of hypotheses about them.
    run
        Values of its rows are 0.

    Returns
    -------
    list of PredictedOutcome
        Of each hypothesis; what belongs to a single run alone is not there again.
    """
    old = comparing.runs
    runs = ShipRuns((*old.runs, run))
    number, shift = len(old.runs), runs.size - old.size
    hypotheses = [_of_old_runs(fit.hypothesis) for fit in fits]
    at, places = [], []
    for fit, hypothesis in zip(fits, hypotheses, strict=True):
        place = np.arange(len(fit.at))
        place[old.size :] += shift
        begun = np.zeros(runs.width(hypothesis))
        begun[: runs.size] = runs.start
        begun[place] = fit.at
        at.append(begun)
        places.append(place)
    found = []
    tables = [each for each in runs.linearise_run(number, hypotheses, at) if each is not None]
    if len(tables) < len(fits):
        return []
    for fit, hypothesis, begun, place, table in zip(fits, hypotheses, at, places, tables):
        family = comparing.prior_of(fit)[0]
        matrix = np.diag(runs.priors(hypothesis, begun).precision[family])
        learnt = np.asarray(sum(comparing.equations(fit)), np.float64)[1:, 1:]
        matrix[np.ix_(place, place)] += learnt
        covariance = inverse_of(matrix)[np.ix_(table.place, table.place)]
        alike = table._replace(white=tables[0].white)  # each reads what any of them draws
        lines = np.hstack([comparing.white(0, alike, run), table.rest])
        found.append(PredictedOutcome(-lines[0], lines[1:], covariance, inverse_of(covariance)))
    return found


def of_instrument(
    comparing: Comparing, fits: Sequence[Fitted], runs: Sequence[RunSight]
) -> tuple[list[PredictedOutcome], list[Float64]]:
    """
    Return what fitted hypotheses predict of an instrument in the runs there are.

    Parameters
    ----------
    comparing
        Of the runs there are.
    fits
        Of hypotheses about them.
    runs
        The same with rows of the instrument alone besides the motion.

    Returns
    -------
    outcomes : list of PredictedOutcome
        Of each hypothesis; empty where one cannot be simulated.
    values : list of (r,)
        As predicted, and not whitened.
    """
    every = ShipRuns(tuple(runs)).linearise([f.hypothesis for f in fits], [f.at for f in fits])
    outcomes, values = [], []
    for fit, tables in zip(fits, every, strict=True):
        if tables is None:
            return [], []
        learnt = np.asarray(sum(comparing.equations(fit)), np.float64)[1:, 1:]
        precision = learnt + np.diag(comparing.prior_of(fit)[2])
        slope = []
        for table in tables:
            whole = np.zeros((len(fit.at), table.rest.shape[1]))
            whole[table.place] = table.rest[1:]
            slope.append(whole)
        mean = -np.concatenate([table.rest[0] for table in tables])
        outcomes.append(PredictedOutcome(mean, np.hstack(slope), inverse_of(precision), precision))
        values.append(-np.concatenate([table.residual for table in tables]))
    return outcomes, values


def with_known(
    comparing: Comparing,
    fits: Sequence[Fitted],
    outcomes: Sequence[PredictedOutcome],
    sd: Mapping[int, Sequence[float]],
) -> list[PredictedOutcome]:
    """
    Return the same where a measurement shows some unknowns of the motion directly.

    Parameters
    ----------
    comparing
        Of the runs there are.
    fits
        Of the hypotheses.
    outcomes
        Of each hypothesis, by all its unknowns.
    sd
        By the number of an unknown in `motion`, one a run; 0: shows nothing.

    Returns
    -------
    list of PredictedOutcome
        With one row more for each unknown that is shown.
    """
    k, found = comparing.runs.coefficients, []
    for fit, outcome in zip(fits, outcomes, strict=True):
        mean, slope = [], []
        for unknown, known in sd.items():
            for place, each in zip(comparing.runs.places, known, strict=True):
                if each > 0.0:
                    mean.append(float(fit.at[place[k + unknown]]) / each)
                    slope.append(np.zeros(len(fit.at)))
                    slope[-1][place[k + unknown]] = 1.0 / each
        rows = np.array(slope).reshape(len(mean), len(fit.at)).T
        found.append(
            replace(
                outcome,
                mean=np.concatenate([outcome.mean, mean]),
                slope=np.hstack([outcome.slope, rows]),
            )
        )
    return found


def _of_old_runs(hypothesis: Explanation) -> Explanation:
    """Return a hypothesis whose effects of a single run stay in the first one."""
    ways = tuple(
        replace(way, run=0) if way.run is None and way.effect.scope is Scope.RUN else way
        for way in hypothesis.ways
    )
    return replace(hypothesis, ways=ways)


def inverse_of(matrix: Float64) -> Float64:
    """Return the inverse of a positive definite matrix whose unknowns have many units."""
    scale = 1.0 / np.sqrt(np.diag(matrix))
    result: Float64 = np.linalg.inv(matrix * np.outer(scale, scale)) * np.outer(scale, scale)
    return result


def probability_of_naming(
    settings: Sequence[Sequence[PredictedOutcome]],
    setting: Sequence[int],
    rivals: Sequence[WeighedHypothesis],
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
    names, probability = [rival.names for rival in rivals], probabilities(rivals)
    share = np.cumsum([0.0, *(probability[each] for each in names)])
    counts = np.diff(np.round(_DRAWS * share).astype(int))
    drawn = [
        (way, settings[way][i].draw(counts[i], rng)) for i, way in enumerate(setting) if counts[i]
    ]
    named = 0
    for way in {way for way, _ in drawn}:
        seen = np.concatenate([each for own, each in drawn if own == way])
        after = [
            rival.log_evidence + rival.log_odds + one.log_density(seen)
            for rival, one in zip(rivals, settings[way], strict=True)
        ]
        named += int(names_one(names, softmax(after, axis=0), inseparable).sum())
    return named / int(counts.sum())
