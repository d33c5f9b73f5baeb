# SPDX-License-Identifier: Apache-2.0
"""
What coastdowns of a ship without a stated baseline can still show.

A form of the resistance, a v + b v |v|, is fitted to the runs themselves. What
has that form is then part of the baseline and cannot be seen: fouling,
propellers, cables. A constant part can, but one run cannot tell whether it is a
force or a speed; runs on other headings tell what turns with the Earth. No
single force is ever named.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.linalg import block_diag, solve_triangular
from scipy.optimize import minimize
from scipy.special import logsumexp

from shipdrag_ros.diagnosis.advice import declared
from shipdrag_ros.diagnosis.diagnose import CoastRun
from shipdrag_ros.diagnosis.noise import bin_means
from shipdrag_ros.diagnosis.result import Diagnosis, Gap, Named, Verdict, Where
from shipdrag_ros.diagnosis.terms import hats
from shipdrag_ros.diagnosis.verdict import UNNAMED, Weighed, decide
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.estimation.motion_fit.steady import white_sd
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship, Uncertain

_BINS, _LEAST_ROWS = 150, 20
_SD_OF_LOG = 2.0  # of a and b
_SHAPE_SD, _SHAPES = 0.15, 5  # of the resistance about the fitted form, relative
_FORCE_SD = 0.15  # of a constant force, relative to the first deceleration
_OFFSET_SD, _SMOOTH_SD, _SMOOTHS = 0.1, 0.05, 6  # of the reading, relative to the first speed
_WIDE = 3.0  # prior widths while noise is learnt
_NOISE_SD_OF_LOG = np.array([1.5, 1.0])
_ROUNDS, _EVALUATIONS = 25, 80
_APART_RAD = 0.5  # between headings of runs, from which they tell what turns with the Earth
_NOTHING, _ONE, _UNNAMED = 0.5, 0.42, 0.08  # probabilities before the data
_LACK_NATS = 5.0
EARTH = ('current', 'waves', 'wind')
LOG_ALONE = ('log_offset',)


def diagnose_fitted(runs: Sequence[CoastRun], ship: Ship) -> Diagnosis:
    """
    Tell what is missing in a resistance that is fitted to the runs.

    Parameters
    ----------
    runs
        One or more; the speed through water is used, or else over ground.
    ship
        For n_r and the mass; its baseline is not used.

    Raises
    ------
    DiagnosisError
        If a run has too few samples of a speed.
    """
    seen = [_Coast.of(run) for run in runs]
    by_log = all(coast.by_log for coast in seen)
    apart = _spread(seen) > _APART_RAD
    problem = _Problem(seen, np.eye(sum(len(coast.time_s) for coast in seen)) * 1e-2)
    problem = problem.with_noise_learnt()
    nothing, earth = problem.fit(()), problem.fit(('earth',))
    smooth, more = problem.fit(('smooth',)), problem.fit(('earth', 'smooth'))
    fits: dict[tuple[str, ...], _Fit] = {(name,): earth for name in EARTH}
    if by_log:
        fits[LOG_ALONE] = problem.fit(('offset',)) if apart else earth
    log = {names: fit.log_evidence + math.log(_ONE / len(fits)) for names, fit in fits.items()}
    log[()] = nothing.log_evidence + math.log(_NOTHING)
    log[UNNAMED] = smooth.log_evidence + math.log(_UNNAMED)
    total = float(logsumexp(list(log.values())))
    weighed = Weighed({}, {names: math.exp(each - total) for names, each in log.items()})
    first = weighed.named()[0]
    best = fits.get(first, nothing)
    lacking = bool(first) and more.log_evidence > earth.log_evidence + _LACK_NATS
    forces = frozenset(EARTH) if apart else frozenset((*EARTH, *LOG_ALONE))
    verdict, candidates = decide(
        weighed, lacking=lacking and first != LOG_ALONE, inseparable=[forces]
    )
    named: tuple[Named, ...] = ()
    if verdict is Verdict.NAMED and first == LOG_ALONE:
        offset = Uncertain(float(best.value[-1]), float(best.sd[-1]))
        named = (Named('log_offset', weighed.probability[first], {'offset_m_s': offset}),)
    missing = verdict in (Verdict.NAMED, Verdict.ONE_OF) and bool(first)
    speeds = np.concatenate([coast.speed_m_s for coast in seen])
    return Diagnosis(
        verdict=verdict,
        effects=named,
        candidates=candidates,
        nothing=weighed.nothing,
        unnamed=weighed.unnamed,
        would_decide=declared(candidates) if verdict is Verdict.ONE_OF else (),
        where=None
        if verdict is Verdict.NONE
        else Where(
            'force',
            (
                min(float(coast.time_s[0]) for coast in seen),
                max(float(coast.time_s[-1]) for coast in seen),
            ),
            (float(speeds.min()), float(speeds.max())),
        ),
        before=nothing.gap,
        after=best.gap if missing else None,
        held_out_before=None,
        held_out_after=None,
        baseline='fitted_here',
        best=named,
        notes=tuple(_notes(ship, seen, best if missing else nothing, by_log=by_log)),
    )


@dataclass(frozen=True)
class _Coast:
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
    def of(cls, run: CoastRun) -> _Coast:
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
        heading = math.atan2(float(np.sin(yaw).mean()), float(np.cos(yaw).mean()))
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
            heading if len(yaw) else math.nan,
            float(np.ptp(np.unwrap(yaw))) if len(yaw) else 0.0,
        )


def _spread(seen: Sequence[_Coast]) -> float:
    """Return how far the headings of runs differ [rad]; 0 where one is not known."""
    turned = np.array([coast.heading_rad - seen[0].heading_rad for coast in seen])
    return float(np.abs(np.angle(np.exp(1j * turned))).max()) if np.isfinite(turned).all() else 0.0


@dataclass(frozen=True)
class _Fit:
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
class _Problem:
    """Runs, and the lower triangular factor of the covariance of their noise."""

    seen: Sequence[_Coast]
    factor: Float64

    def with_noise_learnt(self) -> _Problem:
        """Learn the noise, colour included, of the runs themselves: none is known before."""
        rough = self.fit(('earth',))
        _, sd = self._prior(('earth',))
        slopes = self._slopes(('earth',), rough.value, 1e-3 * sd) * sd * _WIDE
        left = rough.residual
        duration = max(coast.duration_s for coast in self.seen)
        units = np.array([max(float(left.std()), 1e-6), 0.1 * duration])

        def factor(x: Float64) -> Float64:
            size, time = units * np.exp(x)
            blocks = [
                size**2 * np.exp(-np.abs(coast.time_s[:, None] - coast.time_s) / time)
                + np.diag(coast.white_sd_m_s**2)
                for coast in self.seen
            ]
            return np.asarray(block_diag(*blocks), np.float64)

        def cost(x: Float64) -> float:
            whole = np.linalg.cholesky(factor(x) + slopes @ slopes.T)
            white = solve_triangular(whole, left, lower=True)
            log_det = 2.0 * float(np.log(np.diag(whole)).sum())
            return float(white @ white) + log_det + float(((x / _NOISE_SD_OF_LOG) ** 2).sum())

        found = minimize(cost, np.zeros(2), method='Nelder-Mead', options={'maxfev': _EVALUATIONS})
        return _Problem(self.seen, np.asarray(np.linalg.cholesky(factor(found.x)), np.float64))

    def fit(self, parts: tuple[str, ...]) -> _Fit:
        """Fit by Levenberg-Marquardt with normal priors; Laplace's evidence."""
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
        return _Fit(mean + sd * z, spread, residual, white, evidence)

    def _prior(self, parts: tuple[str, ...]) -> tuple[Float64, Float64]:
        """Return means and standard deviations of the parameters."""
        first = np.array([float(coast.speed_m_s[0]) for coast in self.seen])
        top, duration = float(first.max()), max(coast.duration_s for coast in self.seen)
        mean = [math.log(1.0 / duration), math.log(1.0 / (duration * top))]
        mean += [0.0] * _SHAPES + first.tolist()
        sd = [_SD_OF_LOG, _SD_OF_LOG] + [_SHAPE_SD] * _SHAPES + (0.2 * first).tolist()
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
        shape = np.ascontiguousarray(value[2 : 2 + _SHAPES])
        place = 2 + _SHAPES
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
                    + hats((coast.time_s - coast.time_s[0]) / coast.duration_s, _SMOOTHS).T @ sizes
                )
            found.append(speed)
        return np.concatenate(found)

    def _whiten(self, table: Float64) -> Float64:
        found: Float64 = solve_triangular(self.factor, table, lower=True, check_finite=False)
        return found


