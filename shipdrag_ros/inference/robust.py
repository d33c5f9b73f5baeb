# SPDX-License-Identifier: Apache-2.0
"""Robust scale and weights: the median absolute deviation, and Huber's weights of outliers."""

from __future__ import annotations

import math

from shipdrag_ros.compiled import compiled

MAD_TO_SD = 1.482602218505602
"""Standard deviation of normal noise over the median of its size."""
GROSS = 8.0
"""Standard deviations: what is this far from a fit is no measurement of it."""


@compiled('f8(f8, f8)')
def huber_weight(size: float, limit: float) -> float:
    """
    Return Huber's weight of a residual.

    Parameters
    ----------
    size
        Of the residual, in standard deviations.
    limit
        Beyond it a residual counts by its sign alone.

    Returns
    -------
    float
        min(1, limit / size).

    Notes
    -----
    Huber, Robust Statistics (1981), 3.5.
    """
    return 1.0 if size <= limit else limit / size


def huber_square(limit: float) -> float:
    """
    Return the mean of min(z, limit)^2 of a standard normal z.

    Parameters
    ----------
    limit
        As of `huber_weight`, in standard deviations.

    Returns
    -------
    float

    Notes
    -----
    Huber (1981), 5.2: what makes the scale of proposal 2 consistent.
    """
    inside = math.erf(limit / math.sqrt(2.0))
    density = math.exp(-0.5 * limit * limit) / math.sqrt(2.0 * math.pi)
    return inside - 2.0 * limit * density + limit * limit * (1.0 - inside)
