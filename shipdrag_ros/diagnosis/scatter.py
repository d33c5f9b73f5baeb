# SPDX-License-Identifier: Apache-2.0
"""
What several runs say of what they share, and by how much they differ besides.

Each run is linear in shared unknowns, the same in all, and has a factor of its
own on the resistance as a whole. How far these factors scatter is learnt with
the rest: no two runs meet the same hull, sea and air.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.samples import Float64

_SCATTERS = np.geomspace(1e-4, 1.0, 81)  # of the factors, that are tried


@dataclass(frozen=True)
class Normal:
    """
    What a run tells, as normal equations about some point.

    Attributes
    ----------
    matrix : (q, q)
    fall : (q,)
        The step from the point that the run alone asks for is matrix^-1 fall.
    """

    matrix: Float64
    fall: Float64

    @classmethod
    def without(cls, matrix: Float64, fall: Float64, kept: int) -> Normal:
        """
        Return the equations of the first unknowns, whatever the others are.
        """
        own = matrix[kept:, kept:]
        across = np.linalg.solve(own, np.column_stack([matrix[kept:, :kept], fall[kept:]]))
        return cls(
            matrix[:kept, :kept] - matrix[:kept, kept:] @ across[:, :kept],
            fall[:kept] - matrix[:kept, kept:] @ across[:, kept],
        )

    def at(self, step: Float64) -> Normal:
        """
        Return the same about a point that is a step away.
        """
        return Normal(self.matrix, self.fall - self.matrix @ step)


@dataclass(frozen=True)
class Shared:
    """
    What runs have in common.

    Attributes
    ----------
    step : (q,)
        Mean, from the point that the runs are linear about.
    covariance : (q, q)
    scatter, scatter_low, scatter_high
        Standard deviation of the factors of single runs: median, 16 and 84 %.
    """

    step: Float64
    covariance: Float64
    scatter: float
    scatter_low: float
    scatter_high: float


@dataclass(frozen=True)
class Factor:
    """
    By what factor - 1 a run differs from what others share.

    Attributes
    ----------
    value, sd
    away
        In standard deviations, the scatter included.
    """

    value: float
    sd: float
    away: float


def share(
    runs: Sequence[Normal], prior: Normal, along: Float64, *, usual_scatter: float
) -> Shared:
    """
    Learn what runs share, and their scatter.

    Parameters
    ----------
    runs
        About the same point.
    prior
        Of what is shared.
    along : (q,)
        What a factor of 1 + 1 on a run does to the unknowns.
    usual_scatter
        Half-Cauchy scale of the scatter before the data.

    Notes
    -----
    Random effects with the scatter integrated over: its marginal posterior
    weighs the mean and the covariance at each scatter.
    """
    log_weight = np.empty(len(_SCATTERS))
    steps, covariances = [], []
    for i, scatter in enumerate(_SCATTERS):
        matrix, fall = prior.matrix.copy(), prior.fall.copy()
        # density of the scatter itself, on a grid of its logarithm
        log = np.log(scatter) - np.log1p((scatter / usual_scatter) ** 2)
        for run in runs:
            pull, push = run.matrix @ along, float(along @ run.fall)
            freedom = 1.0 / scatter**2 + float(along @ pull)
            matrix += run.matrix - np.outer(pull, pull) / freedom
            fall += run.fall - pull * push / freedom
            log += 0.5 * (push**2 / freedom - np.log(scatter**2 * freedom))
        covariance = np.linalg.inv(matrix)
        step = covariance @ fall
        log_weight[i] = log + 0.5 * (fall @ step - np.linalg.slogdet(matrix)[1])
        steps.append(step)
        covariances.append(covariance)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    table = np.array(steps)
    mean = weight @ table
    about = table - mean
    covariance = np.tensordot(weight, np.array(covariances), 1) + (weight * about.T) @ about
    low, middle, high = np.exp(
        np.interp((0.16, 0.5, 0.84), np.cumsum(weight) - 0.5 * weight, np.log(_SCATTERS))
    )
    return Shared(mean, covariance, float(middle), float(low), float(high))


def factor(run: Normal, others: Shared, along: Float64) -> Factor:
    """
    Hold a run against what others share.
    """
    known = np.linalg.inv(others.covariance)
    run = run.at(others.step)
    pull = run.matrix @ along
    through = np.linalg.solve(known + run.matrix, np.column_stack([pull, run.fall]))
    information = float(along @ pull - pull @ through[:, 0])
    value = float(along @ run.fall - pull @ through[:, 1]) / information
    variance = 1.0 / information
    return Factor(
        value, float(np.sqrt(variance)), value / float(np.sqrt(variance + others.scatter**2))
    )
