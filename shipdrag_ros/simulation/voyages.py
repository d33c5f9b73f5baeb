# SPDX-License-Identifier: Apache-2.0
"""
Months of a fleet: how hulls foul, what is done to them, and the runs in between.

A plan alone; each run of it can be simulated by itself. Added friction grows
with time, faster on some hulls than on others; a cleaning takes most of it off,
a docking all, an idle month in warm water adds to it. Not all of that is
written down.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from shipdrag_ros.errors import SimulationError
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import CoefficientBaseline, Ship
from shipdrag_ros.ship.model import kinematic_viscosity
from shipdrag_ros.simulation.scenario import GaussMarkov, Scenario
from shipdrag_ros.simulation.sensors import sense, standard_sensors
from shipdrag_ros.simulation.surge import simulate

DAY_NS = 86_400_000_000_000
FLEET_START_NS = 1_735_689_600_000_000_000  # 2025-01-01 UTC
LEAD_IN_S, COAST_S = 600.0, 1200.0
SCATTER = 0.015  # of the resistance, from run to run, for reasons nobody finds
_DAYS_PER_YEAR = 365.25
_NAMES = ('Alder', 'Birch', 'Cedar', 'Elm', 'Hazel', 'Juniper', 'Larch', 'Maple', 'Rowan', 'Yew')
_SCALES = (1.0, 0.92, 1.08, 0.97, 1.04)
_SHARE = 0.03  # of the files that are lost, and so of each other misfortune
_WRONG_CLOCK_NS = 946_684_800_000_000_000  # 2000-01-01, where a clock without a battery starts


class Fate(StrEnum):
    """What becomes of the file of a run."""

    SOUND = 'sound'
    LOST = 'lost'
    CUT = 'cut'
    UNREADABLE = 'unreadable'
    WRONG_CLOCK = 'wrong_clock'


@dataclass(frozen=True)
class HullChange:
    """
    Something that changes a hull at once.

    Attributes
    ----------
    day
        Since the start.
    kind
        `cleaning` or `docking`, or `idle` for growth in port.
    known
        Whether anybody wrote it down.
    keeps
        Share of the added friction that is left.
    adds
        Friction added on top.
    growth
        What the growth is multiplied by from then on.
    """

    day: float
    kind: str
    known: bool
    keeps: float = 1.0
    adds: float = 0.0
    growth: float = 1.0


@dataclass(frozen=True)
class HullHistory:
    """
    Added friction of a hull against time.

    Attributes
    ----------
    at_start
        As a fraction of C_F (1 + k).
    growth_per_year
        The same fraction a year, until the first change.
    changes
        In the order of time.
    """

    at_start: float
    growth_per_year: float
    changes: tuple[HullChange, ...] = ()

    def added_friction(self, day: float) -> float:
        """
        Return the added friction on a day, a fraction of C_F (1 + k).
        """
        level, growth, since = self.at_start, self.growth_per_year, 0.0
        for change in self.changes:
            if change.day > day:
                break
            level += growth * (change.day - since) / _DAYS_PER_YEAR
            level = change.keeps * level + change.adds
            growth, since = growth * change.growth, change.day
        return level + growth * (day - since) / _DAYS_PER_YEAR


@dataclass(frozen=True)
class PlannedRun:
    """
    One coastdown to be simulated.

    Attributes
    ----------
    start_ns
        When it begins, truly.
    ship
        Clean, as she was loaded that day, in the water of that day.
    added_friction
        Added friction, a fraction of C_F (1 + k).
    scatter
        Factor on the resistance that nothing explains.
    temperature_c
        Of the water.
    log_factor
        What the speed log reads over the truth.
    scenario
        Speed, heading, current and weather.
    fate
        What becomes of the file.
    seed
        Of the noise of its sensors.
    """

    start_ns: int
    ship: Ship
    added_friction: float
    scatter: float
    temperature_c: float
    log_factor: float
    scenario: Scenario
    fate: Fate
    seed: int

    @property
    def stamped_ns(self) -> int:
        """When it begins by the clock on board."""
        return _WRONG_CLOCK_NS if self.fate is Fate.WRONG_CLOCK else self.start_ns

    def fouled(self) -> Ship:
        """
        Return the ship as she sails.
        """
        base = self.ship.baseline
        assert isinstance(base, CoefficientBaseline)
        friction = (1.0 + base.form_factor) * (1.0 + self.added_friction) * self.scatter
        wave = tuple(self.scatter * value for value in base.wave_coefficient)
        fouled = replace(base, form_factor=friction - 1.0, wave_coefficient=wave)
        return replace(self.ship, baseline=fouled)

    def samples(self) -> Block:
        """
        Return what the sensors read, by the clock on board.
        """
        motion = simulate(self.fouled(), self.scenario)
        block = sense(motion, standard_sensors(), seed=self.seed, start_ns=self.stamped_ns)
        by_log = block.channel == Channel.SPEED_THROUGH_WATER
        factor = np.where(by_log, self.log_factor, 1.0)[:, None]
        return replace(block, value=block.value * factor)


@dataclass(frozen=True)
class PlannedShip:
    """
    A ship and her months.

    Attributes
    ----------
    ship
        As her ship file has her: clean, laden.
    history
        Of her hull.
    runs
        In the order of time.
    """

    ship: Ship
    history: HullHistory
    runs: tuple[PlannedRun, ...]


def plan_fleet(
    pattern: Ship, *, ships: int, months: float, every_days: float, seed: int, sound: bool = False
) -> tuple[PlannedShip, ...]:
    """
    Plan the runs of a fleet.

    Parameters
    ----------
    pattern
        Whose form the ships have, each in a size of her own; with a baseline of
        coefficients.
    ships
        How many.
    months
        How long [30 days].
    every_days
        Between two runs of a ship.
    seed
        Of everything that chance decides.
    sound
        No file is lost, damaged or dated wrongly.

    Raises
    ------
    SimulationError
        If the pattern has no baseline of coefficients.
    """
    if not isinstance(pattern.baseline, CoefficientBaseline):
        raise SimulationError(
            f'ship {pattern.name!r} has no baseline of coefficients, on which fouling could grow'
        )
    days = 30.0 * months
    return tuple(
        _plan_ship(pattern, number, np.arange(0.0, days, every_days), days, seed, sound=sound)
        for number in range(ships)
    )


def _plan_ship(
    pattern: Ship, number: int, days: np.ndarray, length_days: float, seed: int, *, sound: bool
) -> PlannedShip:
    rng = np.random.default_rng([seed, number])
    ship = _scaled(pattern, _SCALES[number % len(_SCALES)], _name(number))
    history = _history(rng, number, length_days)
    fates = [Fate.SOUND] * len(days) if sound else _fates(rng, len(days))
    # instruments drift, and are set right now and then
    drift = np.cumsum(rng.normal(0.0, 0.003, len(days))) + rng.normal(0.0, 0.01)
    drift[int(0.7 * len(days)) :] -= 0.5 * drift[-1] if len(days) else 0.0
    runs = [
        _run(rng, ship, history, day + rng.uniform(0.0, 1.0), float(factor), fate)
        for day, factor, fate in zip(days.tolist(), 1.0 + drift, fates, strict=True)
    ]
    return PlannedShip(ship, history, tuple(runs))


def _history(rng: np.random.Generator, number: int, length_days: float) -> HullHistory:
    """Return a hull's history; what happens to it goes round among the ships."""
    middle = length_days * rng.uniform(0.4, 0.6)
    clean = HullChange(middle, 'cleaning', known=True, keeps=rng.uniform(0.15, 0.35))
    idle = HullChange(0.5 * middle, 'idle', known=False, adds=rng.uniform(0.10, 0.20))
    docking = HullChange(1.3 * middle, 'docking', known=True, keeps=0.0, growth=0.6)
    changes = ((clean,), (replace(clean, known=False),), (idle, docking))[number % 3]
    return HullHistory(rng.uniform(0.05, 0.30), rng.uniform(0.12, 0.35), changes)


