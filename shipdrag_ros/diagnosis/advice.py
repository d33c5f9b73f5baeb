# SPDX-License-Identifier: Apache-2.0
"""
What would separate candidates, and how probably.

Another run and an instrument are simulated under each candidate; of what cannot
be simulated, the declarations of the effects say that it would help.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from shipdrag_ros.diagnosis.context import Context
from shipdrag_ros.diagnosis.facts import Facts
from shipdrag_ros.diagnosis.measured import Measured
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.outcomes import (
    PredictedOutcome,
    of_another_run,
    of_instrument,
    probability_of_naming,
    with_known,
)
from shipdrag_ros.diagnosis.result import Advice, Candidate
from shipdrag_ros.diagnosis.sights import ship_runs, sight
from shipdrag_ros.estimation.run_down import TURNS, RunDown
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.inference.decision import (
    CERTAIN,
    NONE,
    UNKNOWN,
    Names,
    Verdict,
    WeighedHypothesis,
    decide,
)
from shipdrag_ros.inference.rows import LOG
from shipdrag_ros.posterior import motion
from shipdrag_ros.posterior.compare import ComparedHypotheses, Comparing, Fitted
from shipdrag_ros.progress import Progress, silent
from shipdrag_ros.samples import Block, Channel, Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.facts import advice as fact_advice
from shipdrag_ros.simulation.effect import COSTS, Cost, Measure
from shipdrag_ros.simulation.effects import discriminating_measurements, inseparable

_MOST = 12  # rivals
_SLOWER = 0.6  # of the first run, at another speed
_READING_S = 1.0  # between readings of an instrument
_TURNING, _STANDING = 0.5, 0.0  # shaft speed over that under power
_SHALLOW_DRAUGHTS = 4.0
_GUSTS_M_S = 0.2  # median change from minute to minute of a mean wind
_HARDLY = 0.05  # probability below which nothing is gained
_INSTRUMENTS = {
    Measure.WIND: Channel.WIND_APPARENT,
    Measure.DEPTH: Channel.DEPTH,
    Measure.HEADING: Channel.HEADING,
    Measure.SHAFT: Channel.SHAFT,
}
_RUNS = (Measure.RECIPROCAL_RUN, Measure.OTHER_SPEED, Measure.ANOTHER_RUN)


@dataclass(frozen=True)
class Undecided:
    """
    Runs that cannot be decided.

    Attributes
    ----------
    ship
    seen
    comparing, found
        Of these runs.
    facts
        That are stated.
    candidates
        That the runs cannot separate.
    """

    ship: Ship
    seen: Sequence[Observation]
    comparing: Comparing
    found: ComparedHypotheses[Fitted]
    facts: Facts
    candidates: Sequence[Candidate]

    @cached_property
    def inseparable(self) -> tuple[frozenset[str], ...]:
        """Effects that no record separates."""
        return inseparable(self.found.effects)

    @cached_property
    def rivals(self) -> dict[Names, Fitted]:
        """The most probable hypotheses, nothing and something unnamed too."""
        return {
            names: self.found.best[names]
            for place, names in enumerate(self.found.probability)
            if (place < _MOST or names in (NONE, UNKNOWN))
            and math.isfinite(self.found.best[names].log_evidence)
        }


def advice(case: Undecided, progress: Progress = silent) -> tuple[Advice, ...]:
    """
    Return what would decide; first what is likely to cost the crew least.

    Parameters
    ----------
    case
    progress
        Called with how many measurements are tried.

    Returns
    -------
    tuple of Advice
        Of measurements that the runs do not hold already.

    Notes
    -----
    The probability is that something is named after the measurement, averaged over
    what may be the truth; None where it is not simulated.
    """
    rivals = [
        WeighedHypothesis(names, math.log(max(case.found.probability[names], 1e-300)), 0.0)
        for names in case.rivals
    ]
    found: list[Advice] = []
    tried = (*_RUNS, *_INSTRUMENTS)
    for done, measure in enumerate(tried):
        progress('trying what would decide', done, len(tried))
        if _measured(measure, case.seen):
            continue
        settings, setting = _settings(measure, case)
        if settings and all(
            len(each.mean) and np.isfinite(each.slope).all() for way in settings for each in way
        ):
            named = probability_of_naming(settings, setting, rivals, inseparable=case.inseparable)
            found.append(Advice(measure.value, named, COSTS[measure]))
    best = max((each.probability or 0.0 for each in found), default=0.0)
    promising = [each for each in found if (each.probability or 0.0) >= min(_HARDLY, best)]
    ranked = {each: each.probability or 0.0 for each in promising}
    for each in declared(case.candidates):
        measure = Measure(each.measure)
        if measure not in (*_RUNS, *_INSTRUMENTS) and not _measured(measure, case.seen):
            ranked[each] = _reach(measure, case.candidates, case.inseparable)
    for name, named in _facts(case).items():
        ranked[Advice(fact_advice(name), named, Cost.LOOK)] = named
    return _by_cost(ranked)


def _facts(case: Undecided) -> dict[str, float]:
    """Return the facts that would name something, and how probably."""

    def decided(after: Mapping[Names, float]) -> bool:
        return decide(after, case.inseparable).verdict is Verdict.NAMED

    found = case.facts.naming(case.found, decided)
    return {name: named for name, named in found.items() if named >= _HARDLY}


def _by_cost(ranked: Mapping[Advice, float]) -> tuple[Advice, ...]:
    """Put first what is likely to need the fewest hours of the ship until something is named."""

    def hours(each: Advice) -> float:
        return Cost(each.cost).hours / max(ranked[each], 1e-3)

    return tuple(sorted(ranked, key=hours))


def declared(candidates: Sequence[Candidate]) -> tuple[Advice, ...]:
    """
    Return what the effects say separates them; first what costs least for what it serves.

    Parameters
    ----------
    candidates
        With their probabilities, which weigh the pairs.

    Returns
    -------
    tuple of Advice
        Without a probability.
    """
    votes: dict[Measure, float] = {}
    for one, other in combinations(candidates, 2):
        for measure in _discriminating(one, other):
            weight = one.probability * other.probability
            votes[measure] = votes.get(measure, 0.0) + weight
    return _by_cost(
        {Advice(measure.value, None, COSTS[measure]): vote for measure, vote in votes.items()}
    )


def _discriminating(one: Candidate, other: Candidate) -> list[Measure]:
    """Return what separates two candidates, by what they do not share."""
    if UNKNOWN in (one.names, other.names):
        return []
    own, others = set(one.names) - set(other.names), set(other.names) - set(one.names)
    return [
        measure
        for a in sorted(own)
        for b in sorted(others)
        for measure in discriminating_measurements(a, b)
    ]


def _reach(
    measure: Measure, candidates: Sequence[Candidate], inseparable: Sequence[frozenset[str]]
) -> float:
    """Return how probably something is named if all is separated that is said to be."""
    if measure is Measure.THIRD_SPEED:  # is taken for one with the source over ground there is
        return 0.0
    never = {name for group in inseparable for name in group}
    return sum(
        one.probability
        for one in candidates
        if never.isdisjoint(one.names)
        and one.probability
        >= CERTAIN
        * sum(
            other.probability
            for other in candidates
            if other is one or measure not in _discriminating(one, other)
        )
    )


def _measured(measure: Measure, seen: Sequence[Observation]) -> bool:
    """Say whether the runs hold something already."""
    first = seen[0]
    match measure:
        case Measure.RECIPROCAL_RUN:
            return any(math.cos(run.heading_rad - first.heading_rad) < -0.5 for run in seen)
        case Measure.ANOTHER_COURSE:
            return any(math.cos(run.heading_rad - first.heading_rad) < 0.9 for run in seen)
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


def _settings(measure: Measure, case: Undecided) -> tuple[list[list[PredictedOutcome]], list[int]]:
    """Return the ways in which a measurement may be read, and that of each candidate."""
    first, fits, same = case.seen[0], list(case.rivals.values()), [0] * len(case.rivals)
    if measure in _RUNS:
        opposite = math.pi if measure is Measure.RECIPROCAL_RUN else 0.0
        slower = _SLOWER if measure is Measure.OTHER_SPEED else 1.0
        run = _another(first, first.heading_rad + opposite, slower * first.speed_m_s)
        outcomes = of_another_run(case.comparing, fits, sight(run, case.seen, case.ship))
        return ([outcomes], same) if outcomes else ([], [])
    if measure is not Measure.SHAFT:
        outcomes, _ = _read(_windows(measure, case), case, fits)
        return ([outcomes], same) if outcomes else ([], [])
    # whether the water turns the shaft is seen before all else, and differs by rival
    found: list[tuple[list[PredictedOutcome], list[Float64]]] = []
    for after in (_TURNING, _STANDING):
        windows = _windows(measure, case, after=after)
        outcomes, values = _read(windows, case, fits)
        if not outcomes or any(len(each) == 0 for each in values):
            return [], []
        # the time of the stop and the run-down are read from the shaft as well
        seen = [RunDown.of(window, case.ship) for window in windows]
        sd = {
            motion.STOP: [each.stop_sd_s for each in seen],
            motion.TAU: [each.shaft_sd_s / max(each.shaft_s, 1e-3) for each in seen],
        }
        found.append((with_known(case.comparing, fits, outcomes, sd), values))
    (where_turning, values), (where_standing, _) = found
    seen_to_stand = [int(np.median(value[:3]) <= TURNS) for value in values]
    return [where_turning, where_standing], seen_to_stand


def _read(
    windows: Sequence[Window], case: Undecided, fits: Sequence[Fitted]
) -> tuple[list[PredictedOutcome], list[Float64]]:
    """Return what rivals predict of an instrument in each run."""
    seen = []
    for run, window in zip(case.seen, windows, strict=True):
        context = Context.of(window, case.ship, run.time_s, run.context.stop)
        alone = replace(context, value=np.zeros(len(context)))
        seen.append(replace(run, across=None, context=alone))
    return of_instrument(case.comparing, fits, ship_runs(seen, case.ship).runs)


def _another(first: Observation, heading_rad: float, speed_m_s: float) -> Observation:
    """Return a run of the same rows and noise as the first one, whose values are 0."""
    context = first.context
    stop = replace(context.stop, heading_rad=heading_rad, speed_m_s=speed_m_s)
    return replace(
        first,
        heading_rad=heading_rad,
        speed_m_s=speed_m_s,
        along=_empty(first.along),
        across=None if first.across is None else _empty(first.across),
        context=replace(context, stop=stop, value=np.zeros(len(context))),
    )


def _empty(measured: Measured) -> Measured:
    rows = measured.rows
    return replace(measured, rows=rows._replace(value=np.zeros(len(rows.value))))


def _windows(measure: Measure, case: Undecided, *, after: float = 0.0) -> list[Window]:
    """Return what an instrument may read in each run; `after` is the shaft after its fall."""
    windows = []
    channel, draught_m = _INSTRUMENTS[measure], case.ship.draught_m or math.nan
    for run in case.seen:
        stop = run.context.stop
        time_s = np.arange(0.0, run.time_s[-1], _READING_S)
        gusts = 0.5 * _GUSTS_M_S * (-1.0) ** (time_s // 60.0)
        since_s = np.maximum(time_s - stop.lead_in_s, 0.0)
        readings = {
            Channel.WIND_APPARENT: np.column_stack([gusts - stop.speed_m_s, gusts]),
            Channel.DEPTH: np.full(len(time_s), _SHALLOW_DRAUGHTS * draught_m),
            Channel.HEADING: np.full(len(time_s), stop.heading_rad),
            Channel.SHAFT: after + (1.0 - after) * np.exp(-since_s / max(run.run_down_s, 1e-3)),
        }
        time_ns = stop.since_ns + np.round(time_s * 1e9).astype(np.int64)
        windows.append(
            Window.from_block(
                Block.of(channel, time_ns, readings[channel]),
                stop.since_ns + round(stop.lead_in_s * 1e9),
                int(time_ns[-1]),
                before_ns=stop.since_ns,
            )
        )
    return windows
