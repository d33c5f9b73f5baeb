# SPDX-License-Identifier: Apache-2.0
"""
Slow noise, learnt from the steady record; compiled.

By restricted maximum likelihood through the filter that later whitens the coastdown, under broad
priors. The residuals of the coastdown itself would not do: a fit takes part of the noise for
resistance. Two rules: `learn` adds one source after the other while Akaike's criterion falls, and
returns the mean over what is likely; `most_probable` has every source that the inputs can show.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.gaussian import cholesky, products_of
from shipdrag_ros.inference.noise import WHITE, GaussMarkovNoise, Noise, whiten
from shipdrag_ros.inference.rows import LOG, OVER_GROUND, POSITION, Rows
from shipdrag_ros.samples import Float64, Int64

# Sources: gust, water, log, place; two logarithms each, of size and of correlation time. Last, of
# the factor by which the filter of a log makes its means scatter more than its samples show; the
# second one of that means nothing.
_GUST, _WATER, _LOG, _PLACE, _FILTER = range(5)
_SOURCES = 5
# Correlation times of gusts, of the water, of what the log errs by and of positions (receivers
# and radar: 20 to 600 s); known from experience within a factor of e.
_TYPICAL_S = np.array([240.0, 600.0, 240.0, 110.0])
# the same of a diagnosis, whose rows are means over longer times
_TYPICAL_OF_MEANS_S = np.array([90.0, 600.0, 50.0, 50.0])
_SD_OF_LOG_TIME = 0.8
_SD_OF_LOG_SIZE = np.array([1.2, 0.6, 1.2, 1.2])
_WATER_M_S = 0.025  # a current that changes by less goes unnoticed in half an hour
_GUST_OF_R = 0.1  # a force that swings is seldom more of the resistance
_SHORTEST_S, _LONGEST_S = 15.0, 3000.0
# At steady speed an engine that holds torque, power or revs gives more thrust to a ship that is
# slowed: the speed is damped 1 to 2 times as much as the hull's resistance says.
ENGINE_HOLD = 1.4
_OFFSETS = (-1.0, -0.25, 0.5, 1.25)  # of the logarithms, in averaging
_LARGEST = 12.0  # logarithm
_CLOSE = 0.05  # of the logarithms and of the criterion, in searching
_EVALUATIONS, _OF_ALL = 160, 600  # in one search, of a few sources and of all
_GUESSES = (-2.0, -1.0, 0.0, 1.0)  # of the logarithm of a second source's size
_LESS = (0.0, 2.0)  # of the logarithms of the others' sizes
# of the prior's sd; a step is the same part everywhere, so that the weight of each is its size
_OF_PRIOR = (0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 1.28, 2.56)
_WORTH = 0.5  # fall of the criterion
_LARGEST_FILTER = 4.0  # logarithm, of the sd


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
    units : (4,)
        Sizes that the logarithms are relative to [m/s^2], [m/s], [m/s], [m].
    times_s : (4,)
        Correlation times that they are relative to.
    spread : (10,)
        Standard deviation of the normal prior of each logarithm; inf: none.
    gust_m_s2
        Standard deviation of the half-normal prior of the force; inf: none.
    """

    rows: Rows
    table: Float64
    noise: Noise
    units: Float64
    times_s: Float64
    spread: Float64
    gust_m_s2: float


