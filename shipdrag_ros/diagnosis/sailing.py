# SPDX-License-Identifier: Apache-2.0
"""
Sensor effects and current from any sailing, without a coastdown.

The log is held against the way made good over ground, on many courses and at
many speeds. No baseline is needed, and no force can be seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shipdrag_ros.diagnosis.advice import declared
from shipdrag_ros.diagnosis.legs import Direction, Legs, SailingRecord, left_text
from shipdrag_ros.diagnosis.result import (
    LOG_TRACK,
    DiagnosisResult,
    Gap,
    Where,
)
from shipdrag_ros.diagnosis.sailing_model import SailingFit, SailingModel, StandingLog, shown
from shipdrag_ros.diagnosis.verdict import asked, judge, waiting
from shipdrag_ros.diagnosis.words import of_the_earth
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.inference.decision import CERTAIN, NONE, Verdict
from shipdrag_ros.inference.rows import OUTLIER
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.compare import ComparedHypotheses
from shipdrag_ros.posterior.hypotheses import Explanation
from shipdrag_ros.simulation.effect import Scope, WithoutBaseline
from shipdrag_ros.simulation.effects import LIBRARY

_POSSIBLE = 0.01  # probability from which nothing is said against an effect
_QUARTERS = ('east', 'north', 'west', 'south')


def diagnose_sailing(
    records: Sequence[SailingRecord],
    parameters: Parameters,
    *,
    no_coastdown: str = 'No coastdown is used.',
) -> DiagnosisResult:
    """
    Name what is wrong between log and way over ground.

    Parameters
    ----------
    records
        One or more, of the same ship; a current is stated along the first leg.
    parameters
        For the convention of the heading.
    no_coastdown
        For the reader: that there is no coastdown, and why.

    Returns
    -------
    Diagnosis
        Of baseline 'none'; it speaks of log and track alone.

    Raises
    ------
    DiagnosisError
        If there is no log, nothing over ground, or too little even sailing.
    """
    standing = StandingLog.of(records, parameters)
    try:
        legs = Legs.of(records, parameters)
    except DiagnosisError as error:
        if standing is None:
            raise
        return _zeros_alone(standing, str(error), no_coastdown)
    open_ = ~np.array([record.units_checked for record in records])[legs.record]
    ratio = legs.log_m_s[open_] / legs.ground_m_s[open_]
    question = asked(float(np.median(ratio))) if open_.any() else ''
    return waiting(_diagnosed(legs, standing, no_coastdown), question)


def _diagnosed(legs: Legs, standing: StandingLog | None, no_coastdown: str) -> DiagnosisResult:
    """Diagnose legs on which the log turns."""
    model = SailingModel.learnt(legs)
    # legs that no effect and no noise explains
    outlier = np.abs(model.all_together.white) > OUTLIER
    if outlier.any():
        legs = legs[np.flatnonzero(~outlier)]
        model = SailingModel.learnt(legs)
    found = model.compare(standing)
    judged = judge(found, model.inseparable)
    verdict, best, effects = judged.decision.verdict, found.best[judged.top], judged.effects
    if standing and not effects and standing.named.probability >= CERTAIN:
        # a name that something without one, beside it, does not touch
        verdict, effects = Verdict.NAMED, (standing.named,)
    answer = judged.result(
        would_decide=declared(judged.candidates) if verdict is Verdict.ONE_OF else (),
        where=None if verdict is Verdict.NONE else _where(model, standing, best),
        before=_gap(found.best[NONE]),
        after=_gap(best) if judged.missing else None,
        baseline='none',
        notes=(
            *([standing.note] if standing else []),
            *legs.notes,
            *_about(model, int(outlier.sum())),
            *(_why(model, found, best) if judged.missing else ()),
        ),
        examined=(LOG_TRACK,),
        no_coastdown=no_coastdown,
    )
    return replace(answer, verdict=verdict, effects=effects)


def _gap(fit: SailingFit) -> Gap:
    return Gap(float(np.sqrt(np.mean(fit.residual_m_s**2))), None, fit.chi2)


def _zeros_alone(standing: StandingLog, why: str, no_coastdown: str) -> DiagnosisResult:
    """Return the result where too little is left beside the zeros."""
    none = np.zeros(0)
    nothing = SailingFit(Explanation(), none, none, none, none, np.zeros((0, 0)), 0.0)
    fits = nothing, standing.joined(nothing)
    found = ComparedHypotheses((standing.way.effect,), fits)
    judged = judge(found, ())
    return judged.result(
        where=standing.where if judged.missing else None,
        before=Gap(standing.rms_m_s, None, math.nan),
        baseline='none',
        notes=(standing.note, f'nothing else between log and track was examined: {why}'),
        examined=(LOG_TRACK,),
        no_coastdown=no_coastdown,
    )


def _where(model: SailingModel, standing: StandingLog | None, best: SailingFit) -> Where:
    """Return where log and ground disagree; which is wrong is known only of a name."""
    legs, names = model.legs, best.names
    if standing and names == (standing.way.effect.name,):
        return standing.where
    of_log = bool(names) and all(LIBRARY[name].scope is Scope.SENSOR for name in names)
    half = 0.5 * legs.length_s
    return Where(
        'log' if of_log and legs.geodetic else 'log_radar',
        (float(legs.time_s.min()) - half, float(legs.time_s.max()) + half),
        (float(legs.log_m_s.min()), float(legs.log_m_s.max())),
    )


def _about(model: SailingModel, outliers: int) -> list[str]:
    """Say what was used."""
    legs = model.legs
    found = [
        f'log and way over ground are compared on {len(legs)} legs of {legs.length_s:.0f} s, '
        f'whose direction is by {legs.direction}; left out: '
        f'{left_text(legs.left_out)}' + (f', outlier {outliers}' if outliers else '')
    ]
    if legs.direction is Direction.UNKNOWN:
        found.append(
            'without position and heading the courses are not known: a current and an offset '
            'of the log look alike'
        )
    if ruled_out := [effect for effect in shown() if effect not in model.effects]:
        found.append(of_the_earth(ruled_out))
    return found


def _why(
    model: SailingModel, found: ComparedHypotheses[SailingFit], best: SailingFit
) -> list[str]:
    """Say why it is this and none of the others."""
    legs, names = model.legs, best.names
    lines = [f'log over ground: {_by_speed(legs)}']
    action = model.action(best.hypothesis.ways, best.z)
    if any(action.current_m_s):
        east, north = action.current_m_s
        lines.append(f'the water moves by {east:+.3f} m/s to the east, {north:+.3f} to the north')
    if legs.direction is not Direction.UNKNOWN:
        lines.append(f'log over ground by course: {_by_course(legs)}')
    for effect in model.together:
        alike = [sets for sets in model.inseparable if effect.name in sets and sets & set(names)]
        probability = found.probability.get((effect.name,), 0.0)
        if effect.name in names or alike or probability > _POSSIBLE:
            continue
        alone = found.best[effect.name,]
        lines.append(
            f'why not {effect.name}: {effect.without_baseline[WithoutBaseline.LOG_TRACK]}; alone '
            f'it leaves chi2 {alone.chi2:.2f} a leg, {" and ".join(names)} '
            f'{best.chi2:.2f}, and is less probable by '
            f'{0.5 * len(legs) * (alone.chi2 - best.chi2):.0f} nats'
        )
    return lines


def _by_course(legs: Legs) -> str:
    quarter = np.round(legs.direction_rad / (0.5 * math.pi)).astype(int) % 4
    return ', '.join(
        f'{name} {_ratio(legs, quarter == k)}'
        for k, name in enumerate(_QUARTERS)
        if (quarter == k).any()
    )


def _by_speed(legs: Legs) -> str:
    low, high = np.quantile(legs.ground_m_s, (1.0 / 3.0, 2.0 / 3.0))
    slow, fast = legs.ground_m_s <= low, legs.ground_m_s >= high
    return (
        f'{_ratio(legs, slow)} up to {low:.1f} m/s, {_ratio(legs, fast)} from {high:.1f} m/s, '
        f'{_ratio(legs, slow | True)} in all'
    )


def _ratio(legs: Legs, part: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> str:
    ratio = float(legs.log_m_s[part].sum() / legs.ground_m_s[part].sum())
    return f'{ratio:.3f} ({np.count_nonzero(part)} legs)'
