# SPDX-License-Identifier: Apache-2.0
"""
Rows: means over times in which the motion is even, of readings that may be something else.

A reading is right with normal noise, or with a small chance anything within the range of its
input. Its weight in a mean is the probability that it is right, so nothing is rejected by a rule.
"""

from __future__ import annotations

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.rows import KIND_COUNT, Rows
from shipdrag_ros.posterior import priors
from shipdrag_ros.samples import Float64

_FIRST_PART, _FIRST_S, _GROWTH = 60.0, 3.0, 1.06  # of all, longest, and from one to the next
_LONGEST_PART, _LONGEST_S = 80.0, 12.0
_NEIGHBOURS = 4  # on each side, whose median shows where a reading should be


@compiled
def right(value: Float64, sd: Float64, wrong: float) -> Float64:
    """
    Return the probability of each reading that it is right.

    Parameters
    ----------
    value, sd : (n,)
        Of one input, in ascending time, with the standard deviation of its white noise.
    wrong
        Chance that a reading is anything.
    """
    n = len(value)
    found, near = np.ones(n), np.empty(n)
    spread = max(value.max() - value.min(), 1e-12)
    for i in range(n):
        low, high = max(0, i - _NEIGHBOURS), min(n, i + _NEIGHBOURS + 1)
        near[i] = np.median(value[low:high])
    # slow errors and the motion move readings from the median of their neighbours
    away = np.abs(value - near)
    wander = 1.4826 * np.median(away)
    for i in range(n):
        size = max(sd[i], wander)
        good = (1.0 - wrong) * np.exp(-0.5 * (away[i] / size) ** 2) / (2.5066 * size)
        found[i] = max(good / (good + wrong / spread), 1e-9)
    return found


def edges_of(end_s: float, start_s: float = 0.0) -> Float64:
    """
    Return the edges of bins from a start to an end; short where the motion changes.
    """
    longest = max(_LONGEST_S, (end_s - start_s) / _LONGEST_PART)
    first = min(_FIRST_S, (end_s - start_s) / _FIRST_PART)
    widths = np.minimum(first * _GROWTH ** np.arange(400), longest)
    edges = start_s + np.concatenate([[0.0], np.cumsum(widths)])
    result: Float64 = edges[: int(np.searchsorted(edges, end_s, side='right')) + 1]
    return result


def condense(rows: Rows, variance: Float64) -> tuple[Rows, Float64]:
    """
    Average readings over bins.

    Parameters
    ----------
    rows
        Readings in ascending time.
    variance : (n,)
        Of their white noise.

    Returns
    -------
    rows, variance
        In ascending time; a bin without readings is left out.
    """
    edges = edges_of(float(rows.time_s[-1]), float(rows.time_s[0]))
    times, kinds, values, variances = [], [], [], []
    for kind in range(KIND_COUNT):
        chosen = rows.kind == kind
        if not chosen.any():
            continue
        time_s, value, sd = rows.time_s[chosen], rows.value[chosen], np.sqrt(variance[chosen])
        weight = right(value, sd, priors.WRONG.mean) / sd**2
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
