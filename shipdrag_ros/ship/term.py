# SPDX-License-Identifier: Apache-2.0
"""
A learnt effect as data: a term with units, what its parameters are, and what it rests on.

A file may come from anywhere. It is read as plain data, every value is checked, and the formula
is never run: `expression` walks it. `simulation.learnt` makes an effect of it.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping
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
    text,
    text_of,
)
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

CHANNELS = ('force', 'water', 'log', 'ground', 'inertia')
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


ACTING = {'force': ('speed', 'time', 'heading', 'date', 'depth'), 'log': ('speed', 'time')}
"""What can be simulated today: variables by channel."""
RESULT: dict[str, Unit] = {'force': (1.0, 1.0, -2.0), 'log': (0.0, 1.0, -1.0)}
NAMES: dict[str, Unit] = {
    'rho': (1.0, -3.0, 0.0),
    'g': (0.0, 1.0, -2.0),
    'L': (0.0, 1.0, 0.0),
    'nabla': (0.0, 3.0, 0.0),
    'u': (0.0, 1.0, -1.0),
    't': (0.0, 0.0, 1.0),
    'psi': PURE,
    'd': PURE,
    'h': (0.0, 1.0, 0.0),
}
"""
Density, gravity, length, displaced volume; speed through water, time since the stop, yaw, days
since 1970 and depth of the water at the stop.
"""
UNITS: dict[str, Unit] = {
    '1': PURE,
    'rad': PURE,
    'm': (0.0, 1.0, 0.0),
    'm2': (0.0, 2.0, 0.0),
    's': (0.0, 0.0, 1.0),
    'm/s': (0.0, 1.0, -1.0),
    'm/s2': (0.0, 1.0, -2.0),
    'kg': (1.0, 0.0, 0.0),
    'N': (1.0, 1.0, -2.0),
}
MOST_PARAMETERS = 6

NAME = re.compile(r'[a-z][a-z0-9_]{0,59}')
_ANY = (-math.inf, math.inf)
_SIDES_SD = 3.0  # of a parameter, inside which a formula must be sound
_AXES = {
    'L': (2.0, 10.0, 30.0, 100.0, 200.0, 400.0),  # of ships that a term may be carried to
    'u': tuple(np.linspace(0.0, 20.0, 17).tolist()),
    't': tuple(np.linspace(0.0, 86400.0, 9).tolist()),
    'psi': (-math.pi, 0.0, math.pi),
    'd': tuple(np.linspace(0.0, 40000.0, 9).tolist()),
    'h': tuple(np.geomspace(0.5, 1e4, 17).tolist()),
}
"""Ends of the boxes in which ranges are looked at, where a term does not say what is valid."""
_ALIKE = 1e-6  # relative
_ROUNDING = 1e-3  # of correlations in a text


def _unit() -> Kind:
    """Expect a unit of the list; 1 may be written as a number."""
    words = choice(*UNITS)

    def read(value: object, path: str, problems: Problems) -> object:
        return words.read('1' if value == 1 and value is not True else value, path, problems)

    return Kind(read, words.expectation, choices=words.choices)


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


@dataclass(frozen=True)
class TermParameter:
    """A parameter of a term."""

    value: float = declare(number(-1e9, 1e9), 'value')
    sd: float = declare(number(0.0, 1e9), 'standard deviation')
    unit: str = declare(_unit(), 'unit', default='1')


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
    def formula(self) -> Formula:
        """Of the expression."""
        return Formula.parse(self.term.expression)

    def worth(self, known: Mapping[str, Float64 | float], values: tuple[float, ...]) -> Float64:
        """
        Return what the formula is worth; of time, date and depth, inside of what is valid.

        Parameters
        ----------
        known
            Of the names of a formula.
        values
            Of the parameters, in their order.
        """
        names = {
            name: value if name == 'u' else np.clip(value, *self.term.valid.get(name, _ANY))
            for name, value in known.items()
        }
        names |= dict(zip(self.parameters, values, strict=True))
        with np.errstate(all='ignore'):
            found = self.formula.walk(
                Values(), {name: np.asarray(value, np.float64) for name, value in names.items()}
            )
        # far outside of what is probable a fit may try anything
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
    try:
        formula = term.formula
        units = NAMES | {name: UNITS[each.unit] for name, each in term.parameters.items()}
        unit = formula.walk(Units(), units)
        if unit != RESULT[channel]:
            raise FormulaError(
                f'gives {unit_text(unit)}, a {channel} needs {unit_text(RESULT[channel])}'
            )
        unused = [name for name in term.parameters if name not in formula.names]
        if unused:
            raise FormulaError(f'does not use the parameter {unused[0]}')
        _refuse_wrong_variable(term)
        formula.walk(Ranges(), _boxes(term))
        _refuse_mixed(term)
    except FormulaError as error:
        found.append(f'term.expression: {error}')
    return found


def _plain_problems(term: LearntTerm) -> list[str]:
    """Return what is wrong beside the formula."""
    found = []
    if not NAME.fullmatch(term.name):
        found.append(f'name: {term.name[:60]!r}, expected small letters, digits and _')
    count = len(term.parameters)
    if not 1 <= count <= MOST_PARAMETERS:
        found.append(f'parameters: {count} of them, expected 1..{MOST_PARAMETERS}')
    for name in term.parameters:
        if not re.fullmatch(r'[A-Za-z][A-Za-z0-9_]{0,29}', name) or name in NAMES:
            found.append(f'parameters: {name[:40]!r} cannot be a name of a parameter')
    for name, ends in term.term.valid.items():
        if name not in _AXES or name in ('L', 'psi') or len(ends) != 2:
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


def _refuse_wrong_variable(term: LearntTerm) -> None:
    """Expect the variable that is stated, and of the others the speed at most."""
    mine = _NEEDS[term.term.variable]
    names = set(term.formula.names)
    if mine not in names and term.term.shape != 'constant':
        raise FormulaError(f'goes by {term.term.variable}, and {mine} is not in it')
    for other in {'t', 'psi', 'd', 'h'} - {mine}:
        if other in names:
            raise FormulaError(f'goes by {term.term.variable}, and {other} is in it')
    if mine != 'psi' and mine in names and mine not in term.term.valid:
        raise FormulaError(f'has {mine} in it, and valid does not say between what it holds')


def _boxes(term: LearntTerm) -> dict[str, Range]:
    """Return ranges of all names, in boxes that cover all ships and what is valid."""
    axes = {}
    for name, ends in _AXES.items():
        valid = term.term.valid.get(name)
        if name in ('L', *term.formula.names):
            axes[name] = np.linspace(*valid, len(ends)) if valid else np.array(ends)
    lows = np.meshgrid(*(axis[:-1] for axis in axes.values()), indexing='ij')
    highs = np.meshgrid(*(axis[1:] for axis in axes.values()), indexing='ij')
    found = {
        name: Range(low.ravel(), high.ravel())
        for name, low, high in zip(axes, lows, highs, strict=True)
    }
    length = found['L']
    found['nabla'] = Range(1e-4 * length.low**3, 0.1 * length.high**3)
    for name, ends in (('rho', (990.0, 1035.0)), ('g', (GRAVITY_M_S2, GRAVITY_M_S2))):
        found[name] = Range(np.array([ends[0]]), np.array([ends[1]]))
    for name, each in term.parameters.items():
        low, high = (each.value + side * _SIDES_SD * each.sd for side in (-1.0, 1.0))
        if each.value * low < 0.0 or each.value * high < 0.0:  # a size keeps its sign
            low, high = (0.0, high) if each.value > 0.0 else (low, 0.0)
        found[name] = Range(np.array([low]), np.array([high]))
    return found


def _refuse_mixed(term: LearntTerm) -> None:
    """Expect what can be simulated: a force in time goes as the square of the speed."""
    values = tuple(each.value for each in term.parameters.values())
    some: dict[str, Float64 | float] = {
        'rho': 1000.0,
        'g': GRAVITY_M_S2,
        'L': 100.0,
        'nabla': 9000.0,
        'psi': 0.3,
    }
    low, high = term.term.valid.get('u', (0.5, 8.0))
    speed = np.linspace(max(low, 0.05 * high), high, 7)
    last = term.term.valid.get('t', (0.0, 1e3))[1]
    for share in (0.0, 0.1, 0.5, 1.0):
        known = some | {'u': speed, 't': share * last, 'd': 20605.0, 'h': 200.0}
        worth = np.broadcast_to(term.worth(known, values), speed.shape)
        if not is_finite(worth):
            raise FormulaError('is no finite number inside its valid range')
        over = worth / speed**2
        force_in_time = term.term.channel == 'force' and 't' in term.formula.names
        if force_in_time and np.ptp(over) > _ALIKE * np.abs(over).max():
            raise FormulaError('goes by time, and is not u**2 times a function of t alone')
