# SPDX-License-Identifier: Apache-2.0
"""
The final figure of a coastdown: the equation of motion fitted to its window.

A pure function of the window, the ship and the parameters, without threads and
random numbers.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.assemble import AtEnd, assembled, log_scale_note
from shipdrag_ros.estimation.curve import ValidRange
from shipdrag_ros.estimation.ode_fit.batch_means import BatchMeans
from shipdrag_ros.estimation.ode_fit.coast import CURRENT, LOG_LAG, LOG_SCALE, V0, predict
from shipdrag_ros.estimation.ode_fit.first_fits import Start, fit_robustly
from shipdrag_ros.estimation.ode_fit.fitted import FittedMotion
from shipdrag_ros.estimation.ode_fit.guess import InitialGuess
from shipdrag_ros.estimation.ode_fit.problem import Problem
from shipdrag_ros.estimation.ode_fit.record import RunRows
from shipdrag_ros.estimation.ode_fit.run_down import ONSET_SD_S, RunDown
from shipdrag_ros.estimation.ode_fit.steady import LEAST_S
from shipdrag_ros.estimation.result import Estimate, ResistanceCurve, Track
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.inference.learning import LEAST_S as LEARN_S
from shipdrag_ros.inference.learning import learn, of_steady, prior
from shipdrag_ros.inference.rows import CODES, LOG, Rows
from shipdrag_ros.inference.settings import NoisePosterior
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

NAME = 'ode_fit'
_CURVE_POINTS = 257
_NOT_AVERAGED = (
    'the fit did not converge under all settings of the slow disturbances: it is by the most '
    'probable one of the steady record, and its band may be too narrow'
)
_FIRST_ALONE = (
    'the whole law of r did not converge: r is a sum of the powers of the speed fitted first, '
    'without wave making or knowledge of the thrust, and its band is too narrow; give the time '
    'of the stop, a shaft, or a window that begins after it'
)
_QUIET_S = 5.0  # before the stop the last seconds teach nothing; more where it is known worse


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
    record = RunRows.of(window, run_down, parameters)
    guess = InitialGuess.of(record.coast, float(ship.n_r(1.0)))
    notes = [*window.notes, *ship.warnings, *run_down.notes]
    # first the coastdown alone, as if nothing but sensor noise disturbed
    alone = record.without_steady()
    first, _ = fit_robustly(Problem.of(alone, run_down, ship, guess))
    plain = first.plainly(guess.lowest)
    if record.steady_s < LEAST_S:
        record = alone
    # after a stop a log's filter begins to fall behind: without it, that passes for a current
    stopped = window.before is not None
    problem = Problem.of(record, run_down, ship, guess, stopped=stopped).damped(plain)
    problem = problem.disturbed(_at_first(record, problem, run_down, guess).typical)
    start = Start.of(problem, first)
    if start.near is None:
        start = start.again(problem)
    first, full, problem = start.first, start.full, start.condensed
    near = start.near or problem.whole(first)
    noise = learn(problem.seen(near), guess.speed_m_s)
    problem = problem.disturbed(noise.settings)
    found = problem.average(near)
    if found is None:
        # where the whole law cannot be fitted, the first family stands alone
        found = start.near or first
        notes.append(_NOT_AVERAGED if start.near else _FIRST_ALONE)
    if LOG_SCALE in problem.extras:
        notes.append(log_scale_note(*found.unknown(LOG_SCALE)))
    full = full.disturbed(noise.typical)
    notes += _noise_notes(noise, record)
    correlated = full.correlated(found)
    most = max(means.inflation for means in correlated.values())
    if most > 1.0:
        # the figure stays: whether the sensor errs slowly or the ship is pushed is not known
        found = replace(found, covariance=most * found.covariance)
        notes += _correlation_notes(correlated)
    return _result(found, full, record, window, ship, parameters, tuple(notes))


def _at_first(
    record: RunRows, problem: Problem, run_down: RunDown, guess: InitialGuess
) -> NoisePosterior:
    """Learn the noise of the steady record alone; that of the prior where there is none."""
    steady = record.steady
    quiet = -ONSET_SD_S if run_down.stop_sd_s > _QUIET_S else -_QUIET_S
    keep = steady.time_s < quiet
    rows = Rows(steady.time_s[keep], steady.kind[keep], steady.value[keep])
    if not len(rows.time_s):
        rows = record.coast
        variance, white = problem.white.variance, problem.white
        return prior(
            of_steady(rows, variance, float(white.damping_1_s[0]), float(white.inertia[0])),
            guess.speed_m_s,
        )
    return learn(
        of_steady(
            rows,
            record.steady_variance()[keep],
            float(problem.white.damping_1_s[0]),
            float(problem.white.inertia[0]),
        ),
        guess.speed_m_s,
    )


def _noise_notes(noise: NoisePosterior, record: RunRows) -> list[str]:
    if not noise.learnt:
        length_s = record.steady_s + float(np.ptp(record.coast.time_s))
        why = (
            f'{length_s:.0f} s of record are too short to learn slow disturbances from '
            f'({LEARN_S:g} s are needed)'
        )
        if length_s >= LEARN_S:
            why = 'no size of slow disturbances explains the record'
        return [f'{why}: the band holds what is usual at sea']
    slow = noise.slow
    found = [
        f'a force of {slow.gust_m_s2:.2g} m/s² over {slow.gust_s:.0f} s (the engine is taken to '
        f'damp the speed {noise.typical.hold[0]:.2g} times as the hull does; 1 to 2 is usual)'
    ]
    if slow.log_m_s:
        found.append(f'the speed readings by {slow.log_m_s:.2g} m/s over {slow.log_s:.0f} s')
    if slow.place_m:
        found.append(f'positions by {slow.place_m:.2g} m over {slow.place_s:.0f} s')
    if slow.water_m_s:
        found.append(f'the water by {slow.water_m_s:.2g} m/s over {slow.water_s:.0f} s')
    where = f'{record.steady_s:.0f} s of steady record and ' if record.steady_s else ''
    none = (
        ''
        if record.steady_s
        else ('; without a steady record before the onset they are not well known')
    )
    return [
        f'slow disturbances learnt from {where}the coastdown, averaged over '
        f'{len(noise.settings.weight)} settings: about {", ".join(found)}{none}'
    ]


def _correlation_notes(correlated: dict[int, BatchMeans]) -> list[str]:
    names = {kind: name for name, kind in CODES.items()}
    return [
        f'what the fit leaves of {names[kind]} is not independent from sample to sample: its '
        f'means over {means.block} scatter {math.sqrt(means.inflation):.2g} times as much as '
        'independent ones; the band is widened for that'
        for kind, means in correlated.items()
        if means.inflation > 1.0
    ]


def _result(
    found: FittedMotion,
    problem: Problem,
    record: RunRows,
    window: Window,
    ship: Ship,
    parameters: Parameters,
    notes: tuple[str, ...],
) -> Estimate:
    coast = record.coast
    last_speed, last_sigma = _speed_at(found, problem, float(coast.time_s[-1]))
    none = np.zeros(0, np.int64)
    residual, speed = predict(found.law, found.unknowns, problem.grid_s, coast, none)
    low = max(last_speed, float(ship.speed(parameters.froude_min)))
    high = min(found.unknown(V0)[0], float(speed.max()))
    if not high > low * 1.02:
        raise EstimationError(
            f'the fitted speed falls from {high:.4g} to {low:.4g} m/s only, above froude_min '
            f'{parameters.froude_min:g}: give a window that lies in a coastdown, or a smaller '
            'froude_min'
        )
    curve = _curve(found, np.linspace(low, high, _CURVE_POINTS), ship)
    if len(curve) < 2:
        raise EstimationError(
            f'the fitted force nowhere slows the ship from {high:.4g} to {low:.4g} m/s: give a '
            'window in which she coasts'
        )
    last_r, last_repeatable = (
        float(value[0]) for value in found.resistance(np.array([last_speed]))
    )
    last_of_n_r = last_r / (1.0 + float(ship.n_r(last_speed))) * ship.added_mass.sd
    current = found.unknown(CURRENT) if CURRENT in problem.extras else (None, None)
    stamps = np.concatenate(list(record.stamps.values()))
    sigma = float(np.hypot(last_repeatable, last_of_n_r))
    return assembled(
        NAME,
        curve,
        ValidRange.of_branch(curve),
        AtEnd(last_speed, last_sigma, last_r, sigma),
        start_ns=int(stamps.min()),
        end_ns=int(stamps.max()),
        order=None,
        orders=(),
        samples={name: len(times) for name, times in record.stamps.items()},
        noise_sd=_noise_sd(record, problem),
        tracks=_tracks(record, residual[0]),
        current_m_s=current[0],
        current_sigma_m_s=current[1],
        notes=notes,
    )


def _tracks(record: RunRows, residual: Float64) -> dict[str, Track]:
    """Return each input of the coastdown, measured and fitted; residual (n,)."""
    coast, found = record.coast, {}
    for name, stamps in record.stamps.items():
        chosen = coast.kind == CODES[name]
        measured = coast.value[chosen]
        found[name] = Track(stamps, measured, measured - residual[chosen])
    return found


def _noise_sd(record: RunRows, problem: Problem) -> dict[str, float]:
    """Return the white noise of a sample of each input."""
    found = {}
    for name in record.white_sd:
        chosen = problem.rows.kind == CODES[name]
        chosen[: len(record.steady.time_s)] = False
        worth = np.concatenate([record.steady_weight, record.coast_weight])[chosen]
        found[name] = float(np.sqrt(np.min(problem.noise.variance[chosen] * worth)))
    return found


def _speed_at(found: FittedMotion, problem: Problem, time_s: float) -> tuple[float, float]:
    """Return the speed through water at a time, and its standard deviation."""
    row = Rows(np.array([time_s]), np.array([LOG]), np.zeros(1))
    k = found.law.size
    every = np.arange(k + LOG_SCALE, dtype=np.int64)
    unknowns = found.unknowns.copy()
    unknowns[k + LOG_SCALE] = unknowns[k + LOG_LAG] = 0.0
    table, speed = predict(found.law, unknowns, problem.grid_s, row, every)
    by_unknown = table[1:, 0]
    covariance = found.covariance[: len(every), : len(every)]
    variance = np.einsum('i,ij,j->', by_unknown, covariance, by_unknown)
    return float(speed[0]), float(np.sqrt(variance))


def _curve(found: FittedMotion, speed: Float64, ship: Ship) -> ResistanceCurve:
    """Return r(v) where it retards."""
    r, repeatable = found.resistance(speed)
    slope, slope_sigma = found.slope(speed)
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
