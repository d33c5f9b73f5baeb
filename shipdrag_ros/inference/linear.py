# SPDX-License-Identifier: Apache-2.0
"""
Linear models with Gaussian priors under settings of the noise: evidence, solution, covariance.

All that is fitted, for a band, a name or the noise itself, is solved here. All is compiled and
taken from no library, whose order of sums may depend on its threads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.rows import Noise, Rows, Settings, noise_of, whiten
from shipdrag_ros.samples import Float64, Int64

_FOLLOWS = 1e-14  # of a scaled diagonal
_ROUNDING = 1e-6  # nats
ALONE = np.ones((1, 1), np.bool_)
"""`wanted` of one model."""

# Sums may be taken in any order, so that they are vectorised; the order is
# fixed when compiled, and by where a line begins, not by where the data lie.
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
    products, begins = np.empty((size, size)), np.zeros(size, np.int64)
    for a in range(size):
        while begins[a] < n and table[a, begins[a]] == 0.0:
            begins[a] += 1
        for b in range(a + 1):
            since, total = max(begins[a], begins[b]), 0.0
            one, other = table[a, since:], table[b, since:]
            for i in range(len(one)):
                total += one[i] * other[i]
            products[a, b] = products[b, a] = total
    return products


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


class _Elimination(NamedTuple):
    """
    Unknowns of linear models, which go one after another, the last first.

    Attributes
    ----------
    order : (p,)
        Last those of which all priors say the same, before them those in which a prior seldom
        differs from the one before.
    since : (f,)
        How many of them, from the first on, hold all in which a prior differs from that one.
    left : (1 + d, 1 + p, 1 + p)
        Products, the lower half, of the residual and the unknowns that are left, by their
        number; d of them have no prior that all share.
    row, pivot : (p, p), (p,)
        What an unknown is, by the residual and those that are left when it goes.
    log_evidence : (1 + p,)
        Less what is left of the residual.
    """

    order: Int64
    since: Int64
    left: Float64
    row: Float64
    pivot: Float64
    log_evidence: Float64


@compiled
def _ordered(mean: Float64, precision: Float64, first: int, count: int) -> _Elimination:
    """Prepare the families (f, p), some unknowns of which go last."""
    f, p = mean.shape
    differs = np.zeros((p, f), np.bool_)
    for a in range(p):
        for q in range(1, f):
            same = mean[q, a] == mean[q - 1, a] and precision[q, a] == precision[q - 1, a]
            differs[a, q] = not same
    often = differs.sum(axis=1)
    if count < p:
        often[first : first + count] += f
    order = np.argsort(-often, kind='mergesort')
    since = np.zeros(f, np.int64)
    for a in range(p):
        for q in range(1, f):
            if differs[order[a], q]:
                since[q] = a + 1
    left = np.empty((1 + np.count_nonzero(often), 1 + p, 1 + p))
    return _Elimination(order, since, left, np.empty((p, p)), np.empty(p), np.zeros(1 + p))


@compiled
def _begin(models: _Elimination, products: Float64) -> int:
    """Fill in the products (1 + p, 1 + p) of residual and columns; return how many are left."""
    order, left = models.order, models.left[-1]
    left[0, 0] = products[0, 0]
    for a in range(len(order)):
        left[1 + a, 0] = products[1 + order[a], 0]
        for b in range(a + 1):
            left[1 + a, 1 + b] = products[1 + order[a], 1 + order[b]]
    return len(order)


@compiled
def _eliminate(
    models: _Elimination, products: Float64, mean: Float64, precision: Float64, many: int
) -> int:
    """Let the unknowns of a model go of which many are left; return how many cannot."""
    d = len(models.left) - 1
    for a in range(many - 1, -1, -1):
        now, then = models.left[min(a + 1, d)], models.left[min(a, d)]
        i, row, log_evidence = models.order[a], models.row[a], models.log_evidence[a + 1]
        own, whole, known = now[a + 1, a + 1], products[1 + i, 1 + i], precision[i]
        if own < _FOLLOWS * whole:
            own = 0.0  # what is left of a column that follows from others is rounding
        pivot = own + known
        if known < np.inf:
            if not pivot > _FOLLOWS * (whole + known):
                return a + 1
            log_evidence += 0.5 * np.log((known if known > 0.0 else 1.0) / pivot)
        models.log_evidence[a], models.pivot[a] = log_evidence, pivot
        for b in range(a + 1):
            row[b] = now[a + 1, b]
        # counted from its mean: what a narrow prior far away says would be lost in rounding
        row[0] -= own * mean[i]
        for b in range(a + 1):
            part, away = row[b] / pivot, now[a + 1, b] * mean[i]
            for c in range(b + 1):
                then[b, c] = now[b, c] - part * row[c]
            then[b, 0] -= away
        then[0, 0] -= row[0] * mean[i]
        for b in range(a + 1):
            row[b] /= pivot
        row[0] += mean[i]
    return 0


@compiled
def _log_evidence(models: _Elimination, precision: Float64, many: int) -> float:
    """Return the logarithm of the evidence of a model; `many` unknowns could not go."""
    result = models.log_evidence[0] - 0.5 * models.left[0, 0, 0]
    # beyond what no residual at all would give it is rounding
    rounding = result > _ROUNDING and precision.min() > 0.0
    return float(result) if many == 0 and np.isfinite(result) and not rounding else -np.inf


@compiled
def evidences(products: Float64, mean: Float64, precision: Float64) -> Float64:
    """
    Return the logarithms of the evidence of linear models, of all settings and families.

    Parameters
    ----------
    products : (s, 1 + p, 1 + p)
        Of whitened residual and columns.
    mean, precision : (f, p)
        Of the priors; a precision of 0: nothing is known, of infinity: it is the mean.

    Returns
    -------
    (s, f)
        Without -log det / 2 of the rows' covariance; -inf where a model has no solution, or
        nothing is left of the digits of the products.

    Notes
    -----
    Unknowns are eliminated one after another: what is left where a family begins to differ from
    the one before is kept from it.
    """
    s, f = len(products), len(mean)
    logs, models = np.empty((s, f)), _ordered(mean, precision, 0, 0)
    for k in range(s):
        many = _begin(models, products[k])
        for q in range(f):
            many = max(many, models.since[q])
            many = _eliminate(models, products[k], mean[q], precision[q], many)
            logs[k, q] = _log_evidence(models, precision[q], many)
    return logs


@compiled
def _solution(models: _Elimination, count: int) -> tuple[Float64, Float64]:
    """Return the unknowns (p,) and the covariance of the first of them, in their order."""
    p = len(models.order)
    at, covariance = np.empty(p), np.zeros((count, count))
    for a in range(p):
        row = models.row[a]
        at[a] = row[0]
        for b in range(a):
            at[a] -= row[1 + b] * at[b]
        if a < count:
            covariance[a, a] = 1.0 / models.pivot[a]
            for c in range(a):
                for b in range(a):
                    covariance[a, b] -= row[1 + c] * covariance[c, b]
            for b in range(a):
                covariance[b, a] = covariance[a, b]
                covariance[a, a] -= row[1 + b] * covariance[a, b]
    return at, covariance


@compiled
def solve(
    products: Float64,
    mean: Float64,
    precision: Float64,
    wanted: NDArray[np.bool_],
    first: int,
    count: int,
) -> tuple[Float64, Float64, Float64]:
    """
    Solve linear models.

    Parameters
    ----------
    products, mean, precision
        See `evidences`.
    wanted : (s, f)
        Which.
    first, count
        Unknowns whose covariance is returned.

    Returns
    -------
    log_evidence, step, covariance : (m,), (m, p), (m, count, count)
        Of those that are wanted, setting by setting; 0 where there is no solution.
    """
    s, f, p, m = len(products), len(mean), mean.shape[1], wanted.sum()
    logs, steps, covariance = np.empty(m), np.zeros((m, p)), np.zeros((m, count, count))
    models, j = _ordered(mean, precision, first, count), 0
    place = models.order[:count] - first
    for k in range(s):
        many = _begin(models, products[k])
        for q in range(f):
            many = max(many, models.since[q])
            if not wanted[k, q]:
                continue
            many = _eliminate(models, products[k], mean[q], precision[q], many)
            logs[j] = _log_evidence(models, precision[q], many)
            if logs[j] > -np.inf:
                at, spread = _solution(models, count)
                steps[j][models.order] = at
                for a in range(count):
                    for b in range(count):
                        covariance[j, place[a], place[b]] = spread[a, b]
            j += 1
    return logs, steps, covariance
