# SPDX-License-Identifier: Apache-2.0
"""What a file says that an effect does: formulas, and their parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

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
)
from shipdrag_ros.parameter import Prior, Shape
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship.expression import Formula, Unit, Units, Values
from shipdrag_ros.ship.vocabulary import (
    CHANNELS,
    COUNTED_IN,
    OWN_UNITS,
    PRIORS,
    SCOPES,
    SHAPES,
    UNITS,
    VARIABLES,
)

_ANY = (-math.inf, math.inf)
_MOST = 1e9  # of a number
_WIDEST = 5.0  # sd of the logarithm of a size
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
            problems.append(f'{path}: {show(value)}, expected {expectation}')
            return INVALID
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
    def before(self) -> Prior | None:
        """Its prior, where one is stated."""
        if self.prior is None:
            return None
        word, first, second = self.prior
        return Prior(PRIORS[word], first, second)

    @property
    def scale(self) -> str:
        """A formula of what its numbers are counted in."""
        return '1' if self.counted_in is None else COUNTED_IN[self.counted_in]

    def within(self, sds: float) -> tuple[float, float]:
        """Return between what it lies, so many standard deviations about the middle."""
        prior = self.before
        if prior is None:
            assert self.value is not None
            low, high = (self.value + side * sds * self.sd for side in (-1.0, 1.0))
            if self.value * low < 0.0 or self.value * high < 0.0:  # a size keeps its sign
                return (0.0, high) if self.value > 0.0 else (low, 0.0)
            return low, high
        low, high = sorted(prior.at(z) for z in (-sds, sds))
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
        either_sign = self.typical <= 0.0 if self.prior is None else self.ends[0] < 0.0
        return -_MOST if either_sign else 0.0, _MOST

    @property
    def typical(self) -> float:
        """A size that is no rarity, as it is counted."""
        prior = self.before
        if prior is None:
            return self.value or 0.0
        return prior.at(0.0) or prior.at(1.0)


@dataclass(frozen=True, kw_only=True)
class DeclaredTerm:
    """What an effect does; whether it can be so, `soundness` says."""

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
        return np.asarray(np.clip(value, *self.term.valid.get(name, _ANY)), np.float64)


def worth(expression: str, names: Mapping[str, Float64 | float]) -> Float64:
    """
    Return what a formula that was checked is worth.

    Parameters
    ----------
    expression
    names
        Of parameters and of `NAMES`, those that it holds.
    """
    with np.errstate(all='ignore'):
        found = Formula.parse(expression).walk(
            Values(), {name: np.asarray(value, np.float64) for name, value in names.items()}
        )
    # far outside of what is probable a fit may try anything
    if np.isfinite(found).all():
        return found
    result: Float64 = np.nan_to_num(found, nan=0.0, posinf=1e15, neginf=-1e15)
    return result
