# SPDX-License-Identifier: Apache-2.0
"""The first fits of a coastdown: they find how good each row is, and whether the log is off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.ode_fit.coast import CURRENT, LOG_SCALE
from shipdrag_ros.estimation.ode_fit.fitted import FittedMotion
from shipdrag_ros.estimation.ode_fit.problem import Problem
from shipdrag_ros.estimation.ode_fit.weighing import drop_gross, weigh
from shipdrag_ros.inference.noise import whiten

_ROUNDS, _ROUNDS_DISTURBED = 3, 2  # of the weights
_SCALE_SIGNIFICANT = 3.0  # standard deviations


def fit_robustly(problem: Problem) -> tuple[FittedMotion, Problem]:
    """
    Fit the first family; weigh the rows on the way.

    Returns
    -------
    first, problem
        With the variance of each input as it scatters, larger for outliers
        (Huber's weights).

    Raises
    ------
    EstimationError
        If the fit does not converge.
    """
    base = problem.white.variance.copy()
    weight = np.ones(len(base))
    start = problem.start()
    unknown = problem.first.size + len(problem.extras)
    crude = FittedMotion(problem.first, start, np.zeros((len(start), len(start))))
    drop_gross(problem.residual(crude), problem.rows.kind, weight)
    for _ in range(_ROUNDS):
        problem = problem.weighted(base / weight)
        first, white = problem.fit_first(start)
        if first is None:
            raise EstimationError(
                'the equation of motion could not be fitted to the window: give one coastdown, '
                'with the engine stopped; leave out an input that moves otherwise, as a path '
                'does that drifts sideways; or set `estimator` to log_time or one of s1_speed, '
                's1_position, s1_joint'
            )
        start = first.unknowns
        weigh(white, problem.rows.kind, problem.steady, unknown, base, weight)
    assert first is not None
    return first, problem.weighted(base / weight)


def weigh_disturbed(problem: Problem, near: FittedMotion) -> Problem:
    """
    Weigh the rows by what a fit leaves that slow disturbances do not explain.
    """
    base = problem.white.variance.copy()
    weight = np.ones(len(base))
    residual = problem.residual(near)
    unknown = problem.first.size + len(problem.extras)
    for _ in range(_ROUNDS_DISTURBED):
        problem = problem.weighted(base / weight)
        white = residual.reshape(1, -1).copy()
        whiten(problem.rows, white, problem.noise)
        weigh(white[0], problem.rows.kind, problem.steady, unknown, base, weight)
    return problem.weighted(base / weight)


def with_log_scale(problem: Problem, first: FittedMotion) -> tuple[FittedMotion, Problem]:
    """
    Take the scale of the log as unknown where the data show that it is not 1.
    """
    if CURRENT not in problem.extras:
        return first, problem
    scaled = replace(problem, extras=(*problem.extras, LOG_SCALE))
    found, _ = scaled.fit_first(first.unknowns)
    if found is None:
        return first, problem
    scale, sd = found.unknown(LOG_SCALE)
    if abs(scale) <= _SCALE_SIGNIFICANT * sd:
        return first, problem
    return found, scaled
