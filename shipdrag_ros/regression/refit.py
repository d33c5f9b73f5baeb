# SPDX-License-Identifier: Apache-2.0
"""
All orders of one input at once, compiled: what a rolling window can afford.

Every fit is made from scratch. Adding and removing samples from a fit drifts,
and is no faster than this.
"""

from __future__ import annotations

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import Float64

ALPHA, BETA, SQUARED_NORM, COEFFICIENT, SSE = range(5)  # rows of the result

# Sums may be taken in any order, so that they are vectorised; the order is
# fixed when compiled, not by the data or where they lie.
_SUMS = {'reassoc', 'contract', 'nsz'}


@compiled('f8[:, ::1](f8[::1], f8[::1], i8)', fastmath=_SUMS)
def refit(time: Float64, value: Float64, order: int) -> Float64:
    """
    Fit orthogonal polynomials of orders 1, 2, .. to one input.

    Parameters
    ----------
    time : (n,)
        Normalised times in [-1, 1], at least `order` distinct ones.
    value : (n,)
    order
        How many polynomials.

    Returns
    -------
    (5, order)
        Rows `ALPHA`, `BETA`, `SQUARED_NORM` of the recurrence, `COEFFICIENT`
        and `SSE` of the orders 1, 2, ..

    Notes
    -----
    Forsythe's recurrence as in `OrthogonalBasis`, equal weights, without its
    second orthogonalisation: for up to a dozen orders on stamps that cover the
    interval. One pass over the data an order, nothing stored but three columns.
    """
    n = len(time)
    table = np.zeros((5, order))
    residual = value.copy()
    column, before = np.ones(n), np.zeros(n)
    norm, on_residual, first_moment = float(n), 0.0, 0.0
    for i in range(n):
        on_residual += value[i]
        first_moment += time[i]
    for j in range(order):
        p, alpha = on_residual / norm, first_moment / norm
        beta = norm / table[SQUARED_NORM, j - 1] if j > 0 else 0.0
        table[ALPHA, j], table[BETA, j], table[SQUARED_NORM, j] = alpha, beta, norm
        table[COEFFICIENT, j] = p
        sse = norm = on_residual = first_moment = 0.0
        for i in range(n):
            left = residual[i] - p * column[i]
            residual[i] = left
            sse += left * left
            new = (time[i] - alpha) * column[i] - beta * before[i]
            before[i] = new
            square = new * new
            norm += square
            on_residual += new * left
            first_moment += time[i] * square
        table[SSE, j] = sse
        column, before = before, column
    return table


@compiled('f8[:, ::1](f8[:, ::1], f8[::1], i8)')
def evaluate(table: Float64, time: Float64, order: int) -> Float64:
    """
    Evaluate a fit of `refit` and its rate.

    Parameters
    ----------
    table : (5, k)
        From `refit`.
    time : (m,)
        Normalised times.
    order
        How many coefficients to use, at most k.

    Returns
    -------
    (2, m)
        Value and derivative with respect to normalised time.
    """
    result = np.zeros((2, len(time)))
    for i in range(len(time)):
        h, h_before, rate, rate_before = 1.0, 0.0, 0.0, 0.0
        for j in range(order):
            result[0, i] += table[COEFFICIENT, j] * h
            result[1, i] += table[COEFFICIENT, j] * rate
            shifted, beta = time[i] - table[ALPHA, j], table[BETA, j]
            new = shifted * h - beta * h_before
            new_rate = h + shifted * rate - beta * rate_before
            h_before, h, rate_before, rate = h, new, rate, new_rate
    return result
