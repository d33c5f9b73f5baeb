# SPDX-License-Identifier: Apache-2.0
"""
What is known of a coastdown before it is measured, for the live estimator.

A part of r(v) that is not quadratic bends the coast in a way of its own: the
equation of motion, linear about quadratic drag, says how. The polynomials in
log time are held by what friction and wave making can be expected to do, so
that they are free where drag is, near the top, and stiff where it is not.
"""

from __future__ import annotations

import math

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.estimation.ode_fit.families import (
    CUBIC_SD,
    HUMP_SIZES,
    LINEAR_SDS,
    WAVES,
    Humps,
)
from shipdrag_ros.estimation.ode_fit.law import Law, shapes
from shipdrag_ros.samples import Float64, Int64

FREE = 2  # coefficients of quadratic drag: nothing is held against them
_POWERS = np.array([1, 3, 5, 7, 9])  # of r; the last ones are wave making
_START_SD = 1.0  # of the speed at the start
# What else may bend it: of coefficient j, AMPLITUDE DECAY^(j - 2) / j of the distance run.
_AMPLITUDE, _DECAY = 0.002, 0.5
_NODES = 32  # in log time

_SUMS = {'reassoc', 'contract', 'nsz'}  # see regression.refit


def coast_priors(
    length: float, speed_m_s: float, tc_s: float, froude: float, mean: Float64, sd: Float64
) -> tuple[Float64, Float64]:
    """
    Return priors of the coefficients of a coastdown.

    Parameters
    ----------
    length
        Of the window in log time, ln(1 + span / tc).
    speed_m_s, tc_s, froude
        Of the quadratic coast, at its start.
    mean, sd : (k,)
        Of the free coefficients and of the columns after the polynomials, which
        know nothing of r; 0 where a polynomial is held.

    Returns
    -------
    means : (p, k)
    roots : (p, k, k)
        Lower root of the covariance of each.
    """
    humps = Humps.between(math.exp(-length), froude)
    k = int(np.count_nonzero(sd == 0.0)) + FREE
    bends = _bends(length, _POWERS, len(humps.sd), humps.first, humps.spacing, k)
    result: tuple[Float64, Float64] = _priors(
        speed_m_s * tc_s, length, bends, humps.waves, humps.sd, mean, sd
    )
    return result


@compiled('f8[:, ::1](f8, i8[::1], i8, f8, f8, i8)', fastmath=_SUMS)
def _bends(
    length: float, powers: Int64, humps: int, first: float, spacing: float, k: int
) -> Float64:
    """
    Return what the start and each part of r do to the coefficients.

    Parameters
    ----------
    length
        See `coast_priors`.
    powers, humps, first, spacing
        See `Law`.
    k
        Polynomials.

    Returns
    -------
    (1 + parts, k)
        For 1 of the speed at the start, then for each part as large as r there;
        of a coast of speed and time constant 1.

    Notes
    -----
    With w = 1 + t / tc the quadratic coast is v = 1 / w, and a part f(v) of r
    changes it by -(1 / w^2) times the integral of f(1 / w) w^2.
    """
    law = Law(powers, 1.0, 0.0, np.zeros(1), humps, first, spacing)
    parts = len(powers) + humps
    columns = np.zeros((k, 1 + parts))
    before, middle, now = np.empty(parts), np.empty(parts), np.empty(parts)
    slope, total = np.empty(parts), np.zeros(parts)
    rate = np.empty(1 + parts)  # of distance by log time
    w_before = 1.0
    shapes(law, 1.0, before, slope)
    for i in range(_NODES):
        s = -math.cos(math.pi * (i + 0.5) / _NODES)
        w = math.exp(0.5 * length * (s + 1.0))
        w_middle = 0.5 * (w + w_before)
        shapes(law, 1.0 / w_middle, middle, slope)
        shapes(law, 1.0 / w, now, slope)
        rate[0] = 1.0 / w
        for p in range(parts):
            now[p] *= w * w
            # Simpson
            mean = (before[p] + 4.0 * middle[p] * w_middle * w_middle + now[p]) / 6.0
            total[p] += (w - w_before) * mean
            rate[1 + p] = -total[p] / w
            before[p] = now[p]
        w_before = w
        # its Chebyshev series to degree k - 2, integrated
        t_before, t = s, 1.0
        for j in range(k - 1):
            weight = length / _NODES * t * (1.0 if j == 0 else 0.5)
            for p in range(1 + parts):
                columns[j + 1, p] += weight / (j + 1) * rate[p]
            if j > 1:
                for p in range(1 + parts):
                    columns[j - 1, p] -= weight / (j - 1) * rate[p]
            t_before, t = t, 2.0 * s * t - t_before
    columns[:FREE] = 0.0
    return np.ascontiguousarray(columns.T)


@compiled('f8[:, ::1](f8[:, ::1], f8[::1])', fastmath=_SUMS)
def _sd_of_bends(bends: Float64, sd: Float64) -> Float64:
    """Return the covariance (k, k) of parts with some sd (b,) on bends (b, k)."""
    k = bends.shape[1]
    covariance = np.zeros((k, k))
    for c in range(len(bends)):
        for a in range(k):
            part = sd[c] * sd[c] * bends[c, a]
            for b in range(k):
                covariance[a, b] += part * bends[c, b]
    return covariance


@compiled(
    'Tuple((f8[:, ::1], f8[:, :, ::1]))(f8, f8, f8[:, ::1], f8, f8[::1], f8[::1], f8[::1])',
)
def _priors(
    unit: float,
    length: float,
    bends: Float64,
    waves: float,
    humps: Float64,
    mean: Float64,
    sd: Float64,
) -> tuple[Float64, Float64]:
    """Return means and roots, for each linear part and size of the humps."""
    k, first = bends.shape[1], len(bends) - len(humps)
    p = len(LINEAR_SDS) * len(HUMP_SIZES)
    means, roots = np.zeros((p, len(mean))), np.zeros((p, len(mean), len(mean)))
    of_powers = np.full(first, waves)
    of_powers[0], of_powers[1], of_powers[2] = _START_SD, 0.0, CUBIC_SD
    powers, linear = _sd_of_bends(bends[:first], of_powers), _sd_of_bends(bends[1:2], np.ones(1))
    hump = _sd_of_bends(bends[first:], humps)
    q = 0
    for of_linear in LINEAR_SDS:
        for size in HUMP_SIZES:
            root = roots[q]
            for a in range(len(mean)):
                means[q, a], root[a, a] = mean[a], sd[a]
            for a in range(FREE, k):
                for c in range(first - WAVES, first):
                    means[q, a] += unit * waves * bends[c, a]
                left = length * _AMPLITUDE * _DECAY ** (a - FREE) / a
                for b in range(FREE, a + 1):
                    total = left * left if a == b else 0.0
                    total += powers[a, b] + size * size * hump[a, b]
                    total += of_linear * of_linear * linear[a, b]
                    total *= unit * unit
                    for c in range(FREE, b):
                        total -= root[a, c] * root[b, c]
                    root[a, b] = math.sqrt(total) if a == b else total / root[b, b]
            q += 1
    return means, roots