def _run(
    rng: np.random.Generator,
    ship: Ship,
    history: HullHistory,
    day: float,
    log_factor: float,
    fate: Fate,
) -> PlannedRun:
    temperature_c = round(15.0 - 8.0 * math.cos(2.0 * math.pi * day / _DAYS_PER_YEAR), 1)
    loaded = _loaded(ship, rng.uniform(0.94, 1.06), temperature_c)
    speed_m_s = rng.uniform(0.74, 0.8) * float(loaded.baseline_range_m_s[1])
    gust_n = 0.01 * float(loaded.resistance_n(speed_m_s))
    scenario = Scenario(
        speed_m_s=speed_m_s,
        lead_in_s=LEAD_IN_S,
        duration_s=COAST_S,
        heading_rad=rng.uniform(-np.pi, np.pi),
        current_m_s=(rng.normal(0.0, 0.15), rng.normal(0.0, 0.15)),
        water_speed=GaussMarkov(0.01, 200.0),
        gust_force=GaussMarkov(gust_n, 60.0),
        seed=int(rng.integers(1 << 31)),
    )
    return PlannedRun(
        start_ns=FLEET_START_NS + round(day * 86_400.0) * 1_000_000_000,
        ship=loaded,
        added_friction=history.added_friction(day),
        scatter=float(np.exp(rng.normal(0.0, SCATTER))),
        temperature_c=temperature_c,
        log_factor=log_factor,
        scenario=scenario,
        fate=fate,
        seed=int(rng.integers(1 << 31)),
    )


