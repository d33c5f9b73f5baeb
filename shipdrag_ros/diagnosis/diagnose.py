# SPDX-License-Identifier: Apache-2.0
"""
From coastdowns to the effect that is missing in the model.

Answers about one ship are joined, and wait where a unit is asked about.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from shipdrag_ros.diagnosis.advice import DiagnosedRuns, advice
from shipdrag_ros.diagnosis.document import EarlierDiagnosis
from shipdrag_ros.diagnosis.known import Carried, Facts, carried, stated_facts
from shipdrag_ros.diagnosis.observation import CoastRun, Observation, ship_runs
from shipdrag_ros.diagnosis.result import (
    FORCE,
    LOG_TRACK,
    Compared,
    DiagnosisResult,
    EffectEstimate,
    Gap,
    RunTrace,
    SeenRun,
)
from shipdrag_ros.diagnosis.verdict import (
    ComparedRuns,
    gap_of,
    held_out,
    judge,
    limits_of,
    runs_differ,
    where,
)
from shipdrag_ros.diagnosis.words import listed, names_text, of_the_earth, probability, sentence
from shipdrag_ros.display import mistaken_units, ship_speed
from shipdrag_ros.errors import (
    DiagnosisError,
    EarlierError,
    EstimationError,
    ShipdragError,
    SimulationError,
)
from shipdrag_ros.inference.decision import CERTAIN, NONE, UNKNOWN, Verdict, smallest_set
from shipdrag_ros.inference.rows import CODES, LOG, OVER_GROUND, POSITION
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.compare import Comparing, Fitted, RunResidual
from shipdrag_ros.posterior.hypotheses import Explanation
from shipdrag_ros.posterior.law import usual_baseline
from shipdrag_ros.progress import Progress, silent
from shipdrag_ros.ship import Fact, Ship, StatedEffect
from shipdrag_ros.ship.facts import UNITS_CHECKED
from shipdrag_ros.simulation.effect import Effect, Scope
from shipdrag_ros.simulation.effects import carrying, effects_of, terms

_APART_M_S = 0.15  # slowly: six times what is usual of water


def diagnose(
    runs: Sequence[CoastRun],
    ship: Ship,
    parameters: Parameters,
    *,
    facts: Sequence[Fact] = (),
    earlier: Sequence[EarlierDiagnosis] = (),
    advise: bool = True,
    progress: Progress = silent,
) -> DiagnosisResult:
    """
    Name the effect that is missing in a ship's model.

    Parameters
    ----------
    runs
        One or more; effects of the earth are stated along the first one.
    ship
        Its baseline, or a wide one in its place; the effects that its file states are part
        of the model.
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

    Returns
    -------
    DiagnosisResult
        Of baseline 'stated', or 'fitted_here' where the ship file has none.

    Raises
    ------
    DiagnosisError
        If no run has enough steady record, or an earlier diagnosis is of another ship,
        of later runs or of one of these.
    EstimationError
        If no run has enough samples.

    Notes
    -----
    Source: docs/model.md; Bayesian comparison of models by their evidence, MacKay (2003),
    *Information Theory, Inference, and Learning Algorithms*, chapter 28.

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
    baseline = 'fitted_here' if ship.baseline is None else 'stated'
    known = usual_baseline(ship) if ship.baseline is None else ship
    seen, notes = observed(runs, ship, parameters, progress=progress)
    stated = stated_in(runs, seen, ship, facts)
    checked = {each.run for each in stated.stated if each.fact.name == UNITS_CHECKED}
    questions = [
        f'{run.name}: {ask}'
        for j, run in enumerate(seen)
        if not checked & {None, j}
        and (ask := asked(ratio_before_the_stop(run)) or asked_of_speed(run.speed_m_s, known))
    ]
    before = carried(
        earlier, ship, _seen_runs(seen), stated, [e.name for e in effects_about(seen)]
    )
    progress('comparing hypotheses', 0, 0)
    try:
        comparing = compare(seen, ship, stated, before)
        case = DiagnosedRuns(seen, comparing, comparing.compare(), ship, stated, before)
        notes = (*notes, *of_one_day(case))
        found = _answer(case, notes, baseline, progress, advise=advise and not questions)
    except (DiagnosisError, SimulationError) as error:
        if not questions:
            beyond = (asked_of_speed(run.speed_m_s, known, checked=True) for run in seen)
            named = [f'{run.name}: {why}' for run, why in zip(seen, beyond, strict=True) if why]
            raise DiagnosisError('; '.join(named) or str(error)) from error
        found = DiagnosisResult(  # no hypothesis can be compared with these runs
            verdict=Verdict.ONE_OF,
            before=Gap(None, None, math.nan),
            baseline=baseline,
            notes=(*notes, f'if the unit is right: {error}'),
            coastdowns_used=len(seen),
            runs=_seen_runs(seen),
        )
    return waiting(found, '; '.join(questions))


