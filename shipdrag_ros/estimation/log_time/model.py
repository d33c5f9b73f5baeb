# SPDX-License-Identifier: Apache-2.0
"""
The linear model of the live estimator, compiled.

Distance through water is a polynomial in u = ln(1 + t / tc), in
which purely quadratic drag is a straight line. To it come what the inputs do
not share: a current, a factor of the log, and the run-down of the thrust.
"""

from __future__ import annotations

import math

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.rows import LOG, OVER_GROUND
from shipdrag_ros.regression.refit import evaluate, refit
from shipdrag_ros.samples import Float64, Int64

CURRENT, SCALE, THRUST = range(3)  # columns after the polynomials

_SUMS = {'reassoc', 'contract', 'nsz'}  # see regression.refit
_LONGEST = 50.0  # tc, in lengths of the window: hardly bent
_SHORTEST = 0.02
_CRUDE_ORDER = 4  # coefficients of the speed


@compiled('UniTuple(f8, 2)(f8[::1], f8[::1], f8, i8)')
def quadratic_coast(
    time: Float64, value: Float64, span: float, derivative: int
) -> tuple[float, float]:
    """
    Return tc and v0 of v = v0 / (1 + t / tc), from a line through 1 / v.

    Parameters
    ----------
    time : (n,)
        From the start [s].
    value : (n,)
        Speed, or distance where `derivative` is 1.
    span
        Length of the window [s].
    derivative
        Of the value that is the speed.
    """
    order = min(_CRUDE_ORDER + derivative, len(time) - 1)
    half = 0.5 * (time[-1] - time[0])
    middle = 0.5 * (time[-1] + time[0])
    table = refit((time - middle) / half, value, order)
    grid = np.linspace(-1.0, 1.0, 33)
    speed = evaluate(table, grid, order)[derivative]
    if derivative == 1:
        speed = speed / half
    top = np.abs(speed).max()
    w = wt = wtt = wy = wty = 0.0
    for i in range(len(grid)):
        t = middle + half * grid[i]
        v = max(speed[i], 0.05 * top)
        # the error of 1 / v is that of v over v^2
        weight = (v / top) ** 4
        w += weight
        wt += weight * t
        wtt += weight * t * t
        wy += weight / v
        wty += weight * t / v
    slope = (w * wty - wt * wy) / (w * wtt - wt * wt)
    at_start = (wy - slope * wt) / w
    tc = _LONGEST * span
    if at_start > 0.0 and slope * tc > at_start:
        tc = max(at_start / slope, _SHORTEST * span)
    return tc, top


@compiled('f8[:, ::1](f8[::1], i8[::1], f8, f8, f8, f8, i8)', fastmath=_SUMS)
def design(
    time: Float64,
    count: Int64,
    tc: float,
    span: float,
    speed: float,
    run_down: float,
    polynomials: int,
) -> Float64:
    """
    Return the columns of the model, Chebyshev polynomials of u first.

    Parameters
    ----------
    time : (n,)
        From the start [s], kind after kind.
    count : (3,) int64
        Rows of each kind.
    tc, span
        Time constant and length of the window [s].
    speed
        At the start [m/s], of the quadratic coast that a factor of the log multiplies.
    run_down
        Time constant of the thrust [s].
    polynomials
        How many, 3 or more.

    Returns
    -------
    (polynomials + 3, n)
    """
    n, logs = len(time), count[LOG]
    speeds = logs + count[OVER_GROUND]
    columns = np.zeros((polynomials + THRUST + 1, n))
    stretch = 2.0 / math.log1p(span / tc)
    s, rate = np.empty(n), np.empty(n)
    for i in range(n):
        s[i] = stretch * math.log1p(time[i] / tc) - 1.0
        rate[i] = stretch / (tc + time[i])
    columns[0, speeds:] = 1.0
    columns[1, speeds:] = s[speeds:]
    columns[1, :speeds] = rate[:speeds]
    twice = 2.0 * s
    # second kind, times the rate: T_j' = j U_(j-1)
    before, now = rate.copy(), twice * rate
    for j in range(2, polynomials):
        for i in range(speeds):
            columns[j, i] = j * now[i]
            before[i], now[i] = now[i], twice[i] * now[i] - before[i]
        for i in range(speeds, n):
            columns[j, i] = twice[i] * columns[j - 1, i] - columns[j - 2, i]
    columns[polynomials + CURRENT, speeds:] = time[speeds:]
    columns[polynomials + CURRENT, logs:speeds] = 1.0
    columns[polynomials + SCALE, :logs] = speed * tc / (tc + time[:logs])
    for i in range(n):
        effect = -1.0 if i < speeds else run_down
        columns[polynomials + THRUST, i] = effect * run_down * math.exp(-time[i] / run_down)
    return columns


