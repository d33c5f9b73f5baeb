# SPDX-License-Identifier: Apache-2.0
"""
Least squares on any columns, what they determine at all, and how many a fit should have.

Columns of shape ratios and their products differ in size by orders, and often
follow from each other. They are scaled before they are factored; what the data
leave undetermined is kept apart, and not hidden in arbitrary coefficients.

The triangular factor of [A | z] holds all that least squares needs of A and z: any
weighting against other data, any number of leading columns and the residual sums
follow from it, at a cost that no longer depends on the number of rows.

How many coefficients is a stated test in place of a glance at a plot. It serves the order
of a polynomial in time as well as the degree of a polynomial surface: nested
fits of growing size, whatever the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from shipdrag_ros.samples import Float64

RANK_TOLERANCE = 1e-12  # a singular value this small beside the largest is rounding
# Small enough that BLAS never splits the work between threads, so that the last
# bit does not depend on how many there are.
_BLOCK = 128


def triangle(rows: Float64) -> Float64:
    """
    Return the triangular factor R of rows = Q R, without Q.

    Parameters
    ----------
    rows : (n, k)
        With more than 64 columns the last bit may depend on the threads of BLAS.

    Returns
    -------
    (k, k)
        Upper triangular; rows of zeros at the end where n < k.

    Notes
    -----
    Householder on one block of rows after the other, below the factor of those before.
    """
    k = rows.shape[1]
    householder: Any = np.linalg.qr  # numpy's types do not know that mode 'r' gives one array
    factor: Float64 = rows[:0]
    for first in range(0, len(rows), _BLOCK):
        factor = householder(np.concatenate([factor, rows[first : first + _BLOCK]]), mode='r')
    return np.concatenate([factor, np.zeros((k - len(factor), k))])


def inverse(upper: Float64) -> Float64:
    """
    Return the inverse of a small upper triangular matrix.

    Parameters
    ----------
    upper : (k, k)
        Without zeros on the diagonal.

    Notes
    -----
    Back substitution; the library's solver starts threads for any size.
    """
    result = np.eye(len(upper))
    for i in reversed(range(len(upper))):
        result[i] -= upper[i, i + 1 :] @ result[i + 1 :]
        result[i] /= upper[i, i]
    return result


@dataclass(frozen=True)
class LinearFit:
    """
    Coefficients fitted to columns, with what is known of them.

    Attributes
    ----------
    coefficients : (p,)
        The smallest, in scaled columns, where the data leave some open.
    residuals : (n,)
        Measured less fitted.
    scale : (p,)
        What each column was divided by.
    singular : (p,)
        Singular values of the scaled columns, descending.
    directions : (p, p)
        Row i: the combination of scaled columns that belongs to `singular[i]`.
    rank
        How many combinations of the coefficients the data determine.
    """

    coefficients: Float64
    residuals: Float64
    scale: Float64
    singular: Float64
    directions: Float64
    rank: int

    @cached_property
    def sse(self) -> float:
        """Sum of squared residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the residuals."""
        return len(self.residuals) - self.rank

    @property
    def variance(self) -> float:
        """s^2 of S1 (11); NaN without a degree of freedom."""
        return self.sse / self.freedom if self.freedom else float('nan')

    @property
    def condition(self) -> float:
        """Condition number of the scaled columns; infinite where one vanishes."""
        least = float(self.singular[-1])
        return float(self.singular[0]) / least if least > 0.0 else float('inf')

    @cached_property
    def covariance(self) -> Float64:
        """(p, p) Of the coefficients; of its determined part where `rank` < p."""
        root = self._root / self.scale
        return self.variance * (root.T @ root)

    def predict(self, columns: Float64) -> Float64:
        """
        Return fitted values of (m, p) columns.
        """
        return columns @ self.coefficients

    def leverage(self, columns: Float64) -> Float64:
        """
        Return x' (X'X)^+ x of (m, p) columns.

        Notes
        -----
        Times s^2 it is the variance of the fitted value. Montgomery, Peck and
        Vining, Introduction to Linear Regression Analysis, on hidden
        extrapolation: beyond the largest of the data a prediction is one.
        """
        size: Float64 = np.sum((columns / self.scale @ self._root.T) ** 2, axis=1)
        return size

    def undetermined(self, columns: Float64) -> Float64:
        """
        Return which part, 0..1, of (m, p) columns the data leave open.

        Any such part makes the value arbitrary.
        """
        scaled = columns / self.scale
        open_part = scaled @ self.directions[self.rank :].T
        size = np.maximum(np.linalg.norm(scaled, axis=1), np.finfo(np.float64).tiny)
        share: Float64 = np.linalg.norm(open_part, axis=1) / size
        return share

    @cached_property
    def _root(self) -> Float64:
        """(rank, p) R with R'R the pseudo-inverse of the scaled products."""
        return self.directions[: self.rank] / self.singular[: self.rank, None]


