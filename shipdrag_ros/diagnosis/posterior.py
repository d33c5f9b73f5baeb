# SPDX-License-Identifier: Apache-2.0
"""From fits to the posterior probabilities of hypotheses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.model import Hypothesis
from shipdrag_ros.diagnosis.terms import EffectTerm
from shipdrag_ros.inference import decision
from shipdrag_ros.inference.decision import NONE, UNKNOWN, Names


@dataclass(frozen=True)
class Posterior:
    """
    Hypotheses with their probabilities.

    Attributes
    ----------
    best
        Best fit of each: by the names, or by what is unnamed.
    probability
        Of each name or pair, of nothing (`NONE`) and of something without a name (`UNKNOWN`).
    """

    best: Mapping[Names, Fit]
    probability: Mapping[Names, float]

    @property
    def nothing(self) -> float:
        """Probability that nothing is missing."""
        return self.probability.get(NONE, 0.0)

    @property
    def unnamed(self) -> float:
        """Probability of something without a name."""
        return self.probability.get(UNKNOWN, 0.0)

    def named(self) -> list[Names]:
        """
        Return what has a name, or is nothing, most probable first.
        """
        names = [names for names in self.probability if names != UNKNOWN]
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
        As Bayes' rule gives it.
    """
    best: dict[Names, Fit] = {}
    modes: dict[tuple[object, ...], tuple[Names, float]] = {}
    for one in fits:
        names = UNKNOWN if one.hypothesis.discrepancy else one.hypothesis.names
        if names not in best or one.log_evidence > best[names].log_evidence:
            best[names] = one
        mode = mode_of(one.hypothesis)
        if one.log_evidence >= modes.get(mode, (names, -math.inf))[1]:
            modes[mode] = names, one.log_evidence
    # the evidence of a fit holds the prior
    ways = [decision.WeighedHypothesis(names, log, 0.0) for names, log in modes.values()]
    return Posterior(best, decision.probabilities(ways))


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
    kinds = sorted(type(part).__name__ for part, _ in hypothesis.parts)
    return (hypothesis.names, hypothesis.discrepancy, *kinds, *sorted(ways))
