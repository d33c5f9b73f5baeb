# SPDX-License-Identifier: Apache-2.0
"""
Rows: means over times in which the motion is even, of readings that may be something else.

A reading is right with normal noise, or with a small chance anything within the range of its
input. Its weight in a mean is the probability that it is right, so nothing is rejected by a rule.
"""

from __future__ import annotations

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.rows import POSITION, Rows
from shipdrag_ros.posterior import priors
from shipdrag_ros.samples import Float64

_FIRST_PART, _FIRST_S, _GROWTH = 60.0, 3.0, 1.06  # of all, longest, and from one to the next
_LONGEST_PART, _LONGEST_S = 80.0, 12.0
_QUICK = 0.5  # of the number of parts, where time is short
_EVEN = 0.05  # of the time in which the speed halves: its mean is 3e-4 off that of a straight line
_NEIGHBOURS = 9  # whose medians show where a reading should be, and how fast it changes


@compiled
def right(time_s: Float64, value: Float64, sd: Float64, wrong: float) -> Float64:
    """
    Return the probability of each reading that it is right.

    Parameters
    ----------
    time_s, value, sd : (n,)
        Of one input, in ascending time, with the standard deviation of its white noise.
    wrong
        Chance that a reading is anything.
    """
    n, size = len(value), min(_NEIGHBOURS, len(value))
    found, near = np.ones(n), np.empty(n)
    spread = max(value.max() - value.min(), 1e-12)
    half = size // 2
    for i in range(n):
        low = min(max(0, i - half), n - size)
        when, near_by = time_s[low : low + size] - time_s[i], value[low : low + size]
        slope = 0.0
        if half:
            # at either end of a record all neighbours are on one side
            apart = np.maximum(when[half:] - when[: size - half], 1e-9)
            slope = np.median((near_by[half:] - near_by[: size - half]) / apart)
        near[i] = np.median(near_by - slope * when)
    # slow errors and the motion move readings from the median of their neighbours
    away = np.abs(value - near)
    wander = 1.4826 * np.median(away)
    for i in range(n):
        width = max(sd[i], wander)
        good = (1.0 - wrong) * np.exp(-0.5 * (away[i] / width) ** 2) / (2.5066 * width)
        found[i] = max(good / (good + wrong / spread), 1e-9)
    return found


def edges_of(
    end_s: float, start_s: float = 0.0, halved_s: float = np.inf, *, quick: bool = False
) -> Float64:
    """
    Return the edges of bins from a start to an end; short where the motion changes.

    Parameters
    ----------
    end_s, start_s
    halved_s
        In which the speed halves, from the start on.
    quick
        Whether fewer will do.
    """
    fewer = _QUICK if quick else 1.0
    longest = max(_LONGEST_S, (end_s - start_s) / _LONGEST_PART) / fewer
    first = min(_FIRST_S, (end_s - start_s) / _FIRST_PART)
    even = _EVEN * halved_s * np.exp(_EVEN * np.arange(400.0))
    widths = np.minimum(np.minimum(first * _GROWTH ** np.arange(400), longest), even)
    edges = start_s + np.concatenate([[0.0], np.cumsum(widths)])
    result: Float64 = edges[: int(np.searchsorted(edges, end_s, side='right')) + 1]
    return result


def _crude(rows: Rows, speed_m_s: float, halved_s: float) -> Float64:
    """Return what rows would read of a motion of quadratic drag; 0 where none is known."""
    if not np.isfinite(halved_s):
        return np.zeros(len(rows.time_s))
    since = 1.0 + np.maximum(rows.time_s - rows.time_s[0], 0.0) / halved_s
    way = speed_m_s * halved_s * np.log(since)
    result: Float64 = np.where(rows.of(POSITION), way, speed_m_s / since)
    return result


def condense(
    rows: Rows,
    variance: Float64,
    speed_m_s: float = 0.0,
    halved_s: float = np.inf,
    *,
    quick: bool = False,
) -> tuple[Rows, Float64]:
    """
    Average readings over bins.

    Parameters
    ----------
    rows
        Readings in ascending time.
    variance : (n,)
        Of their white noise.
    speed_m_s, halved_s
        At the start, and the time in which it halves, roughly: what bends there is no error.
    quick
        Whether fewer bins will do.

    Returns
    -------
    rows, variance
        In ascending time; a bin without readings is left out.
    """
    edges = edges_of(float(rows.time_s[-1]), float(rows.time_s[0]), halved_s, quick=quick)
    bent = rows.value - _crude(rows, speed_m_s, halved_s)
    times, kinds, values, variances = [], [], [], []
    for kind in np.unique(rows.kind):
        chosen = rows.kind == kind
        time_s, value, sd = rows.time_s[chosen], rows.value[chosen], np.sqrt(variance[chosen])
        weight = right(time_s, bent[chosen], sd, priors.WRONG.mean) / sd**2
        cell = np.searchsorted(edges, time_s, side='right')
        first = np.concatenate([[0], np.flatnonzero(np.diff(cell)) + 1])
        total = np.add.reduceat(weight, first)
        times.append(np.add.reduceat(weight * time_s, first) / total)
        values.append(np.add.reduceat(weight * value, first) / total)
        variances.append(1.0 / total)
        kinds.append(np.full(len(first), kind, np.int64))
    time_s = np.concatenate(times)
    order = np.argsort(time_s, kind='stable')
    found = Rows(time_s[order], np.concatenate(kinds)[order], np.concatenate(values)[order])
    return found, np.concatenate(variances)[order]
