# SPDX-License-Identifier: Apache-2.0
"""
Does one speed read another one in a wrong scale?

A scale stays: it is one unknown for the whole record, however long that is. A current has a
size that its prior bounds, and changes slowly. While she keeps her speed the two look alike;
where she changes it, a scale changes the difference with her speed, and a current does not.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown import numbers as v
from shipdrag_ros.coastdown.bins import Bins, mean_speeds
from shipdrag_ros.compiled import compiled
from shipdrag_ros.display import UNIT_RATIOS
from shipdrag_ros.samples import Float64, Int64

# Edges of means, seconds before the newest: short where it is new, so that a short glide is seen
EDGES: Int64 = np.array([0, 10, 22, 38, 60, 90, 130, 185, 260, 360, 500, 680, 920, 1250])
_WIDTH = np.diff(EDGES)
_MIDDLE = 0.5 * (EDGES[1:] + EDGES[:-1])

_NEAR, _FAR = np.arange(-0.2, 0.21, 0.025), np.arange(0.26, 1.7, 0.06)
_LN = np.concatenate([-_FAR[::-1], _NEAR, _FAR])
_SCALE = np.exp(_LN)


def _normal(away: Float64, sd: float) -> Float64:
    return np.asarray(np.exp(-0.5 * (away / sd) ** 2) / sd, np.float64)


def _share(density: Float64) -> Float64:
    density = density * np.gradient(_LN)
    return np.asarray(np.log(np.maximum(density / density.sum(), 1e-300)), np.float64)


_IS_SOUND = _share(np.sum([part * _normal(_LN, sd) for sd, part in v.SOUND], axis=0))
_IS_WRONG = _share(
    (1.0 - v.UNITS) * _normal(_LN, v.WIDE)
    + v.UNITS * np.mean([_normal(_LN - math.log(each), v.UNIT) for each in UNIT_RATIOS], axis=0)
)


class Scaled(NamedTuple):
    """
    How much more probable it is that a speed is in a wrong scale than that it is sound.

    Attributes
    ----------
    log_odds
        Logarithm of the ratio of the evidences.
    scale
        The most probable one, reading over truth.
    span_s
        What it was learnt from [s].
    """

    log_odds: float
    scale: float
    span_s: int


@lru_cache
def _settings(count: int) -> tuple[Float64, Float64, Float64, Float64]:
    """Return whitening, what a log adds to unit variances, factors as logarithms, currents."""
    white, added, factors, currents = [], [], [], []
    middle, width = _MIDDLE[:count], _WIDTH[:count]
    apart, since = np.subtract.outer(middle, middle), middle[-1] - middle
    same = np.ones((count, count))
    walk = np.minimum.outer(since, since)
    steady = 1.0 - v.TURNS - v.ANOTHER
    kinds = [(same, drift, steady * part) for drift, part in v.DRIFTS]
    kinds.append((np.exp(-np.abs(apart) / v.TURN_S), v.DRIFTS[-1][0], v.TURNS))
    for first in range(1, count):
        newer = np.arange(count) < first
        one = (newer[:, None] == newer).astype(np.float64)
        kinds.append((one, v.DRIFTS[-1][0], v.ANOTHER / (count - 1)))
    of_log = np.diag(v.JITTER**2 / width) + v.OFFSET**2 * same
    for (size, a), (kind, drift, b), (place, c) in product(v.CURRENT, kinds, v.PLACE):
        water = size**2 * kind + drift**2 * walk
        ground = water + np.diag((place / width) ** 2 + v.LEAST**2)
        lower = np.linalg.cholesky(ground)
        inverse = np.linalg.inv(lower)
        more, vectors = np.linalg.eigh(inverse @ of_log @ inverse.T)
        white.append(vectors.T @ inverse)
        added.append(np.maximum(more, 0.0))
        currents.append([size])
        factors.append(math.log(a * b * c) - np.log(np.diag(lower)).sum())
    return np.array(white), np.array(added), np.array(factors), np.array(currents)


def scaled(reading: Float64, truth: Float64) -> Scaled:
    """
    Compare a reading with another one of the same ship; a current may be between them.

    Parameters
    ----------
    reading, truth : (n,)
        Means over the spans of `EDGES` [m/s], the newest first, n at most all.
    """
    white, added, factors, currents = _settings(len(reading))
    # over ground a current from abeam adds more, the slower she is
    abeam = currents**2 / (2.0 * np.maximum(truth, currents))
    each = np.empty(len(_LN))
    beside = (white @ abeam[:, :, None]).reshape(added.shape)
    _evidences(white @ reading, white @ truth, beside, added, factors, each)
    wrong = each + _IS_WRONG
    log_odds = log_sum(wrong) - log_sum(each + _IS_SOUND)
    scale = float(_SCALE[int(np.argmax(wrong))])
    return Scaled(float(log_odds), scale, int(EDGES[len(reading)]))


@compiled(
    'void(float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[::1], '
    'float64[::1])'
)
def _evidences(
    reading: Float64,
    truth: Float64,
    beside: Float64,
    added: Float64,
    factors: Float64,
    each: Float64,
) -> None:
    """Find the log evidence of each scale, of speeds and a current in whitened directions."""
    settings, count = reading.shape
    logs = np.empty(settings)
    for scale in range(len(_SCALE)):
        inverse = 1.0 / _SCALE[scale]
        for setting in range(settings):
            square, along, size, precisions = 0.0, 0.0, 1.0, 1.0
            for i in range(count):
                precision = 1.0 / (1.0 + inverse * inverse * added[setting, i])
                away = truth[setting, i] - inverse * reading[setting, i]
                square += away * away * precision
                along += away * precision * beside[setting, i]
                size += beside[setting, i] * beside[setting, i] * precision
                precisions *= precision
            square += math.log(size / precisions) - along * along / size
            logs[setting] = factors[setting] - 0.5 * square
        each[scale] = log_sum(logs)


@compiled('float64(float64[::1])')
def log_sum(logs: Float64) -> float:
    """
    Return the logarithm of a sum.

    Parameters
    ----------
    logs
        Logarithms of its terms.
    """
    most: float = logs.max()
    if most == -math.inf:
        return most
    total = 0.0
    for each in logs:
        total += math.exp(each - most)
    return most + math.log(total)


def means(bins: Bins, source: int, last: int) -> Float64:
    """
    Return means of a speed [m/s] over the spans of `EDGES`, up to the first with a gap.

    Parameters
    ----------
    bins
        What is kept.
    source
        Of the speed.
    last
        The second with which the newest ends.
    """
    edges = last - EDGES[bins.speeds.shape[1] > EDGES]
    count, speed = mean_speeds(bins, source, edges)
    there = 2 * count > -np.diff(edges)
    return speed if there.all() else speed[: int(np.argmin(there))]