def learn(
    rows: Rows, variance: Float64, *, damping_1_s: float, inertia: float, r_m_s2: float
) -> tuple[GaussMarkovNoise, float]:
    """
    Learn the slow noise of a steady record.

    Parameters
    ----------
    rows
        Of the steady record.
    variance : (n,)
        Of their white noise.
    damping_1_s, inertia
        dr/dv over 1 + n_r [1/s] and 1 + n_r at the steady speed, of the hull alone.
    r_m_s2
        Resistance there, of which a force that swings is a part.

    Returns
    -------
    slow
    filtered
        By how much the variance of the log's noise is larger in means than its samples tell:
        a log that is filtered over some seconds errs alike in neighbours.

    Notes
    -----
    The hull's damping is taken `ENGINE_HOLD` times, the middle of what engines do.
    The mean speed, the first position and the current are profiled out
    (restricted likelihood). A gust force, an error of the log, one of the positions, or several:
    one after the other, by Akaike's criterion. The correlation
    times have a broad log-normal prior, without which a short record lets them run away;
    the force a half-normal one, without which errors of the instruments are taken for it.
    """
    damping_1_s = ENGINE_HOLD * damping_1_s
    speed_sd, place = _white_sds(rows, variance)
    force = _force(0.3 * speed_sd, damping_1_s, inertia, _TYPICAL_S[_GUST])
    units = np.array([force, _WATER_M_S, 0.3 * speed_sd, 3.0 * place])
    spread = np.tile([np.inf, 1.0], _SOURCES)
    gust_m_s2 = _GUST_OF_R * max(r_m_s2, 1e-9)
    noise = _white(variance, damping_1_s, inertia)
    steady = _Steady(rows, _profiled(rows), noise, units, _TYPICAL_S, spread, gust_m_s2)
    # water that moves leaves the trace of a log that errs, but for positions
    logged, placed = int((rows.kind == LOG).any()), int((rows.kind == POSITION).any())
    slow, filtered = _learn(steady, np.array([1, 0, logged, placed, logged]))
    return GaussMarkovNoise(*slow), float(filtered)


def most_probable(
    rows: Rows, variance: Float64, *, damping_1_s: float, inertia: float
) -> GaussMarkovNoise:
    """
    Return the most probable size and time of every source that the inputs can show.

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
    Log-normal priors about what instruments and water usually do; the mean speed, the first
    position and the current are profiled out.
    """
    log, position = rows.kind == LOG, rows.kind == POSITION
    speed_sd, place = _white_sds(rows, variance)
    speed_sd = max(0.02 if position.all() else speed_sd, 0.01)
    force = _force(speed_sd, damping_1_s, inertia, _TYPICAL_OF_MEANS_S[_GUST])
    units = np.array([force, _WATER_M_S, speed_sd, max(place, 0.5)])
    spread = np.column_stack([np.append(_SD_OF_LOG_SIZE, 1.0), np.full(_SOURCES, _SD_OF_LOG_TIME)])
    noise = _white(variance, damping_1_s, inertia)
    steady = _Steady(
        rows, _profiled(rows), noise, units, _TYPICAL_OF_MEANS_S, spread.ravel(), np.inf
    )
    there = np.flatnonzero([log.any(), not log.all(), log.any(), position.any()])
    which = np.sort(np.concatenate([2 * there, 2 * there + 1]))
    found, _ = _search(np.zeros(2 * _SOURCES), which, steady, _OF_ALL)
    return GaussMarkovNoise(*_slow(found, which, steady))


def _white(variance: Float64, damping_1_s: float, inertia: float) -> Noise:
    """Return the noise of a steady record without slow noise."""
    n = len(variance)
    return Noise(variance, WHITE, np.full(n, damping_1_s), np.full(n, inertia))


def _white_sds(rows: Rows, variance: Float64) -> tuple[float, float]:
    """Return typical standard deviations of speeds [m/s] and positions [m]."""
    position = rows.kind == POSITION
    speed_sd = 0.1 if position.all() else float(np.sqrt(np.median(variance[~position])))
    place = float(np.sqrt(np.median(variance[position]))) if position.any() else 1.0 / 3.0
    return speed_sd, place


def _force(speed_sd: float, damping_1_s: float, inertia: float, time_s: float) -> float:
    """Return the force that moves the ship by a standard deviation of its speed."""
    return float(speed_sd * inertia * np.sqrt(damping_1_s * (damping_1_s + 1.0 / time_s)))


def _profiled(rows: Rows) -> Float64:
    """Return measured values, and columns of mean speed, first position and current."""
    position, log = rows.kind == POSITION, rows.kind == LOG
    columns = [rows.value, np.where(position, rows.time_s, 1.0)]
    if position.any():
        columns.append(position.astype(np.float64))
    if log.any() and not log.all():
        # the current, which the log does not see
        columns.append(np.where(position, rows.time_s, (rows.kind == OVER_GROUND) * 1.0))
    return np.array(columns)


