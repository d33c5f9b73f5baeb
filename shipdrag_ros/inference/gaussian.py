# SPDX-License-Identifier: Apache-2.0
"""
Gaussian algebra: normal equations, one Cholesky factor, the posterior and evidence of a model.

All is compiled here and taken from no library, whose order of sums may depend on its threads.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import Float64


class Factored(NamedTuple):
    """
    A positive matrix and its factor, for models of a few dozen unknowns.

    Attributes
    ----------
    lower : (p, p)
        Factor of the matrix scaled to unit diagonal.
    scale : (p,)
        That makes it so.
    """

    lower: Float64
    scale: Float64

    @classmethod
    def of(cls, matrix: Float64) -> Factored:
        """
        Factor a matrix.

        Parameters
        ----------
        matrix : (p, p)
            Symmetric.

        Raises
        ------
        numpy.linalg.LinAlgError
            If it is not positive, or a column follows from others.
        """
        solved, lower, scale = cholesky(np.ascontiguousarray(matrix), 0.0)
        if not solved:
            raise np.linalg.LinAlgError('the matrix is not positive')
        return cls(lower, scale)

    def solve(self, right: Float64) -> Float64:
        """
        Return the solution (p, k) of M x = b for columns of b, (p, k).
        """
        return substitute(self.lower, self.scale, np.ascontiguousarray(right))

    @property
    def inverse(self) -> Float64:
        """Inverse of the matrix, (p, p)."""
        return self.solve(np.eye(len(self.scale)))

    @property
    def log_det(self) -> float:
        """Logarithm of its determinant."""
        return 2.0 * float(np.log(np.diag(self.lower)).sum() - np.log(self.scale).sum())


_BLOCK = 128
_FOLLOWS = 1e-14  # of a scaled diagonal
# Sums may be taken in any order, so that they are vectorised; the order is
# fixed when compiled, not by the data or where they lie.
SUMS = {'reassoc', 'contract', 'nsz'}


@compiled('f8[:, ::1](f8[:, ::1], f8[::1], f8[::1])', fastmath=SUMS)
def condense(rows: Float64, residual: Float64, weight: Float64) -> Float64:
    """
    Return the weighted products of all columns and of the residual.

    Parameters
    ----------
    rows : (k, n)
        The columns of the model.
    residual, weight : (n,)

    Returns
    -------
    (k + 1, k)
        The last row holds the products with the residual.
    """
    k, n = rows.shape
    products = np.zeros((k + 1, k))
    weighted = np.empty(_BLOCK)
    # so many samples at a time as stay in the fastest memory
    for first in range(0, n, _BLOCK):
        size = min(_BLOCK, n - first)
        scale = weight[first : first + size]
        for a in range(k + 1):
            row = residual[first : first + size] if a == k else rows[a, first : first + size]
            for i in range(size):
                weighted[i] = scale[i] * row[i]
            for b in range(min(a + 1, k)):
                other = rows[b, first : first + size]
                total = 0.0
                for i in range(size):
                    total += weighted[i] * other[i]
                products[a, b] += total
    for a in range(k):
        for b in range(a):
            products[b, a] = products[a, b]
    return products


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
def cholesky(matrix: Float64, damping: float) -> tuple[bool, Float64, Float64]:
    """
    Return the lower factor of M + damping diag M, M scaled to unit diagonal.

    Parameters
    ----------
    matrix : (p, p)
        Symmetric.
    damping
        Of Levenberg and Marquardt; 0: none.

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
        lower[a, a] = 1.0 + damping
    solved = factor(lower)
    for a in range(p):
        # what is left of a column that follows from others is rounding
        solved = solved and lower[a, a] * lower[a, a] > _FOLLOWS
    return solved, lower, scale


@compiled('void(f8[:, ::1], f8[::1])')
def forward(lower: Float64, vector: Float64) -> None:
    """
    Solve L x = b in place, L (n, n) lower.
    """
    for i in range(len(vector)):
        total = vector[i]
        for k in range(i):
            total -= lower[i, k] * vector[k]
        vector[i] = total / lower[i, i]


