# SPDX-License-Identifier: Apache-2.0
"""
Generalised least squares under sensor noise and slow disturbances.

The rows are whitened by a Kalman filter of what disturbs the motion: linear in
the data, so residual and columns of the design pass the same gains, and exact
for uneven stamps, gaps and a disturbance that is not stationary. A gust FORCE
moves the ship through the equation of motion, whose damping falls with the
speed; a disturbance of the water's speed is read by the log alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from shipdrag_ros.estimation.motion_fit.coast import LOG, POSITION, Rows
from shipdrag_ros.samples import Float64

_STATES = 4  # speed, distance, gust, water
_LONGEST_STEP_S = 15.0  # of the prediction through a gap


class Disturbance(NamedTuple):
    """
    Slow Gauss-Markov disturbances of first order; an sd of 0: none.

    Attributes
    ----------
    gust_m_s2, gust_s
        Standard deviation of the force per mass, and its correlation time.
    water_m_s, water_s
        The same of what the log reads of the water's own motion.
    """

    gust_m_s2: float
    gust_s: float
    water_m_s: float
    water_s: float


CALM = Disturbance(0.0, 60.0, 0.0, 60.0)


@njit(cache=True)
def _step(
    cov: Float64,
    mean: Float64,
    about: Disturbance,
    damping: float,
    inertia: float,
    dt: float,
) -> None:
    """Carry covariance and means over a step."""
    gust_decay = np.exp(-dt / about.gust_s)
    water_decay = np.exp(-dt / about.water_s)
    decay = np.exp(-damping * dt)
    by_gust = dt * np.exp(-0.5 * damping * dt) * 0.5 * (1.0 + gust_decay) / inertia
    way = 0.5 * dt * (1.0 + decay)
    way_by_gust = 0.5 * dt * by_gust
    for c in range(mean.shape[1]):
        u, g = mean[0, c], mean[2, c]
        mean[1, c] += way * u + way_by_gust * g
        mean[0, c] = decay * u + by_gust * g
        mean[2, c] = gust_decay * g
        mean[3, c] *= water_decay
    # F P, then (F P) F'
    for c in range(_STATES):
        u, g = cov[0, c], cov[2, c]
        cov[1, c] += way * u + way_by_gust * g
        cov[0, c] = decay * u + by_gust * g
        cov[2, c] = gust_decay * g
        cov[3, c] *= water_decay
    for r in range(_STATES):
        u, g = cov[r, 0], cov[r, 2]
        cov[r, 1] += way * u + way_by_gust * g
        cov[r, 0] = decay * u + by_gust * g
        cov[r, 2] = gust_decay * g
        cov[r, 3] *= water_decay
    cov[2, 2] += about.gust_m_s2**2 * (1.0 - gust_decay**2)
    cov[3, 3] += about.water_m_s**2 * (1.0 - water_decay**2)


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


@njit(cache=True)
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
    if about.gust_m_s2 == 0.0 and about.water_m_s == 0.0:
        weights = 1.0 / np.sqrt(variance)
        for c in range(columns):
            for i in range(n):
                table[c, i] *= weights[i]
        for i in range(n):
            log_det += np.log(variance[i])
        return log_det
    cov = np.zeros((_STATES, _STATES))
    mean = np.zeros((_STATES, columns))
    gain = np.empty(_STATES)
    seen = np.empty(_STATES)
    rate = damping[0] + 1.0 / about.gust_s
    cov[2, 2] = about.gust_m_s2**2
    cov[0, 2] = cov[2, 0] = cov[2, 2] / inertia[0] / rate
    cov[0, 0] = cov[0, 2] / inertia[0] / damping[0]
    cov[3, 3] = about.water_m_s**2
    for i in range(n):
        if i:
            dt = rows.time_s[i] - rows.time_s[i - 1]
            if dt > 0.0:
                parts = int(np.ceil(dt / _LONGEST_STEP_S))
                mid = 0.5 * (damping[i] + damping[i - 1])
                for _ in range(parts):
                    _step(cov, mean, about, mid, inertia[i], dt / parts)
        first = 1 if rows.kind[i] == POSITION else 0
        of_water = 1.0 if rows.kind[i] == LOG else 0.0
        for s in range(_STATES):
            seen[s] = cov[s, first] + of_water * cov[s, 3]
        total = seen[first] + of_water * seen[3] + variance[i]
        weight = 1.0 / np.sqrt(total)
        log_det += np.log(total)
        for s in range(_STATES):
            gain[s] = seen[s] / total
        for c in range(columns):
            innovation = table[c, i] - mean[first, c] - of_water * mean[3, c]
            for s in range(_STATES):
                mean[s, c] += gain[s] * innovation
            table[c, i] = innovation * weight
        for a in range(_STATES):
            for b in range(_STATES):
                cov[a, b] -= gain[a] * seen[b]
    return log_det
