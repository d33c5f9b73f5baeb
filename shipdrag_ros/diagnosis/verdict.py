# SPDX-License-Identifier: Apache-2.0
"""
From fits to a verdict: a name only where the data can tell.

Evidence names; a smooth discrepancy that a name does not explain takes the name
back; what nothing in a record can tell apart stays a set.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.linear import Hypothesis
from shipdrag_ros.diagnosis.result import Candidate, Verdict
from shipdrag_ros.diagnosis.terms import EffectTerm

CERTAIN = 0.9  # probability from which an effect is named
QUIET = 0.1  # of nothing missing, from which nothing is said
_SET = 0.99  # of the candidates
_ASKED = math.log(10.0)  # of evidence, from where it is strong (Jeffreys 1961)
_LACK_NATS = 5.0  # of evidence that something smooth besides must gain
_ODD_SD = 2.5  # standard deviations of what is expected of an effect, its size apart
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


UNNAMED = ('?',)


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
    for fit in fits:
        key = UNNAMED if fit.hypothesis.discrepancy else fit.hypothesis.names
        if key not in best or fit.log_evidence > best[key].log_evidence:
            best[key] = fit
        mode = mode_of(fit.hypothesis)
        found = modes.setdefault(key, {})
        found[mode] = max(found.get(mode, -math.inf), fit.log_evidence)
    log = {key: float(logsumexp(list(found.values()))) for key, found in modes.items()}
    return Posterior(
        best, prune_by_bayes_factor(log, {key: best[key].hypothesis.log_odds for key in log})
    )


def prune_by_bayes_factor(
    log_evidence: Mapping[tuple[str, ...], float], log_odds: Mapping[tuple[str, ...], float]
) -> dict[tuple[str, ...], float]:
    """
    Return probabilities, where an effect that the data do not ask for is left out.

    A record in which an effect cannot be seen speaks neither for nor against it.
    What it leaves to a name with such an effect belongs to the name alone.

    Parameters
    ----------
    log_evidence
        Of names, prior included.
    log_odds
        Of names before the data, over nothing.
    """
    kept = dict(log_evidence)
    asked = {names: log_evidence[names] - log_odds[names] for names in kept}
    for names in sorted(log_evidence, key=lambda names: -len(names)):
        fewer = [
            other
            for other in log_evidence
            if len(other) == len(names) - 1 and set(other) < set(names) and names != UNNAMED
        ]
        if not fewer:
            continue
        alone = max(fewer, key=lambda other: asked[other])
        if asked[names] <= asked[alone] + _ASKED:
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


def has_residual_structure(fit: Fit, with_more: Sequence[Fit]) -> bool:
    """
    Tell whether a name leaves more than noise.

    Parameters
    ----------
    with_more
        The same with something smooth besides.
    """
    if exceeds_noise(fit.chi2_per_row, fit.best.rows):
        return True
    return any(more.log_likelihood > fit.log_likelihood + _LACK_NATS for more in with_more)


def outside_prior(fit: Fit) -> bool:
    """
    Tell whether an effect is there in a way that it is not known in.

    However large it is, a turn that hardly changes the heading, or is over in some
    seconds, is something else.
    """
    for part, place in fit.hypothesis.parts:
        if not isinstance(part, EffectTerm) or part.stated:
            continue
        size = part.effect.parameters[0].name
        for i, unknown in enumerate(part.unknowns):
            if unknown.name != size and abs(float(fit.best.z[place + i])) > _ODD_SD:
                return True
    return False


def exceeds_noise(chi2_per_row: float, rows: int) -> bool:
    """
    Tell whether what is left is more than noise, as well as that is known.
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