@compiled('void(f8[:, ::1], f8[::1])')
def _backward(lower: Float64, vector: Float64) -> None:
    """Solve L' x = b in place."""
    n = len(vector)
    for i in range(n - 1, -1, -1):
        total = vector[i]
        for k in range(i + 1, n):
            total -= lower[k, i] * vector[k]
        vector[i] = total / lower[i, i]


@compiled('void(f8[:, ::1], f8[:, ::1])', fastmath=SUMS)
def _invert(lower: Float64, inverse: Float64) -> None:
    """Invert L L' into another matrix."""
    n = len(lower)
    half = np.zeros((n, n))  # of L: row j is column j of its inverse
    for j in range(n):
        half[j, j] = 1.0 / lower[j, j]
        for i in range(j + 1, n):
            total = 0.0
            for k in range(j, i):
                total -= lower[i, k] * half[j, k]
            half[j, i] = total / lower[i, i]
    for a in range(n):
        for b in range(a + 1):
            total = 0.0
            for k in range(a, n):
                total += half[a, k] * half[b, k]
            inverse[a, b] = inverse[b, a] = total


@compiled('Tuple((f8, f8[::1], f8[:, ::1]))(f8[:, ::1], f8[::1], i8[::1], f8[::1], f8[::1])')
def posterior(
    products: Float64,
    start: Float64,
    columns: NDArray[np.int64],
    mean: Float64,
    sd: Float64,
) -> tuple[float, Float64, Float64]:
    """
    Solve one model.

    Parameters
    ----------
    products : (k + 1, k)
        From `condense`, weights being 1 / variance, of the residual at `start`.
    start : (k,)
        Coefficients; 0 of columns that the model does not have.
    columns : (m,) int64
        Which columns it has.
    mean, sd : (k,)
        Prior of the coefficients.

    Returns
    -------
    evidence
        Logarithm of the marginal likelihood, up to a constant of the data.
    step : (m,)
        From `start` to the solution.
    lower : (m, m)
        Triangular factor of the inverse covariance.
    """
    k, m = len(start), len(columns)
    lower, step = np.empty((m, m)), np.empty(m)
    evidence = 0.0
    for a in range(m):
        column = columns[a]
        for b in range(m):
            lower[a, b] = products[column, columns[b]]
        precision = 1.0 / (sd[column] * sd[column])
        off = start[column] - mean[column]
        lower[a, a] += precision
        step[a] = products[k, column] - precision * off
        evidence -= 0.5 * precision * off * off + math.log(sd[column])
    if not factor(lower):
        return -np.inf, step, lower
    forward(lower, step)
    for a in range(m):
        evidence += 0.5 * step[a] * step[a] - math.log(lower[a, a])
    _backward(lower, step)
    return evidence, step, lower


@compiled('f8[::1](f8[:, ::1], f8[::1], i8[::1], f8[::1], f8[::1])')
def deviations(
    products: Float64,
    start: Float64,
    columns: NDArray[np.int64],
    mean: Float64,
    sd: Float64,
) -> Float64:
    """
    Return the standard deviations of one model's coefficients; parameters as `posterior`.

    Returns
    -------
    (k,)
        0 of columns that it does not have.
    """
    _, _, lower = posterior(products, start, columns, mean, sd)
    inverse = np.empty_like(lower)
    _invert(lower, inverse)
    found = np.zeros(len(start))
    for a in range(len(columns)):
        found[columns[a]] = math.sqrt(inverse[a, a])
    return found


@compiled('f8[:, ::1](f8[:, ::1])')
def root(covariance: Float64) -> Float64:
    """
    Return a lower root R of a covariance, R R'; it may be singular.
    """
    n = len(covariance)
    lower = np.zeros((n, n))
    for j in range(n):
        pivot = covariance[j, j]
        for k in range(j):
            pivot -= lower[j, k] * lower[j, k]
        # a coefficient that follows from others, or is in no model
        if not pivot > 1e-13 * covariance[j, j]:
            continue
        pivot = math.sqrt(pivot)
        lower[j, j] = pivot
        for i in range(j + 1, n):
            total = covariance[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = total / pivot
    return lower


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
