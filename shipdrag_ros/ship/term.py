# SPDX-License-Identifier: Apache-2.0
"""
An effect as data: a term with units, what its parameters are, and what it rests on.

The library's are declared so, and those that are learnt. A file may come from anywhere. It is read
as plain data, every value is checked, and the formulas are never run: `expression` walks them.
`simulation.declared` makes an effect of it.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum, auto
from functools import cached_property
from os import PathLike

import numpy as np

from shipdrag_ros.errors import EffectFileError
from shipdrag_ros.fields import (
    INVALID,
    Kind,
    Problems,
    choice,
    declare,
    dotted,
    flag,
    keys_of,
    list_of,
    named,
    number,
    numbers,
    parse,
    plain,
    read_keys,
    section,
    show,
    text,
    text_of,
)
from shipdrag_ros.parameter import Prior, Shape
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship.expression import (
    PURE,
    Formula,
    FormulaError,
    Range,
    Ranges,
    Unit,
    Units,
    Values,
    is_finite,
    unit_text,
)
from shipdrag_ros.ship.sections import GRAVITY_M_S2

SCOPES = ('hull', 'earth', 'sensor', 'run')
SHAPES = ('constant', 'power', 'step', 'ramp', 'hump', 'decay', 'periodic')


class Variable(StrEnum):
    """What a term goes by."""

    SPEED = auto()
    TIME = auto()
    HEADING = auto()
    RELATIVE_ANGLE = auto()
    DEPTH = auto()
    SHAFT = auto()
    WIND = auto()
    POSITION = auto()
    DATE = auto()


_CONSTANT: tuple[str, ...] = ('speed',)  # by nothing: even over the speed
ACTING: Mapping[str, tuple[str, ...]] = {
    'force': ('speed', 'time', 'heading', 'date', 'depth'),
    'water': ('speed', 'time'),
    'air': _CONSTANT,
    'log': ('speed', 'time'),
    'ground': _CONSTANT,
    'inertia': _CONSTANT,
    'clock': _CONSTANT,
    'filter': _CONSTANT,
    'shaft': _CONSTANT,
    'depth': _CONSTANT,
}
"""What a term acts on, with the variables by which that can be simulated."""
CHANNELS = tuple(ACTING)
_SPEED: Unit = (0.0, 1.0, -1.0)
_LENGTH: Unit = (0.0, 1.0, 0.0)
_TIME: Unit = (0.0, 0.0, 1.0)
_FORCE: Unit = (1.0, 1.0, -2.0)
_MASS: Unit = (1.0, 0.0, 0.0)
RESULT: Mapping[str, tuple[Unit, ...]] = {
    'force': (_FORCE,),
    'water': (_SPEED,),
    'air': (_SPEED,),
    'log': (_SPEED, PURE),
    'ground': (PURE,),
    'inertia': (PURE, _MASS),
    'clock': (_TIME,),
    'filter': (_TIME,),
    'shaft': (_SPEED,),
    'depth': (_LENGTH,),
}
"""
Of a resistance; of the velocity of water and air, along the first run and to port of it; of what
the log reads too much, or its share of the speed; of the share by which distances over ground are
too long; of what n_r is larger by, or the mass; of the time by which the log is late, and that of
its filter; of the speed below which the flow does not turn the propeller; of the depth.
"""
_GOES_BY = {'force': {'u', 't'}, 'log': {'u', 't'}, 'water': {'t'}}
_VECTORS = ('water', 'air')
_BY_SPEED = {'u', 'R_T', 'R_V', 'R_F'}
NAMES: dict[str, Unit] = {
    'rho': (1.0, -3.0, 0.0),
    'g': (0.0, 1.0, -2.0),
    'L': _LENGTH,
    'nabla': (0.0, 3.0, 0.0),
    'B_WL': _LENGTH,
    'T_M': _LENGTH,
    'D_P': _LENGTH,
    'n_r': PURE,
    'R_T': _FORCE,
    'R_V': _FORCE,
    'R_F': _FORCE,
    'u': _SPEED,
    't': _TIME,
    't_end': _TIME,
    'psi': PURE,
    'd': PURE,
    'h': _LENGTH,
    'pi': PURE,
}
"""
Density, gravity; of the ship length, displaced volume, breadth, draught, diameter of the
propeller, n_r at half of her speed at the stop; her resistance at u in calm deep water without
that of the air, its viscous part and of that the friction (1 + k) C_F; speed through water, time
since the stop, that at the end of the record, yaw, days since 1970 and depth of the water at the
stop.
"""
UNITS: dict[str, Unit] = {
    '1': PURE,
    'rad': PURE,
    'm': _LENGTH,
    'm2': (0.0, 2.0, 0.0),
    'm^2': (0.0, 2.0, 0.0),
    's': _TIME,
    'm/s': _SPEED,
    'm/s2': (0.0, 1.0, -2.0),
    'kg': _MASS,
    'N': _FORCE,
}
COUNTED_IN = {
    'V^(2/3)': 'nabla**(2/3)',
    'sqrt(g L)': 'sqrt(g*L)',
    'draught': 'T_M',
    'weight of the ship': 'rho*g*nabla',
}
"""What sizes may be counted in, so that one prior serves ships of all sizes."""
_PRIORS = {
    shape.name.lower().replace('_', '-'): shape
    for shape in (
        Shape.NORMAL,
        Shape.HALF_NORMAL,
        Shape.LOG_NORMAL,
        Shape.EITHER_SIGN,
        Shape.UNIFORM,
    )
}
MOST_PARAMETERS = 6

NAME = re.compile(r'(?!(none|unknown)$)[a-z][a-z0-9_]{0,59}')
"""Of a term; none and unknown are answers of a diagnosis."""
EXPECTED_NAME = 'small letters, digits and _, and not none or unknown'
_ANY = (-math.inf, math.inf)
_SIDES_SD = 3.0  # of a parameter, inside which a formula must be sound
_OF_HULL = {  # over the length of a ship
    'B_WL': (0.05, 0.6),
    'T_M': (0.01, 0.3),
    'D_P': (0.005, 0.2),
}
_OF_SHIP = {  # whatever she is
    'n_r': (0.0, 1.0),
    'R_T': (0.0, 1e10),
    'R_V': (0.0, 1e10),
    'R_F': (0.0, 1e10),
    'rho': (990.0, 1035.0),
    'g': (GRAVITY_M_S2, GRAVITY_M_S2),
    'pi': (math.pi, math.pi),
}
_AXES = {
    'L': (2.0, 10.0, 30.0, 100.0, 200.0, 400.0),  # of ships that a term may be carried to
    'u': tuple(np.linspace(0.0, 20.0, 17).tolist()),
    't': tuple(np.linspace(0.0, 86400.0, 9).tolist()),
    't_end': (1.0, 86400.0),
    'psi': (-math.pi, 0.0, math.pi),
    'd': tuple(np.linspace(0.0, 40000.0, 9).tolist()),
    'h': tuple(np.geomspace(0.5, 1e4, 17).tolist()),
}
"""Ends of the boxes in which ranges are looked at, where a term does not say what is valid."""
_WIDEST = 5.0  # sd of the logarithm of a size
_ALIKE = 1e-6  # relative
_ROUNDING = 1e-3  # of correlations in a text


def _unit() -> Kind:
    """Expect a unit of the list; 1 may be written as a number."""
    words = choice(*UNITS)

    def read(value: object, path: str, problems: Problems) -> object:
        return words.read('1' if value == 1 and value is not True else value, path, problems)

    return Kind(read, words.expectation, choices=words.choices)


def _prior() -> Kind:
    """Expect the shape of a prior and its two numbers."""
    two = numbers(-1e9, 1e9)
    expectation = f'[{" | ".join(_PRIORS)}, number, number]'

    def read(value: object, path: str, problems: Problems) -> object:
        if not (isinstance(value, list) and len(value) == 3 and value[0] in (*_PRIORS,)):
            problems.append(f'{path}: {show(value)}, expected {expectation}')
            return INVALID
        row = two.read(value[1:], path, problems)
        if row is INVALID:
            return INVALID
        shape, (first, second) = _PRIORS[value[0]], row
        logarithmic = shape in (Shape.LOG_NORMAL, Shape.EITHER_SIGN)
        if second <= (first if shape is Shape.UNIFORM else 0.0) or (
            logarithmic and not (first and second <= _WIDEST)
        ):
            problems.append(f'{path}: {show(value)}, a prior without a size, or of no width')
            return INVALID
        return value[0], first, second

    return Kind(read, expectation)


@dataclass(frozen=True)
class TermPart:
    """Something that an effect does beside its first formula."""

    channel: str = declare(choice(*CHANNELS), 'what it adds to')
    expression: str = declare(text(), 'the formula')
    to_port: str | None = declare(text(), 'of a velocity: the formula abeam', default=None)


@dataclass(frozen=True)
class TermForm:
    """The key `term` of a file: what acts, where, and by which formula."""

    channel: str = declare(choice(*CHANNELS), 'what it adds to')
    scope: str = declare(choice(*SCOPES), 'what it belongs to')
    variable: str = declare(choice(*Variable), 'what it goes by')
    shape: str = declare(choice(*SHAPES), 'its curve, in a word')
    expression: str = declare(text(), 'the formula')
    valid: Mapping[str, tuple[float, float]] = declare(
        named(numbers(0.0, 1e6, ascending=True)), 'between what it holds', hashed=False
    )
    to_port: str | None = declare(text(), 'of a velocity: the formula abeam', default=None)


@dataclass(frozen=True)
class TermParameter:
    """A parameter of a term: as it was found, or with a prior."""

    value: float | None = declare(
        number(-1e9, 1e9), 'value; with a prior: where none is given', default=None
    )
    sd: float = declare(number(0.0, 1e9), 'standard deviation', default=0.0)
    unit: str = declare(_unit(), 'unit', default='1')
    prior: tuple[str, float, float] | None = declare(_prior(), 'before any data', default=None)
    bounds: tuple[float, ...] | None = declare(
        numbers(-1e9, 1e9, ascending=True), 'of what is accepted', default=None
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
        return Prior(_PRIORS[word], first, second)

    @property
    def scale(self) -> str:
        """A formula of what its numbers are counted in."""
        return '1' if self.counted_in is None else COUNTED_IN[self.counted_in]

    @property
    def ends(self) -> tuple[float, float]:
        """Between what it lies most likely, as it is counted."""
        prior = self.before
        if prior is None:
            assert self.value is not None
            low, high = (self.value + side * _SIDES_SD * self.sd for side in (-1.0, 1.0))
            if self.value * low < 0.0 or self.value * high < 0.0:  # a size keeps its sign
                return (0.0, high) if self.value > 0.0 else (low, 0.0)
            return low, high
        ends = [prior.at(z) for z in (-_SIDES_SD, _SIDES_SD)]
        if prior.shape is Shape.HALF_NORMAL:
            ends[0] = 0.0
        if prior.shape is Shape.EITHER_SIGN:
            ends[0] = -ends[1]
        low, high = self.bounds or _ANY
        return min(max(min(ends), low), high), max(min(max(ends), high), low)

    @property
    def either_sign(self) -> bool:
        """Whether it may be below 0."""
        return self.typical <= 0.0 if self.prior is None else self.ends[0] < 0.0

    @property
    def typical(self) -> float:
        """A size that is no rarity, as it is counted."""
        prior = self.before
        if prior is None:
            return self.value or 0.0
        return prior.at(0.0) or prior.at(1.0)


@dataclass(frozen=True)
class TermEvidence:
    """What a term was learnt from; logarithms of odds of evidence."""

    runs: tuple[str, ...] = declare(list_of(text()), 'digests of the runs')
    over_nothing: float = declare(number(-1e6, 1e6), 'ln of the Bayes factor over nothing')
    over_smooth: float = declare(number(-1e6, 1e6), 'the same over something smooth')
    halves_agree: bool = declare(flag(), 'whether each half of the runs shows it')
    held_out_gap_cut: float = declare(
        number(-100.0, 1.0), 'part of the gap of runs left out that it explains'
    )


@dataclass(frozen=True)
class TermLimit:
    """How large a parameter can be."""

    upper_95: float = declare(number(-1e9, 1e9), '95 % quantile')


@dataclass(frozen=True, kw_only=True)
class LearntTerm:
    """
    A term that was checked.

    Examples
    --------
    >>> from shipdrag_ros.ship import LearntTerm
    >>> term = LearntTerm.from_yaml('''
    ... name: weed
    ... term: {channel: force, scope: hull, variable: speed, shape: step,
    ...   expression: "0.5*rho*A*L**2*u**2*step(u_c*sqrt(g*L) - u, 0.02*sqrt(g*L))",
    ...   valid: {u: [1.1, 7.9]}}
    ... parameters: {A: {value: 0.0014, sd: 0.0002, unit: 1}, u_c: {value: 0.09, sd: 0.01}}
    ... ''')
    >>> term.term.scope
    'hull'
    """

    name: str = declare(text(), 'what it is called')
    term: TermForm = declare(section(TermForm), 'what it is')
    parameters: Mapping[str, TermParameter] = declare(
        named(section(TermParameter)), 'its parameters, the size first', hashed=False
    )
    also: tuple[TermPart, ...] = declare(
        list_of(section(TermPart)), 'what it does beside that', default=()
    )
    covariance: tuple[tuple[float, ...], ...] = declare(
        list_of(numbers(-1e12, 1e12, minimum=1)), 'of the parameters, in their order', default=()
    )
    evidence: TermEvidence | None = declare(
        section(TermEvidence), 'what it rests on; none where somebody declared it', default=None
    )
    looks_like: tuple[str, ...] = declare(
        list_of(text()), 'effects of nearly the same trace', default=()
    )
    limits: Mapping[str, TermLimit] | None = declare(
        named(section(TermLimit)), 'how large parameters can be', default=None, hashed=False
    )

    def __post_init__(self) -> None:
        problems = list(_problems(self))
        if problems:
            raise EffectFileError(self.name[:60], problems)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> LearntTerm:
        """
        Read a file.

        Raises
        ------
        EffectFileError
            If it cannot be used; with every problem that was found.
        """
        content = text_of(path, what='a learnt effect (YAML)', error=EffectFileError)
        return cls.from_yaml(content, subject=str(path))

    @classmethod
    def from_yaml(cls, content: str, *, subject: str = 'effect') -> LearntTerm:
        """
        Read a text.

        Parameters
        ----------
        content
        subject
            What it is, for messages.

        Raises
        ------
        EffectFileError
            If it cannot be used; with every problem that was found.
        """
        problems: list[str] = []
        data = parse(content, subject=subject, error=EffectFileError)
        found = learnt_term().read(data, '', problems)
        if problems:
            raise EffectFileError(subject, problems)
        assert isinstance(found, cls)
        return found

    def to_yaml(self) -> str:
        """
        Return the text of a file.
        """
        from ruamel.yaml import YAML

        writer, stream = YAML(), io.StringIO()
        writer.default_flow_style = None
        writer.width = 110
        writer.dump({key: value for key, value in plain(self).items() if value != []}, stream)
        return stream.getvalue()

    @cached_property
    def parts(self) -> tuple[TermPart, ...]:
        """All that it does."""
        return TermPart(self.term.channel, self.term.expression, self.term.to_port), *self.also

    @property
    def formulas(self) -> Iterator[tuple[str, str, str]]:
        """All formulas, with their place in the file and the channel."""
        for i, part in enumerate(self.parts):
            place = f'also[{i - 1}]' if i else 'term'
            yield f'{place}.expression', part.channel, part.expression
            if part.to_port is not None:
                yield f'{place}.to_port', part.channel, part.to_port

    @cached_property
    def units(self) -> tuple[Unit, ...]:
        """What the formula of each part gives."""
        names = NAMES | {name: UNITS[each.unit] for name, each in self.parameters.items()}
        return tuple(Formula.parse(part.expression).walk(Units(), names) for part in self.parts)

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


def learnt_term() -> Kind:
    """
    Expect a learnt term; it is checked as a whole.
    """
    keys = keys_of(LearntTerm)

    def read(value: object, path: str, problems: Problems) -> object:
        before = len(problems)
        accepted = read_keys(keys, value, path, problems)
        if len(problems) > before:
            return INVALID
        try:
            return LearntTerm(**accepted)
        except EffectFileError as error:
            problems.extend(dotted(path, problem) for problem in error.problems)
            return INVALID

    return Kind(read, f'the keys {", ".join(keys)}')


def _problems(term: LearntTerm) -> list[str]:
    """Return everything that is wrong with a term."""
    found = _plain_problems(term)
    channel, variable = term.term.channel, term.term.variable
    if variable not in ACTING.get(channel, ()):
        able = '; '.join(f'{name} by {", ".join(by)}' for name, by in ACTING.items())
        found.append(
            f'term: channel {channel} by {variable} cannot be simulated yet; that can: {able}'
        )
    if found:
        return found
    unused = set(term.parameters)
    for place, at, formula in term.formulas:
        try:
            unused -= _refuse_unsound(term, at, formula, main=place == 'term.expression')
        except FormulaError as error:
            found.append(f'{place}: {error}')
    if unused and not found:
        found.append(f'term.expression: does not use the parameter {min(unused)}')
    return found


def _refuse_unsound(term: LearntTerm, channel: str, text: str, *, main: bool) -> set[str]:
    """Expect a formula of the right unit, finite wherever it holds; return its names."""
    formula = Formula.parse(text)
    units = NAMES | {name: UNITS[each.unit] for name, each in term.parameters.items()}
    unit = formula.walk(Units(), units)
    if unit not in RESULT[channel]:
        needed = ' or '.join(unit_text(each) for each in RESULT[channel])
        raise FormulaError(f'gives {unit_text(unit)}, a {channel} needs {needed}')
    if channel == 'log' and unit == PURE and _BY_SPEED.union('t') & set(formula.names):
        raise FormulaError('is a share of the speed that changes; write it times u')
    _refuse_wrong_variable(term, channel, set(formula.names), main=main)
    formula.walk(Ranges(), _boxes(term, formula.names))
    _refuse_mixed(term, channel, formula)
    return set(formula.names)


def _plain_problems(term: LearntTerm) -> list[str]:
    """Return what is wrong beside the formula."""
    found = []
    if not NAME.fullmatch(term.name):
        found.append(f'name: {term.name[:60]!r}, expected {EXPECTED_NAME}')
    count = len(term.parameters)
    if not 1 <= count <= MOST_PARAMETERS:
        found.append(f'parameters: {count} of them, expected 1..{MOST_PARAMETERS}')
    for name, each in term.parameters.items():
        if each.value is None and each.prior is None:
            found.append(f'parameters.{name[:40]}: neither value nor prior')
        if each.bounds is not None and len(each.bounds) != 2:
            found.append(f'parameters.{name[:40]}.bounds: expected two')
        counted = Formula.parse(each.scale).walk(Units(), NAMES)
        if each.counted_in is not None and UNITS[each.unit] != counted:
            found.append(f'parameters.{name[:40]}.counted_in: is no {each.unit}')
        if not re.fullmatch(r'[A-Za-z][A-Za-z0-9_]{0,29}', name) or name in NAMES:
            found.append(f'parameters: {name[:40]!r} cannot be a name of a parameter')
    if len(term.parts) > MOST_PARAMETERS:
        found.append(f'also: {len(term.also)} formulas, at most {MOST_PARAMETERS - 1}')
    for place, channel, _ in term.formulas:
        if place.endswith('to_port') and channel not in _VECTORS:
            found.append(f'{place}: a {channel} has no direction')
    for name, ends in term.term.valid.items():
        if name not in _NEEDS.values() or name == 'psi' or len(ends) != 2:
            found.append(f'term.valid.{name[:40]}: expected u, t, d or h, with two ends each')
    sizes = {len(row) for row in term.covariance}
    if term.covariance and (len(term.covariance) != count or sizes != {count}):
        found.append(f'covariance: expected {count} rows of {count} numbers')
    elif term.covariance:
        matrix = np.array(term.covariance)
        if not np.allclose(matrix, matrix.T, rtol=1e-6, atol=0.0):
            found.append('covariance: not symmetric')
        elif not _is_covariance(matrix):
            found.append('covariance: no covariance, as a variance of it is negative')
    unknown = [name for name in term.limits or {} if name not in term.parameters]
    if unknown:
        found.append(f'limits.{unknown[0][:40]}: no parameter of this name')
    if term.evidence is not None and len(term.evidence.runs) > 10_000:
        found.append(f'evidence.runs: {len(term.evidence.runs)} runs, at most 10000')
    if any(len(each) > 100 for each in (*term.looks_like, *(term.evidence or _NONE).runs)):
        found.append('looks_like, evidence.runs: a text of more than 100 characters')
    return found


def _is_covariance(matrix: Float64) -> bool:
    """Say whether no variance of a sum is negative, by more than rounding of a text."""
    variance = np.diag(matrix)
    if np.any(variance < 0.0) or np.any(matrix[variance == 0.0] != 0.0):
        return False
    scale = 1.0 / np.sqrt(np.where(variance > 0.0, variance, 1.0))
    return bool(np.linalg.eigvalsh(matrix * np.outer(scale, scale)).min() > -_ROUNDING)


_NONE = TermEvidence((), 0.0, 0.0, False, 0.0)
_NEEDS = {'speed': 'u', 'time': 't', 'heading': 'psi', 'date': 'd', 'depth': 'h'}


def _refuse_wrong_variable(term: LearntTerm, channel: str, names: set[str], *, main: bool) -> None:
    """Expect the variable that is stated, and of the others the speed at most."""
    mine = _NEEDS[term.term.variable]
    variables = {'u' if name in _BY_SPEED else name for name in names} & set(_NEEDS.values())
    if main and mine not in variables and term.term.shape != 'constant':
        raise FormulaError(f'goes by {term.term.variable}, and {mine} is not in it')
    for other in sorted(variables - {mine, 'u'}):
        raise FormulaError(f'goes by {term.term.variable}, and {other} is in it')
    for other in sorted(variables & {'u', 't'} - _GOES_BY.get(channel, set())):
        raise FormulaError(f'is a {channel}, which does not go by {other}')
    if mine in variables and mine not in ('psi', *term.term.valid):
        raise FormulaError(f'has {mine} in it, and valid does not say between what it holds')


def _boxes(term: LearntTerm, names: Collection[str]) -> dict[str, Range]:
    """Return ranges of all names, in boxes that cover all ships and what is valid."""
    axes = {}
    for name, ends in _AXES.items():
        valid = term.term.valid.get(name)
        if name in ('L', *names):
            axes[name] = np.linspace(*valid, len(ends)) if valid else np.array(ends)
    lows = np.meshgrid(*(axis[:-1] for axis in axes.values()), indexing='ij')
    highs = np.meshgrid(*(axis[1:] for axis in axes.values()), indexing='ij')
    found = {
        name: Range(low.ravel(), high.ravel())
        for name, low, high in zip(axes, lows, highs, strict=True)
    }
    length = found['L']
    found['nabla'] = Range(1e-4 * length.low**3, 0.1 * length.high**3)
    found |= {
        name: Range(low * length.low, high * length.high) for name, (low, high) in _OF_HULL.items()
    }
    found |= {
        name: Range(np.array([low]), np.array([high])) for name, (low, high) in _OF_SHIP.items()
    }
    algebra = Ranges()
    for name, each in term.parameters.items():
        counted = Formula.parse(each.scale).walk(algebra, found)
        found[name] = algebra.binary('*', _range(*each.ends), counted)
    return found


def _range(low: float, high: float) -> Range:
    return Range(np.array([low]), np.array([high]))


def _refuse_mixed(term: LearntTerm, channel: str, formula: Formula) -> None:
    """
    Expect what can be simulated.

    A force in time goes as the square of the speed, and water gains evenly in time.
    """
    some: dict[str, Float64 | float] = {name: ends[1] for name, ends in _OF_SHIP.items()}
    some |= {name: 100.0 * ends[1] for name, ends in _OF_HULL.items()}
    some |= {'L': 100.0, 'nabla': 9000.0, 'psi': 0.3, 'd': 20605.0, 'h': 200.0}
    for name, each in term.parameters.items():
        some[name] = each.typical * float(worth(each.scale, some))
    low, high = term.term.valid.get('u', (0.5, 8.0))
    speed = np.linspace(max(low, 0.05 * high), high, 7)
    last = term.term.valid.get('t', (0.0, 1e3))[1]
    shares = np.array([0.0, 0.1, 0.5, 1.0] if 't' in formula.names else [0.0])[:, None]
    rows = np.empty((len(shares), len(speed)))
    for row, share in zip(rows, shares[:, 0], strict=True):
        now = {'u': speed, 't': share * last, 't_end': last}
        row[:] = worth(formula.text, {key: term.inside(key, x) for key, x in (some | now).items()})
        over = row / speed**2
        force_in_time = channel == 'force' and 't' in formula.names
        if force_in_time and np.ptp(over) > _ALIKE * np.abs(over).max():
            raise FormulaError('goes by time, and is not u**2 times a function of t alone')
    if not is_finite(rows):
        raise FormulaError('is no finite number inside its valid range')
    even = rows[0] + shares * (rows[-1] - rows[0])
    if channel == 'water' and np.ptp(even - rows) > _ALIKE * np.ptp(rows):
        raise FormulaError('is water that does not gain evenly in time')
