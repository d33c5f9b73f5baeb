# SPDX-License-Identifier: Apache-2.0
"""
Linear models with Gaussian priors under settings of the noise: evidence, solution, covariance.

All that is fitted, for a band, a name or the noise itself, is solved here; compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.gaussian import cholesky, products_of, substitute
from shipdrag_ros.inference.noise import Noise, whiten
from shipdrag_ros.inference.rows import Rows
from shipdrag_ros.inference.settings import Settings, noise_of
from shipdrag_ros.samples import Float64


class Families(NamedTuple):
    """
    Priors of the unknowns: means and precisions (f, p), and logarithms of probabilities (f,).

    Means count from where the model is linear.
    """

    mean: Float64
    precision: Float64
    log_chance: Float64


@compiled
def whitened_products(
    table: Float64, rows: Rows, white: Noise, steady: int, settings: Settings
) -> tuple[Float64, Float64]:
    """
    Return the products of lines (l, n) whitened under each setting.

    Parameters
    ----------
    table : (l, n)
        Residual and columns.
    rows, white, steady, settings
        See `noise_of`.

    Returns
    -------
    products, log_det : (s, l, l), (s,)
        With the logarithm of the determinant of the noise covariance.
    """
    s, lines = len(settings.weight), len(table)
    products, log_det = np.empty((s, lines, lines)), np.empty(s)
    for k in range(s):
        copy = table.copy()
        log_det[k] = whiten(rows, copy, noise_of(settings, k, rows, white, steady))
        products[k] = products_of(copy)
    return products, log_det


@compiled
def _posed(
    products: Float64, mean: Float64, precision: Float64
) -> tuple[bool, float, Float64, Float64, Float64]:
    """Return whether a model has a solution, part of its evidence, right side and factor."""
    p = len(mean)
    matrix, right = products[1:, 1:].copy(), products[1:, 0].copy()
    log_evidence = -0.5 * products[0, 0]
    for a in range(p):
        matrix[a, a] += precision[a]
        right[a] += precision[a] * mean[a]
        if precision[a] > 0.0:
            log_evidence += 0.5 * np.log(precision[a]) - 0.5 * precision[a] * mean[a] ** 2
    solved, lower, scale = cholesky(matrix)
    return solved, log_evidence, right, lower, scale


@compiled
def evidence_of(products: Float64, mean: Float64, precision: Float64) -> float:
    """
    Return the logarithm of the evidence of one linear model, as `of_family`, alone.

    Half of that work: noise is learnt by some hundred of these, and needs no solution.
    """
    solved, log_evidence, right, lower, scale = _posed(products, mean, precision)
    if not solved:
        return -np.inf
    for a in range(len(mean)):
        value = right[a] * scale[a]
        for b in range(a):
            value -= lower[a, b] * right[b]
        right[a] = value / lower[a, a]
        log_evidence += 0.5 * right[a] ** 2 - np.log(lower[a, a]) + np.log(scale[a])
    return float(log_evidence)


@compiled
def of_family(
    products: Float64, mean: Float64, precision: Float64
) -> tuple[float, Float64, Float64, Float64]:
    """
    Solve one linear model.

    Parameters
    ----------
    products : (1 + p, 1 + p)
        Of whitened residual and columns.
    mean, precision : (p,)
        Of the prior; a precision of 0: nothing is known.

    Returns
    -------
    log_evidence, step, lower, scale
        The logarithm is without -log det / 2 of the rows' covariance, -inf where the
        model has no solution.
    """
    solved, log_evidence, right, lower, scale = _posed(products, mean, precision)
    if not solved:
        return -np.inf, right, lower, scale
    step = substitute(lower, scale, right.reshape(-1, 1))[:, 0]
    for a in range(len(mean)):
        log_evidence += 0.5 * step[a] * right[a] - np.log(lower[a, a] / scale[a])
    return float(log_evidence) if np.isfinite(log_evidence) else -np.inf, step, lower, scale


@compiled
def solve(
    products: Float64, mean: Float64, precision: Float64, first: int, count: int
) -> tuple[Float64, Float64, Float64]:
    """
    Solve the linear models of all settings (s,) under all priors (f, p).

    Parameters
    ----------
    products : (s, 1 + p, 1 + p)
    mean, precision : (f, p)
    first, count
        Unknowns whose variances are returned.

    Returns
    -------
    log_evidence, step, variance : (s, f), (s, f, p), (s, f, count)
        As `of_family`.
    """
    s, f, p = len(products), len(mean), mean.shape[1]
    logs = np.full((s, f), -np.inf)
    steps, variances = np.zeros((s, f, p)), np.zeros((s, f, count))
    unit = np.zeros((p, count))
    for a in range(count):
        unit[first + a, a] = 1.0
    for k in range(s):
        for q in range(f):
            logs[k, q], step, lower, scale = of_family(products[k], mean[q], precision[q])
            if logs[k, q] == -np.inf:
                continue
            steps[k, q] = step
            if count:
                covariance = substitute(lower, scale, unit)
                for a in range(count):
                    variances[k, q, a] = covariance[first + a, a]
    return logs, steps, variances
