# SPDX-License-Identifier: Apache-2.0
"""Simulated coastdowns and errors of r(v), for the benchmarks of the estimator."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.result import Estimate, ResistanceCurve
from shipdrag_ros.samples import Channel, Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS, Scenario, Sensor, Truth, sense, simulate

COURSE_RAD = 0.7


def coast(ship: Ship, *, speed_m_s: float, duration_s: float, run_down: bool = False) -> Truth:
    """
    Simulate a coastdown from the engine stop on.

    The thrust ends at once, as S1 has it, unless `run_down`.
    """
    if not run_down:
        ship = replace(ship, propulsion=None)
    scenario = Scenario(
        speed_m_s=speed_m_s, lead_in_s=0.0, duration_s=duration_s, heading_rad=COURSE_RAD
    )
    return simulate(ship, scenario)


def read(
    truth: Truth, n: int, *, seed: int, speed_sd: float = 0.05, position_sd: float = 10.0
) -> Window:
    """
    Read a coastdown with n samples of log and position each.
    """
    length_s = truth.time_s[-1]
    # a trifle more, so that the last sample is not lost to rounding
    rate_hz = (n - 1 + 1e-6) / length_s
    sensors = [
        Sensor(channel=Channel.SPEED_THROUGH_WATER, rate_hz=rate_hz, sd=speed_sd),
        Sensor(channel=Channel.POSITION, rate_hz=rate_hz, sd=position_sd),
    ]
    block = sense(truth, sensors, seed=seed)
    return Window.from_block(block, START_NS, START_NS + round(length_s * 1e9))


@dataclass(frozen=True)
class Errors:
    """
    Error of r(v) over the valid range of one estimate, evenly in speed.

    Attributes
    ----------
    rmse, at_top
        In parts of the true max r at the start of the coastdown.
    covered
        Share of the range where +-2 sigma (repeatable) holds the truth.
    """

    rmse: float
    at_top: float
    covered: float


def errors(found: Estimate, truth: Truth) -> Errors:
    """
    Compare an estimate with the resistance that was simulated.
    """
    curve = found.valid_curve
    error, sigma = _evenly(
        curve, curve.resistance_m_s2 - truth.specific_resistance(curve.speed_m_s)
    )
    largest = float(truth.specific_resistance(truth.speed_through_water_m_s[0]))
    return Errors(
        float(np.sqrt(np.mean(error**2))) / largest,
        float(error[-1]) / largest,
        float(np.mean(np.abs(error) <= 2.0 * sigma)),
    )


def _evenly(curve: ResistanceCurve, error: Float64) -> tuple[Float64, Float64]:
    speeds = np.linspace(curve.speed_m_s[0], curve.speed_m_s[-1], 200)
    return (
        np.interp(speeds, curve.speed_m_s, error),
        np.interp(speeds, curve.speed_m_s, curve.sigma_repeatable_m_s2),
    )
