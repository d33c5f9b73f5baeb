# SPDX-License-Identifier: Apache-2.0
"""From coastdowns to the effect that is missing in the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

from shipdrag_ros.diagnosis.advice import advice
from shipdrag_ros.diagnosis.carried import carried
from shipdrag_ros.diagnosis.coast import CoastModel
from shipdrag_ros.diagnosis.differing import runs_differ, with_differing
from shipdrag_ros.diagnosis.earlier import EarlierDiagnosis
from shipdrag_ros.diagnosis.facts import Facts, stated_facts
from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.gaps import frozen, gap_of, held_out, traces, where
from shipdrag_ros.diagnosis.limits import limits_of
from shipdrag_ros.diagnosis.nameless import with_nameless
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.one import diagnose_one
from shipdrag_ros.diagnosis.result import (
    FORCE,
    LOG_TRACK,
    Advice,
    DiagnosisResult,
    EffectEstimate,
    Where,
)
from shipdrag_ros.diagnosis.search import SearchResult, search, with_pairs, with_unnamed
from shipdrag_ros.diagnosis.seen_runs import SeenRun
from shipdrag_ros.diagnosis.speeds import CoastRun
from shipdrag_ros.diagnosis.swinging import swing_notes, with_swinging
from shipdrag_ros.diagnosis.units import asked, ratio_before_the_stop, waiting
from shipdrag_ros.diagnosis.verdict import Judgement, judge
from shipdrag_ros.errors import DiagnosisError, EstimationError
from shipdrag_ros.inference.decision import UNKNOWN, Verdict
from shipdrag_ros.inference.rows import LOG
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.progress import Progress, silent
from shipdrag_ros.ship import Fact, Ship, StatedEffect

_NEAR_S = 4.0  # by which a stop may be moved without seeing the run anew
_LOOKS = 3  # at a run


def diagnose(
    runs: Sequence[CoastRun],
    ship: Ship,
    parameters: Parameters,
    *,
    facts: Sequence[Fact] = (),
    earlier: Sequence[EarlierDiagnosis] = (),
    advise: bool = True,
    progress: Progress = silent,
    engine: Literal['fits', 'one'] = 'fits',
) -> DiagnosisResult:
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
    facts
        That a log book knows of all runs, whatever the ship file and the runs say.
    earlier
        Diagnoses of runs of before; what they found of hull and instruments counts.
    advise
        Whether to work out what would decide, which takes as long as all the rest.
    progress
        Called with each stage, how much of it is done, and of how much.
    engine
        'one': the posterior of docs/model.md, without advice, traces and earlier diagnoses.

    Returns
    -------
    Diagnosis
        Of baseline 'stated'.

    Raises
    ------
    DiagnosisError
        If the ship has no baseline, or no run enough steady record, or an earlier
        diagnosis is of another ship, of later runs or of one of these.
    EstimationError
        If no run has enough samples.

    Notes
    -----
    Source: Bayesian comparison of models by their evidence, MacKay (2003), *Information Theory,
    Inference, and Learning Algorithms*, chapter 28.

    A run that has too little of either is left out, and a note says so.

    Examples
    --------
    >>> from importlib import resources
    >>> from shipdrag_ros.ship import Ship
    >>> ship = Ship.load(resources.files('shipdrag_ros') / 'data' / 'vitus_bering.yaml')
    >>> from shipdrag_ros.diagnosis import CoastRun, diagnose
    >>> from shipdrag_ros.estimation import Window
    >>> from shipdrag_ros.parameters import Parameters
    >>> from shipdrag_ros.parameter import Parameter
    >>> from shipdrag_ros.ship import StatedEffect
    >>> from shipdrag_ros.simulation import START_NS, Scenario, sense, simulate, standard_sensors
    >>> scenario = Scenario(speed_m_s=6.0, duration_s=900.0)
    >>> scale = StatedEffect('log_scale', {'factor': Parameter(0.1, 0.0)})
    >>> truth = simulate(ship, scenario, effects=[scale])
    >>> block = sense(truth, standard_sensors(), seed=1)
    >>> stop_ns = START_NS + round(scenario.lead_in_s * 1e9)
    >>> end_ns = START_NS + round(scenario.length_s * 1e9)
    >>> window = Window.from_block(block, stop_ns, end_ns, before_ns=START_NS)
    >>> diagnosis = diagnose([CoastRun('first', window)], ship, Parameters())
    >>> [effect.name for effect in diagnosis.effects]
    ['log_scale']
    """
    still = {run.name: 0.0 for run in runs}
    seen, notes = _observed(runs, ship, parameters, still, progress)
    questions = [
        f'{run.name}: {ask}' for run in seen if (ask := asked(ratio_before_the_stop(run)))
    ]
    if questions:
        return waiting(
            '; '.join(questions),
            baseline='stated',
            notes=notes,
            coastdowns_used=len(seen),
            runs=_seen_runs(seen),
        )
    if engine == 'one':
        if earlier:
            notes = (*notes, 'earlier diagnoses do not count in the one posterior yet')
        return _by_one((seen, notes), runs, ship, parameters, facts, progress)
    model, found, stated, notes = _searched(
        (seen, notes), runs, ship, parameters, facts, earlier, progress
    )
    seen = model.seen
    best, judged = found.best, judge(found)
    would_decide: tuple[Advice, ...] = ()
    if advise and judged.verdict is Verdict.ONE_OF:
        would_decide = advice(model, judged.posterior, judged.candidates, progress)
    as_stated = frozen(model)
    explained = best if judged.missing else found.nothing
    if judged.verdict is Verdict.UNKNOWN:
        explained = found.posterior.best[UNKNOWN]
        notes = (*notes, *swing_notes(explained, model))
    differ = runs_differ(found) if judged.missing else ()
    return judged.diagnosis(
        would_decide=would_decide,
        where=_where(model, as_stated, found, judged, differ=bool(differ)),
        before=gap_of(model, as_stated.best),
        after=gap_of(model, best.best) if judged.missing else None,
        held_out_before=held_out(model, None),
        held_out_after=held_out(model, best) if judged.missing else None,
        baseline='stated',
        notes=notes,
        traces=traces(model, as_stated.best, explained.best),
        coastdowns_used=len(seen),
        examined=(FORCE, LOG_TRACK) if any(map(_has_both, seen)) else (FORCE,),
        facts=stated.weighed(judged.posterior, [run.name for run in seen]),
        runs_differ=differ,
        runs=_seen_runs(seen),
        earlier=() if model.earlier is None else model.earlier.judged(judged.posterior),
        limits=limits_of(found, model, [effect.name for effect in judged.effects]),
    )


