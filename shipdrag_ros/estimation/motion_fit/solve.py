# SPDX-License-Identifier: Apache-2.0
"""Compiled fit of one family of r(v): damped Gauss-Newton."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.estimation.motion_fit.coast import Rows, predict
from shipdrag_ros.estimation.motion_fit.law import Law
from shipdrag_ros.estimation.motion_fit.whitening import Noise, whiten
from shipdrag_ros.samples import Float64, Int64

_RISES = 8  # of the damping, in one iteration
_CONVERGED = 1e-3  # fall of chi^2: far below what tells laws apart
_LAST_FALL = 0.03  # of chi^2, by a step so small that what it leads to need not be computed


@compiled(fastmath={'reassoc', 'contract'})
def _products(table: Float64) -> Float64:
    """Return all products of two lines of a table; no library, whose threads may differ."""
    size, n = table.shape
    products = np.empty((size, size))
    for a in range(size):
        for b in range(a + 1):
            total = 0.0
            for i in range(n):
                total += table[a, i] * table[b, i]
            products[a, b] = products[b, a] = total
    return products


@compiled
def normal_equations(
    law: Law,
    unknowns: Float64,
    grid_s: Float64,
    rows: Rows,
    noise: Noise,
    active: Int64,
    prior: Float64,
) -> tuple[float, Float64, Float64, Float64]:
    """
    Linearise the whitened rows about some unknowns.

    Parameters
    ----------
    prior : (2, K)
        Mean and precision of each unknown; a precision of 0: none.

    Returns
    -------
    chi2
        Sum of the squared whitened residuals and of the prior.
    matrix, gradient : (p, p), (p,)
        Of the active unknowns.
    white : (n,)
        Whitened residuals.
    """
    table, _ = predict(law, unknowns, grid_s, rows, active)
    p = len(active)
    whiten(rows, table, noise)
    # of residual and columns
    products = _products(table)
    matrix = products[1:, 1:].copy()
    gradient = products[1:, 0].copy()
    chi2 = products[0, 0]
    for a in range(p):
        u = active[a]
        off = prior[0, u] - unknowns[u]
        chi2 += prior[1, u] * off * off
        matrix[a, a] += prior[1, u]
        gradient[a] += prior[1, u] * off
    return chi2, matrix, gradient, table[0].copy()


@compiled
def cholesky(matrix: Float64, damping: float) -> tuple[bool, Float64, Float64]:
    """
    Return the lower factor of M + damping diag M, M scaled to unit diagonal.

    Returns
    -------
    solved, lower, scale
        The scale of each unknown.
    """
    p = len(matrix)
    scale = np.empty(p)
    lower = np.zeros((p, p))
    for a in range(p):
        if not matrix[a, a] > 0.0:
            return False, lower, scale
        scale[a] = 1.0 / np.sqrt(matrix[a, a])
    for a in range(p):
        for b in range(a + 1):
            total = matrix[a, b] * scale[a] * scale[b]
            if a == b:
                total = 1.0 + damping
            for c in range(b):
                total -= lower[a, c] * lower[b, c]
            if a == b:
                if not total > 1e-14:
                    return False, lower, scale
                lower[a, a] = np.sqrt(total)
            else:
                lower[a, b] = total / lower[b, b]
    return True, lower, scale


@compiled
def cholesky_solve(matrix: Float64, right: Float64, damping: float) -> tuple[bool, Float64]:
    """
    Solve (M + damping diag M) x = b for columns of b, M scaled to unit diagonal.
    """
    solved, lower, scale = cholesky(matrix, damping)
    if not solved:
        return False, right
    return True, substitute(lower, scale, right)


@compiled
def substitute(lower: Float64, scale: Float64, right: Float64) -> Float64:
    """
    Solve for columns of b with a factor of `cholesky`.
    """
    p = len(lower)
    x = right.copy()
    for j in range(right.shape[1]):
        for a in range(p):
            total = x[a, j] * scale[a]
            for c in range(a):
                total -= lower[a, c] * x[c, j]
            x[a, j] = total / lower[a, a]
        for a in range(p - 1, -1, -1):
            total = x[a, j]
            for c in range(a + 1, p):
                total -= lower[c, a] * x[c, j]
            x[a, j] = total / lower[a, a]
        for a in range(p):
            x[a, j] *= scale[a]
    return x


@compiled
def fit(
    law: Law,
    start: Float64,
    grid_s: Float64,
    rows: Rows,
    noise: Noise,
    active: Int64,
    prior: Float64,
    iterations: int,
) -> tuple[bool, float, Float64, Float64, Float64]:
    """
    Minimise chi^2 over the active unknowns.

    Returns
    -------
    converged, chi2, unknowns, covariance, white
        The covariance (K, K) is 0 but for the active unknowns.
    """
    unknowns = start.copy()
    chi2, matrix, gradient, white = normal_equations(
        law, unknowns, grid_s, rows, noise, active, prior
    )
    damping = 0.0
    converged = False
    idle = 0
    for _ in range(iterations):
        better = False
        if damping == 0.0:
            solved, step = cholesky_solve(matrix, gradient.reshape(-1, 1), 0.0)
            fall = np.sum(step[:, 0] * gradient)
            if solved and fall < _LAST_FALL:
                for a in range(len(active)):
                    unknowns[active[a]] += step[a, 0]
                chi2 -= fall
                converged = True
                break
        for _ in range(_RISES):
            solved, step = cholesky_solve(matrix, gradient.reshape(-1, 1), damping)
            if solved:
                trial = unknowns.copy()
                for a in range(len(active)):
                    trial[active[a]] += step[a, 0]
                found = normal_equations(law, trial, grid_s, rows, noise, active, prior)
                # written so that NaN fails
                if found[0] <= chi2 + 0.1 * _CONVERGED:
                    better = True
                    break
            damping = max(10.0 * damping, 1e-3)
        if not better:
            # no step helps: as low as rounding, or samples at a kink, allow
            converged = True
            break
        fall = chi2 - found[0]
        unknowns = trial
        chi2, matrix, gradient, white = found
        damping = 0.1 * damping if damping > 1e-4 else 0.0
        # a small fall may be the damping's doing; two of them are not
        idle = idle + 1 if abs(fall) < _CONVERGED else 0
        if idle == 2:
            converged = True
            break
    solved, of_active = cholesky_solve(matrix, np.eye(len(active)), 0.0)
    covariance = np.zeros((len(unknowns), len(unknowns)))
    for a in range(len(active)):
        for b in range(len(active)):
            covariance[active[a], active[b]] = of_active[a, b]
    return converged and solved, chi2, unknowns, covariance, white
