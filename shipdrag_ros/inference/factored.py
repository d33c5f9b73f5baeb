# SPDX-License-Identifier: Apache-2.0
"""A positive matrix and its factor, as Python code uses the one Cholesky of `gaussian`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.inference.gaussian import cholesky, substitute
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
