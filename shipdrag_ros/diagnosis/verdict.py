# SPDX-License-Identifier: Apache-2.0
"""
From compared hypotheses to what is answered: sizes, limits, and how runs differ.

Whether that is `named`, `one_of`, `unknown` or `none` is decided by `inference.decision.decide`.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Generic

import numpy as np

from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.result import (
    Candidate,
    DiagnosisResult,
    EffectEstimate,
    Limit,
    RunSize,
)
from shipdrag_ros.display import mistaken_units
from shipdrag_ros.inference.decision import (
    NONE,
    UNKNOWN,
    Decision,
    Names,
    Verdict,
    decide,
    marginals,
    mixture,
)
from shipdrag_ros.inference.limits import quantile
from shipdrag_ros.inference.rows import LOG, OVER_GROUND, POSITION
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.posterior.compare import ComparedHypotheses, Comparing, Fit, Fitted, WeighedFit
from shipdrag_ros.posterior.effects import EffectWay
from shipdrag_ros.posterior.limits import percent_of_r, sizes_named
from shipdrag_ros.ship.facts import UNITS_CHECKED

_SHARE = 0.95  # of a size, below its limit
_RIVALS = 40  # likeliest effects of which it is found from what size on they are named


@dataclass(frozen=True)
class Judgement(Generic[Fit]):
    """
    A verdict, and what it rests on.

    Attributes
    ----------
    found
    decision
    effects
        That are named.
    candidates
    """

    found: ComparedHypotheses[Fit]
    decision: Decision
    effects: tuple[EffectEstimate, ...]
    candidates: tuple[Candidate, ...]

    @property
    def top(self) -> Names:
        """What is most probable of all that has a name, or nothing."""
        return next(names for names in self.found.probability if names != UNKNOWN)

    @property
    def missing(self) -> bool:
        """Whether the most probable hypothesis explains something that is missing."""
        return bool(self.top) and self.decision.verdict in (Verdict.NAMED, Verdict.ONE_OF)

    @property
    def explained(self) -> Fit:
        """What explains the runs: nothing, the likeliest names or something without a name."""
        if self.decision.verdict is Verdict.UNKNOWN:
            return self.found.best[UNKNOWN]
        return self.found.best[self.top if self.missing else NONE]

    @property
    def best(self) -> tuple[EffectEstimate, ...]:
        """Effects of the most probable names, with their sizes."""
        return sized(self.found.best[self.top], self.found.probability[self.top])


def judge(
    found: ComparedHypotheses[Fit], inseparable: Sequence[Collection[str]]
) -> Judgement[Fit]:
    """
    Return the decision that the posterior probabilities alone make.
    """
    decided = decide(found.probability, inseparable)
    return Judgement(
        found,
        decided,
        tuple(_named(found, name, p) for name, p in sorted(decided.effects.items())),
        tuple(
            Candidate(names, p, () if names == UNKNOWN else sized(found.best[names], p))
            for names, p in decided.candidates
        ),
    )


def sized(fit: WeighedFit, probability: float) -> tuple[EffectEstimate, ...]:
    """
    Return the effects of a hypothesis with their sizes, by name; of runs that differ the last.
    """
    found = {
        way.effect.name: EffectEstimate(way.effect.name, probability, sizes)
        for way, sizes in _sizes(fit)
        if not way.stated
    }
    return tuple(found[name] for name in sorted(found))


def _sizes(fit: WeighedFit) -> list[tuple[EffectWay, dict[str, Parameter]]]:
    """Return the parameters of each way."""
    found, place = [], 0
    assert fit.z is not None
    assert fit.sd is not None
    for way in fit.hypothesis.ways:
        values = {name: Parameter(value, 0.0) for name, value in way.fixed}
        for i, q in enumerate(way.unknowns, place):
            z, sd = float(fit.z[i]), float(fit.sd[i])
            values[q.name] = Parameter(q.prior.at(z), abs(q.prior.slope(z)) * sd)
        place += len(way.unknowns)
        found.append((way, {q.name: values[q.name] for q in way.effect.parameters}))
    return found


def runs_differ(fit: WeighedFit, names: Sequence[str]) -> tuple[RunSize, ...]:
    """
    Return the size in each run, where a hypothesis has one for each.

    Parameters
    ----------
    fit
    names
        Of the runs.
    """
    ways = [(way, sizes) for way, sizes in _sizes(fit) if not way.stated]
    effects = [way.effect.name for way, _ in ways]
    found = []
    for way, sizes in ways:
        if way.run is not None and effects.count(way.effect.name) > 1:
            first = way.effect.parameters[0].name
            found.append(RunSize(names[way.run], way.effect.name, first, sizes[first]))
    return tuple(found)


def _named(found: ComparedHypotheses[Fit], name: str, probability: float) -> EffectEstimate:
    """Return an effect with its sizes over all hypotheses that hold it."""
    holding = [
        (p, effect)
        for names, p in found.probability.items()
        if name in names and names != UNKNOWN
        for effect in sized(found.best[names], p)
        if effect.name == name
    ]
    keys = max(holding, key=lambda each: each[0])[1].parameters
    sizes = {
        key: Parameter(
            *mixture((p, e.parameters[key].value, e.parameters[key].sd) for p, e in holding)
        )
        for key in keys
    }
    return EffectEstimate(name, probability, sizes)


def limits_of(
    judged: Judgement[Fitted], comparing: Comparing, never: Sequence[frozenset[str]]
) -> dict[str, Limit]:
    """
    Return the limit of each effect that is not named, by name.
    """
    found, named = judged.found, judged.decision.effects
    probable = marginals(found.probability)
    names = sorted(comparing.ways, key=lambda name: -probable.get(name, 0.0))[:_RIVALS]
    from_size = sizes_named(comparing, names, {name for group in never for name in group})
    limits = {}
    for effect in found.effects:
        sizes = found.sizes(effect.name)
        if effect.name in named or not sizes:
            continue
        grows = effect.size_power > 0.0
        bound = quantile(sizes, _SHARE if grows else 1.0 - _SHARE)
        limits[effect.name] = Limit(
            effect.parameters[0].name,
            'upper_95' if grows else 'lower_95',
            bound,
            from_size.get(effect.name),
            percent_of_r(comparing, effect.name, bound),
        )
    return limits


def asked(ratio: float) -> str:
    """
    Ask about units where log over ground is a ratio of two; else return ''.

    Parameters
    ----------
    ratio
        Of the log over the speed over ground.

    Returns
    -------
    str
        For the reader.
    """
    units = mistaken_units(ratio)
    if not units:
        return ''
    return (
        f'the log reads {ratio:.2f} times the way over ground, near {units}: is the unit of '
        'one of them wrong? Import it again with its unit, as in '
        f'--map speed_through_water=COLUMN:kn; if it is right, say so with --fact {UNITS_CHECKED}'
    )


def waiting(found: DiagnosisResult, question: str) -> DiagnosisResult:
    """
    Return a diagnosis whose verdict waits for the answer to a question.

    Parameters
    ----------
    found
        As it is if the units are right.
    question
        A sentence; '' where there is none, and the diagnosis stands.
    """
    if not question:
        return found
    return replace(
        found, verdict=Verdict.ONE_OF, effects=(), would_decide=(), where=None, question=question
    )


def ratio_before_the_stop(seen: Observation) -> float:
    """
    Return log over ground in the steady record; NaN without both.

    Parameters
    ----------
    seen
        A run.
    """
    rows = seen.along.rows
    steady = rows.time_s < seen.lead_in_s
    of_log = rows.value[steady & (rows.kind == LOG)]
    ground = rows.value[steady & (rows.kind == OVER_GROUND)]
    if not len(ground):
        placed = steady & (rows.kind == POSITION)
        half = int(placed.sum()) // 2  # far apart, where the noise of places is nothing
        time_s, place = rows.time_s[placed], rows.value[placed]
        ground = (
            (place[-half:] - place[:half]) / (time_s[-half:] - time_s[:half]) if half else ground
        )
    if not len(of_log) or not len(ground) or not np.median(ground) > 0.0:
        return float('nan')
    return float(np.median(of_log) / np.median(ground))
