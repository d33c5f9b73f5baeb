# SPDX-License-Identifier: Apache-2.0
"""
Gauss-Markov noise of a run, and the Kalman filter that whitens its rows.

What disturbs a measurement is a small linear state-space model: a gust FORCE that moves the ship
through the equation of motion, whose damping falls with the speed; slow motion of the water,
which moves the ship over ground; slow errors of the log and of the positions. Each is
Gauss-Markov of first order, and off where its size is 0. The filter is linear in the data, so
residual and columns of a design pass the same gains, and it takes uneven stamps, gaps and a noise
that is not stationary.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.rows import LOG, OVER_GROUND, Rows
from shipdrag_ros.samples import Float64, Int64

# speed through still water and distance over ground, then the four sources
_U, _X, _GUST, _WATER, _LOG, _PLACE = range(6)
_STATES = 6
_LONGEST_STEP_S = 15.0  # of the prediction through a gap, in which the force acts evenly


class GaussMarkovNoise(NamedTuple):
    """
    Slow noise: standard deviation and correlation time of each source; a size of 0: none.

    Attributes
    ----------
    gust_m_s2, gust_s
        A force over the mass.
    water_m_s, water_s
        Motion of the water along the track.
    log_m_s, log_s
        Error of the log.
    place_m, place_s
        Error of the positions.
    """

    gust_m_s2: float = 0.0
    gust_s: float = 60.0
    water_m_s: float = 0.0
    water_s: float = 600.0
    log_m_s: float = 0.0
    log_s: float = 60.0
    place_m: float = 0.0
    place_s: float = 60.0


WHITE = GaussMarkovNoise()


class Noise(NamedTuple):
    """
    What is not motion in rows of measurements.

    Attributes
    ----------
    variance : (n,)
        Of the white noise of each row.
    slow
        In its stationary state at the first row.
    damping_1_s, inertia : (n,)
        dr/dv over 1 + n_r, and 1 + n_r, at each row. Fixed before a fit: the
        weights must not depend on what is fitted.
    """

    variance: Float64
    slow: GaussMarkovNoise
    damping_1_s: Float64
    inertia: Float64


@compiled
def _transition(slow: GaussMarkovNoise, damping: float, inertia: float, dt: float) -> Float64:
    """Return what a step does: u by u, u by force, x by u, x by force, x by water; then decays."""
    f = np.empty(5 + 2 * (_STATES - _GUST))
    size = (slow.gust_m_s2, slow.water_m_s, slow.log_m_s, slow.place_m)
    time_s = (slow.gust_s, slow.water_s, slow.log_s, slow.place_s)
    for k in range(_STATES - _GUST):
        decay = math.exp(-dt / time_s[k])
        f[5 + 2 * k] = decay
        f[6 + 2 * k] = size[k] ** 2 * (1.0 - decay * decay)
    f[0] = math.exp(-damping * dt)
    lag = -math.expm1(-damping * dt) / damping
    f[1] = lag * 0.5 * (1.0 + f[5]) / inertia
    f[2] = lag
    f[3] = 0.5 * dt * f[1]
    f[4] = 0.5 * dt * (1.0 + f[7])
    return f


@compiled
def _predict(cov: Float64, mean: Float64, f: Float64, active: Int64, moved: bool) -> None:
    """Carry covariance and means over a step, F P F' + Q."""
    if moved:
        for c in range(mean.shape[1]):
            u, g = mean[_U, c], mean[_GUST, c]
            mean[_X, c] += f[2] * u + f[3] * g + f[4] * mean[_WATER, c]
            mean[_U, c] = f[0] * u + f[1] * g
        for c in active:
            u, g = cov[_U, c], cov[_GUST, c]
            cov[_X, c] += f[2] * u + f[3] * g + f[4] * cov[_WATER, c]
            cov[_U, c] = f[0] * u + f[1] * g
        for r in active:
            u, g = cov[r, _U], cov[r, _GUST]
            cov[r, _X] += f[2] * u + f[3] * g + f[4] * cov[r, _WATER]
            cov[r, _U] = f[0] * u + f[1] * g
    for s in active:
        if s >= _GUST:
            decay, grown = f[5 + 2 * (s - _GUST)], f[6 + 2 * (s - _GUST)]
            for c in range(mean.shape[1]):
                mean[s, c] *= decay
            for other in active:
                cov[s, other] *= decay
                cov[other, s] *= decay
            cov[s, s] += grown


