# SPDX-License-Identifier: Apache-2.0
"""Simulated coastdowns and errors of r(v), for the benchmarks of the estimator."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from benchmarks import ROOT
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.result import Estimate, ResistanceCurve
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import (
    START_NS,
    GaussMarkov,
    Scenario,
    Sensor,
    Truth,
    sense,
    simulate,
)

CONFIG = ROOT / 'config'
COURSE_RAD = 0.7
STEADY_S = 1800.0
SLOW_S = 300.0  # correlation time of gusts and of the log's slow noise
POINTS = 200  # of a comparison, evenly in speed


@dataclass(frozen=True)
class Hull:
    """A ship, its coastdown and its sensors."""

    name: str
    file: str
    speed_m_s: float
    duration_s: float
    log_sd: float
    position_sd: float

    @cached_property
    def ship(self) -> Ship:
        """As its file says."""
        return Ship.load(CONFIG / self.file)


CARGO = Hull('cargo ship', 'vitus_bering.yaml', 8.2, 1500.0, 0.05, 10.0)
TANKER = Hull('tanker', 'kvlcc2.yaml', 7.9, 3600.0, 0.05, 10.0)
YACHT = Hull('yacht', 'yacht.yaml', 3.0, 150.0, 0.02, 2.0)


@dataclass(frozen=True)
class Case:
    """
    What disturbs a coastdown, and what is read of it.

    Attributes
    ----------
    n
        Samples of log and position each.
    steady
        The steady record before the stop is given.
    run_down
        The thrust runs down; else it ends at once.
    shaft
        It runs down, and the shaft is read.
    current_m_s
        Along the track.
    log_m_s
        Slow noise of the log.
    gust_m_s
        Slow force, by the speed that it makes of the steady ship.
    outliers
        Share of log readings that are wrong.
    """

    name: str = ''
    hull: Hull = CARGO
    n: int = 500
    steady: bool = False
    run_down: bool = False
    shaft: bool = False
    current_m_s: float = 0.0
    log_m_s: float = 0.0
    gust_m_s: float = 0.0
    outliers: float = 0.0

    @property
    def lead_in_s(self) -> float:
        """Of the steady record."""
        return STEADY_S if self.steady else 0.0


@dataclass(frozen=True)
class Coast:
    """One coastdown and what was read of it."""

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
        """Return the true r, the still air over the ground included."""
        ship, course = self.truth.ship, [np.cos(COURSE_RAD), np.sin(COURSE_RAD)]
        along = float(np.dot(self.truth.scenario.current_m_s, course))
        v = np.minimum(speed_m_s, ship.baseline_range_m_s[1])
        wind = ship.air_drag_n(v + along) - ship.air_drag_n(v)
        return np.asarray((ship.resistance_n(v) + wind) / ship.mass_kg)


def coasts(case: Case, runs: int) -> Iterator[Coast]:
    """Simulate coastdowns; seeds from 0."""
    truth = None
    for seed in range(runs):
        if truth is None or case.gust_m_s:
            truth = voyage(case, seed)
        yield Coast(truth, read(truth, case, seed))


def gust_m_s2(case: Case) -> float:
    """Return the force per mass that moves the steady ship by `gust_m_s`."""
    ship, v = case.hull.ship, case.hull.speed_m_s
    inertia = 1.0 + float(ship.n_r(v))
    low, high = (float(ship.resistance_n(v * part)) / ship.mass_kg for part in (0.99, 1.01))
    damping = (high - low) / (0.02 * v) / inertia
    return case.gust_m_s * inertia * float(np.sqrt(damping * (damping + 1.0 / SLOW_S)))


def voyage(case: Case, seed: int = 0) -> Truth:
    """Simulate one run."""
    ship = case.hull.ship
    if not (case.run_down or case.shaft):
        ship = replace(ship, propulsion=None)
    gust_n = gust_m_s2(case) * ship.mass_kg
    scenario = Scenario(
        speed_m_s=case.hull.speed_m_s,
        lead_in_s=case.lead_in_s,
        duration_s=case.hull.duration_s,
        heading_rad=COURSE_RAD,
        current_m_s=(
            case.current_m_s * np.cos(COURSE_RAD),
            case.current_m_s * np.sin(COURSE_RAD),
        ),
        gust_force=GaussMarkov(gust_n, SLOW_S) if gust_n else None,
        seed=seed,
    )
    return simulate(ship, scenario)


def read(truth: Truth, case: Case, seed: int) -> Window:
    """Read a run; cut the window of its coastdown."""
    hull = case.hull
    # a trifle more, so that the last sample is not lost to rounding
    rate_hz = (case.n - 1 + 1e-6) / hull.duration_s
    log = Sensor(
        channel=Channel.SPEED_THROUGH_WATER,
        rate_hz=rate_hz,
        sd=hull.log_sd,
        coloured=GaussMarkov(case.log_m_s, SLOW_S) if case.log_m_s else None,
        outlier_fraction=case.outliers,
        outlier_size=2.0,
    )
    position = Sensor(channel=Channel.POSITION, rate_hz=rate_hz, sd=hull.position_sd)
    shaft = Sensor(channel=Channel.SHAFT, rate_hz=max(rate_hz, 0.5), sd=0.02)
    block = sense(truth, (log, position, shaft)[: 3 if case.shaft else 2], seed=seed)
    return cut(block, case.lead_in_s, hull.duration_s)


def cut(block: Block, lead_in_s: float, duration_s: float) -> Window:
    """
    Return the window of a simulated coastdown, with the record before it where there is one.
    """
    start_ns = START_NS + round(lead_in_s * 1e9)
    before_ns = START_NS if lead_in_s else None
    return Window.from_block(
        block, start_ns, start_ns + round(duration_s * 1e9), before_ns=before_ns
    )


def errors(
    curve: ResistanceCurve, resists: Callable[[Float64], Float64]
) -> tuple[Float64, Float64]:
    """
    Return error and sigma (repeatable) of a curve, evenly over its speeds.
    """
    speeds = np.linspace(curve.speed_m_s[0], curve.speed_m_s[-1], POINTS)
    r, sigma = (
        np.interp(speeds, curve.speed_m_s, each)
        for each in (curve.resistance_m_s2, curve.sigma_repeatable_m_s2)
    )
    return r - resists(speeds), sigma


@dataclass
class Compared:
    """
    Estimates of many coastdowns beside the truth, in parts of the largest r.

    Attributes
    ----------
    error, sigma : (n, POINTS)
        Evenly over the speeds of each.
    took_s
    failed
    """

    error: Float64
    sigma: Float64
    took_s: list[float]
    failed: int

    @classmethod
    def of(
        cls,
        method: Callable[..., Estimate],
        largest: float,
        coasts: Iterable[tuple[Window, Ship, Callable[[Float64], Float64]]],
    ) -> Compared:
        """
        Estimate each coastdown, given with the ship as she is stated and the true r.
        """
        found, took, failed = [], [], 0
        for window, ship, resists in coasts:
            begin = time.perf_counter()
            try:
                curve = method(window, ship, Parameters()).valid_curve
            except EstimationError:
                failed += 1
                continue
            took.append(time.perf_counter() - begin)
            found.append(errors(curve, resists))
        error, sigma = np.array(found).transpose(1, 0, 2) / largest
        return cls(error, sigma, took, failed)

    @property
    def rmse(self) -> float:
        """Over all speeds."""
        return rms(self.error)

    @property
    def covered(self) -> float:
        """Share of the speeds at which two sigma hold the truth."""
        return float(np.mean(np.abs(self.error) <= 2.0 * self.sigma))


def rms(values: object) -> float:
    """
    Return the root mean square.
    """
    return float(np.sqrt(np.mean(np.square(values))))
