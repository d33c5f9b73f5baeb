# SPDX-License-Identifier: Apache-2.0
"""Compiled fit of one family of r(v): damped Gauss-Newton."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.estimation.ode_fit.coast import predict
from shipdrag_ros.estimation.ode_fit.law import Law
from shipdrag_ros.inference.gaussian import cholesky_solve, products_of
from shipdrag_ros.inference.noise import Noise, whiten
from shipdrag_ros.inference.rows import Rows
from shipdrag_ros.samples import Float64, Int64

_RISES = 8  # of the damping, in one iteration
_CONVERGED = 1e-3  # fall of chi^2: far below what separates laws
_LAST_FALL = 0.03  # of chi^2, by a step so small that what it leads to need not be computed


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
    chi2, matrix, gradient = whitened_equations(table, unknowns, rows, noise, active, prior)
    return chi2, matrix, gradient, table[0].copy()


@compiled
def whitened_equations(
    table: Float64, unknowns: Float64, rows: Rows, noise: Noise, active: Int64, prior: Float64
) -> tuple[float, Float64, Float64]:
    """
    Whiten residual and columns, in place, and return their normal equations.

    Parameters
    ----------
    table : (1 + p, n)
        From `predict`.

    Returns
    -------
    chi2, matrix, gradient
        As `normal_equations`.
    """
    p = len(active)
    whiten(rows, table, noise)
    # of residual and columns
    products = products_of(table)
    matrix = products[1:, 1:].copy()
    gradient = products[1:, 0].copy()
    chi2 = products[0, 0]
    for a in range(p):
        u = active[a]
        off = prior[0, u] - unknowns[u]
        chi2 += prior[1, u] * off * off
        matrix[a, a] += prior[1, u]
        gradient[a] += prior[1, u] * off
    return chi2, matrix, gradient


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
