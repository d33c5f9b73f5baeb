# SPDX-License-Identifier: Apache-2.0
"""
What the steady record before the onset tells of the noise.

Sensor noise is what differs from sample to sample, a slow disturbance what
stays: both are learnt apart, by restricted maximum likelihood through the
filter that later whitens the coastdown. The residuals of the coastdown itself
would not do: a fit takes part of the disturbance for resistance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize

from shipdrag_ros.estimation.motion_fit.coast import LOG, POSITION, Rows
from shipdrag_ros.estimation.motion_fit.solve import cholesky_solve
from shipdrag_ros.estimation.motion_fit.whitening import CALM, Disturbance, Noise, whiten
from shipdrag_ros.samples import Float64, Int64

BIN_S = 10.0  # a steady record is condensed to its means over this
LEAST_S = 300.0  # of record from which a disturbance can be learnt
_BLOCK_S = 60.0
_UNSTEADY = 0.06  # of the speed: a block that differs by more ends the steady record
_OUTLIER = 5.0  # robust standard deviations
_MAD_TO_SD = 1.4826
_TYPICAL_S = 240.0  # correlation time; known from experience within a factor of e
_OFFSETS = (-1.0, -0.5, 0.0, 0.5, 1.0, 1.5)  # of the logarithms, in averaging
_SHORTEST_S, _LONGEST_S = 15.0, 3000.0


def white_sd(value: Float64) -> float:
    """
    Return the standard deviation of white noise on a smooth signal.

    Parameters
    ----------
    value : (n,)
        In ascending time.

    Notes
    -----
    From second differences, whose outliers are clipped; 0 where n < 4.
    """
    second = np.diff(value, 2)
    if len(second) < 2:
        return 0.0
    typical = _MAD_TO_SD * float(np.median(np.abs(second)))
    if typical > 0.0:
        second = second[np.abs(second) < 4.0 * typical]
    return float(np.sqrt(np.mean(second**2) / 6.0))


def steady_since(time_s: Float64, speed: Float64, heading_s: Float64, heading: Float64) -> float:
    """
    Return the time from which a record has been steady to its end.

    Parameters
    ----------
    time_s, speed : (n,)
        Ascending.
    heading_s, heading : (m,)
        Yaw [rad]; may be empty.
    """
    if len(time_s) == 0:
        return math.inf
    end = float(time_s[-1])
    level = float(np.median(speed[time_s > end - 2.0 * _BLOCK_S]))
    edges = np.arange(end, time_s[0] - _BLOCK_S, -_BLOCK_S)
    course: float | None = None
    for late, early in pairwise(edges):
        block = speed[(time_s > early) & (time_s <= late)]
        if len(block) and abs(float(np.median(block)) - level) > _UNSTEADY * level:
            return float(late)
        yaw = heading[(heading_s > early) & (heading_s <= late)]
        if len(yaw):
            mean = math.atan2(float(np.sin(yaw).mean()), float(np.cos(yaw).mean()))
            course = mean if course is None else course
            if abs(math.remainder(mean - course, 2.0 * math.pi)) > 0.15:
                return float(late)
    return float(time_s[0])


def condense(time_s: Float64, value: Float64) -> tuple[Float64, Float64, Int64]:
    """
    Return means over `BIN_S` of a record that is steady or moves evenly.

    Parameters
    ----------
    time_s, value : (n,)
        n >= 1.

    Returns
    -------
    time_s, value, count : (b,)
    """
    # outliers are told from what is near in time: the record may drift
    away = value - np.interp(time_s, *_medians(time_s, value))
    typical = _MAD_TO_SD * float(np.median(np.abs(away)))
    keep = np.abs(away) <= _OUTLIER * typical
    time_s, value = time_s[keep], value[keep]
    number = np.floor((time_s - time_s[0]) / BIN_S)
    first = np.concatenate([[0], np.flatnonzero(np.diff(number)) + 1])
    count = np.diff(np.concatenate([first, [len(time_s)]]))
    return (
        np.add.reduceat(time_s, first) / count,
        np.add.reduceat(value, first) / count,
        count,
    )


def _medians(time_s: Float64, value: Float64) -> tuple[Float64, Float64]:
    number = np.floor((time_s - time_s[0]) / (2.0 * _BLOCK_S))
    first = np.concatenate([[0], np.flatnonzero(np.diff(number)) + 1, [len(time_s)]])
    parts = [slice(a, b) for a, b in pairwise(first)]
    return (
        np.array([np.median(time_s[part]) for part in parts]),
        np.array([np.median(value[part]) for part in parts]),
    )


def learn(rows: Rows, variance: Float64, *, damping_1_s: float, inertia: float) -> Disturbance:
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

    Notes
    -----
    The mean speed, the first position and the current are profiled out
    (restricted likelihood). None, a gust force, the water's speed, or both: by
    Akaike's criterion. The correlation times have a broad log-normal prior,
    without which a short record lets them run away.
    """
    n = len(rows.time_s)
    design = np.column_stack(
        [
            np.where(rows.kind == POSITION, rows.time_s, 1.0),
            (rows.kind == POSITION).astype(np.float64),
            np.where(rows.kind == POSITION, rows.time_s, (rows.kind != LOG).astype(np.float64)),
        ]
    )
    kinds = set(rows.kind.tolist())
    used = [0]
    if POSITION in kinds:
        used.append(1)
    if LOG in kinds and len(kinds) > 1:
        used.append(2)
    table = np.vstack([rows.value, design[:, used].T])
    dampings, inertias = np.full(n, damping_1_s), np.full(n, inertia)

    def cost(about: Disturbance) -> float:
        white = table.copy()
        log_det = whiten(rows, white, Noise(variance, about, dampings, inertias))
        columns, z = white[1:], white[0]
        matrix = np.einsum('ji,ki->jk', columns, columns)
        right = np.einsum('ji,i->j', columns, z)[:, None]
        solved, found = cholesky_solve(matrix, right, 0.0)
        if not solved:
            return math.inf
        away = z - np.einsum('ji,j->i', columns, found[:, 0])
        _, log_of_design = np.linalg.slogdet(matrix)
        return float(log_det) + float((away * away).sum()) + float(log_of_design)

    speed_sd = (
        float(np.sqrt(np.median(variance[rows.kind != POSITION]))) if used != [0, 1] else 0.1
    )
    # a force that moves the ship by about as much as its log scatters
    force = 0.3 * speed_sd * inertia * math.sqrt(damping_1_s * (damping_1_s + 1.0 / _TYPICAL_S))
    best, chosen = cost(CALM), CALM
    for gust, water in ((True, False), (False, True), (True, True)):
        if water and LOG not in kinds:
            continue

        def about(x: Float64, gust: bool = gust, water: bool = water) -> Disturbance:
            values = np.exp(np.clip(x, -12.0, 12.0))
            parts = iter(values)
            of_gust = (force * next(parts), _TYPICAL_S * next(parts)) if gust else CALM[:2]
            of_water = (
                (0.3 * speed_sd * next(parts), _TYPICAL_S * next(parts)) if water else CALM[2:]
            )
            return Disturbance(
                float(of_gust[0]), _bounded(of_gust[1]), float(of_water[0]), _bounded(of_water[1])
            )

        def penalised(x: Float64, about: Callable[[Float64], Disturbance] = about) -> float:
            times = x[1::2]
            return cost(about(x)) + float((times**2).sum())

        start = np.zeros(2 * (gust + water))
        found = minimize(
            penalised,
            start,
            method='Nelder-Mead',
            options={
                'initial_simplex': np.vstack([start, np.eye(len(start))]),
                'xatol': 0.05,
                'fatol': 0.05,
                'maxfev': 160,
            },
        )
        criterion = float(found.fun) + 2.0 * len(start)
        if criterion < best:
            best, chosen = criterion, about(_mean(penalised, found.x))
    return chosen


def _mean(cost: Callable[[Float64], float], top: Float64) -> Float64:
    """
    Return the mean over what is likely, instead of the most likely.

    A short record is explained best by too small and too fast a disturbance; the
    band would be too narrow. Of each disturbance: the mean of its variance and
    of variance times correlation time, under a flat prior of the sd.
    """
    mean = top.copy()
    least = cost(top)
    for first in range(0, len(top), 2):
        weights, variances, times = [], [], []
        for of_sd in _OFFSETS:
            for of_time in _OFFSETS:
                x = top.copy()
                x[first] += of_sd
                x[first + 1] += of_time
                weights.append(math.exp(0.5 * (least - cost(x)) + x[first]))
                variances.append(math.exp(2.0 * x[first]))
                times.append(math.exp(2.0 * x[first] + x[first + 1]))
        weight = np.array(weights) / sum(weights)
        variance = float((weight * np.array(variances)).sum())
        mean[first] = 0.5 * math.log(variance)
        mean[first + 1] = math.log(float((weight * np.array(times)).sum()) / variance)
    return mean


def _bounded(time_s: float) -> float:
    return float(min(max(time_s, _SHORTEST_S), _LONGEST_S))
