# SPDX-License-Identifier: Apache-2.0
"""White noise of each input as it scatters, and Huber's weights of outliers; compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from shipdrag_ros.estimation.motion_fit.coast import KIND_COUNT
from shipdrag_ros.samples import Float64, Int64

_HUBER = 2.5  # whitened residuals beyond it count by their size only
_HUBER_SQUARE = 0.9775  # mean of min(z, 2.5)^2 of a standard normal z


@njit(cache=True)
def weigh(
    white: Float64,
    kind: Int64,
    steady: int,
    parameters: int,
    base: Float64,
    weight: Float64,
) -> None:
    """
    Improve variances and weights, in place, by what a fit leaves.

    Parameters
    ----------
    white : (n,)
        Whitened residuals of the fit with the variances base / weight.
    kind : (n,)
        Of the rows.
    steady
        So many of the first rows are of the steady record; an input's scatter
        is that of the others.
    parameters
        Number of unknowns that were fitted.
    base, weight : (n,)
    """
    n = len(white)
    count, squares = np.zeros(KIND_COUNT), np.zeros(KIND_COUNT)
    for i in range(n):
        # the residual in standard deviations before it was weighed down
        size = abs(white[i]) / np.sqrt(weight[i])
        weight[i] = _HUBER / max(size, _HUBER)
        if i >= steady:
            count[kind[i]] += 1.0
            squares[kind[i]] += min(size, _HUBER) ** 2
    expected = _HUBER_SQUARE * (1.0 - parameters / n)
    for i in range(n):
        if count[kind[i]] > 0.0:
            base[i] *= squares[kind[i]] / count[kind[i]] / expected
