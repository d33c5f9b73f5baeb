# SPDX-License-Identifier: Apache-2.0
"""
Error and coverage of the final figure where the thrust after the stop is not what is thought.

The shaft runs down as exp(-t / T); the thrust follows as a power of it, is gone at once, or is
what an open-water line K_T = a - b J leaves, negative before the shaft stands. A motion of its
own, apart from the package's simulation: speed and shaft decide the thrust together. Log and
position, n samples each, white noise; the onset is dated within 5 s.

The ships and the noise are those of `_coasts`.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from benchmarks._tables import grid
from benchmarks.accuracy._coasts import (
    CARGO,
    COURSE_RAD,
    STEADY_S,
    TANKER,
    YACHT,
    Hull,
    errors,
    rms,
)
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.sections import Propulsion

ZERO_NS = 1_700_000_000_000_000_000
RUN_DOWN_S = {CARGO.name: 8.0, TANKER.name: 20.0, YACHT.name: 3.0}
SHAFT_RAD_S, SHAFT_SD = 11.5, 0.02
NO_THRUST = 0.55  # J of the steady ship over that of no thrust, of the open-water line
WINDMILLING = 0.5  # shaft speed that the water keeps up, over that under power at the speed
ONSET_S = 5.0  # the window starts within this of the stop


def _open_water(shaft: float, speed: float) -> float:
    """Return the thrust of K_T = a - b J, all over the steady one."""
    return shaft * (shaft - NO_THRUST * speed) / (1.0 - NO_THRUST)


@dataclass(frozen=True)
class Law:
    """
    How the thrust follows the shaft; all over the steady values.

    Attributes
    ----------
    thrust
        Of shaft speed and ship speed.
    windmilling
        Shaft speed that the water keeps up, over the ship's speed.
    """

    name: str
    thrust: Callable[[float, float], float]
    windmilling: float = 0.0

    @property
    def drag(self) -> float:
        """What the propeller resists in the end, over v^2 and the steady thrust."""
        return -self.thrust(self.windmilling, 1.0) if self.windmilling else 0.0


LAWS = (
    Law('n', lambda shaft, _: shaft),
    Law('n²', lambda shaft, _: shaft**2),
    Law('n³', lambda shaft, _: shaft**3),
    Law('gone at once', lambda _, __: 0.0),
    Law('n² less the wake', _open_water),
    Law('windmilling', _open_water, WINDMILLING),
)


@dataclass(frozen=True)
class Case:
    """
    What is given of the stop.

    Attributes
    ----------
    stated
        Run-down of the ship file, over the true one; None: no `propulsion`.
    """

    name: str
    steady: bool
    shaft: bool
    stated: float | None


CASES = (
    Case('steady, shaft, ship file', steady=True, shaft=True, stated=1.0),
    Case('steady, shaft', steady=True, shaft=True, stated=None),
    Case('steady, ship file', steady=True, shaft=False, stated=1.0),
    Case('steady, ship file x 2', steady=True, shaft=False, stated=2.0),
    Case('steady, ship file / 2', steady=True, shaft=False, stated=0.5),
    Case('steady', steady=True, shaft=False, stated=None),
    Case('shaft', steady=False, shaft=True, stated=1.0),
    Case('neither', steady=False, shaft=False, stated=1.0),
)


@dataclass(frozen=True)
class Motion:
    """From the stop on, in even steps."""

    time_s: Float64
    speed_m_s: Float64
    distance_m: Float64
    shaft: Float64  # over the steady one


@cache
def follow(hull: Hull, law: Law) -> Motion:
    """Integrate the coastdown by Runge-Kutta's fourth order."""
    ship, run_down_s = hull.ship, RUN_DOWN_S[hull.name]
    v0 = hull.speed_m_s
    table_m_s = np.linspace(0.0, v0, 2000)
    table = ship.resistance_n(table_m_s) / ship.mass_kg
    inertia = 1.0 + np.asarray(ship.n_r(table_m_s), np.float64)
    largest = float(table[-1])

    def shaft(t: float, v: float) -> float:
        return max(math.exp(-t / run_down_s), law.windmilling * v / v0)

    def rate(t: float, v: float) -> float:
        thrust = largest * law.thrust(shaft(t, v), v / v0)
        return float((thrust - np.interp(v, table_m_s, table)) / np.interp(v, table_m_s, inertia))

    h = run_down_s / 30.0
    time_s = np.arange(0.0, hull.duration_s + h, h)
    speed, distance = np.empty(len(time_s)), np.empty(len(time_s))
    v, x = v0, 0.0
    for i, t in enumerate(time_s):
        speed[i], distance[i] = v, x
        a = rate(t, v)
        b = rate(t + 0.5 * h, v + 0.5 * h * a)
        c = rate(t + 0.5 * h, v + 0.5 * h * b)
        d = rate(t + h, v + h * c)
        x += h * v + h * h * (a + b + c) / 6.0
        v += h * (a + 2.0 * b + 2.0 * c + d) / 6.0
    return Motion(time_s, speed, distance, np.array([shaft(t, u) for t, u in zip(time_s, speed)]))


def true_r(hull: Hull, law: Law, speed_m_s: Float64) -> Float64:
    """Return what resists the ship when the engine has stopped [m/s^2]."""
    ship, v0 = hull.ship, hull.speed_m_s
    capped = np.minimum(speed_m_s, v0)
    r = np.asarray(ship.resistance_n(capped), np.float64) / ship.mass_kg
    largest = float(ship.resistance_n(v0)) / ship.mass_kg
    return r + law.drag * largest * (speed_m_s / v0) ** 2


