# SPDX-License-Identifier: Apache-2.0
"""
All hypotheses of a model about a record, fitted: singles, and pairs where something is missing.

Which of them are worth a fit is judged by the linear response to one added
effect of a likely size: how much of it there is, and how far the rest of the
hypothesis gives way, is linear. So a column a hypothesis is enough, where a fit
takes hundreds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from shipdrag_ros.diagnosis.fitting import Fit, fit
from shipdrag_ros.diagnosis.model import Hypothesis, Model, start
from shipdrag_ros.diagnosis.posterior import Posterior, mode_of, posterior_of
from shipdrag_ros.diagnosis.terms import EffectTerm, trial_z
from shipdrag_ros.inference.limits import Sensitivity
from shipdrag_ros.parameter import Shape
from shipdrag_ros.progress import Progress, silent
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.effects import find

_PAIRED = 4  # most probable names that pairs are tried with
_PAIRS = 12  # that are fitted
_STARTS = 2  # of each hypothesis that are fitted
_NEGLIGIBLE = math.log(1e-3)  # probability of a pair by its screening score
_LIKELY = 0.05  # probability of names that may not explain all of what is missing
_AMOUNT_SD = 0.6  # of a size that is not 0, in parts of the one that is tried


@dataclass(frozen=True)
class SearchResult:
    """
    What a search found.

    Attributes
    ----------
    model
    nothing
        The fit where nothing is missing.
    fits
        Of everything.
    """

    model: Model
    nothing: Fit
    fits: tuple[Fit, ...]

    @cached_property
    def posterior(self) -> Posterior:
        """Posterior probabilities of all."""
        return posterior_of(self.fits)

    @property
    def smooth(self) -> tuple[Fit, ...]:
        """Fits with something unnamed and nothing else."""
        return tuple(
            one for one in self.fits if one.hypothesis.discrepancy and not one.hypothesis.names
        )

    @property
    def best(self) -> Fit:
        """The most probable of what has a name, or is nothing."""
        return self.posterior.best[self.posterior.named()[0]]


def search(model: Model, *, progress: Progress = silent) -> SearchResult:
    """
    Fit nothing, each effect, and something unnamed.

    Parameters
    ----------
    model
        With the record that it is held against.
    progress
        Called with how many hypotheses are fitted.

    Returns
    -------
    SearchResult
        Without pairs.
    """
    nothing = fit(model, [model.nothing], [start(model, model.nothing)])[0]
    named = [h for effect in model.effects for h in model.with_effect(model.nothing, effect)]
    likely = _likeliest_starts(model, named, nothing)
    unnamed = [model.with_discrepancy(model.nothing, channel) for channel in model.channels]
    both = [*likely, *unnamed]
    starts = [start(model, one, nothing.best) for one in both]
    fits = fit(model, both, starts, progress=progress)
    return SearchResult(model, nothing, (nothing, *fits))


def with_pairs(found: SearchResult, *, progress: Progress = silent) -> SearchResult:
    """
    Fit pairs of effects besides.

    Pairs are of the most probable names with all others, where the linear response says that they
    may count; confounders that nothing separates are no pair.

    Parameters
    ----------
    found
        From `search`.
    progress
        Called with how many pairs are fitted.

    Returns
    -------
    SearchResult
    """
    pairs = _pairs(found.model, found.posterior, progress)
    return replace(found, fits=(*found.fits, *pairs)) if pairs else found


def with_unnamed(found: SearchResult) -> SearchResult:
    """
    Fit likely names with something smooth besides, which has none.

    Parameters
    ----------
    found
        From `search`, with pairs where they are looked for.

    Returns
    -------
    SearchResult
        A name that leaves more than noise has such a rival.
    """
    model = found.model
    tried = [
        (model.with_discrepancy(base.hypothesis, channel), base)
        for base in likely(found.posterior)
        for channel in model.channels
    ]
    starts = [start(model, one, base.best) for one, base in tried]
    fits = fit(model, [one for one, _ in tried], starts)
    return replace(found, fits=(*found.fits, *fits))


def likely(posterior: Posterior) -> list[Fit]:
    """
    Return the fits of likely names, most probable first.

    Parameters
    ----------
    posterior
        Of a search.
    """
    names = [names for names in posterior.named() if names]
    return [posterior.best[each] for each in names if posterior.probability[each] >= _LIKELY]


def screening_score(model: Model, base: Fit, hypotheses: Sequence[Hypothesis]) -> Float64:
    """
    Return about what log evidence hypotheses with one effect more will reach.

    Parameters
    ----------
    model
    base
        What they add to.
    hypotheses
        Their last term is the effect, from where its fit begins.

    Returns
    -------
    (hypotheses,)
        With the prior, less the constant that `Fit.log_evidence` leaves out.
    """
    responses, known = sensitivity(model, base, hypotheses)
    mean, precision = known.mean, known.precision
    own = np.maximum(np.diag(known.information), 0.0) + precision
    # at the best fit of the base the residual is as good as square to all that it has
    residual = np.hstack(base.best.tables)[0]
    negative_gradient = responses @ residual + precision * mean
    gain = 0.5 * (negative_gradient**2 / own - precision * mean**2) - 0.5 * np.log(own / precision)
    log_prior = np.array([hypothesis.log_prior for hypothesis in hypotheses])
    found: Float64 = base.log_likelihood + gain + log_prior
    return found


def sensitivity(
    model: Model, base: Fit, hypotheses: Sequence[Hypothesis]
) -> tuple[Float64, Sensitivity]:
    """
    Return what a record says of one effect more, in parts of the size that is tried.

    Parameters
    ----------
    model
    base
        What the hypotheses add to.
    hypotheses
        Their last term is the effect.

    Returns
    -------
    responses : (hypotheses, rows)
        Whitened.
    known
        The same with what the nuisances of the base take up left out.
    """
    mean, precision = np.array([_amount(hypothesis.terms[-1]) for hypothesis in hypotheses]).T
    responses = model.responses(base.best, hypotheses)
    matrix, _ = base.best.normal_equations
    across = np.hstack(base.best.tables)[1:] @ responses.T
    given_way = np.linalg.lstsq(matrix, across, rcond=1e-13)[0]
    information = responses @ responses.T - across.T @ given_way
    log_odds = np.array([each.log_odds - base.hypothesis.log_odds for each in hypotheses])
    return responses, Sensitivity(information, mean, precision, log_odds)


def _amount(term: EffectTerm) -> tuple[float, float]:
    """Return mean and precision of the size, in parts of that which is tried."""
    first = term.unknowns[0]
    if term.kept:
        tried = first.prior.at(trial_z(first))
        return first.prior.at(0.0) / tried, (tried / first.prior.slope(0.0)) ** 2
    if first.prior.shape is Shape.HALF_NORMAL or first.start == 0.0:
        return 0.0, trial_z(first) ** 2
    return 1.0, 1.0 / _AMOUNT_SD**2


def _likeliest_starts(
    model: Model, hypotheses: Sequence[Hypothesis], near: Fit
) -> list[Hypothesis]:
    """Keep the most promising starts of each hypothesis."""
    modes = [mode_of(hypothesis) for hypothesis in hypotheses]
    if all(modes.count(mode) <= _STARTS for mode in set(modes)):
        return list(hypotheses)
    kept: dict[tuple[object, ...], list[Hypothesis]] = {}
    for i in np.argsort(-screening_score(model, near, hypotheses)):
        found = kept.setdefault(modes[i], [])
        if len(found) < _STARTS:
            found.append(hypotheses[i])
    return [one for ones in kept.values() for one in ones]


def _pairs(model: Model, posterior: Posterior, progress: Progress) -> list[Fit]:
    """Fit pairs of the likeliest names with all others."""
    first = [names for names in posterior.named() if names][:_PAIRED]
    top = next(iter(posterior.probability))
    least = posterior.best[top].log_evidence - math.log(posterior.probability[top]) + _NEGLIGIBLE
    tried: list[tuple[float, Hypothesis, Fit]] = []
    for names in first:
        base = posterior.best[names]
        hypotheses = [
            hypothesis
            for effect in model.effects
            if all(effect.goes_with(find(name)) for name in names)
            and not any({effect.name, *names} <= group for group in model.inseparable)
            for hypothesis in model.with_effect(base.hypothesis, effect)
        ]
        if hypotheses:
            scores = screening_score(model, base, hypotheses).tolist()
            tried += [(score, one, base) for score, one in zip(scores, hypotheses, strict=True)]
    tried.sort(key=lambda one: -one[0])
    kept: dict[tuple[object, ...], tuple[Hypothesis, Fit]] = {}
    for score, hypothesis, base in tried:
        if len(kept) < _PAIRS and score > least:
            kept.setdefault(mode_of(hypothesis), (hypothesis, base))
    starts = [start(model, hypothesis, base.best) for hypothesis, base in kept.values()]
    hypotheses = [hypothesis for hypothesis, _ in kept.values()]
    return fit(model, hypotheses, starts, progress=progress, stage='fitting pairs of effects')
