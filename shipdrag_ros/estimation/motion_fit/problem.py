# SPDX-License-Identifier: Apache-2.0
"""One coastdown to be fitted: what its families share, and the fits."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.motion_fit.coast import (
    CURRENT,
    EXTRAS,
    LOG,
    LOG_SCALE,
    ONSET,
    POSITION,
    RUN_DOWN,
    V0,
    X0,
    Law,
    Rows,
    predict,
)
from shipdrag_ros.estimation.motion_fit.families import (
    FAMILIES,
    GROWTH,
    LARGEST,
    Average,
    FamilyFit,
)
from shipdrag_ros.estimation.motion_fit.guess import Guess
from shipdrag_ros.estimation.motion_fit.record import KINDS, Record
from shipdrag_ros.estimation.motion_fit.run_down import RunDown
from shipdrag_ros.estimation.motion_fit.solve import fit
from shipdrag_ros.estimation.motion_fit.whitening import CALM, Disturbance, Noise
from shipdrag_ros.samples import Float64

PLAIN = (2, 3)  # little noise, and right enough to tell how a force is damped
_STEPS = 96  # of the integration, longer as the ship slows down
_HUBER = 2.5  # whitened residuals beyond it count by their size only
_HUBER_SQUARE = 0.9775  # mean of min(z, 2.5)^2 of a standard normal z
_ROUNDS = 3  # of the weights
_ITERATIONS = 30
_SCALE_SD = 0.02  # of a log's scale, before the fit
_SCALE_SIGNIFICANT = 3.0  # standard deviations


@dataclass(frozen=True)
class Problem:
    """
    What all families of one coastdown share.

    Attributes
    ----------
    rows
        Of the steady record, then of the coastdown.
    grid_s
        Times of the integration.
    noise
        White noise, larger for an outlier, and slow disturbances.
    run_down
        What is known of the stop.
    n_r
        Polynomial of n_r in v.
    v_ref_m_s
        Speed that powers are relative to.
    extras
        Unknowns behind the coefficients that are fitted.
    """

    rows: Rows
    grid_s: Float64
    noise: Noise
    run_down: RunDown
    n_r: Float64
    v_ref_m_s: float
    extras: tuple[int, ...]

    @classmethod
    def of(
        cls,
        record: Record,
        run_down: RunDown,
        n_r: Float64,
        guess: Guess,
    ) -> Problem:
        """
        Set up the fit of a record that nothing but sensor noise disturbs.
        """
        steady, coast = record.steady, record.coast
        rows = Rows(*(np.concatenate([a, b]) for a, b in zip(steady, coast)))
        variance = np.concatenate(
            [record.variance(steady, record.steady_count), record.variance(coast)]
        )
        extras = [V0]
        if run_down.run_down_sd_s > 0.0:
            extras.append(RUN_DOWN)
        # without thrust and steady record a later stop is but a higher speed
        if run_down.stop_sd_s > 0.0 and (run_down.run_down_s > 0.0 or len(steady.time_s)):
            extras.append(ONSET)
        kinds = set(coast.kind.tolist())
        if POSITION in kinds:
            extras.append(X0)
        if LOG in kinds and len(kinds) > 1:
            extras.append(CURRENT)
        end = float(coast.time_s[-1]) + 3.0 * run_down.stop_sd_s
        typical = max(float(coast.time_s[-1]), 1e-3) / 25.0
        grid = typical * np.expm1(np.linspace(0.0, math.log1p(end / typical), _STEPS + 1))
        calm = Noise(variance, CALM, np.ones(len(variance)), np.ones(len(variance)))
        return cls(rows, grid, calm, run_down, n_r, guess.speed_m_s, tuple(extras))

    def disturbed(self, about: Disturbance, plain: FamilyFit) -> Problem:
        """
        Return the problem with slow disturbances, damped as a plain fit has it.
        """
        _, speed = predict(
            plain.law, plain.unknowns, self.grid_s, self.rows, np.zeros(0, np.int64)
        )
        damping, inertia = plain.damping(speed)
        return replace(self, noise=Noise(self.noise.variance, about, damping, inertia))

    def weighted(self, variance: Float64) -> Problem:
        """
        Return the problem with another variance of the white noise.
        """
        return replace(self, noise=self.noise._replace(variance=variance))

    def law(self, powers: tuple[int, ...]) -> Law:
        """
        Return a family in the form that the fit takes.
        """
        thrust = 1.0 if self.run_down.run_down_s > 0.0 else 0.0
        return Law(np.array(powers, np.int64), self.v_ref_m_s, thrust, self.n_r)

    def start(self, powers: tuple[int, ...], other: FamilyFit | None, guess: Guess) -> Float64:
        """
        Return unknowns to start from: another family's, or a guess.
        """
        k = len(powers)
        unknowns = np.zeros(k + EXTRAS)
        if other is None:
            unknowns[powers.index(2)] = guess.quadratic_1_m * self.v_ref_m_s**2
            unknowns[k + V0] = guess.speed_m_s
            unknowns[k + RUN_DOWN] = max(self.run_down.run_down_s, 1e-3)
            unknowns[k + X0] = guess.first_m
            return unknowns
        unknowns[k:] = other.unknowns[-EXTRAS:]
        s = np.linspace(guess.lowest, 1.0, 64)
        r, _ = other.resistance(s * self.v_ref_m_s)
        columns = s[:, None] ** np.array(powers)
        unknowns[:k] = np.linalg.lstsq(columns, r, rcond=None)[0]
        return unknowns

    def fit(self, powers: tuple[int, ...], start: Float64) -> tuple[FamilyFit | None, Float64]:
        """
        Fit one family, None where that fails; return its whitened residuals too.
        """
        law, k = self.law(powers), len(powers)
        active = np.array([*range(k), *(k + extra for extra in self.extras)], np.int64)
        prior = np.zeros((2, k + EXTRAS))
        for extra, mean, sd in (
            (RUN_DOWN, self.run_down.run_down_s, self.run_down.run_down_sd_s),
            (ONSET, 0.0, self.run_down.stop_sd_s),
            (LOG_SCALE, 0.0, _SCALE_SD),
        ):
            prior[:, k + extra] = mean, 1.0 / sd**2 if sd > 0.0 else 0.0
        converged, chi2, unknowns, covariance, white = fit(
            law,
            start,
            self.grid_s,
            self.rows,
            self.noise,
            active,
            prior,
            _ITERATIONS,
        )
        if not converged:
            return None, white
        full = np.zeros((k + EXTRAS, k + EXTRAS))
        full[np.ix_(active, active)] = covariance
        return (
            FamilyFit(law, unknowns, full, chi2, len(self.rows.time_s), len(active)),
            white,
        )


def fit_robustly(
    problem: Problem, record: Record, start: FamilyFit | None, guess: Guess
) -> tuple[FamilyFit, Problem]:
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
    steady = len(record.steady.time_s)
    base = np.concatenate(
        [record.variance(record.steady, record.steady_count), record.variance(record.coast)]
    )
    weight = np.ones(len(base))
    first = start
    for _ in range(_ROUNDS):
        problem = problem.weighted(base / weight)
        first, white = problem.fit(FAMILIES[0], problem.start(FAMILIES[0], first, guess))
        if first is None:
            break
        # the residual in standard deviations before it was weighed down
        size = np.abs(white) / np.sqrt(weight)
        weight = np.minimum(1.0, _HUBER / np.maximum(size, _HUBER))
        freedom = 1.0 - first.parameters / len(base)
        squares = np.minimum(size, _HUBER) ** 2 / (_HUBER_SQUARE * freedom)
        for kind in KINDS.values():
            of_kind = problem.rows.kind == kind
            if of_kind[steady:].any():
                base[of_kind] *= float(squares[steady:][of_kind[steady:]].mean())
    if first is None:
        raise EstimationError(
            'the equation of motion could not be fitted to the window: is it one coastdown, '
            'with the engine stopped all the time?'
        )
    return first, problem.weighted(base / weight)


def with_log_scale(problem: Problem, first: FamilyFit) -> tuple[FamilyFit, Problem]:
    """
    Take the scale of the log as unknown where the data show that it is not 1.
    """
    if CURRENT not in problem.extras:
        return first, problem
    scaled = replace(problem, extras=(*problem.extras, LOG_SCALE))
    found, _ = scaled.fit(FAMILIES[0], first.unknowns)
    if found is None:
        return first, problem
    at = len(FAMILIES[0]) + LOG_SCALE
    scale, sd = float(found.unknowns[at]), math.sqrt(found.covariance[at, at])
    if abs(scale) <= _SCALE_SIGNIFICANT * sd:
        return first, problem
    return found, scaled


def average_families(problem: Problem, first: FamilyFit, guess: Guess) -> Average:
    """
    Fit all families, larger ones while the samples ask for them.
    """
    fits = []
    for powers in FAMILIES:
        found, _ = problem.fit(powers, problem.start(powers, first, guess))
        if found is not None:
            fits.append(found)
    average = Average.of(tuple(fits) or (first,))
    size = max(map(max, FAMILIES)) + 1
    while size <= LARGEST and average.weights[-1] >= GROWTH:
        powers = tuple(range(1, size))
        found, _ = problem.fit(powers, problem.start(powers, average.fits[-1], guess))
        if found is None:
            break
        average = Average.of((*average.fits, found))
        size += 1
    return average
