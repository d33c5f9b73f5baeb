# SPDX-License-Identifier: Apache-2.0
"""From fits to the posterior probabilities of hypotheses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.model import Hypothesis
from shipdrag_ros.diagnosis.terms import EffectTerm

UNNAMED = ('?',)  # stands among the names for something without one
CERTAIN = 0.9  # probability from which an effect is named
QUIET = 0.1  # of nothing missing, from which nothing is said
_LOG_BAYES_FACTOR = math.log(10.0)  # from where evidence is strong (Jeffreys 1961)


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

    Returns
    -------
    Posterior
        After pruning by Bayes factors.
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
    log = {key: _log_sum(found.values()) for key, found in modes.items()}
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
    total = _log_sum(kept.values())
    return {names: math.exp(log - total) for names, log in kept.items()}


def _log_sum(logs: Iterable[float]) -> float:
    """Return the logarithm of a sum; quicker for a handful than scipy's."""
    kept = list(logs)
    top = max(kept)
    if not math.isfinite(top):
        return top
    return top + math.log(math.fsum(math.exp(log - top) for log in kept))


def mode_of(hypothesis: Hypothesis) -> tuple[object, ...]:
    """
    Return names, and what separates a mode from others of the same names.

    Parameters
    ----------
    hypothesis
        Of any model.

    Returns
    -------
    tuple
        To be compared; where a fit begins is no part of it.
    """
    ways = [
        (term.effect.name, term.fixed, term.signs, str(term.only_run), term.sizes, term.kept)
        for term in hypothesis.terms
        if isinstance(term, EffectTerm)
    ]
    return (hypothesis.names, hypothesis.discrepancy, *sorted(ways))