@njit(cache=True)
def _rate(speed: float, a: float, b: float, shape: Float64, top: float, force: float) -> float:
    """Return dv/dt; the shape is a factor, linear between even speeds up to the top."""
    place = min(abs(speed) / top, 1.0) * (len(shape) - 1)
    k = min(int(place), len(shape) - 2)
    factor = 1.0 + shape[k] + (place - k) * (shape[k + 1] - shape[k])
    return float(-(a + b * abs(speed)) * speed * factor - force)


@njit(cache=True)
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


def _notes(ship: Ship, seen: Sequence[_Coast], fit: _Fit, *, by_log: bool) -> list[str]:
    a, b = np.exp(fit.value[:2])
    found = [
        f'the ship file has no baseline: -dv/dt = a v + b v^2 with a = {a:.3g} 1/s and '
        f'b = {b:.3g} 1/m is fitted to the {len(seen)} run(s) themselves; what has that form '
        '(fouling, propeller, cable) cannot be seen, and no single force is named',
        'the noise is learnt from the coastdown itself: what changes slowly hides in it',
    ]
    place = 2 + _SHAPES + len(seen)
    if len(fit.value) == place + 2:
        force, sd = fit.value[place], fit.sd[place]
        first = float(seen[0].speed_m_s[0])
        mass = ship.mass_kg * (1.0 + float(ship.n_r(np.array([abs(first)]))[0]))
        found.append(
            f'a constant part of {force:.3g} ± {sd:.1g} m/s^2 is there besides: a force of '
            f'{force * mass:.3g} N, or a speed of the water of {force / a:.3g} m/s or less'
        )
    if by_log and len(seen) == 1:
        found.append(
            'current stands in the set for a speed that is imported as through water and was '
            'measured over ground (motion capture, GNSS); a log does not feel one'
        )
    swing = max(coast.swing_rad for coast in seen)
    if swing > 0.2:
        found.append(
            f'the heading swings over {math.degrees(swing):.0f} degrees: the drag of drifting '
            'and turning is part of the fitted form'
        )
    return found
