# SPDX-License-Identifier: Apache-2.0
"""
Slow disturbances, learnt from the steady record; compiled.

By restricted maximum likelihood through the filter that later whitens the
coastdown. The residuals of the coastdown itself would not do: a fit takes part
of the disturbance for resistance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.estimation.ode_fit.coast import LOG, OVER_GROUND, POSITION, Rows
from shipdrag_ros.estimation.ode_fit.whitening import CALM, Disturbance, Noise, whiten
from shipdrag_ros.inference.gaussian import cholesky, products_of
from shipdrag_ros.samples import Float64, Int64

_TYPICAL_S = 240.0  # correlation time; known from experience within a factor of e
_SHORTEST_S, _LONGEST_S = 15.0, 3000.0
# At steady speed an engine that holds torque, power or revs gives more thrust to a ship that is
# slowed: the speed is damped 1 to 2 times as much as the hull's resistance says.
ENGINE_HOLD = 1.4
_OFFSETS = (-1.0, -0.25, 0.5, 1.25)  # of the logarithms, in averaging
_LARGEST = 12.0  # logarithm
_CLOSE = 0.05  # of the logarithms and of the criterion, in searching
_EVALUATIONS = 160  # in one search
_GUESSES = (-2.0, -1.0, 0.0, 1.0)  # of the logarithm of a second disturbance's size
_WORTH = 0.5  # fall of the criterion
_GUST, _WATER = np.array([0, 1]), np.array([2, 3])  # of the logarithms searched for
_BOTH = np.array([0, 1, 2, 3])


class _Steady(NamedTuple):
    """
    A steady record prepared for `_criterion`.

    Attributes
    ----------
    rows
        Of it.
    table : (c, n)
        Measured values and columns of what is profiled out.
    noise
        White noise, and how the ship damps.
    units : (2,)
        Sizes that the logarithms are relative to [m/s^2], [m/s].
    """

    rows: Rows
    table: Float64
    noise: Noise
    units: Float64


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
        dr/dv over 1 + n_r [1/s] and 1 + n_r at the steady speed, of the hull alone.

    Notes
    -----
    The hull's damping is taken `ENGINE_HOLD` times, the middle of what engines do.
    The mean speed, the first position and the current are profiled out
    (restricted likelihood). None, a gust force, the water's speed, or both: by
    Akaike's criterion. The correlation times have a broad log-normal prior,
    without which a short record lets them run away.
    """
    n = len(rows.time_s)
    damping_1_s = ENGINE_HOLD * damping_1_s
    position, log = rows.kind == POSITION, rows.kind == LOG
    columns = [rows.value, np.where(position, rows.time_s, 1.0)]
    if position.any():
        columns.append(position.astype(np.float64))
    if log.any() and not log.all():
        # the current, which the log does not see
        columns.append(np.where(position, rows.time_s, (rows.kind == OVER_GROUND) * 1.0))
    speed_sd = 0.1 if position.all() else float(np.sqrt(np.median(variance[~position])))
    # a force that moves the ship by about as much as its log scatters
    force = 0.3 * speed_sd * inertia * np.sqrt(damping_1_s * (damping_1_s + 1.0 / _TYPICAL_S))
    noise = Noise(variance, CALM, np.full(n, damping_1_s), np.full(n, inertia))
    units = np.array([force, 0.3 * speed_sd])
    steady = _Steady(rows, np.array(columns), noise, units)
    return Disturbance(*_learn(steady, bool(log.any())))


