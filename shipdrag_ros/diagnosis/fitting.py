# SPDX-License-Identifier: Apache-2.0
"""
Hypotheses fitted all in step, and their evidence.

Damped Gauss-Newton; the evidence is Laplace's about the best fit, with the part
beyond the end of a one-sided parameter taken off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, product

import numpy as np
from scipy.special import log_ndtr

from shipdrag_ros.diagnosis.model import Hypothesis, Linear, Linearised
from shipdrag_ros.inference.gaussian import Factored
from shipdrag_ros.parameter import Shape
from shipdrag_ros.progress import Progress, silent
from shipdrag_ros.samples import Float64

_ANEW = (0, 3)  # iterations in which all derivatives are found anew
_DAMPING = 1e-2
_HOPELESS = 1e4  # damping
_NEARER = 0.2  # part of the way to the best that a step must make good from there
_SMALL = 0.25  # of usual


@dataclass(frozen=True)
class Fit:
    """
    A fitted hypothesis.

    Attributes
    ----------
    best
        At the most probable unknowns.
    covariance : (p, p)
        NaN where it could not be fitted.
    log_evidence
        With the prior probability, less a constant.
    """

    best: Linear
    covariance: Float64
    log_evidence: float

    @property
    def hypothesis(self) -> Hypothesis:
        """What was fitted."""
        return self.best.hypothesis

    @property
    def log_likelihood(self) -> float:
        """Evidence without the prior probability."""
        return self.log_evidence - self.hypothesis.log_prior

    @property
    def chi2_per_row(self) -> float:
        """About 1 where the noise explains what is left."""
        return self.best.chi2 / self.best.rows


def fit(
    model: Linearised,
    hypotheses: Sequence[Hypothesis],
    starts: Sequence[Float64],
    *,
    progress: Progress = silent,
    stage: str = 'fitting hypotheses',
) -> list[Fit]:
    """
    Fit hypotheses; those that cannot be have no evidence.

    Parameters
    ----------
    model
        That the hypotheses are of.
    hypotheses
    starts
        (p,) each, as `Linear.z`.
    progress
        Called with how many are fitted.
    stage
        What they are, for it.

    Returns
    -------
    list of Fit
        In the order of the hypotheses.

    Notes
    -----
    Levenberg and Marquardt, all hypotheses in step; one that is far behind the
    best and hardly comes nearer is left where it is.
    """
    states = [
        _FitState(h, z.copy(), model.converged) for h, z in zip(hypotheses, starts, strict=True)
    ]
    active = states
    for number in range(model.iterations):
        if not active:
            break
        progress(stage, len(states) - len(active), len(states))
        near = [None if number in _ANEW else s.best for s in active]
        points = model.linearise([s.hypothesis for s in active], [s.trial for s in active], near)
        for state, point in zip(active, points, strict=True):
            state.take(point)
        best = min(state.cost for state in states)
        active = [
            state for state in active if not state.done and not state.lost(best, model.hopeless)
        ]
    return [state.result() for state in states]


class _FitState:
    """A hypothesis on its way to the best fit."""

    def __init__(self, hypothesis: Hypothesis, z: Float64, converged: float) -> None:
        self.converged = converged
        self.hypothesis = hypothesis
        self.trial = z
        self.best: Linear | None = None
        self.damping = 0.0
        self.fallen = math.inf
        self.done = False
        self._half = np.zeros(len(z), bool)
        for i, unknown in enumerate(hypothesis.unknowns):
            self._half[i] = unknown.prior.shape is Shape.HALF_NORMAL

    def take(self, point: Linear) -> None:
        """Go on from a point that was tried, or from the one before with a smaller step."""
        if self.best is None or point.cost < self.best.cost + 1e-9:
            self.fallen = math.inf if self.best is None else self.best.cost - point.cost
            self.best = point
            self.done = self.fallen < self.converged or not math.isfinite(point.cost)
            self.damping = 0.2 * self.damping if self.damping > 1e-4 else 0.0
        else:
            self.damping = max(8.0 * self.damping, _DAMPING)
            self.done = self.damping > _HOPELESS
        if not self.done:
            self.trial = self._step()

    @property
    def cost(self) -> float:
        """-2 ln of the posterior at the best so far."""
        return math.inf if self.best is None else self.best.cost

    def lost(self, cost: float, hopeless: float) -> bool:
        """
        Say whether it is far behind another one, and hardly comes nearer.
        """
        behind = self.cost - cost
        return behind > hopeless and self.fallen < _NEARER * behind

    def _step(self) -> Float64:
        assert self.best is not None
        matrix, negative_gradient = self.best.normal_equations
        free = np.ones(len(negative_gradient), bool)
        while True:
            size = np.sqrt(np.maximum(np.diag(matrix)[free], 1e-300))
            scaled = matrix[np.ix_(free, free)] / np.outer(size, size)
            scaled[np.diag_indices_from(scaled)] *= 1.0 + self.damping
            step = np.zeros(len(negative_gradient))
            step[free] = (
                np.linalg.lstsq(scaled, negative_gradient[free] / size, rcond=1e-13)[0] / size
            )
            trial: Float64 = self.best.z + step
            # one that would leave its side at once is held where it ends
            held = free & self._half & (trial < 0.0) & (self.best.z <= 0.0)
            if not held.any():
                return np.where(self._half, np.maximum(trial, 0.0), trial)
            free &= ~held

    def result(self) -> Fit:
        """Return the fit, with Laplace's evidence."""
        best = self.best
        assert best is not None
        failed = Fit(best, np.full((len(best.z), len(best.z)), np.nan), -math.inf)
        if not math.isfinite(best.cost):
            return failed
        matrix, negative_gradient = best.normal_equations
        covariance, log_evidence = self._laplace(matrix, negative_gradient, best.cost)
        if not math.isfinite(log_evidence):
            return failed
        groups = self.hypothesis.of_one_size
        for small in product(*(([], group) for group in groups)):
            if any(small):
                log_evidence = np.logaddexp(log_evidence, self._if_small([*chain(*small)]))
        log_evidence = float(log_evidence) - len(groups) * math.log(2.0)
        return Fit(best, covariance, log_evidence + self.hypothesis.log_prior)

    def _if_small(self, places: list[int]) -> float:
        """Return the log evidence where some unknowns are small."""
        assert self.best is not None
        matrix, negative_gradient = (each.copy() for each in self.best.normal_equations)
        z, more = self.best.z[places], _SMALL**-2 - 1.0
        matrix[places, places] += more
        negative_gradient[places] -= more * z
        cost = self.best.cost + more * float(z @ z)
        return self._laplace(matrix, negative_gradient, cost)[1] - len(places) * math.log(_SMALL)

    def _laplace(
        self, matrix: Float64, negative_gradient: Float64, cost: float
    ) -> tuple[Float64, float]:
        """Return covariance and log evidence of what is as good as normal."""
        assert self.best is not None
        try:
            factored = Factored.of(matrix)
        except np.linalg.LinAlgError:
            return matrix, -math.inf
        covariance = factored.inverse
        # where the fit is held at the end of a parameter, the best is beyond
        step = covariance @ negative_gradient
        log_evidence = -0.5 * (cost - float(negative_gradient @ step))
        log_evidence -= 0.5 * factored.log_det
        for i in np.flatnonzero(self._half):
            beyond = (self.best.z[i] + step[i]) / math.sqrt(covariance[i, i])
            log_evidence += math.log(2.0) + float(log_ndtr(beyond))
        return covariance, log_evidence