@compiled
def _slow(x: Float64, which: Int64, steady: _Steady) -> GaussMarkovNoise:
    """Return the noise of logarithms; sources not searched for are none."""
    size, time_s = np.zeros(4), np.array([60.0, 600.0, 60.0, 60.0])
    for i in which:
        if i // 2 == _FILTER:
            continue
        value = np.exp(min(max(x[i], -_LARGEST), _LARGEST))
        if i % 2:
            time_s[i // 2] = min(max(steady.times_s[i // 2] * value, _SHORTEST_S), _LONGEST_S)
        else:
            size[i // 2] = steady.units[i // 2] * value
    return GaussMarkovNoise(
        size[0], time_s[0], size[1], time_s[1], size[2], time_s[2], size[3], time_s[3]
    )


@compiled
def _filtered(x: Float64) -> float:
    """Return the factor of the variance of the log's noise."""
    return float(np.exp(2.0 * min(max(x[2 * _FILTER], 0.0), _LARGEST_FILTER)))


@compiled
def _criterion(x: Float64, which: Int64, steady: _Steady) -> float:
    """Return -2 ln of the restricted likelihood and of the prior, less a constant."""
    slow = _slow(x, which, steady)
    rows, noise = steady.rows, steady.noise
    table = steady.table.copy()
    variance = noise.variance.copy()
    variance[rows.kind == LOG] *= _filtered(x)
    total = whiten(rows, table, Noise(variance, slow, noise.damping_1_s, noise.inertia))
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
        total += (x[i] / steady.spread[i]) ** 2
    total += (slow.gust_m_s2 / steady.gust_m_s2) ** 2
    return float(total)


@compiled
def _search(
    start: Float64, which: Int64, steady: _Steady, evaluations: int
) -> tuple[Float64, float]:
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
    while done < evaluations:
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

    A short record is explained best by too small and too fast a source; the
    band would be too narrow. Of each source: the mean of its variance, and of
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
def _with_one_more(chosen: Float64, new: int, which: Int64, steady: _Steady) -> Float64:
    """
    Return where to search with one source more, the last of `which`.

    What was taken for the others may be the new one: they are tried small too.
    """
    start, least = chosen, np.inf
    for less in _LESS:
        for size in _GUESSES:
            trial = chosen.copy()
            if less > 0.0:
                trial[which[:-2:2]] -= less
                trial[which[1:-2:2]] = 0.0
            trial[2 * new] = size
            cost = _criterion(trial, which, steady)
            if cost < least:
                start, least = trial, cost
    return start


@compiled
def _hidden_gust(chosen: Float64, which: Int64, steady: _Steady) -> float:
    """Return the logarithm of the root of the mean variance of a force of typical time."""
    more = np.append(which, np.array([0, 1]))
    trial = chosen.copy()
    least, total, variances = np.inf, 0.0, 0.0
    for part in _OF_PRIOR:
        trial[0] = np.log(part * steady.gust_m_s2 / steady.units[0])
        cost = _criterion(trial, more, steady)
        if cost < least:
            # relative to the best so far
            fall = np.exp(0.5 * (cost - least))
            total, variances, least = fall * total, fall * variances, cost
        weight = np.exp(0.5 * (least - cost)) * part
        total += weight
        variances += weight * (part * steady.gust_m_s2) ** 2
    return float(np.log(np.sqrt(variances / total) / steady.units[0]))


@compiled
def _learn(steady: _Steady, seen: Int64) -> tuple[GaussMarkovNoise, float]:
    """Add one source after the other while Akaike's criterion falls."""
    which = np.zeros(0, np.int64)
    chosen = np.zeros(2 * _SOURCES)
    least = _criterion(chosen, which, steady)
    left = seen.copy()
    for _ in range(_SOURCES):
        best, best_which, best_chosen, added = least - 4.0, which, chosen, -1
        for kind in range(_SOURCES):
            if left[kind]:
                more = np.append(which, np.array([2 * kind, 2 * kind + 1]))
                start = _with_one_more(chosen, kind, more, steady)
                # a second one is worth a search only where a guess of it helps
                if len(which) and not _criterion(start, more, steady) < least - _WORTH:
                    continue
                found, cost = _search(start, more, steady, _EVALUATIONS)
                if cost < best:
                    best, best_which, best_chosen, added = cost, more, found, kind
        if added < 0:
            break
        least, which, chosen = best, best_which, best_chosen
        left[added] = 0
    if len(which):
        chosen = _mean(chosen, least, which, steady)
    if left[0] and len(which):
        # positions that wander hide a force: not shown is not none
        chosen[0] = _hidden_gust(chosen, which, steady)
        which = np.append(which, np.array([0, 1]))
    return _slow(chosen, which, steady), _filtered(chosen)
