# SPDX-License-Identifier: Apache-2.0
"""
A baseline that several runs share, and by how much single runs differ besides.

Each run is linear in shared unknowns, the same in all, and has a factor of its
own on the resistance as a whole. How far these factors scatter is learnt with
the rest: no two runs meet the same hull, sea and air. Only r / (1 + n_r) shows in
a coastdown: n_r is as the ship file states it, and what is learnt is the
retardation. That a baseline may be far worse than it says is the prior of the
posterior: its families, each by its probability.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import softmax

from shipdrag_ros.diagnosis.observation import CoastRun, Observation
from shipdrag_ros.diagnosis.sights import ship_runs
from shipdrag_ros.inference.decision import NONE
from shipdrag_ros.inference.linear import solve
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.compare import Comparing, Fitted
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import CoefficientSd, Ship, TableBaseline

_LEAST_SD = 0.005  # what is stated more surely is learnt all the same
_POINTS = 60
_SCATTERS = np.geomspace(1e-4, 1.0, 81)  # of the factors, that are tried


class Shared(NamedTuple):
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


class Factor(NamedTuple):
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


class Normals(NamedTuple):
    """
    What runs show of the unknowns that they share, as normal equations about some point.

    Attributes
    ----------
    matrix : (j, q, q)
    gradient : (j, q)
        The step from the point that a run alone asks for is matrix^-1 gradient.
    """

    matrix: Float64
    gradient: Float64

    def without(self, run: int) -> Normals:
        """Return those of the other runs."""
        return Normals(*(np.delete(each, run, axis=0) for each in self))


def share(runs: Normals, prior: Float64, along: Float64, *, usual_scatter: float) -> Shared:
    """
    Learn what runs share, and their scatter.

    Parameters
    ----------
    runs
        In units of the standard deviation before the data.
    prior : (q,)
        Mean of what is shared before the data, from the point of the equations.
    along : (q,)
        What a factor of 1 + 1 on a run does to the unknowns.
    usual_scatter
        Half-Cauchy scale of the scatter before the data.

    Returns
    -------
    Shared
        Averaged over the posterior of the scatter.

    Notes
    -----
    Random effects with the scatter integrated over: its marginal posterior
    weighs the mean and the covariance at each scatter.
    """
    pull, push = runs.matrix @ along, runs.gradient @ along
    freedom = _SCATTERS[:, np.newaxis] ** -2.0 + pull @ along
    matrix = np.eye(len(along)) + runs.matrix.sum(axis=0)
    matrix = matrix - np.einsum('sj,jp,jq->spq', 1.0 / freedom, pull, pull)
    gradient = prior + runs.gradient.sum(axis=0) - (push / freedom) @ pull
    covariance = np.linalg.inv(matrix)
    steps = np.einsum('spq,sq->sp', covariance, gradient)
    # density of the scatter itself, on a grid of its logarithm
    log = np.log(_SCATTERS) - np.log1p((_SCATTERS / usual_scatter) ** 2)
    of_runs = push**2 / freedom - np.log(_SCATTERS[:, np.newaxis] ** 2 * freedom)
    log += 0.5 * (of_runs.sum(axis=1) - np.linalg.slogdet(matrix)[1])
    log += 0.5 * (gradient * steps).sum(axis=1)
    weight = softmax(log)
    mean = weight @ steps
    about = steps - mean
    low, middle, high = np.exp(
        np.interp((0.16, 0.5, 0.84), np.cumsum(weight) - 0.5 * weight, np.log(_SCATTERS))
    )
    total = np.tensordot(weight, covariance, 1) + (weight * about.T) @ about
    return Shared(mean, total, float(middle), float(low), float(high))


def factor(matrix: Float64, gradient: Float64, others: Shared, along: Float64) -> Factor:
    """
    Compare a run with what others share.

    Parameters
    ----------
    matrix, gradient : (q, q), (q,)
        Normal equations of the run.
    others
        What the other runs share.
    along : (q,)
        What a factor of 1 + 1 on a run does to the unknowns.

    Returns
    -------
    Factor
        Of the run over the others, - 1.
    """
    # what the others leave open counts as an error of the run
    through = along @ np.linalg.inv(np.eye(len(along)) + matrix @ others.covariance)
    information = float(through @ matrix @ along)
    value = float(through @ (gradient - matrix @ others.step)) / information
    sd = information**-0.5
    return Factor(value, sd, value / float(np.hypot(sd, others.scatter)))


@dataclass(frozen=True)
class SharedBaseline:
    """
    Runs, linear about a common fit.

    Attributes
    ----------
    ship
        Whose baseline may differ in all its parts.
    comparing
        Of the runs.
    fitted
        Nothing missing, all runs together.
    names
        Of the scales of the baseline, the first of the unknowns that runs share.
    unit, at, mean : (q,)
        Standard deviation before the data of each shared unknown, and in it the common fit,
        and the mean before the data from there.
    normals
        Of the runs, in these units.
    speed_m_s
        Lowest and highest of all runs.
    """

    ship: Ship
    comparing: Comparing
    fitted: Fitted
    names: tuple[str, ...]
    unit: Float64
    at: Float64
    mean: Float64
    normals: Normals
    speed_m_s: tuple[float, float]

    @classmethod
    def of(cls, runs: Sequence[CoastRun], ship: Ship, parameters: Parameters) -> SharedBaseline:
        """
        Fit the runs.

        Parameters
        ----------
        runs
            Clean, each with the steady record before the stop.
        ship
            With a baseline.
        parameters
            For the noise of the sensors and the convention of the heading.

        Returns
        -------
        SharedBaseline
            About the fit of all runs at once.
        """
        ship = _opened(ship)
        seen = [
            Observation.of(run.window.one_of_each(), ship, parameters, name=run.name)
            for run in runs
        ]
        comparing = Comparing(ship_runs(seen, ship), ship, ())
        fitted = next(fit for fit in comparing.compare().fitted if fit.names == NONE)
        equations = comparing.equations(fitted)
        families = comparing.runs.priors(fitted.hypothesis, fitted.at)
        logs, _, _ = solve(
            np.sum(equations, axis=0)[None], families.mean, families.precision, 0, 0
        )
        chance = softmax(logs[0] + families.log_chance)
        mean, precision = chance @ families.mean, chance @ families.precision
        own = comparing.runs.own
        shared = np.delete(np.arange(len(fitted.at)), np.concatenate(own))
        unit = precision[shared] ** -0.5
        of_runs = []
        kept = np.insert(1 + shared, 0, 0)  # the residual first
        for mine, both in zip(own, equations, strict=True):
            # the unknowns of a run alone, whatever they are: their Schur complement
            open_ = both[np.ix_(1 + mine, 1 + mine)] + np.diag(precision[mine])
            across = both[np.ix_(1 + mine, kept)]
            across[:, 0] += (precision * mean)[mine]
            given = across[:, 1:].T @ np.linalg.solve(open_, across)
            of_runs.append(both[np.ix_(1 + shared, kept)] - given)
        table = np.array(of_runs) * unit[:, np.newaxis]
        speeds = [each.speed_m_s for each in fitted.linear]
        return cls(
            ship,
            comparing,
            fitted,
            ('resistance',) if isinstance(ship.baseline, TableBaseline) else ('friction', 'wave'),
            unit,
            fitted.at[shared] / unit,
            mean[shared] / unit,
            Normals(table[:, :, 1:] * unit, table[:, :, 0]),
            (
                max(min(float(speed.min()) for speed in speeds), 0.0),
                max(float(speed.max()) for speed in speeds),
            ),
        )

    @property
    def along(self) -> Float64:
        """What a factor of 2 on a run does to the shared unknowns, in their units."""
        whole = np.zeros(len(self.unit))
        whole[: len(self.names)] = 1.0 / self.unit[: len(self.names)]
        return whole

    def shared(self, normals: Normals) -> Shared:
        """Return what runs share, with the prior of the baseline."""
        usual = float(stated_sd(self.ship)[0])
        return share(normals, self.mean, self.along, usual_scatter=usual)

    def factors(self) -> list[Factor]:
        """Compare each run with the others."""
        return [
            factor(matrix, gradient, self.shared(self.normals.without(j)), self.along)
            for j, (matrix, gradient) in enumerate(zip(*self.normals, strict=True))
        ]

    def of_parts(self, shared: Shared) -> tuple[Float64, Float64]:
        """
        Return the departure of each part from what is stated, and its covariance.

        The shape is counted in as far as the parts can follow it over the
        speeds of the runs.
        """
        parts = self.relative_parts(np.linspace(*self.speed_m_s, _POINTS))
        k = len(self.names)
        follow = np.linalg.lstsq(parts[:k].T, parts[k:].T, rcond=None)[0]
        onto = np.hstack([np.eye(k), follow]) * self.unit
        return onto @ (self.at + shared.step), onto @ shared.covariance @ onto.T

    def relative_parts(self, speed_m_s: Float64) -> Float64:
        """Return what each shared unknown adds to the resistance, relative, (q, n)."""
        law = self.comparing.runs.runs[0].model.law
        columns = np.concatenate([law.parts, law.shapes, law.humps])
        speed = np.maximum(speed_m_s, 1e-3 * law.speed_m_s[-1])
        whole = np.interp(speed, law.speed_m_s, law.parts.sum(axis=0))
        found = np.zeros((len(self.unit), len(speed)))  # those behind them are of the log
        for i, column in enumerate(columns):
            found[i] = np.interp(speed, law.speed_m_s, column) / whole
        return found

    def chi2_per_row(self, run: int) -> float:
        """Return what a run's own factor on the baseline leaves."""
        left = self.comparing.residuals(self.fitted)[run].whitened
        gained = float(self.along @ self.normals.gradient[run]) ** 2
        gained /= float(self.along @ self.normals.matrix[run] @ self.along)
        return (float(left @ left) - gained) / len(left)


def stated_sd(ship: Ship) -> Float64:
    """
    Return how well the parts of a baseline are stated, relative: friction and wave, or the whole.
    """
    base = ship.baseline
    assert base is not None
    if isinstance(base, TableBaseline):
        return np.array([base.relative_sd])
    return np.array([base.relative_sd.friction, base.relative_sd.wave])


def _opened(ship: Ship) -> Ship:
    """Return a ship whose baseline may differ in all its parts, and in retardation alone."""
    assert ship.baseline is not None
    base = replace(ship.baseline, relative_sd_of='retardation', run_scatter=0.0)
    if isinstance(base, TableBaseline):
        sd = max(base.relative_sd, _LEAST_SD)
        return replace(ship, baseline=replace(base, relative_sd=sd))
    parts = CoefficientSd(
        max(base.relative_sd.friction, _LEAST_SD), max(base.relative_sd.wave, _LEAST_SD)
    )
    return replace(ship, baseline=replace(base, relative_sd=parts))
