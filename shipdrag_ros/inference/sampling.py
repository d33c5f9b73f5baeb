# SPDX-License-Identifier: Apache-2.0
"""
Settings of the noise drawn about the most probable one, by importance; compiled.

The evidence of a setting is that of a linear model whose coefficients are integrated out. A
quasi-Newton search finds the most probable setting, differences the curvature there; points that
are fixed once and for all, spread by the curvature, are weighed by evidence and prior.
"""

from __future__ import annotations

from functools import cache
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.linear import evidence_of, whitened_products
from shipdrag_ros.inference.noise import HOLD, SIZE, SOURCES, WHITE_OF, Noise, Settings
from shipdrag_ros.inference.rows import Rows
from shipdrag_ros.samples import Float64, Int64

_SHORTEST_S, _LONGEST_S = 2.0, 3600.0
_LEAST_WHITE = 0.7  # means scatter no less than those of independent samples
_PAIRS = 24  # of points about the most probable setting
_WIDER = 1.1  # than the curvature says
_ITERATIONS, _HALVINGS = 25, 5  # of the search
_LONGEST_STEP = 2.5  # in standard deviations of the prior
_NEAR, _APART = 1e-2, 0.3  # steps of differences, for slope and curvature
_FLOOR = 0.4  # of the curvature, in which the prior has 1


class Seen(NamedTuple):
    """
    What noise is learnt from.

    Attributes
    ----------
    rows
        In ascending time.
    table : (1 + p, n)
        What is measured, less a guess; columns of what is unknown.
    mean, precision : (q, p)
        Priors of the unknowns, all alike in probability; a precision of 0: not known.
    noise
        White noise as samples show it, and how the hull damps.
    steady
        How many of the rows are before the stop.
    """

    rows: Rows
    table: Float64
    mean: Float64
    precision: Float64
    noise: Noise
    steady: int


class SizePrior(NamedTuple):
    """Medians and standard deviations of the logarithms, and which of them matter."""

    centre: Float64
    sd: Float64
    which: Int64


@cache
def spread_points(dimensions: int) -> Float64:
    """Return the origin and pairs of opposite points, evenly spread as a standard normal."""
    # the additive recurrence of the generalised golden ratio (Roberts 2018)
    ratio = 2.0
    for _ in range(64):
        ratio = (1.0 + ratio) ** (1.0 / (dimensions + 1))
    steps = (1.0 / ratio) ** np.arange(1, dimensions + 1)
    even = (0.5 + np.outer(np.arange(1, _PAIRS + 1), steps)) % 1.0
    normal = NormalDist()
    half = np.array([[normal.inv_cdf(float(part)) for part in line] for line in even])
    half /= np.sqrt(np.mean(half**2, axis=0))
    points = np.zeros((1 + 2 * _PAIRS, dimensions))
    points[1::2], points[2::2] = half, -half
    return points


@compiled
def values(z: Float64, prior: SizePrior) -> Float64:
    """Return sizes and times, white factors and hold; a source that does not matter is none."""
    value = np.exp(prior.centre + prior.sd * z)
    matters = np.zeros(SIZE)
    matters[prior.which] = 1.0
    for i in range(SOURCES):
        value[2 * i] *= matters[2 * i]
        value[2 * i + 1] = min(max(value[2 * i + 1], _SHORTEST_S), _LONGEST_S)
    for i in range(WHITE_OF, HOLD):
        value[i] = max(value[i], _LEAST_WHITE)
    return value


@compiled
def _log_posterior(z: Float64, seen: Seen, prior: SizePrior) -> float:
    """Return the logarithm of evidence times prior, less a constant; -inf where it fails."""
    value = values(z, prior).reshape(1, SIZE)
    setting = Settings(value[:, :WHITE_OF], value[:, WHITE_OF:HOLD], value[:, HOLD], np.ones(1))
    products, log_det = whitened_products(seen.table, seen.rows, seen.noise, seen.steady, setting)
    best, total = -np.inf, 0.0
    for q in range(len(seen.mean)):
        each = evidence_of(products[0], seen.mean[q], seen.precision[q])
        if each > best:
            total = total * np.exp(best - each) + 1.0
            best = each
        elif each > -np.inf:
            total += np.exp(each - best)
    if not best > -np.inf:
        return -np.inf
    square = 0.0
    for i in prior.which:
        square += z[i] * z[i]
    result = best + np.log(total) - 0.5 * log_det[0] - 0.5 * square
    return float(result) if np.isfinite(result) else -np.inf


@compiled
def _slope(z: Float64, value: float, seen: Seen, prior: SizePrior) -> Float64:
    """Return the slope of the logarithm in each direction that matters."""
    p = len(prior.which)
    slope = np.zeros(p)
    for a in range(p):
        trial = z.copy()
        trial[prior.which[a]] += _NEAR
        slope[a] = (_log_posterior(trial, seen, prior) - value) / _NEAR
    return slope


