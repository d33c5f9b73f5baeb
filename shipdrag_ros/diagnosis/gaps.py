# SPDX-License-Identifier: Apache-2.0
"""How far model and data are apart, where, and what each run looks like."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shipdrag_ros.diagnosis.coast import CoastModel
from shipdrag_ros.diagnosis.coast_terms import RunNuisance
from shipdrag_ros.diagnosis.fitting import Fit, fit
from shipdrag_ros.diagnosis.measured import Measured
from shipdrag_ros.diagnosis.model import Hypothesis, Linear, start
from shipdrag_ros.diagnosis.result import Compared, Gap, RunTrace, Where
from shipdrag_ros.diagnosis.terms import EffectTerm
from shipdrag_ros.inference.rows import CODES, LOG, POSITION
from shipdrag_ros.samples import Float64

_PARTS = 12  # of a coastdown, to say where a gap is
_SHARE = 0.9  # of the excess, between the ends of where it is
_EVEN_NATS = 3.0  # of evidence by which two channels are not separated
_ROUNDS = 3
_ACROSS = 'position_across'


def gap_of(model: CoastModel, linear: Linear) -> Gap:
    """
    Return how far a fitted model is from the runs.

    Parameters
    ----------
    model
        The runs, and what they are held against.
    linear
        Of a hypothesis at its best fit.

    Returns
    -------
    Gap
        RMS over the coastdowns; chi^2 over all rows.
    """
    speeds, places = [], []
    for seen, residual in zip(model.seen, linear.residuals, strict=True):
        n = len(seen.along)
        along, kind = residual[:n], seen.along.rows.kind
        coasting = seen.along.rows.time_s >= seen.lead_in_s
        speeds.append(along[coasting & (kind == LOG)])
        ahead = along[coasting & (kind == POSITION)]
        if seen.across is not None and len(ahead):
            across = residual[n : n + len(seen.across)][seen.across.rows.time_s >= seen.lead_in_s]
            places.append(np.hypot(ahead, across))
    return Gap(_rms(speeds), _rms(places), linear.chi2 / linear.rows)


def _rms(parts: Sequence[Float64]) -> float | None:
    whole = np.concatenate([*parts, np.empty(0)])
    return float(np.sqrt(np.mean(whole**2))) if len(whole) else None


def frozen(model: CoastModel) -> Fit:
    """
    Fit where and how fast the runs began, the ship being as its file states it.

    Parameters
    ----------
    model
        The runs, and what they are held against.

    Returns
    -------
    Fit
        In which the per-run nuisance parameters alone are free.
    """
    nothing = model.nothing
    places = tuple(
        replace(term, scatter=0.0, fall_sd=0.0) if isinstance(term, RunNuisance) else term
        for term in nothing.measurement_terms
    )
    as_stated = replace(nothing, terms=nothing.terms[1:], measurement_terms=places)
    return fit(model, [as_stated], [start(model, as_stated)])[0]


def held_out(model: CoastModel, found: Fit | None) -> Gap | None:
    """
    Predict each run from the others, and show how far off that is.

    Parameters
    ----------
    model
        The runs, and what they are held against.
    found
        With the effect; None: the ship as its file states it.

    Returns
    -------
    Gap or None
        None with one run, and where all have an effect of their own.

    Notes
    -----
    What the other runs do not show is allowed for: chi^2 is of residuals whose
    covariance holds that of the prediction. A run with an effect that is its own
    cannot be predicted; None where that is so of all.
    """
    if len(model.seen) < 2:
        return None
    gaps, rows = [], []
    for j, run in enumerate(model.seen):
        alone = replace(model, seen=(run,))
        if found is None:
            linear = frozen(alone).best
        elif _has_its_own(found.hypothesis, j):
            continue
        else:
            linear = predicted(model, j, found)
        gaps.append(gap_of(alone, linear))
        rows.append(linear.rows)
    if not gaps:
        return None
    return Gap(
        _mean_square([gap.rms_speed_m_s for gap in gaps]),
        _mean_square([gap.rms_position_m for gap in gaps]),
        float(np.average([gap.chi2_per_sample for gap in gaps], weights=rows)),
    )


def _has_its_own(hypothesis: Hypothesis, run: int) -> bool:
    """Say whether an effect acts in a run that says nothing of the others."""
    return any(
        (term.of_single_run or term.sizes > 1) and term.acts_in(run)
        for term in hypothesis.terms
        if isinstance(term, EffectTerm)
    )


def _mean_square(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.sqrt(np.mean(np.square(known)))) if known else None


def predicted(model: CoastModel, run: int, found: Fit) -> Linear:
    """
    Predict a run, learning from the others what belongs to it too.

    Parameters
    ----------
    model
        The runs, and what they are held against.
    run
        Its place among them.
    found
        Fit of all runs, whose hypothesis is taken.

    Returns
    -------
    Linear
        Of the run alone, at its most probable nuisance parameters. The posterior of
        the other runs is the prior of what is shared, and counts its own prior once.
    """
    rest = [i for i in range(len(model.seen)) if i != run]
    others = replace(model, seen=tuple(model.seen[i] for i in rest))
    alone = replace(model, seen=(model.seen[run],))
    there = others.transferred(found.hypothesis, runs=rest)
    learnt = fit(others, [there], [start(others, there)])[0]
    here = alone.transferred(found.hypothesis, runs=[run])
    shared = sum(len(term.unknowns) for term in here.terms)
    z = start(alone, here)
    z[:shared] = learnt.best.z[:shared]
    mean = z[:shared].copy()
    precision = np.linalg.pinv(learnt.covariance[:shared, :shared], hermitian=True)
    linear = alone.linearise([here], [z])[0]
    for _ in range(_ROUNDS):
        if not np.isfinite(linear.cost):
            break
        matrix, negative_gradient = linear.normal_equations
        for i, unknown in enumerate(here.unknowns[:shared]):
            matrix[i, i] -= unknown.prior.weight(linear.z[i])
            negative_gradient[i] += unknown.prior.weight(linear.z[i]) * linear.z[i]
        matrix[:shared, :shared] += precision
        negative_gradient[:shared] -= precision @ (linear.z[:shared] - mean)
        step = np.linalg.lstsq(matrix, negative_gradient, rcond=1e-13)[0]
        linear = alone.linearise([here], [linear.z + step])[0]
    return linear


def where(model: CoastModel, as_stated: Fit, unnamed: Sequence[Fit]) -> Where:
    """
    Return in which channel, and when, model and data disagree.

    Parameters
    ----------
    model
        The runs, and what they are held against.
    as_stated
        From `frozen`.
    unnamed
        Fits with a smooth discrepancy each.

    Returns
    -------
    Where
        The ends hold 90 % of the excess over noise.
    """
    best = max(unnamed, key=lambda fit: fit.log_likelihood)
    channel = best.hypothesis.discrepancy
    near = {
        fit.hypothesis.discrepancy
        for fit in unnamed
        if fit.log_likelihood > best.log_likelihood - _EVEN_NATS
    }
    if {'log', 'radar'} <= near:
        channel = 'log_radar'
    times, speeds = [], []
    for j, seen in enumerate(model.seen):
        excess = np.zeros(_PARTS)
        white = as_stated.best.tables[j][0]
        after = (seen.along.rows.time_s - seen.lead_in_s) / seen.duration_s
        part = np.clip((after * _PARTS).astype(int), 0, _PARTS - 1)
        rows = np.flatnonzero(after >= 0.0)
        np.add.at(excess, part[rows], white[rows] ** 2 - 1.0)
        share = np.cumsum(np.maximum(excess, 0.0))
        if share[-1] <= 0.0:
            continue
        share /= share[-1]
        first = int(np.searchsorted(share, 0.5 * (1.0 - _SHARE)))
        last = int(np.searchsorted(share, 0.5 * (1.0 + _SHARE)))
        ends = np.array([first, last + 1]) / _PARTS * seen.duration_s
        speed = model.predict(j, as_stated.best).speed
        times.append(ends)
        speeds.append(np.interp(ends + seen.lead_in_s, seen.time_s, speed))
    if not times:
        whole = max(seen.duration_s for seen in model.seen)
        return Where(channel, (0.0, whole), (0.0, max(s.speed_m_s for s in model.seen)))
    return Where(
        channel,
        (float(np.min(times)), float(np.max(times))),
        (float(np.min(speeds)), float(np.max(speeds))),
    )


def traces(model: CoastModel, before: Linear, after: Linear) -> tuple[RunTrace, ...]:
    """
    Return each run as it was measured and as two models have it.

    Parameters
    ----------
    model
        The runs, and what they are held against.
    before, after
        Two hypotheses at their best fit.

    Returns
    -------
    tuple of Trace
        One a run.
    """
    return tuple(_trace(model, j, before, after) for j in range(len(model.seen)))


def _trace(model: CoastModel, run: int, before: Linear, after: Linear) -> RunTrace:
    seen = model.seen[run]
    speed = model.predict(run, after).speed
    n = len(seen.along)
    blocks: list[tuple[str, Measured, slice]] = [(name, seen.along, slice(0, n)) for name in CODES]
    if seen.across is not None:
        blocks.append((_ACROSS, seen.across, slice(n, n + len(seen.across))))
    found = []
    for quantity, block, part in blocks:
        own = np.ones(len(block), bool)
        if quantity in CODES:
            own = block.rows.kind == CODES[quantity]
        if not own.any():
            continue
        measured = block.rows.value[own]
        noise = np.linalg.inv(block.whitener)
        found.append(
            Compared(
                quantity,
                block.rows.time_s[own] - seen.lead_in_s,
                speed[block.at[own]],
                measured,
                measured - before.residuals[run][part][own],
                measured - after.residuals[run][part][own],
                np.sqrt(np.sum(noise[own] ** 2, axis=1)),
                before.tables[run][0, part][own],
                after.tables[run][0, part][own],
            )
        )
    return RunTrace(seen.name, seen.lead_in_s, tuple(found))