def _answer(
    case: DiagnosedRuns, notes: tuple[str, ...], baseline: str, progress: Progress, *, advise: bool
) -> DiagnosisResult:
    """Judge what was compared."""
    stated = case.ship.baseline is not None
    seen, comparing, found = case.seen, case.comparing, case.found
    judged = judge(found, case.inseparable)
    verdict = judged.decision.verdict
    advise = advise and verdict is Verdict.ONE_OF
    names = [run.name for run in seen]
    before, best = comparing.as_stated if stated else found.best[NONE], found.best[judged.top]
    differ = runs_differ(best, names) if judged.missing else ()
    answer = [held for held, _ in smallest_set(found.probability, CERTAIN)]
    agree = NONE in answer and verdict in (Verdict.NONE, Verdict.ONE_OF)
    unknown = verdict is Verdict.UNKNOWN or UNKNOWN in answer
    return judged.result(
        would_decide=advice(case, judged.candidates, progress) if advise else (),
        where=None
        if agree
        else where(
            case,
            before,
            judged.explained,
            judged.decision.effects or ({} if unknown else set(chain(*answer))),
            of_force=bool(differ),
        ),
        before=gap_of(seen, comparing.residuals(before)),
        after=gap_of(seen, comparing.residuals(best)) if judged.missing else None,
        held_out_before=held_out(seen, comparing, before),
        held_out_after=held_out(seen, comparing, best) if judged.missing else None,
        baseline=baseline,
        notes=(*notes, *_besides(case, judged.decision.effects, stated=stated)),
        traces=traces(case, before, judged.explained),
        coastdowns_used=len(seen),
        examined=(FORCE, LOG_TRACK) if any(map(_has_both, seen)) else (FORCE,),
        facts=case.facts.weighed(found, names),
        runs_differ=differ,
        runs=_seen_runs(seen),
        earlier=case.earlier.judged(found),
        limits=limits_of(judged, comparing, case.inseparable),
    )


def _besides(case: DiagnosedRuns, named: Collection[str], *, stated: bool) -> Iterator[str]:
    """Say what is not sound, and what cannot be seen."""
    for j, run in enumerate(case.seen):
        water_m_s = case.comparing.water_m_s(j)
        if not named and _has_both(run) and water_m_s > _APART_M_S:
            yield (
                f'{run.name}: log and way over ground wander apart by {water_m_s:.2f} m/s (one '
                'standard deviation), as water seldom makes them; one of them is wrong, and as '
                'much of the coastdown as is like it passes for noise'
            )
    ruled_out = [each for each in effects_of(case.seen[0].ship).values() if not each.in_geodetic]
    if ruled_out and _geodetic(case.seen):
        yield of_the_earth(ruled_out)
    unseen: dict[tuple[str, ...], list[str]] = {}
    for effect in effects_of(case.ship).values():
        unseen.setdefault(effect.missing(case.ship), []).append(names_text([effect.name]))
    for keys, effects in unseen.items():
        if keys:
            wanted = ' and '.join(f'`{key}`' for key in keys)
            yield f'not examined without {wanted} in the ship file: {", ".join(effects)}'
    if not stated:
        yield (
            'the ship file has no baseline: the runs are compared with all hulls of her length '
            'and volume; what looks like fouling, a propeller or a cable may be the hull'
        )