def record(hull: Hull, law: Law, case: Case, n: int, seed: int) -> Window:
    """Read a coastdown; cut its window."""
    rng = np.random.default_rng(seed)
    motion = follow(hull, law)
    spacing = hull.duration_s / (n - 1)
    time_s = np.arange(-STEADY_S if case.steady else 0.0, hull.duration_s, spacing)
    speed = np.interp(time_s, motion.time_s, motion.speed_m_s)
    distance = np.where(
        time_s < 0.0,
        hull.speed_m_s * time_s,
        np.interp(time_s, motion.time_s, motion.distance_m),
    )
    along = distance[:, None] * [np.cos(COURSE_RAD), np.sin(COURSE_RAD)]
    stamps = ZERO_NS + np.round(time_s * 1e9).astype(np.int64)
    blocks = [
        Block.of(
            Channel.SPEED_THROUGH_WATER, stamps, speed + hull.log_sd * rng.normal(size=len(speed))
        ),
        Block.of(
            Channel.POSITION, stamps, along + hull.position_sd * rng.normal(size=along.shape)
        ),
    ]
    late_s = float(rng.uniform(-ONSET_S, ONSET_S)) if case.steady else 0.0
    if case.shaft:
        shaft_s = np.arange(time_s[0], time_s[-1], 1.0)
        shaft = np.where(shaft_s < 0.0, 1.0, np.interp(shaft_s, motion.time_s, motion.shaft))
        value = SHAFT_RAD_S * shaft + SHAFT_SD * rng.normal(size=len(shaft))
        stamps = ZERO_NS + np.round(shaft_s * 1e9).astype(np.int64)
        blocks.append(Block.of(Channel.SHAFT, stamps, value))
    return Window.from_block(
        in_arrival_order(blocks),
        ZERO_NS + round(late_s * 1e9),
        ZERO_NS + round(hull.duration_s * 1e9),
        before_ns=ZERO_NS - round(STEADY_S * 1e9) if case.steady else None,
    )


def ship_of(hull: Hull, case: Case) -> Ship:
    """Return the ship as its file states it."""
    if case.stated is None:
        return replace(hull.ship, propulsion=None)
    run_down_s = case.stated * RUN_DOWN_S[hull.name]
    return replace(hull.ship, propulsion=Propulsion(run_down_s, 0.25 * run_down_s))


@dataclass(frozen=True)
class Score:
    """Of many coastdowns; in parts of the largest r."""

    rmse: float
    at_top: float
    covered: float
    sigma: float
    took_s: float
    failed: int


def score(hull: Hull, law: Law, case: Case, n: int, runs: int) -> Score:
    """Estimate many coastdowns and compare."""
    ship = ship_of(hull, case)
    largest = float(true_r(hull, law, np.array(hull.speed_m_s)))
    found, covered, sigmas, took = [], [], [], []
    for seed in range(runs):
        window = record(hull, law, case, n, seed)
        begin = time.perf_counter()
        try:
            curve = estimate_final(window, ship, Parameters()).valid_curve
        except EstimationError:
            continue
        took.append(time.perf_counter() - begin)
        error, sigma = errors(curve, partial(true_r, hull, law))
        found.append(error / largest)
        covered.append(np.abs(error) <= 2.0 * sigma)
        sigmas.append(sigma / largest)
    top = rms(np.array(found)[:, -1])
    cover = float(np.mean(covered))
    return Score(rms(found), top, cover, rms(sigmas), float(np.median(took)), runs - len(took))


def row(hull: Hull, case: Case, n: int, runs: int) -> list[str]:
    """Return what is given, a cell for each law, and all of them together."""
    found = [score(hull, law, case, n, runs) for law in LAWS]
    whole, cover = rms([each.rmse for each in found]), np.mean([each.covered for each in found])
    return [
        case.name,
        *(
            f'{100 * each.rmse:.2f} / {100 * each.at_top:.1f} / {100 * each.covered:.0f}'
            for each in found
        ),
        f'{100 * whole:.2f} / {100 * cover:.0f}',
        f'{100 * rms([each.sigma for each in found]):.2f}',
        f'{1e3 * np.median([each.took_s for each in found]):.1f}',
        f'{sum(each.failed for each in found)}',
    ]


def main() -> None:
    """
    Print a table for each ship.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=40, help='coastdowns of each case')
    parser.add_argument('-n', type=int, default=500, help='samples of log and position each')
    options = parser.parse_args()
    for hull in (CARGO, TANKER, YACHT):
        grid(
            f'{hull.name}: shaft runs down in {RUN_DOWN_S[hull.name]:g} s; n = {options.n}, '
            f'N = {options.runs}, seeds 0..{options.runs - 1}; RMSE / at top / cover %',
            ['given', *(law.name for law in LAWS), 'all', 'sigma', 'ms', 'failed'],
            [row(hull, case, options.n, options.runs) for case in CASES],
            width=190,
        )
    print(
        'RMSE over the valid range, evenly in speed, in % of the largest r; sigma: the stated '
        'one, rms.\ncover: share of the range where +-2 sigma (repeatable) holds the truth.'
    )


if __name__ == '__main__':
    main()
