# SPDX-License-Identifier: Apache-2.0
"""
How many coefficients a fit should have: the table and the one rule.

The rule is a stated test in place of a glance at a plot. It serves the order
of a polynomial in time as well as the degree of a polynomial surface: nested
fits of growing size, whatever the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.orthogonal import OrthogonalBasis

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

        chance = fdtrc(np.diff(self.coefficients), self.freedom[1:], self.f[1:])
        # the library answers NaN at infinity
        chance[np.isinf(self.f[1:])] = 0.0
        return np.concatenate([[np.nan], chance])

    def plateau(self, *, significance: float | None = None) -> int:
        """
        Return the row of the smallest fit in the plateau of s^2.

        Parameters
        ----------
        significance
            A step less probable than this counts; `SIGNIFICANCE` where not given.

        Notes
        -----
        S1 compares neighbours of s^2, S5 raises the degree while the fall is
        substantial. As a test: the smallest fit of which neither of the next
        `NEIGHBOURS` steps has p < `significance`. s^2 falls where F > 1; the
        test asks for more than chance gives.
        """
        return int(np.argmax(self._settled(significance or SIGNIFICANCE)))

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
        soon: NDArray[np.bool_] = np.any(
            [falls[i : i + len(self.sse)] for i in range(NEIGHBOURS)], axis=0
        )
        return ~soon


def fit_orders(basis: OrthogonalBasis, values: Float64) -> tuple[Float64, OrderTable]:
    """
    Fit at every order that leaves a degree of freedom.

    Parameters
    ----------
    basis
        Polynomials on n times with equal weights.
    values : (n,)
        Measured at these times; n >= 2.

    Returns
    -------
    coefficients : (order,)
        The first k of them are the fit of order k.
    table
        Of orders 1, 2, ..
    """
    coefficients, sse = basis.fit(values)
    orders = np.arange(1, min(basis.order, len(values) - 1) + 1)
    table = OrderTable.of(
        orders, sse[: len(orders)], rows=len(values), rounding=rounding((values * values).sum())
    )
    return coefficients, table


def rounding(sum_of_squares: float) -> float:
    """
    Return the sum of squares that rounding alone leaves of data.
    """
    return (8.0 * float(np.finfo(np.float64).eps)) ** 2 * float(sum_of_squares)
