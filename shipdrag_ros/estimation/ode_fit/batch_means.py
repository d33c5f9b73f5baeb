# SPDX-License-Identifier: Apache-2.0
"""Residuals that are not independent from sample to sample: how much worse their means are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.samples import Float64

_LEAST_BLOCKS = 16  # of a size: fewer do not show their scatter
_BY_CHANCE = 3.5  # standard deviations of that scatter: less is chance


class BatchMeans(NamedTuple):
    """
    What means of neighbours scatter more than those of independent residuals.

    Attributes
    ----------
    inflation
        Of the variance; 1 where chance explains it.
    block
        Samples in those means.
    """

    inflation: float
    block: int


def batch_means(white: Float64) -> BatchMeans:
    """
    Return the largest excess scatter of means over blocks that chance does not explain.

    Parameters
    ----------
    white : (n,)
        Residuals over their standard deviation, in ascending time.

    Notes
    -----
    Of independent residuals the variance of the mean of B is 1/B of their variance, with a
    relative standard deviation of sqrt(2 B / n). Blocks of 2, 4, 8 ..: 2 or 3 false
    alarms in 1000 (n = 500, 2000).
    """
    found = BatchMeans(1.0, 1)
    n = len(white)
    # less than 1 where the correlation is in the standard deviation already
    mean_square = max(float((white * white).mean()), 1.0) if n else 0.0
    block = 2
    while block * _LEAST_BLOCKS <= n and mean_square > 0.0:
        count = n // block
        means = white[: count * block].reshape(count, block).mean(axis=1)
        ratio = block * float((means * means).mean()) / mean_square
        if ratio > max(found.inflation, 1.0 + _BY_CHANCE * np.sqrt(2.0 * block / n)):
            found = BatchMeans(ratio, block)
        block *= 2
    return found
