# SPDX-License-Identifier: Apache-2.0
"""
Nested Laplace: Gaussian inside, a deterministic design over the noise and the priors outside.

About one linearisation of the motion every setting of the noise and every family of priors (a
hypothesis, or a size of one) is a linear model. Each has its evidence; what leaves is the
mixture. No random numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.inference.gaussian import cholesky, products_of, substitute
from shipdrag_ros.inference.learning import learn
from shipdrag_ros.inference.learning import prior as prior_of
from shipdrag_ros.inference.noise import Noise, whiten
from shipdrag_ros.inference.rows import Rows
from shipdrag_ros.inference.sampling import Seen
from shipdrag_ros.inference.settings import NoisePosterior, Settings, noise_of
from shipdrag_ros.posterior.motion import damping_of, predict
from shipdrag_ros.posterior.problem import Family, RunModel
from shipdrag_ros.samples import Float64

_ITERATIONS = 12  # of Gauss and Newton, to where the noise is learnt
_ROUNDS = 6  # linearisations about the mean of the mixture
_CLOSE = 0.05  # of chi^2, between one mean and the next
_LEAST = 1e-3  # weight of a model; less is left out of the spread
_LARGEST_STEP = 3.0  # of a Gauss-Newton step, in standard deviations of the prior


class Families(NamedTuple):
    """
    Priors of the unknowns, one family a line; `log_chance` (f,) are their logarithms.
    """

    mean: Float64
    precision: Float64
    log_chance: Float64


@dataclass(frozen=True)
class RunPosterior:
    """
    What a run says of all unknowns.

    Attributes
    ----------
    problem
    mean, covariance : (p,), (p, p)
        Of the mixture over families and settings of the noise.
    family : (f,)
        Probability of each family of `problem.families`.
    noise
        Settings with their probabilities.
    converged
        Whether the mean of the mixture stood still.
    """

    problem: RunModel
    mean: Float64
    covariance: Float64
    family: Float64
    noise: NoisePosterior
    converged: bool

    def chance(self, name: str) -> float:
        """
        Return the probability of all families of a hypothesis.
        """
        mine = [each.name == name for each in self.problem.families]
        return float(self.family[mine].sum())


@compiled
def of_family(
    products: Float64, mean: Float64, precision: Float64
) -> tuple[bool, float, Float64, Float64, Float64]:
    """
    Solve one linear model.

    Parameters
    ----------
    products : (1 + p, 1 + p)
        Of whitened residual and columns.
    mean, precision : (p,)
        Of the prior, from where the model is linear.

    Returns
    -------
    solved, log_evidence, step, lower, scale
        The logarithm is without -log det / 2 of the rows' covariance.
    """
    p = len(mean)
    matrix, right = products[1:, 1:].copy(), np.empty((p, 1))
    log_evidence = -0.5 * products[0, 0]
    for a in range(p):
        matrix[a, a] += precision[a]
        right[a, 0] = products[1 + a, 0] + precision[a] * mean[a]
        log_evidence += 0.5 * np.log(precision[a]) - 0.5 * precision[a] * mean[a] ** 2
    solved, lower, scale = cholesky(matrix, 0.0)
    step = np.zeros(p)
    if solved:
        step = substitute(lower, scale, right)[:, 0]
        for a in range(p):
            log_evidence += 0.5 * step[a] * right[a, 0] - np.log(lower[a, a] / scale[a])
    return solved, log_evidence, step, lower, scale


@compiled
def mix(
    table: Float64,
    rows: Rows,
    white: Noise,
    steady: int,
    settings: Settings,
    families: Families,
    taught: Families,
) -> tuple[Float64, Float64, Float64]:
    """
    Average linear models over settings of the noise and families of priors.

    Parameters
    ----------
    table : (1 + p, n)
        Residual and columns, not whitened.
    rows, white, steady
        See `noise_of`.
    settings
        Weighted by the mean evidence of `taught`, as `learn` does.
    families, taught
        Means count from where the model is linear.

    Returns
    -------
    step, covariance, weight
        Of the mixture; `weight` (s, f) sums to 1.
    """
    s, f, p = len(settings.weight), len(families.log_chance), len(table) - 1
    t = len(taught.log_chance)
    logs, of_taught = np.full((s, f), -np.inf), np.full((s, t), -np.inf)
    every = np.empty((s, p + 1, p + 1))
    for k in range(s):
        noise = noise_of(settings, k, rows, white, steady)
        copy = table.copy()
        log_det = whiten(rows, copy, noise)
        every[k] = products_of(copy)
        for q in range(f):
            solved, log_evidence, _, _, _ = of_family(
                every[k], families.mean[q], families.precision[q]
            )
            if solved and np.isfinite(log_evidence):
                logs[k, q] = log_evidence - 0.5 * log_det
        for q in range(t):
            solved, log_evidence, _, _, _ = of_family(
                every[k], taught.mean[q], taught.precision[q]
            )
            if solved and np.isfinite(log_evidence):
                of_taught[k, q] = log_evidence - 0.5 * log_det
    weight, top = np.zeros((s, f)), logs.max()
    for k in range(s):
        alike = np.exp(of_taught[k] - top).sum() / t
        for q in range(f):
            if alike > 0.0:
                of_family_q = np.exp(logs[k, q] - top + families.log_chance[q])
                weight[k, q] = settings.weight[k] * of_family_q / alike
    weight /= weight.sum()
    mean, second = np.zeros(p), np.zeros((p, p))
    kept = 0.0
    for k in range(s):
        for q in range(f):
            if weight[k, q] < _LEAST:
                continue
            kept += weight[k, q]
            _, _, step, lower, scale = of_family(every[k], families.mean[q], families.precision[q])
            covariance = substitute(lower, scale, np.eye(p))
            for a in range(p):
                mean[a] += weight[k, q] * step[a]
                for b in range(p):
                    second[a, b] += weight[k, q] * (covariance[a, b] + step[a] * step[b])
    mean /= kept
    second /= kept
    for a in range(p):
        for b in range(p):
            second[a, b] -= mean[a] * mean[b]
    return mean, second, weight


def _families(problem: RunModel, families: tuple[Family, ...], now: Float64) -> Families:
    """Return what families say of the unknowns that are free, from some unknowns on."""
    free = problem.free
    return Families(
        np.array([each.mean[free] - now[free] for each in families]),
        np.array([each.precision[free] for each in families]),
        np.log(np.array([each.chance for each in families])),
    )


def _linear(problem: RunModel, now: Float64) -> tuple[Float64, Noise]:
    """Return residual and columns of what is free, and the noise as the hull damps there."""
    table, speed = predict(problem.forces, now, problem.grid_s, problem.rows)
    if not np.all(np.isfinite(table)):
        raise EstimationError(
            'the motion is not finite under what the readings ask for: give a window that lies in '
            'one coastdown, or the time of the stop'
        )
    theta = now[: problem.coefficients]
    damping, inertia = damping_of(problem.forces, theta, np.maximum(speed, 0.0))
    kept = np.concatenate([[0], 1 + problem.free])
    return table[kept], problem.white._replace(damping_1_s=damping, inertia=inertia)


def _mixed(
    problem: RunModel, now: Float64, settings: Settings
) -> tuple[Float64, Float64, Float64]:
    """Return step, covariance and weights at some unknowns."""
    table, white = _linear(problem, now)
    families = _families(problem, problem.families, now)
    taught = _families(problem, problem.taught, now)
    of_free, spread, weight = mix(
        table, problem.rows, white, problem.steady, settings, families, taught
    )
    step, covariance = np.zeros(len(now)), np.diag(1.0 / problem.families[0].precision)
    step[problem.free] = of_free
    covariance[np.ix_(problem.free, problem.free)] = spread
    return step, covariance, weight


def _seen(problem: RunModel, now: Float64) -> Seen:
    table, white = _linear(problem, now)
    families = _families(problem, problem.taught, now)
    return Seen(problem.rows, table, families.mean, families.precision, white, problem.steady)


def _typical(problem: RunModel, noise: NoisePosterior) -> Float64:
    """Climb, by Gauss and Newton, to the mean under one typical setting of the noise."""
    now = problem.start.copy()
    sd = 1.0 / np.sqrt(problem.widest.precision)
    for _ in range(_ITERATIONS):
        step, _, _ = _mixed(problem, now, noise.typical)
        length = float(np.max(np.abs(step[: problem.coefficients]) / sd[: problem.coefficients]))
        now += step * min(1.0, _LARGEST_STEP / max(length, 1e-12))
        if length < _CLOSE:
            break
    return now


def infer(problem: RunModel, *, quick: bool = False) -> RunPosterior:
    """
    Return the posterior of a run.

    Parameters
    ----------
    problem
        Rows, motion and priors.
    quick
        Times of the noise as they usually are, and fewer settings.

    Raises
    ------
    EstimationError
        If the motion runs away.
    """
    first = prior_of(_seen(problem, problem.start), problem.speed_m_s)
    now = _typical(problem, first)
    noise = learn(_seen(problem, now), problem.speed_m_s, quick=quick)
    away = np.inf
    for _ in range(_ROUNDS):
        step, covariance, weight = _mixed(problem, now, noise.settings)
        now = now + step
        moved = step[problem.free]
        spread = covariance[np.ix_(problem.free, problem.free)]
        away = float(moved @ np.linalg.solve(spread, moved))
        if away < _CLOSE:
            break
    settings = noise.settings._replace(weight=weight.sum(axis=1))
    noise = replace(noise, settings=settings)
    return RunPosterior(problem, now, covariance, weight.sum(axis=0), noise, away < 1.0)
