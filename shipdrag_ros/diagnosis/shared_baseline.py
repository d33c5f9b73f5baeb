# SPDX-License-Identifier: Apache-2.0
"""
A baseline that several runs share, and by how much single runs differ besides.

Each run is linear in shared unknowns, the same in all, and has a factor of its
own on the resistance as a whole. How far these factors scatter is learnt with
the rest: no two runs meet the same hull, sea and air. Only r / (1 + n_r) shows in
a coastdown: n_r is as the ship file states it, and what is learnt is the
retardation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from shipdrag_ros.diagnosis.observation import CoastRun, Observation
from shipdrag_ros.diagnosis.sights import ship_runs
from shipdrag_ros.inference.decision import NONE
from shipdrag_ros.inference.linear import Factored
from shipdrag_ros.parameter import WIDER, WIDER_CHANCE
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.compare import Comparing, Fitted
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import CoefficientSd, Ship, TableBaseline

_LEAST_SD = 0.005  # what is stated more surely is learnt all the same
_POINTS = 60
_SCATTERS = np.geomspace(1e-4, 1.0, 81)  # of the factors, that are tried


@dataclass(frozen=True)
class Normal:
    """
    What a run shows, as normal equations about some point.

    Attributes
    ----------
    matrix : (q, q)
    negative_gradient : (q,)
        The step from the point that the run alone asks for is matrix^-1 negative_gradient.
    """

    matrix: Float64
    negative_gradient: Float64

    @classmethod
    def without(cls, matrix: Float64, negative_gradient: Float64, kept: int) -> Normal:
        """
        Return the equations of the first unknowns, whatever the others are.

        Parameters
        ----------
        matrix, negative_gradient : (p, p), (p,)
            Normal equations.
        kept
            Number of first unknowns that are kept.

        Returns
        -------
        Normal
            Their Schur complement.
        """
        own = matrix[kept:, kept:]
        across = Factored.of(own).solve(
            np.column_stack([matrix[kept:, :kept], negative_gradient[kept:]])
        )
        return cls(
            matrix[:kept, :kept] - matrix[:kept, kept:] @ across[:, :kept],
            negative_gradient[:kept] - matrix[:kept, kept:] @ across[:, kept],
        )

    def at(self, step: Float64) -> Normal:
        """
        Return the same about a point that is a step away.

        Parameters
        ----------
        step : (q,)
            To the new point.

        Returns
        -------
        Normal
            Of the same matrix.
        """
        return Normal(self.matrix, self.negative_gradient - self.matrix @ step)


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
        Normal equations about the same point.
    prior
        Of what is shared.
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
    log_weight = np.empty(len(_SCATTERS))
    steps, covariances = [], []
    for i, scatter in enumerate(_SCATTERS):
        matrix, negative_gradient = prior.matrix.copy(), prior.negative_gradient.copy()
        # density of the scatter itself, on a grid of its logarithm
        log = np.log(scatter) - np.log1p((scatter / usual_scatter) ** 2)
        for run in runs:
            pull, push = run.matrix @ along, float(along @ run.negative_gradient)
            freedom = 1.0 / scatter**2 + float(along @ pull)
            matrix += run.matrix - np.outer(pull, pull) / freedom
            negative_gradient += run.negative_gradient - pull * push / freedom
            log += 0.5 * (push**2 / freedom - np.log(scatter**2 * freedom))
        factored = Factored.of(matrix)
        covariance = factored.inverse
        step = covariance @ negative_gradient
        log_weight[i] = log + 0.5 * (negative_gradient @ step - factored.log_det)
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

    Parameters
    ----------
    run
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
    known = Factored.of(others.covariance).inverse
    run = run.at(others.step)
    pull = run.matrix @ along
    both = np.column_stack([pull, run.negative_gradient])
    through = Factored.of(known + run.matrix).solve(both)
    information = float(along @ pull - pull @ through[:, 0])
    value = float(along @ run.negative_gradient - pull @ through[:, 1]) / information
    variance = 1.0 / information
    return Factor(
        value, float(np.sqrt(variance)), value / float(np.sqrt(variance + others.scatter**2))
    )


def tail_weight(away: Float64) -> Float64:
    """
    Return the precision that gives the slope of a heavy-tailed density.

    A baseline may be far worse than it says.

    Parameters
    ----------
    away : (n,)
        From what is stated, in standard deviations.
    """
    log_odds = np.log(WIDER * (1.0 - WIDER_CHANCE) / WIDER_CHANCE)
    wider = expit(0.5 * away**2 * (1.0 - WIDER**-2) - log_odds)
    result: Float64 = 1.0 - wider * (1.0 - WIDER**-2)
    return result


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
    unit, mean : (q,)
        Standard deviation and mean, in that unit, of each shared unknown before the data.
    normals
        One a run, of the shared unknowns in their units.
    speed_m_s
        Lowest and highest of all runs.
    """

    ship: Ship
    comparing: Comparing
    fitted: Fitted
    names: tuple[str, ...]
    unit: Float64
    mean: Float64
    normals: tuple[Normal, ...]
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
        names, sds = _stated(ship)
        _, mean, precision = comparing.prior_of(fitted)
        own = comparing.runs.own
        shared = np.delete(np.arange(len(fitted.at)), np.concatenate(own))
        unit = precision[shared] ** -0.5
        unit[: len(sds)] = sds
        normals = []
        for place, both in zip(own, comparing.equations(fitted), strict=True):
            open_ = both[1:, 1:].copy()
            open_[place, place] += precision[place]
            negative_gradient = both[1:, 0].copy()
            negative_gradient[place] += (precision * mean)[place]
            order = np.concatenate([shared, place])
            in_unit = np.concatenate([unit, np.ones(len(place))])
            matrix = open_[np.ix_(order, order)] * np.outer(in_unit, in_unit)
            normals.append(Normal.without(matrix, negative_gradient[order] * in_unit, len(shared)))
        speeds = [table.speed_m_s for table in fitted.linear]
        return cls(
            ship,
            comparing,
            fitted,
            names,
            unit,
            (mean + fitted.at)[shared] / unit,
            tuple(normals),
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

    def shared(self, normals: Sequence[Normal]) -> Shared:
        """Return what runs share, with the prior of the baseline."""
        away = self.z(None) - self.mean
        weight = np.ones(len(away))
        n = len(self.names)
        weight[:n] = tail_weight(away[:n])
        prior = Normal(np.diag(weight), -weight * away)
        return share(normals, prior, self.along, usual_scatter=float(self.unit[0]))

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
        return onto @ self.z(shared), onto @ shared.covariance @ onto.T

    def relative_parts(self, speed_m_s: Float64) -> Float64:
        """Return what each shared unknown adds to the resistance, relative, (q, n)."""
        law = self.comparing.runs.runs[0].model.law
        columns = np.concatenate([law.parts, law.shapes, law.humps])
        speed = np.maximum(speed_m_s, 1e-3 * law.speed_m_s[-1])
        found = np.zeros((len(self.unit), len(speed)))
        for i, column in enumerate(columns):
            found[i] = np.interp(speed, law.speed_m_s, column)
        result: Float64 = found / np.interp(speed, law.speed_m_s, law.parts.sum(axis=0))
        return result

    def z(self, shared: Shared | None) -> Float64:
        """Return the shared unknowns in their units; None: as all runs were fitted."""
        own = np.concatenate(self.comparing.runs.own)
        fitted: Float64 = np.delete(self.fitted.at, own) / self.unit
        return fitted if shared is None else fitted + shared.step

    def chi2_per_row(self, run: int) -> float:
        """Return what a run's own factor on the baseline leaves."""
        normal = self.normals[run]
        left = self.comparing.residuals(self.fitted)[run].whitened
        gained = float(self.along @ normal.negative_gradient) ** 2
        gained /= float(self.along @ normal.matrix @ self.along)
        return (float(left @ left) - gained) / len(left)


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


def _stated(ship: Ship) -> tuple[tuple[str, ...], list[float]]:
    """Return the names of the scales of a baseline, and how well they are stated."""
    base = ship.baseline
    assert base is not None
    if isinstance(base, TableBaseline):
        return ('resistance',), [base.relative_sd]
    return ('friction', 'wave'), [base.relative_sd.friction, base.relative_sd.wave]
