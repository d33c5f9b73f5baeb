# SPDX-License-Identifier: Apache-2.0
"""
Generalised least squares under sensor noise and slow disturbances.

The rows are whitened by a Kalman filter of what disturbs the motion: linear in
the data, so residual and columns of the design pass the same gains, and exact
for uneven stamps, gaps and a disturbance that is not stationary. A gust FORCE
moves the ship through the equation of motion, whose damping falls with the
speed; a disturbance of the water's speed is read by the log alone, a wandering of the
positions by them alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.estimation.ode_fit.coast import OVER_GROUND, POSITION, Rows
from shipdrag_ros.samples import Float64

_STATES = 5  # speed, distance, gust, water, wander
_LONGEST_STEP_S = 30.0  # of the prediction through a gap


class Disturbance(NamedTuple):
    """
    Slow Gauss-Markov disturbances of first order; an sd of 0: none.

    Attributes
    ----------
    gust_m_s2, gust_s
        Standard deviation of the force per mass, and its correlation time.
    water_m_s, water_s
        The same of what the log reads of the water's own motion.
    wander_m, wander_s
        The same of the error of positions.
    """

    gust_m_s2: float
    gust_s: float
    water_m_s: float
    water_s: float
    wander_m: float = 0.0
    wander_s: float = 60.0


CALM = Disturbance(0.0, 60.0, 0.0, 60.0)


@compiled
def _carry(about: Disturbance, damping: float, inertia: float, dt: float, carry: Float64) -> None:
    """Fill in what a step does to the states."""
    gust_decay = np.exp(-dt / about.gust_s)
    carry[0] = np.exp(-damping * dt)
    carry[1] = dt * np.exp(-0.5 * damping * dt) * 0.5 * (1.0 + gust_decay) / inertia
    carry[2] = 0.5 * dt * (1.0 + carry[0])
    carry[3] = 0.5 * dt * carry[1]
    carry[4] = gust_decay
    carry[5] = about.gust_m_s2**2 * (1.0 - gust_decay**2)
    carry[6] = np.exp(-dt / about.water_s)
    carry[7] = about.water_m_s**2 * (1.0 - carry[6] ** 2)
    carry[8] = np.exp(-dt / about.wander_s)
    carry[9] = about.wander_m**2 * (1.0 - carry[8] ** 2)


@compiled
def _step(cov: Float64, mean: Float64, carry: Float64, low: int, high: int) -> None:
    """Carry covariance and means, of the states low .. high - 1, over a step."""
    decay, by_gust, way, way_by_gust, gust_decay, gust = carry[:6]
    if low == 0:
        for c in range(mean.shape[1]):
            u, g = mean[0, c], mean[2, c]
            mean[1, c] += way * u + way_by_gust * g
            mean[0, c] = decay * u + by_gust * g
            mean[2, c] = gust_decay * g
        # F P, then (F P) F'
        for c in range(high):
            u, g = cov[0, c], cov[2, c]
            cov[1, c] += way * u + way_by_gust * g
            cov[0, c] = decay * u + by_gust * g
            cov[2, c] = gust_decay * g
        for r in range(high):
            u, g = cov[r, 0], cov[r, 2]
            cov[r, 1] += way * u + way_by_gust * g
            cov[r, 0] = decay * u + by_gust * g
            cov[r, 2] = gust_decay * g
        cov[2, 2] += gust
    # errors of the log and of the positions
    for e in range(3, high):
        decay, grown = carry[2 * e], carry[2 * e + 1]
        for c in range(mean.shape[1]):
            mean[e, c] *= decay
        for s in range(low, high):
            cov[e, s] *= decay
            cov[s, e] *= decay
        cov[e, e] += grown


class Noise(NamedTuple):
    """
    What is not motion in rows of measurements.

    Attributes
    ----------
    variance : (n,)
        Of the white noise of each row.
    about
        The disturbances, in their stationary state at the first row.
    damping_1_s, inertia : (n,)
        dr/dv over 1 + n_r, and 1 + n_r, at each row. Fixed before the fit: the
        weights must not depend on what is fitted.
    """

    variance: Float64
    about: Disturbance
    damping_1_s: Float64
    inertia: Float64


@compiled
def whiten(rows: Rows, table: Float64, noise: Noise) -> float:
    """
    Whiten, in place, residual and columns of the design.

    Parameters
    ----------
    rows
        In ascending time.
    table : (c, n)
        Residual and columns of the design.

    Returns
    -------
    float
        Logarithm of the determinant of the covariance of the rows.
    """
    variance, about, damping, inertia = noise
    columns, n = table.shape
    log_det = 0.0
    if about.gust_m_s2 == 0.0 and about.water_m_s == 0.0 and about.wander_m == 0.0:
        weights = 1.0 / np.sqrt(variance)
        for c in range(columns):
            for i in range(n):
                table[c, i] *= weights[i]
        for i in range(n):
            log_det += np.log(variance[i])
        return log_det
    # only the states that are disturbed
    low = 0 if about.gust_m_s2 > 0.0 else 3
    high = _STATES if about.wander_m > 0.0 else (4 if about.water_m_s > 0.0 else 3)
    cov = np.zeros((_STATES, _STATES))
    mean = np.zeros((_STATES, columns))
    gain = np.zeros(_STATES)
    seen = np.zeros(_STATES)
    rate = damping[0] + 1.0 / about.gust_s
    cov[2, 2] = about.gust_m_s2**2
    cov[0, 2] = cov[2, 0] = cov[2, 2] / inertia[0] / rate
    cov[0, 0] = cov[0, 2] / inertia[0] / damping[0]
    cov[3, 3] = about.water_m_s**2
    cov[4, 4] = about.wander_m**2
    carry = np.empty(10)
    last_dt, last_mid, last_inertia = -1.0, -1.0, -1.0
    for i in range(n):
        if i:
            dt = rows.time_s[i] - rows.time_s[i - 1]
            if dt > 0.0:
                parts = int(np.ceil(dt / _LONGEST_STEP_S)) if low == 0 else 1
                mid = 0.5 * (damping[i] + damping[i - 1])
                if dt != last_dt or mid != last_mid or inertia[i] != last_inertia:
                    _carry(about, mid, inertia[i], dt / parts, carry)
                    last_dt, last_mid, last_inertia = dt, mid, inertia[i]
                for _ in range(parts):
                    _step(cov, mean, carry, low, high)
        # what is measured, and the error of its input; over ground has none
        first = 1 if rows.kind[i] == POSITION else 0
        error = 4 if rows.kind[i] == POSITION else 3
        erring = 0.0 if rows.kind[i] == OVER_GROUND else 1.0
        for s in range(low, high):
            seen[s] = cov[s, first] + erring * cov[s, error]
        total = seen[first] + erring * seen[error] + variance[i]
        weight = 1.0 / np.sqrt(total)
        log_det += np.log(total)
        for s in range(low, high):
            gain[s] = seen[s] / total
        for c in range(columns):
            innovation = table[c, i] - mean[first, c] - erring * mean[error, c]
            for s in range(low, high):
                mean[s, c] += gain[s] * innovation
            table[c, i] = innovation * weight
        for a in range(low, high):
            for b in range(low, high):
                cov[a, b] -= gain[a] * seen[b]
    return log_det
