# SPDX-License-Identifier: Apache-2.0
"""Simulated coastdowns and errors of r(v), for the benchmarks of the estimator."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.optimize import nnls

from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.result import Estimate, ResistanceCurve
from shipdrag_ros.samples import Channel, Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.baseline import TableBaseline
from shipdrag_ros.ship.sections import Propulsion
from shipdrag_ros.simulation import (
    START_NS,
    GaussMarkov,
    Scenario,
    Sensor,
    Truth,
    sense,
    simulate,
)

CONFIG = Path(__file__).parents[2] / 'config'
COURSE_RAD = 0.7
STEADY_S = 1800.0
COLOUR_S = 60.0
GUST_S = 300.0
IN_FAMILY = (1, 2, 4)
POINTS = 200  # of a comparison, evenly in speed


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


@dataclass(frozen=True)
class Hull:
    """
    A ship, its coastdown and its sensors.

    Attributes
    ----------
    in_family
        Its resistance is a sum of the powers `IN_FAMILY` of the speed, fitted
        to that of the ship file.
    """

    name: str
    file: str
    speed_m_s: float
    duration_s: float
    log_sd: float
    position_sd: float
    in_family: bool = False

    @cached_property
    def ship(self) -> Ship:
        """As its file says, or with the resistance of the family."""
        ship = Ship.load(CONFIG / self.file)
        if not self.in_family:
            return ship
        speeds = np.linspace(0.0, 1.2 * self.speed_m_s, 400)
        columns = speeds[:, None] ** np.array(IN_FAMILY)
        coefficients, _ = nnls(columns, ship.resistance_n(speeds))
        table = TableBaseline(tuple(speeds), tuple(columns @ coefficients), relative_sd=0.02)
        return replace(ship, baseline=table, air=None)


CARGO = Hull('cargo ship', 'vitus_bering.yaml', 8.2, 1500.0, 0.05, 10.0)
TANKER = Hull('tanker', 'kvlcc2.yaml', 7.9, 3600.0, 0.05, 10.0)
YACHT = Hull('yacht', 'yacht.yaml', 3.0, 150.0, 0.02, 2.0)
FAMILY = replace(CARGO, name='cargo ship of v, v², v⁴', in_family=True)


@dataclass(frozen=True)
class Case:
    """
    What disturbs a coastdown.

    Attributes
    ----------
    steady
        The steady record before the stop is given.
    run_down
        The thrust runs down, and the shaft is read; else it ends at once.
    current_m_s
        Along the track.
    colour_m_s
        Slow noise of the log, correlated over `COLOUR_S`.
    gust_m_s
        Slow force, by the speed that it makes of the steady ship, correlated
        over `GUST_S`.
    outliers
        Share of log readings that are wrong by 1/8 to 3/8 of the speed at the
        start.
    gap
        Nothing is read for a tenth of the coastdown, early.
    """

    name: str
    steady: bool = False
    run_down: bool = False
    current_m_s: float = 0.0
    colour_m_s: float = 0.0
    gust_m_s: float = 0.0
    outliers: float = 0.0
    gap: bool = False


@dataclass(frozen=True)
class Coast:
    """
    One coastdown and what was read of it.
    """

    truth: Truth
    window: Window

    @cached_property
    def speeds(self) -> Float64:
        """From the speed at the end, or Froude number 0.05, to that at the stop."""
        truth = self.truth
        at_stop = np.interp(truth.scenario.lead_in_s, truth.time_s, truth.speed_through_water_m_s)
        low = max(float(truth.speed_through_water_m_s[-1]), float(truth.ship.speed(0.05)))
        return np.linspace(low, float(at_stop), POINTS)

    def resists(self, speed_m_s: Float64) -> Float64:
        """
        Return the true r, the still air over the ground included.
        """
        truth = self.truth
        along = float(np.dot(truth.scenario.current_m_s, [np.cos(COURSE_RAD), np.sin(COURSE_RAD)]))
        air = truth.ship.air_drag_n
        wind = air(speed_m_s + along) - air(speed_m_s)
        return truth.specific_resistance(speed_m_s) + wind / truth.ship.mass_kg


def coasts(hull: Hull, case: Case, n: int, runs: int) -> Iterator[Coast]:
    """
    Simulate coastdowns with n samples of log and position each; seeds from 0.
    """
    truth = None
    for seed in range(runs):
        if truth is None or case.gust_m_s:
            truth = _truth(hull, case, seed)
        yield Coast(truth, _read(truth, hull, case, n, seed))


def gust_m_s2(hull: Hull, case: Case) -> float:
    """
    Return the force per mass that moves the steady ship by `gust_m_s`.
    """
    ship, v = hull.ship, hull.speed_m_s
    inertia = 1.0 + float(ship.n_r(v))
    low, high = (float(ship.resistance_n(v * part)) / ship.mass_kg for part in (0.99, 1.01))
    damping = (high - low) / (0.02 * v) / inertia
    return case.gust_m_s * inertia * float(np.sqrt(damping * (damping + 1.0 / GUST_S)))


def _truth(hull: Hull, case: Case, seed: int) -> Truth:
    ship = hull.ship
    if not case.run_down:
        ship = replace(ship, propulsion=None)
    elif ship.propulsion is None:
        ship = replace(ship, propulsion=Propulsion(run_down_s=3.0, sd=1.0))
    gust_n = gust_m_s2(hull, case) * ship.mass_kg
    scenario = Scenario(
        speed_m_s=hull.speed_m_s,
        lead_in_s=STEADY_S if case.steady else 0.0,
        duration_s=hull.duration_s,
        heading_rad=COURSE_RAD,
        current_m_s=(
            case.current_m_s * np.cos(COURSE_RAD),
            case.current_m_s * np.sin(COURSE_RAD),
        ),
        gust_force=GaussMarkov(gust_n, GUST_S) if gust_n else None,
        seed=seed,
    )
    return simulate(ship, scenario)


def _read(truth: Truth, hull: Hull, case: Case, n: int, seed: int) -> Window:
    # a trifle more, so that the last sample is not lost to rounding
    rate_hz = (n - 1 + 1e-6) / hull.duration_s
    start_s = truth.scenario.lead_in_s
    gap = (start_s + 0.1 * hull.duration_s, start_s + 0.2 * hull.duration_s)
    gaps = (gap,) if case.gap else ()
    log = Sensor(
        channel=Channel.SPEED_THROUGH_WATER,
        rate_hz=rate_hz,
        sd=hull.log_sd,
        coloured=GaussMarkov(case.colour_m_s, COLOUR_S) if case.colour_m_s else None,
        outlier_fraction=case.outliers,
        outlier_size=0.25 * hull.speed_m_s,
        gaps_s=gaps,
    )
    position = Sensor(channel=Channel.POSITION, rate_hz=rate_hz, sd=hull.position_sd, gaps_s=gaps)
    shaft = Sensor(channel=Channel.SHAFT, rate_hz=max(rate_hz, 0.5), sd=0.02)
    block = sense(truth, (log, position, shaft) if case.run_down else (log, position), seed=seed)
    start_ns = START_NS + round(start_s * 1e9)
    return Window.from_block(
        block,
        start_ns,
        start_ns + round(hull.duration_s * 1e9),
        before_ns=START_NS if case.steady else None,
    )
