# SPDX-License-Identifier: Apache-2.0
"""
One rich law of r(v) fitted under several priors at once, and averaged; compiled.

One linearisation of the motion serves all priors: the law is solved under each,
weighed by its marginal likelihood, and the next linearisation is about the
average. The covariance is that of the mixture: what priors disagree about is in it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.estimation.ode_fit.coast import predict
from shipdrag_ros.estimation.ode_fit.families import Priors
from shipdrag_ros.estimation.ode_fit.law import Law
from shipdrag_ros.estimation.ode_fit.solve import whitened_equations
from shipdrag_ros.inference.averaging import average as mix
from shipdrag_ros.inference.noise import Noise
from shipdrag_ros.inference.rows import Rows
from shipdrag_ros.inference.settings import Settings, noise_of
from shipdrag_ros.samples import Float64, Int64

# Rounds that go the whole way, half of it, and a fifth: stop, thrust and lag may oscillate.
_WHOLE_ROUNDS, _HALF_ROUNDS, _ROUNDS = 3, 16, 40
# sd of what has no prior, over that by the samples alone: nothing is held
_VAGUE = 1e6
_CLOSE, _NEAR = 0.03, 1.0  # of chi^2, between one average and the next; and at the end


class Disturbed(NamedTuple):
    """
    Rows and what is known of their noise.

    Attributes
    ----------
    rows
    white
        Noise of the sensors, and how the hull damps.
    settings
        Of the slow noise.
    steady
        How many of the rows are before the stop.
    """

    rows: Rows
    white: Noise
    settings: Settings
    steady: int


@compiled
def average(
    law: Law,
    start: Float64,
    grid_s: Float64,
    record: Disturbed,
    active: Int64,
    prior: Float64,
    priors: Priors,
) -> tuple[bool, Float64, Float64]:
    """
    Fit the law under all priors and settings of the noise, and average.

    Parameters
    ----------
    law
        Of k coefficients.
    record
        With the settings that are averaged over.
    active
        The k coefficients, then what else is fitted.
    prior
        See `normal_equations`; of what is not a coefficient.
    priors
        Of the coefficients.

    Returns
    -------
    converged, unknowns, covariance
        Within priors and settings and between them.
    """
    unknowns = start.copy()
    size, p = len(unknowns), len(active)
    count, k = priors.precision.shape
    covariance = np.zeros((size, size))
    whole, sure = np.ones((1, p), np.bool_), np.ones(1)
    products, of_active = np.empty((p + 1, p)), np.empty((p, p))
    means, roots = np.empty((count, p)), np.zeros((count, p, p))
    weight = record.settings.weight
    away = np.inf
    for number in range(_ROUNDS):
        table, _ = predict(law, unknowns, grid_s, record.rows, active)
        now = unknowns[active]
        step, second, information = np.zeros(p), np.zeros((p, p)), np.zeros((p, p))
        total = 0.0
        for which in range(len(weight)):
            noise = noise_of(record.settings, which, record.rows, record.white, record.steady)
            _, matrix, gradient = whitened_equations(
                table.copy(), unknowns, record.rows, noise, active, prior
            )
            products[:p], products[p] = matrix, gradient
            for f in range(count):
                for a in range(p):
                    held = priors.precision[f, a] if a < k else 0.0
                    if held > 0.0:
                        means[f, a], roots[f, a, a] = priors.mean[f, a], 1.0 / np.sqrt(held)
                    else:
                        # infinite where no row shows it
                        shown = np.sqrt(matrix[a, a])
                        means[f, a] = now[a]
                        roots[f, a, a] = _VAGUE / shown if shown > 0.0 else np.inf
            # written so that NaN fails: such a setting is left out
            if not np.isfinite(roots).all() or not np.isfinite(products).all():
                continue
            found, of_active, _ = mix(products, now, whole, sure, means, roots)
            total += weight[which]
            for a in range(p):
                step[a] += weight[which] * (found[a] - now[a])
                for b in range(p):
                    information[a, b] += weight[which] * matrix[a, b]
                    second[a, b] += weight[which] * (
                        of_active[a, b] + (found[a] - now[a]) * (found[b] - now[b])
                    )
        if not total > 0.0:
            return False, unknowns, covariance
        step /= total
        away = 0.0
        part = 1.0 if number < _WHOLE_ROUNDS else 0.5 if number < _HALF_ROUNDS else 0.2
        for a in range(p):
            unknowns[active[a]] += part * step[a]
            for b in range(p):
                away += step[a] * information[a, b] / total * step[b]
                covariance[active[a], active[b]] = second[a, b] / total - step[a] * step[b]
        # so far or never: the small steps are for what still oscillates
        if away < _CLOSE or (away < _NEAR and number == _HALF_ROUNDS - 1):
            break
    return away < _NEAR, unknowns, covariance
