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

from dataclasses import dataclass
from functools import cache
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.gaussian import cholesky, products_of
from shipdrag_ros.inference.noise import WHITE, GaussMarkovNoise, Noise, whiten
from shipdrag_ros.inference.rows import KIND_COUNT, LOG, OVER_GROUND, POSITION, Rows
from shipdrag_ros.samples import Float64, Int64

LEAST_S = 300.0  # of record from which noise can be learnt; from less the prior is taken
# Parameters of a setting, all logarithms: size and time of gust, water, log, place; factors of
# the white sd of each input; hold of the engine.
_SOURCES = 4
_WHITE_OF = 2 * _SOURCES
_HOLD = _WHITE_OF + KIND_COUNT
SIZE = _HOLD + 1
# At steady speed an engine that holds torque, power or revs gives more thrust to a ship that is
# slowed: the speed is damped 1 to 2 times as much as the hull's resistance says.
_TYPICAL_HOLD = 1.4
# standard deviation of the logarithms, and medians of those that have a unit of their own
_SD_OF_SIZE = (1.0, 0.8, 1.0, 1.6)
_SD_OF_TIME = (0.9, 0.8, 1.1, 1.2)
_SD_OF_WHITE, _SD_OF_HOLD = (0.6, 0.6, 0.4), 0.25
_WHITE = (1.3, 1.3, 1.0)  # samples behind a filter err alike: their means scatter more
_LEAST_WHITE = 0.7  # means scatter no less than those of independent samples
_GUST_OF_R = 0.011  # of the resistance
_GUST_S = 18.0  # over the root of the damping [1/s]: 60 to 300 s for ships, seconds for boats
_WATER_M_S, _WATER_SPEED_M_S, _WATER_S = 0.02, 5.0, 600.0  # less where a craft is slower
_LOG_OF_WHITE, _LOG_OF_SPEED, _LOG_S = 0.3, 1e-3, 40.0
_PLACE_OF_SPEED_S, _PLACE_S = 0.1, 80.0
_SHORTEST_S, _LONGEST_S = 2.0, 3600.0

_PAIRS = 24  # of points about the most probable setting
_WIDER = 1.1  # than the curvature says
KEPT = 24  # settings
_NEGLIGIBLE = 2e-3  # weight of a setting
_ITERATIONS, _HALVINGS = 25, 5  # of the search
_LONGEST_STEP = 2.5  # in standard deviations of the prior
_CLOSE = 0.02  # of the logarithm of the evidence
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


class Settings(NamedTuple):
    """
    Choices of all sizes, with their probabilities; the most probable first.

    Attributes
    ----------
    slow : (s, 8)
        Fields of `GaussMarkovNoise`.
    white : (s, 3)
        Factor of the white standard deviation of each input.
    hold : (s,)
        Of the damping before the stop, over that of the hull.
    weight : (s,)
        Summing to 1.
    """

    slow: Float64
    white: Float64
    hold: Float64
    weight: Float64


SENSORS_ALONE = Settings(np.array([WHITE]), np.ones((1, KIND_COUNT)), np.ones(1), np.ones(1))


@compiled
def noise_of(settings: Settings, which: int, rows: Rows, white: Noise, steady: int) -> Noise:
    """
    Return the noise of rows in a setting.

    Parameters
    ----------
    settings, which
    rows
    white
        As samples show it, and how the hull damps.
    steady
        How many of the rows are before the stop.
    """
    n = len(rows.kind)
    variance, damping = np.empty(n), white.damping_1_s.copy()
    for i in range(n):
        variance[i] = white.variance[i] * settings.white[which, rows.kind[i]] ** 2
    for i in range(steady):
        damping[i] *= settings.hold[which]
    s = settings.slow[which]
    slow = GaussMarkovNoise(s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7])
    return Noise(variance, slow, damping, white.inertia)


@dataclass(frozen=True)
class NoisePosterior:
    """
    What is known of the noise of a record.

    Attributes
    ----------
    settings
    learnt
        False where nothing could be learnt: these are the settings of the prior.
    """

    settings: Settings
    learnt: bool

    @property
    def typical(self) -> Settings:
        """The one setting that comes nearest to all: mean squares of sizes, middle times."""
        weight = self.settings.weight
        slow = np.empty(2 * _SOURCES)
        slow[::2] = np.sqrt(weight @ self.settings.slow[:, ::2] ** 2)
        slow[1::2] = np.exp(weight @ np.log(self.settings.slow[:, 1::2]))
        return Settings(
            slow[None],
            np.sqrt(weight @ self.settings.white**2)[None],
            np.exp(weight @ np.log(self.settings.hold))[None],
            np.ones(1),
        )

    @property
    def slow(self) -> GaussMarkovNoise:
        """Sizes and times of the typical setting."""
        return GaussMarkovNoise(*self.typical.slow[0].tolist())


