# SPDX-License-Identifier: Apache-2.0
"""
Gaussian algebra: normal equations, one Cholesky factor, the posterior and evidence of a model.

All is compiled here and taken from no library, whose order of sums may depend on its threads.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

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
        solved, lower, scale = cholesky(np.ascontiguousarray(matrix))
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


_FOLLOWS = 1e-14  # of a scaled diagonal
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
