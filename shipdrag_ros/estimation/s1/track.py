# SPDX-License-Identifier: Apache-2.0
"""
Distance along the track from noisy positions.

A length summed from noisy positions is biased long, so nothing is summed over
them: both coordinates are fitted with the same polynomials and the positions
are projected on the direction of the fitted track.
"""

from __future__ import annotations

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.regression.order import fit_orders
from shipdrag_ros.regression.orthogonal import OrthogonalBasis
from shipdrag_ros.samples import Float64

_STEPS = 512  # of the integral of the excess
_STRAIGHT = 2  # coefficients of a straight line


def along_track(time: Float64, position: Float64, basis: OrthogonalBasis) -> Float64:
    """
    Return the distance along the track of each position.

    Parameters
    ----------
    time : (n,)
        Normalised times, ascending.
    position : (n, 2)
        In a plane [m].
    basis
        Polynomials on these times, fewer than times and at least 2.

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
    The direction is that of the linear terms of both coordinates. Where the
    cross-track coordinate y bends (its order, by the rule, is above that of a
    line), the excess of the arc over its projection, integral of
    sqrt(x'^2 + y'^2) - |x'| of the fitted track, is added: of second order in
    the angle, so that the noise of y enters in second order only.
    """
    local = position - position[0]
    east, _ = basis.fit(local[:, 0])
    north, _ = basis.fit(local[:, 1])
    length = float(np.hypot(east[1], north[1]))
    if length == 0.0:
        raise EstimationError(
            f'position: {len(position)} samples without a direction of travel, all near '
            f'{position[0].tolist()} m; check the input or leave it out'
        )
    cosine, sine = east[1] / length, north[1] / length
    ahead: Float64 = cosine * local[:, 0] + sine * local[:, 1]
    across = cosine * local[:, 1] - sine * local[:, 0]
    y, table = fit_orders(basis, across)
    y_order = table.plateau_order
    if y_order <= _STRAIGHT:
        return ahead
    x, table = fit_orders(basis, ahead)
    x_order = table.plateau_order
    steps = np.linspace(-1.0, 1.0, _STEPS + 1)
    rate = basis.evaluate(steps, derivatives=1, order=max(x_order, y_order))[1]
    x_rate = np.einsum('k,km->m', x[:x_order], rate[:x_order])
    y_rate = np.einsum('k,km->m', y[:y_order], rate[:y_order])
    excess_rate = np.hypot(x_rate, y_rate) - np.abs(x_rate)
    halves = 0.5 * np.diff(steps) * (excess_rate[1:] + excess_rate[:-1])
    excess = np.concatenate([[0.0], np.cumsum(halves)])
    distance: Float64 = ahead + np.interp(time, steps, excess)
    return distance
