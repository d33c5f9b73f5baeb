# SPDX-License-Identifier: Apache-2.0
"""
S1's estimator as published: a window in, r(v) with its range out.

A pure function of the window, the ship and the parameters: no memory, no
random numbers, no clock, and sums that do not depend on the number of threads.

S1's three problems: speed alone, position alone, both together.

Each returns the fitted polynomial with the covariance of its coefficients, and
the order table it was chosen from.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.distance import along_track
from shipdrag_ros.estimation.estimators import Estimator
from shipdrag_ros.estimation.result import Estimate, OrderTrial, Track, ValidRange
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship
from shipdrag_ros.studies.least_squares import OrderTable, inverse, rounding, triangle
from shipdrag_ros.studies.s1.motion import (
    OrthogonalBasis,
    PolynomialMotion,
    TimeScale,
    at_end,
    fit_orders,
    resistance_curve,
)


@dataclass(frozen=True)
class ScalarInput:
    """
    One input as a scalar function of time.

    Attributes
    ----------
    name
        Of the input.
    time_ns : (n,) int64
        Strictly ascending.
    value : (n,)
        Speed [m/s], or distance along the track [m].
    known_sigma
        A-priori standard deviation, 0 where unknown.
    scale, basis
        Polynomials on these times.
    """

    name: str
    time_ns: Int64
    value: Float64
    known_sigma: float
    scale: TimeScale
    basis: OrthogonalBasis

    @property
    def is_place(self) -> bool:
        """Whether it is a distance."""
        return self.name == 'position'


@dataclass(frozen=True)
class Solution:
    """
    A problem solved at every order, and at the one chosen.

    Attributes
    ----------
    fit
        The polynomial of the order chosen.
    trials
        The order table.
    noise_sd
        Residual standard deviation of each input, by name.
    reorthogonalised
        How many basis columns needed a second orthogonalisation.
    notes
        What a reader must know, a sentence each.
    """

    fit: PolynomialMotion
    trials: tuple[OrderTrial, ...]
    noise_sd: dict[str, float]
    reorthogonalised: int
    notes: tuple[str, ...]

    @property
    def order(self) -> int:
        """Number of the coefficients."""
        return len(self.fit.coefficients)


def solve_one(data: ScalarInput) -> Solution:
    """
    Fit the speed alone, or the position alone, whose derivative is the speed.

    Notes
    -----
    S1 (5, 6, 9, 11).
    """
    basis = data.basis
    coefficients, table = fit_orders(basis, data.value)
    known = data.known_sigma**2
    row, trusted, notes = _choose(table, known)
    order = int(table.coefficients[row])
    variance = known if trusted else float(table.variance[row])
    root = np.diag(np.sqrt(variance / basis.squared_norm[:order]))
    unused = np.full(len(table.sse), np.nan)
    speed, position = (unused, table.variance) if data.is_place else (table.variance, unused)
    return Solution(
        PolynomialMotion(data.scale, basis, coefficients[:order], root, int(data.is_place)),
        _trials(table, speed, position),
        {data.name: math.sqrt(table.variance[row])},
        basis.reorthogonalised,
        notes,
    )


def solve_joint(speed: ScalarInput, position: ScalarInput) -> Solution:
    """
    Fit one polynomial to the position and its derivative to the speed.

    Notes
    -----
    S1 (7, 10, 11), with the noise of each input first from its own problem
    where it is not known. The polynomials are orthogonal on the stamps of both
    inputs; where these agree, as in S1, that is S1's basis. Derivative columns
    are not orthogonal, so the weighted matrix is factored. Its columns are
    nested: one factorisation serves all orders. The residual variance of each
    input is its sum of squares over n_i less the trace of its part of the hat
    matrix.
    """
    alone = solve_one(position), solve_one(speed)
    inputs = (position, speed)
    # above 0 for data that a fit follows exactly, too
    least = [float(np.finfo(np.float64).eps * np.abs(data.value).max()) for data in inputs]
    found = [
        data.known_sigma or max(solution.noise_sd[data.name], rounded) or 1.0
        for data, solution, rounded in zip(inputs, alone, least)
    ]
    sigmas = np.array(found)
    scale = TimeScale.of(position.time_ns, speed.time_ns)
    counts = np.array([len(position.value), len(speed.value)])
    times = scale.normalise(np.concatenate([position.time_ns, speed.time_ns]))
    # of full rank: no more columns than either input carries by itself
    basis = OrthogonalBasis.on(times, max(position.basis.order, speed.basis.order))
    rates = basis.evaluate(times[counts[0] :], derivatives=1)[1] / scale.half_s
    # each input condensed once; weights and orders are then a matter of small matrices
    condensed = [
        triangle(np.vstack([rows, data.value]).T) / sigma
        for rows, data, sigma in zip((basis.columns[:, : counts[0]], rates), inputs, sigmas)
    ]
    q, r = np.linalg.qr(np.concatenate(condensed))
    projected = r[:, -1]
    parts = np.stack([q[: len(r)], q[len(r) :]])
    # residual of each order: what the columns from that order on take of the data
    residual = np.cumsum((parts * projected)[:, :, ::-1], axis=2)[:, :, ::-1]
    sse = np.einsum('ijk,ijk->ik', residual, residual)[:, 1:]
    traces = np.cumsum(np.einsum('ijk,ijk->ik', parts, parts)[:, :-1], axis=1)
    # an input that the fit follows exactly keeps a degree of freedom, so as not to divide by 0
    variances = sse * sigmas[:, None] ** 2 / np.maximum(counts[:, None] - traces, 1.0)

    squares = sum(
        float((data.value * data.value).sum()) / sigma**2 for data, sigma in zip(inputs, sigmas)
    )
    tail = np.cumsum((projected**2)[::-1])[::-1]
    table = OrderTable.of(
        np.arange(1, basis.order + 1), tail[1:], rows=int(counts.sum()), rounding=rounding(squares)
    )
    row, trusted, notes = _choose(table, float(all(data.known_sigma for data in inputs)))
    order = int(table.coefficients[row])
    unscaled = inverse(r[:order, :order])
    coefficients = np.einsum('ij,j->i', unscaled, projected[:order])
    root = unscaled if trusted else unscaled * math.sqrt(table.variance[row])
    return Solution(
        PolynomialMotion(scale, basis, coefficients, root, speed_at=1),
        _trials(table, variances[1], variances[0]),
        {data.name: math.sqrt(variances[i, row]) for i, data in enumerate(inputs)},
        basis.reorthogonalised + sum(solution.reorthogonalised for solution in alone),
        notes,
    )


def _choose(table: OrderTable, known: float) -> tuple[int, bool, tuple[str, ...]]:
    """
    Choose the order; say whether a known variance (0: unknown) was trusted.
    """
    if known == 0.0:
        return table.plateau(), False, ()
    row = table.plateau_at(known)
    if row is None:
        note = (
            'the residuals of every order are too large for the stated standard deviation: '
            'it was not used for the order and the band'
        )
        return table.plateau(), False, (note,)
    if table.is_below(row, known):
        note = 'the residuals are too small for the stated standard deviation: the band is wide'
        return row, True, (note,)
    return row, True, ()


def _trials(table: OrderTable, speed: Float64, position: Float64) -> tuple[OrderTrial, ...]:
    columns = (table.variance, speed, position, table.f, table.p)
    return tuple(
        OrderTrial(int(order), *map(float, values))
        for order, *values in zip(table.coefficients, *columns)
    )


@dataclass(frozen=True)
class _Requirement:
    """What a problem needs."""

    inputs: tuple[str, ...]
    stamps: int  # of each input, at least
    order: int  # coefficients without which there is no deceleration


_SPEED = 'speed_through_water'
# joint: fewer stamps of an input do not show its noise, hence not its weight
PROBLEMS = {
    's1_speed': _Requirement((_SPEED,), stamps=4, order=2),
    's1_position': _Requirement(('position',), stamps=4, order=3),
    's1_joint': _Requirement((_SPEED, 'position'), stamps=12, order=3),
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
    motion = fit.motion(np.linspace(-1.0, 1.0, 257))
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
    names = problem.inputs
    notes: tuple[str, ...] = ()
    enough = PROBLEMS['s1_speed'].stamps
    over_ground = len(window.speed_through_water) < enough <= len(window.speed_over_ground)
    if over_ground and _SPEED in names:
        names = ('speed_over_ground', *names[1:])
        notes = (
            'speed over ground was used as the speed, there is none through water: '
            'a current is part of it',
        )
    for name in names:
        _check(name, window.series(name), problem.stamps, parameters.estimator)
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
    value, sigma = series.value, parameters.speed_sigma_m_s
    if name == 'position':
        value, sigma = along_track(time, value), parameters.position_sigma_m
    return ScalarInput(name, series.time_ns, value, sigma, scale, basis)


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

    order = PROBLEMS[name].order
    return Estimator(name, meaning, of_problem, constant_order=order, caveat=_CAVEAT)
