# SPDX-License-Identifier: Apache-2.0
"""
Error and coverage of the final figure on simulated coastdowns.

On three hulls, n samples of log and position each; disturbances of 300 s are learnt from
1800 s of steady record, never given.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate
from shipdrag_ros.estimation.estimators import named
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Channel, Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS, Scenario, Sensor, Truth, sense, simulate
from shipdrag_ros.simulation.scenario import GaussMarkov

CONFIG = Path(__file__).parents[2] / 'config'
COURSE_RAD = 0.7
STEADY_S = 1800.0
SLOW_S = 300.0


@dataclass(frozen=True)
class Hull:
    """A ship, its coastdown and its sensors."""

    file: str
    speed_m_s: float
    duration_s: float
    speed_sd: float
    position_sd: float


CARGO = Hull('vitus_bering.yaml', 8.2, 1500.0, 0.05, 10.0)
TANKER = Hull('kvlcc2.yaml', 7.9, 3600.0, 0.05, 10.0)
YACHT = Hull('yacht.yaml', 3.0, 150.0, 0.02, 2.0)


@dataclass(frozen=True)
class Case:
    """What is simulated; disturbances by their effect on the speed [m/s]."""

    name: str
    hull: Hull = CARGO
    n: int = 500
    steady: bool = False
    shaft: bool = False
    current_m_s: float = 0.0
    log_m_s: float = 0.0
    gust_m_s: float = 0.0
    outliers: float = 0.0

    @property
    def lead_in_s(self) -> float:
        return STEADY_S if self.steady else 0.0


CASES = (
    Case('white noise'),
    Case('n = 100', n=100),
    Case('n = 2000', n=2000),
    Case('tanker', hull=TANKER),
    Case('yacht with a hump', hull=YACHT),
    Case('current 0.25 m/s', current_m_s=0.25),
    Case('3 % outliers', outliers=0.03),
    Case('steady record', steady=True),
    Case('steady record, shaft', steady=True, shaft=True),
    Case('the log wanders 0.05 m/s', steady=True, log_m_s=0.05),
    Case('the same, shaft', steady=True, shaft=True, log_m_s=0.05),
    Case('gusts of 0.05 m/s', steady=True, gust_m_s=0.05),
    Case('the same, shaft', steady=True, shaft=True, gust_m_s=0.05),
)


def ship_of(case: Case) -> Ship:
    """Return the ship; its thrust ends at once where there is no shaft to see it."""
    ship = Ship.load(CONFIG / case.hull.file)
    return ship if case.shaft else replace(ship, propulsion=None)


def gust_m_s2(case: Case, ship: Ship) -> float:
    """Return the force per mass that moves the steady ship by `gust_m_s`."""
    v = case.hull.speed_m_s
    inertia = 1.0 + float(ship.n_r(v))
    low, high = (float(ship.resistance_n(v * f)) / ship.mass_kg for f in (0.99, 1.01))
    damping = (high - low) / (0.02 * v) / inertia
    return case.gust_m_s * inertia * float(np.sqrt(damping * (damping + 1.0 / SLOW_S)))


def coast(case: Case, ship: Ship, seed: int, *, noise: float = 1.0) -> tuple[Truth, Window]:
    """Simulate one record; cut the window of its coastdown."""
    hull = case.hull
    gust = noise * gust_m_s2(case, ship) * ship.mass_kg
    truth = simulate(
        ship,
        Scenario(
            speed_m_s=hull.speed_m_s,
            lead_in_s=case.lead_in_s,
            duration_s=hull.duration_s,
            heading_rad=COURSE_RAD,
            current_m_s=(
                case.current_m_s * np.cos(COURSE_RAD),
                case.current_m_s * np.sin(COURSE_RAD),
            ),
            gust_force=GaussMarkov(gust, SLOW_S) if gust else None,
            seed=seed,
        ),
    )
    # a trifle more, so that the last sample is not lost to rounding
    rate_hz = (case.n - 1 + 1e-6) / hull.duration_s
    wander = noise * case.log_m_s
    sensors = [
        Sensor(
            channel=Channel.SPEED_THROUGH_WATER,
            rate_hz=rate_hz,
            sd=noise * hull.speed_sd,
            coloured=GaussMarkov(wander, SLOW_S) if wander else None,
            outlier_fraction=noise * case.outliers,
            outlier_size=2.0,
        ),
        Sensor(channel=Channel.POSITION, rate_hz=rate_hz, sd=noise * hull.position_sd),
    ]
    if case.shaft:
        sensors.append(Sensor(channel=Channel.SHAFT, rate_hz=max(rate_hz, 0.5), sd=0.02))
    start_ns = START_NS + round(case.lead_in_s * 1e9)
    window = Window.from_block(
        sense(truth, sensors, seed=seed),
        start_ns,
        start_ns + round(hull.duration_s * 1e9),
        before_ns=START_NS if case.steady else None,
    )
    return truth, window


def true_r(case: Case, ship: Ship, speed_m_s: Float64) -> Float64:
    """Return what resists, the still air over the ground included."""
    v = np.minimum(speed_m_s, ship.baseline_range_m_s[1])
    wind = ship.air_drag_n(v + case.current_m_s) - ship.air_drag_n(v)
    result: Float64 = (ship.resistance_n(v) + wind) / ship.mass_kg
    return result


def without_baseline(method: Callable[..., Estimate]) -> Callable[..., Estimate]:
    """Return an estimator that is not shown the baseline of the ship file."""

    def bare(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
        return method(window, replace(ship, baseline=None), parameters)

    return bare


def row(case: Case, runs: int, method: Callable[..., Estimate]) -> list[str]:
    """Run one case; return the cells of its row."""
    ship = ship_of(case)
    largest = float(true_r(case, ship, np.array(case.hull.speed_m_s)))
    errors, covered, took, failed = [], [], [], 0
    for seed in track(range(runs), description=case.name, console=Console(stderr=True)):
        _, window = coast(case, ship, seed)
        begin = time.perf_counter()
        try:
            curve = method(window, ship, Parameters()).valid_curve
        except EstimationError:
            failed += 1
            continue
        took.append(time.perf_counter() - begin)
        speeds = np.linspace(curve.speed_m_s[0], curve.speed_m_s[-1], 200)
        r = np.interp(speeds, curve.speed_m_s, curve.resistance_m_s2)
        sigma = np.interp(speeds, curve.speed_m_s, curve.sigma_repeatable_m_s2)
        error = r - true_r(case, ship, speeds)
        errors.append(error / largest)
        covered.append(np.abs(error) <= 2.0 * sigma)
    error = np.array(errors)
    bias = error.mean(axis=0)
    return [
        case.name,
        f'{case.n}',
        f'{100 * np.sqrt(np.mean(error**2)):.2f}',
        f'{100 * np.sqrt(np.mean(bias**2)):.2f}',
        f'{100 * np.sqrt(np.mean((error - bias) ** 2)):.2f}',
        f'{100 * np.sqrt(np.mean(error[:, -1] ** 2)):.1f}',
        f'{100 * bias[-1]:+.1f}',
        f'{100 * np.sqrt(np.mean(error[:, 0] ** 2)):.2f}',
        f'{100 * np.mean(covered):.0f}',
        f'{1e3 * np.median(took):.1f}',
        f'{failed}',
    ]


def main() -> None:
    """
    Print the table.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=200, help='coastdowns of each case')
    parser.add_argument(
        '--live', action='store_true', help='the estimator during the coastdown instead'
    )
    parser.add_argument('--estimator', default='one', help='the parameter of that name')
    parser.add_argument(
        '--no-baseline', action='store_true', help='the ship file states length and volume alone'
    )
    options = parser.parse_args()
    runs = options.runs
    table = Table(
        title=f'Final figure on simulated coastdowns, N = {runs}, seeds 0..{runs - 1}; '
        'in % of the largest r'
    )
    table.add_column('case')
    for heading in (
        'n',
        'RMSE',
        'bias',
        'spread',
        'at top',
        'bias',
        'at bottom',
        'cover %',
        'ms',
        'failed',
    ):
        table.add_column(heading, justify='right')
    method = estimate if options.live else named(options.estimator).estimate
    if options.no_baseline:
        method = without_baseline(method)
    for case in CASES:
        table.add_row(*row(case, runs, method))
    Console(width=140).print(table)
    print(
        'RMSE over the valid range, evenly in speed; at top, at bottom: at its ends. cover: share '
        'of the range\nwhere +-2 sigma (repeatable) holds the truth. bound: Cramer-Rao, of '
        'v .. v^4 with the noise known.'
    )


if __name__ == '__main__':
    main()
