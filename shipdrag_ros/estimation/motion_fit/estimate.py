# SPDX-License-Identifier: Apache-2.0
"""
The final figure of a coastdown: the equation of motion fitted to its window.

A pure function of the window, the ship and the parameters, without threads and
random numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

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
    resistance,
)
from shipdrag_ros.estimation.motion_fit.families import (
    FAMILIES,
    GROWTH,
    LARGEST,
    Average,
    FamilyFit,
)
from shipdrag_ros.estimation.motion_fit.record import KINDS, Record
from shipdrag_ros.estimation.motion_fit.run_down import RunDown
from shipdrag_ros.estimation.motion_fit.solve import fit
from shipdrag_ros.estimation.motion_fit.steady import LEAST_S, learn
from shipdrag_ros.estimation.motion_fit.whitening import CALM, Disturbance
from shipdrag_ros.estimation.result import Estimate, FroudeMax, ResistanceCurve, Track
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship

NAME = 'motion'
_STEPS = 96  # of the integration, longer as the ship slows down
_CURVE_POINTS = 257
_HUBER = 2.5  # whitened residuals beyond it count by their size only
_ROUNDS = 3  # of the weights
_ITERATIONS = 30
_SCALE_SD = 0.02  # of a log's scale, before the fit
_SCALE_SIGNIFICANT = 3.0  # standard deviations
_QUIET_S = 5.0  # an onset known worse than this: the last seconds before it teach nothing


@dataclass(frozen=True)
class _Problem:
    """What all families share."""

    rows: Rows
    variance: Float64
    grid_s: Float64
    about: Disturbance
    run_down: RunDown
    n_r: Float64
    v_ref_m_s: float
    extras: tuple[int, ...]

    def law(self, powers: tuple[int, ...]) -> Law:
        thrust = 1.0 if self.run_down.run_down_s > 0.0 else 0.0
        return Law(np.array(powers, np.int64), self.v_ref_m_s, thrust, self.n_r)

    def start(self, powers: tuple[int, ...], other: FamilyFit | None, guess: _Guess) -> Float64:
        """Return unknowns to start from: another family's, or a guess."""
        k = len(powers)
        unknowns = np.zeros(k + EXTRAS)
        if other is None:
            unknowns[powers.index(2)] = guess.quadratic * self.v_ref_m_s**2
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
        """Fit one family; None where it does not converge."""
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
            law, start, self.grid_s, self.rows, self.variance, self.about, active, prior, _ITERATIONS
        )
        if not converged:
            return None, white
        full = np.zeros((k + EXTRAS, k + EXTRAS))
        full[np.ix_(active, active)] = covariance
        return (
            FamilyFit(law, unknowns, full, chi2, len(self.rows.time_s), len(active)),
            white,
        )