@compiled
def _stationary(noise: Noise) -> Float64:
    """Return the covariance of the states before the first row."""
    slow, damping, inertia = noise.slow, noise.damping_1_s[0], noise.inertia[0]
    cov = np.zeros((_STATES, _STATES))
    cov[_GUST, _GUST] = slow.gust_m_s2**2
    cov[_WATER, _WATER] = slow.water_m_s**2
    cov[_LOG, _LOG] = slow.log_m_s**2
    cov[_PLACE, _PLACE] = slow.place_m**2
    if slow.gust_m_s2 > 0.0:
        cov[_U, _GUST] = cov[_GUST, _GUST] / inertia / (damping + 1.0 / slow.gust_s)
        cov[_GUST, _U] = cov[_U, _GUST]
        cov[_U, _U] = cov[_U, _GUST] / inertia / damping
    return cov


@compiled
def _active(slow: GaussMarkovNoise) -> tuple[Int64, bool]:
    """Return the states that are disturbed, and whether the ship is moved."""
    moved = slow.gust_m_s2 > 0.0 or slow.water_m_s > 0.0
    on = np.array(
        [
            moved,
            moved,
            slow.gust_m_s2 > 0.0,
            slow.water_m_s > 0.0,
            slow.log_m_s > 0.0,
            slow.place_m > 0.0,
        ]
    )
    return np.flatnonzero(on), moved


@compiled
def whiten(rows: Rows, table: Float64, noise: Noise) -> float:
    """
    Whiten, in place, residual and columns of a design.

    Parameters
    ----------
    rows
        In ascending time.
    table : (c, n)
        Residual and columns of the design.
    noise
        Of the rows.

    Returns
    -------
    float
        Logarithm of the determinant of the covariance of the rows.
    """
    variance, slow, damping, inertia = noise
    columns, n = table.shape
    log_det = 0.0
    active, moved = _active(slow)
    if len(active) == 0:
        weights = 1.0 / np.sqrt(variance)
        for c in range(columns):
            for i in range(n):
                table[c, i] *= weights[i]
        for i in range(n):
            log_det += np.log(variance[i])
        return log_det
    cov = _stationary(noise)
    mean = np.zeros((_STATES, columns))
    gain, seen = np.zeros(_STATES), np.zeros(_STATES)
    f = np.empty(0)
    last_dt, last_mid, last_inertia = -1.0, -1.0, -1.0
    for i in range(n):
        if i:
            dt = rows.time_s[i] - rows.time_s[i - 1]
            if dt > 0.0:
                parts = int(np.ceil(dt / _LONGEST_STEP_S)) if moved else 1
                mid = 0.5 * (damping[i] + damping[i - 1])
                if dt != last_dt or mid != last_mid or inertia[i] != last_inertia:
                    f = _transition(slow, mid, inertia[i], dt / parts)
                    last_dt, last_mid, last_inertia = dt, mid, inertia[i]
                for _ in range(parts):
                    _predict(cov, mean, f, active, moved)
        # what is measured, and the error of its input
        first, error = _X, _PLACE
        if rows.kind[i] == LOG:
            first, error = _U, _LOG
        elif rows.kind[i] == OVER_GROUND:
            first, error = _U, _WATER
        for s in active:
            seen[s] = cov[s, first] + cov[s, error]
        total = seen[first] + seen[error] + variance[i]
        weight = 1.0 / np.sqrt(total)
        log_det += np.log(total)
        for s in active:
            gain[s] = seen[s] / total
        for c in range(columns):
            innovation = table[c, i] - mean[first, c] - mean[error, c]
            for s in active:
                mean[s, c] += gain[s] * innovation
            table[c, i] = innovation * weight
        for a in active:
            for b in active:
                cov[a, b] -= gain[a] * seen[b]
    return log_det


@compiled
def apply(whitener: Float64, table: Float64) -> Float64:
    """
    Whiten lines by a matrix; compiled, as the threads of a library do not pay for so small ones.

    Parameters
    ----------
    whitener : (n, n)
        Lower triangular: the inverse Cholesky factor of the covariance of the rows.
    table : (c, n)

    Returns
    -------
    (c, n)
    """
    lines, n = table.shape
    turned = np.ascontiguousarray(table.T)
    result = np.zeros((n, lines))
    for i in range(n):
        for j in range(i + 1):
            factor = whitener[i, j]
            for c in range(lines):
                result[i, c] += factor * turned[j, c]
    return result.T
