# SPDX-License-Identifier: Apache-2.0
"""
Linear models with Gaussian priors under settings of the noise: evidence, solution, covariance.

All that is fitted, for a band, a name or the noise itself, is solved here. All is compiled and
taken from no library, whose order of sums may depend on its threads.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.rows import Noise, Rows, Settings, noise_of, whiten
from shipdrag_ros.samples import Float64, Int64

_FOLLOWS = 1e-14  # of a scaled diagonal
_ROUNDING = 1e-6  # nats
# Sums may be taken in any order, so that they are vectorised; the order is
# fixed when compiled, not by the data or where they lie.
SUMS = {'reassoc', 'contract', 'nsz'}


@compiled('f8[:, ::1](f8[:, ::1])', fastmath=SUMS)
def products_of(table: Float64) -> Float64:
    """
    Return all products of two lines of a table; no library, whose threads may differ.

    Parameters
    ----------
    table : (c, n)
        Whitened residual and columns, for instance.

    Returns
    -------
    (c, c)
    """
    size, n = table.shape
    products = np.empty((size, size))
    for a in range(size):
        for b in range(a + 1):
            total = 0.0
            for i in range(n):
                total += table[a, i] * table[b, i]
            products[a, b] = products[b, a] = total
    return products


@compiled('b1(f8[:, ::1])')
def factor(matrix: Float64) -> bool:
    """
    Factor (n, n) in place, Cholesky, lower, row by row; False where it is not positive.
    """
    n = len(matrix)
    for i in range(n):
        for j in range(i):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = total / matrix[j, j]
        pivot = matrix[i, i]
        for k in range(i):
            pivot -= matrix[i, k] * matrix[i, k]
        if not pivot > 0.0:
            return False
        matrix[i, i] = math.sqrt(pivot)
    return True


@compiled
def cholesky(matrix: Float64) -> tuple[bool, Float64, Float64]:
    """
    Return the lower factor of M scaled to unit diagonal.

    Parameters
    ----------
    matrix : (p, p)
        Symmetric.

    Returns
    -------
    solved, lower, scale
        Whether M is positive, the factor (p, p), and the scale of each unknown (p,).
    """
    p = len(matrix)
    scale = np.empty(p)
    lower = np.zeros((p, p))
    for a in range(p):
        if not matrix[a, a] > 0.0:
            return False, lower, scale
        scale[a] = 1.0 / np.sqrt(matrix[a, a])
    for a in range(p):
        for b in range(a):
            lower[a, b] = matrix[a, b] * scale[a] * scale[b]
        lower[a, a] = 1.0
    solved = factor(lower)
    for a in range(p):
        # what is left of a column that follows from others is rounding
        solved = solved and lower[a, a] * lower[a, a] > _FOLLOWS
    return solved, lower, scale


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
def inverted(lower: Float64, scale: Float64) -> Float64:
    """
    Return the inverse of a matrix by its factor of `cholesky`.
    """
    p = len(lower)
    of_lower, inverse = np.zeros((p, p)), np.empty((p, p))
    for a in range(p):
        of_lower[a, a] = scale[a] / lower[a, a]
        for b in range(a):
            total = 0.0
            for c in range(b, a):
                total += lower[a, c] * of_lower[c, b]
            of_lower[a, b] = -total / lower[a, a]
    for a in range(p):
        for b in range(a + 1):
            total = 0.0
            for c in range(a, p):
                total += of_lower[c, a] * of_lower[c, b]
            inverse[a, b] = inverse[b, a] = total
    return inverse


def solve_scaled(matrix: Float64, right: Float64) -> Float64:
    """
    Solve for right sides (p,) or (p, k) of a positive matrix whose unknowns have many units.
    """
    scale = 1.0 / np.sqrt(np.diag(matrix))
    solved = np.linalg.solve(matrix * np.outer(scale, scale), (right.T * scale).T)
    result: Float64 = (solved.T * scale).T
    return result


def inverse_of(matrix: Float64) -> Float64:
    """Return the inverse of such a matrix."""
    scale = 1.0 / np.sqrt(np.diag(matrix))
    return np.linalg.inv(matrix * np.outer(scale, scale)) * np.outer(scale, scale)


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
def _evidence(products: Float64, mean: Float64, precision: Float64) -> float:
    """Return the logarithm of the evidence of one linear model, as `of_family`, alone."""
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
def evidences(products: Float64, mean: Float64, precision: Float64) -> Float64:
    """
    Return the logarithms of the evidence (s, f) of linear models, as `solve`, without solutions.

    Parameters
    ----------
    products : (s, 1 + p, 1 + p)
    mean, precision : (f, p)
        What has an infinite precision is 0, and costs nothing: noise is learnt by some hundred
        settings, under priors each of which leaves out most of the columns.
    """
    s, f = len(products), len(mean)
    logs = np.empty((s, f))
    for q in range(f):
        held = np.flatnonzero(precision[q] < np.inf)
        m, least = len(held), precision[q].min()
        part = np.empty((1 + m, 1 + m))
        for k in range(s):
            for a in range(1 + m):
                i = 1 + held[a - 1] if a else 0
                for b in range(1 + m):
                    part[a, b] = products[k, i, 1 + held[b - 1] if b else 0]
            logs[k, q] = _evidence(part, mean[q][held], precision[q][held])
            if logs[k, q] > _ROUNDING and least > 0.0:
                logs[k, q] = -np.inf
    return logs


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
def _eliminated(
    products: Float64, mean: Float64, precision: Float64, order: Int64, c: int
) -> tuple[bool, Float64, Float64, Float64, Float64]:
    """
    Return a linear model of its later unknowns alone, the first c in an order integrated out.

    Returns
    -------
    solved, products, across, lower, scale
        Products (1 + v, 1 + v) as `of_family` takes them; for the unknowns that are gone, the
        factor (c, c), and what it makes (c, 1 + v) of their products with residual and the rest.
    """
    v = len(order) - c
    left, matrix = np.empty((1 + v, 1 + v)), np.empty((c, c))
    across = np.empty((c, 1 + v))
    for a in range(1 + v):
        i = 1 + order[c + a - 1] if a else 0
        for b in range(a + 1):
            left[a, b] = products[i, 1 + order[c + b - 1] if b else 0]
    log_evidence = 0.0
    for a in range(c):
        i = order[a]
        for b in range(c):
            matrix[a, b] = products[1 + i, 1 + order[b]]
        matrix[a, a] += precision[i]
        across[a, 0] = products[1 + i, 0] + precision[i] * mean[i]
        for b in range(v):
            across[a, 1 + b] = products[1 + i, 1 + order[c + b]]
        if precision[i] > 0.0:
            log_evidence += 0.5 * (np.log(precision[i]) - precision[i] * mean[i] ** 2)
    solved, lower, scale = cholesky(matrix)
    if not solved:
        return False, left, across, lower, scale
    for a in range(c):
        for b in range(1 + v):
            total = across[a, b] * scale[a]
            for k in range(a):
                total -= lower[a, k] * across[k, b]
            across[a, b] = total / lower[a, a]
        log_evidence -= np.log(lower[a, a] / scale[a])
    for a in range(1 + v):
        for b in range(a + 1):
            total = left[a, b]
            for k in range(c):
                total -= across[k, a] * across[k, b]
            if a == b > 0 and total < _FOLLOWS * left[a, a]:
                total = 0.0  # what is left of a column that follows from others is rounding
            left[a, b] = left[b, a] = total
    left[0, 0] -= 2.0 * log_evidence
    return True, left, across, lower, scale


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
        As `of_family`; -inf also where nothing is left of the digits of the products.

    Notes
    -----
    Unknowns of which all priors say the same are eliminated once a setting.
    """
    s, f, p = len(products), len(mean), mean.shape[1]
    logs = np.full((s, f), -np.inf)
    steps, variances = np.zeros((s, f, p)), np.zeros((s, f, count))
    apart = np.zeros(p, np.bool_)
    apart[first : first + count] = True
    for a in range(p):
        for q in range(1, f):
            if mean[q, a] != mean[0, a] or precision[q, a] != precision[0, a]:
                apart[a] = True
    alike, late = np.flatnonzero(~apart), np.flatnonzero(apart)
    order, c = np.concatenate((alike, late)), len(alike)
    unit = np.zeros((p - c, count))
    for a in range(p - c):
        if first <= late[a] < first + count:
            unit[a, late[a] - first] = 1.0
    for k in range(s):
        solved, left, across, lower, scale = _eliminated(
            products[k], mean[0], precision[0], order, c
        )
        if not solved:
            continue
        for q in range(f):
            logs[k, q], step, mine, unscaled = of_family(left, mean[q][late], precision[q][late])
            if logs[k, q] > _ROUNDING and precision[q].min() > 0.0:
                logs[k, q] = -np.inf  # beyond what no residual at all would give: rounding
            if logs[k, q] == -np.inf:
                continue
            for a in range(c - 1, -1, -1):
                total = across[a, 0]
                for b in range(p - c):
                    total -= across[a, 1 + b] * step[b]
                for b in range(a + 1, c):
                    total -= lower[b, a] * steps[k, q, order[b]]
                steps[k, q, order[a]] = total / lower[a, a]
            for a in range(c):
                steps[k, q, order[a]] *= scale[a]
            for a in range(p - c):
                steps[k, q, late[a]] = step[a]
            if count:
                covariance = substitute(mine, unscaled, unit)
                for a in range(p - c):
                    if first <= late[a] < first + count:
                        variances[k, q, late[a] - first] = covariance[a, late[a] - first]
    return logs, steps, variances
