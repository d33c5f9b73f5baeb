# SPDX-License-Identifier: Apache-2.0
"""
S1's estimator as published: a window in, r(v) with its range out.

A pure function of the window, the ship and the parameters: no memory, no
random numbers, no clock, and sums that do not depend on the number of threads.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.curve import ValidRange
from shipdrag_ros.estimation.distance import along_track
from shipdrag_ros.estimation.estimators import Estimator
from shipdrag_ros.estimation.result import Estimate, Track
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship
from shipdrag_ros.studies.orthogonal import OrthogonalBasis, TimeScale
from shipdrag_ros.studies.s1.motion import at_end, resistance_curve
from shipdrag_ros.studies.s1.problems import (
    ScalarInput,
    Solution,
    solve_joint,
    solve_one,
)

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
    inputs, notes = _inputs(window, parameters)
    solution = solve_joint(*inputs) if len(inputs) > 1 else solve_one(*inputs)
    fit = solution.fit
    _check_deceleration(parameters.estimator, solution)
    motion = fit.motion(_GRID)
    curve = resistance_curve(motion, ship, froude_min=parameters.froude_min)
    return Estimate(
        parameters.estimator,
        **ValidRange.of_polynomial(curve)._asdict(),
        **at_end(motion, ship)._asdict(),
        calm=curve,
        conditions=curve,
        whole=curve,
        start_ns=fit.scale.first_ns,
        end_ns=fit.scale.first_ns + fit.scale.span_ns,
        order=solution.order,
        orders=solution.trials,
        samples={data.name: len(data.value) for data in inputs},
        noise_sd=solution.noise_sd,
        tracks={
            data.name: Track(
                data.time_ns,
                data.value,
                fit.fitted(data.time_ns, derivative=0 if data.is_place else fit.speed_at),
            )
            for data in inputs
        },
        reorthogonalised=solution.reorthogonalised,
        notes=(*window.notes, *notes, *solution.notes, *ship.warnings),
    )


def _inputs(
    window: Window, parameters: Parameters
) -> tuple[tuple[ScalarInput, ...], tuple[str, ...]]:
    """Return the inputs that are used, the speed first, and what is to be said of them."""
    problem = PROBLEMS[parameters.estimator]
    speed = 'speed_through_water'
    notes: tuple[str, ...] = ()
    enough = PROBLEMS['s1_speed'].stamps
    if len(window.speed_through_water) < enough <= len(window.speed_over_ground):
        speed = 'speed_over_ground'
    names = [speed] * problem.speed + ['position'] * problem.position
    for name in names:
        _check(name, window.series(name), problem.stamps, parameters.estimator)
    if 'speed_over_ground' in names:
        notes = (
            'speed over ground was used as the speed, there is none through water: '
            'a current is part of it',
        )
    return tuple(_scalar(name, window.series(name), parameters) for name in names), notes


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


def _scalar(name: str, series: Series, parameters: Parameters) -> ScalarInput:
    scale = TimeScale.of(series.time_ns)
    time = scale.normalise(series.time_ns)
    basis = OrthogonalBasis.on(time, parameters.order_max)
    if name != 'position':
        sigma_m_s = parameters.speed_sigma_m_s
        return ScalarInput(name, series.time_ns, series.value, sigma_m_s, scale, basis)
    distance = along_track(time, series.value)
    return ScalarInput(name, series.time_ns, distance, parameters.position_sigma_m, scale, basis)


def _check_deceleration(estimator: str, solution: Solution) -> None:
    needed = PROBLEMS[estimator].order
    if solution.order < needed:
        noise = ', '.join(f'{name} {value:.3g}' for name, value in solution.noise_sd.items())
        raise EstimationError(
            f'no deceleration above the noise (sd {noise}) in '
            f'{solution.fit.scale.span_ns * 1e-9:.4g} s: {solution.order} coefficient(s) explain '
            f'the samples, {estimator} needs {needed}; give a longer window, or one after '
            'the engine stop'
        )


_CAVEAT = (
    'The band holds the noise of the sensors and the uncertainty of the added mass, not the error '
    'of the polynomial itself: towards the highest speeds, where the run-down of the engine lies, '
    'the true error can be several times larger.'
)


def published(name: str, meaning: str) -> Estimator:
    """
    Return one of the published problems as an estimator.

    Parameters
    ----------
    name
        A key of `PROBLEMS`.
    meaning
        What it is, for a report.
    """

    def of_problem(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
        return estimate(window, ship, replace(parameters, estimator=name))

    return Estimator(
        name=name,
        meaning=meaning,
        estimate=of_problem,
        constant_order=PROBLEMS[name].order,
        caveat=_CAVEAT,
    )