def of_one_day(case: ComparedRuns) -> Iterator[str]:
    """Say which effects of the ship file are of the water and air of one day, and taken as so."""
    earth = [way.effect for way in case.comparing.stated if way.effect.scope is Scope.EARTH]
    if earth:
        yield (
            f'the ship file states {names_text([effect.name for effect in earth])}, which is of '
            f'the water and air of one day: it is taken for these runs, along the heading of '
            f'{case.seen[0].name}; take it out of the file for runs of another day'
        )


def compare(
    seen: Sequence[Observation], ship: Ship, facts: Facts, earlier: Carried | None = None
) -> Comparing:
    """
    Return the comparison of all hypotheses about some runs of a ship.

    Parameters
    ----------
    seen
    ship
    facts
        That are stated.
    earlier
        What earlier diagnoses say of the runs.
    """
    before = Carried(ship, 0, ()) if earlier is None else earlier
    effects = effects_about(seen)

    def log_known(hypothesis: Explanation) -> float:
        return facts.log_likelihood(hypothesis) + before.log_weight(hypothesis)

    kept = before.ways(effects)
    return Comparing(ship_runs(seen, ship), ship, effects, log_known, kept, effects)


def effects_about(seen: Sequence[Observation]) -> list[Effect]:
    """Return the effects that her ship file and the instruments of her runs can show."""
    ship, read = seen[0].ship, {name for run in seen for name in run.inputs}
    geodetic = _geodetic(seen)
    return [
        effect
        for effect in effects_of(ship).values()
        if not effect.missing(ship)
        and (not effect.errs_in or read.intersection(effect.errs_in))
        and (effect.in_geodetic or not geodetic)
    ]


def _geodetic(seen: Sequence[Observation]) -> bool:
    return all(run.geodetic for run in seen)


def stated_in(
    runs: Sequence[CoastRun], seen: Sequence[Observation], ship: Ship, facts: Sequence[Fact] = ()
) -> Facts:
    """Gather what is stated of the runs that are diagnosed."""
    own = {run.name: run.facts for run in runs}
    return stated_facts(ship, [(own[run.name], run.stopped_ns) for run in seen], facts)


def _seen_runs(seen: Sequence[Observation]) -> tuple[SeenRun, ...]:
    """Return names and stops of the runs that are diagnosed."""
    return tuple(SeenRun(run.name, run.stopped_ns) for run in seen)


def _has_both(run: Observation) -> bool:
    """Say whether a run has a log and the way over ground, to be held against each other."""
    by_log = run.rows.kind == LOG
    return bool(by_log.any() and not by_log.all())


