# SPDX-License-Identifier: Apache-2.0
"""One run as it will be sailed: hull, propeller, weather, faults; effects change it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from benchmarks.worlds.hidden_b.hulls import GRAVITY, Array, Hull
from benchmarks.worlds.hidden_b.screws import Screw
from benchmarks.worlds.hidden_b.weather import Weather

Timed = Callable[[Array, Array], Array]
"""Resistance [N] at times since the stop [s] and speeds through water."""


@dataclass
class Faults:
    """
    What is wrong with the instruments, beyond their noise.

    Attributes
    ----------
    swing
        Of the log's gain, by time since the stop.
    gyro
        Error [rad] by time since the stop.
    """

    scale: float = 0.0
    offset_m_s: float = 0.0
    lag_s: float = 0.0
    dead_m_s: float = 0.0
    late_s: float = 0.0
    radar_scale: float = 0.0
    swing: Callable[[Array], Array] | None = None
    gyro: Callable[[Array], Array] | None = None


@dataclass
class Setting:
    """
    All that a run depends on; times are since the stop.

    Attributes
    ----------
    speed_m_s
        Steady, before the stop.
    heading_rad, first_rad
        Of this run and of the first, from east, anticlockwise.
    lead_s, coast_s, step_s
        Length of the steady part and of the rest, and the time step.
    clock_s
        Time of day at the stop, for the tide.
    mass, added
        Factors of mass and of added mass.
    still, of_depth
        What the resistance table becomes: functions (hull, speeds, resistance) -> resistance; the
        latter are no part of it in deep water.
    timed
        Forces that come and go; part of no r(v).
    helm
        Yaw rate by time, beside the autopilot's wander.
    shear
        Change of the current in place by time, along the heading.
    tide_change
        Change of it in time, which carries the ship along, (n, 2).
    depth_m
        Of the water.
    """

    hull: Hull
    screw: Screw
    weather: Weather
    speed_m_s: float
    heading_rad: float
    first_rad: float
    lead_s: float
    coast_s: float
    step_s: float
    clock_s: float
    seed: tuple[int, ...]
    quiet: bool = False
    mass: float = 1.0
    added: float = 1.0
    still: list[Callable[[Hull, Array, Array], Array]] = field(default_factory=list)
    of_depth: list[Callable[[Hull, Array, Array], Array]] = field(default_factory=list)
    timed: list[Timed] = field(default_factory=list)
    wind: list[tuple[float, float]] = field(default_factory=list)
    flow: list[tuple[float, float]] = field(default_factory=list)
    helm: list[Callable[[Array], Array]] = field(default_factory=list)
    shear: list[Callable[[Array], Array]] = field(default_factory=list)
    waves: list[Callable[[Array, Array, float, np.random.Generator | None], Array]] = field(
        default_factory=list
    )
    depth_m: float = 300.0
    faults: Faults = field(default_factory=Faults)

    def stream(self, *more: int) -> np.random.Generator:
        """
        Return the random numbers of one purpose.
        """
        return np.random.default_rng([*self.seed, *more])

    def along_first(self, along: float, port: float) -> tuple[float, float]:
        """
        Turn a vector of the first run's frame to east and north.
        """
        c, s = np.cos(self.first_rad), np.sin(self.first_rad)
        return float(along * c - port * s), float(along * s + port * c)

    def still_n(self, *, deep: bool = False) -> Array:
        """
        Return the resistance on the hull's grid of speeds, propeller apart; in deep water, if so.
        """
        found = self.hull.still_n
        for change in self.still if deep else [*self.still, *self.of_depth]:
            found = change(self.hull, self.hull.grid_m_s, found)
        return found

    @property
    def mass_kg(self) -> float:
        """Mass, without added mass."""
        return self.hull.mass_kg * self.mass

    @property
    def n_r(self) -> float:
        """Added mass over mass, as it is in this run."""
        return self.hull.n_r * self.added / self.mass

    @property
    def period_s(self) -> float:
        """Of waves half as long as the ship."""
        return float(np.sqrt(2 * np.pi * 0.5 * self.hull.length_m / GRAVITY))
