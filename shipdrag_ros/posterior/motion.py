# SPDX-License-Identifier: Apache-2.0
"""
The motion with its derivatives by all unknowns, and what instruments read of it; compiled.

    (1 + n_r(u) + n) du/dt = -r(u) + r(u_0) T(t)
    r(u) = known(u) + sum_j theta_j R_j(u)
    T = (1 - l) ((1 + q) nu^2 - q nu u / u_0) + l exp(-(t - t_0) / LEFT_S)  from t_0 on, 1 before
    nu = exp(-(t - t_0) / tau)
    log = (1 + b_1) u(t - lag) + b_0
    over ground = (1 + g) (u(t - lag) + c);  place = x_0 + (1 + g) (x + c t)

Every force that depends on the speed alone is a column of a table over the speed: parts of the
law, its error, and what an effect adds. So the law and its effects are one thing here.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.rows import KIND_COUNT, LOG, POSITION, Rows
from shipdrag_ros.posterior.priors import LEFT_S
from shipdrag_ros.samples import Float64

# unknowns behind the coefficients theta; the first five change the motion
SPEED, THRUST, TAU, INERTIA, LEFT, STOP, PLACE, CURRENT, SCALE, OFFSET, LAG = range(11)
GROUND_SCALE, GROUND_LAG = range(LAG + 1, LAG + 3)
EXTRAS = GROUND_LAG + 1
OWN = EXTRAS - PLACE  # of each further instrument behind them, from its `PLACE` on
_MOVING = 5
_LEFT_S = LEFT_S.mean


def own(code: int) -> int:
    """
    Return by how much the unknowns of an instrument stand behind those of the first of its kind.
    """
    return OWN * (int(code) // KIND_COUNT)


class Forces(NamedTuple):
    """
    What acts on the ship, over an even grid of speeds from 0 on.

    Attributes
    ----------
    step_m_s
        Of the grid.
    known : (2, m)
        Value and slope of what has no unknown [m/s^2, 1/s].
    columns : (2, k, m)
        The same of each force per unit coefficient.
    inertia : (2, m)
        1 + n_r.
    tau_s
        Of the shaft, about which `TAU` is relative (its logarithm); 0: the
        thrust ended at once.
    """

    step_m_s: float
    known: Float64
    columns: Float64
    inertia: Float64
    tau_s: float


@compiled(inline=True, uncounted=True)
def _basis(step: float, m: int, u: float) -> tuple[int, float, float, float, float]:
    """Return the cell of a speed and the cubic Hermite weights of values and slopes."""
    place = u / step
    cell = min(max(int(place), 0), m - 2)
    s = min(max(place - cell, -0.5), 1.5)
    a = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s)
    return cell, a, 1.0 - a, s * (1.0 - s) * (1.0 - s) * step, s * s * (s - 1.0) * step


@compiled(inline=True, uncounted=True)
def _look(table: Float64, step: float, u: float) -> tuple[float, float]:
    """Return value and slope of a table (2, m) at a speed."""
    m = table.shape[1]
    cell, a, b, c, d = _basis(step, m, u)
    value = (
        a * table[0, cell] + b * table[0, cell + 1] + c * table[1, cell] + d * table[1, cell + 1]
    )
    s = min(max(u / step - cell, 0.0), 1.0)
    return value, (1.0 - s) * table[1, cell] + s * table[1, cell + 1]


@compiled(inline=True, uncounted=True)
def _fill(columns: Float64, step: float, u: float, value: Float64) -> None:
    """Fill in each column at a speed."""
    cell, a, b, c, d = _basis(step, columns.shape[2], u)
    for j in range(columns.shape[1]):
        value[j] = (
            a * columns[0, j, cell]
            + b * columns[0, j, cell + 1]
            + c * columns[1, j, cell]
            + d * columns[1, j, cell + 1]
        )


@compiled
def total_of(forces: Forces, theta: Float64) -> Float64:
    """Return value and slope (2, m) of r under some coefficients (k,)."""
    total = forces.known.copy()
    for j in range(forces.columns.shape[1]):
        for i in range(total.shape[1]):
            total[0, i] += theta[j] * forces.columns[0, j, i]
            total[1, i] += theta[j] * forces.columns[1, j, i]
    return total


def settled(forces: Forces, theta: Float64) -> Forces:
    """
    Return the same forces with nothing unknown, where some coefficients (k,) are the truth.
    """
    none = np.zeros((2, 0, forces.known.shape[1]))
    return forces._replace(known=total_of(forces, theta), columns=none)


@compiled(inline=True, uncounted=True)
def _rates(
    forces: Forces,
    total: Float64,
    unknowns: Float64,
    start: Float64,
    t: float,
    state: Float64,
    rate: Float64,
    at: Float64,
) -> None:
    """
    Fill in the rate of (u, du/d unknowns, x, dx/d unknowns).

    `start` holds each column at u_0, then r(u_0) and its slope; `at` is work.
    """
    k = forces.columns.shape[1]
    p = k + _MOVING
    u, u_0 = state[0], unknowns[k + SPEED]
    r, slope = _look(total, forces.step_m_s, u)
    inertia, inertia_slope = _look(forces.inertia, forces.step_m_s, u)
    inertia += unknowns[k + INERTIA]
    _fill(forces.columns, forces.step_m_s, u, at)
    thrust, by_u, by_u_0, by_q, by_tau, by_left = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if forces.tau_s > 0.0:
        q, tau = unknowns[k + THRUST], forces.tau_s * np.exp(unknowns[k + TAU])
        gone, nu, ratio = 1.0 - unknowns[k + LEFT], np.exp(-t / tau), u / u_0
        run_down = (1.0 + q) * nu * nu - q * nu * ratio
        by_left = np.exp(-t / _LEFT_S) - run_down
        thrust = run_down + unknowns[k + LEFT] * by_left
        by_u, by_u_0 = -gone * q * nu / u_0, gone * q * nu * ratio / u_0
        by_q = gone * (nu * nu - nu * ratio)
        by_tau = gone * (2.0 * (1.0 + q) * nu - q * ratio) * nu * t / tau
    r_0 = start[k]
    a = (thrust * r_0 - r) / inertia
    own = (r_0 * by_u - slope - inertia_slope * a) / inertia
    rate[0] = a
    for j in range(k):
        rate[1 + j] = (thrust * start[j] - at[j]) / inertia
    rate[1 + k + SPEED] = (thrust * start[k + 1] + r_0 * by_u_0) / inertia
    rate[1 + k + THRUST] = r_0 * by_q / inertia
    rate[1 + k + TAU] = r_0 * by_tau / inertia
    rate[1 + k + INERTIA] = -a / inertia
    rate[1 + k + LEFT] = r_0 * by_left / inertia
    for j in range(p):
        rate[1 + j] += own * state[1 + j]
    for j in range(p + 1):
        rate[p + 1 + j] = state[j]


@compiled
def integrate(forces: Forces, unknowns: Float64, grid_s: Float64) -> tuple[Float64, Float64]:
    """
    Follow the motion over times from the stop on, 0 there.

    Returns
    -------
    state, rate : (n, 2 (k + 6))
        (u, du/d unknowns, x, dx/d unknowns) by theta and the first five extras.

    Notes
    -----
    Runge-Kutta of fourth order; the derivatives are those of the motion's own steps.
    """
    k = forces.columns.shape[1]
    size, n = 2 * (k + _MOVING + 1), len(grid_s)
    state, rate = np.zeros((n, size)), np.zeros((n, size))
    state[0, 0], state[0, 1 + k + SPEED] = unknowns[k + SPEED], 1.0
    total = total_of(forces, unknowns[:k])
    start, at = np.zeros(k + 2), np.empty(k)
    _fill(forces.columns, forces.step_m_s, unknowns[k + SPEED], start[:k])
    start[k], start[k + 1] = _look(total, forces.step_m_s, unknowns[k + SPEED])
    k2, k3, k4, trial = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    _rates(forces, total, unknowns, start, grid_s[0], state[0], rate[0], at)
    for i in range(n - 1):
        t, h = grid_s[i], grid_s[i + 1] - grid_s[i]
        now, k1 = state[i], rate[i]
        for j in range(size):
            trial[j] = now[j] + 0.5 * h * k1[j]
        _rates(forces, total, unknowns, start, t + 0.5 * h, trial, k2, at)
        for j in range(size):
            trial[j] = now[j] + 0.5 * h * k2[j]
        _rates(forces, total, unknowns, start, t + 0.5 * h, trial, k3, at)
        for j in range(size):
            trial[j] = now[j] + h * k3[j]
        _rates(forces, total, unknowns, start, t + h, trial, k4, at)
        for j in range(size):
            state[i + 1, j] = now[j] + h * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]) / 6.0
        _rates(forces, total, unknowns, start, t + h, state[i + 1], rate[i + 1], at)
    return state, rate


@compiled(inline=True, uncounted=True)
def _late(t: float, lag: float) -> tuple[float, float, float]:
    """
    Return the time whose speed a filter shows, its slope by the time and minus that by the lag.

    Exact where the speed has fallen evenly since 0; a lag below 0 is a reading ahead of its time.
    """
    if lag <= 0.0:
        return t - lag, 1.0, 1.0
    if t <= 0.0:
        return t, 1.0, 0.0
    left = np.exp(-t / lag)
    return t - lag * (1.0 - left), 1.0 - left, 1.0 - left - t / lag * left


@compiled
def predict(
    forces: Forces, unknowns: Float64, grid_s: Float64, rows: Rows
) -> tuple[Float64, Float64]:
    """
    Predict rows with their derivatives by all unknowns.

    Parameters
    ----------
    forces
    unknowns : (k + 13,)
        Behind them `OWN` for each further number of instruments: place, scale and so on.
    grid_s : (g,)
        Of the integration, from 0 on.
    rows
        Times count from where the stop is thought to be.

    Returns
    -------
    table : (1 + p, n)
        Measured less predicted, then the derivatives of the prediction.
    speed : (n,)
        Through water.
    """
    k = forces.columns.shape[1]
    p, n = k + _MOVING, len(rows.time_s)
    state, rate = integrate(forces, unknowns, grid_s)
    table, speed = np.zeros((1 + len(unknowns), n)), np.empty(n)
    u_0, stop, current = unknowns[k + SPEED], unknowns[k + STOP], unknowns[k + CURRENT]
    here = np.empty(p + 1)
    cell = 0
    for i in range(n):
        kind, t = rows.kind[i] % KIND_COUNT, rows.time_s[i] - stop
        own = k + OWN * (rows.kind[i] // KIND_COUNT)
        place = kind == POSITION
        by_time, by_lag = 1.0, 0.0
        if not place:
            lag = unknowns[own + LAG] if kind == LOG else unknowns[own + GROUND_LAG]
            t, by_time, by_lag = _late(t, lag)
        acceleration = 0.0
        here[:] = 0.0
        if t < 0.0:
            now = u_0
            here[0] = u_0 * t if place else u_0
            here[1 + k + SPEED] = t if place else 1.0
        else:
            while cell > 0 and grid_s[cell] > t:
                cell -= 1
            while cell < len(grid_s) - 2 and grid_s[cell + 1] < t:
                cell += 1
            h = grid_s[cell + 1] - grid_s[cell]
            s = (t - grid_s[cell]) / h
            a = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s)
            b, c, d = 1.0 - a, s * (1.0 - s) * (1.0 - s) * h, s * s * (s - 1.0) * h
            first = p + 1 if place else 0
            for j in range(p + 1):
                here[j] = (
                    a * state[cell, first + j]
                    + b * state[cell + 1, first + j]
                    + c * rate[cell, first + j]
                    + d * rate[cell + 1, first + j]
                )
            now = (
                a * state[cell, 0]
                + b * state[cell + 1, 0]
                + c * rate[cell, 0]
                + d * rate[cell + 1, 0]
            )
            acceleration = (1.0 - s) * rate[cell, 0] + s * rate[cell + 1, 0]
        speed[i] = now
        factor = 1.0 + unknowns[own + (SCALE if kind == LOG else GROUND_SCALE)]
        for j in range(p):
            table[1 + j, i] = factor * here[1 + j]
        at = 1 + k
        if place:
            way = u_0 * stop + here[0] + current * rows.time_s[i]
            predicted = unknowns[own + PLACE] + factor * way
            table[at + SPEED, i] += factor * stop
            table[at + STOP, i] = factor * (u_0 - now)
            table[1 + own + PLACE, i], table[1 + own + GROUND_SCALE, i] = 1.0, way
            table[at + CURRENT, i] = factor * rows.time_s[i]
        else:
            table[at + STOP, i] = -factor * acceleration * by_time
            predicted = factor * now
            if kind == LOG:
                predicted += unknowns[own + OFFSET]
                table[1 + own + SCALE, i], table[1 + own + OFFSET, i] = now, 1.0
                table[1 + own + LAG, i] = -factor * acceleration * by_lag
            else:
                predicted += factor * current
                table[at + CURRENT, i], table[1 + own + GROUND_SCALE, i] = factor, now + current
                table[1 + own + GROUND_LAG, i] = -factor * acceleration * by_lag
        table[0, i] = rows.value[i] - predicted
    return table, speed


@compiled
def damping_of(forces: Forces, theta: Float64, speed_m_s: Float64) -> tuple[Float64, Float64]:
    """Return dr/du over 1 + n_r [1/s], above 0, and 1 + n_r at (n,) speeds."""
    total = total_of(forces, theta)
    damping, inertia = np.empty(len(speed_m_s)), np.empty(len(speed_m_s))
    for i in range(len(speed_m_s)):
        r, slope = _look(total, forces.step_m_s, speed_m_s[i])
        inertia[i] = _look(forces.inertia, forces.step_m_s, speed_m_s[i])[0]
        least = 0.1 * abs(r) / max(speed_m_s[i], 1e-6)
        damping[i] = max(slope, least, 1e-9) / inertia[i]
    return damping, inertia


@compiled
def shapes_at(forces: Forces, speed_m_s: Float64) -> tuple[Float64, Float64]:
    """
    Return value and slope at (m,) speeds: (2, m) of what is known, (2, k, m) of each column.
    """
    n, k = len(speed_m_s), forces.columns.shape[1]
    known, columns = np.empty((2, n)), np.empty((2, k, n))
    for i in range(n):
        known[0, i], known[1, i] = _look(forces.known, forces.step_m_s, speed_m_s[i])
        for j in range(k):
            column = forces.columns[:, j]
            columns[0, j, i], columns[1, j, i] = _look(column, forces.step_m_s, speed_m_s[i])
    return known, columns
