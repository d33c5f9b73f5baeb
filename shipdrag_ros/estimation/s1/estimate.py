# SPDX-License-Identifier: Apache-2.0
"""
S1's estimator as published: a window in, r(v) with its range out.

A pure function of the window, the ship and the parameters: no memory, no
random numbers, no clock, and sums that do not depend on the number of threads.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.curve import AtEnd, ValidRange, resistance_curve
from shipdrag_ros.estimation.distance import along_track
from shipdrag_ros.estimation.result import Estimate, Track
from shipdrag_ros.estimation.s1.problems import (
    ScalarInput,
    Solution,
    solve_joint,
    solve_position,
    solve_speed,
)
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.regression.orthogonal import OrthogonalBasis, TimeScale
from shipdrag_ros.ship import Ship

_GRID = np.linspace(-1.0, 1.0, 257)  # normalised times at which the curve is evaluated


@dataclass(frozen=True)
class _Requirement:
    """What a problem needs."""

    speed: bool
    position: bool
    stamps: int  # of each input, at least
    order: int  # coefficients without which there is no deceleration


# joint: fewer stamps of an input do not show its noise, hence not its weight
PROBLEMS = {
    's1_speed': _Requirement(speed=True, position=False, stamps=4, order=2),
    's1_position': _Requirement(speed=False, position=True, stamps=4, order=3),
    's1_joint': _Requirement(speed=True, position=True, stamps=12, order=3),
}


@dataclass(frozen=True)
class _Offered:
    """What the window offers, and which problem it is for."""

    estimator: str
    speed: ScalarInput | None
    position: ScalarInput | None
    notes: tuple[str, ...]

    @property
    def used(self) -> tuple[ScalarInput, ...]:
        return tuple(data for data in (self.speed, self.position) if data is not None)


def estimate(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
    """
    Estimate r(v) from one window.

    Parameters
    ----------
    window
        Accepted samples.
    ship
        For n_r and the Froude number.
    parameters
        `estimator`, one of `PROBLEMS`, `order_max`, `froude_min` and the known
        standard deviations are used.

    Raises
    ------
    EstimationError
        If the window does not hold a coastdown that can be estimated.

    Notes
    -----
    S1 (1)-(13). Samples of one input are weighted equally. `w` is of the
    repeatable sigma, which is S1's.
    """
    window = window.one_of_each()
    inputs = _inputs(window, parameters)
    solution = _solve(inputs)
    _check_deceleration(inputs, solution)
    motion = solution.fit.motion(_GRID)
    curve = resistance_curve(motion, ship, froude_min=parameters.froude_min)
    scale = solution.fit.scale
    return Estimate(
        inputs.estimator,
        **ValidRange.of_polynomial(curve)._asdict(),
        **AtEnd.of(motion, ship)._asdict(),
        calm=curve,
        conditions=curve,
        start_ns=scale.first_ns,
        end_ns=scale.first_ns + scale.span_ns,
        order=solution.order,
        orders=solution.trials,
        samples={data.name: len(data.value) for data in inputs.used},
        noise_sd=solution.noise_sd,
        tracks=_tracks(inputs, solution),
        reorthogonalised=solution.reorthogonalised,
        notes=(*window.notes, *inputs.notes, *solution.notes, *ship.warnings),
    )


def _inputs(window: Window, parameters: Parameters) -> _Offered:
    """Decide which inputs are used, and for which problem."""
    name, speed = 'speed_through_water', window.speed_through_water
    notes: list[str] = []
    if len(speed) < PROBLEMS['s1_speed'].stamps <= len(window.speed_over_ground):
        name, speed = 'speed_over_ground', window.speed_over_ground
    position = window.position
    estimator = parameters.estimator
    problem = PROBLEMS[estimator]
    if problem.speed:
        _check(name, speed, problem.stamps, estimator)
    if problem.position:
        _check('position', position, problem.stamps, estimator)
    if problem.speed and name == 'speed_over_ground':
        notes.append(
            'speed over ground was used as the speed, there is none through water: '
            'a current is part of it'
        )
    return _Offered(
        estimator,
        _speed(name, speed, parameters) if problem.speed else None,
        _distance(position, parameters) if problem.position else None,
        tuple(notes),
    )


def _check(name: str, series: Series, enough: int, estimator: str) -> None:
    stamps = len(np.unique(series.time_ns))
    if stamps < enough:
        raise EstimationError(
            f'{name}: {stamps} distinct stamp(s) in the window, {estimator} needs {enough} or '
            'more: give a longer window, or another `estimator`'
        )
    bad = int((~np.isfinite(series.value)).sum())
    if bad:
        raise EstimationError(f'{name}: {bad} value(s) are not finite: give accepted samples only')


def _speed(name: str, series: Series, parameters: Parameters) -> ScalarInput:
    scale, basis = _polynomials(series, parameters)
    sigma_m_s = parameters.speed_sigma_m_s
    return ScalarInput(name, series.time_ns, series.value, sigma_m_s, scale, basis)


def _distance(series: Series, parameters: Parameters) -> ScalarInput:
    scale, basis = _polynomials(series, parameters)
    distance = along_track(scale.normalise(series.time_ns), series.value)
    sigma_m = parameters.position_sigma_m
    return ScalarInput('position', series.time_ns, distance, sigma_m, scale, basis)


def _polynomials(series: Series, parameters: Parameters) -> tuple[TimeScale, OrthogonalBasis]:
    scale = TimeScale.of(series.time_ns)
    return scale, OrthogonalBasis.on(scale.normalise(series.time_ns), parameters.order_max)


def _solve(inputs: _Offered) -> Solution:
    if inputs.speed is None:
        assert inputs.position is not None
        return solve_position(inputs.position)
    if inputs.position is None:
        return solve_speed(inputs.speed)
    return solve_joint(inputs.speed, inputs.position)


def _check_deceleration(inputs: _Offered, solution: Solution) -> None:
    needed = PROBLEMS[inputs.estimator].order
    if solution.order < needed:
        noise = ', '.join(f'{name} {value:.3g}' for name, value in solution.noise_sd.items())
        raise EstimationError(
            f'no deceleration above the noise (sd {noise}) in '
            f'{solution.fit.scale.span_ns * 1e-9:.4g} s: {solution.order} coefficient(s) explain '
            f'the samples, {inputs.estimator} needs {needed}; give a longer window, or one after '
            'the engine stop'
        )


def _tracks(inputs: _Offered, solution: Solution) -> dict[str, Track]:
    fit = solution.fit
    result = {}
    if inputs.speed is not None:
        data = inputs.speed
        fitted = fit.fitted(data.time_ns, derivative=fit.speed_at)
        result[data.name] = Track(data.time_ns, data.value, fitted)
    if inputs.position is not None:
        data = inputs.position
        result[data.name] = Track(data.time_ns, data.value, fit.fitted(data.time_ns, derivative=0))
    return result
