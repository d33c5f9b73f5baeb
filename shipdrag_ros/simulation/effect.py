# SPDX-License-Identifier: Apache-2.0
"""
How an effect is declared: what it does, how large it may be, what separates it.

What it does to a simulated run is an action, in the few terms that the kernel knows. Actions add,
so that any set of effects is one action; the empty one changes nothing.

Simulation, command line, documentation and diagnosis read the declaration; no
effect is known to them by name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from math import inf
from operator import add, attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shipdrag_ros.fields import (
    INVALID,
    Kind,
    Problems,
    choice,
    declare,
    flag,
    list_of,
    named,
    number,
    section,
    text,
)
from shipdrag_ros.parameter import ABSOLUTE, Parameter, Scale
from shipdrag_ros.samples import INPUTS, Float64
from shipdrag_ros.ship import GRAVITY_M_S2, Ship
from shipdrag_ros.simulation.scenario import Scenario, Turn

Vector = tuple[float, float]


class Cost(StrEnum):
    """What a measure costs the crew, and about as many hours of the ship."""

    LOOK = 'a look', 0.1
    LEG = 'a few minutes on another course', 0.3
    RUN = 'another run', 1.0
    GEAR = 'gear to be rigged or hauled in', 2.0
    PASSAGE = 'a passage elsewhere', 6.0
    DIVE = 'a diver or a dock', 48.0

    hours: float

    def __new__(cls, text: str, hours: float = 0.0) -> Cost:
        member = str.__new__(cls, text)
        member._value_, member.hours = text, hours
        return member


class Measure(StrEnum):
    """What can be done to separate two effects, as it is advised, and what it costs."""

    RECIPROCAL_RUN = 'a run on the reciprocal heading', Cost.RUN
    ANOTHER_COURSE = 'a leg on another course', Cost.LEG
    OTHER_SPEED = 'a run that begins or ends at another speed', Cost.RUN
    ANOTHER_RUN = 'another run of the same ship', Cost.RUN
    RADAR = 'radar or GNSS positions', Cost.GEAR
    LOG = 'a speed log', Cost.GEAR
    WIND = 'an anemometer (wind_apparent)', Cost.GEAR
    DEPTH = 'an echo sounder (depth)', Cost.LOOK
    DEEP_WATER = 'a run in deep water', Cost.PASSAGE
    HEADING = 'a compass (heading)', Cost.LOOK
    SHAFT = 'the shaft speed (shaft)', Cost.LOOK
    RUDDER = 'the rudder angle (rudder)', Cost.LOOK
    THIRD_SPEED = 'a third source of speed, GNSS beside log and radar', Cost.GEAR
    WITHOUT_CABLE = 'a run without the cable', Cost.GEAR
    FREE_PROPELLER = 'a run with the propeller turning freely', Cost.GEAR
    CLEAN_HULL = 'a run after the hull is cleaned', Cost.DIVE
    DRAUGHT = 'the draughts, read on both sides fore and aft', Cost.LOOK
    FAST_CHANGE = 'a quick change of speed at a known time', Cost.RUN

    cost: Cost

    def __new__(cls, text: str, cost: Cost = Cost.LOOK) -> Measure:
        member = str.__new__(cls, text)
        member._value_, member.cost = text, cost
        return member


class Scope(StrEnum):
    """What an effect belongs to, hence in which other runs it must be."""

    EARTH = 'earth'
    HULL = 'hull'
    RUN = 'run'
    SENSOR = 'sensor'


class WithoutBaseline(StrEnum):
    """
    What shows an effect although nothing is known of the ship's resistance.

    Attributes
    ----------
    LOG_TRACK
        The log compared with the track over ground, on many courses and at many
        speeds. Such an effect acts alike on all ships.
    ZEROS
        Readings of exactly 0 while the ship moves, and right ones when she is faster.
    """

    LOG_TRACK = 'log_track'
    ZEROS = 'zeros'


def _weight(ship: Ship) -> float:
    return ship.mass_kg * GRAVITY_M_S2


def _area(ship: Ship) -> float:
    return float(ship.displaced_volume_m3 ** (2.0 / 3.0))


def _speed(ship: Ship) -> float:
    return float(ship.speed(1.0))


def _draught(ship: Ship) -> float:
    return ship.draught_m or math.nan


# no lambdas: sizes are part of a diagnosis, which is sent from process to process
SCALES = (
    ABSOLUTE,
    Scale('weight of the ship', _weight),
    Scale('V^(2/3)', _area),
    Scale('sqrt(g L)', _speed),
    Scale('L', attrgetter('length_m')),
    Scale('draught', _draught),
)


@dataclass(frozen=True)
class Frame:
    """
    What an effect acts in.

    Attributes
    ----------
    ship
    scenario
    reference_rad
        Heading of the first run [rad]: effects of the earth are stated along
        it and to port of it, whatever the heading of the run at hand.
    """

    ship: Ship
    scenario: Scenario
    reference_rad: float

    def earth(self, along: float, to_port: float) -> Vector:
        """
        Turn a vector of the first run to the east and to the north.
        """
        cos, sin = math.cos(self.reference_rad), math.sin(self.reference_rad)
        return along * cos - to_port * sin, along * sin + to_port * cos


@dataclass(frozen=True)
class Said:
    """
    What a fact of the log book says of an effect.

    Attributes
    ----------
    values
        Of the fact, with which the effect goes together; none: the fact denies the
        effect.
    fades_s
        Where the fact has a date: the time after it in which the effect may have
        come again, to 1 - 1/e.
    """

    values: tuple[str, ...] = declare(list_of(text()), 'of the fact', default=())
    fades_s: float = declare(number(0.0, 1e12, 's'), 'after its date', default=math.inf)


DAY_S = 86400.0
_MEASURES = {each.name.lower(): each for each in Measure}


def _words(of: Mapping[str, Any]) -> Kind:
    """Expect a list of some words; return what they stand for."""
    words = list_of(choice(*of))

    def read(value: object, path: str, problems: Problems) -> object:
        given = words.read(value, path, problems)
        return given if given is INVALID else tuple(of[word] for word in given)

    return Kind(read, words.expectation)


@dataclass(frozen=True, kw_only=True)
class Effect:
    """
    An effect of the library.

    Attributes
    ----------
    name
    scope
    parameters
        The first is the VALUE of `simulate --effect NAME=VALUE`.
    formula, source
        What is computed, and where it comes from.
    struck_out_by
        Context inputs that measure it, so that it is known not to be missing.
    formula_sd
        How far what the effect does may depart from its formula, relative.
    odds
        That it is missing in a model, before any data.
    size_power
        Its trace grows about as this power of the first parameter; below 0, the smaller that is
        the more there is of the effect.
    confounders
        Effects of nearly the same trace, and what decides from each; nothing:
        no record can.
    not_with
        Effects that cannot be there at the same time.
    act
        From a frame and the values of the parameters, in their order.
    needs
        Keys of the ship file without which it cannot act.
    errs_in
        Inputs whose readings it falsifies; of an effect of a sensor.
    without_baseline
        What shows it without a baseline, and a sentence on how it looks there
        ('': nothing to add).
    in_geodetic
        Whether it can be where positions are latitude and longitude.
    facts
        What facts of the log book say of it, by name of the fact.
    nameless_at
        Values of parameters at which many other causes leave the same trace, so that it
        is no name.
    lasts_s
        Time in which it goes unseen, to 1 - 1/e: repaired, cleaned, set again [s]. 0:
        of its run or its day, so that it says nothing of another.
    """

    name: str
    scope: Scope
    parameters: tuple[Parameter, ...]
    formula: str = declare(text(), 'what is computed')
    source: str = declare(text(), 'where it comes from')
    act: Callable[..., Action]
    struck_out_by: tuple[str, ...] = declare(
        list_of(choice(*INPUTS)), 'what measures it', default=()
    )
    confounders: Mapping[str, tuple[Measure, ...]] = declare(
        named(_words(_MEASURES)), 'what looks alike, and what decides', default={}
    )
    not_with: tuple[str, ...] = declare(list_of(text()), 'effects that exclude it', default=())
    formula_sd: float = declare(number(0.0, 10.0), 'of its formula, relative', default=0.0)
    odds: float = declare(number(1e-6, 1.0), 'before any data', default=0.04)
    size_power: float = declare(number(-12.0, 12.0), 'of its size in its trace', default=1.0)
    needs: tuple[str, ...] = ()
    errs_in: tuple[str, ...] = ()
    without_baseline: Mapping[WithoutBaseline, str] = declare(
        named(text()), 'what shows it without a baseline', default={}
    )
    in_geodetic: bool = declare(flag(), 'by latitude and longitude too', default=True)
    facts: Mapping[str, Said] = declare(
        named(section(Said)), 'what a log book says of it', default={}
    )
    nameless_at: Mapping[str, float] = field(default_factory=dict)
    lasts_s: float = declare(number(0.0, 1e9, 's'), 'in which it goes unseen', default=0.0)

    def goes_with(self, other: Effect) -> bool:
        """
        Say whether two effects can be there at the same time.
        """
        return other.name not in (self.name, *self.not_with) and self.name not in other.not_with

    def missing(self, ship: Ship) -> tuple[str, ...]:
        """
        Return the keys that the ship file lacks.
        """
        return tuple(key for key in self.needs if getattr(ship, key) is None)

    def parameters_of(self, ship: Ship) -> tuple[Parameter, ...]:
        """
        Return the parameters with all sizes in SI.
        """
        return tuple(parameter.of(ship) for parameter in self.parameters)

    def action(self, frame: Frame, *values: float) -> Action:
        """
        Return what the effect does; the values are taken as they are.
        """
        return self.act(frame, *values)


@dataclass(frozen=True, kw_only=True)
class Action:
    """
    Contributions of effects; vectors point to the east and to the north.

    Attributes
    ----------
    resistance
        Functions of |speed through water| >= 0 [m/s] that return an extra
        resistance [N], retarding positive, odd in the speed.
    wind_m_s
        Velocity of the air over ground.
    wave_force_n
        Mean force of the waves on the ship at rest.
    wave_encounter_s_m
        The force is (1 + wave_encounter_s_m c)^2 times that, c the speed
        through water against the force.
    current_m_s
        Velocity of the water over ground.
    current_change_m_s
        What the current gains, evenly, from the end of the lead-in to the
        end of the record.
    residual_fraction, residual_decay_s
        Share of the thrust that does not end with the ship's run-down but
        as exp(-t / residual_decay_s).
    run_down_change_s
        The run-down is longer by this.
    n_r_change
        n_r is larger by this.
    mass_fraction
        The ship's mass is larger by this fraction, its resistance is not.
    turns
        On top of the scenario's.
    stall_m_s
        Above this speed through water the flow turns the propeller, below it
        stands; 0: as the baseline has it.
    free_shaft
        Shaft speed of the baseline's free propeller, over that under power at
        the same speed of the ship, where it is seen to turn.
    friction_m_s
        Speed through water below which friction stops that propeller.
    depth_m
        Depth of the water, where it is less than the scenario's.
    log_factor, log_offset_m_s
        The log reads (1 + log_factor) times the truth and its errors, plus log_offset_m_s.
    log_lag_s
        Time constant of a first-order filter of the log.
    log_late_s
        A reading of the log is of this time before its stamp.
    log_error
        Functions of speed through water [m/s] and time since the end of the lead-in [s] that
        return what the flow at the log is too fast [m/s].
    radar_factor
        Positions and speeds over ground read (1 + radar_factor) times truth.
    ground_lag_s
        Time constant of a first-order filter of the speed over ground.
    """

    resistance: tuple[Callable[[Float64], Float64], ...] = ()
    wind_m_s: Vector = (0.0, 0.0)
    wave_force_n: Vector = (0.0, 0.0)
    wave_encounter_s_m: float = 0.0
    current_m_s: Vector = (0.0, 0.0)
    current_change_m_s: Vector = (0.0, 0.0)
    residual_fraction: float = 0.0
    residual_decay_s: float = 0.0
    run_down_change_s: float = 0.0
    n_r_change: float = 0.0
    mass_fraction: float = 0.0
    turns: tuple[Turn, ...] = ()
    stall_m_s: float = 0.0
    free_shaft: float = 0.0
    friction_m_s: float = 0.0
    depth_m: float = inf
    log_factor: float = 0.0
    log_offset_m_s: float = 0.0
    log_lag_s: float = 0.0
    log_late_s: float = 0.0
    log_error: tuple[Callable[[Float64, Float64], Float64], ...] = ()
    radar_factor: float = 0.0
    ground_lag_s: float = 0.0

    def __add__(self, other: Action) -> Action:
        return Action.total(self, other)

    @classmethod
    def total(cls, *actions: Action) -> Action:
        """
        Return what several do together.
        """
        parts: dict[str, Any] = {}
        for action in actions:
            for name, value in action._parts.items():
                parts[name] = _ADD.get(name, add)(parts[name], value) if name in parts else value
        return cls(**parts)

    @cached_property
    def _parts(self) -> dict[str, Any]:
        """What it contributes: most actions have a part or two."""
        return {name: value for name, value in vars(self).items() if value != _NOTHING[name]}

    def resistance_n(self, speed_m_s: ArrayLike) -> Float64:
        """
        Return the extra resistance [N], odd in the speed.
        """
        speed = np.asarray(speed_m_s, np.float64)
        added = (function(np.abs(speed)) for function in self.resistance)
        return np.sign(speed) * sum(added, np.zeros_like(speed))


def _sum_of_vectors(one: Vector, other: Vector) -> Vector:
    return one[0] + other[0], one[1] + other[1]


_VECTORS = ('wind_m_s', 'wave_force_n', 'current_m_s', 'current_change_m_s')
_ADD: Mapping[str, Any] = {
    **dict.fromkeys(_VECTORS, _sum_of_vectors),
    'stall_m_s': max,
    'depth_m': min,
}
_NOTHING = vars(Action())
