# SPDX-License-Identifier: Apache-2.0
"""
One rich law of r(v) fitted under several priors at once, and averaged; compiled.

One linearisation of the motion serves all priors: the law is solved under each,
weighed by its marginal likelihood, and the next linearisation is about the
average. The covariance is that of the mixture: what priors disagree about is in it.
"""

from __future__ import annotations

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.estimation.motion_fit.coast import Rows
from shipdrag_ros.estimation.motion_fit.families import Priors
from shipdrag_ros.estimation.motion_fit.law import Law
from shipdrag_ros.estimation.motion_fit.solve import cholesky, normal_equations, substitute
from shipdrag_ros.estimation.motion_fit.whitening import Noise
from shipdrag_ros.samples import Float64, Int64

_ROUNDS, _WHOLE_ROUNDS = 16, 3  # the later ones go half the way: a late onset may oscillate
_CLOSE, _NEAR = 0.03, 1.0  # of chi^2, between one average and the next; and at the end


@compiled
def _solve(
    mean: Float64,
    precision: Float64,
    now: Float64,
    chi2: float,
    matrix: Float64,
    gradient: Float64,
) -> tuple[float, Float64, Float64]:
    """
    Solve under one prior about some unknowns.

    Parameters
    ----------
    mean, precision, now : (p,)
        Prior and present value of the unknowns; a precision of 0: none.
    chi2, matrix, gradient
        See `normal_equations`.

    Returns
    -------
    criterion, step, covariance
        -2 ln of the marginal likelihood, less a constant; infinite where the
        samples do not tell the unknowns.
    """
    p = len(now)
    part = matrix.copy()
    right = np.zeros((p, p + 1))
    criterion = chi2
    for a in range(p):
        off = now[a] - mean[a]
        part[a, a] += precision[a]
        right[a, 0] = gradient[a] - precision[a] * off
        right[a, 1 + a] = 1.0
        criterion += precision[a] * off * off
        if precision[a] > 0.0:
            criterion -= np.log(precision[a])
    solved, lower, scale = cholesky(part, 0.0)
    if not solved:
        return np.inf, now, part
    found = substitute(lower, scale, right)
    for a in range(p):
        criterion += 2.0 * np.log(lower[a, a] / scale[a]) - right[a, 0] * found[a, 0]
    return criterion, found[:, 0].copy(), found[:, 1:].copy()


@compiled
def average(
    law: Law,
    start: Float64,
    grid_s: Float64,
    rows: Rows,
    noise: Noise,
    active: Int64,
    prior: Float64,
    priors: Priors,
) -> tuple[bool, Float64, Float64]:
    """
    Fit the law under all priors and average.

    Parameters
    ----------
    law
        Of k coefficients.
    active
        The k coefficients, then what else is fitted.
    prior
        See `normal_equations`; of what is not a coefficient.
    priors
        Of the coefficients.

    Returns
    -------
    converged, unknowns, covariance
    """
    unknowns = start.copy()
    size, p = len(unknowns), len(active)
    count, k = priors.precision.shape
    covariance = np.zeros((size, size))
    criteria = np.empty(count)
    steps = np.empty((count, p))
    spreads = np.empty((count, p, p))
    about, precision = np.zeros(p), np.zeros(p)
    mean = np.zeros(p)
    away = np.inf
    for number in range(_ROUNDS):
        chi2, matrix, gradient, _ = normal_equations(
            law, unknowns, grid_s, rows, noise, active, prior
        )
        now = unknowns[active]
        for f in range(count):
            about[:k], precision[:k] = priors.mean[f], priors.precision[f]
            criteria[f], steps[f], spreads[f] = _solve(
                about, precision, now, chi2, matrix, gradient
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