class _Prior(NamedTuple):
    """Medians and standard deviations of the logarithms, and which of them matter."""

    centre: Float64
    sd: Float64
    which: Int64


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


def learn(seen: Seen, speed_m_s: float) -> NoisePosterior:
    """
    Learn the noise of a record.

    Parameters
    ----------
    seen
    speed_m_s
        At the stop; with the damping it sets the scale of the priors.

    Returns
    -------
    NoisePosterior
        That of the prior where the record is shorter than `LEAST_S`, or where no setting
        explains it.

    Notes
    -----
    Evidence at the mode and its curvature, then importance sampling with weights cut at the
    root of their number times their mean (Ionides 2008).
    """
    prior = _prior(seen, speed_m_s)
    length_s = float(np.ptp(seen.rows.time_s)) if len(seen.rows.time_s) else 0.0
    if length_s < LEAST_S:
        return _of_prior(prior)
    found = _sample(seen, prior, _points(len(prior.which)))
    return _posterior(*found, prior) if np.isfinite(found[1]).any() else _of_prior(prior)


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


def _of_prior(prior: _Prior) -> NoisePosterior:
    points = _points(len(prior.which))[: 1 + KEPT]
    z = np.zeros((len(points), SIZE))
    z[:, prior.which] = points
    return NoisePosterior(_settings(z, np.full(len(z), 1.0 / len(z)), prior), False)


def _posterior(z: Float64, log_weight: Float64, prior: _Prior) -> NoisePosterior:
    """Keep what counts, the most probable first."""
    usable = np.isfinite(log_weight)
    z, log_weight = z[usable], log_weight[usable]
    weight = np.exp(log_weight - log_weight.max())
    weight = np.minimum(weight, np.sqrt(len(weight)) * weight.mean())
    weight /= weight.sum()
    order = np.argsort(-weight, kind='stable')[:KEPT]
    order = order[weight[order] > _NEGLIGIBLE]
    return NoisePosterior(_settings(z[order], weight[order] / weight[order].sum(), prior), True)


def _settings(z: Float64, weight: Float64, prior: _Prior) -> Settings:
    """Return the settings at points, in standard deviations of the prior."""
    value = np.array([_values(each, prior) for each in z])
    return Settings(
        value[:, :_WHITE_OF].copy(), value[:, _WHITE_OF:_HOLD].copy(), value[:, _HOLD], weight
    )


@cache
def _points(dimensions: int) -> Float64:
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


def _prior(seen: Seen, speed_m_s: float) -> _Prior:
    """Return what instruments, engines, air and water usually do."""
    rows, noise = seen.rows, seen.noise
    has = np.array([np.any(rows.kind == kind) for kind in range(KIND_COUNT)])

    def white(kind: int, otherwise: float) -> float:
        chosen = noise.variance[rows.kind == kind]
        return float(np.sqrt(np.median(chosen))) if len(chosen) else otherwise

    at = max(seen.steady - 1, 0)
    damping, inertia = float(noise.damping_1_s[at]), float(noise.inertia[at])
    r_m_s2 = damping * inertia * speed_m_s / 2.5
    log_sd = white(LOG, white(OVER_GROUND, 0.0))
    medians = np.array(
        [
            _GUST_OF_R * r_m_s2,
            _GUST_S / np.sqrt(damping),
            _WATER_M_S * min(1.0, speed_m_s / _WATER_SPEED_M_S),
            _WATER_S,
            max(_LOG_OF_WHITE * log_sd, _LOG_OF_SPEED * speed_m_s),
            _LOG_S,
            max(white(POSITION, 0.0), _PLACE_OF_SPEED_S * speed_m_s),
            _PLACE_S,
            *_WHITE,
            _TYPICAL_HOLD,
        ]
    )
    sd = np.array(
        [*np.column_stack([_SD_OF_SIZE, _SD_OF_TIME]).ravel(), *_SD_OF_WHITE, _SD_OF_HOLD]
    )
    # water that moves is a matter of what is measured over ground
    active = np.array([True, bool(has[1:].any()), bool(has[:2].any()), bool(has[POSITION])])
    which = np.concatenate([np.repeat(active, 2), has, [seen.steady > 0]])
    return _Prior(np.log(medians), sd, np.flatnonzero(which))


