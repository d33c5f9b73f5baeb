# SPDX-License-Identifier: Apache-2.0
"""
A parameter: value, standard deviation, prior, bounds and unit, as in lmfit.

One kind for all: what an effect of the library declares, what a ship file
states, what a fit leaves open and what a diagnosis finds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from statistics import NormalDist
from typing import Any

import numpy as np

from shipdrag_ros.fields import declare, number

TAILS = ((1.0, 0.9), (3.0, 0.1))  # what is stated or calculated is so many times worse, so often


class Shape(StrEnum):
    """Kinds of prior distributions."""

    NORMAL = 'normal'
    HALF_NORMAL = 'half-normal'
    LOG_NORMAL = 'log-normal'
    EITHER_SIGN = 'log-normal in size, of either sign'
    UNIFORM = 'uniform'
    CHOICE = 'either'
    FLAT = 'flat'


_OF_ONE_SIGN = Shape.HALF_NORMAL, Shape.LOG_NORMAL, Shape.EITHER_SIGN
_WIDEST = 1.0  # sd of the logarithm of a size that was found ...
_WIDE = 2.0  # ... and a relative sd that is wider


@dataclass(frozen=True)
class Prior:
    """
    How large a parameter is thought to be before any data.

    A fit works on z, which is standard normal under the prior (flat, where the
    prior is), so that the evidence of hypotheses can be compared whatever the
    units of their parameters.

    Attributes
    ----------
    shape
    first, second
        Mean and sd of a normal one; 0 and sd of the normal
        of a half-normal one; median and sd of the logarithm, of the size where
        either sign is alike; ends of a uniform one; the two values of a choice;
        origin and unit of a flat one.
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
                if value * a <= 0.0:
                    return -math.inf
                return _log_normal(math.log(value / a) / b) - math.log(b * abs(value))
            case Shape.EITHER_SIGN:
                return math.log(0.5) + log_normal(a, b).log_density(abs(value))
            case Shape.UNIFORM:
                return -math.log(b - a) if a <= value <= b else -math.inf
            case Shape.CHOICE:
                return math.log(0.5) if value in (a, b) else -math.inf
            case Shape.FLAT:
                return 0.0

    def draw(self, rng: np.random.Generator) -> float:
        """
        Return one value.

        Raises
        ------
        ValueError
            If the prior is flat: it has no probability to draw from.
        """
        a, b = self.first, self.second
        match self.shape:
            case Shape.EITHER_SIGN:
                return float(rng.choice([1.0, -1.0])) * self.at(rng.standard_normal())
            case Shape.UNIFORM:
                return float(rng.uniform(a, b))
            case Shape.CHOICE:
                return float(rng.choice([a, b]))
            case Shape.FLAT:
                raise ValueError('a flat prior cannot be drawn from')
            case _:
                value = self.at(rng.standard_normal())
                return abs(value) if self.shape is Shape.HALF_NORMAL else value

    def at(self, z: float) -> float:
        """
        Return the value at z; that of positive sign where either is alike.

        Raises
        ------
        ValueError
            If the prior is a choice: it has no z.
        """
        a, b = self.first, self.second
        match self.shape:
            case Shape.HALF_NORMAL:
                return b * z
            case Shape.LOG_NORMAL | Shape.EITHER_SIGN:
                return a * math.exp(b * z)
            case Shape.UNIFORM:
                return a + (b - a) * 0.5 * math.erfc(-z / math.sqrt(2.0))
            case Shape.CHOICE:
                raise ValueError('a choice is not fitted')
            case _:
                return a + b * z

    @property
    def typical(self) -> float:
        """A value that is no rarity; a choice has none."""
        return self.at(0.0) or self.at(1.0)

    def moments(self) -> tuple[float, float]:
        """
        Return mean and sd.

        Raises
        ------
        ValueError
            If the prior is neither normal nor log-normal.
        """
        match self.shape:
            case Shape.NORMAL:
                return self.first, self.second
            case Shape.LOG_NORMAL:
                mean = self.first * math.exp(0.5 * self.second**2)
                return mean, abs(mean) * math.sqrt(math.expm1(self.second**2))
            case _:
                raise ValueError(f'no moments of a prior that is {self}')

    def inverse(self, value: float) -> float:
        """
        Return z of a value, of its own sign where either is alike.

        Raises
        ------
        ValueError
            If the prior is a choice.
        """
        a, b = self.first, self.second
        match self.shape:
            case Shape.HALF_NORMAL:
                return value / b
            case Shape.LOG_NORMAL | Shape.EITHER_SIGN:
                return math.log(max(value / a, 1e-300)) / b
            case Shape.UNIFORM:
                share = min(max((value - a) / (b - a), 1e-12), 1.0 - 1e-12)
                return NormalDist().inv_cdf(share)
            case Shape.CHOICE:
                raise ValueError(f'a prior that is {self} has no z of a value')
            case _:
                return (value - a) / b

    def slope(self, z: float) -> float:
        """
        Return the derivative of the value by z.
        """
        a, b = self.first, self.second
        match self.shape:
            case Shape.LOG_NORMAL | Shape.EITHER_SIGN:
                return a * b * math.exp(b * z)
            case Shape.UNIFORM:
                return (b - a) * math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
            case _:
                return b

    def scaled(self, factor: float) -> Prior:
        """
        Return the prior of a quantity that is so many times larger.
        """
        if self.shape in (Shape.LOG_NORMAL, Shape.EITHER_SIGN):
            return Prior(self.shape, factor * self.first, self.second)
        return Prior(self.shape, factor * self.first, factor * self.second)

    def of_sign(self, sign: float) -> Prior:
        """
        Return the prior given the sign (1 or -1), where either is alike; else this one.
        """
        if self.shape is Shape.EITHER_SIGN:
            return Prior(Shape.LOG_NORMAL, sign * self.first, self.second)
        return self

    def about(self, value: float, sd: float) -> Prior:
        """
        Return what is expected of such a parameter that was found; one of one sign keeps it.
        """
        if value == 0.0 or sd == 0.0 or self.shape not in _OF_ONE_SIGN:
            return normal(sd, mean=value)
        relative = min(sd / abs(value), _WIDE)  # the square of a large one overflows
        return log_normal(value, min(math.sqrt(math.log1p(relative**2)), _WIDEST))

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
            case Shape.FLAT:
                return 'flat'