def _where(
    model: CoastModel, as_stated: Fit, found: SearchResult, judged: Judgement, *, differ: bool
) -> Where | None:
    """Say where model and data are apart."""
    if judged.verdict is Verdict.NONE:
        return None
    place = where(model, as_stated, found.smooth)
    if differ and place is not None:  # an error alike in all runs would pass for the log's
        return replace(place, channel=FORCE)
    return place


def _searched(
    first: tuple[tuple[Observation, ...], tuple[str, ...]],
    runs: Sequence[CoastRun],
    ship: Ship,
    parameters: Parameters,
    facts: Sequence[Fact],
    earlier: Sequence[EarlierDiagnosis],
    progress: Progress,
) -> tuple[CoastModel, SearchResult, Facts, tuple[str, ...]]:
    """Search, and see the runs anew where that moves their stops; notes on them besides."""
    moved_s = {run.name: 0.0 for run in runs}
    for _ in range(_LOOKS):
        seen, notes = (
            _observed(runs, ship, parameters, moved_s, progress)
            if any(moved_s.values())
            else first
        )
        stated = _stated(runs, seen, ship, facts)
        before = carried(earlier, ship, _seen_runs(seen), stated)
        model = CoastModel(ship, seen, seen[0].heading_rad, stated, before)
        found = search(model, progress=progress)
        more_s = {run.name: model.stop_moved_s(found.best, j) for j, run in enumerate(seen)}
        if all(abs(by_s) <= _NEAR_S for by_s in more_s.values()):
            break
        moved_s = {name: by_s + more_s.get(name, 0.0) for name, by_s in moved_s.items()}
    found = with_swinging(found, model)
    found = with_pairs(with_differing(found, model), progress=progress)
    found = with_nameless(found, model)
    return model, with_unnamed(found), stated, notes


