# SPDX-License-Identifier: Apache-2.0
"""One coastdown to be fitted: what is measured, known and unknown."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.ode_fit.averaging import Disturbed, average
from shipdrag_ros.estimation.ode_fit.batch_means import BatchMeans, batch_means
from shipdrag_ros.estimation.ode_fit.coast import (
    CURRENT,
    EXTRAS,
    LOG_LAG,
    LOG_SCALE,
    ONSET,
    THRUST,
    THRUST_FAST,
    V0,
    X0,
    predict,
)
from shipdrag_ros.estimation.ode_fit.condensing import means
from shipdrag_ros.estimation.ode_fit.families import FIRST, PLAIN, POWERS, Humps
from shipdrag_ros.estimation.ode_fit.fitted import FittedMotion
from shipdrag_ros.estimation.ode_fit.guess import InitialGuess
from shipdrag_ros.estimation.ode_fit.law import Law
from shipdrag_ros.estimation.ode_fit.record import RunRows
from shipdrag_ros.estimation.ode_fit.run_down import RunDown
from shipdrag_ros.estimation.ode_fit.solve import fit
from shipdrag_ros.inference.noise import WHITE, Noise, whiten
from shipdrag_ros.inference.rows import LOG, LOG_SCALE_SD, POSITION, Rows
from shipdrag_ros.inference.sampling import Seen
from shipdrag_ros.inference.settings import SENSORS_ALONE, Settings, noise_of
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship

_STEPS = 72  # of the integration, longer as the ship slows down
_ITERATIONS = 30
# Of a shorter coast the errors that go over in seconds look like powers of the speed: four of
# them run away at its ends, and with them r at the top, by which the slow noise is scaled.
_SHORT_S = 60.0
_LAG_S, _LAG_SD_S = 0.0, 6.0  # of a log behind other inputs, by its filter


@dataclass(frozen=True)
class Problem:
    """
    What all fits of one coastdown share.

    Attributes
    ----------
    rows
        Of the steady record, then of the coastdown.
    steady
        How many of them are of the steady record.
    grid_s
        Times of the integration.
    white
        Noise of the sensors, larger for an outlier, and how the hull damps.
    settings
        Of the slow noise; the first is used where one is.
    run_down
        What is known of the stop.
    guess
        Where the first fit starts.
    first
        Law of the first fit: four powers, two of a short coast.
    humps
        Where humps may be.
    extras
        Unknowns behind the coefficients that are fitted.
    """

    rows: Rows
    steady: int
    grid_s: Float64
    white: Noise
    settings: Settings
    run_down: RunDown
    guess: InitialGuess
    first: Law
    humps: Humps
    extras: tuple[int, ...]

    @classmethod
    def of(
        cls,
        record: RunRows,
        run_down: RunDown,
        ship: Ship,
        guess: InitialGuess,
        *,
        stopped: bool = False,
    ) -> Problem:
        """
        Set up the fit of a record that nothing but sensor noise disturbs.

        Parameters
        ----------
        record, run_down, ship, guess
        stopped
            The coastdown begins with a stop after steady sailing, whether or not the record
            holds that: a log lags behind from there on.
        """
        steady, coast = record.steady, record.coast
        rows = Rows(*(np.concatenate([a, b]) for a, b in zip(steady, coast)))
        variance = np.concatenate(
            [
                record.steady_variance(),
                record.variance(coast, record.coast_weight),
            ]
        )
        extras = [V0]
        if run_down.shaft_s > 0.0:
            extras += [THRUST, THRUST_FAST]
        # without a steady record a later stop is but a higher speed, or more thrust
        if run_down.stop_sd_s > 0.0 and len(steady.time_s):
            extras.append(ONSET)
        kinds = set(coast.kind.tolist())
        if POSITION in kinds:
            extras.append(X0)
        if LOG in kinds:
            # whether or not another input can show it
            extras.append(LOG_SCALE)
        if LOG in kinds and len(kinds) > 1:
            extras.append(CURRENT)
            if len(steady.time_s) or stopped:
                extras.append(LOG_LAG)
        end = float(coast.time_s[-1]) + 3.0 * run_down.stop_sd_s
        typical = max(float(coast.time_s[-1]), 1e-3) / 25.0
        grid = typical * np.expm1(np.linspace(0.0, math.log1p(end / typical), _STEPS + 1))
        ones = np.ones(len(variance))
        v_ref = guess.speed_m_s
        powers = FIRST if float(np.ptp(coast.time_s)) > _SHORT_S else PLAIN
        return cls(
            rows,
            len(steady.time_s),
            grid,
            Noise(variance, WHITE, ones, ones),
            SENSORS_ALONE,
            run_down,
            guess,
            Law(np.array(powers, np.int64), v_ref, run_down.shaft_s, ship.n_r_polynomial()),
            Humps.between(guess.lowest, float(ship.froude(v_ref))),
            tuple(extras),
        )

    @property
    def noise(self) -> Noise:
        """That of the first setting."""
        found: Noise = noise_of(self.settings, 0, self.rows, self.white, self.steady)
        return found

    def damped(self, plain: FittedMotion) -> Problem:
        """
        Return the problem in which a fit says how the hull damps.

        Raises
        ------
        EstimationError
            If the fit ran away.
        """
        _, speed = predict(
            plain.law, plain.unknowns, self.grid_s, self.rows, np.zeros(0, np.int64)
        )
        if not np.all(np.isfinite(speed)):
            raise EstimationError(
                'the fitted speed is not finite: give one coastdown, with the engine stopped, '
                'or set `estimator` to log_time'
            )
        damping, inertia = plain.damping(speed)
        return replace(self, white=Noise(self.white.variance, WHITE, damping, inertia))

    def disturbed(self, settings: Settings) -> Problem:
        """
        Return the problem with settings of the slow noise.
        """
        return replace(self, settings=settings)

    def weighted(self, variance: Float64) -> Problem:
        """
        Return the problem with another variance of the white noise.
        """
        return replace(self, white=self.white._replace(variance=variance))

    def seen(self, near: FittedMotion) -> Seen:
        """
        Return what the noise is learnt from, linear about a fit of the whole law.
        """
        active = self._active(near.law)
        table, _ = predict(near.law, near.unknowns, self.grid_s, self.rows, active)
        now, prior = near.unknowns[active], self._prior(near.law)[:, active]
        priors = self.humps.priors(self._unit_m_s2)
        count, k = priors.precision.shape
        mean, precision = np.tile(prior[0] - now, (count, 1)), np.tile(prior[1], (count, 1))
        mean[:, :k], precision[:, :k] = priors.mean - now[:k], priors.precision
        return Seen(self.rows, table, mean, precision, self.white, self.steady)

    def residual(self, found: FittedMotion) -> Float64:
        """
        Return measured less predicted of all rows, (n,).
        """
        none = np.zeros(0, np.int64)
        table, _ = predict(found.law, found.unknowns, self.grid_s, self.rows, none)
        result: Float64 = table[0]
        return result

    def correlated(self, found: FittedMotion) -> dict[int, BatchMeans]:
        """
        Return by how much what a fit leaves of the coastdown is correlated, for each input.
        """
        white = self.residual(found).reshape(1, -1)
        whiten(self.rows, white, self.noise)
        kind, left = self.rows.kind[self.steady :], white[0, self.steady :]
        return {int(of): batch_means(left[kind == of]) for of in np.unique(kind)}

    def condensed(self, near: FittedMotion) -> Problem:
        """
        Return the problem with the coastdown condensed to a row a step and input.

        What a fit that is near leaves is as good as a constant over a step, so
        that its mean stands for all of it; slow disturbances do not change
        within a step either.
        """
        left = self.residual(near)
        white = self.white
        coast, variance = means(self.rows, self.steady, left, white.variance, self.grid_s)
        before = slice(self.steady)
        nothing = np.zeros(len(coast.time_s))
        rows = Rows(
            *(
                np.concatenate([old[before], new])
                for old, new in zip(self.rows, (coast.time_s, coast.kind, nothing))
            )
        )
        value = np.concatenate([left[before], coast.value])
        value -= replace(self, rows=rows).residual(near) - rows.value
        damping, inertia = (
            np.interp(rows.time_s, self.rows.time_s, of_row)
            for of_row in (white.damping_1_s, white.inertia)
        )
        variance = np.concatenate([white.variance[before], variance])
        return replace(
            self,
            rows=rows._replace(value=value),
            white=Noise(variance, WHITE, damping, inertia),
        )

    def start(self) -> Float64:
        """
        Return unknowns for the first fit to start from: purely quadratic drag.
        """
        size = self.first.size
        unknowns = np.zeros(size + EXTRAS)
        unknowns[self.first.powers.tolist().index(2)] = self._unit_m_s2
        unknowns[size + V0] = self.guess.speed_m_s
        for extra, mean, _ in self.run_down.priors:
            unknowns[size + extra] = mean
        unknowns[size + X0] = self.guess.first_m
        return unknowns

    def fit_first(self, start: Float64) -> tuple[FittedMotion | None, Float64]:
        """
        Fit the first family, None where that fails; return whitened residuals too.

        How the thrust ended and the scale of the log are held as they are most likely: without
        the priors of the whole law they cannot be separated from the powers.
        """
        converged, _, unknowns, covariance, white = fit(
            self.first,
            start,
            self.grid_s,
            self.rows,
            self.noise,
            self._active(self.first, held=(THRUST, THRUST_FAST, LOG_SCALE)),
            self._prior(self.first),
            _ITERATIONS,
        )
        return FittedMotion(self.first, unknowns, covariance) if converged else None, white

    def whole(self, first: FittedMotion) -> FittedMotion:
        """
        Return the whole law as the first family has it.
        """
        law = self.first._replace(
            powers=np.array(POWERS, np.int64),
            humps=len(self.humps.sd),
            first_hump=self.humps.first,
            spacing=self.humps.spacing,
        )
        start = np.zeros(law.size + EXTRAS)
        start[law.size :] = first.unknowns[first.law.size :]
        for power, coefficient in zip(first.law.powers, first.unknowns):
            start[POWERS.index(power)] = coefficient
        return FittedMotion(law, start, np.zeros((len(start), len(start))))

    def average(self, near: FittedMotion) -> FittedMotion | None:
        """
        Average a fit of the whole law over priors and settings; None where it does not converge.
        """
        law = near.law
        converged, unknowns, covariance = average(
            law,
            near.unknowns,
            self.grid_s,
            Disturbed(self.rows, self.white, self.settings, self.steady),
            self._active(law),
            self._prior(law),
            self.humps.priors(self._unit_m_s2),
        )
        return FittedMotion(law, unknowns, covariance) if converged else None

    @property
    def _unit_m_s2(self) -> float:
        return self.guess.quadratic_1_m * self.guess.speed_m_s**2

    def _active(self, law: Law, held: tuple[int, ...] = ()) -> Int64:
        k = law.size
        extras = [k + extra for extra in self.extras if extra not in held]
        return np.array([*range(k), *extras], np.int64)

    def _prior(self, law: Law) -> Float64:
        """Return mean and precision of what is known before, (2, k + 8)."""
        k = law.size
        prior = np.zeros((2, k + EXTRAS))
        of_log = (LOG_SCALE, 0.0, LOG_SCALE_SD), (LOG_LAG, _LAG_S, _LAG_SD_S)
        for extra, mean, sd in (*self.run_down.priors, *of_log):
            prior[:, k + extra] = mean, 1.0 / sd**2 if sd > 0.0 else 0.0
        return prior
