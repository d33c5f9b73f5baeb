# SPDX-License-Identifier: Apache-2.0
"""The evidence of a hypothesis: what is off, under the covariance of all that is random."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import solve_triangular

from benchmarks.worlds.hidden_b.hulls import Array

EDDIES = (0.055, 0.1, 0.185)  # percent of the speed: middles of thirds of what is drawn
HELM = (0.35, 0.65)  # degrees: of halves
Weather = tuple[float, float]  # sizes of eddies and of helm


@dataclass(frozen=True)
class Terms:
    """
    What the evidence of a fit is made of.

    Attributes
    ----------
    parts
        Covariances: of all but eddies and helm, of either of size 1.
    smooth
        Columns of smooth unknowns, by name.
    whole
        What is off at the middle of the prior, linear about the best.
    slopes
        By standard normal numbers.
    less
        To be taken from the logarithm.
    """

    parts: Sequence[Array]
    smooth: dict[str, Array]
    whole: Array
    slopes: Array
    less: float

    def evidence(self, weather: Weather, kind: str | None = None) -> float:
        """
        Return the logarithm of the evidence, with an unknown of a kind beside it.
        """
        n = len(self.parts[0])
        covariance = self.slopes @ self.slopes.T + np.eye(len(self.whole))
        covariance[:n, :n] += summed(self.parts, weather) - np.eye(n)
        if kind is not None:
            covariance[:n, :n] += self.smooth[kind] @ self.smooth[kind].T
        factor = np.linalg.cholesky(covariance)
        white = solve_triangular(factor, self.whole, lower=True, check_finite=False)
        return -0.5 * float(white @ white) - float(np.sum(np.log(np.diag(factor)))) - self.less

    def beside(self, weather: Weather) -> dict[str, float]:
        """
        Return the same with each kind of unknown.
        """
        return {kind: self.evidence(weather, kind) for kind in self.smooth}

    def weather(self) -> Weather:
        """
        Return how large eddies and helm are, by what explains most; unknowns are let in.
        """

        def best(weather: Weather) -> float:
            kinds = (None, 'force, quick', 'force and helm')
            return max(self.evidence(weather, kind) for kind in kinds)

        return max(product(EDDIES, HELM), key=best)


def summed(parts: Sequence[Array], weather: Weather) -> Array:
    """
    Return the covariance of a row in a weather, of its parts.
    """
    return parts[0] + weather[0] ** 2 * parts[1] + weather[1] ** 2 * parts[2]
