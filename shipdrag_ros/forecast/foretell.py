# SPDX-License-Identifier: Apache-2.0
"""
From an estimate to the rest of the glide: the posterior predictive, linearised about its median.

With the speed in place of the time, t(u) = integral du / a(u), and all that disturbs it is
linear: an error e of ln a, or a gust of -e a, shifts the time at which she has a speed by the
integral of -e dt, and the way by that of -e (u + c) dt. So one covariance of e along the glide
gives every band. No random numbers.
"""

from __future__ import annotations

import math

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.forecast.law import deceleration
from shipdrag_ros.forecast.result import Forecast, Z
from shipdrag_ros.parameters import SPEEDS_M_S
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

FRACTIONS = (0.9, 0.75, 0.5, 0.25)
"""Of the speed at the stop, that are always spoken of."""
# sizes of what disturbs a glide, as the priors of the noise have them (`inference/learning.py`)
GUST = 0.04
"""Standard deviation of a gust, of the deceleration at the stop."""
GUST_TIMES = 18.0
"""Correlation time of a gust, over the root of the damping [1/s]."""
DRIFT_M_S, DRIFT_SPEED_M_S, DRIFT_S = 0.02, 5.0, 600.0
"""Slow motion of the water, less of it for craft below that speed, and its correlation time."""
CURRENT_M_S = 0.4
"""Standard deviation of a current that no input shows."""
READING, READING_WHITE = 1e-3, 0.3
"""Slow error of the instrument: of the speed at the stop, or of its white noise."""
_NODES = 64  # of the glide, evenly in ln u
_BEYOND = 0.5  # of the lowest speed that is spoken of, until which is foretold
_WIDEST = 10.0  # of the logarithm of a figure, on either side


def foretell(
    estimate: Estimate,
    ship: Ship,
    *,
    froude_min: float = 0.0,
    speeds_m_s: tuple[float, ...] = SPEEDS_M_S,
) -> Forecast:
    """
    Foretell the rest of a glide.

    Parameters
    ----------
    estimate
        Of the glide so far, of any estimator.
    ship
        For n_r and the hull.
    froude_min
        At which a coastdown ends; 0: not spoken of.
    speeds_m_s
        Spoken of besides `FRACTIONS` of the speed at the stop.

    Returns
    -------
    Forecast
        Of times and distances to the lower speeds, from the last reading on. Distances are over
        ground where positions were used.

    Raises
    ------
    EstimationError
        If she is slower already than all of these speeds.

    Notes
    -----
    By law and gusts, times and distances are log-normal: a weak deceleration delays more than a
    strong one hastens.
    """
    now, stop = estimate.last_speed_m_s, float(estimate.curve.speed_m_s[-1])
    wanted = {*(part * stop for part in FRACTIONS), *speeds_m_s, float(ship.speed(froude_min))}
    targets = tuple(sorted((u for u in wanted if 0.0 < u < now), reverse=True))
    if not targets:
        raise EstimationError(
            f'nothing is left to foretell: at {now:.3g} m/s she is slower than '
            f'{FRACTIONS[-1]:.0%} of {stop:.3g} m/s and than {", ".join(map(str, speeds_m_s))} '
            'm/s: give a lower speed in forecast_speeds'
        )
    u = np.exp(np.linspace(math.log(now), math.log(_BEYOND * targets[-1]), _NODES))
    found = deceleration(estimate, ship, np.append(u, stop))
    a = np.exp(found.log_m_s2)
    weights = _weights(u, a[:-1])
    time = weights.sum(axis=1)
    covariance = found.covariance[:-1, :-1] + _gusts(u, a, time)
    over_ground = 'position' in estimate.samples
    current = (estimate.current_m_s or 0.0) if over_ground else 0.0
    ground = u + current
    way = (weights * ground).sum(axis=1)
    by_way = weights * ground
    # what is wrong with the present speed, and with the reading that will show a lower one
    late = (estimate.last_speed_sigma_m_s / a[0]) ** 2
    reading = (_reading_sd(estimate, stop) / a[:-1]) ** 2
    drift = _drift(estimate, stop, time) if over_ground else np.zeros(_NODES)
    times = _bands(time, _variance(weights, covariance), late + reading)
    ways = _bands(
        way,
        _variance(by_way, covariance),
        late * ground[0] ** 2 + reading * ground**2 + drift,
    )
    return Forecast(
        estimate.end_ns,
        stop,
        u,
        times,
        ways,
        estimate.last_speed_sigma_m_s,
        current,
        np.sqrt(drift),
        targets,
        over_ground,
    )


def _weights(u: Float64, a: Float64) -> Float64:
    """Return (n, n) times that she spends about each speed until each of them."""
    step = np.diff(-np.log(u))
    each = u / a
    weights = np.zeros((len(u), len(u)))
    for i in range(1, len(u)):
        weights[i:, i - 1] += 0.5 * step[i - 1] * each[i - 1]
        weights[i:, i] += 0.5 * step[i - 1] * each[i]
    return weights


def _variance(weights: Float64, covariance: Float64) -> Float64:
    return np.asarray(((weights @ covariance) * weights).sum(axis=1))


def _gusts(u: Float64, a: Float64, time: Float64) -> Float64:
    """Return the covariance of a Gauss-Markov force, in parts of the deceleration."""
    size = GUST * a[-1] / a[:-1]
    damping = 2.0 * a[0] / u[0]
    length = GUST_TIMES / math.sqrt(damping)
    return np.asarray(np.outer(size, size) * np.exp(-np.abs(time[:, None] - time) / length))


def _drift(estimate: Estimate, stop: float, time: Float64) -> Float64:
    """Return the variance of the way that the water makes."""
    size = DRIFT_M_S * min(1.0, stop / DRIFT_SPEED_M_S)
    ratio = time / DRIFT_S
    slow = 2.0 * (size * DRIFT_S) ** 2 * (ratio + np.expm1(-ratio))
    sd = estimate.current_sigma_m_s or 0.0
    return np.asarray(slow + (sd * time) ** 2)


def _reading_sd(estimate: Estimate, stop: float) -> float:
    speeds = [sd for name, sd in estimate.noise_sd.items() if name.startswith('speed')]
    white = min((sd for sd in speeds if math.isfinite(sd)), default=0.0)
    return max(READING * stop, READING_WHITE * white)


def _bands(median: Float64, scaled: Float64, added: Float64) -> Float64:
    """
    Return median, low and high (n, 3).

    A variance is of what scales a figure, which is then log-normal, or is added to it.
    """
    spread = Z * np.sqrt(scaled) / np.maximum(median, 1e-12)
    spread = np.minimum(spread, _WIDEST)
    beside = Z * np.sqrt(added)
    low = median - np.hypot(median * -np.expm1(-spread), beside)
    high = median + np.hypot(median * np.expm1(spread), beside)
    # a lower speed comes later, and farther on
    bands = np.column_stack([median, np.maximum(low, 0.0), high])
    return np.asarray(np.maximum.accumulate(bands, axis=0))
