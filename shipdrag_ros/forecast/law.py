# SPDX-License-Identifier: Apache-2.0
"""
The deceleration at speeds that a glide has not reached yet, with its covariance.

ln a(u) = ln a_0(u) + d(ln u), a_0 of the ship file or of a hull of her length and volume. d is a
Gaussian process: an unknown level, an unknown exponent, a smooth rest and a constant force, which
grows as the drag falls. It is given what the estimate says of r(v), and beyond that is the prior:
families from one of narrow sizes to one of a craft that is no hull, weighed by their evidence.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from shipdrag_ros.estimation.result import Estimate, ResistanceCurve
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.baseline import ittc57

# priors, chosen on world A (`benchmarks/forecast_worlds.py`)
LEVEL = 1.0
"""Standard deviation of d at the highest speed: the size of r is what was measured."""
EXPONENT = 0.15
"""Standard deviation of the exponent of r over u, beside that of the hull."""
SMOOTH, ALIKE = 0.06, 0.4
"""Standard deviation of the rest of d, and over how much of ln u it is alike."""
CONSTANT = 0.03
"""Standard deviation of a constant force, of the deceleration at the stop."""
SCALES = ((1.0, 0.85), (3.0, 0.12), (10.0, 0.03))
"""Families in which the last three are so many times as wide, and their probabilities."""
# a hull without a baseline, as in docs/model.md
_FORM, _WAVE, _WAVE_FROUDE, _WAVE_POWER = 0.2, 8e-4, 0.22, 4
_POINTS = 25  # of the curve, evenly in ln u
_ALIKE_RANGE = (0.03, 3.0)  # of ln u, over which errors of the estimate may be alike
_ROUNDING = 1e-6


class Deceleration(NamedTuple):
    """
    ln of the deceleration without thrust at some speeds (m,), and its covariance (m, m).
    """

    log_m_s2: Float64
    covariance: Float64


def deceleration(estimate: Estimate, ship: Ship, speed_m_s: Float64) -> Deceleration:
    """
    Return the law that an estimate and the prior give.

    Parameters
    ----------
    estimate
        Of any estimator: r(v), its band and the band of its slope are used.
    ship
        For n_r and the hull.
    speed_m_s : (m,)
        Above 0.

    Notes
    -----
    Regression by Gaussian processes (Rasmussen, Williams 2006, ch. 2). An error of n_r cancels:
    r / (1 + n_r) was measured, and is foretold. Errors of the estimate at two speeds are alike
    over sigma / sd of the slope.
    """
    curve = estimate.valid_curve if len(estimate.valid_curve) >= _POINTS else estimate.curve
    top = float(curve.speed_m_s[-1])
    x = np.linspace(np.log(curve.speed_m_s[0]), np.log(top), _POINTS)
    measured, error = _measured(curve, ship, np.exp(x))
    u = np.concatenate([np.exp(x), speed_m_s])
    base = _log_hull(ship, u)
    base += measured[-1] - base[_POINTS - 1]
    off = measured - base[:_POINTS]
    means, covariances, logs = [], [], []
    for scale, chance in SCALES:
        prior = _prior(np.log(u / top), np.exp(measured[-1] - base), scale)
        of_curve, to_others = prior[:_POINTS, :_POINTS] + error, prior[_POINTS:, :_POINTS]
        lower = np.linalg.cholesky(of_curve)
        gain = np.linalg.solve(of_curve, to_others.T).T
        fit = np.linalg.solve(lower, off)
        logs.append(np.log(chance) - 0.5 * fit @ fit - np.log(np.diag(lower)).sum())
        means.append(base[_POINTS:] + gain @ off)
        covariances.append(prior[_POINTS:, _POINTS:] - gain @ to_others.T)
    weight = np.exp(np.array(logs) - max(logs))
    weight /= weight.sum()
    mean = weight @ np.array(means)
    apart = np.array(means) - mean
    covariance = np.tensordot(weight, covariances, 1) + (weight * apart.T) @ apart
    return Deceleration(mean, covariance)


def _log_hull(ship: Ship, u: Float64) -> Float64:
    """Return ln of the deceleration by a hull, but for a constant."""
    if ship.baseline is not None:
        low, high = ship.baseline_range_m_s
        inside = np.clip(u, max(low, 1e-3 * high), high)
        drag = ship.resistance_n(inside) * (u / inside) ** 2
    else:
        reynolds = u * ship.length_m / ship.water.kinematic_viscosity_m2_s
        wave = _WAVE * (ship.froude(u) / _WAVE_FROUDE) ** _WAVE_POWER
        drag = ((1.0 + _FORM) * ittc57(reynolds) + wave) * u**2
    return np.asarray(np.log(drag / (1.0 + ship.n_r(u))))


def _prior(x: Float64, weakness: Float64, scale: float) -> Float64:
    """Return the covariance of d: `x` from the top, `weakness` of the drag against it."""
    apart = x[:, None] - x
    constant = np.log1p(scale * CONSTANT * (weakness - 1.0))
    return np.asarray(
        LEVEL**2
        + (scale * EXPONENT) ** 2 * np.outer(x, x)
        + (scale * SMOOTH) ** 2 * np.exp(-0.5 * (apart / ALIKE) ** 2)
        + np.outer(constant, constant)
    )


def _measured(curve: ResistanceCurve, ship: Ship, u: Float64) -> tuple[Float64, Float64]:
    """Return ln a of the estimate and the covariance of its error."""

    def at(values: Float64) -> Float64:
        return np.interp(u, curve.speed_m_s, values)

    r = np.maximum(at(curve.resistance_m_s2), 1e-3 * float(curve.resistance_m_s2.max()))
    sd = at(curve.sigma_repeatable_m_s2)
    slope_sd = np.maximum(at(curve.slope_sigma) * ship.froude(u), 1e-12)
    alike = np.clip(sd / slope_sd, *_ALIKE_RANGE)
    x, relative = np.log(u), sd / r
    squares = alike[:, None] ** 2 + alike**2
    # Gibbs (1997): positive definite where the length changes
    correlation = np.sqrt(2.0 * np.outer(alike, alike) / squares) * np.exp(
        -((x[:, None] - x) ** 2) / squares
    )
    error = np.outer(relative, relative) * correlation + _ROUNDING * np.eye(len(u))
    return np.log(r / (1.0 + ship.n_r(u))), error
