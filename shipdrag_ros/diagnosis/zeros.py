# SPDX-License-Identifier: Apache-2.0
"""
Readings of exactly 0 while the ship moves: a speed below which a log stands still.

Zeros that come at any speed are drop-outs; a ship that drifts with the water has a
log that rightly reads 0, and one way over ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import betaln, expit, logsumexp

from shipdrag_ros.diagnosis.legs import SailingRecord, Stretches
from shipdrag_ros.diagnosis.result import (
    LOG_TRACK,
    Candidate,
    DiagnosisResult,
    EffectEstimate,
    Gap,
    Where,
)
from shipdrag_ros.inference.decision import CERTAIN, NONE, UNKNOWN, Names, Verdict, decide
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.effect import Effect, WithoutBaseline
from shipdrag_ros.simulation.effects import LIBRARY

_MOVES_M_S = 0.1  # slower is at rest, as positions show it
_SCATTER_M_S = 0.08  # of the way over ground while the log reads 0, that no drift explains
_LEAST = 3  # stretches at 0 while the ship moves, and as many that are not
_APART = 3.0  # stretches in which a wheel sticks once: neighbours are no new evidence
_LAPSES = (0.01, 0.05)  # readings that are otherwise than the speed says
_WIDTHS = (0.02, 0.05, 0.1)  # of the speed at which a wheel begins to turn, relative


@dataclass(frozen=True)
class StandsStill:
    """
    A log that stands still below some speed.

    Attributes
    ----------
    effect
        With the speed.
    stretches
        In which it reads 0 while the ship moves.
    share
        Of the stretches below that speed, in which it reads 0.
    slowest_m_s, fastest_m_s
        Of them.
    rms_m_s
        Of the speed that it does not show.
    length_s
        Of the longest record.
    """

    effect: EffectEstimate
    stretches: int
    share: float
    slowest_m_s: float
    fastest_m_s: float
    rms_m_s: float
    length_s: float


def stands_still(records: Sequence[SailingRecord], parameters: Parameters) -> StandsStill | None:
    """
    Return the speed below which a log reads 0; None where it does not.

    Parameters
    ----------
    records
        With frozen readings of 0.
    parameters
        For the convention of the heading.

    Returns
    -------
    StandsStill or None
        Its probability by the Bayes factor over zeros that come at any speed.

    Raises
    ------
    DiagnosisError
        If there is no log, or nothing over ground.
    """
    stretches = Stretches.of(records, parameters)
    moving = np.abs(stretches.way_m_s) > _MOVES_M_S
    way, zero = stretches.way_m_s[moving], stretches.zero[moving]
    speed = np.abs(way)
    if min(zero.sum(), (~zero).sum()) < _LEAST or _drifts(way[zero], stretches.by_place):
        return None
    effect = _effect()
    bands = np.geomspace(speed.min(), speed.max(), 200)
    prior = np.array([effect.parameters[0].prior.log_density(each) for each in bands.tolist()])
    prior = prior + np.log(np.gradient(bands))
    log_each = prior + _log_likelihood(bands, speed, zero) / _APART
    n, k = len(zero), int(zero.sum())
    at_any_speed = float(betaln(k / _APART + 1.0, (n - k) / _APART + 1.0))
    log_odds = float(logsumexp(log_each)) - at_any_speed + np.log(effect.odds)
    weight = np.exp(log_each - logsumexp(log_each))
    value = float(weight @ bands)
    sd = float(np.sqrt(weight @ (bands - value) ** 2))
    probability = float(expit(log_odds))
    below = speed < value
    if probability < 0.5 or not below.any():
        return None
    sizes = {effect.parameters[0].name: Parameter(value, sd)}
    named = EffectEstimate(effect.name, probability, sizes)
    at_zero = speed[zero]
    return StandsStill(
        named,
        k,
        float(zero[below].mean()),
        float(at_zero.min()),
        float(at_zero.max()),
        float(np.sqrt(np.mean(at_zero**2))),
        stretches.length_s,
    )


def _effect() -> Effect:
    (found,) = (e for e in LIBRARY.values() if WithoutBaseline.ZEROS in e.without_baseline)
    return found


def _drifts(way: np.ndarray[tuple[int], np.dtype[np.complex128]], by_place: bool) -> bool:
    """Say whether one velocity of the water may be all that moves the ship."""
    if not by_place:
        way = np.abs(way).astype(np.complex128)
    return float(np.sqrt(np.mean(np.abs(way - way.mean()) ** 2))) < _SCATTER_M_S


def _log_likelihood(
    bands: Float64, speed: Float64, zero: np.ndarray[tuple[int], np.dtype[np.bool_]]
) -> Float64:
    """Return that of zeros below each band, averaged over lapses and widths, (bands,)."""
    found = []
    for lapse in _LAPSES:
        for width in _WIDTHS:
            below = expit((1.0 - speed / bands[:, None]) / width)
            chance = lapse + (1.0 - 2.0 * lapse) * below
            found.append(np.log(np.where(zero, chance, 1.0 - chance)).sum(axis=1))
    total: Float64 = logsumexp(np.array(found), axis=0) - np.log(len(found))
    return total


def with_zeros(found: DiagnosisResult, still: StandsStill | None) -> DiagnosisResult:
    """
    Add a log that stands still to what log and track show besides.

    Parameters
    ----------
    found
        Of the readings that are not 0.
    still
        None: the log does not stand still.

    Returns
    -------
    Diagnosis
        Of both, as independent of each other.
    """
    if still is None:
        return found
    sure = still.effect.probability
    probability: dict[Names, float] = {}
    effects: dict[Names, tuple[EffectEstimate, ...]] = {}
    for each in found.candidates:
        with_it = each.names
        if with_it != UNKNOWN:
            with_it = tuple(sorted((*each.names, still.effect.name)))
        ways = ((each.names, 1.0 - sure, ()), (with_it, sure, (still.effect,)))
        for names, share, more in ways:
            probability[names] = probability.get(names, 0.0) + share * each.probability
            effects[names] = () if names == UNKNOWN else (*each.effects, *more)
    decision = decide(probability)
    candidates = tuple(Candidate(names, p, effects[names]) for names, p in decision.candidates)
    named = dict(decision.effects)
    if sure >= CERTAIN:  # whatever else there is, something without a name too
        named[still.effect.name] = sure
    both = (*(effect for each in reversed(candidates) for effect in each.effects), still.effect)
    sizes = {effect.name: effect for effect in both}
    return replace(
        found,
        notes=(_note(still), *found.notes),
        verdict=Verdict.NAMED if named else decision.verdict,
        effects=tuple(replace(sizes[name], probability=p) for name, p in sorted(named.items())),
        candidates=candidates,
        nothing=found.nothing * (1.0 - sure),
        best=candidates[0].effects,
        where=found.where if found.candidates[0].names else _where(still),
    )


def zeros_alone(still: StandsStill, *, why: str, no_coastdown: str) -> DiagnosisResult:
    """
    Return the result where too little is left beside the zeros.

    Parameters
    ----------
    still
    why
        Nothing more can be said.
    no_coastdown
        For the reader.
    """
    sure = still.effect.probability
    candidate = Candidate((still.effect.name,), sure, (still.effect,))
    decision = decide({candidate.names: sure, NONE: 1.0 - sure})
    return DiagnosisResult(
        verdict=decision.verdict,
        effects=(still.effect,) if decision.effects else (),
        candidates=(candidate, Candidate(NONE, 1.0 - sure)),
        nothing=1.0 - sure,
        unnamed=0.0,
        where=_where(still),
        before=Gap(still.rms_m_s, None, math.nan),
        baseline='none',
        best=(still.effect,),
        notes=(_note(still), f'nothing else between log and track was examined: {why}'),
        examined=(LOG_TRACK,),
        no_coastdown=no_coastdown,
    )


def _note(still: StandsStill) -> str:
    (size,) = still.effect.parameters.values()
    slow, fast, share = still.slowest_m_s, still.fastest_m_s, 100.0 * still.share
    return (
        f'the log reads exactly 0 in {still.stretches} stretches in which she moved over ground, '
        f'at {slow:.2f} to {fast:.2f} m/s: in {share:.0f} % of all below {size.value:.2f} m/s, '
        'and seldom above'
    )


def _where(still: StandsStill) -> Where:
    return Where('log', (0.0, still.length_s), (still.slowest_m_s, still.fastest_m_s))
