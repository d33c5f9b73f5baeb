# SPDX-License-Identifier: Apache-2.0
"""How far model and data are apart, where, and what each run looks like."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.result import FORCE, Compared, Gap, RunTrace, Where
from shipdrag_ros.diagnosis.verdict import ComparedRuns
from shipdrag_ros.inference.decision import UNKNOWN
from shipdrag_ros.inference.linear import solve_scaled
from shipdrag_ros.inference.rows import CODES, LOG, POSITION
from shipdrag_ros.posterior.compare import ComparedHypotheses, Comparing, Fitted, RunResidual
from shipdrag_ros.posterior.hypotheses import IN_GROUND, IN_LOG, place_of
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.simulation.effects import find

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
    case: ComparedRuns,
    before: Fitted,
    after: Fitted,
    named: Collection[str],
    *,
    of_force: bool,
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
        Whether it is known to be in the force.

    Returns
    -------
    Where
        The ends hold 90 % of the excess over noise.
    """
    channel = FORCE if of_force else _falsified(named) or _channel(case.found)
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