@dataclass(frozen=True)
class _Guess:
    """A crude answer to start from: purely quadratic drag."""

    speed_m_s: float
    quadratic: float  # r / v^2 [1/m]
    first_m: float
    lowest: float  # speed at the end over that at the start

    @classmethod
    def of(cls, coast: Rows, n_r: float) -> _Guess:
        kind = POSITION
        for wanted in (LOG, 1):
            if np.any(coast.kind == wanted):
                kind = wanted
                break
        chosen = coast.kind == kind
        time_s, value = coast.time_s[chosen], coast.value[chosen]
        blocks = np.array_split(np.arange(len(time_s)), min(12, len(time_s) // 4))
        if kind == POSITION:
            middle = np.array([time_s[block].mean() for block in blocks])
            where = np.array([np.median(value[block]) for block in blocks])
            when = 0.5 * (middle[1:] + middle[:-1])
            speed = np.diff(where) / np.diff(middle)
        else:
            when = np.array([np.median(time_s[block]) for block in blocks])
            speed = np.array([np.median(value[block]) for block in blocks])
        top = float(speed.max())
        if not top > 0.0:
            raise EstimationError(
                f'the speed in the window is {top:.3g} m/s at most: give a window that lies in '
                'a coastdown'
            )
        inverse = 1.0 / np.maximum(speed, 0.05 * top)
        # 1/v = 1/v0 + c t / (1 + n_r); relative errors of v count alike
        weight = 1.0 / inverse**2
        mean_t, mean = np.average(when, weights=weight), np.average(inverse, weights=weight)
        t = when - mean_t
        slope = float((weight * t * (inverse - mean)).sum() / (weight * t * t).sum())
        if not slope > 0.0:
            raise EstimationError(
                f'no deceleration in {np.ptp(time_s):.4g} s: give a longer window, or one after '
                'the engine stop'
            )
        first = mean - slope * mean_t
        v0 = min(1.0 / first, 1.2 * top) if first > 0.0 else 1.2 * top
        positions = coast.value[coast.kind == POSITION]
        first_m = float(positions[0]) if len(positions) else 0.0
        return cls(float(v0), slope * (1.0 + n_r), first_m, float(np.clip(speed[-1] / v0, 0.05, 0.9)))


def estimate(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
    """
    Estimate r(v) from one window by fitting the equation of motion.

    Parameters
    ----------
    window
        Accepted samples; with the steady record `before` it, disturbances are
        learnt and the speed at the stop is pinned.
    ship
        For n_r, the Froude number and the run-down of the thrust.
    parameters
        `froude_min` and the known standard deviations are used.

    Raises
    ------
    EstimationError
        If the window does not hold a coastdown that can be estimated.
    """
    run_down = RunDown.of(window, ship)
    record = Record.of(window, run_down, parameters)
    n_r = ship.n_r_polynomial()
    guess = _Guess.of(record.coast, float(ship.n_r(1.0)))
    notes = [*window.notes, *ship.warnings, f'{run_down.source}']
    # first the coastdown alone, as if nothing but sensor noise disturbed
    alone = record.without_steady()
    first, problem = _robust(_problem(alone, run_down, n_r, guess), alone, None, guess)
    if record.steady_s >= LEAST_S:
        about = _learn(record, first, run_down)
        problem = _with(_problem(record, run_down, n_r, guess), about=about)
        first, problem = _robust(problem, record, first, guess)
        notes.append(_disturbance_note(about, record.steady_s))
    else:
        record = alone
        notes.append(
            'there is no steady record before the onset to learn slow disturbances from: the '
            'band holds the noise of the sensors alone'
        )
    first, problem = _log_scale(problem, first, notes)
    average = _average(problem, first, guess)
    return _result(average, problem, record, window, ship, parameters, tuple(notes))


def _problem(record: Record, run_down: RunDown, n_r: Float64, guess: _Guess) -> _Problem:
    steady, coast = record.steady, record.coast
    rows = Rows(*(np.concatenate([a, b]) for a, b in zip(steady, coast)))
    variance = np.concatenate(
        [record.variance(steady, record.steady_count), record.variance(coast)]
    )
    extras = [V0]
    if run_down.run_down_sd_s > 0.0:
        extras.append(RUN_DOWN)
    if run_down.stop_sd_s > 0.0:
        extras.append(ONSET)
    kinds = set(coast.kind.tolist())
    if POSITION in kinds:
        extras.append(X0)
    if LOG in kinds and len(kinds) > 1:
        extras.append(CURRENT)
    end = float(coast.time_s[-1]) + 3.0 * run_down.stop_sd_s
    typical = max(float(coast.time_s[-1]), 1e-3) / 25.0
    grid = typical * np.expm1(np.linspace(0.0, math.log1p(end / typical), _STEPS + 1))
    return _Problem(rows, variance, grid, CALM, run_down, n_r, guess.speed_m_s, tuple(extras))


def _with(problem: _Problem, **changes: object) -> _Problem:
    from dataclasses import replace

    return replace(problem, **changes)  # type: ignore[arg-type]


def _robust(
    problem: _Problem, record: Record, start: FamilyFit | None, guess: _Guess
) -> tuple[FamilyFit, _Problem]:
    """Fit the first family; find outliers and the scatter of each input on the way."""
    powers = FAMILIES[0]
    base = np.concatenate(
        [record.variance(record.steady, record.steady_count), record.variance(record.coast)]
    )
    variance = base
    found = start
    for _ in range(_ROUNDS):
        problem = _with(problem, variance=variance)
        begin = problem.start(powers, found, guess)
        found, white = problem.fit(powers, begin)
        if found is None:
            raise EstimationError(
                'the equation of motion could not be fitted to the window: is it one coastdown, '
                'with the engine stopped all the time?'
            )
        # of the residual as it would be with its own variance
        size = np.abs(white) * np.sqrt(variance / base)
        weight = np.where(size > _HUBER, _HUBER / np.maximum(size, _HUBER), 1.0)
        scale = np.ones(len(base))
        for kind in KINDS.values():
            chosen = problem.rows.kind == kind
            chosen[: len(record.steady.time_s)] = False
            count = int(chosen.sum())
            if count:
                kept = weight[chosen] * size[chosen] ** 2
                share = 1.0 - found.parameters / len(base)
                scale[problem.rows.kind == kind] = float(kept.mean()) / share
        variance = base / weight
        base = base * scale
        variance = base / weight
    return found, _with(problem, variance=variance)


def _learn(record: Record, first: FamilyFit, run_down: RunDown) -> Disturbance:
    k = len(first.law.powers)
    v0 = float(first.unknowns[k + V0])
    inertia = 1.0 + float(np.polynomial.polynomial.polyval(v0, first.law.n_r))
    _, slope = resistance(first.law, first.unknowns, v0)
    quiet = -30.0 if run_down.stop_sd_s > _QUIET_S else 0.0
    keep = record.steady.time_s < quiet
    rows = Rows(*(column[keep] for column in record.steady))
    variance = record.variance(rows, record.steady_count[keep])
    return learn(rows, variance, damping=max(slope / inertia, 1e-6), inertia=inertia)


def _disturbance_note(about: Disturbance, steady_s: float) -> str:
    found = []
    if about.gust_m_s2:
        found.append(f'a force of {about.gust_m_s2:.2g} m/s² over {about.gust_s:.0f} s')
    if about.water_m_s:
        found.append(f'the log by {about.water_m_s:.2g} m/s over {about.water_s:.0f} s')
    return (
        f'disturbances learnt from {steady_s:.0f} s of steady record: '
        f'{" and ".join(found) or "none but the noise of the sensors"}'
    )


def _log_scale(
    problem: _Problem, first: FamilyFit, notes: list[str]
) -> tuple[FamilyFit, _Problem]:
    """Take the scale of the log as unknown where the data show that it is not 1."""
    if CURRENT not in problem.extras:
        return first, problem
    scaled = _with(problem, extras=(*problem.extras, LOG_SCALE))
    found, _ = scaled.fit(FAMILIES[0], first.unknowns)
    if found is None:
        return first, problem
    at = len(FAMILIES[0]) + LOG_SCALE
    scale, sd = float(found.unknowns[at]), math.sqrt(found.covariance[at, at])
    if abs(scale) <= _SCALE_SIGNIFICANT * sd:
        return first, problem
    notes.append(f'the log reads {100.0 * scale:+.2g} ± {200.0 * sd:.1g} % off, taken out')
    return found, scaled


def _average(problem: _Problem, first: FamilyFit, guess: _Guess) -> Average:
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


def _result(
    average: Average,
    problem: _Problem,
    record: Record,
    window: Window,
    ship: Ship,
    parameters: Parameters,
    notes: tuple[str, ...],
) -> Estimate:
    best = average.best
    k = len(best.law.powers)
    coast = record.coast
    end_s = float(coast.time_s[-1])
    ends = Rows(np.array([end_s, end_s]), np.array([LOG, LOG]), np.zeros(2))
    every = np.arange(k + EXTRAS, dtype=np.int64)
    plain = best.unknowns.copy()
    plain[k + LOG_SCALE] = 0.0
    table, speed = predict(best.law, plain, problem.grid_s, ends, every[:-1])
    by_unknown = table[1:, 0]
    last_var = np.einsum('i,ij,j->', by_unknown, best.covariance[:-1, :-1], by_unknown)
    low = max(float(speed[0]), float(ship.speed(parameters.froude_min)))
    high, _ = average.unknown(V0)
    _, at_start = predict(best.law, plain, problem.grid_s, coast, every[:1])
    high = min(high, float(at_start.max()))
    if not high > low * 1.02:
        raise EstimationError(
            f'the fitted speed falls from {high:.4g} to {low:.4g} m/s only, above froude_min '
            f'{parameters.froude_min:g}: give a window that lies in a coastdown, or a smaller '
            'froude_min'
        )
    curve = _curve(average, np.linspace(low, high, _CURVE_POINTS), ship)
    residual = predict(best.law, best.unknowns, problem.grid_s, coast, every[:1])[0][0]
    tracks = {}
    for name, stamps in record.stamps.items():
        chosen = coast.kind == KINDS[name]
        measured = coast.value[chosen]
        tracks[name] = Track(stamps, measured, measured - residual[chosen])
    last = average.resistance(speed[:1])
    r_last = float(last[0][0])
    inertia = 1.0 + float(ship.n_r(speed[0]))
    noise = {}
    for name in record.white_sd:
        chosen = problem.rows.kind == KINDS[name]
        chosen[: len(record.steady.time_s)] = False
        noise[name] = float(np.sqrt(np.min(problem.variance[chosen])))
    current = average.unknown(CURRENT) if CURRENT in problem.extras else (None, None)
    stamps = np.concatenate(list(record.stamps.values()))
    return Estimate(
        estimator=NAME,
        start_ns=int(stamps.min()),
        end_ns=int(stamps.max()),
        order=None,
        orders=(),
        samples={name: len(times) for name, times in record.stamps.items()},
        noise_sd=noise,
        curve=curve,
        froude_valid=(float(curve.froude[0]), float(curve.froude[-1])),
        froude_max_by=FroudeMax.BRANCH_TOP,
        froude_max_argmax=float(curve.froude[np.argmax(curve.slope)]),
        w=float(curve.sigma_repeatable_m_s2.max() / curve.resistance_m_s2.max()),
        last_speed_m_s=float(speed[0]),
        last_speed_sigma_m_s=float(np.sqrt(last_var)),
        last_resistance_m_s2=r_last,
        last_sigma_m_s2=float(np.hypot(last[1][0], r_last / inertia * ship.added_mass.sd)),
        tracks=tracks,
        current_m_s=current[0],
        current_sigma_m_s=current[1],
        notes=notes,
    )


def _curve(average: Average, speed: Float64, ship: Ship) -> ResistanceCurve:
    """Return r(v) where it retards."""
    r, repeatable = average.resistance(speed)
    slope, slope_sigma = average.slope(speed)
    of_n_r = np.abs(r) / (1.0 + ship.n_r(speed)) * ship.added_mass.sd
    per_froude = float(ship.speed(1.0))
    driving = np.flatnonzero(r <= 0.0)
    part = slice(int(driving[-1]) + 1 if len(driving) else 0, None)
    return ResistanceCurve(
        np.ascontiguousarray(speed[part]),
        r[part],
        np.sqrt(repeatable**2 + of_n_r**2)[part],
        repeatable[part],
        ship.froude(speed[part]),
        (per_froude * slope)[part],
        (per_froude * slope_sigma)[part],
    )
