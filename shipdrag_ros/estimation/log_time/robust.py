# SPDX-License-Identifier: Apache-2.0
"""Noise of each input and weights of its samples, outliers among them, compiled."""

from __future__ import annotations

import math

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.estimation.log_time.model import combine
from shipdrag_ros.inference.gaussian import condense, posterior
from shipdrag_ros.inference.robust import GROSS, MAD_TO_SD, huber_square, huber_weight
from shipdrag_ros.samples import Float64, Int64

HUBER = 2.0  # standard deviations: 99 % efficient in Gaussian noise
_SPIKE = 6.0
_OF_HUBER = huber_square(HUBER)
_PASSES = 2
_LAGS = 5  # of the samples; noise that is slower cannot be separated from the motion


@compiled('f8(f8[::1])')
def _rounding(value: Float64) -> float:
    """A standard deviation above 0 for data that a fit follows exactly."""
    return 1e-14 * float(max(1e-6, np.abs(value).max()))


@compiled('f8(f8[::1], f8[::1])')
def _sd_about_smooth(value: Float64, root: Float64) -> float:
    """Noise on a smooth curve, from second differences, where the root of the weight is 1."""
    if len(value) < 3:
        return 1.0
    second = np.empty(len(value) - 2)
    for i in range(len(second)):
        of_three = 1.0 / root[i] ** 2 + 4.0 / root[i + 1] ** 2 + 1.0 / root[i + 2] ** 2
        second[i] = value[i + 2] - 2.0 * value[i + 1] + value[i]
        second[i] *= math.sqrt(6.0 / of_three)
    spread = np.median(np.abs(second)) * MAD_TO_SD
    if spread == 0.0:  # readings repeat, being rounded
        spread = math.sqrt(np.mean(second * second))
    return float(max(spread / math.sqrt(6.0), _rounding(value)))


@compiled('f8(f8, f8, f8, f8, f8)')
def _median_of_five(a: float, b: float, c: float, d: float, e: float) -> float:
    # the larger of the two smaller ones and the smaller of the two larger ones stay
    low, high = max(min(a, b), min(c, d)), min(max(a, b), max(c, d))
    return max(min(low, high), min(max(low, high), e))


@compiled('f8[::1](f8[::1])')
def despike(value: Float64) -> Float64:
    """
    Replace spikes by the median of five, to start from.
    """
    limit = _SPIKE * _sd_about_smooth(value, np.ones(len(value)))
    clean = value.copy()
    for i in range(2, len(value) - 2):
        middle = _median_of_five(value[i - 2], value[i - 1], value[i], value[i + 1], value[i + 2])
        if abs(value[i] - middle) > limit:
            clean[i] = middle
    return clean


@compiled('f8(f8)')
def _weight(size: float) -> float:
    """Huber's weight of a residual in standard deviations; none of a gross one."""
    return huber_weight(size, HUBER) if size <= GROSS else 0.0


@compiled('f8(f8[::1])')
def _robust_sd(residual: Float64) -> float:
    """Huber's proposal 2, from the median on."""
    size = np.abs(residual)
    sd = max(np.median(size) * MAD_TO_SD, 1e-3 * math.sqrt(np.mean(size * size)))
    for _ in range(3):
        total = 0.0
        for i in range(len(size)):
            cut = min(size[i], HUBER * sd)
            total += cut * cut
        sd = math.sqrt(total / (len(size) * _OF_HUBER))
    return float(sd)


@compiled('f8(f8[::1], f8[::1])')
def _autocorrelation_time(residual: Float64, weight: Float64) -> float:
    """How many samples of correlated noise are worth one of white noise."""
    n = len(residual)
    weighted = residual * weight
    total = (weighted * weighted).sum()
    result, chance = 1.0, 2.0 / math.sqrt(n)
    for lag in range(1, n // _LAGS):
        correlation = (weighted[lag:] * weighted[:-lag]).sum() / total
        if not correlation > chance:
            break
        result += 2.0 * correlation
    return result


@compiled(
    'UniTuple(f8[::1], 4)(f8[:, ::1], f8[::1], f8[::1], f8[::1], i8[::1], f8[::1], i8[::1], '
    'f8[::1], f8[::1])',
)
def robust_fit(
    rows: Float64,
    value: Float64,
    clean: Float64,
    stated: Float64,
    count: Int64,
    known_sd: Float64,
    columns: Int64,
    mean: Float64,
    sd: Float64,
) -> tuple[Float64, Float64, Float64, Float64]:
    """
    Fit one model, its weights found from its residuals.

    Parameters
    ----------
    rows : (k, n)
        Columns of the model at the samples, kind after kind.
    value, clean : (n,)
        Measured, and without spikes.
    stated : (n,)
        Weight by the variances that samples state.
    count : (kinds,) int64
        Samples of each kind.
    known_sd : (kinds,)
        Standard deviation of each, 0 where unknown.
    columns : (m,) int64
        Those in the model.
    mean, sd : (k,)
        Prior of the coefficients.

    Returns
    -------
    coefficients : (k,)
    weight : (n,)
        Inverse variance of each sample.
    noise_sd : (kinds,)
        Found from the residuals, robustly; NaN without samples.
    used_sd : (kinds,)
        The known one where the residuals do not contradict it.

    Notes
    -----
    Huber (1981): weights min(1, c / |r|), scale by proposal 2. The inverse
    variances are such that their inverse normal matrix is his covariance,
    mean psi^2 / (mean psi')^2, times the number of samples that correlated noise
    makes worth one, 1 + 2 sum of correlations up to the first that chance explains.
    """
    n = len(value)
    coefficients, weight = np.zeros(len(rows)), np.empty(n)
    noise_sd, used_sd = np.full(len(count), np.nan), np.full(len(count), np.nan)
    residual = value - clean
    free = len(columns) * 0.5  # about half of the coefficients are the prior's
    for turn in range(_PASSES + 1):
        first = 0
        for kind in range(len(count)):
            last = first + count[kind]
            if last == first:
                continue
            root = np.sqrt(stated[first:last])
            part = residual[first:last] * root
            if turn == 0:
                found = _sd_about_smooth(value[first:last], root)
            else:
                found = max(_robust_sd(part), _rounding(value[first:last]))
                found *= math.sqrt(n / max(n - free, 1.0))
            scale = found
            if 0.5 * found < known_sd[kind] and found < 1.25 * known_sd[kind]:
                scale = known_sd[kind]
            inside = psi = total = 0.0
            for i in range(first, last):
                size = abs(part[i - first]) / scale
                w = _weight(size)
                weight[i] = w
                total += w
                psi += (w * size) ** 2
                if size <= HUBER:
                    inside += 1.0
            if scale == found:
                psi, inside = max(psi, 1e-9), max(inside, 1.0)
                of_huber = psi * (last - first) / (inside * inside)
            else:
                of_huber = 1.0
            if turn == 0:
                of_huber = 1.0
            factor = (last - first) / (max(total, 1.0) * of_huber * scale * scale)
            if turn > 0:
                factor /= _autocorrelation_time(part, weight[first:last])
            for i in range(first, last):
                weight[i] *= factor * stated[i]
            noise_sd[kind], used_sd[kind] = found, scale
            first = last
        if turn < _PASSES:
            # about nothing at first: the residual of the first turn is to what is clean
            products = condense(rows, residual if turn else value, weight)
            _, step, _ = posterior(products, coefficients, columns, mean, sd)
            for a in range(len(columns)):
                coefficients[columns[a]] += step[a]
            residual = value - combine(rows, coefficients)
    return coefficients, weight, noise_sd, used_sd
