# SPDX-License-Identifier: Apache-2.0
"""All hypotheses about some runs, fitted: singles, and pairs where something is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from shipdrag_ros.diagnosis.fitting import Fit, fit
from shipdrag_ros.diagnosis.hypotheses import Library
from shipdrag_ros.diagnosis.linear import Hypothesis
from shipdrag_ros.diagnosis.screening import screening_score
from shipdrag_ros.diagnosis.terms import RunNuisance
from shipdrag_ros.diagnosis.verdict import QUIET, Posterior, mode_of, posterior_of
from shipdrag_ros.simulation.effects import find

_PAIRED = 4  # most probable names that pairs are tried with
_PAIRS = 12  # that are fitted
_STARTS = 2  # of each hypothesis that are fitted


@dataclass(frozen=True)
class Found:
    """
    What a search found.

    Attributes
    ----------
    library
    nothing
        The fit where nothing is missing.
    fits
        Of everything.
    """

    library: Library
    nothing: Fit
    fits: tuple[Fit, ...]

    @cached_property
    def posterior(self) -> Posterior:
        """All with their probabilities."""
        return posterior_of(self.fits)

    @property
    def smooth(self) -> tuple[Fit, ...]:
        """Fits with something unnamed instead, one a channel."""
        return tuple(one for one in self.fits if one.hypothesis.discrepancy)

    @property
    def best(self) -> Fit:
        """The most probable of what has a name, or is nothing."""
        return self.posterior.best[self.posterior.named()[0]]

    def stop_moved_s(self, run: int) -> float:
        """
        Return by how much the best fit moves the stop of a run.
        """
        for part, place in self.best.hypothesis.parts:
            if isinstance(part, RunNuisance) and part.run == run:
                at = part.place_of_stop
                return part.unknowns[at].value(float(self.best.best.z[place + at]))
        raise AssertionError(f'run {run} has no place')


def search(library: Library) -> Found:
    """
    Fit nothing, each effect, and something unnamed.
    """
    nothing = fit(library.problem, [library.nothing], [library.start(library.nothing)])[0]
    named = [h for e in library.effects for h in library.with_effect(library.nothing, e)]
    unnamed = [library.with_discrepancy(library.nothing, c) for c in library.channels()]
    likely = _likeliest_starts(library, named, nothing)
    both = [*likely, *unnamed]
    fits = fit(library.problem, both, [library.start(h, nothing) for h in both])
    return Found(library, nothing, (nothing, *fits))


def with_pairs(found: Found) -> Found:
    """
    Fit pairs besides, where something is missing.
    """
    if found.posterior.nothing >= QUIET:
        return found
    pairs = _pairs(found.library, found.posterior)
    return replace(found, fits=(*found.fits, *pairs))


def with_more(found: Found) -> tuple[Fit, ...]:
    """
    Return fits of something smooth besides the best.
    """
    library, best = found.library, found.best
    if not best.hypothesis.names:
        return found.smooth
    more = [library.with_discrepancy(best.hypothesis, c) for c in library.channels()]
    return tuple(fit(library.problem, more, [library.start(h, best) for h in more]))


def _likeliest_starts(
    library: Library, hypotheses: Sequence[Hypothesis], near: Fit
) -> list[Hypothesis]:
    """Keep the most promising starts of each hypothesis."""
    promised = screening_score(library.problem, near, hypotheses)
    kept: dict[tuple[object, ...], list[Hypothesis]] = {}
    for i in np.argsort(-promised):
        found = kept.setdefault(mode_of(hypotheses[i]), [])
        if len(found) < _STARTS:
            found.append(hypotheses[i])
    return [one for ones in kept.values() for one in ones]


def _pairs(library: Library, posterior: Posterior) -> list[Fit]:
    """Fit pairs of the likeliest names with all others."""
    first = [names for names in posterior.named() if names][:_PAIRED]
    tried: list[tuple[float, Hypothesis, Fit]] = []
    for names in first:
        base = posterior.best[names]
        hypotheses = [
            hypothesis
            for effect in library.effects
            if all(effect.goes_with(find(name)) for name in names)
            for hypothesis in library.with_effect(base.hypothesis, effect)
        ]
        promised = screening_score(library.problem, base, hypotheses).tolist()
        tried += [(p, one, base) for p, one in zip(promised, hypotheses, strict=True)]
    tried.sort(key=lambda one: -one[0])
    kept: dict[tuple[object, ...], tuple[Hypothesis, Fit]] = {}
    for _, hypothesis, base in tried:
        if len(kept) < _PAIRS:
            kept.setdefault(mode_of(hypothesis), (hypothesis, base))
    starts = [library.start(hypothesis, base) for hypothesis, base in kept.values()]
    return fit(library.problem, [hypothesis for hypothesis, _ in kept.values()], starts)
