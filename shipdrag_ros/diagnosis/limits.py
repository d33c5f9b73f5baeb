# SPDX-License-Identifier: Apache-2.0
"""How large each effect that is not named can be, and from which size on it would have been."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from shipdrag_ros.diagnosis.coast import CoastModel
from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.model import Hypothesis
from shipdrag_ros.diagnosis.posterior import Posterior
from shipdrag_ros.diagnosis.result import Limit
from shipdrag_ros.diagnosis.search import SearchResult, sensitivity
from shipdrag_ros.diagnosis.terms import EffectTerm, trial_z
from shipdrag_ros.inference.decision import UNKNOWN
from shipdrag_ros.inference.limits import SizePosterior, named_from, quantile
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.effect import Effect

_SHARE = 0.95
_SPEEDS = 60  # at which resistances are compared
_RUN_DOWNS = 8.0  # after the stop, from where no thrust is left


def limits_of(found: SearchResult, model: CoastModel, named: Collection[str]) -> dict[str, Limit]:
    """
    Return the limit of each effect that is not named.

    Parameters
    ----------
    found
        With pairs.
    model
        Of the same runs.
    named
        Effects that need none.

    Returns
    -------
    dict
        By name; without an effect whose size no fit has found.
    """
    amounts = _named_from(found, model)
    bounds: dict[str, tuple[Effect, float, Fit]] = {}
    for effect in model.effects:
        sizes = _sizes(found.posterior, effect.name) if effect.name not in named else []
        if sizes:
            share = _SHARE if effect.size_power > 0.0 else 1.0 - _SHARE
            likeliest = found.posterior.best[effect.name,]
            bounds[effect.name] = effect, quantile(sizes, share), likeliest
    percent = _percent_of_r(found, model, bounds)
    return {
        name: Limit(
            effect.parameters[0].name,
            'upper_95' if effect.size_power > 0.0 else 'lower_95',
            bound,
            amounts.get(name),
            percent[name],
        )
        for name, (effect, bound, _) in bounds.items()
    }


def _sizes(posterior: Posterior, name: str) -> list[SizePosterior]:
    """Return the size of an effect under each hypothesis that holds it."""
    sizes = []
    for names, one in posterior.best.items():
        if names == UNKNOWN or name not in names or not np.isfinite(one.covariance).all():
            continue
        for part, place in one.hypothesis.parts:
            if isinstance(part, EffectTerm) and part.effect.name == name and not part.stated:
                sd = float(np.sqrt(one.covariance[place, place]))
                weight = posterior.probability[names]
                sizes.append(
                    SizePosterior(weight, float(one.best.z[place]), sd, part.unknowns[0].prior)
                )
    # given that it is there: how improbable that is does not matter
    total = sum(each.weight for each in sizes)
    return sizes if total > 0.0 else [each._replace(weight=1.0) for each in sizes]


def _named_from(found: SearchResult, model: CoastModel) -> dict[str, float]:
    """Return the size from which each effect is named; without those that never are."""
    ways = [model.with_effect(model.nothing, effect) for effect in model.effects]
    every = [one for each in ways for one in each]
    if not every:
        return {}
    _, known = sensitivity(model, found.nothing, every)
    chosen, place = [], 0
    for (
        each
    ) in ways:  # of the ways in which it may be there, one that shows neither best nor least
        own = np.diag(known.information)[place : place + len(each)]
        chosen.append(place + int(np.argsort(own)[len(each) // 2]))
        place += len(each)
    part = known._replace(
        information=known.information[np.ix_(chosen, chosen)],
        mean=known.mean[chosen],
        precision=known.precision[chosen],
        log_odds=known.log_odds[chosen],
    )
    never = {name for group in model.inseparable for name in group}
    return {
        effect.name: _size(every[at], effect, float(amount))
        for effect, at, amount in zip(model.effects, chosen, named_from(part), strict=True)
        if np.isfinite(amount) and effect.name not in never
    }


def _size(hypothesis: Hypothesis, effect: Effect, amount: float) -> float:
    """Return the size of so many times the trace of that which is tried."""
    first = hypothesis.terms[-1].unknowns[0]
    tried = abs(float(first.prior.at(trial_z(first))))
    return tried * float(amount ** (1.0 / effect.size_power))


def _percent_of_r(
    found: SearchResult, model: CoastModel, bounds: dict[str, tuple[Effect, float, Fit]]
) -> dict[str, float]:
    """Return by how much of it each effect at its bound changes the resistance that is shown."""
    added, names = [], []
    for name, (_, bound, likeliest) in bounds.items():
        for term, place in likeliest.hypothesis.parts:
            if isinstance(term, EffectTerm) and term.effect.name == name and not term.stated:
                z = likeliest.best.z[place : place + len(term.unknowns)].tolist()
                values = [u.prior.at(each) for u, each in zip(term.unknowns, z, strict=True)]
                first = bound if values[0] >= 0.0 else -bound
                added.append((term, [first] * term.sizes + values[term.sizes :]))
                names.append(name)
                break
    time_s, speeds = model.shown(0, found.nothing.best, added)
    late = time_s > _RUN_DOWNS * model.seen[0].run_down_s
    if late.sum() < 3:
        return dict.fromkeys(bounds, float('nan'))
    curves = [_shown_r(time_s[late], line[late]) for line in speeds]
    apart = [_apart(curves[0], curve) for curve in curves[1:]]
    return dict.fromkeys(bounds, float('nan')) | dict(zip(names, apart, strict=True))


def _shown_r(time_s: Float64, speed_m_s: Float64) -> tuple[Float64, Float64]:
    """Return speeds in ascending order and the loss of speed there."""
    loss = -np.gradient(speed_m_s, time_s)
    order = np.argsort(speed_m_s)
    return speed_m_s[order], loss[order]


def _apart(one: tuple[Float64, Float64], other: tuple[Float64, Float64]) -> float:
    """Return the rms difference of two curves over the speeds that both hold, percent."""
    low, high = max(one[0][0], other[0][0]), min(one[0][-1], other[0][-1])
    if not high > low:
        return float('nan')
    speed = np.linspace(low, high, _SPEEDS)
    first, second = np.interp(speed, *one), np.interp(speed, *other)
    return 100.0 * float(np.sqrt(np.mean(((second - first) / first) ** 2)))
