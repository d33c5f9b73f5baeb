# SPDX-License-Identifier: Apache-2.0
"""
The noise of a run, colour included, learnt from its steady record.

What disturbs a measurement is followed by a small linear model: a gust force
that moves the ship, slow motion of the water, slow errors of the log and of the
positions, each Gauss-Markov of first order. Its sizes are the most probable
ones under broad priors; the mean speed, the place and the current are profiled
out. The filter whitens any rows, so that their squares can be added.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from shipdrag_ros.compiled import compiled
from shipdrag_ros.estimation.ode_fit.coast import LOG, OVER_GROUND, POSITION, Rows
from shipdrag_ros.samples import Float64, Int64

_STATES = 6
_U, _X, _GUST, _WATER, _LOG, _PLACE = range(_STATES)
_LONGEST_STEP_S = 15.0
# of correlation times [s]: gust, water, log, place; known within a factor of e
_TYPICAL_S = np.array([90.0, 600.0, 50.0, 50.0])
_WATER_M_S = 0.025  # a current that changes by less goes unnoticed in half an hour
_SD_OF_LOG_TIME = np.full(4, 0.8)
_SD_OF_LOG_SIZE = np.array([1.2, 0.6, 1.2, 1.2])
_EVALUATIONS = 600


class Colour(NamedTuple):
    """
    Slow disturbances; pairs of standard deviation and correlation time [s].

    Attributes
    ----------
    size : (4,)
        Gust force over mass [m/s^2], water [m/s], error of the log [m/s] and of
        the positions [m].
    time_s : (4,)
    """

    size: Float64
    time_s: Float64


class Damping(NamedTuple):
    """
    How the ship answers a force at each row.

    Attributes
    ----------
    rate_1_s, inertia : (n,)
        dr/dv over 1 + n_r, and 1 + n_r.
    """

    rate_1_s: Float64
    inertia: Float64


@compiled
def _carry(
    cov: Float64, mean: Float64, colour: Colour, rate: float, inertia: float, dt: float
) -> None:
    """Carry covariance and means over a step."""
    f = np.eye(_STATES)
    decay = math.exp(-rate * dt)
    lag = (1.0 - decay) / rate if rate * dt > 1e-6 else dt
    for k in range(4):
        f[_GUST + k, _GUST + k] = math.exp(-dt / colour.time_s[k])
    gust = 0.5 * (1.0 + f[_GUST, _GUST]) / inertia
    f[_U, _U] = decay
    f[_U, _GUST] = lag * gust
    f[_X, _U] = lag
    f[_X, _GUST] = 0.5 * dt * lag * gust
    f[_X, _WATER] = dt * 0.5 * (1.0 + f[_WATER, _WATER])
    cov[:] = f @ cov @ f.T
    mean[:] = f @ mean
    for k in range(4):
        cov[_GUST + k, _GUST + k] += colour.size[k] ** 2 * (1.0 - f[_GUST + k, _GUST + k] ** 2)


@compiled
def whiten(
    rows: Rows, variance: Float64, colour: Colour, damping: Damping, table: Float64
) -> float:
    """
    Whiten lines of a table in place.

    Parameters
    ----------
    rows
        In ascending time.
    variance : (n,)
        Of what is white.
    table : (c, n)

    Returns
    -------
    float
        Logarithm of the determinant of the covariance of the rows.
    """
    n = len(rows.time_s)
    cov = np.zeros((_STATES, _STATES))
    mean = np.zeros((_STATES, len(table)))
    rate, inertia = damping.rate_1_s[0], damping.inertia[0]
    for k in range(4):
        cov[_GUST + k, _GUST + k] = colour.size[k] ** 2
    cov[_U, _GUST] = cov[_GUST, _GUST] / inertia / (rate + 1.0 / colour.time_s[0])
    cov[_GUST, _U] = cov[_U, _GUST]
    cov[_U, _U] = cov[_U, _GUST] / inertia / rate
    log_det = 0.0
    seen = np.zeros(_STATES)
    for i in range(n):
        if i:
            dt = rows.time_s[i] - rows.time_s[i - 1]
            if dt > 0.0:
                parts = math.ceil(dt / _LONGEST_STEP_S)
                mid = 0.5 * (damping.rate_1_s[i] + damping.rate_1_s[i - 1])
                for _ in range(parts):
                    _carry(cov, mean, colour, mid, damping.inertia[i], dt / parts)
        first, second = _X, _PLACE
        if rows.kind[i] == LOG:
            first, second = _U, _LOG
        elif rows.kind[i] == OVER_GROUND:
            first, second = _U, _WATER
        total = variance[i]
        for s in range(_STATES):
            seen[s] = cov[s, first] + cov[s, second]
        total += seen[first] + seen[second]
        log_det += math.log(total)
        weight = 1.0 / math.sqrt(total)
        for c in range(len(table)):
            left = table[c, i] - mean[first, c] - mean[second, c]
            for s in range(_STATES):
                mean[s, c] += seen[s] / total * left
            table[c, i] = left * weight
        for a in range(_STATES):
            for b in range(_STATES):
                cov[a, b] -= seen[a] * seen[b] / total
    return log_det


def learn(rows: Rows, variance: Float64, *, damping_1_s: float, inertia: float) -> Colour:
    """
    Learn the slow disturbances of a steady record.

    Parameters
    ----------
    rows
        Of the steady record.
    variance : (n,)
        Of their white noise.
    damping_1_s, inertia
        dr/dv over 1 + n_r [1/s] and 1 + n_r at the steady speed.
    """
    n = len(rows.time_s)
    position, log = rows.kind == POSITION, rows.kind == LOG
    lines = [rows.value, np.where(position, rows.time_s, 1.0)]
    if position.any():
        lines.append(position.astype(np.float64))
    if log.any() and not log.all():
        lines.append(np.where(position, rows.time_s, (rows.kind == OVER_GROUND) * 1.0))
    table = np.array(lines)
    there = np.array([log.any(), not log.all(), log.any(), position.any()])
    units = _units(rows, variance, damping_1_s, inertia)
    damping = Damping(np.full(n, damping_1_s), np.full(n, inertia))
    which = np.flatnonzero(np.concatenate([there, there]))

    def colour(x: Float64) -> Colour:
        logarithm = np.zeros(8)
        logarithm[which] = np.clip(x, -6.0, 6.0)
        size = np.where(there, units * np.exp(logarithm[:4]), 0.0)
        return Colour(size, _TYPICAL_S * np.exp(logarithm[4:]))

    spread = np.concatenate([_SD_OF_LOG_SIZE, _SD_OF_LOG_TIME])[which]

    def cost(x: Float64) -> float:
        likelihood = float(_criterion(rows, variance, colour(x), damping, table))
        return likelihood + float(((x / spread) ** 2).sum())

    corners = np.vstack([np.zeros(len(which)), 0.7 * np.eye(len(which))])
    found = minimize(
        cost,
        corners[0],
        method='Nelder-Mead',
        options={'maxfev': _EVALUATIONS, 'xatol': 0.1, 'fatol': 0.1, 'initial_simplex': corners},
    )
    return colour(found.x)


def _units(rows: Rows, variance: Float64, damping_1_s: float, inertia: float) -> Float64:
    """Return sizes that disturbances are likely to have."""
    position = rows.kind == POSITION
    place_m = math.sqrt(float(np.median(variance[position]))) if position.any() else 1.0
    speed = 0.02 if position.all() else math.sqrt(float(np.median(variance[~position])))
    speed = max(speed, 0.01)
    force = speed * inertia * math.sqrt(damping_1_s * (damping_1_s + 1.0 / _TYPICAL_S[0]))
    return np.array([force, _WATER_M_S, speed, max(place_m, 0.5)])


@compiled
def _criterion(
    rows: Rows, variance: Float64, colour: Colour, damping: Damping, table: Float64
) -> float:
    """Return -2 ln of the restricted likelihood, less a constant."""
    lines = table.copy()
    total = whiten(rows, variance, colour, damping, lines)
    columns = lines[1:]
    matrix = columns @ columns.T
    size = np.sqrt(np.diag(matrix))
    scaled = matrix / size.reshape(-1, 1) / size.reshape(1, -1)
    right = (columns @ lines[0]) / size
    total += np.log(np.linalg.det(scaled)) + 2.0 * np.log(size).sum()
    total += (lines[0] * lines[0]).sum() - (right * np.linalg.solve(scaled, right)).sum()
    return float(total)


@compiled
def apply(whitener: Float64, table: Float64) -> Float64:
    """
    Whiten lines by a matrix; compiled, as the threads of a library do not pay for so small ones.

    Parameters
    ----------
    whitener : (n, n)
        Lower triangular.
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


def bin_means(time_s: Float64, value: Float64, edges: Float64) -> tuple[Float64, Float64, Int64]:
    """
    Average samples over bins; a bin without any is left out.

    Parameters
    ----------
    time_s : (n,)
        In any order, n >= 1.
    value : (n, ...)
    edges : (b,)
        Ascending.

    Returns
    -------
    time_s, value, count : (k,), (k, ...), (k,)
    """
    order = np.argsort(time_s, kind='stable')
    cell = np.searchsorted(edges, time_s[order])
    first = np.concatenate([[0], np.flatnonzero(np.diff(cell)) + 1])
    count = np.diff(np.concatenate([first, [len(order)]]))
    total = np.add.reduceat(value[order], first, axis=0)
    mean = (total.T / count).T
    return np.add.reduceat(time_s[order], first) / count, mean, count
