# SPDX-License-Identifier: Apache-2.0
"""
Distance along the track from noisy positions.

A length summed from noisy positions is biased long, so nothing is summed over
them: both coordinates are fitted with the same polynomials and the positions
are projected on the direction of the fitted track.
"""

from __future__ import annotations

import math

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.samples import Float64

_ORDER = 8  # most coefficients of a bend
_STRAIGHT = 2
_STEPS = 256  # of the integral of the excess


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


@compiled('i8(f8[::1], i8)')
def _best_order(sse: Float64, n: int) -> int:
    """Order of least AICc, at least a line."""
    best, least = _STRAIGHT, np.inf
    for order in range(_STRAIGHT, len(sse) + 1):
        k = order + 1
        if n - k - 1 <= 0:
            break
        criterion = n * math.log(max(sse[order - 1], 1e-300) / n) + 2.0 * k * n / (n - k - 1)
        if criterion < least:
            best, least = order, criterion
    return best


def along_track(time: Float64, position: Float64) -> Float64:
    """
    Return the distance along the track of each position.

    Parameters
    ----------
    time : (n,)
        Normalised times, ascending from -1 to 1, 4 or more.
    position : (n, 2)
        In a plane [m].

    Returns
    -------
    (n,)
        [m], ascending in the direction of travel, 0 at the first position.

    Raises
    ------
    EstimationError
        If the positions have no direction of travel.

    Notes
    -----
    The direction is that of the straight lines through both coordinates. Where the
    cross-track coordinate y bends (its order, by AICc, is above that of a line), the
    excess of the arc over its projection, integral of sqrt(x'^2 + y'^2) - |x'| of the
    fitted track, is added: of second order in the angle, so that the noise of y enters
    in second order only. AICc: Hurvich and Tsai (1989).
    """
    distance: Float64 = _project(time, np.ascontiguousarray(position))
    if np.isnan(distance[0]):
        raise EstimationError(
            f'position: {len(position)} samples without a direction of travel, all near '
            f'{position[0].tolist()} m; check the input or leave it out'
        )
    return distance


@compiled('f8[::1](f8[::1], f8[:, ::1])')
def _project(time: Float64, position: Float64) -> Float64:
    """Return the distance along the track of each position; NaN without a direction."""
    n = len(time)
    order = max(1, min(_ORDER, n - 2))
    east = position[:, 0] - position[0, 0]
    north = position[:, 1] - position[0, 1]
    to_east = refit(time, east, _STRAIGHT)[COEFFICIENT, 1]
    to_north = refit(time, north, _STRAIGHT)[COEFFICIENT, 1]
    length = math.sqrt(to_east * to_east + to_north * to_north)
    if length == 0.0:
        return np.full(n, np.nan)
    cosine, sine = to_east / length, to_north / length
    ahead, across = cosine * east + sine * north, cosine * north - sine * east
    bend = refit(time, across, order)
    bend_order = _best_order(bend[SSE], n)
    if bend_order == _STRAIGHT:
        return np.asarray(ahead)
    along = refit(time, ahead, order)
    steps = np.linspace(-1.0, 1.0, _STEPS + 1)
    x = evaluate(along, steps, _best_order(along[SSE], n))[1]
    y = evaluate(bend, steps, bend_order)[1]
    excess = np.zeros(_STEPS + 1)
    last = math.sqrt(x[0] * x[0] + y[0] * y[0]) - abs(x[0])
    for i in range(1, _STEPS + 1):
        now = math.sqrt(x[i] * x[i] + y[i] * y[i]) - abs(x[i])
        excess[i] = excess[i - 1] + (now + last) / _STEPS
        last = now
    return np.asarray(ahead + np.interp(time, steps, excess))
