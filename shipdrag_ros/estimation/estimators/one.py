# SPDX-License-Identifier: Apache-2.0
"""
The estimator of the one posterior (docs/model.md), live and final.

An adapter: a window becomes rows and a prior of the stop, the posterior becomes an estimate.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from shipdrag_ros.display import plus_minus
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.estimators import Estimator
from shipdrag_ros.estimation.record import LEAST_STAMPS, RunRows, weighted_white_sd
from shipdrag_ros.estimation.result import AtEnd, Estimate, ResistanceCurve, Track, ValidRange
from shipdrag_ros.estimation.run_down import RunDown
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.inference.rows import CODES, KIND_COUNT, LOG, POSITION, Rows, block_medians
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior import motion
from shipdrag_ros.posterior.laplace import RunPosterior, infer
from shipdrag_ros.posterior.law import DEPTH, HELD, WIND
from shipdrag_ros.posterior.priors import (
    HELD_FORCE,
    LEFT_S,
    LOG_LAG,
    LOG_OFFSET,
    LOG_SCALE,
    THRUST_LEFT,
)
from shipdrag_ros.posterior.problem import EXACT, RunModel, StopPrior
from shipdrag_ros.posterior.readout import ReadOut, read
from shipdrag_ros.posterior.weather import MeasuredWind, Reference, Weather
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

NAME = 'one'
_CONDITIONS = (HELD,)  # what is taken out of r(v)
_CALM = (HELD, WIND, DEPTH)
_CURVE_POINTS = 129
_WIND_POINTS = 25
_WORTH_A_NOTE = 0.1  # probability
_WRONG = {  # the sd of a sound instrument, and what another one is
    motion.SCALE: (LOG_SCALE.sd, 'in a wrong scale', '%'),
    motion.OFFSET: (LOG_OFFSET.sd, 'with a wrong zero', 'm/s'),
    motion.LAG: (LOG_LAG.sd, 'behind a long filter', 's'),
    motion.GROUND_SCALE: (EXACT, 'in a wrong scale', '%'),
}


_LEAST_LOSS = 1e-3  # of the speed over the window: less is rounding
_ABOVE = 1.05  # of the highest median: she was hardly faster
_BLOCKS = 12, 48  # whose medians outliers do not reach
_SHOWN = 0.01  # of the mean speed, by the medians of positions


@dataclass(frozen=True)
class InitialGuess:
    """
    Purely quadratic drag.

    Attributes
    ----------
    speed_m_s
        At time 0.
    quadratic_1_m
        r / v^2.
    lowest
        Speed at the end over that at the start.
    seen : (2, b)
        Times and median speeds of parts of the record.
    """

    speed_m_s: float
    quadratic_1_m: float
    lowest: float
    seen: Float64

    @classmethod
    def of(cls, coast: Rows, n_r: float) -> InitialGuess:
        """
        Fit a line through 1/v.

        Raises
        ------
        EstimationError
            If the ship does not slow down.
        """
        when, speed = _speeds(coast)
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
        if not slope * float(np.ptp(coast.time_s)) > _LEAST_LOSS * mean:
            raise EstimationError(
                f'no deceleration in {np.ptp(coast.time_s):.4g} s: if she slowed at another time, '
                'give a window there'
            )
        first = mean - slope * mean_t
        v0 = min(1.0 / first, _ABOVE * top) if first > 0.0 else _ABOVE * top
        return cls(
            float(v0),
            slope * (1.0 + n_r),
            float(np.clip(speed[-1] / v0, 0.05, 0.9)),
            np.stack([when, speed]),
        )


def _speeds(rows: Rows) -> tuple[Float64, Float64]:
    """Return times and median speeds of parts of what its best input says."""
    code = min(np.unique(rows.kind).tolist(), key=lambda code: (code % KIND_COUNT, code))
    kind, chosen = code % KIND_COUNT, rows.kind == code
    time_s, value = rows.time_s[chosen], rows.value[chosen]
    count, blocks = len(time_s), _BLOCKS[1]
    if kind == POSITION:  # as many as show how fast she was
        noise_m = weighted_white_sd(value, np.ones(count))
        many = (_SHOWN * math.sqrt(count) * float(np.ptp(value)) / max(noise_m, 1e-9)) ** (2 / 3)
        blocks = int(np.clip(many, *_BLOCKS))
    edges = np.linspace(0.0, count, min(blocks, count // 4) + 1).astype(np.int64)
    when, speed = block_medians(time_s, edges), block_medians(value, edges)
    if kind == POSITION:
        speed = np.diff(speed) / np.diff(when)
        when = 0.5 * (when[1:] + when[:-1])
    return when, speed


def _speed_before(steady: Rows) -> float:
    """Return the speed before the window, 0 where nothing shows it."""
    speed = _speeds(steady)[1] if len(steady.time_s) else np.empty(0)
    return float(np.median(speed)) if len(speed) else 0.0


def estimate(
    window: Window, ship: Ship, parameters: Parameters, *, quick: bool = False
) -> Estimate:
    """
    Estimate r(v) from one window.

    Parameters
    ----------
    window
        Accepted samples, with the steady record `before` it.
    ship
        For the law of the hull, n_r and the run-down of the thrust.
    parameters
        `froude_min` and the known standard deviations are used.
    quick
        Whether times of the noise are the usual ones, and its sizes averaged over fewer settings.

    Raises
    ------
    EstimationError
        If the window does not hold a coastdown that can be estimated.

    Notes
    -----
    Source: docs/model.md.
    """
    run_down = RunDown.of(window, ship)
    record = RunRows.of(window, run_down, parameters)
    guess = InitialGuess.of(record.coast, float(ship.n_r(1.0)))
    halved_s = (1.0 + float(ship.n_r(1.0))) / (guess.quadratic_1_m * guess.speed_m_s)
    rows, variance = record.condensed(guess.speed_m_s, halved_s, quick=quick)
    weather = _weather(window, run_down, guess.seen)
    problem = RunModel.of(
        rows,
        variance,
        len(record.steady.time_s),
        ship,
        StopPrior(
            run_down.stop_sd_s,
            run_down.shaft_s,
            run_down.shaft_sd_s,
            run_down.stands,
            window.found or run_down.stop_sd_s > 0.0,
        ),
        # the stop may be before the window: the law reaches up to the speed there
        speeds_m_s=(
            guess.lowest * guess.speed_m_s,
            guess.speed_m_s,
            max(guess.speed_m_s, _speed_before(record.steady)),
        ),
        weather=weather,
        geodetic=[CODES[name] for name in window.geodetic],
    )
    found = infer(problem, guess.seen, quick=quick)
    reference = weather.reference(ship)
    notes = (*record.notes, *run_down.notes, *_notes(found, record))
    return _result(found, record, window, ship, parameters, reference, notes)


def _weather(window: Window, run_down: RunDown, seen: Float64) -> Weather:
    """Return wind and depth as they are measured in a window."""
    depth = window.depth.value
    depth_m = float(np.median(depth)) if len(depth) >= LEAST_STAMPS else None
    air = window.wind_apparent
    if len(air) < LEAST_STAMPS:
        return Weather(None, depth_m)
    time_s = (air.time_ns - run_down.stop_ns) * 1e-9
    against = np.stack([-air.value[:, 0] - np.interp(time_s, *seen), air.value[:, 1]])
    # a wind that changes evenly in time, at the speeds that she has meanwhile
    about = float(time_s.mean())
    even = np.stack([np.ones(len(time_s)), (time_s - about) / max(float(np.ptp(time_s)), 1e-9)])
    fitted = np.linalg.solve(even @ even.T, even @ against.T)
    when = np.linspace(0.0, float(time_s[-1]), _WIND_POINTS)
    changed = np.stack([np.ones(_WIND_POINTS), (when - about) / float(np.ptp(time_s))])
    head, cross = (changed.T @ fitted).T[:, ::-1]
    speed = np.maximum.accumulate(np.interp(when, *seen)[::-1])
    return Weather(MeasuredWind(speed, head, cross), depth_m)


def _notes(found: RunPosterior, record: RunRows) -> Iterator[str]:
    """Yield what else the figure rests on."""
    problem, k = found.problem, found.problem.coefficients
    chances = ', '.join(
        f'{name} {found.chance(name):.2g}'
        for name in dict.fromkeys(problem.families.name.tolist())
    )
    yield f'averaged over what the hull may differ by and what else may act: {chances}'
    sd = np.sqrt(np.diag(found.covariance))
    yield from _acting_notes(found, sd)
    logs = {name: CODES[name] for name in record.stamps if CODES[name] % KIND_COUNT == LOG}
    for name, code in logs.items() if len(record.stamps) > 1 else ():
        at = k + motion.own(code) + motion.SCALE
        log = 'log' if len(logs) == 1 else f'log {name}'
        off = plus_minus(100.0 * float(found.mean[at]), 200.0 * float(sd[at]), '+')
        yield f'the {log} reads {off} % off (two standard deviations): taken out, and in the band'
    yield from _wrong_notes(found, record)
    if not logs:
        yield (
            f'a current is part of the speed: one of ± {2.0 * sd[k + motion.CURRENT]:.2g} m/s '
            '(two standard deviations) is in the band'
        )
    if not found.noise.learnt:
        yield (
            'the record is too short to learn slow disturbances from: the band holds usual ones'
        )
        return
    slow = found.noise.slow
    sizes = [f'a force of {slow.gust_m_s2:.2g} m/s² over {slow.gust_s:.0f} s']
    if slow.log_m_s:
        sizes.append(f'the speed readings by {slow.log_m_s:.2g} m/s over {slow.log_s:.0f} s')
    if slow.place_m:
        sizes.append(f'positions by {slow.place_m:.2g} m over {slow.place_s:.0f} s')
    if slow.water_m_s:
        sizes.append(f'the water by {slow.water_m_s:.2g} m/s over {slow.water_s:.0f} s')
    yield (
        f'slow disturbances learnt, averaged over {len(found.noise.settings.weight)} settings: '
        f'about {", ".join(sizes)}'
    )


def _acting_notes(found: RunPosterior, sd: Float64) -> Iterator[str]:
    """Yield what acts after the stop, where that is more likely than not."""
    problem = found.problem
    for name, at, what in (
        (HELD_FORCE, problem.of_hull, 'a force that no input shows slows her by'),
        (THRUST_LEFT, problem.coefficients + motion.LEFT, 'thrust is left after the stop,'),
    ):
        chance = found.chance(name)
        if chance > 0.5:
            share = _held_unit(found) if name == HELD_FORCE else 1.0
            # where it acts: it is 0 where not. The moments leave out models of little weight,
            # the chance does not: of one that is all but certain nothing may be left
            mean = found.mean[at] / chance
            spread = max((sd[at] ** 2 + found.mean[at] ** 2) / chance - mean**2, 0.0)
            yield (
                f'{what} {100.0 * share * mean:.0f} ± {200.0 * share * math.sqrt(spread):.0f} % '
                f'of the resistance at the stop (probability {chance:.2g}): it is no part of r, '
                'and makes its band wide; give a window in which nothing acts but the water'
            )


def _held_unit(found: RunPosterior) -> float:
    """Return a held force of size 1, over the r that was found at the stop."""
    problem, at = found.problem, found.problem.coefficients + motion.SPEED
    at_stop = found.mean[at : at + 1]
    unit = motion.shapes_at(problem.forces, at_stop)[1][0, problem.of_hull, 0]
    return float(unit / read(found, at_stop, without=_CONDITIONS).resistance_m_s2[0])


def _wrong_notes(found: RunPosterior, record: RunRows) -> Iterator[str]:
    """Say what is wrong with an instrument, where that is not unlikely."""
    k, inputs = found.problem.coefficients, dict[tuple[int, int], list[str]]()
    for name in record.stamps:
        is_log = CODES[name] % KIND_COUNT == LOG
        for place in _WRONG:
            if is_log == (place != motion.GROUND_SCALE):
                inputs.setdefault((motion.own(CODES[name]), place), []).append(name)
    for (own, place), names in inputs.items():
        at, (sound_sd, what, unit) = k + own + place, _WRONG[place]
        wider = found.problem.families.precision[:, at] < 0.9 / sound_sd**2
        chance = float(found.family[wider].sum())
        if chance > _WORTH_A_NOTE:
            factor = 100.0 if unit == '%' else 1.0
            size, sd = factor * found.mean[at], factor * np.sqrt(found.covariance[at, at])
            yield (
                f'{" and ".join(names)}: {what} with probability {chance:.2g}, which is in the '
                f'band ({plus_minus(size, 2.0 * sd, "+")} {unit}, two standard deviations)'
            )


def _result(
    found: RunPosterior,
    record: RunRows,
    window: Window,
    ship: Ship,
    parameters: Parameters,
    reference: Reference,
    notes: tuple[str, ...],
) -> Estimate:
    problem, k = found.problem, found.problem.coefficients
    coast = record.coast
    table, speed = motion.predict(problem.forces, found.mean, problem.grid_s, coast)
    last = float(speed[-1])
    low = max(last, float(ship.speed(parameters.froude_min)))
    high = float(found.mean[k + motion.SPEED])
    if not high > low * 1.02:
        too_slow = f'; {low:.4g} m/s is that of froude_min' if low > last else ''
        raise EstimationError(
            f'the fitted speed goes from {high:.4g} to {last:.4g} m/s{too_slow}: give a window '
            f'that lies in a coastdown{", or a smaller froude_min" if too_slow else ""}'
        )
    grid = np.linspace(low, high, _CURVE_POINTS)
    part = read(found, grid, without=_CONDITIONS)
    use = _slowing(part)
    conditions = _curve(part, use, ship)
    whole = _curve(read(found, grid), use, ship)
    part = read(found, grid, without=_CALM)
    calm, sigmas = _curve(part, use, ship), part.parts_m_s2 | {'n_r': _of_n_r(part, ship)}
    curve = conditions if reference.unknown else calm
    stamps = np.concatenate(list(record.stamps.values()))
    without = _CONDITIONS if reference.unknown else _CALM
    over_ground = any(CODES[name] % KIND_COUNT != LOG for name in record.stamps)
    current = k + motion.CURRENT
    return Estimate(
        NAME,
        **ValidRange.of_branch(curve)._asdict(),
        **_at_end(found, coast, last, float(whole.resistance_m_s2[-1]), without)._asdict(),
        calm=calm,
        conditions=conditions,
        whole=whole,
        reference=reference,
        sigma_parts={name: each[use] for name, each in sigmas.items()},
        sigma_shared_m_s2=part.shared_m_s2[use],
        start_ns=int(stamps.min()),
        end_ns=int(stamps.max()),
        order=None,
        orders=(),
        samples={name: len(times) for name, times in record.stamps.items()},
        noise_sd=dict(record.white_sd),
        tracks=_tracks(record, table[0]),
        current_m_s=float(found.mean[current]) if over_ground else None,
        current_sigma_m_s=float(np.sqrt(found.covariance[current, current]))
        if over_ground
        else None,
        notes=(*window.notes, *ship.warnings, *notes),
    )


def _tracks(record: RunRows, predicted: Float64) -> dict[str, Track]:
    """Return readings and residuals of each input."""
    found = {}
    for name, times in record.stamps.items():
        chosen = record.coast.kind == CODES[name]
        measured = record.coast.value[chosen]
        found[name] = Track(times, measured, measured - predicted[chosen])
    return found


def _slowing(part: ReadOut) -> slice:
    """Return where the force slows the ship."""
    grid = part.speed_m_s
    driving = np.flatnonzero(part.resistance_m_s2 <= 0.0)
    use = slice(int(driving[-1]) + 1 if len(driving) else 0, None)
    if len(grid[use]) < 3:
        raise EstimationError(
            f'the fitted force nowhere slows the ship from {grid[-1]:.4g} to {grid[0]:.4g} m/s: '
            'give a window in which she coasts'
        )
    return use


def _of_n_r(part: ReadOut, ship: Ship) -> Float64:
    """Return what n_r adds to sigma."""
    if part.n_r_m_s2.any():
        return part.n_r_m_s2
    # where the file states retardations, n_r is no unknown of the motion
    inertia = 1.0 + ship.n_r(part.speed_m_s)
    return np.abs(part.resistance_m_s2) / inertia * ship.added_mass.sd


def _curve(part: ReadOut, use: slice, ship: Ship) -> ResistanceCurve:
    """Return r(v) over a part of the speeds."""
    per_froude = float(ship.speed(1.0))
    return ResistanceCurve(
        part.speed_m_s[use].copy(),
        part.resistance_m_s2[use],
        np.hypot(part.repeatable_m_s2, _of_n_r(part, ship))[use],
        part.repeatable_m_s2[use],
        ship.froude(part.speed_m_s[use]),
        per_froude * part.slope_1_s[use],
        per_froude * part.slope_sigma_1_s[use],
        part.by_current_1_s[use],
    )


def _at_end(
    found: RunPosterior, coast: Rows, last: float, at_stop: float, without: tuple[str, ...]
) -> AtEnd:
    """Return what is known of the end; `at_stop` [m/s^2] is what slows her at the stop."""
    problem, k = found.problem, found.problem.coefficients
    at_end = read(found, np.array([last]), without=without)
    row = Rows(coast.time_s[-1:], np.array([LOG]), np.zeros(1))
    now = found.mean.copy()
    now[k + motion.SCALE :] = 0.0  # the speed itself, not the log
    by, _ = motion.predict(problem.forces, now, problem.grid_s, row)
    by[1 + k + motion.SCALE :] = 0.0
    speed_sd = float(np.sqrt(by[1:, 0] @ found.covariance @ by[1:, 0]))
    since_s = float(coast.time_s[-1] - found.mean[k + motion.STOP])
    left = float(found.mean[k + motion.LEFT]) * math.exp(-max(since_s, 0.0) / LEFT_S.mean)
    return AtEnd(
        last,
        speed_sd,
        float(at_end.resistance_m_s2[0]),
        float(at_end.sigma_m_s2[0]),
        left * at_stop,
    )


ESTIMATOR = Estimator(
    name=NAME,
    meaning='one posterior of hull, thrust, instruments and noise',
    estimate=estimate,
    live=partial(estimate, quick=True),
    learns_noise=True,
)