def observed(
    runs: Sequence[CoastRun], ship: Ship, parameters: Parameters, progress: Progress
) -> tuple[tuple[Observation, ...], tuple[str, ...]]:
    """
    Return the runs that can be diagnosed, and what is to be said about them.

    Parameters
    ----------
    progress
        Called with how many runs are seen.
    """
    seen: list[Observation] = []
    refused: dict[str, DiagnosisError | EstimationError] = {}
    notes: list[str] = []
    for done, run in enumerate(runs):
        progress('learning the noise before the stop, of each run', done, len(runs))
        window = run.window.one_of_each()
        notes += [f'{run.name}: {note}' for note in window.notes[len(run.window.notes) :]]
        try:
            own = usual_baseline(run.ship or ship)
            seen.append(Observation.of(window, own, parameters, name=run.name))
        except (DiagnosisError, EstimationError) as error:
            refused[run.name] = error
    if not seen:
        name, reason = next(iter(refused.items()))
        raise type(reason)(f'{name}: {reason}')
    notes += [f'{run.name}: {note}' for run in seen for note in run.notes]
    notes += [f'left out: {name}: {why}' for name, why in refused.items()]
    notes += [
        f'{run.name}: the shaft ran down in {run.context.stop.shaft_s:.2g} s, where the ship file '
        f'says {ship.propulsion.run_down_s:.2g} ± {2.0 * ship.propulsion.sd:.2g} s'
        for run in seen
        if ship.propulsion is not None and run.context.stop.shaft_s > 0.0
    ]
    low_m_s = 0.0 if ship.baseline is None else ship.baseline_range_m_s[0]
    notes += [
        f'{run.name}: below {low_m_s:.3g} m/s ({ship_speed(low_m_s, ship.mass_kg)}) the ship file '
        'states no resistance; there it is taken to go with the square of the speed'
        for run in seen
        if (run.rows.value[run.rows.kind != POSITION] < low_m_s).any()
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
        The same with the effects in `effects`, and with each learnt term among them.
    """
    added = tuple(StatedEffect(effect.name, dict(effect.parameters)) for effect in effects)
    ship = carrying(ship, terms([effect.name for effect in effects]))
    return replace(ship, effects=(*ship.effects, *added))


_AGAIN = 'Import it again with its unit, as in --map speed_through_water=COLUMN:kn'


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
        f'one of them wrong? {_AGAIN}; if it is right, say so with --fact {UNITS_CHECKED}'
    )


def asked_of_speed(speed_m_s: float, ship: Ship, *, checked: bool = False) -> str:
    """
    Ask about the unit of a speed that no resistance is known for; else return ''.

    Parameters
    ----------
    speed_m_s
        Before the stop, as it was read.
    ship
        With a baseline.
    checked
        Whether the unit is known to be right: no question, but what to do.
    """
    low, high = ship.baseline_range_m_s
    if low <= speed_m_s <= high:
        return ''
    read, least, most = (ship_speed(each, ship.mass_kg) for each in (speed_m_s, low, high))
    return (
        f'the speed before the stop was read as {speed_m_s:.3g} m/s ({read}), and resistance is '
        f'known for {low:.3g} to {high:.3g} m/s ({least.partition(" ")[0]} to {most})'
        f'{"; " if checked else f": is the unit wrong? {_AGAIN}; if it is right, "}'
        'state a `baseline` that holds this speed'
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
    rows = seen.rows
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


Diagnose = Callable[[], DiagnosisResult]
_HELD = 'all of each glide is compared with the model, such parts with the rest'
_APART = 'what is named rests on the coastdowns alone, and need not explain such parts'
_SOUND_PART = (
    'So it is not known whether anything is missing; give the sound part alone with '
    '--window START END'
)


def with_whole_glides(
    alone: Diagnose, whole: Diagnose | None, notes: Sequence[str], *, coastdowns: int
) -> DiagnosisResult:
    """
    Diagnose with the parts that are no coastdown.

    Parameters
    ----------
    alone
        Diagnoses the coastdowns, or log and track where there is none.
    whole
        Diagnoses the glides with such parts; None where there are none that can be followed.
    notes
        What these parts are, a sentence each.
    coastdowns
        How many there are.

    Returns
    -------
    DiagnosisResult
        Of the whole; of the coastdowns where the whole cannot be followed, or has no name though
        they have one.

    Raises
    ------
    DiagnosisError
        If nothing can be diagnosed, or the whole cannot be and the rest shows nothing: what is
        cut is no sign of nothing. If an earlier diagnosis cannot count.
    EstimationError
        If there is no such part, and no run has enough samples.
    """
    if whole is None:
        return _noting(alone(), *notes)
    held, why = None, ''
    try:
        held = replace(whole(), coastdowns_used=coastdowns)
    except EarlierError:  # it counts for no part of a glide either
        raise
    except ShipdragError as error:  # a glide that is like none may not be followed
        why = f'all of each glide could not be held against the model: {error}'
    if held and not (held.verdict is Verdict.UNKNOWN and coastdowns):
        return _noting(held, *notes, _HELD)
    try:
        found = alone()
    except EarlierError:
        raise
    except (DiagnosisError, EstimationError) as error:
        said = f'the coastdowns alone could not be diagnosed: {error}'
        if held:
            return _noting(held, *notes, _HELD, said)
        raise DiagnosisError(f'{"; ".join((*notes, said, why))}. {_SOUND_PART}') from error
    if held:
        named = found.verdict is Verdict.NAMED
        return _noting(found, *notes, _APART) if named else _noting(held, *notes, _HELD)
    if found.candidates[0].names == NONE:  # what is cut from them is no sign of nothing
        raise DiagnosisError(f'{"; ".join((*notes, why))}. {_SOUND_PART}')
    return _noting(found, *notes, why)


def _noting(found: DiagnosisResult, *notes: str) -> DiagnosisResult:
    return replace(found, notes=(*found.notes, *notes))


def with_log_track(force: DiagnosisResult, log_track: DiagnosisResult) -> DiagnosisResult:
    """
    Join what coastdowns show of the force with what log and track show.

    Parameters
    ----------
    force
        Of coastdowns without a stated baseline.
    log_track
        Of the same records.

    Returns
    -------
    Diagnosis
        Where log and track disagree, that is the answer, and a note says what the force
        shows besides: what turns the log wrong, or moves the water, leaves a force
        behind that is none.
    """
    examined = tuple(dict.fromkeys((*force.examined, *log_track.examined)))
    if log_track.verdict is Verdict.NONE:
        agree = (
            'log and track agree: nothing is wrong between them that these records could show '
            f'(probability {probability(log_track.nothing)})'
        )
        return replace(_noting(force, agree, *log_track.notes), examined=examined)
    besides = () if force.verdict is Verdict.NONE else (_force_besides(force),)
    named = {effect.name for effect in log_track.effects}
    return replace(
        log_track,
        limits={name: each for name, each in force.limits.items() if name not in named},
        notes=(*besides, *log_track.notes, *force.notes),
        would_decide=log_track.would_decide or force.would_decide,
        baseline=force.baseline,
        coastdowns_used=force.coastdowns_used,
        no_coastdown='',
        examined=examined,
        traces=force.traces,
        facts=force.facts,
    )


def _force_besides(force: DiagnosisResult) -> str:
    """Say what the force shows besides."""
    if force.verdict is Verdict.UNKNOWN:
        return f'in the force besides: {sentence(force)}'
    likely = listed([each for each in force.candidates if each.names])
    return f'in the force besides, compared with all hulls of her length and volume: {likely}'


def traces(case: ComparedRuns, before: Fitted, after: Fitted) -> tuple[RunTrace, ...]:
    """
    Return each run as it was measured and as two hypotheses have it.

    Parameters
    ----------
    case
    before, after
    """
    left = zip(case.comparing.residuals(before), case.comparing.residuals(after), strict=True)
    return tuple(
        RunTrace(run.name, run.lead_in_s, tuple(_compared(run, case.comparing, j, *both, after)))
        for j, (run, both) in enumerate(zip(case.seen, left, strict=True))
    )


def _compared(
    run: Observation,
    comparing: Comparing,
    j: int,
    before: RunResidual,
    after: RunResidual,
    fit: Fitted,
) -> list[Compared]:
    """Return each quantity that was measured in a run."""
    table, rows = fit.linear[j], run.rows
    sd = comparing.noise_sd(j, table)
    n = len(rows.time_s)
    found = [
        Compared(
            quantity,
            rows.time_s[own] - run.lead_in_s,
            table.speed_m_s[own],
            rows.value[own],
            rows.value[own] - before.along[own],
            rows.value[own] - after.along[own],
            sd[own],
            before.whitened[:n][own],
            after.whitened[:n][own],
        )
        for quantity, code in CODES.items()
        if (own := rows.kind == code).any()
    ]
    port_s, a = run.context.port_s, len(run.context.port_s)
    if a:
        noise, places = np.linalg.inv(run.context.whitener[:a, :a]), run.context.value[:a]
        found.append(
            Compared(
                'position_across',
                port_s - run.lead_in_s,
                np.interp(port_s, rows.time_s, table.speed_m_s),
                places,
                places - before.rest[:a],
                places - after.rest[:a],
                np.sqrt(np.sum(noise**2, axis=1)),
                before.whitened[n : n + a],
                after.whitened[n : n + a],
            )
        )
    return found