@compiled('f8[::1](f8[:, ::1], f8[::1])', fastmath=_SUMS)
def combine(columns: Float64, coefficients: Float64) -> Float64:
    """
    Return the model at the rows: (k, n), (k,) -> (n,).
    """
    total = np.zeros(columns.shape[1])
    for j in range(len(coefficients)):
        p = coefficients[j]
        if p != 0.0:
            for i in range(len(total)):
                total[i] += p * columns[j, i]
    return total


@compiled('f8[:, :, ::1](f8, f8, i8, i8)')
def coast_rows(tc: float, span: float, polynomials: int, points: int) -> Float64:
    """
    Return speed, acceleration and jerk of each polynomial.

    At times even in u from the start to the end of the window.

    Returns
    -------
    (3, points, polynomials)
        Of unit coefficients, in SI units.
    """
    rows = np.zeros((3, points, polynomials))
    length = math.log1p(span / tc)
    stretch = 2.0 / length
    d = np.zeros((4, polynomials))
    for i in range(points):
        s = 2.0 * i / (points - 1) - 1.0
        rate = math.exp(-0.5 * (s + 1.0) * length) / tc  # du/dt
        d[:, :] = 0.0
        d[0, 0], d[0, 1], d[1, 1] = 1.0, s, 1.0
        for j in range(2, polynomials):
            for k in range(4):
                d[k, j] = 2.0 * s * d[k, j - 1] - d[k, j - 2]
                if k > 0:
                    d[k, j] += 2.0 * k * d[k - 1, j - 1]
        for j in range(polynomials):
            first, second = stretch * d[1, j], stretch**2 * d[2, j]
            third = stretch**3 * d[3, j]
            rows[0, i, j] = rate * first
            rows[1, i, j] = rate**2 * (second - first)
            rows[2, i, j] = rate**3 * (third - 3.0 * second + 2.0 * first)
    return rows


@compiled(
    'Tuple((f8[:, ::1], f8[:, :, ::1]))(f8, f8, f8[::1], f8[:, ::1], i8, f8)',
    fastmath=_SUMS,
)
def coast_motion(
    tc: float, span: float, coefficients: Float64, root: Float64, points: int, drop: float
) -> tuple[Float64, Float64]:
    """
    Return the motion from where it has lost a speed, and its errors.

    Parameters
    ----------
    tc, span
        See `design`.
    coefficients : (k,)
        Of the polynomials.
    root : (k, q)
        Of their covariance.
    points
        Times, even in u from the start to the end of the window.
    drop
        Speed lost before the first time that is returned [m/s].

    Returns
    -------
    values : (3, m)
        Speed, acceleration, jerk.
    errors : (3, m, q)
        That of the acceleration is at a given speed, not at a given time.
    """
    rows = coast_rows(tc, span, len(coefficients), points)
    q = root.shape[1]
    values, errors = np.zeros((3, points)), np.zeros((3, points, q))
    for derivative in range(3):
        for i in range(points):
            error = errors[derivative, i]
            for j in range(len(coefficients)):
                p = rows[derivative, i, j]
                values[derivative, i] += p * coefficients[j]
                for c in range(q):
                    error[c] += p * root[j, c]
    for i in range(points):
        if values[1, i] != 0.0:
            errors[1, i] -= values[2, i] / values[1, i] * errors[0, i]
    first, start = 0, values[0, 0] - drop
    for i in range(points - 1):
        if values[0, i] > start:
            first = i
    if not values[0, first] > start >= values[0, first + 1]:
        return values, errors
    share = (values[0, first] - start) / (values[0, first] - values[0, first + 1])
    values[:, first] += share * (values[:, first + 1] - values[:, first])
    errors[:, first] += share * (errors[:, first + 1] - errors[:, first])
    return values[:, first:].copy(), errors[:, first:].copy()