def _loaded(ship: Ship, fraction: float, temperature_c: float) -> Ship:
    """Return a ship at a fraction of her draught, in water of a temperature."""
    assert ship.draught_m is not None
    assert ship.wetted_surface_m2 is not None
    fraction = round(fraction, 2)
    viscosity = kinematic_viscosity(temperature_c, ship.water.density_kg_m3)
    return replace(
        ship,
        draught_m=round(fraction * ship.draught_m, 3),
        displaced_volume_m3=round(fraction * ship.displaced_volume_m3, 1),
        # the bottom is wet at any draught
        wetted_surface_m2=(0.4 + 0.6 * fraction) * ship.wetted_surface_m2,
        water=replace(ship.water, kinematic_viscosity_m2_s=viscosity),
    )


def _fates(rng: np.random.Generator, many: int) -> list[Fate]:
    """Return what becomes of the files: most are sound, of each misfortune there are few."""
    fates = [Fate.SOUND] * many
    misfortunes = [fate for fate in Fate if fate is not Fate.SOUND]
    for place in rng.permutation(many)[: round(_SHARE * len(misfortunes) * many)].tolist():
        fates[place] = misfortunes[int(rng.integers(len(misfortunes)))]
    return fates


def _name(number: int) -> str:
    again = number // len(_NAMES)
    return _NAMES[number % len(_NAMES)] + (f' {again + 1}' if again else '')


def _scaled(ship: Ship, scale: float, name: str) -> Ship:
    """Return a ship of the same form in another size."""

    air = ship.air and replace(
        ship.air, frontal_area_m2=round(ship.air.frontal_area_m2 * scale**2, 1)
    )
    return replace(
        ship,
        name=name,
        length_m=round(ship.length_m * scale, 3),
        displaced_volume_m3=round(ship.displaced_volume_m3 * scale**3, 1),
        breadth_m=ship.breadth_m and round(ship.breadth_m * scale, 3),
        draught_m=ship.draught_m and round(ship.draught_m * scale, 3),
        wetted_surface_m2=ship.wetted_surface_m2 and round(ship.wetted_surface_m2 * scale**2, 3),
        air=air,
        effects=(),
    )
