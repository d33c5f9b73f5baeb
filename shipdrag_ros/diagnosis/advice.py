# SPDX-License-Identifier: Apache-2.0
"""
What would tell candidates apart, and how probably.

Another run and an instrument are simulated under each candidate; of what cannot
be simulated, the declarations of the effects say that it would help.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from shipdrag_ros.diagnosis.context import Context
from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.hypotheses import Library
from shipdrag_ros.diagnosis.linear import Problem
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.prospect import (
    Prospect,
    empty,
    of_another_run,
    of_instrument,
    resolving,
)
from shipdrag_ros.diagnosis.result import Advice, Candidate
from shipdrag_ros.diagnosis.verdict import UNNAMED, Weighed
from shipdrag_ros.estimation.motion_fit.coast import LOG
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effect import Measure
from shipdrag_ros.simulation.effects import deciders

_MOST = 12  # candidates that are told apart
_SLOWER = 0.6  # of the first run, at another speed
_READING_S = 10.0  # between readings of an instrument
_TURNING, _STANDING = 0.5, 0.0  # shaft speed over that under power
_TURNS = 0.05
_SHALLOW_DRAUGHTS = 4.0
_NOT_SIMULATED = 0.5  # where what cannot be simulated stands among the others
_HARDLY = 0.05  # probability below which nothing is gained
_INSTRUMENTS = {
    Measure.WIND: Channel.WIND_APPARENT,
    Measure.DEPTH: Channel.DEPTH,
    Measure.HEADING: Channel.HEADING,
    Measure.SHAFT: Channel.SHAFT,
}
_RUNS = (Measure.RECIPROCAL_RUN, Measure.OTHER_SPEED, Measure.ANOTHER_RUN)


def advice(
    library: Library,
    weighed: Weighed,
    candidates: Sequence[Candidate],
    *,
    inseparable: Collection[frozenset[str]],
) -> tuple[Advice, ...]:
    """
    Return what would decide, the most promising first.

    Parameters
    ----------
    candidates
        That the runs cannot tell apart.
    inseparable
        Effects that no record can tell apart, which are never certain.

    Notes
    -----
    The probability is that the candidate which is the truth is certain after the
    measurement, averaged over the candidates and something unnamed, which never
    is; None where it is not simulated.
    """
    rivals = [*((each.names, each.probability) for each in candidates[:_MOST])]
    if UNNAMED in weighed.best:
        rivals.append((UNNAMED, weighed.unnamed))
    # one that could not be fitted is none
    rivals = [
        (names, probability)
        for names, probability in rivals
        if np.isfinite(weighed.best[names].covariance).all()
    ]
    fits = [weighed.best[names] for names, _ in rivals]
    share = np.array([probability for _, probability in rivals])
    share /= share.sum()
    never = {*UNNAMED, *(name for group in inseparable for name in group)}
    possible = [float(never.isdisjoint(names)) for names, _ in rivals]
    found: list[Advice] = []
    for measure in (*_RUNS, *_INSTRUMENTS) if len(fits) > 1 else ():
        if _measured(measure, library.seen):
            continue
        settings, setting = _settings(measure, library, fits)
        if settings and all(
            np.isfinite(one.slope).all() and len(one.mean) for way in settings for one in way
        ):
            certain = resolving(settings, setting, share.tolist())
            found.append(Advice(measure.value, float(share @ (np.array(certain) * possible))))
    best = max((each.probability or 0.0 for each in found), default=0.0)
    promising = [each for each in found if (each.probability or 0.0) >= min(_HARDLY, best)]
    simulated = {measure.value for measure in (*_RUNS, *_INSTRUMENTS)}
    others = [
        each
        for each in declared(candidates)
        if each.measure not in simulated and not _measured(Measure(each.measure), library.seen)
    ]
    return tuple(sorted([*promising, *others], key=_rank))


def declared(candidates: Sequence[Candidate]) -> tuple[Advice, ...]:
    """
    Return what the effects say tells them apart, what serves most pairs first.
    """
    votes: dict[str, float] = {}
    for one, other in combinations(candidates, 2):
        for a in one.names:
            for b in other.names:
                if a == b:
                    continue
                for measure in deciders(a, b):
                    weight = one.probability * other.probability
                    votes[measure.value] = votes.get(measure.value, 0.0) + weight
    ranked = sorted(votes, key=lambda measure: -votes[measure])
    return tuple(Advice(measure, None) for measure in ranked)


def _rank(each: Advice) -> float:
    return -(_NOT_SIMULATED if each.probability is None else each.probability)


def _measured(measure: Measure, seen: Sequence[Observation]) -> bool:
    """Tell whether the runs hold something already."""
    first = seen[0]
    match measure:
        case Measure.RECIPROCAL_RUN:
            return any(math.cos(run.heading_rad - first.heading_rad) < -0.5 for run in seen)
        case Measure.OTHER_SPEED:
            return any(abs(run.speed_m_s / first.speed_m_s - 1.0) > 0.2 for run in seen)
        case Measure.ANOTHER_RUN:
            return len(seen) > 1
        case Measure.WIND:
            return all(len(run.context.at_wind) for run in seen)
        case Measure.DEPTH:
            return all(run.context.draught_m is not None for run in seen)
        case Measure.HEADING:
            return all(len(run.context.at_yaw) for run in seen)
        case Measure.SHAFT:
            return all(len(run.context.at_shaft) for run in seen)
        case Measure.LOG:
            return any((run.along.rows.kind == LOG).any() for run in seen)
        case Measure.RADAR:
            return any((run.along.rows.kind != LOG).any() for run in seen)
        case _:
            return False


def _settings(
    measure: Measure, library: Library, fits: Sequence[Fit]
) -> tuple[list[list[Prospect]], list[int]]:
    """Return the ways in which a measurement may be read, and that of each candidate."""
    problem, first = library.problem, library.seen[0]
    if measure in _RUNS:
        opposite = math.pi if measure is Measure.RECIPROCAL_RUN else 0.0
        slower = _SLOWER if measure is Measure.OTHER_SPEED else 1.0
        run = _another(first, first.heading_rad + opposite, slower * first.speed_m_s)
        return [of_another_run(problem, fits, run)], [0] * len(fits)
    if measure is not Measure.SHAFT:
        prospects, _ = of_instrument(problem, fits, _contexts(measure, problem, library.ship))
        return [prospects], [0] * len(fits)
    # whether the water turns the shaft is seen before all else, and differs by candidate
    turning = _contexts(measure, problem, library.ship, after=_TURNING)
    standing = _contexts(measure, problem, library.ship, after=_STANDING)
    if any(len(context.at_shaft) == 0 for context in (*turning, *standing)):
        return [], []
    where_turning, values = of_instrument(problem, fits, turning)
    where_standing, _ = of_instrument(problem, fits, standing)
    seen_to_stand = [int(np.median(value[:3]) <= _TURNS) for value in values]
    return [where_turning, where_standing], seen_to_stand


def _another(first: Observation, heading_rad: float, speed_m_s: float) -> Observation:
    """Return a run of the same rows and noise as the first one."""
    context = first.context
    stop = replace(context.stop, heading_rad=heading_rad, speed_m_s=speed_m_s)
    return replace(
        first,
        heading_rad=heading_rad,
        speed_m_s=speed_m_s,
        along=empty(first.along),
        across=None if first.across is None else empty(first.across),
        context=replace(context, stop=stop, value=np.zeros(len(context))),
    )


def _contexts(
    measure: Measure, problem: Problem, ship: Ship, *, after: float = 0.0
) -> list[Context]:
    """Return what an instrument would add to each run; `after` is the shaft after the stop."""
    contexts = []
    channel = _INSTRUMENTS[measure]
    for run in problem.seen:
        stop = run.context.stop
        time_s = np.arange(0.0, run.time_s[-1], _READING_S)
        readings = {
            Channel.WIND_APPARENT: np.outer(np.ones(len(time_s)), [-stop.speed_m_s, 0.0]),
            Channel.DEPTH: np.full(len(time_s), _SHALLOW_DRAUGHTS * (ship.draught_m or math.nan)),
            Channel.HEADING: np.full(len(time_s), stop.heading_rad),
            Channel.SHAFT: np.where(time_s < stop.lead_in_s, 1.0, after),
        }
        time_ns = stop.since_ns + np.round(time_s * 1e9).astype(np.int64)
        window = Window.from_block(
            Block.of(channel, time_ns, readings[channel]),
            stop.since_ns + round(stop.lead_in_s * 1e9),
            int(time_ns[-1]),
            before_ns=stop.since_ns,
        )
        contexts.append(Context.of(window, ship, run.time_s, stop))
    return contexts
