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
from shipdrag_ros.estimation.ode_fit.families import Priors
from shipdrag_ros.estimation.ode_fit.law import Law
from shipdrag_ros.estimation.ode_fit.solve import normal_equations
from shipdrag_ros.inference.gaussian import average as mix
from shipdrag_ros.inference.noise import Noise
from shipdrag_ros.inference.rows import Rows
from shipdrag_ros.samples import Float64, Int64

_ROUNDS, _WHOLE_ROUNDS = 16, 3  # the later ones go half the way: a late onset may oscillate
# sd of what has no prior, over that by the samples alone: nothing is held
_VAGUE = 1e6
_CLOSE, _NEAR = 0.03, 1.0  # of chi^2, between one average and the next; and at the end


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
    of_active = np.empty((p, p))
    whole, sure = np.ones((1, p), np.bool_), np.ones(1)
    products = np.empty((p + 1, p))
    means, roots = np.empty((count, p)), np.zeros((count, p, p))
    away = np.inf
    for number in range(_ROUNDS):
        _, matrix, gradient, _ = normal_equations(
            law, unknowns, grid_s, rows, noise, active, prior
        )
        products[:p], products[p] = matrix, gradient
        now = unknowns[active]
        for f in range(count):
            for a in range(p):
                held = priors.precision[f, a] if a < k else 0.0
                if held > 0.0:
                    means[f, a], roots[f, a, a] = priors.mean[f, a], 1.0 / np.sqrt(held)
                else:
                    means[f, a], roots[f, a, a] = now[a], _VAGUE / np.sqrt(matrix[a, a])
        # written so that NaN fails
        if not np.isfinite(roots).all() or not np.isfinite(products).all():
            return False, unknowns, covariance
        found, of_active, _ = mix(products, now, whole, sure, means, roots)
        step = found - now
        away = 0.0
        part = 1.0 if number < _WHOLE_ROUNDS else 0.5
        for a in range(p):
            unknowns[active[a]] += part * step[a]
            for b in range(p):
                away += step[a] * matrix[a, b] * step[b]
        if away < _CLOSE:
            break
    for a in range(p):
        for b in range(p):
            covariance[active[a], active[b]] = of_active[a, b]
    return away < _NEAR, unknowns, covariance
