# SPDX-License-Identifier: Apache-2.0
"""From the posterior of a search to what is answered, with sizes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.posterior import Posterior
from shipdrag_ros.diagnosis.result import Candidate, DiagnosisResult, EffectEstimate
from shipdrag_ros.diagnosis.search import SearchResult
from shipdrag_ros.diagnosis.terms import EffectTerm
from shipdrag_ros.inference.decision import UNKNOWN, Names, Verdict, decide, mixture
from shipdrag_ros.parameter import Parameter


@dataclass(frozen=True)
class Judgement:
    """
    A verdict, and what it rests on.

    Attributes
    ----------
    found
    posterior
        Of all hypotheses.
    verdict
    effects
        That are named.
    candidates
    """

    found: SearchResult
    posterior: Posterior
    verdict: Verdict
    effects: tuple[EffectEstimate, ...]
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
            effects=self.effects,
            candidates=self.candidates,
            nothing=self.posterior.nothing,
            unnamed=self.posterior.unnamed,
            best=self.best,
            **rest,
        )


def judge(found: SearchResult, unseen: Mapping[str, float] = MappingProxyType({})) -> Judgement:
    """
    Return the verdict on what a search found.

    Parameters
    ----------
    found
        With pairs, where they are looked for.
    unseen
        Prior odds of effects that these data cannot show: what is so without them is so with them.

    Returns
    -------
    Judgement
        The decision that the posterior probabilities alone make.
    """
    fits = found.posterior.best
    posterior = _with_unseen(found.posterior, unseen)
    decision = decide(posterior.probability, found.model.inseparable)
    candidates = tuple(
        Candidate(names, p, sized(fits[names], p) if names in fits and names != UNKNOWN else ())
        for names, p in decision.candidates
    )
    named = tuple(_named(posterior, name, p) for name, p in sorted(decision.effects.items()))
    return Judgement(found, posterior, decision.verdict, named, candidates)


def _with_unseen(posterior: Posterior, odds: Mapping[str, float]) -> Posterior:
    """Return the posterior with effects whose evidence is that of nothing."""
    total = 1.0 + posterior.nothing * math.fsum(odds.values())
    both: dict[Names, float] = dict(posterior.probability)
    both |= {(name,): posterior.nothing * each for name, each in odds.items()}
    return Posterior(posterior.best, {names: p / total for names, p in both.items()})


def _named(posterior: Posterior, name: str, probability: float) -> EffectEstimate:
    """Return an effect with its sizes over all hypotheses that hold it."""
    holding = [
        (p, effect)
        for names, p in posterior.probability.items()
        if name in names and names != UNKNOWN
        for effect in sized(posterior.best[names], p)
        if effect.name == name
    ]
    _, first = max(holding, key=lambda each: each[0])
    sizes = {}
    for key in first.parameters:
        parts = [(p, effect.parameters[key]) for p, effect in holding]
        sizes[key] = Parameter(*mixture((p, size.value, size.sd) for p, size in parts))
    return EffectEstimate(name, probability, sizes)


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