@compiled
def _values(z: Float64, prior: _Prior) -> Float64:
    """Return sizes and times, white factors and hold; a source that does not matter is none."""
    value = np.exp(prior.centre + prior.sd * z)
    matters = np.zeros(SIZE)
    matters[prior.which] = 1.0
    for i in range(_SOURCES):
        value[2 * i] *= matters[2 * i]
        value[2 * i + 1] = min(max(value[2 * i + 1], _SHORTEST_S), _LONGEST_S)
    for i in range(_WHITE_OF, _HOLD):
        value[i] = max(value[i], _LEAST_WHITE)
    return value


@compiled
def _log_posterior(z: Float64, seen: Seen, prior: _Prior) -> float:
    """Return the logarithm of evidence times prior, less a constant; -inf where it fails."""
    value = _values(z, prior).reshape(1, SIZE)
    setting = Settings(
        value[:, :_WHITE_OF], value[:, _WHITE_OF:_HOLD], value[:, _HOLD], np.ones(1)
    )
    noise = noise_of(setting, 0, seen.rows, seen.noise, seen.steady)
    table = seen.table.copy()
    log_det = whiten(seen.rows, table, noise)
    products = products_of(table)
    best, total = -np.inf, 0.0
    for q in range(len(seen.mean)):
        each = _of_model(products, seen.mean[q], seen.precision[q])
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
    result = best + np.log(total) - 0.5 * log_det - 0.5 * square
    return float(result) if np.isfinite(result) else -np.inf


@compiled
def _of_model(products: Float64, mean: Float64, precision: Float64) -> float:
    """Return the logarithm of the evidence of a linear model with whitened rows."""
    p = len(mean)
    matrix, right = products[1:, 1:].copy(), products[1:, 0].copy()
    result = -0.5 * products[0, 0]
    for a in range(p):
        matrix[a, a] += precision[a]
        right[a] += precision[a] * mean[a]
        if precision[a] > 0.0:
            result += 0.5 * np.log(precision[a]) - 0.5 * precision[a] * mean[a] ** 2
    solved, lower, scale = cholesky(matrix, 0.0)
    if not solved:
        return -np.inf
    for a in range(p):
        value = right[a] * scale[a]
        for b in range(a):
            value -= lower[a, b] * right[b]
        right[a] = value / lower[a, a]
        result += 0.5 * right[a] ** 2 - np.log(lower[a, a]) + np.log(scale[a])
    return float(result)


@compiled
def _slope(z: Float64, value: float, seen: Seen, prior: _Prior) -> Float64:
    """Return the slope of the logarithm in each direction that matters."""
    p = len(prior.which)
    slope = np.zeros(p)
    for a in range(p):
        trial = z.copy()
        trial[prior.which[a]] += _NEAR
        slope[a] = (_log_posterior(trial, seen, prior) - value) / _NEAR
    return slope


@compiled
def _mode(start: Float64, seen: Seen, prior: _Prior) -> tuple[Float64, float]:
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
        if not expected > _CLOSE:
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
    if a < _WHITE_OF and b < _WHITE_OF:
        return a // 2 == b // 2 or (a % 2 == 0 and b % 2 == 0)
    low, high = min(a, b), max(a, b)
    # white noise and the engine's hold against the sizes of what they resemble
    return low < _WHITE_OF and low % 2 == 0 and (high < _HOLD or low == 0)


@compiled
def _curvature(z: Float64, value: float, seen: Seen, prior: _Prior) -> Float64:
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
def _sample(seen: Seen, prior: _Prior, points: Float64) -> tuple[Float64, Float64]:
    """Return settings about the most probable one, and the logarithms of their weights."""
    p = len(prior.which)
    start, least = np.zeros(SIZE), -np.inf
    # sources in turn large and small: the search climbs from the best
    for number in range(1 + 2 * _SOURCES):
        trial = np.zeros(SIZE)
        if number:
            trial[2 * ((number - 1) // 2)] = 1.0 if number % 2 else -1.0
        value = _log_posterior(trial, seen, prior)
        if value > least:
            start, least = trial, value
    z, value = _mode(start, seen, prior)
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
