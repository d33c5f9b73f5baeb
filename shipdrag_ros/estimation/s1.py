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
from shipdrag_ros.estimation.curve import froude_max, resistance_curve, specific_resistance
from shipdrag_ros.estimation.motion import sigma
from shipdrag_ros.estimation.problems import (
    Measured,
    Solution,
    solve_joint,
    solve_position,
    solve_speed,
)
from shipdrag_ros.estimation.result import Estimate, Track
from shipdrag_ros.estimation.track import along_track
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.regression.orthogonal import OrthogonalBasis, TimeScale
from shipdrag_ros.ship import Ship

MIN_STAMPS = 4  # of an input, for a curve with a degree of freedom left
MIN_STAMPS_JOINT = 12  # of each input: fewer do not tell their noise, hence no weight
_GRID = np.linspace(-1.0, 1.0, 257)  # normalised times at which the curve is evaluated
# coefficients without which there is no deceleration
_ORDER_MIN = {'s1_speed': 2, 's1_position': 3, 's1_joint': 3}


@dataclass(frozen=True)
class _Inputs:
    """What the window offers, and which problem it is for."""

    estimator: str
    speed: Measured | None
    position: Measured | None
    notes: tuple[str, ...]

    @property
    def used(self) -> tuple[Measured, ...]:
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
        `estimator`, `order_max`, `froude_min` and the known standard
        deviations are used.

    Raises
    ------
    EstimationError
        If the window does not hold a coastdown that can be estimated.

    Notes
    -----
    S1 (1)-(13). Samples of one input are weighted equally. `w` is of the
    repeatable sigma, which is S1's.
    """
    inputs = _inputs(window, parameters)
    solution = _solve(inputs, parameters.order_max)
    _check_deceleration(inputs, solution)
    motion = solution.fit.motion(_GRID)
    curve = resistance_curve(motion, ship, froude_min=parameters.froude_min)
    top, by = froude_max(curve)
    valid = curve.between(curve.froude[0], top)
    end = motion[-1:]
    r, r_sigma, _ = specific_resistance(end, ship)
    scale = solution.fit.scale
    return Estimate(
        estimator=inputs.estimator,
        start_ns=scale.first_ns,
        end_ns=scale.first_ns + scale.span_ns,
        order=solution.order,
        orders=solution.trials,
        samples={data.name: len(data.value) for data in inputs.used},
        noise_sd=solution.noise_sd,
        curve=curve,
        froude_valid=(float(curve.froude[0]), top),
        froude_max_by=by,
        froude_max_argmax=float(curve.froude[np.argmax(curve.slope)]),
        w=float(valid.sigma_repeatable_m_s2.max() / valid.resistance_m_s2.max()),
        last_speed_m_s=float(end.speed[0]),
        last_speed_sigma_m_s=float(sigma(end.speed_error)[0]),
        last_resistance_m_s2=float(r[0]),
        last_sigma_m_s2=float(r_sigma[0]),
        tracks=_tracks(inputs, solution),
        reorthogonalised=solution.reorthogonalised,
        notes=(*window.notes, *inputs.notes, *solution.notes, *ship.warnings),
    )


def _inputs(window: Window, parameters: Parameters) -> _Inputs:
    """Decide which inputs are used, and for which problem."""
    wanted = parameters.estimator
    notes: list[str] = []
    name, speed = 'speed_through_water', window.speed_through_water
    if len(speed) < MIN_STAMPS <= len(window.speed_over_ground):
        name, speed = 'speed_over_ground', window.speed_over_ground
    enough = MIN_STAMPS
    if wanted == 'auto':
        wanted = _offered(len(speed), len(window.position))
        for left_out, count in ((name, len(speed)), ('position', len(window.position))):
            if count and wanted != 's1_joint' and not left_out.startswith(wanted[3:]):
                notes.append(
                    f'{left_out}: {count} sample(s), fewer than the {MIN_STAMPS_JOINT} of each '
                    'input that a joint fit needs; left out'
                )
    elif wanted == 's1_joint':
        enough = MIN_STAMPS_JOINT
    for needed, series in ((name, speed), ('position', window.position)):
        if wanted == 's1_joint' or needed.startswith(wanted[3:]):
            _check(needed, series, enough, wanted)
    if name == 'speed_over_ground' and wanted != 's1_position':
        notes.append(
            'speed over ground was used as the speed, there is none through water: '
            'a current is part of it'
        )
    return _Inputs(
        wanted,
        None
        if wanted == 's1_position'
        else Measured(name, speed.time_ns, speed.value, parameters.speed_sigma_m_s),
        None if wanted == 's1_speed' else _distance(window.position, parameters),
        tuple(notes),
    )


def _offered(speeds: int, positions: int) -> str:
    """Name the problem that `auto` stands for."""
    if min(speeds, positions) >= MIN_STAMPS_JOINT:
        return 's1_joint'
    return 's1_speed' if speeds >= min(positions, MIN_STAMPS_JOINT) else 's1_position'


def _check(name: str, series: Series, enough: int, estimator: str) -> None:
    if len(series) < enough:
        raise EstimationError(
            f'{name}: {len(series)} sample(s) in the window, {estimator} needs {enough} or more: '
            'give a longer window, or another `estimator`'
        )
    if not np.isfinite(series.value).all():
        raise EstimationError(
            f'{name}: {int((~np.isfinite(series.value)).sum())} value(s) are not finite: '
            'give accepted samples only'
        )


def _distance(position: Series, parameters: Parameters) -> Measured:
    time = TimeScale.of(position.time_ns).normalise(position.time_ns)
    basis = OrthogonalBasis.on(time, parameters.order_max)
    distance = along_track(time, position.value, basis)
    return Measured('position', position.time_ns, distance, parameters.position_sigma_m)


def _solve(inputs: _Inputs, order_max: int) -> Solution:
    if inputs.speed is None:
        assert inputs.position is not None
        return solve_position(inputs.position, order_max=order_max)
    if inputs.position is None:
        return solve_speed(inputs.speed, order_max=order_max)
    return solve_joint(inputs.speed, inputs.position, order_max=order_max)


def _check_deceleration(inputs: _Inputs, solution: Solution) -> None:
    needed = _ORDER_MIN[inputs.estimator]
    if solution.order < needed:
        noise = ', '.join(f'{name} {value:.3g}' for name, value in solution.noise_sd.items())
        raise EstimationError(
            f'no deceleration above the noise (sd {noise}) in '
            f'{solution.fit.scale.span_ns * 1e-9:.4g} s: {solution.order} coefficient(s) explain '
            f'the samples, {inputs.estimator} needs {needed}; give a longer window, or one after '
            'the engine stop'
        )


def _tracks(inputs: _Inputs, solution: Solution) -> dict[str, Track]:
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
