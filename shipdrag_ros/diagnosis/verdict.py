# SPDX-License-Identifier: Apache-2.0
"""
From compared hypotheses to what is answered: sizes, limits, how runs differ, and the gaps.

Whether that is `named`, `one_of`, `unknown` or `none` is decided by `inference.decision.decide`.
How far model and data are apart, and where, stands below.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic

import numpy as np
from scipy.special import logsumexp

from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.result import (
    FORCE,
    Candidate,
    DiagnosisResult,
    EffectEstimate,
    Gap,
    Limit,
    RunSize,
    Where,
)
from shipdrag_ros.inference.decision import (
    NONE,
    UNKNOWN,
    Decision,
    LineNumbers,
    Names,
    Rival,
    Verdict,
    chances_of_names,
    decide,
    marginals,
    mixture,
    named_from,
    quantile,
)
from shipdrag_ros.inference.linear import solve_scaled
from shipdrag_ros.inference.rows import KIND_COUNT, LOG, POSITION
from shipdrag_ros.parameter import Parameter, Shape
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.compare import (
    ComparedHypotheses,
    Comparing,
    Fit,
    Fitted,
    RunResidual,
    WeighedFit,
)
from shipdrag_ros.posterior.effects import EffectWay
from shipdrag_ros.posterior.hypotheses import IN_GROUND, IN_LOG, IN_SPEED, Explanation, place_of
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.columns import RUN_DOWNS
from shipdrag_ros.simulation.effects import find

_BELOW = 0.95  # of a size, below its limit
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
        bound = quantile(sizes, _BELOW if grows else 1.0 - _BELOW)
        limits[effect.name] = Limit(
            effect.parameters[0].name,
            'upper_95' if grows else 'lower_95',
            bound,
            from_size.get(effect.name),
            percent_of_r(comparing, effect.name, bound),
        )
    return limits


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
    comparing, stated, parts = lines.comparing, lines.comparing.stated, []
    for way in modes:
        z = _points(way)
        sized = [replace(way, start=(one, *way.start[1:])) for one in z.tolist()]
        tried = [Explanation((*stated, each)) for each in sized]
        runs = range(len(comparing.runs.runs))
        shown = [comparing.traces(j, comparing.nothing, tried) for j in runs]
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
    shown = run.simulate(actions, began.speed_m_s, began.later_s).along
    rows, model = run.model.rows, run.model
    by_log = rows.kind == LOG if (rows.kind == LOG).any() else rows.kind == rows.kind[-1]
    late = by_log & (rows.time_s > RUN_DOWNS * max(model.forces.tau_s, 1.0))
    time, lines = rows.time_s[late], shown[:, late]
    if len(time) < _FEWEST or not np.isfinite(lines).all():
        return math.nan
    if rows.kind[late][0] % KIND_COUNT == POSITION:
        lines = np.gradient(lines, time, axis=1, edge_order=2)
    loss = np.gradient(lines, time, axis=1, edge_order=2)
    apart = np.interp(-lines[0], -lines[1], loss[1]) / np.minimum(loss[0], -1e-9) - 1.0
    inside = (lines[0] >= lines[1].min()) & (lines[0] <= lines[1].max())
    return 100.0 * float(np.sqrt(np.mean(apart[inside] ** 2))) if inside.any() else math.nan


_PARTS = 12  # of a coastdown, to say where a gap is
_SHARE = 0.9  # of the excess, between the ends of where it is
_EVEN_NATS = 3.0  # of evidence by which two channels are not separated
_CHANNELS = {IN_LOG: 'log', IN_GROUND: 'radar'}


def gap_of(seen: Sequence[Observation], residuals: Sequence[RunResidual]) -> Gap:
    """
    Return how far a hypothesis is from the runs.

    Parameters
    ----------
    seen
    residuals
        One a run.

    Returns
    -------
    Gap
        RMS over the coastdowns; chi^2 over all rows.
    """
    speeds, places = [], []
    for run, residual in zip(seen, residuals, strict=True):
        kind, after = run.rows.kind, run.rows.time_s >= run.lead_in_s
        speeds.append(residual.along[after & (kind == LOG)])
        ahead = residual.along[after & (kind == POSITION)]
        port_s = run.context.port_s
        if len(port_s) and len(ahead):
            when = run.rows.time_s[after & (kind == POSITION)]
            to_port = np.interp(when, port_s, residual.rest[: len(port_s)])
            places.append(np.hypot(ahead, to_port))
    whole = np.concatenate([each.whitened for each in residuals])
    return Gap(_rms(speeds), _rms(places), float(np.mean(whole**2)))


def _rms(parts: Sequence[Float64]) -> float | None:
    whole = np.concatenate([*parts, np.empty(0)])
    return float(np.sqrt(np.mean(whole**2))) if len(whole) else None


def held_out(seen: Sequence[Observation], comparing: Comparing, fit: Fitted) -> Gap | None:
    """
    Predict each run from the others, and show how far off that is.

    Parameters
    ----------
    seen
    comparing
        Of these runs.
    fit
        Of all of them; its rows are taken as linear.

    Returns
    -------
    Gap or None
        None with one run, and where all have an effect of their own.

    Notes
    -----
    chi^2 is by how much -2 ln of the posterior density grows with the run, so that what the
    others do not show is allowed for. A run with an effect that is its own cannot be predicted.
    """
    own_effects = {way.run for way in fit.hypothesis.ways}
    told = [j for j in range(len(seen)) if j not in own_effects]
    if len(seen) < 2 or not told:
        return None
    _, mean, precision = comparing.prior_of(fit)
    parts = comparing.equations(fit)
    everything = np.sum(parts, axis=0)
    least = _least(everything, mean, precision)[0]
    chi2, residuals, rows = 0.0, [], 0
    for j in told:
        without, at = _least(everything - parts[j], mean, precision)
        chi2 += least - without
        table, sight = fit.linear[j], comparing.runs.runs[j]
        at = at.copy()
        own = comparing.runs.own[j]
        at[own] = _given_shared(parts[j], at, own, mean, precision)
        along = table.along[0] - at[table.place] @ table.along[1:]
        white = table.rest[0] - at[table.place] @ table.rest[1:]
        rest = np.linalg.solve(sight.whitener, white)
        residuals.append(RunResidual(along, rest, np.concatenate([along, rest])))
        rows += len(along) + len(rest)
    gap = gap_of([seen[j] for j in told], residuals)
    return replace(gap, chi2_per_sample=chi2 / rows)


def _least(products: Float64, mean: Float64, precision: Float64) -> tuple[float, Float64]:
    """Return the least -2 ln of the posterior density, and where it is (p,)."""
    matrix = products[1:, 1:] + np.diag(precision)
    right = products[1:, 0] + precision * mean
    at = solve_scaled(matrix, right)
    return float(products[0, 0] + precision @ mean**2 - right @ at), at


def _given_shared(
    products: Float64, at: Float64, own: Int64, mean: Float64, precision: Float64
) -> Float64:
    """Return what belongs to a run alone, all else being as the other runs show it."""
    fixed = at.copy()
    fixed[own] = 0.0
    right = products[1 + own, 0] - products[1 + own, 1:] @ fixed + precision[own] * mean[own]
    matrix = products[np.ix_(1 + own, 1 + own)] + np.diag(precision[own])
    return np.linalg.solve(matrix, right)


def where(
    case: ComparedRuns, before: Fitted, after: Fitted, named: Collection[str], *, of_force: bool
) -> Where:
    """
    Return in which channel, and when, model and data disagree.

    Parameters
    ----------
    case
    before
        The ship as stated.
    after
        What explains the runs, whose speeds are said: a ship as stated may never be as slow.
    named
        Effects of the answer.
    of_force
        Whether it is known to be in the force, where no instrument alone is named.

    Returns
    -------
    Where
        The ends hold 90 % of the excess over noise.
    """
    channel = _falsified(named) or (FORCE if of_force else _channel(case.found))
    times, speeds = [], []
    residuals = case.comparing.residuals(before)
    for run, residual, table in zip(case.seen, residuals, after.linear, strict=True):
        since = (run.rows.time_s - run.lead_in_s) / run.duration_s
        part = np.clip((since * _PARTS).astype(int), 0, _PARTS - 1)
        rows = np.flatnonzero(since >= 0.0)
        excess = np.zeros(_PARTS)
        np.add.at(excess, part[rows], residual.whitened[rows] ** 2 - 1.0)
        share = np.cumsum(np.maximum(excess, 0.0))
        if share[-1] <= 0.0:
            continue
        share /= share[-1]
        first = int(np.searchsorted(share, 0.5 * (1.0 - _SHARE)))
        last = int(np.searchsorted(share, 0.5 * (1.0 + _SHARE)))
        ends = np.array([first, last + 1]) / _PARTS
        times.append(ends * run.duration_s)
        speeds.append(np.interp(ends, since, table.speed_m_s))
    if not times:
        whole = max(run.duration_s for run in case.seen)
        return Where(channel, (0.0, whole), (0.0, max(run.speed_m_s for run in case.seen)))
    return Where(
        channel,
        (float(np.min(times)), float(np.max(times))),
        (float(np.min(speeds)), float(np.max(speeds))),
    )


def _falsified(named: Collection[str]) -> str:
    """Return the channel of instruments whose errors alone are named; else ''."""
    read = [find(name).errs_in for name in named]
    if not read or not all(read):
        return ''
    by_log = {'speed_through_water' in each for each in read}
    return 'log_radar' if len(by_log) > 1 else 'log' if True in by_log else 'radar'


def _channel(found: ComparedHypotheses[Fitted]) -> str:
    """Return where something smooth explains most."""
    smooth = [fit for fit in found.fitted if fit.names == UNKNOWN and not fit.hypothesis.names]
    best = max(smooth, key=lambda fit: fit.log_evidence)
    near = {
        place_of(fit.hypothesis.smooth)
        for fit in smooth
        if fit.log_evidence > best.log_evidence - _EVEN_NATS
    }
    if {IN_LOG, IN_GROUND} <= near:
        return 'log_radar'
    return _CHANNELS.get(place_of(best.hypothesis.smooth), FORCE)
