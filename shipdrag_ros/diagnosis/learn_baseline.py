# SPDX-License-Identifier: Apache-2.0
"""
The baseline that clean runs show, and how far single runs depart from it.

A baseline from a towing tank is often worse than it says, which two runs cannot
show; several clean runs can, and how they differ from each other shows what a
further run may do without anything being missing.

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
from typing import Any, NamedTuple

import numpy as np
from scipy.special import softmax
from scipy.stats import t as student

from shipdrag_ros.diagnosis.observation import CoastRun, Observation, ship_runs
from shipdrag_ros.errors import DiagnosisError, EstimationError
from shipdrag_ros.estimation import estimate_final
from shipdrag_ros.estimation.reciprocal import combine
from shipdrag_ros.inference.decision import NONE
from shipdrag_ros.inference.linear import evidences
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.compare import Comparing, Fitted
from shipdrag_ros.posterior.priors import UNSTATED_FORM
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Baseline, CoefficientBaseline, CoefficientSd, Ship, TableBaseline

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
        total = np.sum(equations, axis=0)[None]
        logs = evidences(total, families.mean, families.precision)[0]
        chance = softmax(logs + families.log_chance)
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
    first, *wave = np.maximum(stated_sd(ship), _LEAST_SD).tolist()
    sd: Any = CoefficientSd(first, *wave) if wave else first
    changes = {'relative_sd': sd, 'relative_sd_of': 'retardation', 'run_scatter': 0.0}
    return replace(ship, baseline=replace(ship.baseline, **changes))


ENOUGH = 3  # runs that show their scatter
_ASKED = 5  # from which it is well known
_FORM_POINTS = 12
_MARGIN = 1.1  # above the highest speed
_STANDS_OUT = 0.01  # probability by chance, for any of the runs
_UNEXPLAINED = 1.5  # chi^2 a row


@dataclass(frozen=True)
class CleanRun:
    """
    One of the runs.

    Attributes
    ----------
    name
    factor
        Its resistance over that of the others, - 1.
    chi2_per_row
        1 where the noise explains what a baseline leaves.
    """

    name: str
    factor: Factor
    chi2_per_row: float


@dataclass(frozen=True)
class LearntBaseline:
    """
    A learnt baseline.

    Attributes
    ----------
    ship
        With it.
    names
        Of the parts: friction and wave, or resistance as a whole.
    factors : (k,)
        Learnt over stated, of each part.
    covariance : (k, k)
        Of the factors, without the scatter of single runs.
    shared
        What the runs have in common, with the scatter of the resistance from run to run.
    relative_sd : (k,)
        As the learnt baseline states it, beside the scatter: a further run
        differs by both.
    stated_sd : (k,)
        As before; None where nothing was stated.
    speed_m_s
        Covered by the runs, lowest and highest.
    runs
    warnings
        What a reader must know, a sentence each.
    """

    ship: Ship
    names: tuple[str, ...]
    factors: Float64
    covariance: Float64
    shared: Shared
    relative_sd: Float64
    stated_sd: Float64 | None
    speed_m_s: tuple[float, float]
    runs: tuple[CleanRun, ...]
    warnings: tuple[str, ...]

    @property
    def correlation(self) -> float:
        """Of the relative deviations of friction and wave that the baseline states."""
        base = self.ship.baseline
        return base.relative_sd.correlation if isinstance(base, CoefficientBaseline) else 0.0


def learn_baseline(runs: Sequence[CoastRun], ship: Ship, parameters: Parameters) -> LearntBaseline:
    """
    Learn a ship's baseline from clean runs.

    Parameters
    ----------
    runs
        Clean hull, calm deep water, no wind; each with the steady record
        before the stop. What differs from run to run widens the baseline.
    ship
        Its baseline, if there is one, keeps its form and is the prior, with
        heavy tails; n_r and effects are taken as the file states them.
    parameters
        For the noise of the sensors and the convention of the heading.

    Returns
    -------
    Learnt
        With a ship file that states the baseline, its errors and the scatter.

    Raises
    ------
    DiagnosisError
        Without a run, or where one has too little steady record.
    EstimationError
        If a run has too few samples.
    ShipFileError
        If the runs ask for values that a ship file may not hold.
    """
    if not runs:
        raise DiagnosisError('no run to learn a baseline from: give at least one')
    begun = ship if ship.baseline is not None else _from_curves(runs, ship, parameters)
    problem = SharedBaseline.of(runs, begun, parameters)
    everything = problem.shared(problem.normals)
    factors = problem.factors()
    enough = len(runs) >= ENOUGH
    mean, covariance = problem.of_parts(everything)
    stated = stated_sd(begun)
    assert begun.baseline is not None
    absolute = np.sqrt(np.diag(covariance))
    correlation = float(covariance[0, -1] / (absolute[0] * absolute[-1]))
    scatter = everything.scatter if enough else begun.baseline.run_scatter
    if not enough:
        # how far a further run may be off is known by what was stated alone
        absolute = np.maximum(absolute, stated)
    relative_sd = absolute / (1.0 + mean)
    source = _source(everything, len(runs), problem.speed_m_s, begun)
    base = replace(
        _scaled(problem, everything, mean, relative_sd, correlation, source),
        run_scatter=_rounded(scatter),
    )
    learnt = replace(ship, baseline=base)
    found = tuple(
        CleanRun(run.name, each, problem.chi2_per_row(j))
        for j, (run, each) in enumerate(zip(runs, factors, strict=True))
    )
    return LearntBaseline(
        ship=Ship.from_yaml(learnt.to_yaml(), subject='the learnt baseline'),
        names=problem.names,
        factors=1.0 + mean,
        covariance=covariance,
        shared=everything,
        relative_sd=relative_sd,
        stated_sd=None if ship.baseline is None else stated,
        speed_m_s=problem.speed_m_s,
        runs=found,
        warnings=tuple(_warnings(found, ship, problem)),
    )


def _scaled(
    problem: SharedBaseline,
    shared: Shared,
    mean: Float64,
    relative_sd: Float64,
    correlation: float,
    source: str,
) -> Baseline:
    """Return the baseline with what was learnt, in the form that it has."""
    base = problem.ship.baseline
    if isinstance(base, CoefficientBaseline):
        friction, wave = 1.0 + mean
        return replace(
            base,
            form_factor=_rounded(friction * (1.0 + base.form_factor) - 1.0),
            correlation_allowance=_rounded(friction * base.correlation_allowance),
            wave_coefficient=tuple(_rounded(wave * c) for c in base.wave_coefficient),
            relative_sd=CoefficientSd(
                _rounded(relative_sd[0]), _rounded(relative_sd[1]), _rounded(correlation)
            ),
            source=source,
        )
    assert base is not None
    # a table follows the shape as well
    parts = problem.relative_parts(np.array(base.speed_m_s))
    change = (problem.unit * (problem.at + shared.step)) @ parts
    force = np.array(base.resistance_n) * (1.0 + change)
    return replace(
        base,
        resistance_n=tuple(_rounded(value) for value in force),
        relative_sd=_rounded(relative_sd[0]),
        source=source,
    )


def _rounded(value: float) -> float:
    """Return as many digits as a reader of the ship file can use."""
    return float(f'{value:.7g}')


def _from_curves(runs: Sequence[CoastRun], ship: Ship, parameters: Parameters) -> Ship:
    """
    Return a ship with a table from r(v) of the runs.

    Beyond the speeds at which all of them may be used, it goes with the
    square of the speed.
    """
    found = [estimate_final(run.window, ship, parameters) for run in runs]
    whole = combine(found, [None] * len(found)) if len(found) > 1 else found[0].valid_curve
    speed, r = whole.speed_m_s, whole.resistance_m_s2
    if len(speed) < 2:
        raise EstimationError(
            f'r(v) of {runs[0].name} may be used at {len(speed)} speed(s), 2 are needed: give '
            'longer runs, or state a baseline in the ship file'
        )
    inner = np.linspace(speed[0], speed[-1], _FORM_POINTS)
    highest = _MARGIN * max(float(one.curve.speed_m_s[-1]) for one in found)
    points = np.concatenate([inner[0] * np.array([0.25, 0.5, 0.75]), inner, [highest]])
    inside = np.clip(points, inner[0], inner[-1])
    force = ship.mass_kg * np.interp(inside, speed, r) * (points / inside) ** 2
    base = TableBaseline(
        (0.0, *(_rounded(value) for value in points)),
        (0.0, *(_rounded(value) for value in force)),
        relative_sd=UNSTATED_FORM.mean,
        source=f'from {inner[0]:.3g} to {inner[-1]:.3g} m/s, beyond by the square of the speed',
    )
    return replace(ship, baseline=base)


def _source(shared: Shared, runs: int, speed_m_s: tuple[float, float], begun: Ship) -> str:
    assert begun.baseline is not None
    before = f' ({begun.baseline.source})' if begun.baseline.source else ''
    scatter = 'scatter not known from so few'
    if runs >= ENOUGH:
        scatter = f'scatter from run to run {100.0 * shared.scatter:.2g} %'
    many = 'run' if runs == 1 else 'runs'
    return f'{runs} clean {many} of {speed_m_s[0]:.3g}..{speed_m_s[1]:.3g} m/s, {scatter}{before}'


def _warnings(runs: Sequence[CleanRun], ship: Ship, problem: SharedBaseline) -> list[str]:
    found = []
    if ship.baseline is None:
        base = problem.ship.baseline
        assert base is not None
        found.append(f'the ship file states no baseline: it is a table of r(v), {base.source}')
    if len(runs) < ENOUGH:
        holds = 'the relative_sd that was stated still holds'
        if ship.baseline is None:
            holds = f'a relative_sd of {UNSTATED_FORM.mean:g} is stated'
        found.append(
            f'{len(runs)} run(s) do not show how runs differ: {holds}; with {_ASKED} runs their '
            'scatter replaces it'
        )
    elif len(runs) < _ASKED:
        found.append(f'{len(runs)} runs show their scatter roughly; {_ASKED} show it well')
    if len(runs) >= ENOUGH:
        limit = float(student.isf(0.5 * _STANDS_OUT / len(runs), len(runs) - 2))
        worst = max(runs, key=lambda run: abs(run.factor.away))
        if abs(worst.factor.away) > limit:
            found.append(
                f'{worst.name} stands out: its resistance is {worst.factor.value:+.1%} off the '
                'others; leave it out unless you know that it was clean'
            )
    found += [
        f'{run.name} is not explained by any baseline (chi^2 {run.chi2_per_row:.2g} a sample): '
        'look at it with `shipdrag diagnose`'
        for run in runs
        if run.chi2_per_row > _UNEXPLAINED
    ]
    return found