@compiled
def _mode(start: Float64, seen: Seen, prior: SizePrior, close: float) -> tuple[Float64, float]:
    """Climb to the most probable setting by a quasi-Newton search (BFGS)."""
    p = len(prior.which)
    z, value = start.copy(), _log_posterior(start, seen, prior)
    inverse = np.eye(p)
    slope = _slope(z, value, seen, prior)
    for _ in range(_ITERATIONS):
        step = np.zeros(p)
        for a in range(p):
            for b in range(p):
                step[a] += inverse[a, b] * slope[b]
        if not np.sum(step * slope) > 0.0:
            inverse, step = np.eye(p), slope.copy()
        length = np.sqrt(np.sum(step * step))
        if length > _LONGEST_STEP:
            step *= _LONGEST_STEP / length
        expected = np.sum(step * slope)
        if not expected > close:
            break
        part, better = 1.0, False
        trial, at_trial = z, value
        for _ in range(_HALVINGS):
            trial = z.copy()
            for a in range(p):
                trial[prior.which[a]] += part * step[a]
            at_trial = _log_posterior(trial, seen, prior)
            if at_trial > value + 0.1 * part * expected:
                better = True
                break
            part *= 0.4
        if not better:
            break
        step *= part
        after = _slope(trial, at_trial, seen, prior)
        change = slope - after
        along = np.sum(change * step)
        if along > 1e-3 * np.sum(step * step):
            turned = np.zeros(p)
            for a in range(p):
                for b in range(p):
                    turned[a] += inverse[a, b] * change[b]
            factor = (1.0 + np.sum(change * turned) / along) / along
            for a in range(p):
                for b in range(p):
                    inverse[a, b] += (
                        factor * step[a] * step[b]
                        - (turned[a] * step[b] + step[a] * turned[b]) / along
                    )
        z, value, slope = trial, at_trial, after
    return z, value


@compiled
def _trade(a: int, b: int) -> bool:
    """Say whether two parameters may stand for each other: not the times of two sources."""
    if a < WHITE_OF and b < WHITE_OF:
        return a // 2 == b // 2 or (a % 2 == 0 and b % 2 == 0)
    low, high = min(a, b), max(a, b)
    # white noise and the engine's hold against the sizes of what they resemble
    return low < WHITE_OF and low % 2 == 0 and (high < HOLD or low == 0)


@compiled
def _curvature(z: Float64, value: float, seen: Seen, prior: SizePrior) -> Float64:
    """Return minus the second derivatives of the logarithm, by differences."""
    p = len(prior.which)
    matrix, ahead = np.empty((p, p)), np.empty(p)
    for a in range(p):
        trial = z.copy()
        trial[prior.which[a]] += _APART
        ahead[a] = _log_posterior(trial, seen, prior)
        trial[prior.which[a]] -= 2.0 * _APART
        behind = _log_posterior(trial, seen, prior)
        matrix[a, a] = (2.0 * value - ahead[a] - behind) / _APART**2
    for a in range(p):
        for b in range(a):
            matrix[a, b] = matrix[b, a] = 0.0
            if not _trade(prior.which[a], prior.which[b]):
                continue
            trial = z.copy()
            trial[prior.which[a]] += _APART
            trial[prior.which[b]] += _APART
            both = _log_posterior(trial, seen, prior)
            matrix[a, b] = (ahead[a] + ahead[b] - value - both) / _APART**2
            matrix[b, a] = matrix[a, b]
    return matrix


@compiled
def _root(matrix: Float64) -> Float64:
    """Return the lower factor of a curvature, raised until it is far from 0 everywhere."""
    p = len(matrix)
    for raised in range(12):
        lower = np.zeros((p, p))
        least = np.inf
        for a in range(p):
            for b in range(a + 1):
                total = matrix[a, b] + (0.25 * raised * raised if a == b else 0.0)
                for c in range(b):
                    total -= lower[a, c] * lower[b, c]
                if a == b:
                    least = min(least, total) if np.isfinite(total) else -np.inf
                    lower[a, a] = np.sqrt(max(total, 1e-9))
                else:
                    lower[a, b] = total / lower[b, b]
        if least > _FLOOR:
            return lower
    return np.eye(p)


@compiled
def sample(seen: Seen, prior: SizePrior, points: Float64, close: float) -> tuple[Float64, Float64]:
    """
    Return settings about the most probable one, and the logarithms of their weights.

    `close` is how near it is sought, by the logarithm of the evidence.
    """
    p = len(prior.which)
    start, least = np.zeros(SIZE), -np.inf
    # sources in turn large and small: the search climbs from the best
    for number in range(1 + 2 * SOURCES):
        trial = np.zeros(SIZE)
        if number:
            trial[2 * ((number - 1) // 2)] = 1.0 if number % 2 else -1.0
        value = _log_posterior(trial, seen, prior)
        if value > least:
            start, least = trial, value
    z, value = _mode(start, seen, prior, close)
    lower = _root(_curvature(z, value, seen, prior))
    count = len(points)
    found, log_weight = np.zeros((count, SIZE)), np.full(count, -np.inf)
    for k in range(count):
        found[k] = z
        # lower' x = point
        x = points[k] * _WIDER
        for a in range(p - 1, -1, -1):
            for b in range(a + 1, p):
                x[a] -= lower[b, a] * x[b]
            x[a] /= lower[a, a]
        square = 0.0
        for a in range(p):
            found[k, prior.which[a]] += x[a]
            square += points[k, a] ** 2
        log_weight[k] = _log_posterior(found[k], seen, prior) + 0.5 * square
    return found, log_weight
