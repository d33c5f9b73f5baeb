# SPDX-License-Identifier: Apache-2.0
"""
How an effect is declared: what it does, how large it may be, what tells it apart.

Simulation, command line, documentation and diagnosis read the declaration; no
effect is known to them by name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from shipdrag_ros.ship import GRAVITY_M_S2, Ship
from shipdrag_ros.simulation.action import Action, Vector
from shipdrag_ros.simulation.measures import Measure as Measure
from shipdrag_ros.simulation.scenario import Scenario


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
        The log held against the track over ground, on many courses and at many
        speeds. Such an effect acts alike on all ships.
    ZEROS
        Readings of exactly 0 while the ship moves, and right ones when she is faster.
    CONSTANT_FORCE
        A constant part of the deceleration beside a form of the resistance
        that is fitted to the coastdown itself.
    """

    LOG_TRACK = 'log_track'
    ZEROS = 'zeros'
    CONSTANT_FORCE = 'constant_force'


class Shape(StrEnum):
    """Kinds of prior distributions."""

    NORMAL = 'normal'
    HALF_NORMAL = 'half-normal'
    LOG_NORMAL = 'log-normal'
    EITHER_SIGN = 'log-normal in size, of either sign'
    UNIFORM = 'uniform'
    CHOICE = 'either'


@dataclass(frozen=True)
class Prior:
    """
    How large a parameter is thought to be before any data.

    Attributes
    ----------
    shape
    first, second
        Mean and sd of a normal one; 0 and sd of the normal of a half-normal
        one; median and sd of the logarithm, of the size where either sign is
        alike; ends of a uniform one; the two values of a choice.
    """

    shape: Shape
    first: float
    second: float

    def log_density(self, value: float) -> float:
        """
        Return the logarithm of the density; of the probability of a choice.
        """
        a, b = self.first, self.second
        match self.shape:
            case Shape.NORMAL:
                return _log_normal((value - a) / b) - math.log(b)
            case Shape.HALF_NORMAL:
                return math.log(2.0 / b) + _log_normal(value / b) if value >= 0.0 else -math.inf
            case Shape.LOG_NORMAL:
                if value <= 0.0:
                    return -math.inf
                return _log_normal(math.log(value / a) / b) - math.log(b * value)
            case Shape.EITHER_SIGN:
                return math.log(0.5) + log_normal(a, b).log_density(abs(value))
            case Shape.UNIFORM:
                return -math.log(b - a) if a <= value <= b else -math.inf
            case Shape.CHOICE:
                return math.log(0.5) if value in (a, b) else -math.inf

    def draw(self, rng: np.random.Generator) -> float:
        """
        Return one value.
        """
        a, b = self.first, self.second
        match self.shape:
            case Shape.NORMAL:
                return float(rng.normal(a, b))
            case Shape.HALF_NORMAL:
                return float(abs(rng.normal(0.0, b)))
            case Shape.LOG_NORMAL:
                return float(a * math.exp(b * rng.standard_normal()))
            case Shape.EITHER_SIGN:
                return float(rng.choice([a, -a]) * math.exp(b * rng.standard_normal()))
            case Shape.UNIFORM:
                return float(rng.uniform(a, b))
            case Shape.CHOICE:
                return float(rng.choice([a, b]))

    def scaled(self, factor: float) -> Prior:
        """
        Return the prior of a quantity that is so many times larger.
        """
        if self.shape in (Shape.LOG_NORMAL, Shape.EITHER_SIGN):
            return Prior(self.shape, factor * self.first, self.second)
        return Prior(self.shape, factor * self.first, factor * self.second)

    def __str__(self) -> str:
        a, b = self.first, self.second
        match self.shape:
            case Shape.NORMAL:
                return f'normal, {a:g} ± {b:g}'
            case Shape.HALF_NORMAL:
                return f'half-normal, 0 + {b:g}'
            case Shape.LOG_NORMAL:
                return f'log-normal, median {a:g}, factor {math.exp(b):.2g}'
            case Shape.EITHER_SIGN:
                return f'log-normal, median {a:g}, factor {math.exp(b):.2g}, either sign'
            case Shape.UNIFORM:
                return f'uniform, {a:g} .. {b:g}'
            case Shape.CHOICE:
                return 'either alike'


def normal(sd: float, *, mean: float = 0.0) -> Prior:
    """
    Expect either sign.
    """
    return Prior(Shape.NORMAL, mean, sd)


def half_normal(sd: float) -> Prior:
    """
    Expect 0 or more, small values most.
    """
    return Prior(Shape.HALF_NORMAL, 0.0, sd)