def least_squares(columns: Float64, values: Float64) -> LinearFit:
    """
    Fit coefficients to columns.

    Parameters
    ----------
    columns : (n, p)
        One column a coefficient.
    values : (n,)
        Measured.

    Returns
    -------
    LinearFit
        Coefficients (p,), their covariance, residuals (n,) and rank.

    Raises
    ------
    ValueError
        If the sizes differ or something is not finite.

    Notes
    -----
    Source: Golub, Van Loan, *Matrix Computations*, 5.3 and 5.5.

    QR of the columns scaled to length 1, then singular values of the small
    triangle; the normal equations, which square the condition, are not formed.

    Examples
    --------
    >>> import numpy as np
    >>> from shipdrag_ros.studies.least_squares import least_squares
    >>> x = np.arange(4.0)
    >>> fit = least_squares(np.column_stack([np.ones(4), x]), 1.0 + 2.0 * x)
    >>> [f'{value:.3f}' for value in fit.coefficients]
    ['1.000', '2.000']
    """
    if columns.ndim != 2 or columns.shape[:1] != values.shape or not columns.size:
        raise ValueError(f'columns {columns.shape} and values {values.shape}, expected n x p, n')
    if not (np.isfinite(columns).all() and np.isfinite(values).all()):
        raise ValueError('columns or values are not all finite')
    size = np.linalg.norm(columns, axis=0)
    scale = np.where(size > 0.0, size, 1.0)
    scaled = columns / scale
    factor = triangle(np.column_stack([scaled, values]))
    left, singular, directions = np.linalg.svd(factor[:-1, :-1])
    rank = int(np.sum(singular > RANK_TOLERANCE * singular[0]))
    root = directions[:rank] / singular[:rank, None]
    solved = root.T @ (left[:, :rank].T @ factor[:-1, -1])
    residuals = values - scaled @ solved
    # a second time on what is left: rounding in it would look like a misfit
    factor = triangle(np.column_stack([scaled, residuals]))
    solved += root.T @ (left[:, :rank].T @ factor[:-1, -1])
    residuals = values - scaled @ solved
    return LinearFit(solved / scale, residuals, scale, singular, directions, rank)


SIGNIFICANCE = 0.05  # a step less probable than this by chance counts as a fall of s^2
IMPLAUSIBLE = 1e-3  # an s^2 less probable than this contradicts a known variance
NEIGHBOURS = 2  # even and odd terms alternate: one idle step is not yet a plateau


