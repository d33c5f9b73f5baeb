# SPDX-License-Identifier: Apache-2.0
"""
A form of the resistance fitted to the coastdowns themselves.

-dv/dt = (a v + b v |v|) (1 + a small, smooth shape) + what a hypothesis adds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, solve_triangular
from scipy.optimize import minimize

from shipdrag_ros.compiled import compiled
from shipdrag_ros.diagnosis.diagnose import CoastRun
from shipdrag_ros.diagnosis.noise import bin_means
from shipdrag_ros.diagnosis.result import Gap
from shipdrag_ros.diagnosis.terms import cubic_bsplines
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.estimation.motion_fit.steady import white_sd
from shipdrag_ros.samples import Float64

SHAPES = 5
_BINS, _LEAST_ROWS = 150, 20
_SD_OF_LOG = 2.0  # of a and b
_SHAPE_SD = 0.15  # of the resistance about the fitted form, relative
_FORCE_SD = 0.15  # of a constant force, relative to the first deceleration
_OFFSET_SD, _SMOOTH_SD, _SMOOTHS = 0.1, 0.05, 6  # of the reading, relative to the first speed
_WIDE = 3.0  # prior widths while noise is learnt
_NOISE_SD_OF_LOG = np.array([1.5, 1.0])
_ROUNDS, _EVALUATIONS = 25, 80


@dataclass(frozen=True)
class Coast:
    """
    A coastdown, averaged over bins.

    Attributes
    ----------
    time_s, speed_m_s, white_sd_m_s : (n,)
        From the start of the window; the first is where the speed is highest.
    heading_rad
        NaN where it is not known.
    swing_rad
        Of the heading during the run; 0 where it is not known.
    """

    by_log: bool
    time_s: Float64
    speed_m_s: Float64
    white_sd_m_s: Float64
    heading_rad: float
    swing_rad: float

    @property
    def duration_s(self) -> float:
        """Time from the highest speed to the end."""
        return float(self.time_s[-1] - self.time_s[0])

    @classmethod
    def of(cls, run: CoastRun) -> Coast:
        """
        Average a run from its highest speed on.

        Raises
        ------
        DiagnosisError
            If there are too few speeds, or none ahead.
        """
        window = run.window
        by_log = len(window.speed_through_water) >= 2 * _LEAST_ROWS
        series = window.speed_through_water if by_log else window.speed_over_ground
        if len(series) < 2 * _LEAST_ROWS:
            raise DiagnosisError(
                f'{run.name}: {len(series)} speeds in the coastdown, and the ship file has no '
                f'baseline; to fit one, at least {2 * _LEAST_ROWS} speeds through water or over '
                'ground are needed: give a record with a speed, or a ship file with `baseline`'
            )
        time = np.asarray((series.time_ns - window.start_ns) * 1e-9, np.float64)
        edges = np.linspace(time[0], time[-1] + 1e-6, min(_BINS, len(time) // 2) + 1)[1:]
        when, mean, count = bin_means(time, series.value, edges)
        top = int(np.argmax(mean))  # until then the thrust has not run down
        yaw = window.heading.value
        if not mean[top] > 0.0:
            raise DiagnosisError(
                f'{run.name}: the speed is never above 0: give a record of a ship under way ahead'
            )
        if len(mean) - top < _LEAST_ROWS:
            raise DiagnosisError(
                f'{run.name}: the speed is highest {when[top]:.0f} s after the begin and there '
                'is too little after it: give a record that begins at the stop'
            )
        return cls(
            by_log,
            when[top:],
            mean[top:],
            (max(white_sd(series.value), 1e-4 * float(mean[top])) / np.sqrt(count))[top:],
            float(np.angle(np.exp(1j * yaw).mean())) if len(yaw) else math.nan,
            float(np.ptp(np.unwrap(yaw))) if len(yaw) else 0.0,
        )


@dataclass(frozen=True)
class FormFit:
    """
    A hypothesis fitted.

    Attributes
    ----------
    value, sd : (p,)
        ln a [1/s], ln b [1/m], the shape about that form, first speed of each run
        [m/s], then what the hypothesis adds: the constant force over mass along the first heading
        and to port [m/s^2], an offset [m/s], or sizes of a smooth error [m/s].
    """

    value: Float64
    sd: Float64
    residual: Float64
    white: Float64
    log_evidence: float

    @property
    def gap(self) -> Gap:
        """How far it is from the runs."""
        rms = float(np.sqrt(np.mean(self.residual**2)))
        return Gap(rms, None, float(self.white @ self.white) / len(self.white))


@dataclass(frozen=True)
class FormProblem:
    """
    Runs, and the lower triangular factor of the covariance of their noise.
    """

    seen: Sequence[Coast]
    factor: Float64

    @classmethod
    def learnt(cls, seen: Sequence[Coast]) -> FormProblem:
        """
        Learn the noise, colour included, of the runs themselves: none is known before.
        """
        white = cls(seen, np.eye(sum(len(coast.time_s) for coast in seen)) * 1e-2)
        rough = white.fit(('earth',))
        _, sd = white._prior(('earth',))
        slopes = white._slopes(('earth',), rough.value, 1e-3 * sd) * sd * _WIDE
        left = rough.residual
        duration = max(coast.duration_s for coast in seen)
        units = np.array([max(float(left.std()), 1e-6), 0.1 * duration])

        def factor(x: Float64) -> Float64:
            size, time = units * np.exp(x)
            blocks = [
                size**2 * np.exp(-np.abs(coast.time_s[:, None] - coast.time_s) / time)
                + np.diag(coast.white_sd_m_s**2)
                for coast in seen
            ]
            return np.asarray(block_diag(*blocks), np.float64)

        def cost(x: Float64) -> float:
            whole = np.linalg.cholesky(factor(x) + slopes @ slopes.T)
            white = solve_triangular(whole, left, lower=True)
            log_det = 2.0 * float(np.log(np.diag(whole)).sum())
            return float(white @ white) + log_det + float(((x / _NOISE_SD_OF_LOG) ** 2).sum())

        found = minimize(cost, np.zeros(2), method='Nelder-Mead', options={'maxfev': _EVALUATIONS})
        return cls(seen, np.asarray(np.linalg.cholesky(factor(found.x)), np.float64))

    def fit(self, parts: tuple[str, ...]) -> FormFit:
        """
        Fit a hypothesis.

        Parameters
        ----------
        parts
            What it adds to the form: 'earth', 'offset', 'smooth'.

        Notes
        -----
        Levenberg and Marquardt with normal priors; Laplace's evidence.
        """
        mean, sd = self._prior(parts)
        z, damping = np.zeros(len(mean)), 1e-3
        cost, residual, white = self._cost(parts, mean, sd, z)
        matrix = np.eye(len(z))
        for _ in range(_ROUNDS):
            slopes = self._whiten(self._slopes(parts, mean + sd * z, 1e-3 * sd)) * sd
            matrix = np.eye(len(z)) + slopes.T @ slopes
            fall = slopes.T @ white - z
            trial = z + np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), fall)
            at_trial = self._cost(parts, mean, sd, trial)
            if at_trial[0] < cost:
                settled = cost - at_trial[0] < 1e-4
                z, damping = trial, 0.2 * damping
                cost, residual, white = at_trial
                if settled:
                    break
            else:
                damping *= 10.0
        spread = sd * np.sqrt(np.diag(np.linalg.inv(matrix)))
        evidence = -0.5 * cost - 0.5 * float(np.linalg.slogdet(matrix)[1])
        return FormFit(mean + sd * z, spread, residual, white, evidence)

    def _prior(self, parts: tuple[str, ...]) -> tuple[Float64, Float64]:
        """Return means and standard deviations of the parameters."""
        first = np.array([float(coast.speed_m_s[0]) for coast in self.seen])
        top, duration = float(first.max()), max(coast.duration_s for coast in self.seen)
        mean = [math.log(1.0 / duration), math.log(1.0 / (duration * top))]
        mean += [0.0] * SHAPES + first.tolist()
        sd = [_SD_OF_LOG, _SD_OF_LOG] + [_SHAPE_SD] * SHAPES + (0.2 * first).tolist()
        for part in parts:
            size = {
                'earth': [_FORCE_SD * 2.0 * top / duration] * 2,
                'offset': [_OFFSET_SD * top],
                'smooth': [_SMOOTH_SD * top] * (_SMOOTHS * len(self.seen)),
            }[part]
            mean, sd = mean + [0.0] * len(size), sd + size
        return np.array(mean), np.array(sd)

    def _cost(
        self, parts: tuple[str, ...], mean: Float64, sd: Float64, z: Float64
    ) -> tuple[float, Float64, Float64]:
        measured = np.concatenate([coast.speed_m_s for coast in self.seen])
        with np.errstate(over='ignore', invalid='ignore'):  # a motion that runs away is no fit
            residual = measured - self._predict(parts, (mean + sd * z)[:, None])[:, 0]
            white = self._whiten(residual)
            cost = float(white @ white + z @ z)
        return cost if math.isfinite(cost) else math.inf, residual, white

    def _slopes(self, parts: tuple[str, ...], value: Float64, step: Float64) -> Float64:
        """Return the derivatives of the prediction, (n, p); all steps are one simulation."""
        steps = np.hstack([np.diag(step), -np.diag(step)])
        both = self._predict(parts, value[:, None] + steps)
        return np.asarray((both[:, : len(step)] - both[:, len(step) :]) / (2.0 * step))

    def _predict(self, parts: tuple[str, ...], value: Float64) -> Float64:
        """Return the speeds that are read, (n, k), of parameters (p, k)."""
        a, b = np.exp(value[:2])
        shape = np.ascontiguousarray(value[2 : 2 + SHAPES])
        place = 2 + SHAPES
        first = value[place : place + len(self.seen)]
        place += len(self.seen)
        top = max(float(coast.speed_m_s[0]) for coast in self.seen)
        force = {'earth': 2}.get(parts[0] if parts else '', 0)
        along = value[place] if force else np.zeros(value.shape[1])
        to_port = value[place + 1] if force else np.zeros(value.shape[1])
        rest = value[place + force :]
        found = []
        for j, coast in enumerate(self.seen):
            turned = coast.heading_rad - self.seen[0].heading_rad
            turned = turned if math.isfinite(turned) else 0.0
            constant = along * math.cos(turned) + to_port * math.sin(turned)
            speed = _coasting(coast.time_s, first[j], a, b, shape, top, constant)
            if 'offset' in parts:
                speed = speed + rest[0]
            if 'smooth' in parts:
                sizes = rest[_SMOOTHS * j : _SMOOTHS * (j + 1)]
                speed = (
                    speed
                    + cubic_bsplines(
                        (coast.time_s - coast.time_s[0]) / coast.duration_s, _SMOOTHS
                    ).T
                    @ sizes
                )
            found.append(speed)
        return np.concatenate(found)

    def _whiten(self, table: Float64) -> Float64:
        found: Float64 = solve_triangular(self.factor, table, lower=True, check_finite=False)
        return found


@compiled
def _rate(speed: float, a: float, b: float, shape: Float64, top: float, force: float) -> float:
    """Return dv/dt; the shape is a factor, linear between even speeds up to the top."""
    place = min(abs(speed) / top, 1.0) * (len(shape) - 1)
    k = min(int(place), len(shape) - 2)
    factor = 1.0 + shape[k] + (place - k) * (shape[k + 1] - shape[k])
    return float(-(a + b * abs(speed)) * speed * factor - force)


@compiled
def _coasting(
    time_s: Float64,
    first: Float64,
    a: Float64,
    b: Float64,
    shape: Float64,
    top: float,
    force: Float64,
) -> Float64:
    """Integrate by Runge and Kutta, (n, k)."""
    found = np.empty((len(time_s), len(first)))
    for c in range(len(first)):
        speed = first[c]
        own = shape[:, c].copy()
        for i in range(len(time_s)):
            if i:
                dt = time_s[i] - time_s[i - 1]
                one = _rate(speed, a[c], b[c], own, top, force[c])
                two = _rate(speed + 0.5 * dt * one, a[c], b[c], own, top, force[c])
                three = _rate(speed + 0.5 * dt * two, a[c], b[c], own, top, force[c])
                four = _rate(speed + dt * three, a[c], b[c], own, top, force[c])
                speed += dt / 6.0 * (one + 2.0 * two + 2.0 * three + four)
            found[i, c] = speed
    return found
