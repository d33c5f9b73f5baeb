# SPDX-License-Identifier: Apache-2.0
"""
From compared hypotheses to what is answered: sizes, limits, how runs differ, answers joined.

Whether that is `named`, `one_of`, `unknown` or `none` is decided by `inference.decision.decide`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic

import numpy as np
from scipy.special import logsumexp

from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.result import (
    Candidate,
    DiagnosisResult,
    EffectEstimate,
    Limit,
    RunSize,
)
from shipdrag_ros.diagnosis.words import listed, probability, sentence
from shipdrag_ros.display import mistaken_units, ship_speed
from shipdrag_ros.errors import DiagnosisError, EarlierError, EstimationError, ShipdragError
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
from shipdrag_ros.inference.limits import (
    LineNumbers,
    Rival,
    chances_of_names,
    named_from,
    quantile,
)
from shipdrag_ros.inference.rows import LOG, OVER_GROUND, POSITION
from shipdrag_ros.parameter import Parameter, Shape
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.compare import ComparedHypotheses, Comparing, Fit, Fitted, WeighedFit
from shipdrag_ros.posterior.effects import EffectWay
from shipdrag_ros.posterior.hypotheses import IN_SPEED, Explanation
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.facts import UNITS_CHECKED
from shipdrag_ros.simulation.columns import RUN_DOWNS

_SHARE = 0.95  # of a size, below its limit
_AGAIN = 'Import it again with its unit, as in --map speed_through_water=COLUMN:kn'
_RIVALS = 40  # likeliest effects of which it is found from what size on they are named


@dataclass(frozen=True)
class ComparedRuns:
    """Runs with hypotheses about them compared."""

    seen: tuple[Observation, ...]
    comparing: Comparing
    found: ComparedHypotheses[Fitted]
    ship: Ship


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

    def result(self, **rest: Any) -> DiagnosisResult:
        """Return what is answered, with what else there is to be said."""
        probability = self.found.probability
        return DiagnosisResult(
            verdict=self.decision.verdict,
            effects=self.effects,
            candidates=self.candidates,
            nothing=probability.get(NONE, 0.0),
            unnamed=probability.get(UNKNOWN, 0.0),
            best=sized(self.found.best[self.top], probability[self.top]),
            **rest,
        )


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
    found = []
    assert fit.z is not None
    assert fit.sd is not None
    for way, own in fit.hypothesis.placed:
        values = {name: Parameter(value, 0.0) for name, value in way.fixed}
        for q, z, sd in zip(way.unknowns, fit.z[own].tolist(), fit.sd[own].tolist()):
            values[q.name] = Parameter(q.prior.at(z), abs(q.prior.slope(z)) * sd)
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
        f'one of them wrong? {_AGAIN}; if it is right, say so with --fact {UNITS_CHECKED}'
    )


def asked_of_speed(speed_m_s: float, ship: Ship) -> str:
    """
    Ask about the unit of a speed that no resistance is known for; else return ''.

    Parameters
    ----------
    speed_m_s
        Before the stop, as it was read.
    ship
        With a baseline.
    """
    low, high = ship.baseline_range_m_s
    if low <= speed_m_s <= high:
        return ''
    read, least, most = (ship_speed(each, ship.mass_kg) for each in (speed_m_s, low, high))
    return (
        f'the speed before the stop was read as {speed_m_s:.3g} m/s ({read}), and resistance is '
        f'known for {low:.3g} to {high:.3g} m/s ({least.partition(" ")[0]} to {most}): is the '
        f'unit wrong? {_AGAIN}; if it is right, state a `baseline` that holds this speed'
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
    besides = () if force.verdict is Verdict.NONE else (_besides(force),)
    return replace(
        log_track,
        notes=(*besides, *log_track.notes, *force.notes),
        would_decide=log_track.would_decide or force.would_decide,
        baseline=force.baseline,
        coastdowns_used=force.coastdowns_used,
        no_coastdown='',
        examined=examined,
        traces=force.traces,
        facts=force.facts,
    )


def _besides(force: DiagnosisResult) -> str:
    """Say what the force shows besides."""
    if force.verdict is Verdict.UNKNOWN:
        return f'in the force besides: {sentence(force)}'
    likely = listed([each for each in force.candidates if each.names])
    return f'in the force besides, compared with all hulls of her length and volume: {likely}'


_LITTLE = 1e-6  # of a trace: as good as none of the effect
_CELL = 0.5  # in z: Gaussians that far apart, and of that sd, whose sum is a prior
_POINTS = np.arange(-3.25, 3.3, _CELL)
_FEWEST = 5  # rows of a curve


class _Lines:
    """Lines of each run, (k, n + q), and where they are."""

    def __init__(self, comparing: Comparing) -> None:
        self.comparing, self.count = comparing, 0
        self.runs: list[list[Float64]] = [[] for _ in comparing.runs.runs]

    def add(self, lines: Sequence[Float64]) -> LineNumbers:
        """Keep lines of each run; return their places."""
        for kept, each in zip(self.runs, lines, strict=True):
            kept.append(each)
        first, self.count = self.count, self.count + len(lines[0])
        return np.arange(first, self.count)

    def information(self) -> Float64:
        """Return the products of all, less what the nuisances take up."""
        lines = [np.concatenate(each) for each in self.runs]
        return self.comparing.given_way(self.comparing.nothing, lines)[1]

    def left_open(self, hypothesis: Explanation) -> LineNumbers:
        """Keep what a hypothesis leaves open, but the size that is tried; standard normal."""
        comparing, runs = self.comparing, self.comparing.runs
        at = comparing.widened(comparing.nothing, hypothesis)
        first = comparing.first
        if not hypothesis.smooth:
            tried = hypothesis.ways[-1].tried()
            at[first : first + len(tried)] = tried
            first += 1
        found = []
        for table in runs.linearise([hypothesis], [at])[0] or ():
            own = np.zeros((len(at) - first, len(table.along[0]) + len(table.rest[0])))
            here = table.place >= first
            own[table.place[here] - first] = np.hstack([table.along, table.rest])[1:][here]
            found.append(own)
        return self.add(found) if found else np.arange(0)


def sizes_named(
    comparing: Comparing, names: Sequence[str], never: Collection[str]
) -> dict[str, float]:
    """
    Return the size from which each effect is named; without those that never are.

    Parameters
    ----------
    comparing
        After the comparison.
    names
        Of the effects, which are each other's rivals: time and memory go with their square.
    never
        Effects that no record separates.
    """
    lines = _Lines(comparing)
    (nothing,) = lines.add(
        [np.zeros((1, t.along.shape[1] + t.rest.shape[1])) for t in comparing.nothing.linear]
    )
    ways = [_modes(comparing.ways[name]) for name in names]
    effects = [_rival(each, lines, nothing) for each in ways]
    sizes = np.array(priors.SMOOTH_SIZES)
    alike, none = np.full(len(sizes), -math.log(len(sizes))), np.full(len(sizes), nothing)
    unnamed = []
    for where in comparing.smooth:
        if where != IN_SPEED:  # which is a prior of the hull
            own = lines.left_open(replace(comparing.base, smooth=where))
            opened = np.tile(own, (len(sizes), 1))
            unnamed.append(
                Rival(math.log(priors.UNNAMED_ODDS.mean), alike, none, none, opened, sizes)
            )
    information = lines.information()
    # what is open about an effect grows with it
    norm = np.sqrt(np.maximum(np.diag(information), 0.0))
    for i, (modes, each) in enumerate(zip(ways, effects, strict=True)):
        shown = norm[each.trace].reshape(len(modes), -1)
        tried = [np.argmin(np.abs(_points(way) - way.tried()[0])) for way in modes]
        likely = shown[np.arange(len(modes)), tried][:, None]
        share = np.divide(shown, likely, out=np.zeros_like(shown), where=likely > 0.0)
        effects[i] = each._replace(share=share.ravel())
    found = {}
    for modes, chance in zip(ways, chances_of_names(information, effects, unnamed), strict=True):
        which = len(modes) // 2  # that shows neither best nor least
        way = modes[which]
        prior, z = way.unknowns[0].prior, _points(way)
        size = np.array([prior.at(one) for one in z[1:].tolist()])
        amount = np.append(0.0, np.abs(size / prior.at(way.tried()[0])) ** way.power)
        either = np.flatnonzero(z > 0.0) if prior.shape is Shape.NORMAL else np.arange(len(z))
        order = either[np.argsort(amount[either])]
        least = named_from(amount[order], chance.reshape(len(modes), -1)[which, order])
        if math.isfinite(least) and way.effect.name not in never:
            found[way.effect.name] = abs(way.size_of(least))
    return found


def _modes(ways: Sequence[EffectWay]) -> list[EffectWay]:
    """Return one way of each sign and side."""
    plain = [way for way in ways if way.run is None and not (way.kept or way.nameless)]
    modes: dict[object, list[EffectWay]] = {}
    for way in plain:
        modes.setdefault(way.mode, []).append(way)
    return [sorted(each, key=lambda way: way.start)[len(each) // 2] for each in modes.values()]


def _points(way: EffectWay) -> Float64:
    """Return z of sizes: next to none of the effect, and those whose prior is a sum."""
    half = way.unknowns[0].prior.shape is Shape.HALF_NORMAL
    return np.append(way.z_of(_LITTLE), _POINTS[_POINTS > 0.0] if half else _POINTS)


def _rival(modes: Sequence[EffectWay], lines: _Lines, nothing: int) -> Rival:
    """Return an effect as a rival of others, its lines kept."""
    stated, parts = lines.comparing.stated, []
    for way in modes:
        z = _points(way)
        sized = [replace(way, start=(one, *way.start[1:])) for one in z.tolist()]
        shown = _traces(lines.comparing, [Explanation((*stated, each)) for each in sized])
        slopes = lines.add([_CELL * np.gradient(each[1:], _CELL, axis=0) for each in shown])
        log_chance = np.append(-math.inf, -0.5 * z[1:] ** 2 / (1.0 - _CELL**2))
        parts.append(
            (
                log_chance - logsumexp(log_chance) - math.log(len(modes)),
                lines.add(shown),
                np.append(nothing, slopes),
                np.tile(lines.left_open(Explanation((*stated, way))), (len(z), 1)),
                np.ones(len(z)),
            )
        )
    return Rival(math.log(modes[0].effect.odds), *map(np.concatenate, zip(*parts, strict=True)))


def _traces(comparing: Comparing, hypotheses: Sequence[Explanation]) -> list[Float64]:
    runs = range(len(comparing.runs.runs))
    return [comparing.traces(j, comparing.nothing, hypotheses) for j in runs]


def percent_of_r(comparing: Comparing, name: str, bound: float) -> float:
    """
    Return by how much an effect of some size changes the deceleration that is shown.

    Parameters
    ----------
    comparing
        After the comparison.
    name
        Of the effect.
    bound
        Its size.

    Returns
    -------
    float
        Rms over the coastdown after the run-down, percent.
    """
    way, runs = comparing.ways[name][0], comparing.runs
    prior = way.unknowns[0].prior
    z = [prior.inverse(math.copysign(bound, prior.first)), *way.start[1:]]
    run = runs.runs[0]
    began = runs.began(0, comparing.nothing.at)
    actions = began.still, began.still + way.action(run.frame, z)
    shown = run.simulate(actions, np.full(2, began.speed_m_s), began.later_s).along
    rows, model = run.model.rows, run.model
    by_log = rows.kind == LOG if (rows.kind == LOG).any() else rows.kind == rows.kind[-1]
    late = by_log & (rows.time_s > RUN_DOWNS * max(model.forces.tau_s, 1.0))
    time, lines = rows.time_s[late], shown[:, late]
    if len(time) < _FEWEST or not np.isfinite(lines).all():
        return math.nan
    loss = np.gradient(lines, time, axis=1)
    apart = np.interp(-lines[0], -lines[1], loss[1]) / np.minimum(loss[0], -1e-9) - 1.0
    inside = (lines[0] >= lines[1].min()) & (lines[0] <= lines[1].max())
    return 100.0 * float(np.sqrt(np.mean(apart[inside] ** 2))) if inside.any() else math.nan
