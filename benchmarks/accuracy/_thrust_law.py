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

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

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


@cache
def follow(hull: Hull, law: Law) -> tuple[Float64, Float64, Float64, Float64]:
    """Return time, speed, distance, and the shaft over the steady one, from the stop on."""
    ship, v0 = hull.ship, hull.speed_m_s
    table_m_s = np.linspace(0.0, v0, 2000)
    table = ship.resistance_n(table_m_s) / ship.mass_kg
    inertia = 1.0 + np.asarray(ship.n_r(table_m_s), np.float64)

    def shaft(t: Float64, v: Float64) -> Float64:
        return np.maximum(np.exp(-t / RUN_DOWN_S[hull.name]), law.windmilling * v / v0)

    def rate(t: Float64, state: Float64) -> tuple[Float64, Float64]:
        v = state[0]
        push = table[-1] * law.thrust(shaft(t, v), v / v0) - np.interp(v, table_m_s, table)
        return push / np.interp(v, table_m_s, inertia), v

    span_s = 0.0, hull.duration_s
    time_s = np.linspace(*span_s, 5000)
    speed, distance = solve_ivp(rate, span_s, (v0, 0.0), t_eval=time_s, rtol=1e-8, atol=1e-8).y
    return time_s, speed, distance, shaft(time_s, speed)


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
    after_s, speed, distance, shaft = follow(hull, law)
    time_s = np.arange(-STEADY_S, hull.duration_s, hull.duration_s / (n - 1))
    speed = np.interp(time_s, after_s, speed)
    before = np.minimum(time_s, 0.0) * hull.speed_m_s
    distance = before + np.interp(time_s, after_s, distance)
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
        value = SHAFT_RAD_S * np.interp(shaft_s, after_s, shaft)
        value += SHAFT_SD * rng.normal(size=len(value))
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