def _by_one(
    first: tuple[tuple[Observation, ...], tuple[str, ...]],
    runs: Sequence[CoastRun],
    ship: Ship,
    parameters: Parameters,
    facts: Sequence[Fact],
    progress: Progress,
) -> DiagnosisResult:
    """Diagnose by the one posterior, which observes the runs again where it moves their stops."""

    def observe(
        moved_s: Mapping[str, float],
    ) -> tuple[tuple[Observation, ...], tuple[str, ...]]:
        if not any(moved_s.values()):
            return first
        return _observed(runs, ship, parameters, moved_s, progress)

    answer = diagnose_one(observe, ship, lambda these: _stated(runs, these, ship, facts))
    return replace(answer, runs=_seen_runs(first[0]))


def _stated(
    runs: Sequence[CoastRun], seen: Sequence[Observation], ship: Ship, facts: Sequence[Fact]
) -> Facts:
    """Gather what is stated of the runs that are diagnosed."""
    own = {run.name: run.facts for run in runs}
    return stated_facts(ship, [(own[run.name], run.time_ns) for run in _seen_runs(seen)], facts)


def _seen_runs(seen: Sequence[Observation]) -> tuple[SeenRun, ...]:
    """Return names and stops of the runs that are diagnosed."""
    stops = [run.context.stop for run in seen]
    at_ns = [stop.since_ns + round(stop.lead_in_s * 1e9) for stop in stops]
    return tuple(SeenRun(run.name, ns) for run, ns in zip(seen, at_ns))


def _has_both(run: Observation) -> bool:
    """Say whether a run has a log and the way over ground, to be held against each other."""
    by_log = run.along.rows.kind == LOG
    return bool(by_log.any() and not by_log.all())


def _observed(
    runs: Sequence[CoastRun],
    ship: Ship,
    parameters: Parameters,
    moved_s: Mapping[str, float],
    progress: Progress,
) -> tuple[tuple[Observation, ...], tuple[str, ...]]:
    """
    Return the runs that can be diagnosed, and what is to be said about them.

    Parameters
    ----------
    moved_s
        By how much the stop of each run is later than it is taken for at first.
    progress
        Called with how many runs are seen.
    """
    seen: list[Observation] = []
    refused: dict[str, DiagnosisError | EstimationError] = {}
    for done, run in enumerate(runs):
        progress('learning the noise before the stop, of each run', done, len(runs))
        try:
            by_s = moved_s.get(run.name, 0.0)
            seen.append(
                Observation.of(
                    run.window, run.ship or ship, parameters, name=run.name, stop_moved_s=by_s
                )
            )
        except (DiagnosisError, EstimationError) as error:
            refused[run.name] = error
    if not seen:
        name, reason = next(iter(refused.items()))
        raise type(reason)(f'{name}: {reason}')
    notes = [f'left out: {name}: {why}' for name, why in refused.items()]
    notes += [
        f'{run.name}: the shaft ran down in {run.context.stop.shaft_s:.2g} s, where the ship file '
        f'says {ship.propulsion.run_down_s:.2g} ± {2.0 * ship.propulsion.sd:.2g} s'
        for run in seen
        if ship.propulsion is not None and run.context.stop.shaft_s > 0.0
    ]
    notes += [
        f'{run.name}: log and way over ground wander apart by {run.along.water_m_s:.2f} m/s (one '
        'standard deviation) before the stop, as water seldom makes them; one of them is wrong, '
        'and as much of the coastdown as is like it passes for noise'
        for run in seen
        if run.log_ground_discrepancy
    ]
    return tuple(seen), tuple(notes)


def with_effects(ship: Ship, effects: Sequence[EffectEstimate]) -> Ship:
    """
    Return a ship with effects added to what its file states.

    Parameters
    ----------
    ship
        As its file states it.
    effects
        That a diagnosis named.

    Returns
    -------
    Ship
        The same with the effects in `effects`.
    """
    added = tuple(StatedEffect(effect.name, dict(effect.parameters)) for effect in effects)
    return replace(ship, effects=(*ship.effects, *added))
