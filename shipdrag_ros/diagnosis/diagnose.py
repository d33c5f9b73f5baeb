# SPDX-License-Identifier: Apache-2.0
"""From coastdowns to the effect that is missing in the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shipdrag_ros.diagnosis.advice import advice
from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.gaps import frozen, gap_of, held_out, where
from shipdrag_ros.diagnosis.hypotheses import Library
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.result import (
    FORCE,
    LOG_TRACK,
    Advice,
    Diagnosis,
    Named,
    Verdict,
    Where,
)
from shipdrag_ros.diagnosis.search import search, with_more, with_pairs
from shipdrag_ros.diagnosis.terms import EffectTerm
from shipdrag_ros.diagnosis.traces import traces
from shipdrag_ros.diagnosis.verdict import (
    QUIET,
    Posterior,
    decide,
    exceeds_noise,
    has_residual_structure,
    outside_prior,
)
from shipdrag_ros.errors import DiagnosisError, EstimationError
from shipdrag_ros.estimation.motion_fit.coast import LOG
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship, StatedEffect, Uncertain
from shipdrag_ros.simulation.effect import Scope

_NEAR_S = 4.0  # by which a stop may be moved without seeing the run anew
_LOOKS = 3  # at a run


@dataclass(frozen=True)
class CoastRun:
    """
    A coastdown to be diagnosed.

    Attributes
    ----------
    name
        For the user.
    window
        With the steady record before it.
    """

    name: str
    window: Window


def diagnose(runs: Sequence[CoastRun], ship: Ship, parameters: Parameters) -> Diagnosis:
    """
    Name the effect that is missing in a ship's model.

    Parameters
    ----------
    runs
        One or more; effects of the earth are stated along the first one.
    ship
        With a baseline; the effects that its file states are part of the model.
    parameters
        For the noise of the sensors and the convention of the heading.

    Raises
    ------
    DiagnosisError
        If the ship has no baseline, or no run enough steady record.
    EstimationError
        If no run has enough samples.

    Notes
    -----
    A run that has too little of either is left out, and a note says so.
    """
    moved_s = {run.name: 0.0 for run in runs}
    for _ in range(_LOOKS):
        seen, notes = _observed(runs, ship, parameters, moved_s)
        found = search(Library(ship, seen, seen[0].heading_rad))
        more_s = {run.name: found.stop_moved_s(j) for j, run in enumerate(seen)}
        if all(abs(by_s) <= _NEAR_S for by_s in more_s.values()):
            break
        moved_s = {name: by_s + more_s.get(name, 0.0) for name, by_s in moved_s.items()}
    found = with_pairs(found)
    library, posterior, best = found.library, found.posterior, found.best
    never = _inseparable(library)
    alarm = posterior.nothing < QUIET and bool(best.hypothesis.names)
    predicted = held_out(library, best) if alarm else None
    lacking = alarm and (
        has_residual_structure(best, with_more(found))
        or outside_prior(best)
        or (predicted is not None and exceeds_noise(predicted.chi2_per_sample, best.best.rows))
    )
    # an instrument that errs before the stop has taught the noise what it should have shown
    log_ground_discrepancy = any(run.log_ground_discrepancy for run in seen) and not _of_the_ship(
        library, best
    )
    if lacking or log_ground_discrepancy:
        posterior = posterior.doubted()
    verdict, candidates = decide(
        posterior, lacking=lacking or log_ground_discrepancy, inseparable=never
    )
    would_decide: tuple[Advice, ...] = ()
    if verdict is Verdict.ONE_OF:
        would_decide = advice(library, posterior, candidates, inseparable=never)
    as_stated = frozen(library)
    missing = verdict in (Verdict.NAMED, Verdict.ONE_OF) and bool(best.hypothesis.names)
    explained = best if missing else found.nothing
    if verdict is Verdict.UNKNOWN:
        explained = max(found.smooth, key=lambda one: one.log_likelihood)
    return Diagnosis(
        verdict=verdict,
        effects=_named(best, posterior) if verdict is Verdict.NAMED else (),
        candidates=candidates,
        nothing=posterior.nothing,
        unnamed=posterior.unnamed,
        would_decide=would_decide,
        where=_place(
            library,
            as_stated,
            found.smooth,
            verdict,
            log_ground_discrepancy=log_ground_discrepancy,
        ),
        before=gap_of(library.problem, as_stated.best),
        after=gap_of(library.problem, best.best) if missing else None,
        held_out_before=held_out(library, None),
        held_out_after=predicted if missing else None,
        baseline='stated',
        best=_named(best, posterior),
        notes=notes,
        traces=traces(library.problem, as_stated.best, explained.best),
        coastdowns_used=len(seen),
        examined=(FORCE, LOG_TRACK) if any(map(_has_both, seen)) else (FORCE,),
    )


def _has_both(run: Observation) -> bool:
    """Tell whether a run has a log and the way over ground, to be held against each other."""
    by_log = run.along.rows.kind == LOG
    return bool(by_log.any() and not by_log.all())


def _observed(
    runs: Sequence[CoastRun], ship: Ship, parameters: Parameters, moved_s: Mapping[str, float]
) -> tuple[tuple[Observation, ...], tuple[str, ...]]:
    """
    Return the runs that can be diagnosed, and what is to be said about them.

    Parameters
    ----------
    moved_s
        By how much the stop of each run is later than it is taken for at first.
    """
    seen: list[Observation] = []
    refused: dict[str, DiagnosisError | EstimationError] = {}
    for run in runs:
        try:
            by_s = moved_s.get(run.name, 0.0)
            seen.append(
                Observation.of(run.window, ship, parameters, name=run.name, stop_moved_s=by_s)
            )
        except (DiagnosisError, EstimationError) as error:
            refused[run.name] = error
    if not seen:
        name, reason = next(iter(refused.items()))
        raise type(reason)(f'{name}: {reason}')
    notes = [f'left out: {name}: {why}' for name, why in refused.items()]
    notes += [
        f'{run.name}: log and way over ground wander apart by {run.along.water_m_s:.2f} m/s (one '
        'standard deviation) before the stop, as water seldom makes them; one of them is wrong, '
        'and as much of the coastdown as is like it passes for noise'
        for run in seen
        if run.log_ground_discrepancy
    ]
    return tuple(seen), tuple(notes)


def _of_the_ship(library: Library, best: Fit) -> bool:
    """Tell whether what is missing acts on the ship, whatever water and instruments do."""
    scopes = {effect.scope for effect in library.effects if effect.name in best.hypothesis.names}
    return bool(scopes) and scopes <= {Scope.HULL, Scope.RUN}


def _place(
    library: Library,
    as_stated: Fit,
    smooth: Sequence[Fit],
    verdict: Verdict,
    *,
    log_ground_discrepancy: bool,
) -> Where | None:
    """Return where model and data disagree."""
    if verdict is Verdict.NONE:
        return None
    if not log_ground_discrepancy:
        return where(library, as_stated, smooth)
    runs = [run for run in library.seen if run.log_ground_discrepancy]
    speeds = [run.speed_m_s for run in runs]
    lead_in_s = max(run.lead_in_s for run in runs)
    return Where('log_radar', (-lead_in_s, 0.0), (min(speeds), max(speeds)))


def with_effects(ship: Ship, effects: Sequence[Named]) -> Ship:
    """
    Return a ship with effects added to what its file states.
    """
    added = tuple(StatedEffect(effect.name, dict(effect.parameters)) for effect in effects)
    return replace(ship, effects=(*ship.effects, *added))


def _named(best: Fit, posterior: Posterior) -> tuple[Named, ...]:
    """Return the effects of a fit with their parameters."""
    probability = posterior.probability[best.hypothesis.names]
    found = []
    for part, place in best.hypothesis.parts:
        if not isinstance(part, EffectTerm) or part.stated:
            continue
        values: dict[str, Uncertain] = {}
        for i, unknown in enumerate(part.unknowns):
            z = float(best.best.z[place + i])
            sd = abs(unknown.slope(z)) * float(np.sqrt(best.covariance[place + i, place + i]))
            values[unknown.name] = Uncertain(unknown.value(z), sd)
        for name, value in part.fixed:
            values[name] = Uncertain(value, 0.0)
        ordered = {q.name: values[q.name] for q in part.effect.parameters}
        found.append(Named(part.effect.name, probability, ordered))
    return tuple(sorted(found, key=lambda effect: effect.name))


def _inseparable(library: Library) -> list[frozenset[str]]:
    """Return look-alikes that no record of a coastdown tells apart."""
    return [
        frozenset((one.name, other))
        for one in library.effects
        for other, measures in one.confounders.items()
        if not measures
    ]
