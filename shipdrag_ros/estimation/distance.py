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
from shipdrag_ros.regression.refit import COEFFICIENT, SSE, evaluate, refit
from shipdrag_ros.samples import Float64

_ORDER = 8  # most coefficients of a bend
_STRAIGHT = 2
_STEPS = 256  # of the integral of the excess


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
