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
"""What `solve` is asked for of one model."""

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
    Unknowns of linear models, which go one after another; the residual stands behind them.

    Attributes
    ----------
    order : (p,)
        In which they go: first those of which all priors say the same, then those in which a
        prior seldom differs from the one before.
    since : (f,)
        How many of them each prior shares with the one before.
    alike
        How many have one prior; what is left is kept from them on.
    left : (1 + p - alike, 1 + p, 1 + p)
        Products of what is left, the upper half.
    row, pivot : (p, 1 + p), (p,)
        What an unknown is, by those that are left when it goes.
    log_evidence : (1 + p,)
        Less what is left of the residual.
    """

    order: Int64
    since: Int64
    alike: int
    left: Float64
    row: Float64
    pivot: Float64
    log_evidence: Float64


@compiled
def _ordered(mean: Float64, precision: Float64, first: int, count: int) -> _Elimination:
    """Return where all of the families (f, p) begin; some unknowns go last."""
    f, p = mean.shape
    changes = np.zeros((p, f), np.bool_)
    for a in range(p):
        for q in range(1, f):
            changes[a, q] = (
                mean[q, a] != mean[q - 1, a] or precision[q, a] != precision[q - 1, a]
            )
    often = changes.sum(axis=1)
    if count < p:
        often[first : first + count] += f
    order = np.argsort(often, kind='mergesort')
    since = np.zeros(f, np.int64)
    for q in range(1, f):
        while since[q] < p and not changes[order[since[q]], q]:
            since[q] += 1
    alike = int(np.sum(often == 0))
    left, row = np.empty((1 + p - alike, 1 + p, 1 + p)), np.empty((p, 1 + p))
    return _Elimination(order, since, alike, left, row, np.empty(p), np.zeros(1 + p))


@compiled
def _begin(models: _Elimination, products: Float64) -> None:
    """Fill in the products (1 + p, 1 + p) of residual and columns."""
    order, left = models.order, models.left[0]
    p = len(order)
    left[p, p] = products[0, 0]
    for a in range(p):
        left[a, p] = products[1 + order[a], 0]
        for b in range(a, p):
            left[a, b] = products[1 + order[a], 1 + order[b]]


@compiled
def _eliminate(
    models: _Elimination, products: Float64, mean: Float64, precision: Float64, gone: int
) -> int:
    """Let the unknowns of one model go, some of which are gone; return how many could."""
    p, row = len(mean), models.row
    for a in range(gone, p):
        i = models.order[a]
        now = models.left[max(a - models.alike, 0)]
        then = models.left[max(a + 1 - models.alike, 0)]
        own, known = now[a, a], precision[i]
        whole = products[1 + i, 1 + i]
        if own < _FOLLOWS * whole:
            own = 0.0  # what is left of a column that follows from others is rounding
        pivot = own + known
        if not pivot > _FOLLOWS * (whole + known):
            return a
        log_evidence = models.log_evidence[a]
        for b in range(a + 1, p + 1):
            row[a, b] = now[a, b]
        if known < np.inf:
            row[a, p] += known * mean[i]
            log_evidence -= 0.5 * np.log(pivot)
            if known > 0.0:
                log_evidence += 0.5 * (np.log(known) - known * mean[i] ** 2)
        models.log_evidence[a + 1], models.pivot[a] = log_evidence, pivot
        for b in range(a + 1, p + 1):
            part = row[a, b] / pivot
            for c in range(b, p + 1):
                then[b, c] = now[b, c] - part * row[a, c]
        for b in range(a + 1, p + 1):
            row[a, b] /= pivot
    return p


@compiled
def _log_evidence(models: _Elimination, precision: Float64, gone: int) -> float:
    """Return the logarithm of the evidence of a model whose unknowns are gone."""
    p = len(precision)
    result = models.log_evidence[p] - 0.5 * models.left[-1, p, p] if gone == p else -np.inf
    # beyond what no residual at all would give it is rounding
    rounding = result > _ROUNDING and precision.min() > 0.0
    return float(result) if np.isfinite(result) and not rounding else -np.inf


@compiled
def evidences(products: Float64, mean: Float64, precision: Float64) -> Float64:
    """
    Return the logarithms of the evidence (s, f) of linear models.

    Parameters
    ----------
    products : (s, 1 + p, 1 + p)
        Of whitened residual and columns.
    mean, precision : (f, p)
        Of the priors; a precision of 0: nothing is known, of infinity: the unknown is 0.

    Returns
    -------
    (s, f)
        Without -log det / 2 of the rows' covariance; -inf where a model has no solution, or
        nothing is left of the digits of the products.

    Notes
    -----
    Unknowns go one after another. What is left where a family begins to differ from the one
    before is kept from it.
    """
    s, f = len(products), len(mean)
    logs = np.empty((s, f))
    models = _ordered(mean, precision, 0, 0)
    for k in range(s):
        _begin(models, products[k])
        gone = 0
        for q in range(f):
            since = min(gone, models.since[q])
            gone = _eliminate(models, products[k], mean[q], precision[q], since)
            logs[k, q] = _log_evidence(models, precision[q], gone)
    return logs


@compiled
def _solution(models: _Elimination, count: int) -> tuple[Float64, Float64]:
    """Return the unknowns (p,) and the covariance of the last of them, in their order."""
    row, p = models.row, len(models.order)
    at, away = np.empty(p), p - count
    covariance = np.zeros((count, count))
    for a in range(p - 1, -1, -1):
        total = row[a, p]
        for b in range(a + 1, p):
            total -= row[a, b] * at[b]
        at[a] = total
        if a < away:
            continue
        j = a - away
        for c in range(j + 1, count):
            part = row[a, away + c]
            for b in range(j + 1, count):
                covariance[j, b] -= part * covariance[c, b]
        variance = 1.0 / models.pivot[a]
        for b in range(j + 1, count):
            covariance[b, j] = covariance[j, b]
            variance -= row[a, away + b] * covariance[j, b]
        covariance[j, j] = variance
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
    models = _ordered(mean, precision, first, count)
    order, last = models.order, models.order[p - count :] - first
    j = 0
    for k in range(s):
        _begin(models, products[k])
        gone = 0
        for q in range(f):
            gone = min(gone, models.since[q])
            if not wanted[k, q]:
                continue
            gone = _eliminate(models, products[k], mean[q], precision[q], gone)
            logs[j] = _log_evidence(models, precision[q], gone)
            if logs[j] > -np.inf:
                at, spread = _solution(models, count)
                for a in range(p):
                    steps[j, order[a]] = at[a]
                for a in range(count):
                    for b in range(count):
                        covariance[j, last[a], last[b]] = spread[a, b]
            j += 1
    return logs, steps, covariance
