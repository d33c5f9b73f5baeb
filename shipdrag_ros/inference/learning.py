# SPDX-License-Identifier: Apache-2.0
"""
The noise of a record, learnt with its uncertainty; compiled.

A setting is a size and a correlation time of each slow source, a factor of the white noise of each
input, and how firmly the engine holds the speed. Under broad log-normal priors the evidence of a
setting is that of a linear model whose coefficients are integrated out: the resistance too, so
that a run teaches about its noise without being taken for noise. `learn` finds the most probable
setting, the curvature there, and some tens of settings about it weighed by evidence and prior
(importance sampling at fixed points: no random numbers). What follows from a setting is averaged
over them: a size that a record does not show is not 0, and a band widens by what is not known.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference import priors
from shipdrag_ros.inference.linear import evidences, whitened_products
from shipdrag_ros.inference.rows import (
    HOLD,
    KIND_COUNT,
    LOG,
    OVER_GROUND,
    POSITION,
    SIZE,
    SOURCES,
    WHITE_OF,
    GaussMarkovNoise,
    Noise,
    NoisePosterior,
    Rows,
    Settings,
)
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
        Priors of the unknowns, all alike in probability; a precision of 0: not known, of
        infinity: 0.
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
    logs = evidences(products, seen.mean, seen.precision)[0]
    best = logs.max()
    if not best > -np.inf:
        return -np.inf
    total = np.exp(logs - best).sum()
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


KEPT = 24  # settings
_QUICK, _QUICK_KEPT = 13, 8  # of the points about the most probable setting, and of settings
_NEGLIGIBLE = 2e-3  # weight of a setting
_FINE, _ROUGH = 0.02, 0.3  # of the logarithm of the evidence: how near the most probable one is
LEAST_S = 300.0  # of record from which noise can be learnt; of less most is the prior's


def of_steady(rows: Rows, variance: Float64, damping_1_s: float, inertia: float) -> Seen:
    """
    Prepare a steady record alone: mean speed, first position and current are unknown.

    Parameters
    ----------
    rows
        Of the steady record.
    variance : (n,)
        Of their white noise.
    damping_1_s, inertia
        dr/dv over 1 + n_r [1/s] and 1 + n_r at the steady speed, of the hull alone.
    """
    n = len(variance)
    position, log = rows.kind == POSITION, rows.kind == LOG
    columns = [rows.value, np.where(position, rows.time_s, 1.0)]
    if position.any():
        columns.append(position.astype(np.float64))
    if log.any() and not log.all():
        # the current, which the log does not see
        columns.append(np.where(position, rows.time_s, (rows.kind == OVER_GROUND) * 1.0))
    none = np.zeros((1, len(columns) - 1))
    noise = Noise(variance, GaussMarkovNoise(), np.full(n, damping_1_s), np.full(n, inertia))
    return Seen(rows, np.array(columns), none, none, noise, n)


def learn(seen: Seen, speed_m_s: float, *, quick: bool = False) -> NoisePosterior:
    """
    Learn the noise of a record.

    Parameters
    ----------
    seen
    speed_m_s
        At the stop; with the damping it sets the scale of the priors.
    quick
        Times as they usually are, and a third of the settings.

    Returns
    -------
    NoisePosterior
        Of a record shorter than `LEAST_S` it is not called learnt: what it holds is mostly the
        prior. Settings of the prior as they are, where no setting explains the record.

    Notes
    -----
    Evidence at the mode and its curvature, then importance sampling with weights cut at the
    root of their number times their mean (Ionides 2008).
    """
    prior = _prior(seen, speed_m_s)
    if quick:
        sizes = prior.which[(prior.which >= WHITE_OF) | (prior.which % 2 == 0)]
        prior = prior._replace(which=sizes)
    points = spread_points(len(prior.which))
    points, close = (points[:_QUICK], _ROUGH) if quick else (points, _FINE)
    z, log_weight = sample(seen, prior, points, close)
    if not np.isfinite(log_weight).any():
        return _of_prior(prior)
    length_s = float(np.ptp(seen.rows.time_s)) if len(seen.rows.time_s) else 0.0
    kept = _QUICK_KEPT if quick else KEPT
    return replace(_posterior(z, log_weight, prior, kept), learnt=length_s >= LEAST_S)


def prior(seen: Seen, speed_m_s: float) -> NoisePosterior:
    """
    Return settings where nothing can be learnt.
    """
    return _of_prior(_prior(seen, speed_m_s))


def settings_at(seen: Seen, speed_m_s: float, points: Float64) -> Settings:
    """
    Return the settings at points of the prior, all alike in weight.

    Parameters
    ----------
    seen, speed_m_s
        As `learn`.
    points : (s, SIZE)
        Standard normal where drawn from the prior.
    """
    return _settings(points, np.full(len(points), 1.0 / len(points)), _prior(seen, speed_m_s))


def _of_prior(prior: SizePrior) -> NoisePosterior:
    points = spread_points(len(prior.which))[: 1 + KEPT]
    z = np.zeros((len(points), SIZE))
    z[:, prior.which] = points
    return NoisePosterior(_settings(z, np.full(len(z), 1.0 / len(z)), prior), False)


def _posterior(z: Float64, log_weight: Float64, prior: SizePrior, kept: int) -> NoisePosterior:
    """Keep what counts, the most probable first."""
    usable = np.isfinite(log_weight)
    z, log_weight = z[usable], log_weight[usable]
    weight = np.exp(log_weight - log_weight.max())
    weight = np.minimum(weight, np.sqrt(len(weight)) * weight.mean())
    weight /= weight.sum()
    order = np.argsort(-weight, kind='stable')[:kept]
    order = order[weight[order] > _NEGLIGIBLE]
    return NoisePosterior(_settings(z[order], weight[order] / weight[order].sum(), prior), True)


def _settings(z: Float64, weight: Float64, prior: SizePrior) -> Settings:
    """Return the settings at points, in standard deviations of the prior."""
    value = np.array([values(each, prior) for each in z])
    return Settings(
        value[:, :WHITE_OF].copy(), value[:, WHITE_OF:HOLD].copy(), value[:, HOLD], weight
    )


def _prior(seen: Seen, speed_m_s: float) -> SizePrior:
    """Return what instruments, engines, air and water usually do."""
    rows, noise = seen.rows, seen.noise
    has = np.array([rows.of(kind).any() for kind in range(KIND_COUNT)])

    def white(kind: int, otherwise: float) -> float:
        chosen = noise.variance[rows.of(kind)]
        return float(np.sqrt(np.median(chosen))) if len(chosen) else otherwise

    at = max(seen.steady - 1, 0)
    damping, inertia = float(noise.damping_1_s[at]), float(noise.inertia[at])
    r_m_s2 = damping * inertia * speed_m_s / 2.5
    log_sd = white(LOG, white(OVER_GROUND, 0.0))
    medians = np.array(
        [
            priors.GUST.mean * r_m_s2,
            priors.GUST_TIME.mean / np.sqrt(damping),
            priors.WATER.mean * min(1.0, speed_m_s / priors.WATER_SPEED.mean),
            priors.WATER_TIME.mean,
            max(priors.LOG.mean * log_sd, priors.LOG_LEAST.mean * speed_m_s),
            priors.LOG_TIME.mean,
            max(white(POSITION, 0.0), priors.PLACE.mean * speed_m_s),
            priors.PLACE_TIME.mean,
            priors.WHITE_LOG.mean,
            priors.WHITE_GROUND.mean,
            priors.WHITE_PLACE.mean,
            priors.HOLD.mean,
        ]
    )
    sd = np.array([each.sd for each in priors.LEARNT])
    # water that moves is a matter of what is measured over ground
    active = np.array([True, bool(has[1:].any()), bool(has[:2].any()), bool(has[POSITION])])
    which = np.concatenate([np.repeat(active, 2), has, [seen.steady > 0]])
    return SizePrior(np.log(medians), sd, np.flatnonzero(which))
