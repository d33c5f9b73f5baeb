# SPDX-License-Identifier: Apache-2.0
"""
From a posterior to a verdict: a name only where the data decide.

Evidence names; a smooth discrepancy that a name does not explain takes the name
back; what nothing in a record can separate stays a set.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.model import Part
from shipdrag_ros.diagnosis.posterior import CERTAIN, QUIET, Posterior
from shipdrag_ros.diagnosis.result import Candidate, DiagnosisResult, EffectEstimate, Gap, Verdict
from shipdrag_ros.diagnosis.search import SearchResult
from shipdrag_ros.diagnosis.terms import EffectTerm
from shipdrag_ros.parameter import Parameter, Shape

SET = 0.99  # of what has a name, in the candidates
_LACK_NATS = 5.0  # of evidence that something smooth besides must gain: a factor of 150
_SHAPE_SD = 2.5  # prior sd of a shape parameter of an effect: 1 in 80 is beyond
_FORM_SD = 3.5  # of its four departures from its formula, together: 1 in 60 is beyond
_SIZE_SD = 5.0  # of the logarithm of a size: 32 times the median where its sd is a factor of 2
_LACK_SD, _LACK_SLACK = 4.0, 0.2  # of chi^2 a row above 1: the noise is not known better


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

    found: SearchResult
    posterior: Posterior
    verdict: Verdict
    candidates: tuple[Candidate, ...]

    @property
    def missing(self) -> bool:
        """Whether the most probable hypothesis explains something that is missing."""
        names = self.found.best.hypothesis.names
        return self.verdict in (Verdict.NAMED, Verdict.ONE_OF) and bool(names)

    @property
    def best(self) -> tuple[EffectEstimate, ...]:
        """Effects of the most probable hypothesis, with their parameters."""
        fit = self.found.best
        return sized(fit, self.posterior.probability[fit.hypothesis.names])

    def diagnosis(self, **rest: Any) -> DiagnosisResult:
        """
        Return the result.

        Parameters
        ----------
        **rest
            What the verdict does not show, as in `DiagnosisResult`.
        """
        return DiagnosisResult(
            verdict=self.verdict,
            effects=self.best if self.verdict is Verdict.NAMED else (),
            candidates=self.candidates,
            nothing=self.posterior.nothing,
            unnamed=self.posterior.unnamed,
            best=self.best,
            **rest,
        )


def judge(
    found: SearchResult,
    *,
    held_out: Gap | None = None,
    distrusted: bool = False,
    besides: Sequence[Fit] = (),
) -> Judgement:
    """
    Return the verdict on what a search found.

    Parameters
    ----------
    found
        With pairs, where they are looked for.
    held_out
        Of runs predicted from others with the most probable hypothesis; None
        without.
    distrusted
        The measurements themselves are known to be wrong.
    besides
        Fits of the most probable hypothesis with something more that has no name.

    Returns
    -------
    Judgement
        Of verdict unknown where the best hypothesis leaves more than noise.
    """
    best, posterior = found.best, found.posterior
    doubted = distrusted or (
        found.alarm
        and (
            has_residual_structure(best, (*found.with_discrepancy(), *besides))
            or outside_prior(best)
            or (held_out is not None and exceeds_noise(held_out.chi2_per_sample, best.best.rows))
        )
    )
    if doubted:
        posterior = posterior.doubted()
    verdict, candidates = decide(posterior, lacking=doubted, inseparable=found.model.inseparable)
    fits = posterior.best
    with_sizes = tuple(
        replace(each, effects=sized(fits[each.names], each.probability)) for each in candidates
    )
    return Judgement(found, posterior, verdict, with_sizes)


def sized(fit: Fit, probability: float) -> tuple[EffectEstimate, ...]:
    """
    Return the effects of a hypothesis with their sizes, by name.

    Parameters
    ----------
    fit
        Of the hypothesis.
    probability
        Of its names.

    Returns
    -------
    tuple of EffectEstimate
        Of the effects that have parameters of their own; not those that the ship
        file states.
    """
    found = []
    for part, place in fit.hypothesis.parts:
        if not isinstance(part, EffectTerm) or part.stated:
            continue
        values = {name: Parameter(value, 0.0) for name, value in part.fixed}
        for i, unknown in enumerate(part.unknowns, place):
            z, sd = float(fit.best.z[i]), float(np.sqrt(fit.covariance[i, i]))
            prior = unknown.prior
            values[unknown.name] = Parameter(prior.at(z), abs(prior.slope(z)) * sd)
        ordered = {q.name: values[q.name] for q in part.effect.parameters}
        found.append(EffectEstimate(part.effect.name, probability, ordered))
    return tuple(sorted(found, key=lambda effect: effect.name))


def has_residual_structure(fit: Fit, with_discrepancy: Sequence[Fit]) -> bool:
    """
    Say whether a hypothesis leaves more than noise.

    Parameters
    ----------
    fit
        Of the hypothesis.
    with_discrepancy
        The same with something smooth besides.

    Returns
    -------
    bool
        By chi^2, or where something smooth gains 5 nats of evidence.
    """
    if exceeds_noise(fit.chi2_per_row, fit.best.rows):
        return True
    limit = fit.log_likelihood + _LACK_NATS
    return any(more.log_likelihood > limit for more in with_discrepancy)


def outside_prior(fit: Fit) -> bool:
    """
    Say whether an effect is there in a way that its prior hardly holds.

    However large it is, a turn that hardly changes the heading, or is over in some seconds, is
    something else: a shape parameter beyond 2.5 prior sd. So is one that follows its formula
    only with departures beyond 3.5 sd together, and a size whose logarithm is beyond 5. Sizes
    of either sign, and components of one, are no shape.

    Parameters
    ----------
    fit
        Of the hypothesis.

    Returns
    -------
    bool
        Of any effect that is not stated in the ship file.
    """
    for part, place in fit.hypothesis.parts:
        z = np.abs(fit.best.z[place : place + len(part.unknowns)])
        if any(part is error for error in fit.hypothesis.model_errors):
            if float(np.linalg.norm(z)) > _FORM_SD:
                return True
        elif any(each > _most_sd(part, i) for i, each in enumerate(z)):
            return True
    return False


def _most_sd(part: Part, place: int) -> float:
    """Return the prior standard deviations beyond which an unknown of an effect is odd."""
    if not isinstance(part, EffectTerm) or part.stated or part.kept or place in part.one_size:
        return math.inf
    unknown = part.unknowns[place]
    if unknown.name != part.effect.parameters[0].name:
        return _SHAPE_SD
    return _SIZE_SD if unknown.prior.shape is Shape.LOG_NORMAL else math.inf


def exceeds_noise(chi2_per_row: float, rows: int) -> bool:
    """
    Say whether what is left is more than noise, as well as that is known.

    Parameters
    ----------
    chi2_per_row
        Mean square of the whitened residuals.
    rows
        Their number.

    Returns
    -------
    bool
        More than 4 sd and 0.2 above 1.
    """
    return chi2_per_row > 1.0 + _LACK_SD * math.sqrt(2.0 / rows) + _LACK_SLACK


def decide(
    posterior: Posterior, *, lacking: bool, inseparable: Sequence[frozenset[str]]
) -> tuple[Verdict, tuple[Candidate, ...]]:
    """
    Return verdict and candidates.

    Parameters
    ----------
    posterior
        Of hypotheses.
    lacking
        Something is left that no name explains.
    inseparable
        Effects that no record can separate.

    Returns
    -------
    verdict : Verdict
        Named only from a probability of 0.9.
    candidates : tuple of Candidate
        The fewest that hold 99 % of what has a name.
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
        if held >= SET * total:
            break
    return tuple(found)
