# SPDX-License-Identifier: Apache-2.0
"""
What models share that predict their rows directly, under noise of a dense covariance.

Sailing and the form fitted here are two. Their noise is learnt from the record
itself, beside all that is fitted.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from shipdrag_ros.diagnosis.advice import declared
from shipdrag_ros.diagnosis.fitting import Fit
from shipdrag_ros.diagnosis.model import Hypothesis, Linear, Model
from shipdrag_ros.diagnosis.result import DiagnosisResult, Gap, Where
from shipdrag_ros.diagnosis.terms import trial_z
from shipdrag_ros.diagnosis.verdict import Judgement
from shipdrag_ros.inference.decision import Verdict
from shipdrag_ros.samples import Float64

_STEP_Z = 1e-3


class DirectModel(Model):
    """
    A model that predicts its rows, given unknowns.

    Attributes
    ----------
    factor : (n, n)
        Lower triangular: the covariance of the noise is factor factor^T.
    """

    factor: Float64
    free: ClassVar[Float64] = np.empty(0)
    iterations: ClassVar[int] = 40
    converged: ClassVar[float] = 1e-4
    hopeless: ClassVar[float] = math.inf

    @property
    @abstractmethod
    def measured(self) -> Float64:
        """Rows, (n,)."""

    @abstractmethod
    def predict(self, hypothesis: Hypothesis, z: Float64) -> Float64:
        """
        Return the rows, (n, k), that a hypothesis predicts at unknowns (p, k).
        """

    def linearise(
        self,
        hypotheses: Sequence[Hypothesis],
        at: Sequence[Float64],
        near: Sequence[Linear | None] | None = None,
    ) -> list[Linear]:
        """
        Return the whitened rows of each hypothesis about some unknowns.
        """
        found = []
        for hypothesis, z in zip(hypotheses, at, strict=True):
            steps = _STEP_Z * np.eye(len(z))
            with np.errstate(over='ignore', invalid='ignore'):  # a motion that runs away
                both = self.predict(hypothesis, z[:, None] + np.hstack([steps, -steps]))
                ahead, behind = both[:, : len(z)], both[:, len(z) :]
                residual = self.measured - self.predict(hypothesis, z[:, None])[:, 0]
                slopes = (ahead - behind) / (2.0 * _STEP_Z)
                table = self._whitened(np.column_stack([residual, slopes]))
            found.append(Linear(hypothesis, z, (table,), (residual,)))
        return found

    def responses(self, base: Linear, hypotheses: Sequence[Hypothesis]) -> Float64:
        """
        Return the linear response to the last term of each, (hypotheses, n).
        """
        before = self.predict(base.hypothesis, base.z[:, None])[:, 0]
        found = []
        for hypothesis in hypotheses:
            first, *others = hypothesis.terms[-1].unknowns
            z = np.concatenate([base.z, [trial_z(first)], [u.start for u in others]])
            found.append(self.predict(hypothesis, z[:, None])[:, 0] - before)
        return self._whitened(np.array(found).T)

    def _whitened(self, columns: Float64) -> Float64:
        """Return whitened lines of columns, (k, n)."""
        found = solve_triangular(self.factor, columns, lower=True, check_finite=False).T
        return np.ascontiguousarray(found, np.float64)


def diagnosis_of_speeds(judged: Judgement, where: Where, **rest: Any) -> DiagnosisResult:
    """
    Return the result of a model whose rows are speeds.

    Parameters
    ----------
    judged
        Of such a model.
    where
        Where model and data may disagree.
    **rest
        What else there is to be said, as in `DiagnosisResult`.

    Returns
    -------
    Diagnosis
        Whose advice is what the effects declare; nothing is held out.
    """
    one_of = judged.verdict is Verdict.ONE_OF
    return judged.diagnosis(
        would_decide=declared(judged.candidates) if one_of else (),
        where=None if judged.verdict is Verdict.NONE else where,
        before=_gap(judged.found.nothing),
        after=_gap(judged.found.best) if judged.missing else None,
        held_out_before=None,
        held_out_after=None,
        **rest,
    )


def _gap(fit: Fit) -> Gap:
    residual = fit.best.residuals[0]
    return Gap(float(np.sqrt(np.mean(residual**2))), None, fit.chi2_per_row)


def learn_factor(
    covariance: Callable[[Float64], Float64],
    residual: Float64,
    slopes: Float64,
    *,
    sd_of_log: Float64,
    evaluations: int,
) -> Float64:
    """
    Learn the covariance of noise beside what is fitted.

    Parameters
    ----------
    covariance
        From logarithms (q,) of what it depends on, over what is usual.
    residual : (n,)
        Of a rough fit.
    slopes : (n, p)
        Of the prediction, by as much as the unknowns may yet move.
    sd_of_log : (q,)
        Prior standard deviations of the logarithms.
    evaluations
        At most.

    Returns
    -------
    (n, n)
        Lower triangular factor of the most probable covariance.
    """
    open_ = slopes @ slopes.T

    def cost(x: Float64) -> float:
        factor = np.linalg.cholesky(covariance(x) + open_)
        white = solve_triangular(factor, residual, lower=True, check_finite=False)
        log_det = 2.0 * float(np.log(np.diag(factor)).sum())
        return float(white @ white) + log_det + float(((x / sd_of_log) ** 2).sum())

    corners = np.vstack([np.zeros(len(sd_of_log)), 0.7 * np.eye(len(sd_of_log))])
    options = {'maxfev': evaluations, 'xatol': 0.05, 'fatol': 0.05, 'initial_simplex': corners}
    found = minimize(cost, corners[0], method='Nelder-Mead', options=options)
    return np.asarray(np.linalg.cholesky(covariance(found.x)), np.float64)
