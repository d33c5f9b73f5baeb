# SPDX-License-Identifier: Apache-2.0
"""The first fits of a coastdown: they find how good each row is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.ode_fit.fitted import FittedMotion
from shipdrag_ros.estimation.ode_fit.problem import Problem
from shipdrag_ros.estimation.ode_fit.weighing import drop_gross, weigh
from shipdrag_ros.inference.noise import whiten

_ROUNDS, _ROUNDS_DISTURBED = 3, 2  # of the weights


@dataclass(frozen=True)
class Start:
    """
    What the whole law is fitted to, and a first fit of it.

    Attributes
    ----------
    first
        Fit of the first family.
    full, condensed
        Every row weighed; a row a step.
    near
        The whole law; None where it does not converge.
    """

    first: FittedMotion
    full: Problem
    condensed: Problem
    near: FittedMotion | None

    @classmethod
    def of(cls, problem: Problem, first: FittedMotion) -> Start:
        """
        Fit the whole law, about a fit of the first family.

        Parameters
        ----------
        problem
            Every row of the window.
        first
            Of the coastdown.

        Returns
        -------
        Start
            Its `near` is None where the whole law does not converge.
        """
        full = weigh_disturbed(problem, first)
        condensed = full.condensed(first)
        return cls(first, full, condensed, condensed.average(condensed.whole(first)))

    def again(self, problem: Problem) -> Start:
        """
        Return the start about a first fit to all rows.

        The coastdown alone cannot show where the stop was: without the record before it, an
        onset that was found seconds early passes for a higher speed.

        Parameters
        ----------
        problem
            As in `of`.

        Returns
        -------
        Start
            The same where that does not converge either.
        """
        first, _ = self.full.fit_first(self.first.unknowns)
        return self if first is None else Start.of(problem, first)


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
        If the fit does not converge even once.
    """
    base = problem.white.variance.copy()
    weight = np.ones(len(base))
    start = problem.start()
    unknown = problem.first.size + len(problem.extras)
    crude = FittedMotion(problem.first, start, np.zeros((len(start), len(start))))
    drop_gross(problem.residual(crude), problem.rows.kind, weight)
    first: FittedMotion | None = None
    for _ in range(_ROUNDS):
        weighted = problem.weighted(base / weight)
        found, white = weighted.fit_first(start)
        if found is None:
            # a round before it is near enough to begin with
            break
        problem, first, start = weighted, found, found.unknowns
        weigh(white, problem.rows.kind, problem.steady, unknown, base, weight)
    else:
        problem = problem.weighted(base / weight)
    if first is None:
        raise EstimationError(
            'the equation of motion could not be fitted to the window: give one coastdown, '
            'with the engine stopped; leave out an input that moves otherwise, as a path '
            'does that drifts sideways; or set `estimator` to log_time or one of s1_speed, '
            's1_position, s1_joint'
        )
    return first, problem


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
