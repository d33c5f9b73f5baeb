# SPDX-License-Identifier: Apache-2.0
"""
An effect without that which makes it this effect and no other.

A drag that comes and goes is a turn where the course shows it; where nothing does, it is
something, and has no name.
"""

from __future__ import annotations

from dataclasses import replace

from shipdrag_ros.diagnosis.coast import CoastModel
from shipdrag_ros.diagnosis.fitting import Fit, fit
from shipdrag_ros.diagnosis.model import Hypothesis, start
from shipdrag_ros.diagnosis.search import SearchResult, likely
from shipdrag_ros.diagnosis.terms import EffectTerm


def with_nameless(found: SearchResult, model: CoastModel) -> SearchResult:
    """
    Fit likely effects as something without a name besides, where that is what they may be.

    Parameters
    ----------
    found
        From `search`, with pairs.
    model
        Of the same runs.

    Returns
    -------
    SearchResult
        The same where no effect of the kind is likely, alone or with another.
    """
    tried = [made for one in likely(found.posterior) if (made := _nameless(model, one))]
    if not tried:
        return found
    starts = [start(model, hypothesis, near.best) for hypothesis, near in tried]
    fits = fit(model, [hypothesis for hypothesis, _ in tried], starts)
    return replace(found, fits=(*found.fits, *fits))


def _nameless(model: CoastModel, near: Fit) -> tuple[Hypothesis, Fit] | None:
    """Return the hypothesis of a fit with one of its effects at its nameless values."""
    for term, place in near.hypothesis.parts:
        if not isinstance(term, EffectTerm) or term.stated or term.kept:
            continue
        at = term.effect.nameless_at
        if not at:
            continue
        z = {q.name: float(near.best.z[place + i]) for i, q in enumerate(term.unknowns)}
        fixed = (*term.fixed, *at.items())
        free = [q.name for q in term.effect.parameters if q.name not in dict(fixed)]
        plain = replace(
            term,
            # what a log book says of the effect is not said of something else
            effect=replace(term.effect, facts={}),
            fixed=fixed,
            signs=tuple((name, sign) for name, sign in term.signs if name not in at),
            starts=tuple(z[name] for name in free),
        )
        return model.with_nameless(near.hypothesis, term, plain), near
    return None