@compiled
def _about(x: Float64, which: Int64, units: Float64) -> Disturbance:
    """Return the disturbances of four logarithms; those not searched for are none."""
    found = np.array([0.0, CALM.gust_s, 0.0, CALM.water_s])
    for i in which:
        value = np.exp(min(max(x[i], -_LARGEST), _LARGEST))
        if i % 2:
            found[i] = min(max(_TYPICAL_S * value, _SHORTEST_S), _LONGEST_S)
        else:
            found[i] = units[i // 2] * value
    return Disturbance(found[0], found[1], found[2], found[3])


@compiled
def _criterion(x: Float64, which: Int64, steady: _Steady) -> float:
    """Return -2 ln of the restricted likelihood and of the prior, less a constant."""
    about = _about(x, which, steady.units)
    rows, noise = steady.rows, steady.noise
    table = steady.table.copy()
    total = whiten(rows, table, Noise(noise.variance, about, noise.damping_1_s, noise.inertia))
    # of the columns first, then the values: what is left of these is the last pivot
    p = len(table) - 1
    rolled = np.empty_like(table)
    for a in range(p + 1):
        rolled[a] = table[(a + 1) % (p + 1)]
    solved, lower, scale = cholesky(products_of(rolled), 0.0)
    if not solved:
        return np.inf
    for a in range(p):
        total += 2.0 * np.log(lower[a, a] / scale[a])
    total += (lower[p, p] / scale[p]) ** 2
    for i in which:
        if i % 2:
            total += x[i] * x[i]
    return float(total)


@compiled
def _search(start: Float64, which: Int64, steady: _Steady) -> tuple[Float64, float]:
    """Minimise the criterion over some of the logarithms by Nelder and Mead's simplex."""
    p = len(which)
    points = np.empty((p + 1, len(start)))
    costs = np.empty(p + 1)
    for j in range(p + 1):
        points[j] = start
        if j:
            points[j, which[j - 1]] += 1.0
        costs[j] = _criterion(points[j], which, steady)
    done = p + 1
    while done < _EVALUATIONS:
        order = np.argsort(costs)
        points, costs = points[order], costs[order]
        spread = 0.0
        for j in range(1, p + 1):
            spread = max(spread, np.abs(points[j] - points[0]).max())
        if spread < _CLOSE or costs[p] - costs[0] < _CLOSE:
            break
        middle = np.zeros(len(start))
        for j in range(p):
            middle += points[j] / p
        away = middle - points[p]
        point = middle + away
        cost = _criterion(point, which, steady)
        done += 1
        if costs[0] <= cost < costs[p - 1]:
            points[p], costs[p] = point, cost
            continue
        # further, or back on the better side
        factor = 2.0 if cost < costs[0] else (0.5 if cost < costs[p] else -0.5)
        other = middle + factor * away
        other_cost = _criterion(other, which, steady)
        done += 1
        if other_cost < min(cost, costs[p]):
            points[p], costs[p] = other, other_cost
        elif cost < costs[p]:
            points[p], costs[p] = point, cost
        else:
            for j in range(1, p + 1):
                points[j] = 0.5 * (points[j] + points[0])
                costs[j] = _criterion(points[j], which, steady)
            done += p
    best = np.argmin(costs)
    return points[best], costs[best]


@compiled
def _mean(top: Float64, least: float, which: Int64, steady: _Steady) -> Float64:
    """
    Return the mean over what is likely, instead of the most likely.

    A short record is explained best by too small and too fast a disturbance; the
    band would be too narrow. Of each disturbance: the mean of its variance, and of
    the logarithm of its correlation time, under a flat prior of the sd.
    """
    mean = top.copy()
    for first in which[::2]:
        total, variances, times = 0.0, 0.0, 0.0
        for of_sd in _OFFSETS:
            for of_time in _OFFSETS:
                x = top.copy()
                x[first] += of_sd
                x[first + 1] += of_time
                weight = np.exp(0.5 * (least - _criterion(x, which, steady)) + x[first])
                total += weight
                variances += weight * np.exp(2.0 * x[first])
                times += weight * x[first + 1]
        mean[first] = 0.5 * np.log(variances / total)
        mean[first + 1] = times / total
    return mean


@compiled
def _learn(steady: _Steady, logged: bool) -> Disturbance:
    """Choose between no disturbance, one and two by Akaike's criterion."""
    best, chosen, which = _criterion(np.zeros(4), _GUST[:0], steady), np.zeros(4), _GUST[:0]
    calm, least = best, best
    for one in (_GUST, _WATER):
        if one[0] == 2 and not logged:
            continue
        found, cost = _search(np.zeros(4), one, steady)
        if cost + 2.0 * len(one) < best:
            best, least, chosen, which = cost + 2.0 * len(one), cost, found, one
    if logged and best < calm:
        # a second one is worth a search only where a guess of it helps
        start, guessed = chosen, np.inf
        for size in _GUESSES:
            trial = chosen.copy()
            trial[2 if which[0] == 0 else 0] = size
            cost = _criterion(trial, _BOTH, steady)
            if cost < guessed:
                start, guessed = trial, cost
        if guessed < least - _WORTH:
            found, cost = _search(start, _BOTH, steady)
            if cost + 2.0 * len(_BOTH) < best:
                best, least, chosen, which = cost + 2.0 * len(_BOTH), cost, found, _BOTH
    if len(which):
        chosen = _mean(chosen, least, which, steady)
    disturbance: Disturbance = _about(chosen, which, steady.units)
    return disturbance