@dataclass(frozen=True)
class OrderTable:
    """
    Nested least-squares fits of growing size to the same data.

    Attributes
    ----------
    coefficients : (m,) int
        How many coefficients each fit has, ascending, all below `rows`.
    sse : (m,)
        Sum of squared residuals of each, not ascending.
    rows
        How many data.
    """

    coefficients: NDArray[np.intp]
    sse: Float64
    rows: int

    @classmethod
    def of(
        cls,
        coefficients: Sequence[int] | NDArray[np.intp],
        sse: Sequence[float] | Float64,
        *,
        rows: int,
        rounding: float = 0.0,
    ) -> OrderTable:
        """
        Build a table from plain numbers.

        Parameters
        ----------
        coefficients, sse, rows
            See the attributes.
        rounding
            A sum of squares this small is rounding alone and counts as 0.

        Raises
        ------
        ValueError
            If a fit has as many coefficients as data, or the sizes do not
            ascend.
        """
        sizes = np.asarray(coefficients, np.intp)
        sums = np.asarray(sse, np.float64)
        if np.any(np.diff(sizes) <= 0) or sizes[-1] >= rows:
            raise ValueError(f'coefficients are {sizes}, expected ascending and below {rows}')
        return cls(sizes, np.where(sums <= rounding, 0.0, sums), rows)

    @cached_property
    def freedom(self) -> Float64:
        """(m,) Degrees of freedom of the residuals."""
        return (self.rows - self.coefficients).astype(np.float64)

    @cached_property
    def variance(self) -> Float64:
        """(m,) s^2 of S1 (11)."""
        return self.sse / self.freedom

    @cached_property
    def f(self) -> Float64:
        """(m,) F of the step from the fit before; NaN at the first."""
        fall = np.maximum(-np.diff(self.sse), 0.0) / np.diff(self.coefficients)
        after = self.variance[1:]
        exact = after == 0.0
        ratio = fall / np.where(exact, 1.0, after)
        return np.concatenate([[np.nan], np.where(exact & (fall > 0.0), np.inf, ratio)])

    @cached_property
    def p(self) -> Float64:
        """(m,) Probability of such an F by chance; NaN at the first."""
        from scipy.special import fdtrc  # slow to import

        chance = fdtrc(np.diff(self.coefficients, prepend=0), self.freedom, self.f)
        chance[np.isinf(self.f)] = 0.0  # the library answers NaN there
        return np.asarray(chance, np.float64)

    def plateau(self, *, significance: float = SIGNIFICANCE) -> int:
        """
        Return the row of the smallest fit in the plateau of s^2.

        Parameters
        ----------
        significance
            A step less probable than this counts.

        Notes
        -----
        S1 compares neighbours of s^2, S5 raises the degree while the fall is
        substantial. As a test: the smallest fit of which neither of the next
        `NEIGHBOURS` steps has p < `significance`. s^2 falls where F > 1; the
        test asks for more than chance gives.
        """
        return int(np.argmax(self._settled(significance)))

    def plateau_at(self, variance: float) -> int | None:
        """
        Return the row of the smallest fit in a plateau at a known variance.

        Parameters
        ----------
        variance
            A-priori variance of one datum.

        Returns
        -------
        int or None
            None where s^2 of every such fit is too large for it.

        Notes
        -----
        S1's other comparison. A plateau above the known variance, by chi^2 at
        `IMPLAUSIBLE`, is not the last one.
        """
        from scipy.special import chdtrc  # slow to import

        plausible = chdtrc(self.freedom, self.sse / variance) >= IMPLAUSIBLE
        rows = np.flatnonzero(self._settled(SIGNIFICANCE) & plausible)
        return int(rows[0]) if len(rows) else None

    def is_below(self, row: int, variance: float) -> bool:
        """
        Say whether s^2 of a fit is too small for a known variance.
        """
        from scipy.special import chdtr  # slow to import

        return bool(chdtr(self.freedom[row], self.sse[row] / variance) < IMPLAUSIBLE)

    def _settled(self, significance: float) -> NDArray[np.bool_]:
        """Say of which fits no significant step follows soon; always so of the last."""
        falls = np.concatenate([self.p[1:] < significance, np.zeros(NEIGHBOURS, np.bool_)])
        return ~np.asarray(sliding_window_view(falls, NEIGHBOURS).any(axis=1))


def rounding(sum_of_squares: float) -> float:
    """
    Return the sum of squares that rounding alone leaves of data.
    """
    return (8.0 * float(np.finfo(np.float64).eps)) ** 2 * float(sum_of_squares)
