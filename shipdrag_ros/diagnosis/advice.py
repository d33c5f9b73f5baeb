# SPDX-License-Identifier: Apache-2.0
"""
What would separate candidates, and how probably.

Another run and an instrument are simulated under each candidate; of what cannot
be simulated, the declarations of the effects say that it would help.

What a measurement that is yet to be made would separate.

Each rival predicts it from the posterior given the existing runs; outcomes are
drawn under each in turn, and the verdict on every one of them is found as it
would be.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.special import softmax

from shipdrag_ros.diagnosis.known import Carried, Facts
from shipdrag_ros.diagnosis.observation import Context, Observation, ship_runs, sight
from shipdrag_ros.diagnosis.result import Advice, Candidate
from shipdrag_ros.diagnosis.verdict import ComparedRuns
from shipdrag_ros.estimation.run_down import TURNS, RunDown
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.inference.decision import (
    CERTAIN,
    NONE,
    UNKNOWN,
    Names,
    Weighed,
    names_one,
    probabilities,
)
from shipdrag_ros.inference.linear import inverse_of
from shipdrag_ros.inference.rows import LOG
from shipdrag_ros.posterior import motion
from shipdrag_ros.posterior.compare import Comparing, Fitted
from shipdrag_ros.posterior.hypotheses import Explanation, RunSight, ShipRuns
from shipdrag_ros.progress import Progress, silent
from shipdrag_ros.samples import Block, Channel, Float64
from shipdrag_ros.ship.facts import advice as fact_advice
from shipdrag_ros.simulation.effect import Cost, Measure, Scope
from shipdrag_ros.simulation.effects import discriminating_measurements, inseparable

_DRAWS = 300  # of all rivals, of each as many as it is probable
_SEED = 0


@dataclass(frozen=True)
class PredictedOutcome:
    """
    What one rival predicts of a measurement, whitened rows.

    Attributes
    ----------
    mean : (r,)
    slope : (p, r)
        By each unknown.
    covariance, precision : (p, p)
        Of the unknowns before the measurement; 0 in both where nothing is known.
    """

    mean: Float64
    slope: Float64
    covariance: Float64
    precision: Float64

    def draw(self, count: int, rng: np.random.Generator) -> Float64:
        """
        Return outcomes, (count, r).
        """
        size, axes = np.linalg.eigh(self.covariance)
        root = axes * np.sqrt(np.maximum(size, 0.0))
        unknown = rng.standard_normal((count, len(root))) @ root.T
        noise = rng.standard_normal((count, len(self.mean)))
        return np.asarray(self.mean + unknown @ self.slope + noise, np.float64)

    def log_density(self, outcomes: Float64) -> Float64:
        """
        Return that of each outcome, less a constant that all rivals share.
        """
        away = outcomes - self.mean
        matrix = self.precision + self.slope @ self.slope.T
        falls = away @ self.slope.T
        explained = np.einsum('ai,ai->a', falls, np.linalg.solve(matrix, falls.T).T)
        known = np.diag(self.precision) > 0.0
        before = np.linalg.slogdet(self.precision[np.ix_(known, known)])[1]
        volume = before - np.linalg.slogdet(matrix)[1]
        squares = np.einsum('ai,ai->a', away, away)
        return np.asarray(0.5 * (volume - squares + explained), np.float64)


def of_another_run(
    comparing: Comparing, fits: Sequence[Fitted], run: RunSight
) -> list[PredictedOutcome]:
    """
    Return what fitted hypotheses predict of a run that is yet to be made.

    Parameters
    ----------
    comparing
        Of the runs there are.
    fits
        Of hypotheses about them.
    run
        Values of its rows are 0.

    Returns
    -------
    list of PredictedOutcome
        Of each hypothesis; what belongs to a single run alone is not there again.
    """
    old = comparing.runs
    runs = ShipRuns((*old.runs, run))
    number, shift = len(old.runs), runs.size - old.size
    hypotheses = [_of_old_runs(fit.hypothesis) for fit in fits]
    at, places = [], []
    for fit, hypothesis in zip(fits, hypotheses, strict=True):
        place = np.arange(len(fit.at))
        place[old.size :] += shift
        begun = np.zeros(runs.width(hypothesis))
        begun[: runs.size] = runs.start
        begun[place] = fit.at
        at.append(begun)
        places.append(place)
    found = []
    tables = [each for each in runs.linearise_run(number, hypotheses, at) if each is not None]
    if len(tables) < len(fits):
        return []
    for fit, hypothesis, begun, place, table in zip(fits, hypotheses, at, places, tables):
        family = comparing.prior_of(fit)[0]
        matrix = np.diag(runs.priors(hypothesis, begun).precision[family])
        learnt = np.sum(comparing.equations(fit), axis=0)[1:, 1:]
        matrix[np.ix_(place, place)] += learnt
        covariance = inverse_of(matrix)[np.ix_(table.place, table.place)]
        alike = table._replace(white=tables[0].white)  # each reads what any of them draws
        lines = np.hstack([comparing.white(0, alike, run), table.rest])
        found.append(PredictedOutcome(-lines[0], lines[1:], covariance, inverse_of(covariance)))
    return found


def of_instrument(
    comparing: Comparing, fits: Sequence[Fitted], runs: Sequence[RunSight]
) -> tuple[list[PredictedOutcome], list[Float64]]:
    """
    Return what fitted hypotheses predict of an instrument in the runs there are.

    Parameters
    ----------
    comparing
        Of the runs there are.
    fits
        Of hypotheses about them.
    runs
        The same with rows of the instrument alone besides the motion.

    Returns
    -------
    outcomes : list of PredictedOutcome
        Of each hypothesis; empty where one cannot be simulated.
    values : list of (r,)
        As predicted, and not whitened.
    """
    every = ShipRuns(tuple(runs)).linearise([f.hypothesis for f in fits], [f.at for f in fits])
    outcomes, values = [], []
    for fit, tables in zip(fits, every, strict=True):
        if tables is None:
            return [], []
        precision = comparing.information(fit)
        slope = []
        for table in tables:
            whole = np.zeros((len(fit.at), table.rest.shape[1]))
            whole[table.place] = table.rest[1:]
            slope.append(whole)
        mean = -np.concatenate([table.rest[0] for table in tables])
        outcomes.append(PredictedOutcome(mean, np.hstack(slope), inverse_of(precision), precision))
        values.append(-np.concatenate([table.residual for table in tables]))
    return outcomes, values


def with_known(
    comparing: Comparing,
    fits: Sequence[Fitted],
    outcomes: Sequence[PredictedOutcome],
    sd: Mapping[int, Sequence[float]],
) -> list[PredictedOutcome]:
    """
    Return the same where a measurement shows some unknowns of the motion directly.

    Parameters
    ----------
    comparing
        Of the runs there are.
    fits
        Of the hypotheses.
    outcomes
        Of each hypothesis, by all its unknowns.
    sd
        By the number of an unknown in `motion`, one a run; 0: shows nothing.

    Returns
    -------
    list of PredictedOutcome
        With one row more for each unknown that is shown.
    """
    k, places, found = comparing.runs.coefficients, comparing.runs.places, []
    shown = [
        (place[k + unknown], each)
        for unknown, known in sd.items()
        for place, each in zip(places, known, strict=True)
        if each > 0.0
    ]
    at, known_sd = (np.array(column) for column in zip(*shown)) if shown else (np.arange(0),) * 2
    for fit, outcome in zip(fits, outcomes, strict=True):
        rows = np.zeros((len(fit.at), len(at)))
        rows[at, np.arange(len(at))] = 1.0 / known_sd
        mean = np.concatenate([outcome.mean, fit.at[at] / known_sd])
        found.append(replace(outcome, mean=mean, slope=np.hstack([outcome.slope, rows])))
    return found


def _of_old_runs(hypothesis: Explanation) -> Explanation:
    """Return a hypothesis whose effects of a single run stay in the first one."""
    ways = tuple(
        replace(way, run=0) if way.run is None and way.effect.scope is Scope.RUN else way
        for way in hypothesis.ways
    )
    return replace(hypothesis, ways=ways)


def probability_of_naming(
    settings: Sequence[Sequence[PredictedOutcome]],
    setting: Sequence[int],
    rivals: Sequence[Weighed],
    *,
    inseparable: Sequence[frozenset[str]],
) -> float:
    """
    Return how probably something is named after a measurement.

    Parameters
    ----------
    settings
        Predicted outcomes of all rivals, for each way in which the measurement may be
        read.
    setting
        The way it is read where each rival is the truth.
    rivals
        Each of other names.
    inseparable
        Effects that no record can separate.

    Returns
    -------
    float
        Averaged over the rivals by their probabilities; 300 draws of a fixed seed.
    """
    rng = np.random.default_rng(_SEED)
    names, probability = [each for each, _ in rivals], probabilities(rivals)
    share = np.cumsum([0.0, *(probability[each] for each in names)])
    counts = np.diff(np.round(_DRAWS * share).astype(int))
    drawn = [
        (way, settings[way][i].draw(counts[i], rng)) for i, way in enumerate(setting) if counts[i]
    ]
    named = 0
    for way in {way for way, _ in drawn}:
        seen = np.concatenate([each for own, each in drawn if own == way])
        after = [
            log_weight + one.log_density(seen)
            for (_, log_weight), one in zip(rivals, settings[way], strict=True)
        ]
        named += int(names_one(names, softmax(after, axis=0), inseparable).sum())
    return named / int(counts.sum())


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
class DiagnosedRuns(ComparedRuns):
    """
    Runs, with what else is known of them.

    Attributes
    ----------
    facts
        That are stated.
    earlier
        What earlier diagnoses say.
    """

    facts: Facts
    earlier: Carried

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


def advice(
    case: DiagnosedRuns, candidates: Sequence[Candidate], progress: Progress = silent
) -> tuple[Advice, ...]:
    """
    Return what would decide; first what is likely to cost the crew least.

    Parameters
    ----------
    case
    candidates
        That the runs cannot separate.
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
        (names, math.log(max(case.found.probability[names], 1e-300))) for names in case.rivals
    ]
    found: list[Advice] = []
    tried, held = (*_RUNS, *_INSTRUMENTS), _measured(case.seen)
    for done, measure in enumerate(tried):
        progress('trying what would decide', done, len(tried))
        if measure in held:
            continue
        settings, setting = _settings(measure, case)
        if settings and all(
            len(each.mean) and np.isfinite(each.slope).all() for way in settings for each in way
        ):
            named = probability_of_naming(settings, setting, rivals, inseparable=case.inseparable)
            found.append(Advice(measure.value, named, measure.cost))
    best = max((each.probability or 0.0 for each in found), default=0.0)
    promising = [each for each in found if (each.probability or 0.0) >= min(_HARDLY, best)]
    ranked = {each: each.probability or 0.0 for each in promising}
    for each in declared(candidates):
        measure = Measure(each.measure)
        if measure not in (*tried, *held):
            ranked[each] = _reach(measure, candidates, case.inseparable)
    for name, named in case.facts.naming(case.found, case.inseparable).items():
        if named >= _HARDLY:
            ranked[Advice(fact_advice(name), named, Cost.LOOK)] = named
    return _by_cost(ranked)


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
        {Advice(measure.value, None, measure.cost): vote for measure, vote in votes.items()}
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


