# SPDX-License-Identifier: Apache-2.0
"""White noise of each input as it scatters, and Huber's weights of outliers; compiled."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.robust import GROSS, MAD_TO_SD, huber_square, huber_weight
from shipdrag_ros.inference.rows import KIND_COUNT
from shipdrag_ros.samples import Float64, Int64

_HUBER = 2.5  # whitened residuals beyond it count by their size only
_LOST = 1e-6  # its weight: none, but finite
_HUBER_SQUARE = huber_square(_HUBER)


@compiled
def drop_gross(residual: Float64, kind: Int64, weight: Float64) -> None:
    """
    Take the weight, in place, of rows far from a crude answer, as others of their input go.

    A first reading that is wrong can be followed by a fit, but hardly by a crude answer.

    Parameters
    ----------
    residual, kind, weight : (n,)
    """
    for of_kind in range(KIND_COUNT):
        chosen = np.flatnonzero(kind == of_kind)
        if len(chosen):
            limit = GROSS * MAD_TO_SD * np.median(np.abs(residual[chosen]))
            for i in chosen:
                if abs(residual[i]) > limit:
                    weight[i] = _LOST


@compiled
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
    count, squares, size = np.zeros(KIND_COUNT), np.zeros(KIND_COUNT), np.empty(n)
    for i in range(n):
        # the residual in standard deviations before it was weighed down
        size[i] = abs(white[i]) / np.sqrt(weight[i])
        if i >= steady and weight[i] > _LOST:
            count[kind[i]] += 1.0
            squares[kind[i]] += min(size[i], _HUBER) ** 2
    expected = _HUBER_SQUARE * (1.0 - parameters / n)
    for i in range(n):
        growth = 1.0
        if count[kind[i]] > 0.0:
            growth = squares[kind[i]] / count[kind[i]] / expected
        base[i] *= growth
        # means of the steady record are off by the fit, not by themselves
        gross = i >= steady and size[i] > GROSS * np.sqrt(max(growth, 1.0))
        weight[i] = _LOST if gross else huber_weight(size[i], _HUBER)
