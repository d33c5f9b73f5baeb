# SPDX-License-Identifier: Apache-2.0
"""
Coastdowns diagnosed by the one posterior.

An adapter: observed runs become rows, a prior of the stop and their simulation; probabilities
become an answer with sizes, limits and gaps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from shipdrag_ros.diagnosis.facts import Facts
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.result import (
    FORCE,
    LOG_TRACK,
    Candidate,
    DiagnosisResult,
    EffectEstimate,
    Gap,
    Limit,
)
from shipdrag_ros.diagnosis.simulated import rows_of
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.inference.decision import NONE, UNKNOWN, Verdict, decide, mixture
from shipdrag_ros.inference.limits import quantile
from shipdrag_ros.inference.rows import LOG, POSITION, Rows
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.posterior.compare import ComparedHypotheses, Comparing, Fitted, RunResidual
from shipdrag_ros.posterior.hypotheses import RunSight, ShipRuns, SimulatedRows
from shipdrag_ros.posterior.problem import RunModel, StopPrior
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Action, Scenario, simulate_columns
from shipdrag_ros.simulation.effect import Frame
from shipdrag_ros.simulation.effects import LIBRARY, inseparable

_LOOKS, _NEAR_S = 3, 4.0  # at runs, and by which a stop may move without another
_SHARE = 0.95  # of a size, below its limit


def diagnose_one(
    observe: Callable[[Mapping[str, float]], tuple[tuple[Observation, ...], tuple[str, ...]]],
    ship: Ship,
    facts_of: Callable[[Sequence[Observation]], Facts],
) -> DiagnosisResult:
    """
    Name the effect that is missing in a ship's model, by the one posterior.

    Parameters
    ----------
    observe
        From by how much the stop of each run, by name, is later than it is taken for at first
        [s], to the runs and notes on them.
    ship
        With a baseline; the effects that its file states are part of the model.
    facts_of
        Of the log book about the runs.

    Raises
    ------
    DiagnosisError
        If the ship has no baseline.

    Notes
    -----
    Source: docs/model.md.
    """
    moved_s: dict[str, float] = {}
    for _ in range(_LOOKS):
        seen, notes = observe(moved_s)
        facts = facts_of(seen)
        found, comparing = compare(seen, ship, facts)
        likeliest = max(found.fitted, key=lambda fit: fit.log_weight)
        more_s = comparing.runs.stop_s(likeliest.at)
        if all(abs(by_s) <= _NEAR_S for by_s in more_s):
            break
        # effects are simulated from the stop as the run was seen
        for run, by_s in zip(seen, more_s, strict=True):
            moved_s[run.name] = moved_s.get(run.name, 0.0) + by_s
    return _result(seen, found, comparing, facts, notes)


def _result(
    seen: Sequence[Observation],
    found: ComparedHypotheses,
    comparing: Comparing,
    facts: Facts,
    notes: Sequence[str],
) -> DiagnosisResult:
    """Read the answer from what was compared."""
    decided = decide(found.probability, inseparable(found.effects))
    top = next(names for names in found.probability if names != UNKNOWN)
    both = any(len(set(run.along.rows.kind.tolist())) > 1 for run in seen)
    missing = bool(top) and decided.verdict in (Verdict.NAMED, Verdict.ONE_OF)
    return DiagnosisResult(
        verdict=decided.verdict,
        effects=tuple(_named(found, name, p) for name, p in sorted(decided.effects.items())),
        candidates=tuple(
            Candidate(names, p, () if names == UNKNOWN else _sized(found.best[names], p))
            for names, p in decided.candidates
        ),
        nothing=found.probability.get(NONE, 0.0),
        unnamed=found.probability.get(UNKNOWN, 0.0),
        would_decide=(),
        where=None,
        before=_gap(seen, comparing.residuals(comparing.as_stated)),
        after=_gap(seen, comparing.residuals(found.best[top])) if missing else None,
        held_out_before=None,
        held_out_after=None,
        baseline='stated',
        best=_sized(found.best[top], found.probability[top]),
        notes=tuple(notes),
        coastdowns_used=len(seen),
        examined=(FORCE, LOG_TRACK) if both else (FORCE,),
        facts=facts.weighed(found, [run.name for run in seen]),
        limits=_limits(found, comparing, frozenset(decided.effects)),
    )


def compare(
    seen: Sequence[Observation], ship: Ship, facts: Facts
) -> tuple[ComparedHypotheses, Comparing]:
    """
    Compare all hypotheses about some runs of a ship.

    Raises
    ------
    DiagnosisError
        If the ship has no baseline.
    """
    if ship.baseline is None:
        raise DiagnosisError(
            f'ship {ship.name!r} has no baseline to hold a run against; '
            'add `baseline` to its ship file, or learn one with `shipdrag baseline`'
        )
    effects = [effect for effect in LIBRARY.values() if not effect.missing(ship)]
    comparing = Comparing(_runs(seen, ship), ship, effects, facts.log_likelihood)
    return comparing.compare(), comparing


def _sized(fit: Fitted, probability: float) -> tuple[EffectEstimate, ...]:
    """Return the effects of a hypothesis with their sizes, by name."""
    found, place = [], 0
    assert fit.z is not None
    assert fit.sd is not None
    for way in fit.hypothesis.ways:
        values = {name: Parameter(value, 0.0) for name, value in way.fixed}
        for i, q in enumerate(way.unknowns, place):
            z, sd = float(fit.z[i]), float(fit.sd[i])
            values[q.name] = Parameter(q.prior.at(z), abs(q.prior.slope(z)) * sd)
        place += len(way.unknowns)
        if not way.stated:
            ordered = {q.name: values[q.name] for q in way.effect.parameters}
            found.append(EffectEstimate(way.effect.name, probability, ordered))
    return tuple(sorted(found, key=lambda effect: effect.name))


def _named(found: ComparedHypotheses, name: str, probability: float) -> EffectEstimate:
    """Return an effect with its sizes over all hypotheses that hold it."""
    holding = [
        (p, effect)
        for names, p in found.probability.items()
        if name in names and names != UNKNOWN
        for effect in _sized(found.best[names], p)
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


def _gap(seen: Sequence[Observation], residuals: Sequence[RunResidual]) -> Gap:
    """Return how far a hypothesis is from the runs."""
    speeds, places = [], []
    for run, residual in zip(seen, residuals, strict=True):
        kind, after = run.along.rows.kind, run.along.rows.time_s >= run.lead_in_s
        speeds.append(residual.along[after & (kind == LOG)])
        ahead = residual.along[after & (kind == POSITION)]
        if run.across is not None and len(ahead):
            to_port = residual.rest[: len(run.across)][run.across.rows.time_s >= run.lead_in_s]
            places.append(np.hypot(ahead, to_port))
    whole = np.concatenate([each.whitened for each in residuals])
    return Gap(_rms(speeds), _rms(places), float(np.mean(whole**2)))


def _rms(parts: Sequence[Float64]) -> float | None:
    whole = np.concatenate([*parts, np.empty(0)])
    return float(np.sqrt(np.mean(whole**2))) if len(whole) else None


def _limits(
    found: ComparedHypotheses, comparing: Comparing, named: frozenset[str]
) -> dict[str, Limit]:
    """Return the limit of each effect that is not named."""
    amounts = comparing.named_from(inseparable(found.effects))
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
            amounts.get(effect.name),
            comparing.percent_of_r(effect.name, bound),
        )
    return limits


def _runs(seen: Sequence[Observation], ship: Ship) -> ShipRuns:
    reference = seen[0].heading_rad
    top = max(run.speed_m_s for run in seen)
    low = min(_lowest(run) for run in seen)
    return ShipRuns(tuple(_sight(run, ship, reference, top, low) for run in seen))


def _lowest(run: Observation) -> float:
    """Return about the speed at the end."""
    speeds = [
        run.along.rows.value[run.along.rows.kind == kind][-5:]
        for kind in (0, 1)
        if (run.along.rows.kind == kind).any()
    ]
    if speeds:
        return max(float(np.median(speeds[0])), 0.05 * run.speed_m_s)
    return 0.3 * run.speed_m_s


def _sight(run: Observation, ship: Ship, reference_rad: float, top: float, low: float) -> RunSight:
    scenario = Scenario(
        speed_m_s=run.speed_m_s,
        lead_in_s=run.lead_in_s,
        # beyond the last row, whatever the difference is rounded to
        duration_s=run.duration_s + 1e-6,
        heading_rad=run.heading_rad,
    )
    frame = Frame(run.ship, scenario, reference_rad)
    along = run.along
    rows = Rows(along.rows.time_s - run.lead_in_s, along.rows.kind, along.rows.value)
    steady = int(np.searchsorted(along.rows.time_s, run.lead_in_s))
    stop = StopPrior(max(run.stop_sd_s, 1e-3), run.run_down_s, run.run_down_sd_s)
    model = RunModel.of(rows, along.variance, steady, ship, stop, speed_m_s=top, low_m_s=low)
    start = model.start.copy()
    start[model.coefficients] = run.speed_m_s
    model = replace(model, start=start, speed_m_s=run.speed_m_s)
    across = run.across
    value, blocks = [run.context.value], [run.context.whitener]
    if across is not None:
        value.insert(0, across.rows.value)
        blocks.insert(0, across.whitener)
    stated = ship.propulsion.run_down_s if ship.propulsion else 0.0
    return RunSight(
        model,
        frame,
        np.concatenate(value),
        np.asarray(block_diag(*blocks, np.zeros((0, 0))), np.float64),
        0 if across is None else len(across),
        run.heading_sd_rad,
        stated,
        ship.baseline.run_scatter if ship.baseline else 0.0,
        -run.stop_moved_s,
        _simulating(run, frame),
    )


def _simulating(
    run: Observation, frame: Frame
) -> Callable[[Sequence[Action], Float64], SimulatedRows]:
    def simulate(actions: Sequence[Action], speed_m_s: Float64) -> SimulatedRows:
        columns = simulate_columns(
            frame.ship, frame.scenario, actions, run.time_s, speed_m_s=speed_m_s
        )
        along, across, distance = rows_of(run, columns)
        context = run.context.predict(columns, actions)
        at = distance[:, :0] if run.across is None else distance[:, run.across.at]
        return SimulatedRows(along, np.hstack([across, context]), at)

    return simulate
