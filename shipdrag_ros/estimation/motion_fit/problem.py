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
    FIRST,
    Average,
    Family,
    FamilyFit,
    Humps,
)
from shipdrag_ros.estimation.motion_fit.guess import Guess
from shipdrag_ros.estimation.motion_fit.record import KINDS, Record
from shipdrag_ros.estimation.motion_fit.run_down import RunDown
from shipdrag_ros.estimation.motion_fit.solve import fit
from shipdrag_ros.estimation.motion_fit.whitening import CALM, Disturbance, Noise, whiten
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

_PLAIN = Family((2, 3))  # never negative, and right enough to tell how a force is damped
_STEPS = 72  # of the integration, longer as the ship slows down
_HUBER = 2.5  # whitened residuals beyond it count by their size only
_HUBER_SQUARE = 0.9775  # mean of min(z, 2.5)^2 of a standard normal z
_ROUNDS, _ROUNDS_DISTURBED = 3, 2  # of the weights
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
    steady
        How many of them are of the steady record.
    samples
        How many there were before rows were condensed.
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
    humps
        Where humps may be.
    hump_unit_m_s2
        r that their sizes are relative to, at the reference speed.
    extras
        Unknowns behind the coefficients that are fitted.
    """

    rows: Rows
    steady: int
    samples: int
    grid_s: Float64
    noise: Noise
    run_down: RunDown
    n_r: Float64
    v_ref_m_s: float
    humps: Humps
    hump_unit_m_s2: float
    extras: tuple[int, ...]

    @classmethod
    def of(cls, record: Record, run_down: RunDown, ship: Ship, guess: Guess) -> Problem:
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
        v_ref = guess.speed_m_s
        return cls(
            rows,
            len(steady.time_s),
            len(rows.time_s),
            grid,
            calm,
            run_down,
            ship.n_r_polynomial(),
            v_ref,
            Humps.between(guess.lowest, float(ship.froude(v_ref))),
            guess.quadratic_1_m * v_ref**2,
            tuple(extras),
        )

    def plain(self, found: FamilyFit, guess: Guess) -> FamilyFit:
        """
        Return a fit as the plainest of families has it, without its covariance.
        """
        unknowns = self.start(_PLAIN, found, guess)
        nothing = np.zeros((len(unknowns), len(unknowns)))
        return FamilyFit(self.law(_PLAIN), unknowns, nothing, 0.0, self.samples, 0.0)

    def disturbed(self, about: Disturbance, plain: FamilyFit) -> Problem:
        """
        Return the problem with slow disturbances, damped as a fit has it.
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

    def residual(self, found: FamilyFit) -> Float64:
        """
        Return measured less predicted of all rows, (n,).
        """
        none = np.zeros(0, np.int64)
        table, _ = predict(found.law, found.unknowns, self.grid_s, self.rows, none)
        result: Float64 = table[0]
        return result

    def condensed(self, near: FamilyFit) -> Problem:
        """
        Return the problem with the coastdown condensed to a row a step and input.

        What a fit that is near leaves is as good as a constant over a step, so
        that its mean stands for all of it; slow disturbances do not change
        within a step either.
        """
        edges = np.concatenate([-self.grid_s[:0:-1], self.grid_s])
        residual = self.residual(near)
        parts = [[column[: self.steady] for column in (*self.rows, self.noise.variance)]]
        mean_residual = [residual[: self.steady]]
        for kind in KINDS.values():
            chosen = self.steady + np.flatnonzero(self.rows.kind[self.steady :] == kind)
            if len(chosen) == 0:
                continue
            time_s = self.rows.time_s[chosen]
            cell = np.searchsorted(edges, time_s)
            first = np.concatenate([[0], np.flatnonzero(np.diff(cell)) + 1])
            weight = 1.0 / self.noise.variance[chosen]
            total = np.add.reduceat(weight, first)
            when = np.add.reduceat(weight * time_s, first) / total
            mean_residual.append(np.add.reduceat(weight * residual[chosen], first) / total)
            zero = np.zeros(len(when))
            parts.append([when, np.full(len(when), kind, np.int64), zero, 1.0 / total])
        time_s, kinds, _, variance = (np.concatenate(columns) for columns in zip(*parts))
        order = np.argsort(time_s[self.steady :], kind='stable') + self.steady
        order = np.concatenate([np.arange(self.steady), order])
        rows = Rows(time_s[order], kinds[order], np.zeros(len(order)))
        found = replace(self, rows=rows)
        value = np.concatenate(mean_residual)[order] - found.residual(near)
        damping, inertia = (
            np.interp(time_s[order], self.rows.time_s, of_row)
            for of_row in (self.noise.damping_1_s, self.noise.inertia)
        )
        noise = Noise(variance[order], self.noise.about, damping, inertia)
        return replace(self, rows=rows._replace(value=value), noise=noise)

    def law(self, family: Family) -> Law:
        """
        Return a family in the form that the fit takes.
        """
        thrust = 1.0 if self.run_down.run_down_s > 0.0 else 0.0
        powers = np.array(family.powers, np.int64)
        count = len(self.humps.sd) if family.humpy else 0
        return Law(
            powers,
            self.v_ref_m_s,
            thrust,
            self.n_r,
            count,
            self.humps.first,
            self.humps.spacing,
        )

    def start(self, family: Family, other: FamilyFit | None, guess: Guess) -> Float64:
        """
        Return unknowns to start from: another family's, or a guess.
        """
        powers = family.powers
        size = len(powers) + (len(self.humps.sd) if family.humpy else 0)
        unknowns = np.zeros(size + EXTRAS)
        if other is None:
            unknowns[powers.index(2)] = guess.quadratic_1_m * self.v_ref_m_s**2
            unknowns[size + V0] = guess.speed_m_s
            unknowns[size + RUN_DOWN] = max(self.run_down.run_down_s, 1e-3)
            unknowns[size + X0] = guess.first_m
            return unknowns
        unknowns[size:] = other.unknowns[-EXTRAS:]
        if tuple(other.law.powers) == powers:
            same = min(size, other.law.size)
            unknowns[:same] = other.unknowns[:same]
            return unknowns
        s = np.linspace(guess.lowest, 1.0, 64)
        r, _ = other.resistance(s * self.v_ref_m_s)
        columns = s[:, None] ** np.array(powers)
        unknowns[: len(powers)] = np.linalg.lstsq(columns, r, rcond=None)[0]
        return unknowns

    def fit(self, family: Family, start: Float64) -> tuple[FamilyFit | None, Float64]:
        """
        Fit one family, None where that fails; return its whitened residuals too.
        """
        law = self.law(family)
        k, plain = law.size, len(law.powers)
        active = np.array([*range(k), *(k + extra for extra in self.extras)], np.int64)
        prior = np.zeros((2, k + EXTRAS))
        prior[1, plain:k] = 1.0 / (self.hump_unit_m_s2 * self.humps.sd[: law.humps]) ** 2
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
        # what the samples tell of the humps: one less what the prior knows of each
        told = 1.0 - prior[1, plain:k] * np.diag(covariance)[plain:k]
        of_prior = float((prior[1, plain:k] * unknowns[plain:k] ** 2).sum())
        parameters = len(active) - law.humps + float(told.sum())
        found = FamilyFit(law, unknowns, covariance, chi2 - of_prior, self.samples, parameters)
        return found, white


