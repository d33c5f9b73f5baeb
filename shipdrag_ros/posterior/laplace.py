# SPDX-License-Identifier: Apache-2.0
"""
Nested Laplace: Gaussian inside, a deterministic design over the noise and the priors outside.

About one linearisation of the motion every setting of the noise and every family of priors (a
hypothesis, or a size of one) is a linear model. Each has its evidence; what leaves is the
mixture. No random numbers.

The search begins where the motion along the speeds that were measured is linear in r,

    u(t) = u_0 - integral of (r(v) - r(u_0) T) / (1 + n_r(v)),  v a rough speed from the readings

so that no hull is too far from the prior's for the first step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.inference.learning import Seen, learn
from shipdrag_ros.inference.learning import prior as prior_of
from shipdrag_ros.inference.linear import (
    ALONE,
    Families,
    evidences,
    solve,
    whitened_products,
)
from shipdrag_ros.inference.rows import LOG, POSITION, Noise, NoisePosterior, Settings
from shipdrag_ros.posterior import motion
from shipdrag_ros.posterior.motion import damping_of, predict
from shipdrag_ros.posterior.problem import FamilySet, RunModel
from shipdrag_ros.samples import Float64

_POINTS = 400  # of the time after the stop


def along_readings(problem: RunModel, seen: Float64) -> tuple[Float64, Float64]:
    """
    Return rows with their derivatives, as `motion.predict` does.

    Parameters
    ----------
    problem
    seen : (2, b)
        Times and speeds, roughly.

    Returns
    -------
    table : (1 + p, n)
        Measured less what `problem.start` says without any r, then the derivatives by what has
        to do with the motion; 0 by all others.
    speed : (n,)
        Through water, roughly.
    """
    rows, k, start = problem.rows, problem.coefficients, problem.start
    time_s = np.linspace(0.0, max(float(rows.time_s[-1]), 1e-9), _POINTS)
    speed = np.maximum(np.interp(time_s, *seen), 0.0)
    known, columns = (value[0] for value in motion.shapes_at(problem.forces, speed))
    at_first = motion.shapes_at(problem.forces, speed[:1])[1][0]
    inertia = motion.damping_of(problem.forces, start[:k], speed)[1]
    thrust = _thrust(problem, time_s, speed)
    # `known` is that of theta = 0, whose part of the thrust is small for a start
    force = np.vstack([known - known[0] * thrust, columns - at_first * thrust]) / inertia
    lost = _integral(force, time_s)
    way = _integral(lost, time_s)
    place, after = rows.of(POSITION), np.maximum(rows.time_s, 0.0)
    of_force = np.array(
        [
            np.where(place, np.interp(after, time_s, x), np.interp(after, time_s, v))
            for v, x in zip(lost, way)
        ]
    )
    table = np.zeros((1 + len(start), len(after)))
    table[1 : 1 + k] = -of_force[1:]
    of_speed = np.where(place, rows.time_s, 1.0)
    table[1 + k + motion.SPEED] = of_speed
    table[1 + k + motion.CURRENT] = np.where(place, rows.time_s, ~rows.of(LOG))
    first = start[k + motion.SPEED] * of_speed
    for code in np.unique(rows.kind[place]):
        at, own = k + motion.own(code) + motion.PLACE, rows.kind == code
        table[1 + at] = own
        first += start[at] * own
    table[0] = rows.value - first + of_force[0] + start[:k] @ of_force[1:]
    return table, np.interp(after, time_s, speed)


def _thrust(problem: RunModel, time_s: Float64, speed: Float64) -> Float64:
    """Return T under the usual law."""
    if problem.forces.tau_s == 0.0:
        return np.zeros(len(time_s))
    q = problem.start[problem.coefficients + motion.THRUST]
    nu = np.exp(-time_s / problem.forces.tau_s)
    result: Float64 = (1.0 + q) * nu**2 - q * nu * speed / max(speed[0], 1e-9)
    return result


def _integral(value: Float64, time_s: Float64) -> Float64:
    """Return integrals (c, m) from the first time on, by trapezoids."""
    parts = 0.5 * (value[:, 1:] + value[:, :-1]) * np.diff(time_s)
    return np.hstack([np.zeros((len(value), 1)), np.cumsum(parts, axis=1)])


_ITERATIONS = 12  # of Gauss and Newton, to where the noise is learnt
_ROUNDS = 60  # linearisations about the mean of the mixture
_CLOSE = 0.05  # of chi^2, from one step to the next
_STILL, _SETTLED = 0.05, 0.5  # of sigma of r(v), between one mean and the next
_UNLIKELY, _QUICK = -7.0, -5.0  # log odds to the likeliest family; less is left out
_LEAST = 1e-3  # of the weight of the likeliest model; less is left out of mean and spread
_ROUGH = 0.02  # of the speed: error of the first step
_HALVINGS = 8  # of a Gauss-Newton step that leads astray
_SHORTEST = 1.0 / 32.0  # part of a step to the mean of the mixture
_ASTRAY = 2  # steps that lead farther away, before a shorter one is tried
_RUNS_AWAY = (
    'the motion is not finite under what the readings ask for: give a window that lies in one '
    'coastdown, or the time of the stop'
)


class NormalMixture(NamedTuple):
    """
    Normal distributions that count, of some unknowns.

    Attributes
    ----------
    weight : (m,)
        Adds up to 1.
    mean, covariance : (m, p), (m, p, p)
    """

    weight: Float64
    mean: Float64
    covariance: Float64

    def moments(self) -> tuple[Float64, Float64]:
        """Return mean and covariance of all."""
        mean = self.weight @ self.mean
        away = self.mean - mean
        within = np.tensordot(self.weight, self.covariance, 1)
        return mean, within + (self.weight * away.T) @ away

    def through(self, columns: Float64) -> tuple[Float64, Float64]:
        """Return means and variances (m, v) of what columns (p, v) make of the unknowns."""
        return self.mean @ columns, np.sum(columns * (self.covariance @ columns), axis=1)


@dataclass(frozen=True)
class RunPosterior:
    """
    What a run says of all unknowns.

    Attributes
    ----------
    problem
    mean, covariance : (p,), (p, p)
        Of the mixture over families and settings of the noise.
    force
        That mixture, of the coefficients of forces that are free, less their mean.
    family : (f,)
        Probability of each family of `problem.families`.
    noise
        Settings with their probabilities.
    """

    problem: RunModel
    mean: Float64
    covariance: Float64
    force: NormalMixture
    family: Float64
    noise: NoisePosterior

    def chance(self, name: str) -> float:
        """
        Return the probability of all families of a hypothesis.
        """
        return float(self.family[self.problem.families.name == name].sum())


@compiled
def mix(
    products: Float64, log_det: Float64, prior: Float64, families: Families, taught: Families
) -> tuple[Float64, Float64, Float64, Float64]:
    """
    Average linear models over settings of the noise and families of priors.

    Parameters
    ----------
    products, log_det
        See `whitened_products`.
    prior : (s,)
        Weights of the settings by the mean evidence of `taught`, as `learn` has them.
    families, taught

    Returns
    -------
    weight : (s, f)
        Of all; adds up to 1.
    kept, step, covariance
        Of those that count, as `NormalMixture` has them.
    """
    s, f, t = len(products), len(families.log_chance), len(taught.log_chance)
    logs = evidences(products, families.mean, families.precision)
    of_taught = evidences(products, taught.mean, taught.precision)
    for k in range(s):
        logs[k] -= 0.5 * log_det[k]
        of_taught[k] -= 0.5 * log_det[k]
    weight, top = np.zeros((s, f)), logs.max()
    for k in range(s):
        alike = np.exp(of_taught[k] - top).sum() / t
        for q in range(f):
            if alike > 0.0:
                of_family_q = np.exp(logs[k, q] - top + families.log_chance[q])
                weight[k, q] = prior[k] * of_family_q / alike
    weight /= weight.sum()
    counts, p = weight >= _LEAST * weight.max(), families.mean.shape[1]
    kept = weight.ravel()[counts.ravel()]
    _, step, covariance = solve(products, families.mean, families.precision, counts, 0, p)
    return weight, kept / kept.sum(), step, covariance


def _linear(problem: RunModel, now: Float64) -> tuple[Float64, Noise]:
    """Return residual and columns of what is free, and the noise as the hull damps there."""
    return _prepared(problem, now, predict(problem.forces, now, problem.grid_s, problem.rows))


def _prepared(
    problem: RunModel, now: Float64, predicted: tuple[Float64, Float64]
) -> tuple[Float64, Noise]:
    """Return the same of rows as predicted under some unknowns."""
    table, speed = predicted
    if not np.all(np.isfinite(table)):
        raise EstimationError(_RUNS_AWAY)
    theta = now[: problem.coefficients]
    damping, inertia = damping_of(problem.forces, theta, np.maximum(speed, 0.0))
    kept = np.concatenate([[0], 1 + problem.free])
    return table[kept], problem.white._replace(damping_1_s=damping, inertia=inertia)


def _likely(problem: RunModel, now: Float64, typical: Settings, least: float) -> RunModel:
    """Return the problem with the families that count under a setting of the noise."""
    logs = _each_family(problem, now, _linear(problem, now), typical).log_evidence
    if not np.isfinite(logs.max()):
        raise EstimationError(_RUNS_AWAY)
    return replace(problem, families=problem.families.of(logs - logs.max() > least))


class _Averaged(NamedTuple):
    """What the linear models about some unknowns say: the mixture, and from where it counts."""

    weight: Float64  # (s, f)
    free: NormalMixture
    step: Float64  # (p,), as the next
    covariance: Float64


def _mixed(problem: RunModel, taught: FamilySet, now: Float64, settings: Settings) -> _Averaged:
    """Return what is said about some unknowns; noise was learnt by `taught`."""
    table, white = _linear(problem, now)
    families, of_taught = (each.about(now, problem.free) for each in (problem.families, taught))
    products, log_det = whitened_products(table, problem.rows, white, problem.steady, settings)
    weight, *kept = mix(products, log_det, settings.weight, families, of_taught)
    mixture = NormalMixture(*kept)
    of_free, spread = mixture.moments()
    step, covariance = np.zeros(len(now)), np.diag(1.0 / problem.families.precision[0])
    step[problem.free] = of_free
    covariance[np.ix_(problem.free, problem.free)] = spread
    return _Averaged(weight, mixture, step, covariance)


def _of_force(problem: RunModel, found: _Averaged) -> NormalMixture:
    """Return the mixture of the coefficients of forces that are free, less their mean."""
    weight, mean, covariance = found.free
    free = problem.free_forces
    f = len(free)
    return NormalMixture(weight, mean[:, :f] - found.step[free], covariance[:, :f, :f])


def _seen(problem: RunModel, now: Float64) -> Seen:
    table, white = _linear(problem, now)
    families = problem.taught.about(now, problem.free)
    return Seen(problem.rows, table, families.mean, families.precision, white, problem.steady)


class _Linear(NamedTuple):
    """The motion under one setting of the noise, about some unknowns: one model a family."""

    misfit: float  # chi^2 of the rows
    log_evidence: Float64  # (f,)
    step: Float64  # (free,), of the likeliest


def _each_family(
    problem: RunModel, now: Float64, linear: tuple[Float64, Noise], settings: Settings
) -> _Linear:
    """Solve each; what the noise does not explain yet counts as more noise."""
    products, _ = whitened_products(linear[0], problem.rows, linear[1], problem.steady, settings)
    n = len(problem.rows.time_s)
    misfit = float(products[0, 0, 0])
    products *= min(1.0, n / misfit)
    priors = problem.families.about(now, problem.free)
    logs = evidences(products, priors.mean, priors.precision) + priors.log_chance
    best = [int(np.argmax(logs))]
    _, step, _ = solve(products, priors.mean[best], priors.precision[best], ALONE, 0, 0)
    return _Linear(misfit, logs[0], step[0])


def _objective(problem: RunModel, now: Float64, misfit: float, which: int) -> float:
    families, free = problem.families, problem.free
    away = now[free] - families.mean[which, free]
    n = len(problem.rows.time_s)
    tempered = misfit if misfit < n else n * (1.0 + float(np.log(misfit / n)))
    return tempered + float(families.precision[which, free] @ away**2)


def _begun(problem: RunModel, seen: Float64) -> tuple[RunModel, Float64]:
    """
    Take the first step along the readings, where all hulls are linear.

    Hulls of another level than the likeliest are left out: about one level the others are not
    linear.
    """
    now = problem.start.copy()
    table, white = _prepared(problem, now, along_readings(problem, seen))
    none = problem.families.about(now, problem.free)
    typical = prior_of(
        Seen(problem.rows, table, none.mean[:1], none.precision[:1], white, problem.steady),
        problem.speed_m_s,
    ).typical
    length_s = float(problem.rows.time_s[-1]) / seen.shape[1]
    rough = _ROUGH * problem.speed_m_s * np.where(problem.rows.of(POSITION), length_s, 1.0)
    white = white._replace(variance=white.variance + rough**2)
    linear = _each_family(problem, now, (table, white), typical)
    which = int(np.argmax(linear.log_evidence))
    now[problem.free] += linear.step
    level = problem.families.level
    return replace(problem, families=problem.families.of(level == level[which])), now


def _climbed(problem: RunModel, now: Float64, typical: Settings) -> Float64:
    """Climb, by Gauss and Newton, under one setting of the noise and the likeliest hull."""
    linear = _each_family(problem, now, _linear(problem, now), typical)
    for _ in range(_ITERATIONS):
        which = int(np.argmax(linear.log_evidence))
        least = before = _objective(problem, now, linear.misfit, which)
        part, step = 1.0, np.zeros(len(now))
        step[problem.free] = linear.step
        for _ in range(_HALVINGS):
            trial = now + part * step
            predicted = predict(problem.forces, trial, problem.grid_s, problem.rows)
            if np.all(np.isfinite(predicted[0])):
                linear = _each_family(
                    problem, trial, _prepared(problem, trial, predicted), typical
                )
                least = _objective(problem, trial, linear.misfit, which)
                if least < before + _CLOSE:
                    break
            part *= 0.5
        else:
            break
        now = trial
        if before - least < _CLOSE:
            break
    return now


def _moved(problem: RunModel, found: _Averaged) -> float:
    """Return by how many standard deviations r(v) moves at most, over the speeds of the run."""
    k, speed = problem.coefficients, problem.law.speed_m_s
    inside = (speed >= problem.low_m_s) & (speed <= problem.speed_m_s)
    columns = problem.forces.columns[0][:, inside]
    columns[problem.of_hull : problem.of_hull + 1] = 0.0  # a held force is no part of r
    variance = np.einsum('km,kl,lm->m', columns, found.covariance[:k, :k], columns)
    with np.errstate(invalid='ignore', divide='ignore'):
        return float(np.max(np.abs(found.step[:k] @ columns) / np.sqrt(variance)))


def _settled(
    problem: RunModel, taught: FamilySet, now: Float64, settings: Settings
) -> tuple[Float64, _Averaged]:
    """
    Return the mean of the mixture about which it is taken, and the mixture.

    Raises
    ------
    EstimationError
        If no step leads there.
    """
    found = _mixed(problem, taught, now, settings)
    best = away, now, found = _moved(problem, found), now, found
    part, astray = 1.0, 0
    for _ in range(_ROUNDS):
        if best[0] < _STILL or part < _SHORTEST:
            break
        now = now + part * found.step
        try:
            found = _mixed(problem, taught, now, settings)
            away = _moved(problem, found)
        except EstimationError:  # the motion runs away
            away, astray = math.inf, _ASTRAY
        if away < best[0]:
            best, part, astray = (away, now, found), min(2.0 * part, 1.0), 0
        elif astray < _ASTRAY:  # the way there may lead farther away first
            astray += 1
        else:
            (away, now, found), part, astray = best, 0.5 * part, 0
    away, now, found = best
    if not away < _SETTLED:
        raise EstimationError(
            'the fit of the motion does not settle: the record allows motions that are too '
            'different; give a longer window, one without a turn or thrust, or a ship file with a '
            'baseline'
        )
    return now + part * found.step, found


def infer(problem: RunModel, seen: Float64 | None = None, *, quick: bool = False) -> RunPosterior:
    """
    Return the posterior of a run.

    Parameters
    ----------
    problem
        Rows, motion and priors.
    seen : (2, b)
        Times and speeds, roughly, to begin from; None: from `problem.start`.
    quick
        Times of the noise as they usually are, and fewer settings.

    Raises
    ------
    EstimationError
        If the motion runs away, or the fit does not settle.
    """
    now = problem.start
    if seen is not None:
        problem, now = _begun(problem, seen)
    usual = problem.usual
    now = _climbed(usual, now, prior_of(_seen(problem, now), problem.speed_m_s).typical)
    noise = learn(_seen(problem, now), problem.speed_m_s, quick=quick)
    now = _climbed(usual, now, noise.typical)
    taught, problem = (
        problem.taught,
        _likely(problem, now, noise.typical, _QUICK if quick else _UNLIKELY),
    )
    mean, found = _settled(problem, taught, now, noise.settings)
    settings = noise.settings._replace(weight=found.weight.sum(axis=1))
    return RunPosterior(
        problem,
        mean,
        found.covariance,
        _of_force(problem, found),
        found.weight.sum(axis=0),
        replace(noise, settings=settings),
    )
