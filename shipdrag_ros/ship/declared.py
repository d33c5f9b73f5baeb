# SPDX-License-Identifier: Apache-2.0
"""
What the file of an effect says that it does: formulas, and their parameters.

First the words: channels, variables, names and units; then what is said with them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from shipdrag_ros.fields import (
    INVALID,
    Kind,
    Problems,
    choice,
    declare,
    list_of,
    named,
    number,
    numbers,
    section,
    show,
    text,
    unexpected,
)
from shipdrag_ros.parameter import Prior, Shape, log_normal, normal
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship.expression import NEWTON, PURE, Formula, Unit, Units, Values, unit_of
from shipdrag_ros.ship.sections import GRAVITY_M_S2

SCOPES = ('hull', 'earth', 'sensor', 'run')
SHAPES = ('constant', 'power', 'step', 'ramp', 'hump', 'decay', 'periodic')
VARIABLES = {'speed': 'u', 'time': 't', 'heading': 'psi', 'date': 'd', 'depth': 'h'} | (
    dict.fromkeys(('relative_angle', 'shaft', 'wind', 'position'), '')
)
"""What a term goes by, and what a formula calls it; nothing: it cannot be simulated."""
_MASS, _LENGTH, _TIME, _SPEED, _GAIN = map(unit_of, ('kg', 'm', 's', 'm/s', 'm/s**2'))
UNITS: Mapping[str, Unit] = {
    **dict.fromkeys(('1', 'rad'), PURE),
    'm': _LENGTH,
    **dict.fromkeys(('m2', 'm^2'), unit_of('m**2')),
    's': _TIME,
    'm/s': _SPEED,
    'm/s2': _GAIN,
    'kg': _MASS,
    'N': NEWTON,
}


class TermChannel(NamedTuple):
    """
    What something adds to.

    Attributes
    ----------
    most
        What a formula may be worth on a ship of 100 m, by its unit.
    by
        The variables by which it can be simulated; only by speed: also by nothing.
    during
        Those of u and t that may change it during a run.
    is_vector
    """

    most: Mapping[Unit, float]
    by: tuple[str, ...] = ('speed',)
    during: str = ''
    is_vector: bool = False


CHANNELS: Mapping[str, TermChannel] = {
    'force': TermChannel({NEWTON: 1e8}, ('speed', 'time', 'heading', 'date', 'depth'), 'ut'),
    'water': TermChannel({_SPEED: 50.0}, ('speed', 'time'), 't', is_vector=True),
    'air': TermChannel({_SPEED: 200.0}, is_vector=True),
    'log': TermChannel({_SPEED: 50.0, PURE: 10.0}, ('speed', 'time'), 'ut'),
    'ground': TermChannel({PURE: 10.0}),
    'inertia': TermChannel({PURE: 10.0, _MASS: 1e8}),
    'clock': TermChannel({_TIME: 1e4}),
    'filter': TermChannel({_TIME: 1e4}),
    'shaft': TermChannel({_SPEED: math.inf}),
    'depth': TermChannel({_LENGTH: 2e4}),
}
"""
Of a resistance; of the velocity of water and air, along the first run and to port of it; of what
the log reads too much, or its share of the speed; of the share by which distances over ground are
too long; of what n_r is larger by, or the mass; of the time by which the log is late, and that of
its filter; of the speed below which the flow does not turn the propeller; of the depth.
"""


class FormulaName(NamedTuple):
    """
    What a formula may hold.

    Attributes
    ----------
    unit
    usual
        On a ship of 100 m.
    ends
        Between what it lies on any ship, cut into boxes in which ranges are looked at.
    power
        Of the length of the ship, that the ends are times of.
    """

    unit: Unit
    usual: float
    ends: tuple[float, ...]
    power: int = 0


def _even(low: float, high: float, boxes: int) -> tuple[float, ...]:
    return tuple(np.linspace(low, high, boxes + 1).tolist())


NAMES: Mapping[str, FormulaName] = {
    'rho': FormulaName(unit_of('kg/m**3'), 1025.0, (990.0, 1035.0)),
    'g': FormulaName(_GAIN, GRAVITY_M_S2, (GRAVITY_M_S2, GRAVITY_M_S2)),
    'L': FormulaName(_LENGTH, 100.0, (2.0, 10.0, 30.0, 100.0, 200.0, 400.0)),
    'nabla': FormulaName(unit_of('m**3'), 9000.0, (1e-4, 0.1), 3),
    'B_WL': FormulaName(_LENGTH, 18.0, (0.05, 0.6), 1),
    'T_M': FormulaName(_LENGTH, 7.0, (0.01, 0.3), 1),
    'D_P': FormulaName(_LENGTH, 5.0, (0.005, 0.2), 1),
    'n_r': FormulaName(PURE, 0.1, (0.0, 1.0)),
    'R_T': FormulaName(NEWTON, 3e5, (0.0, 1e10)),
    'R_V': FormulaName(NEWTON, 2e5, (0.0, 1e10)),
    'R_F': FormulaName(NEWTON, 2e5, (0.0, 1e10)),
    'u': FormulaName(_SPEED, 5.0, _even(0.0, 20.0, 16)),
    't': FormulaName(_TIME, 500.0, _even(0.0, 86400.0, 8)),
    't_end': FormulaName(_TIME, 1000.0, (1.0, 86400.0)),
    'psi': FormulaName(PURE, 0.3, (-math.pi, 0.0, math.pi)),
    'd': FormulaName(PURE, 20605.0, _even(0.0, 40000.0, 8)),
    'h': FormulaName(_LENGTH, 200.0, tuple(np.geomspace(0.5, 1e4, 17).tolist())),
    'pi': FormulaName(PURE, math.pi, (math.pi, math.pi)),
}
"""
Density, gravity; of the ship length, displaced volume, breadth, draught, diameter of the
propeller, n_r at half of her speed at the stop; her resistance at u in calm deep water without
that of the air, its viscous part and of that the friction (1 + k) C_F; speed through water, time
since the stop, that at the end of the record, yaw, days since 1970 and depth of the water at the
stop.
"""
OWN_UNITS = {name: each.unit for name, each in NAMES.items()}
BY_SPEED = ('R_T', 'R_V', 'R_F')
COUNTED_IN = {
    'V^(2/3)': 'nabla**(2/3)',
    'sqrt(g L)': 'sqrt(g*L)',
    'L': 'L',
    'draught': 'T_M',
    'weight of the ship': 'rho*g*nabla',
}
"""What sizes may be counted in, so that one prior serves ships of all sizes."""
_NO_FORM = (Shape.CHOICE, Shape.FLAT)  # that a file may state
PRIORS = {each.name.lower().replace('_', '-'): each for each in Shape if each not in _NO_FORM}
_ANY = (-math.inf, math.inf)
_MOST = 1e9  # of a number
_WIDEST = 5.0  # sd of the logarithm of a size
_UNSURE = 0.5  # relative sd of a parameter that may have the other sign
_SIDES_SD = 3.0  # of a parameter, inside which a formula must be sound


def _unit() -> Kind:
    """Expect a unit of the list; 1 may be written as a number."""
    words = choice(*UNITS)

    def read(value: object, path: str, problems: Problems) -> object:
        return words.read('1' if value == 1 and value is not True else value, path, problems)

    return Kind(read, words.expectation, choices=words.choices)


def _prior() -> Kind:
    """Expect the shape of a prior and its two numbers."""
    two = numbers(-_MOST, _MOST)
    expectation = f'[{" | ".join(PRIORS)}, number, number]'

    def read(value: object, path: str, problems: Problems) -> object:
        if not (isinstance(value, list) and len(value) == 3 and value[0] in (*PRIORS,)):
            return unexpected(value, path, problems, expectation)
        row = two.read(value[1:], path, problems)
        if row is INVALID:
            return INVALID
        shape, (first, second) = PRIORS[value[0]], row
        logarithmic = shape in (Shape.LOG_NORMAL, Shape.EITHER_SIGN)
        if second <= (first if shape is Shape.UNIFORM else 0.0) or (
            logarithmic and not (first and second <= _WIDEST)
        ):
            problems.append(f'{path}: {show(value)}, a prior without a size, or of no width')
        elif shape is Shape.HALF_NORMAL and first:
            problems.append(f'{path}: {show(value)}, a half-normal begins at 0, not at {first:g}')
        else:
            return value[0], first, second
        return INVALID

    return Kind(read, expectation)


@dataclass(frozen=True)
class TermPart:
    """A formula, and what it adds to."""

    channel: str = declare(choice(*CHANNELS), 'what it adds to')
    expression: str = declare(text(), 'the formula')
    to_port: str | None = declare(text(), 'of a velocity: the formula abeam', default=None)


@dataclass(frozen=True, kw_only=True)
class TermForm(TermPart):
    """The key `term` of a file: what acts, where, and by which formula."""

    scope: str = declare(choice(*SCOPES), 'what it belongs to')
    variable: str = declare(choice(*VARIABLES), 'what it goes by')
    shape: str = declare(choice(*SHAPES), 'its curve, in a word')
    valid: Mapping[str, tuple[float, float]] = declare(
        named(numbers(0.0, 1e6, ascending=True)), 'between what it holds', hashed=False
    )


@dataclass(frozen=True)
class TermParameter:
    """A parameter of a term: as it was found, or with a prior."""

    value: float | None = declare(
        number(-_MOST, _MOST), 'value; with a prior: where none is given', default=None
    )
    sd: float = declare(number(0.0, _MOST), 'standard deviation', default=0.0)
    unit: str = declare(_unit(), 'unit', default='1')
    prior: tuple[str, float, float] | None = declare(_prior(), 'before any data', default=None)
    bounds: tuple[float, ...] | None = declare(
        numbers(-_MOST, _MOST, ascending=True), 'of what is accepted', default=None
    )
    counted_in: str | None = declare(
        choice(*COUNTED_IN), 'what its numbers are counted in', default=None
    )
    meaning: str | None = declare(text(), 'in words', default=None)

    @property
    def expected(self) -> Prior:
        """Its prior: as stated, or as it was found."""
        if self.prior is None:
            return as_found(self.value or 0.0, self.sd)
        word, first, second = self.prior
        return Prior(PRIORS[word], first, second)

    @property
    def scale(self) -> str:
        """A formula of what its numbers are counted in."""
        return '1' if self.counted_in is None else COUNTED_IN[self.counted_in]

    def within(self, sds: float) -> tuple[float, float]:
        """Return between what it lies, so many standard deviations about the middle."""
        prior = self.expected
        low, high = sorted(prior.at(z) for z in (-sds, sds))
        if self.prior is None and self.value and low * high < 0.0:  # a size keeps its sign
            return (0.0, high) if self.value > 0.0 else (low, 0.0)
        if prior.shape is Shape.HALF_NORMAL:
            return 0.0, high
        return (-high, high) if prior.shape is Shape.EITHER_SIGN else (low, high)

    @property
    def ends(self) -> tuple[float, float]:
        """Between what it lies most likely, as it is counted."""
        low, high = self.bounds or _ANY
        first, last = self.within(_SIDES_SD)
        return min(max(first, low), high), max(min(last, high), low)

    @property
    def accepted(self) -> tuple[float, float]:
        """Between what it may be given."""
        if self.bounds is not None:
            return self.bounds[0], self.bounds[-1]
        return -_MOST if self.ends[0] < 0.0 else 0.0, _MOST


def as_found(value: float, sd: float) -> Prior:
    """
    Return what is expected of a parameter that was found; one that is sure keeps its sign.
    """
    if value == 0.0 or sd > _UNSURE * abs(value):
        return normal(max(sd, 1e-12), mean=value)
    return log_normal(value, sd / abs(value))


@dataclass(frozen=True, kw_only=True)
class DeclaredTerm:
    """What an effect does; whether it can be so, `term.problems_of` says."""

    name: str = declare(text(), 'what it is called')
    term: TermForm = declare(section(TermForm), 'what it is')
    parameters: Mapping[str, TermParameter] = declare(
        named(section(TermParameter)), 'its parameters, the size first', hashed=False
    )
    also: tuple[TermPart, ...] = declare(
        list_of(section(TermPart)), 'what it does beside that', default=()
    )

    @cached_property
    def parts(self) -> tuple[TermPart, ...]:
        """All that it does."""
        return self.term, *self.also

    @property
    def formulas(self) -> Iterator[tuple[str, str, str]]:
        """All formulas, with their place in the file and the channel."""
        for i, part in enumerate(self.parts):
            place = f'also[{i - 1}]' if i else 'term'
            yield f'{place}.expression', part.channel, part.expression
            if part.to_port is not None:
                yield f'{place}.to_port', part.channel, part.to_port

    @property
    def names(self) -> dict[str, Unit]:
        """All that formulas may name."""
        return OWN_UNITS | {name: UNITS[each.unit] for name, each in self.parameters.items()}

    @cached_property
    def units(self) -> tuple[Unit, ...]:
        """What the formula of each part gives."""
        return tuple(
            Formula.parse(part.expression).walk(Units(), self.names) for part in self.parts
        )

    def inside(self, name: str, value: Float64 | float) -> Float64:
        """
        Return a value of a variable, inside of what is valid.
        """
        valid = self.term.valid.get(name)
        if valid and isinstance(value, float):  # as of most names, thousands of times
            value = min(max(value, valid[0]), valid[1])
        elif valid:
            value = np.clip(value, *valid)
        return np.asarray(value, np.float64)


def worth(expression: str, names: Mapping[str, Float64 | float]) -> Float64:
    """
    Return what a formula that was checked is worth.

    Parameters
    ----------
    expression
    names
        Of parameters and of `NAMES`, those that it holds.
    """
    known = {name: np.asarray(value, np.float64) for name, value in names.items()}
    with np.errstate(all='ignore'):
        found = Formula.parse(expression).walk(Values(), known)
    # far outside of what is probable a fit may try anything
    if np.isfinite(found).all():
        return found
    result: Float64 = np.nan_to_num(found, nan=0.0, posinf=1e15, neginf=-1e15)
    return result