def log_normal(median: float, sd_of_log: float) -> Prior:
    """
    Expect more than 0, within a factor of the median.
    """
    return Prior(Shape.LOG_NORMAL, median, sd_of_log)


def either_sign(median: float, sd_of_log: float) -> Prior:
    """
    Expect either sign, within a factor of the median, and hardly 0.
    """
    return Prior(Shape.EITHER_SIGN, median, sd_of_log)


def uniform(low: float, high: float) -> Prior:
    """
    Expect any value between two.
    """
    return Prior(Shape.UNIFORM, low, high)


@dataclass(frozen=True)
class Scale:
    """
    What a size is counted in, so that one prior serves ships of all sizes.

    Attributes
    ----------
    text
        In words; '' for the unit of the parameter itself.
    of
        Its size, of a ship whose file has what the effect needs.
    """

    text: str
    of: Callable[[Ship], float]


ABSOLUTE = Scale('', lambda ship: 1.0)
WEIGHTS = Scale('weight of the ship', lambda ship: ship.mass_kg * GRAVITY_M_S2)
AREAS = Scale('V^(2/3)', lambda ship: ship.displaced_volume_m3 ** (2.0 / 3.0))
SPEEDS = Scale('sqrt(g L)', lambda ship: float(ship.speed(1.0)))
DRAUGHTS = Scale('draught', lambda ship: ship.draught_m or math.nan)


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """
    A parameter of an effect.

    Attributes
    ----------
    name
        With its unit, as it is given.
    unit
        '' for a pure number.
    meaning
    prior
    low, high
        What a simulation accepts.
    default
        Where it is not given; None: it must be.
    words
        What may be given in place of a number.
    measured_in
        What prior, low, high and default are counted in; `of` makes them SI.
    """

    name: str
    unit: str
    meaning: str
    prior: Prior
    low: float
    high: float
    default: float | None = None
    words: Mapping[str, float] = field(default_factory=dict)
    measured_in: Scale = ABSOLUTE

    def of(self, ship: Ship) -> Quantity:
        """
        Return the same with all sizes in SI, for one ship.
        """
        size = self.measured_in.of(ship)
        return replace(
            self,
            prior=self.prior.scaled(size),
            low=self.low * size,
            high=self.high * size,
            default=None if self.default is None else self.default * size,
            measured_in=ABSOLUTE,
        )

    @property
    def expectation(self) -> str:
        """What is accepted, in words."""
        if self.words:
            return ' or '.join(f'{word} ({value:g})' for word, value in self.words.items())
        return f'{self.low:g}..{self.high:g} {self.unit}'.rstrip()

    def accepts(self, value: float) -> bool:
        """
        Tell whether a simulation can use a value.
        """
        if self.words:
            return value in self.words.values()
        return self.low <= value <= self.high


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

    values: tuple[str, ...] = ()
    fades_s: float = math.inf


DENIES = Said()


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
    """

    name: str
    scope: Scope
    parameters: tuple[Quantity, ...]
    formula: str
    source: str
    act: Callable[..., Action]
    struck_out_by: tuple[str, ...] = ()
    confounders: Mapping[str, tuple[Measure, ...]] = field(default_factory=dict)
    not_with: tuple[str, ...] = ()
    formula_sd: float = 0.0
    odds: float = 0.04
    needs: tuple[str, ...] = ()
    errs_in: tuple[str, ...] = ()
    without_baseline: Mapping[WithoutBaseline, str] = field(default_factory=dict)
    in_geodetic: bool = True
    facts: Mapping[str, Said] = field(default_factory=dict)

    def goes_with(self, other: Effect) -> bool:
        """
        Tell whether two effects can be there at the same time.
        """
        return other.name not in (self.name, *self.not_with) and self.name not in other.not_with

    def missing(self, ship: Ship) -> tuple[str, ...]:
        """
        Return the keys that the ship file lacks.
        """
        return tuple(key for key in self.needs if getattr(ship, key) is None)

    def quantities(self, ship: Ship) -> tuple[Quantity, ...]:
        """
        Return the parameters with all sizes in SI.
        """
        return tuple(quantity.of(ship) for quantity in self.parameters)

    def action(self, frame: Frame, *values: float) -> Action:
        """
        Return what the effect does; the values are taken as they are.
        """
        return self.act(frame, *values)


def _log_normal(standard: float) -> float:
    return -0.5 * standard * standard - 0.5 * math.log(2.0 * math.pi)
