# SPDX-License-Identifier: Apache-2.0
"""Slow random disturbances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import Float64


@dataclass(frozen=True)
class GaussMarkov:
    """
    Stationary Gauss-Markov process of first order, AR(1) when sampled.

    Attributes
    ----------
    sd
        Standard deviation, in the unit of what is disturbed.
    correlation_time_s
        Lag at which the correlation has fallen to 1/e.
    """

    sd: float
    correlation_time_s: float

    def problems(self) -> list[str]:
        """
        Say what is impossible about it.
        """
        problems = []
        if not 0.0 <= self.sd < np.inf:
            problems.append(f'sd is {self.sd!r}, expected 0 or more')
        if not 0.0 < self.correlation_time_s < np.inf:
            problems.append(
                f'correlation_time_s is {self.correlation_time_s!r}, expected more than 0'
            )
        return problems

    def sample(self, time_s: Float64, rng: np.random.Generator) -> Float64:
        """
        Draw one realisation at ascending times, even or not.

        Parameters
        ----------
        time_s : (n,)
        rng
            Source of the n standard normal numbers.

        Returns
        -------
        (n,)
        """
        white = rng.standard_normal(len(time_s))
        decay = np.exp(-np.diff(time_s) / self.correlation_time_s)
        realisation: Float64 = self.sd * _filter(white, decay)
        return realisation


@compiled
def _filter(white: Float64, decay: Float64) -> Float64:
    result = white.copy()
    for i in range(1, len(result)):
        phi = decay[i - 1]
        result[i] = phi * result[i - 1] + np.sqrt(1.0 - phi * phi) * white[i]
    return result
