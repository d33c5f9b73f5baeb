# SPDX-License-Identifier: Apache-2.0
"""
From what size on some runs name an effect, and what a size does to the motion.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from shipdrag_ros.inference.limits import LineNumbers, Rival, chances_of_names, named_from
from shipdrag_ros.inference.rows import LOG
from shipdrag_ros.parameter import Shape
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.compare import Comparing
from shipdrag_ros.posterior.effects import EffectWay
from shipdrag_ros.posterior.hypotheses import IN_SPEED, Explanation
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.columns import RUN_DOWNS

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
        first = runs.size + len(comparing.base.unknowns)
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
