# SPDX-License-Identifier: Apache-2.0
"""
Compiled integration of the equation of motion, with its sensitivities.

    (1 + n_r(v)) dv/dt = -r(v) + r(v0) (a exp(-t / T) + b exp(-3 t / T)),
    r(v) = sum of c_k (v / v_ref)^k

The last term is the thrust left while the shaft runs down with the time constant T. How it
follows the shaft is not known: a and b are fitted. As a power 1, 2, 3 of the shaft speed:
(a, b) = (1, 0), about (0.25, 0.75), (0, 1); gone at once: (0, 0); what an open-water line
K_T = k0 - k1 J leaves, negative before the shaft stands: about (-0.7, 1.7). Time t counts from
the engine stop; before it the speed is v0.
"""

from __future__ import annotations

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.estimation.ode_fit.law import Law, shapes
from shipdrag_ros.inference.rows import LOG, OVER_GROUND, POSITION, Rows
from shipdrag_ros.samples import Float64, Int64

# Columns of the unknowns behind the k coefficients.
V0, THRUST, THRUST_FAST, ONSET, X0, CURRENT, LOG_SCALE, LOG_LAG = range(8)
EXTRAS = 8
_FAST = 3.0  # of the second part of the thrust: the power of the shaft that falls fastest
_OF_MOTION = 3  # of these, the ones that change the motion by themselves


@compiled
def _rates(
    law: Law,
    unknowns: Float64,
    at_start: Float64,
    t: float,
    state: Float64,
    rate: Float64,
    work: Float64,
) -> None:
    """
    Fill in the rates of (v, dv/du, x, dx/du), u the unknowns of the motion.

    `at_start` holds the shapes at v0, then r(v0) and dr/dv(v0); `work` (2, k) is
    written over.
    """
    k = len(law.powers) + law.humps
    q = k + _OF_MOTION
    v = state[0]
    n_r = 0.0
    n_r_slope = 0.0
    for j in range(len(law.n_r) - 1, -1, -1):
        n_r_slope = n_r_slope * v + n_r
        n_r = n_r * v + law.n_r[j]
    inertia = 1.0 + n_r
    shapes(law, v / law.v_ref_m_s, work[0], work[1])
    r, slope = 0.0, 0.0
    for j in range(k):
        r += unknowns[j] * work[0, j]
        slope += unknowns[j] * work[1, j]
    slope /= law.v_ref_m_s
    thrust, slow, fast = 0.0, 0.0, 0.0
    if law.run_down_s > 0.0:
        slow = np.exp(-t / law.run_down_s)
        fast = np.exp(-_FAST * t / law.run_down_s)
        thrust = unknowns[k + THRUST] * slow + unknowns[k + THRUST_FAST] * fast
    rate[1 + k + THRUST] = at_start[k] * slow / inertia
    rate[1 + k + THRUST_FAST] = at_start[k] * fast / inertia
    acceleration = (thrust * at_start[k] - r) / inertia
    by_v = (-slope - n_r_slope * acceleration) / inertia
    rate[0] = acceleration
    for j in range(k):
        rate[1 + j] = (thrust * at_start[j] - work[0, j]) / inertia
    rate[1 + k + V0] = thrust * at_start[k + 1] / inertia
    for j in range(q):
        rate[1 + j] += by_v * state[1 + j]
    for j in range(q + 1):
        rate[q + 1 + j] = state[j]


@compiled
def integrate(law: Law, unknowns: Float64, grid_s: Float64) -> tuple[Float64, Float64]:
    """
    Follow the motion and its sensitivities over a grid of times from 0 on.

    Returns
    -------
    state, rate : (m, 2 (k + 4))
        (v, dv/du, x, dx/du), u the k coefficients, v0, a and b; x is 0 at 0.

    Notes
    -----
    Runge-Kutta of fourth order, with fixed steps.
    """
    k = len(law.powers) + law.humps
    size = 2 * (k + _OF_MOTION + 1)
    m = len(grid_s)
    state = np.zeros((m, size))
    rate = np.zeros((m, size))
    state[0, 0] = unknowns[k + V0]
    state[0, 1 + k + V0] = 1.0
    work = np.empty((2, k))
    at_start = np.zeros(k + 2)
    shapes(law, unknowns[k + V0] / law.v_ref_m_s, at_start, work[1])
    for j in range(k):
        at_start[k] += unknowns[j] * at_start[j]
        at_start[k + 1] += unknowns[j] * work[1, j] / law.v_ref_m_s
    k2 = np.empty(size)
    k3 = np.empty(size)
    k4 = np.empty(size)
    trial = np.empty(size)
    _rates(law, unknowns, at_start, grid_s[0], state[0], rate[0], work)
    for i in range(m - 1):
        t = grid_s[i]
        h = grid_s[i + 1] - t
        now = state[i]
        k1 = rate[i]
        for j in range(size):
            trial[j] = now[j] + 0.5 * h * k1[j]
        _rates(law, unknowns, at_start, t + 0.5 * h, trial, k2, work)
        for j in range(size):
            trial[j] = now[j] + 0.5 * h * k2[j]
        _rates(law, unknowns, at_start, t + 0.5 * h, trial, k3, work)
        for j in range(size):
            trial[j] = now[j] + h * k3[j]
        _rates(law, unknowns, at_start, t + h, trial, k4, work)
        for j in range(size):
            state[i + 1, j] = now[j] + h * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]) / 6.0
        _rates(law, unknowns, at_start, t + h, state[i + 1], rate[i + 1], work)
    return state, rate


