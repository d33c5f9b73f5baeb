# SPDX-License-Identifier: Apache-2.0
"""
From fits to posterior probabilities, and to a verdict: a name only where the data can tell.

Evidence names; a smooth discrepancy that a name does not explain takes the name
back; what nothing in a record can tell apart stays a set.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import logsumexp

from shipdrag_ros.diagnosis.fitting import Fit, fit
from shipdrag_ros.diagnosis.model import Hypothesis, Model, start
from shipdrag_ros.diagnosis.result import Candidate, Diagnosis, Gap, Named, Verdict
from shipdrag_ros.diagnosis.terms import EffectTerm
from shipdrag_ros.ship import Uncertain

UNNAMED = ('?',)  # stands among the names for something without one
CERTAIN = 0.9  # probability from which an effect is named
QUIET = 0.1  # of nothing missing, from which nothing is said
_LOG_BAYES_FACTOR = math.log(10.0)  # from where evidence is strong (Jeffreys 1961)
_SET = 0.99  # of the candidates
_LACK_NATS = 5.0  # of evidence that something smooth besides must gain
_SHAPE_SD = 2.5  # prior standard deviations of a shape parameter of an effect
_LACK_SD, _LACK_SLACK = 4.0, 0.2  # of chi^2 a row above 1: the noise is not known better


@dataclass(frozen=True)
class Posterior:
    """
    Hypotheses with their probabilities.

    Attributes
    ----------
    best
        Best fit of each: by the names, or by what is unnamed.
    probability
        Of each name or pair (none: nothing is missing), and of '?' (unnamed).
    """

    best: dict[tuple[str, ...], Fit]
    probability: dict[tuple[str, ...], float]

    @property
    def nothing(self) -> float:
        """Probability that nothing is missing."""
        return self.probability[()]

    @property
    def unnamed(self) -> float:
        """Probability of something without a name."""
        return self.probability.get(UNNAMED, 0.0)

    def doubted(self) -> Posterior:
        """
        Return the same where the best name leaves more than noise.

        Something without a name is then as probable as one must be to be named.
        """
        if self.unnamed >= CERTAIN:
            return self
        share = (1.0 - CERTAIN) / (1.0 - self.unnamed)
        scaled = {names: share * p for names, p in self.probability.items()}
        return Posterior(self.best, {**scaled, UNNAMED: CERTAIN})

    def named(self) -> list[tuple[str, ...]]:
        """
        Return what has a name, or is nothing, most probable first.
        """
        names = [names for names in self.probability if names != UNNAMED]
        return sorted(names, key=lambda names: -self.probability[names])


def posterior_of(fits: Sequence[Fit]) -> Posterior:
    """
    Give hypotheses their probabilities.

    Parameters
    ----------
    fits
        Several of the same names differ in where the fit began, of which the
        best counts, or in a choice.
    """
    best: dict[tuple[str, ...], Fit] = {}
    modes: dict[tuple[str, ...], dict[tuple[object, ...], float]] = {}
    for one in fits:
        key = UNNAMED if one.hypothesis.discrepancy else one.hypothesis.names
        if key not in best or one.log_evidence > best[key].log_evidence:
            best[key] = one
        mode = mode_of(one.hypothesis)
        found = modes.setdefault(key, {})
        found[mode] = max(found.get(mode, -math.inf), one.log_evidence)
    log = {key: float(logsumexp(list(found.values()))) for key, found in modes.items()}
    return Posterior(
        best, prune_by_bayes_factor(log, {key: best[key].hypothesis.log_odds for key in log})
    )


def prune_by_bayes_factor(
    log_evidence: Mapping[tuple[str, ...], float], log_odds: Mapping[tuple[str, ...], float]
) -> dict[tuple[str, ...], float]:
    """
    Return posterior probabilities, dropping an effect whose Bayes factor is below 10.

    A record in which an effect cannot be seen speaks neither for nor against it.
    The probability of a name with such an effect goes to the name alone.

    Parameters
    ----------
    log_evidence
        Of names, prior included.
    log_odds
        Prior log odds of names over nothing.

    Returns
    -------
    dict
        Of the names that are left; adds up to 1.

    Notes
    -----
    A factor of 10 is strong evidence by Jeffreys, Theory of Probability (1961).
    """
    kept = dict(log_evidence)
    factor = {names: log_evidence[names] - log_odds[names] for names in kept}
    for names in sorted(log_evidence, key=lambda names: -len(names)):
        fewer = [
            other
            for other in log_evidence
            if len(other) == len(names) - 1 and set(other) < set(names) and names != UNNAMED
        ]
        if not fewer:
            continue
        alone = max(fewer, key=lambda other: factor[other])
        if factor[names] <= factor[alone] + _LOG_BAYES_FACTOR:
            kept[alone] = float(np.logaddexp(kept[alone], kept.pop(names)))
    total = logsumexp(list(kept.values()))
    return {names: math.exp(log - total) for names, log in kept.items()}


def mode_of(hypothesis: Hypothesis) -> tuple[object, ...]:
    """
    Return names, and what tells a mode apart from others of the same names.
    """
    ways = [
        (term.effect.name, term.fixed, term.signs, str(term.only_run))
        for term in hypothesis.terms
        if isinstance(term, EffectTerm)
    ]
    return (hypothesis.names, hypothesis.discrepancy, *sorted(ways))


@dataclass(frozen=True)
class Found:
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
        """Fits with something unnamed instead, one a channel."""
        return tuple(one for one in self.fits if one.hypothesis.discrepancy)

    @property
    def best(self) -> Fit:
        """The most probable of what has a name, or is nothing."""
        return self.posterior.best[self.posterior.named()[0]]

    @property
    def alarm(self) -> bool:
        """Whether something is missing, and has a name."""
        return self.posterior.nothing < QUIET and bool(self.best.hypothesis.names)

    def with_discrepancy(self) -> tuple[Fit, ...]:
        """Return fits of something smooth besides the best, one a channel."""
        model, best = self.model, self.best
        if not best.hypothesis.names:
            return self.smooth
        more = [model.with_discrepancy(best.hypothesis, channel) for channel in model.channels]
        return tuple(fit(model, more, [start(model, one, best.best) for one in more]))


@dataclass(frozen=True)
class Judgement:
    """
    A verdict, and what it rests on.

    Attributes
    ----------
    found
    posterior
        Where the verdict is doubted, something unnamed is in it as probable as one
        must be to be named.
    verdict
    candidates
    """

    found: Found
    posterior: Posterior
    verdict: Verdict
    candidates: tuple[Candidate, ...]

    @property
    def missing(self) -> bool:
        """Whether the most probable hypothesis explains something that is missing."""
        names = self.found.best.hypothesis.names
        return self.verdict in (Verdict.NAMED, Verdict.ONE_OF) and bool(names)

    @property
    def best(self) -> tuple[Named, ...]:
        """Effects of the most probable hypothesis, with their parameters."""
        fit = self.found.best
        probability = self.posterior.probability[fit.hypothesis.names]
        found = []
        for part, place in fit.hypothesis.parts:
            if not isinstance(part, EffectTerm) or part.stated:
                continue
            values = {name: Uncertain(value, 0.0) for name, value in part.fixed}
            for i, unknown in enumerate(part.unknowns, place):
                z, sd = float(fit.best.z[i]), float(np.sqrt(fit.covariance[i, i]))
                values[unknown.name] = Uncertain(unknown.value(z), abs(unknown.slope(z)) * sd)
            ordered = {q.name: values[q.name] for q in part.effect.parameters}
            found.append(Named(part.effect.name, probability, ordered))
        return tuple(sorted(found, key=lambda effect: effect.name))

    def diagnosis(self, **rest: Any) -> Diagnosis:
        """
        Return the result.

        Parameters
        ----------
        **rest
            What the verdict does not tell, as in `Diagnosis`.
        """
        return Diagnosis(
            verdict=self.verdict,
            effects=self.best if self.verdict is Verdict.NAMED else (),
            candidates=self.candidates,
            nothing=self.posterior.nothing,
            unnamed=self.posterior.unnamed,
            best=self.best,
            **rest,
        )


def judge(found: Found, *, held_out: Gap | None = None, distrusted: bool = False) -> Judgement:
    """
    Return the verdict on what a search found.

    Parameters
    ----------
    found
    held_out
        Of runs predicted from others with the most probable hypothesis; None
        without.
    distrusted
        The measurements themselves are known to be wrong.
    """
    best, posterior = found.best, found.posterior
    doubted = distrusted or (
        found.alarm
        and (
            has_residual_structure(best, found.with_discrepancy())
            or outside_prior(best)
            or (held_out is not None and exceeds_noise(held_out.chi2_per_sample, best.best.rows))
        )
    )
    if doubted:
        posterior = posterior.doubted()
    verdict, candidates = decide(posterior, lacking=doubted, inseparable=found.model.inseparable)
    return Judgement(found, posterior, verdict, candidates)


def has_residual_structure(fit: Fit, with_discrepancy: Sequence[Fit]) -> bool:
    """
    Tell whether a hypothesis leaves more than noise.

    Parameters
    ----------
    fit
    with_discrepancy
        The same with something smooth besides.
    """
    if exceeds_noise(fit.chi2_per_row, fit.best.rows):
        return True
    limit = fit.log_likelihood + _LACK_NATS
    return any(more.log_likelihood > limit for more in with_discrepancy)


def outside_prior(fit: Fit) -> bool:
    """
    Tell whether a shape parameter of an effect lies beyond 2.5 prior sd.

    However large it is, a turn that hardly changes the heading, or is over in some
    seconds, is something else. Sizes, and components of one, are no shape.
    """
    return any(
        abs(float(fit.best.z[place + i])) > _SHAPE_SD
        for part, place in fit.hypothesis.parts
        if isinstance(part, EffectTerm) and not part.stated
        for i, unknown in enumerate(part.unknowns)
        if unknown.name != part.effect.parameters[0].name and i not in part.one_size
    )


def exceeds_noise(chi2_per_row: float, rows: int) -> bool:
    """
    Tell whether what is left is more than noise, as well as that is known.

    Parameters
    ----------
    chi2_per_row
        Mean square of the whitened residuals.
    rows
        Their number.
    """
    return chi2_per_row > 1.0 + _LACK_SD * math.sqrt(2.0 / rows) + _LACK_SLACK


def decide(
    posterior: Posterior, *, lacking: bool, inseparable: Sequence[frozenset[str]]
) -> tuple[Verdict, tuple[Candidate, ...]]:
    """
    Return verdict and candidates.

    Parameters
    ----------
    lacking
        Something is left that no name explains.
    inseparable
        Effects that no record can tell apart.
    """
    candidates = _smallest(posterior)
    first = posterior.named()[0]
    if lacking:
        return Verdict.UNKNOWN, candidates
    if posterior.nothing >= QUIET:
        return Verdict.NONE, candidates
    if posterior.unnamed > 0.5:
        return Verdict.UNKNOWN, candidates
    alone = not any(set(first) & group for group in inseparable)
    if alone and posterior.probability[first] >= CERTAIN:
        return Verdict.NAMED, candidates
    if posterior.unnamed > 1.0 - CERTAIN and len(candidates) == 1:
        return Verdict.UNKNOWN, candidates
    return Verdict.ONE_OF, candidates


def _smallest(posterior: Posterior) -> tuple[Candidate, ...]:
    """Return the fewest names that hold almost all of what has a name."""
    total = 1.0 - posterior.unnamed
    found: list[Candidate] = []
    held = 0.0
    for names in posterior.named():
        found.append(Candidate(names, posterior.probability[names]))
        held += posterior.probability[names]
        if held >= _SET * total:
            break
    return tuple(found)
