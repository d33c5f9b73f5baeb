# SPDX-License-Identifier: Apache-2.0
"""
Coastdowns where the thrust after the stop is not what is thought.

The shaft runs down as exp(-t / T); the thrust follows as a power of it, is gone at once, or is
what an open-water line K_T = a - b J leaves, negative before the shaft stands. A motion of its
own, apart from the package's simulation: speed and shaft decide the thrust together. Log and
position, n samples each, white noise; the onset is dated within 5 s.

The ships and the noise are those of `_coasts`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from benchmarks.accuracy._coasts import CARGO, COURSE_RAD, STEADY_S, YACHT, Compared, Hull
from shipdrag_ros.estimation import Window, estimate_final
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.sections import Propulsion

ZERO_NS = 1_700_000_000_000_000_000
RUN_DOWN_S = {CARGO.name: 8.0, YACHT.name: 3.0}
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

    thrust: Callable[[float, float], float]
    windmilling: float = 0.0

    @property
    def drag(self) -> float:
        """What the propeller resists in the end, over v^2 and the steady thrust."""
        return -self.thrust(self.windmilling, 1.0) if self.windmilling else 0.0


LAWS = (
    Law(lambda shaft, _: shaft),
    Law(lambda shaft, _: shaft**2),
    Law(lambda shaft, _: shaft**3),
    Law(lambda _, __: 0.0),  # gone at once
    Law(_open_water),  # less the wake
    Law(_open_water, WINDMILLING),
)


class Case(NamedTuple):
    """Of the stop: whether the shaft is read; run-down of the ship file, over the true one."""

    shaft: bool
    stated: float


CASES = (Case(True, 1.0), Case(False, 1.0), Case(False, 2.0))


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
    time_s = np.arange(-STEADY_S, hull.duration_s, spacing)
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
    late_s = float(rng.uniform(-ONSET_S, ONSET_S))
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
        before_ns=ZERO_NS - round(STEADY_S * 1e9),
    )


def ship_of(hull: Hull, case: Case) -> Ship:
    """Return the ship as its file states it."""
    run_down_s = case.stated * RUN_DOWN_S[hull.name]
    return replace(hull.ship, propulsion=Propulsion(run_down_s, 0.25 * run_down_s))


def score(hull: Hull, law: Law, case: Case, n: int, runs: int) -> Compared:
    """Estimate many coastdowns and compare."""
    ship, resists = ship_of(hull, case), partial(true_r, hull, law)
    seen = ((record(hull, law, case, n, seed), ship, resists) for seed in range(runs))
    return Compared.of(estimate_final, float(resists(np.array(hull.speed_m_s))), seen)