def fit_robustly(problem: Problem, guess: Guess) -> tuple[FamilyFit, Problem]:
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
    base = problem.noise.variance
    weight = np.ones(len(base))
    first = None
    for _ in range(_ROUNDS):
        problem = problem.weighted(base / weight)
        first, white = problem.fit(FIRST, problem.start(FIRST, first, guess))
        if first is None:
            raise EstimationError(
                'the equation of motion could not be fitted to the window: is it one coastdown, '
                'with the engine stopped all the time?'
            )
        base, weight = _weigh(problem, white, base, weight, first.parameters)
    assert first is not None
    return first, problem.weighted(base / weight)


def weigh_disturbed(problem: Problem, near: FamilyFit) -> Problem:
    """
    Weigh the rows by what a fit leaves that slow disturbances do not explain.
    """
    base = problem.noise.variance
    weight = np.ones(len(base))
    residual = problem.residual(near)
    for _ in range(_ROUNDS_DISTURBED):
        problem = problem.weighted(base / weight)
        white = residual.reshape(1, -1).copy()
        whiten(problem.rows, white, problem.noise)
        base, weight = _weigh(problem, white[0], base, weight, near.parameters)
    return problem.weighted(base / weight)


def _weigh(
    problem: Problem, white: Float64, base: Float64, weight: Float64, parameters: float
) -> tuple[Float64, Float64]:
    """Return variances of the inputs as they scatter, and Huber's weights."""
    # the residual in standard deviations before it was weighed down
    size = np.abs(white) / np.sqrt(weight)
    weight = np.minimum(1.0, _HUBER / np.maximum(size, _HUBER))
    freedom = 1.0 - parameters / len(base)
    squares = np.minimum(size, _HUBER) ** 2 / (_HUBER_SQUARE * freedom)
    base = base.copy()
    coast = slice(problem.steady, None)
    for kind in KINDS.values():
        of_kind = problem.rows.kind == kind
        if of_kind[coast].any():
            base[of_kind] *= float(squares[coast][of_kind[coast]].mean())
    return base, weight


def with_log_scale(problem: Problem, first: FamilyFit) -> tuple[FamilyFit, Problem]:
    """
    Take the scale of the log as unknown where the data show that it is not 1.
    """
    if CURRENT not in problem.extras:
        return first, problem
    scaled = replace(problem, extras=(*problem.extras, LOG_SCALE))
    found, _ = scaled.fit(FIRST, first.unknowns)
    if found is None:
        return first, problem
    at = found.law.size + LOG_SCALE
    scale, sd = float(found.unknowns[at]), math.sqrt(found.covariance[at, at])
    if abs(scale) <= _SCALE_SIGNIFICANT * sd:
        return first, problem
    return found, scaled


def average_families(problem: Problem, first: FamilyFit, guess: Guess) -> Average:
    """
    Fit all families, one after the other from the one before.
    """
    fits = []
    near = first
    for family in FAMILIES:
        found, _ = problem.fit(family, problem.start(family, near, guess))
        if found is not None:
            fits.append(found)
            near = found if not family.humpy else near
    return Average.of(tuple(fits) or (first,))
