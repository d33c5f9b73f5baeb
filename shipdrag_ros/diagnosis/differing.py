# SPDX-License-Identifier: Apache-2.0
"""
Runs between which the hull changed: an effect of the hull with a size for each.

Where one state of the hull does not fit all runs, one size for all is none of them.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shipdrag_ros.diagnosis.coast import CoastModel
from shipdrag_ros.diagnosis.fitting import fit
from shipdrag_ros.diagnosis.model import Hypothesis, start
from shipdrag_ros.diagnosis.result import RunSize
from shipdrag_ros.diagnosis.search import SearchResult
from shipdrag_ros.diagnosis.terms import EffectTerm
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.simulation.effect import Scope

_DAY_NS = 12 * 3600 * 10**9  # between runs, from where the hull may be another
_ONE_DAY, _OTHER_DAYS = 0.03, 0.3  # chance that an effect of the hull differs between runs


def with_differing(found: SearchResult, model: CoastModel) -> SearchResult:
    """
    Fit each effect of the hull with a size for each run besides.

    Parameters
    ----------
    found
        From `search`.
    model
        Of the same runs.

    Returns
    -------
    SearchResult
        The same with a single run.
    """
    if len(model.seen) < 2:
        return found
    stops = [run.context.stop.since_ns for run in model.seen]
    chance = _OTHER_DAYS if max(stops) - min(stops) > _DAY_NS else _ONE_DAY
    tried: list[Hypothesis] = []
    for effect in model.effects:
        if effect.scope is not Scope.HULL:
            continue
        # where else a fit begins is of the shared size
        one = model.with_effect(model.nothing, effect)[0]
        *terms, shared = one.terms
        own = replace(shared, sizes=len(model.seen))
        errors = tuple(replace(error, term=own) for error in one.model_errors)
        log_prior = one.log_prior + math.log(chance)
        tried.append(replace(one, terms=(*terms, own), model_errors=errors, log_prior=log_prior))
    starts = [start(model, one, found.nothing.best) for one in tried]
    return replace(found, fits=(*found.fits, *fit(model, tried, starts)))


def runs_differ(found: SearchResult) -> tuple[RunSize, ...]:
    """
    Return the size in each run, where the most probable hypothesis has one for each.

    Parameters
    ----------
    found
        From `with_differing`.

    Returns
    -------
    tuple of RunSize
        Empty where one size serves all runs.
    """
    best = found.best
    assert isinstance(found.model, CoastModel)
    sizes = []
    for part, place in best.hypothesis.parts:
        if not isinstance(part, EffectTerm) or part.sizes == 1:
            continue
        for j, run in enumerate(found.model.seen):
            z, prior = float(best.best.z[place + j]), part.unknowns[j].prior
            sd = abs(prior.slope(z)) * float(np.sqrt(best.covariance[place + j, place + j]))
            name = part.effect.parameters[0].name
            sizes.append(RunSize(run.name, part.effect.name, name, Parameter(prior.at(z), sd)))
    return tuple(sizes)