@dataclass(frozen=True)
class Declared:
    """
    A prior with its letter, unit and source.

    Attributes
    ----------
    letter
        As in docs/model.md.
    meaning
    prior
        A number where it is taken as known.
    unit
        '' for a pure number.
    source
        A publication, or the records that it was learnt from.
    """

    letter: str
    meaning: str
    prior: Prior | float
    unit: str
    source: str

    @cached_property
    def mean(self) -> float:
        """Mean of a normal prior, median of a log-normal one, or the number."""
        return self.prior.first if isinstance(self.prior, Prior) else self.prior

    @cached_property
    def sd(self) -> float:
        """Standard deviation, of the logarithm of a log-normal one; 0 of a number."""
        return self.prior.second if isinstance(self.prior, Prior) else 0.0


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
    Expect more than 0, within a factor of the median; less than 0 where the median is.
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


def flat(unit: float = 1.0) -> Prior:
    """
    Expect nothing: the data alone decide; z counts in `unit`.
    """
    return Prior(Shape.FLAT, 0.0, unit)


@dataclass(frozen=True)
class Scale:
    """
    What a size is counted in, so that one prior serves ships of all sizes.

    Attributes
    ----------
    text
        In words; '' for the unit of the parameter itself.
    of
        Its size, of a ship whose file has what is needed.
    """

    text: str
    of: Callable[[Any], float]


def _one(ship: Any) -> float:
    return 1.0


ABSOLUTE = Scale('', _one)  # no lambda: results are sent from process to process


@dataclass(frozen=True)
class Parameter:
    """
    One number, known, stated, or to be found.

    Attributes
    ----------
    value
        What it is; of a declaration, what it is where it is not given. NaN: it
        must be given, or fitted.
    sd
        Standard deviation of the value; 0 where it is exactly known.
    name
        With its unit, as it is given; '' where it stands under its name.
    unit
        '' for a pure number.
    meaning
        In words.
    prior
        Before any data.
    low, high
        Bounds of what is accepted.
    words
        What may be given in place of a number.
    measured_in
        What value, prior and bounds are counted in; `of` makes them SI.
    """

    value: float = declare(number(-1e12, 1e12), 'value', default=math.nan)
    sd: float = declare(number(0.0, 1e12), 'standard deviation', default=0.0)
    name: str = field(default='', kw_only=True)
    unit: str = field(default='', kw_only=True)
    meaning: str = field(default='', kw_only=True)
    prior: Prior = field(default=flat(), kw_only=True)
    low: float = field(default=-math.inf, kw_only=True)
    high: float = field(default=math.inf, kw_only=True)
    words: Mapping[str, float] = field(default_factory=dict, kw_only=True, hash=False)
    measured_in: Scale = field(default=ABSOLUTE, kw_only=True)

    def of(self, ship: Any) -> Parameter:
        """
        Return the same with all sizes in SI, for one ship.
        """
        size = self.measured_in.of(ship)
        return replace(
            self,
            value=self.value * size,
            sd=self.sd * size,
            prior=self.prior.scaled(size),
            low=self.low * size,
            high=self.high * size,
            measured_in=ABSOLUTE,
        )

    @property
    def is_given(self) -> bool:
        """Whether there is a value."""
        return not math.isnan(self.value)

    @property
    def expectation(self) -> str:
        """What is accepted, in words."""
        if self.words:
            return ' or '.join(f'{word} ({value:g})' for word, value in self.words.items())
        return f'{self.low:g}..{self.high:g} {self.unit}'.rstrip()

    def accepts(self, value: float) -> bool:
        """
        Say whether a value is one of the words, or inside the bounds.
        """
        if self.words:
            return value in self.words.values()
        return self.low <= value <= self.high


def _log_normal(standard: float) -> float:
    return -0.5 * standard * standard - 0.5 * math.log(2.0 * math.pi)