def _measured(seen: Sequence[Observation]) -> set[Measure]:
    """Return what the runs hold already."""
    first, contexts = seen[0], [run.context for run in seen]
    turned = min(math.cos(run.heading_rad - first.heading_rad) for run in seen)
    faster = max(abs(run.speed_m_s / first.speed_m_s - 1.0) for run in seen)
    held = {
        Measure.RECIPROCAL_RUN: turned < -0.5,
        Measure.ANOTHER_COURSE: turned < 0.9,
        Measure.OTHER_SPEED: faster > 0.2,
        Measure.ANOTHER_RUN: len(seen) > 1,
        Measure.WIND: all(len(each.at_wind) for each in contexts),
        Measure.DEPTH: all(each.draught_m is not None for each in contexts),
        Measure.HEADING: all(len(each.at_yaw) for each in contexts),
        Measure.SHAFT: all(len(each.at_shaft) for each in contexts),
        Measure.LOG: any((run.rows.kind == LOG).any() for run in seen),
        Measure.RADAR: any((run.rows.kind != LOG).any() for run in seen),
    }
    return {measure for measure, is_held in held.items() if is_held}


def _settings(
    measure: Measure, case: DiagnosedRuns
) -> tuple[list[list[PredictedOutcome]], list[int]]:
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
    windows: Sequence[Window], case: DiagnosedRuns, fits: Sequence[Fitted]
) -> tuple[list[PredictedOutcome], list[Float64]]:
    """Return what rivals predict of an instrument in each run."""
    seen = []
    for run, window in zip(case.seen, windows, strict=True):
        context = Context.of(window, case.ship, run.time_s, run.context.stop)
        alone = replace(context, value=np.zeros(len(context)))
        seen.append(replace(run, context=alone))
    return of_instrument(case.comparing, fits, ship_runs(seen, case.ship).runs)


def _another(first: Observation, heading_rad: float, speed_m_s: float) -> Observation:
    """Return a run of the same rows and noise as the first one, whose values are 0."""
    context = first.context
    stop = replace(context.stop, heading_rad=heading_rad, speed_m_s=speed_m_s)
    return replace(
        first,
        heading_rad=heading_rad,
        speed_m_s=speed_m_s,
        rows=first.rows._replace(value=np.zeros(len(first.rows.value))),
        context=replace(context, stop=stop, value=np.zeros(len(context))),
    )


def _windows(measure: Measure, case: DiagnosedRuns, *, after: float = 0.0) -> list[Window]:
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