@compiled
def _behind(t: float, lag: float) -> tuple[float, float, float]:
    """
    Return the time whose speed a log shows, and how it follows the time and falls by the lag.

    A filter of the time constant `lag`, at an even deceleration since 0; an earlier log is ahead.
    """
    if lag <= 0.0:
        return t - lag, 1.0, 1.0
    if t <= 0.0:
        return t, 1.0, 0.0
    left = np.exp(-t / lag)
    return t - lag * (1.0 - left), 1.0 - left, 1.0 - left - t / lag * left


@compiled
def predict(
    law: Law, unknowns: Float64, grid_s: Float64, rows: Rows, active: Int64
) -> tuple[Float64, Float64]:
    """
    Predict the rows, with their derivatives by the active unknowns.

    Returns
    -------
    table : (1 + p, n)
        Measured less predicted, then the derivatives of the prediction.
    speed : (n,)
        Speed through water at the rows.
    """
    k = len(law.powers) + law.humps
    q = k + _OF_MOTION
    state, rate = integrate(law, unknowns, grid_s)
    n = len(rows.time_s)
    table = np.zeros((1 + len(active), n))
    speed = np.empty(n)
    v0, x0, onset = unknowns[k + V0], unknowns[k + X0], unknowns[k + ONSET]
    current, scale = unknowns[k + CURRENT], 1.0 + unknowns[k + LOG_SCALE]
    lag = unknowns[k + LOG_LAG]
    here = np.empty(2 * (q + 1))
    cell = 0
    for i in range(n):
        t = rows.time_s[i] - onset
        by_onset, by_lag = 1.0, 0.0
        if rows.kind[i] == LOG:
            t, by_onset, by_lag = _behind(t, lag)
        acceleration = 0.0
        if t < 0.0:
            here[:] = 0.0
            here[0] = v0
            here[1 + k + V0] = 1.0
            here[q + 1] = v0 * t
            here[q + 2 + k + V0] = t
        else:
            while cell > 0 and grid_s[cell] > t:
                cell -= 1
            while cell < len(grid_s) - 2 and grid_s[cell + 1] < t:
                cell += 1
            h = grid_s[cell + 1] - grid_s[cell]
            s = (t - grid_s[cell]) / h
            # cubic Hermite; of the distance only where it is measured
            a = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s)
            b = s * (1.0 - s) * (1.0 - s) * h
            c = s * s * (s - 1.0) * h
            low, high = (q + 1, 2 * (q + 1)) if rows.kind[i] == POSITION else (1, q + 1)
            here[0] = (
                a * state[cell, 0]
                + (1.0 - a) * state[cell + 1, 0]
                + b * rate[cell, 0]
                + c * rate[cell + 1, 0]
            )
            for j in range(low, high):
                here[j] = (
                    a * state[cell, j]
                    + (1.0 - a) * state[cell + 1, j]
                    + b * rate[cell, j]
                    + c * rate[cell + 1, j]
                )
            acceleration = (1.0 - s) * rate[cell, 0] + s * rate[cell + 1, 0]
        speed[i] = here[0]
        kind = rows.kind[i]
        if kind == LOG:
            predicted = scale * here[0]
        elif kind == OVER_GROUND:
            predicted = here[0] + current
        else:
            predicted = x0 + v0 * onset + here[q + 1] + current * rows.time_s[i]
        table[0, i] = rows.value[i] - predicted
        for p in range(len(active)):
            u = active[p]
            if u < q:
                if kind == LOG:
                    table[1 + p, i] = scale * here[1 + u]
                elif kind == OVER_GROUND:
                    table[1 + p, i] = here[1 + u]
                else:
                    table[1 + p, i] = here[q + 2 + u] + (onset if u == k + V0 else 0.0)
            elif u == k + ONSET:
                if kind == POSITION:
                    table[1 + p, i] = v0 - here[0]
                else:
                    by_time = by_onset * (scale if kind == LOG else 1.0)
                    table[1 + p, i] = -acceleration * by_time
            elif u == k + X0:
                table[1 + p, i] = 1.0 if kind == POSITION else 0.0
            elif u == k + CURRENT:
                if kind == POSITION:
                    table[1 + p, i] = rows.time_s[i]
                elif kind == OVER_GROUND:
                    table[1 + p, i] = 1.0
            elif kind == LOG:
                by_lagging = -scale * acceleration * by_lag
                table[1 + p, i] = here[0] if u == k + LOG_SCALE else by_lagging
    return table, speed
