# SPDX-License-Identifier: Apache-2.0
"""
All families of r(v) fitted at once, and averaged; compiled.

Every family is a choice among the coefficients of one rich law, so one
linearisation of the motion serves them all: each is solved in it, weighed by
AICc, and the next linearisation is about the average. The covariance is that of
the mixture: what families disagree about is in it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from shipdrag_ros.estimation.motion_fit.coast import Rows
from shipdrag_ros.estimation.motion_fit.families import Families
from shipdrag_ros.estimation.motion_fit.law import Law
from shipdrag_ros.estimation.motion_fit.solve import cholesky_solve, normal_equations
from shipdrag_ros.estimation.motion_fit.whitening import Noise
from shipdrag_ros.samples import Float64, Int64

_ROUNDS, _WHOLE_ROUNDS = 16, 3  # the later ones go half the way: a late onset may oscillate
_CLOSE, _NEAR = 0.03, 1.0  # of chi^2, between one average and the next; and at the end


@njit(cache=True)
def _solve(
    kept: np.ndarray,
    precision: Float64,
    now: Float64,
    chi2: float,
    matrix: Float64,
    gradient: Float64,
    samples: int,
) -> tuple[float, Float64, Float64]:
    """
    Solve one family about some unknowns.

    Parameters
    ----------
    kept, precision, now : (p,)
        Which unknowns are fitted, the others are 0; prior about 0.
    chi2, matrix, gradient
        See `normal_equations`.

    Returns
    -------
    criterion, step, covariance
        AICc; infinite where the samples do not tell the unknowns.
    """
    p = len(now)
    step = np.where(kept, 0.0, -now)
    covariance = np.zeros((p, p))
    inside = np.flatnonzero(kept)
    q = len(inside)
    part = np.empty((q, q))
    right = np.zeros((q, q + 1))
    # what is left out goes first: to chi^2 and gradient without it
    for a in range(p):
        if not kept[a]:
            chi2 -= 2.0 * step[a] * gradient[a]
            for b in range(p):
                if not kept[b]:
                    chi2 += step[a] * matrix[a, b] * step[b]
    for i in range(q):
        a = inside[i]
        slope = gradient[a] - precision[a] * now[a]
        for b in range(p):
            if not kept[b]:
                slope -= matrix[a, b] * step[b]
        for j in range(q):
            part[i, j] = matrix[a, inside[j]]
        part[i, i] += precision[a]
        right[i, 0] = slope
        right[i, 1 + i] = 1.0
    solved, found = cholesky_solve(part, right, 0.0)
    if not solved:
        return np.inf, step, covariance
    parameters = 0.0
    for i in range(q):
        a = inside[i]
        step[a] = found[i, 0]
        # of chi^2 with the prior; then what the prior has of it
        before, after = now[a], now[a] + step[a]
        chi2 += precision[a] * (before * before - after * after) - right[i, 0] * found[i, 0]
        # what the samples tell of it: one less what the prior knows
        parameters += 1.0 - precision[a] * found[i, 1 + i]
        for j in range(q):
            covariance[a, inside[j]] = found[i, 1 + j]
    spare = max(samples - parameters - 1.0, 1.0)
    return chi2 + 2.0 * parameters * samples / spare, step, covariance


@njit(cache=True)
def average(
    law: Law,
    start: Float64,
    grid_s: Float64,
    rows: Rows,
    noise: Noise,
    active: Int64,
    prior: Float64,
    families: Families,
    samples: int,
) -> tuple[bool, Float64, Float64]:
    """
    Fit all families and average them.

    Parameters
    ----------
    law
        With all coefficients of all families.
    active
        The k coefficients, then what else is fitted.
    prior
        See `normal_equations`; of what is not a coefficient.
    samples
        For AICc.

    Returns
    -------
    converged, unknowns, covariance
    """
    unknowns = start.copy()
    size, p = len(unknowns), len(active)
    count, k = families.included.shape
    covariance = np.zeros((size, size))
    criteria = np.empty(count)
    steps = np.empty((count, p))
    spreads = np.empty((count, p, p))
    kept = np.ones(p, np.bool_)
    precision = np.zeros(p)
    mean = np.zeros(p)
    away = np.inf
    for number in range(_ROUNDS):
        chi2, matrix, gradient, _ = normal_equations(
            law, unknowns, grid_s, rows, noise, active, prior
        )
        now = unknowns[active]
        for f in range(count):
            kept[:k] = families.included[f]
            precision[:k] = families.precision[f]
            criteria[f], steps[f], spreads[f] = _solve(
                kept, precision, now, chi2, matrix, gradient, samples
            )
        least = criteria.min()
        # written so that NaN fails
        if not least < np.inf:
            return False, unknowns, covariance
        weights = np.exp(-0.5 * (criteria - least))
        weights /= weights.sum()
        mean[:] = 0.0
        for f in range(count):
            mean += weights[f] * steps[f]
        away = 0.0
        part = 1.0 if number < _WHOLE_ROUNDS else 0.5
        for a in range(p):
            unknowns[active[a]] += part * mean[a]
            for b in range(p):
                away += mean[a] * matrix[a, b] * mean[b]
        if away < _CLOSE:
            break
    for f in range(count):
        for a in range(p):
            for b in range(p):
                between = (steps[f, a] - mean[a]) * (steps[f, b] - mean[b])
                covariance[active[a], active[b]] += weights[f] * (spreads[f, a, b] + between)
    return away < _NEAR, unknowns, covariance
