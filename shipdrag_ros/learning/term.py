# SPDX-License-Identifier: Apache-2.0
"""
A learnt effect as data: a term with units, what its parameters are, and what it rests on.

A file may come from anywhere. It is read as plain data, every value is checked, and the formula
is never run: `expression` walks it.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field
from enum import StrEnum, auto
from functools import cached_property, partial
from os import PathLike

import numpy as np

from shipdrag_ros.errors import EffectFileError
from shipdrag_ros.fields import Key as FieldKey
from shipdrag_ros.fields import (
    Kind,
    Problems,
    choice,
    declare,
    flag,
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
from shipdrag_ros.learning.expression import (
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
from shipdrag_ros.parameter import Parameter, Prior, log_normal, normal
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import GRAVITY_M_S2, Ship
from shipdrag_ros.simulation.action import Action
from shipdrag_ros.simulation.effect import DAY_S, Effect, Frame, Scope
from shipdrag_ros.simulation.effects import LIBRARY
from shipdrag_ros.simulation.scenario import Scenario, Turn

CHANNELS = ('force', 'water', 'log', 'ground', 'inertia')
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
OWN = frozenset(LIBRARY)
"""Names of the library itself."""

_NAME = re.compile(r'[a-z][a-z0-9_]{0,59}')
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
_KNOTS = 24  # of a force in time: straight between them
_FOR_EVER_S = 1e7
_SIZE_SD, _SHAPE_SD = 0.5, 0.05  # of logarithms: a later size may differ, its form hardly
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
    scope: str = declare(choice(*Scope), 'what it belongs to')
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


_KEYS = {
    'name': FieldKey(text(), 'what it is called', MISSING),
    'term': FieldKey(section(TermForm), 'what it is', MISSING),
    'parameters': FieldKey(
        named(section(TermParameter)), 'its parameters, the size first', MISSING
    ),
    'covariance': FieldKey(
        list_of(numbers(-1e12, 1e12, minimum=1)), 'of the parameters, in their order', ()
    ),
    'evidence': FieldKey(section(TermEvidence), 'what it rests on', None),
    'looks_like': FieldKey(list_of(text()), 'effects of nearly the same trace', ()),
    'limits': FieldKey(named(section(TermLimit)), 'how large parameters can be', None),
}


@dataclass(frozen=True, kw_only=True)
class LearntTerm:
    """
    A term that was checked.

    Attributes
    ----------
    name
    form
        What acts, where, and by which formula.
    parameters
        By name; the first is the size.
    covariance
        Rows, in the order of the parameters; empty where it is not stated.
    evidence
        None of a term that somebody declared.
    looks_like
        Effects that leave nearly the same trace.
    limits
        By parameter.

    Examples
    --------
    >>> from shipdrag_ros.learning.term import LearntTerm
    >>> term = LearntTerm.from_yaml('''
    ... name: weed
    ... term: {channel: force, scope: hull, variable: speed, shape: step,
    ...   expression: "0.5*rho*A*L**2*u**2*step(u_c*sqrt(g*L) - u, 0.02*sqrt(g*L))",
    ...   valid: {u: [1.1, 7.9]}}
    ... parameters: {A: {value: 0.0014, sd: 0.0002, unit: 1}, u_c: {value: 0.09, sd: 0.01}}
    ... ''')
    >>> term.effect().scope.value
    'hull'
    """

    name: str
    form: TermForm
    parameters: Mapping[str, TermParameter] = field(hash=False)
    covariance: tuple[tuple[float, ...], ...] = ()
    evidence: TermEvidence | None = None
    looks_like: tuple[str, ...] = ()
    limits: Mapping[str, TermLimit] | None = field(default=None, hash=False)

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
        read = read_keys(
            _KEYS, parse(content, subject=subject, error=EffectFileError), '', problems
        )
        if problems:
            raise EffectFileError(subject, problems)
        try:
            return cls(form=read.pop('term'), **read)
        except EffectFileError as error:
            raise EffectFileError(subject, error.problems) from None

    def to_yaml(self) -> str:
        """
        Return the text of a file.
        """
        from ruamel.yaml import YAML

        whole = {
            'name': self.name,
            'term': plain(self.form),
            'parameters': plain(self.parameters),
            'covariance': plain(self.covariance) or None,
            'evidence': plain(self.evidence),
            'looks_like': plain(self.looks_like) or None,
            'limits': plain(self.limits),
        }
        writer, stream = YAML(), io.StringIO()
        writer.default_flow_style = None
        writer.width = 110
        writer.dump({key: value for key, value in whole.items() if value is not None}, stream)
        return stream.getvalue()

    @cached_property
    def formula(self) -> Formula:
        """Of the expression."""
        return Formula.parse(self.form.expression)

    def force_n(self, frame: Frame, values: tuple[float, ...], speed_m_s: Float64) -> Float64:
        """
        Return the force at speeds (n,), at the stop [N].

        Beyond the speeds that it holds for it goes on as the square of the speed.
        """
        low, high = self.form.valid.get('u', (0.0, math.inf))
        inside = np.clip(speed_m_s, low, high)
        force = self._worth(frame, values, inside, 0.0)
        beyond = np.where(inside > 0.0, speed_m_s / np.maximum(inside, 1e-9), 1.0) ** 2
        found: Float64 = np.broadcast_to(force, np.shape(speed_m_s)) * beyond
        return found

    def act(self, frame: Frame, *values: float) -> Action:
        """
        Return what it does, as an effect of the library does.
        """
        if self.form.channel == 'log':
            return Action(log_error=(partial(self._reading_m_s, frame, values),))
        if 't' not in self.formula.names:
            return Action(resistance=(partial(self.force_n, frame, values),))
        return Action(turns=self._in_time(frame, values))

    def effect(self) -> Effect:
        """
        Return it as an effect of the library.
        """
        size, *_ = self.parameters
        seen = len(self.evidence.runs) if self.evidence else 0
        return Effect(
            name=self.name,
            scope=Scope(self.form.scope),
            parameters=tuple(
                Parameter(
                    each.value,
                    name=name,
                    unit='' if each.unit == '1' else each.unit,
                    meaning='size' if name == size else 'of its curve',
                    prior=_prior(each, _SIZE_SD if name == size else _SHAPE_SD),
                    low=-1e9 if each.value <= 0.0 else 0.0,
                    high=1e9,
                )
                for name, each in self.parameters.items()
            ),
            formula=self.form.expression,
            source=f'learnt from {seen} runs' if seen else 'declared by a file',
            act=self.act,
            errs_in=('speed_through_water',) if self.form.channel == 'log' else (),
            lasts_s=0.0 if self.form.scope == Scope.RUN else 365.0 * DAY_S,
        )

    def _reading_m_s(
        self, frame: Frame, values: tuple[float, ...], speed_m_s: Float64, since_s: Float64
    ) -> Float64:
        """Return what the log reads too much; before the stop, as at the stop."""
        speed = np.clip(speed_m_s, *self.form.valid.get('u', (0.0, math.inf)))
        since = np.clip(since_s, *self.form.valid.get('t', (0.0, math.inf)))
        found: Float64 = np.broadcast_to(
            self._worth(frame, values, speed, since), np.shape(speed_m_s)
        )
        return found

    def _worth(
        self,
        frame: Frame,
        values: tuple[float, ...],
        speed_m_s: Float64,
        time_s: Float64 | float,
    ) -> Float64:
        ship, scenario = frame.ship, frame.scenario
        names = {
            'rho': ship.water.density_kg_m3,
            'g': GRAVITY_M_S2,
            'L': ship.length_m,
            'nabla': ship.displaced_volume_m3,
            'u': speed_m_s,
            't': time_s,
            'psi': scenario.heading_rad,
            **{
                name: float(np.clip(value, *self.form.valid.get(name, (0.0, math.inf))))
                for name, value in (('d', scenario.day), ('h', scenario.depth_m))
            },
            **dict(zip(self.parameters, values, strict=True)),
        }
        with np.errstate(all='ignore'):
            found = self.formula.walk(
                Values(), {name: np.asarray(value, np.float64) for name, value in names.items()}
            )
        # far outside of what is probable a fit may try anything
        result: Float64 = np.nan_to_num(found, nan=0.0, posinf=1e15, neginf=-1e15)
        return result

    def _in_time(self, frame: Frame, values: tuple[float, ...]) -> tuple[Turn, ...]:
        """Return a drag over the square of the speed that grows and falls in time."""
        low, high = self.form.valid.get('t', (0.0, math.inf))
        last = max(frame.scenario.duration_s, 1.0)
        knots = np.linspace(0.0, last, _KNOTS + 1)
        # where much happens early, as of a decay, knots stand closer there
        knots = last * (knots / last) ** 1.5
        at = np.clip(knots, low, high)
        force = self._worth(frame, values, np.asarray(1.0), at)
        density = frame.ship.water.density_kg_m3
        area = np.broadcast_to(2.0 * force / density, knots.shape)
        turns = [Turn(0.0, _FOR_EVER_S, 0.0, float(area[0]))]
        for start, end, more in zip(knots[:-1], knots[1:], np.diff(area), strict=True):
            edge = float(end - start)
            turns.append(
                Turn(float(start) + 0.5 * edge, _FOR_EVER_S, 0.0, float(more), edge_s=edge)
            )
        return tuple(turn for turn in turns if turn.drag_area_m2 != 0.0)


def _prior(parameter: TermParameter, least_sd: float) -> Prior:
    """Return what is expected of a parameter in later runs."""
    value, sd = parameter.value, parameter.sd
    if value == 0.0 or sd > 0.5 * abs(value):
        return normal(max(sd, 1e-12), mean=value)
    return log_normal(value, max(sd / abs(value), least_sd))


def _problems(term: LearntTerm) -> list[str]:
    """Return everything that is wrong with a term."""
    found = _plain_problems(term)
    channel, variable = term.form.channel, term.form.variable
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
    found = list(_name_problems(term.name))
    count = len(term.parameters)
    if not 1 <= count <= MOST_PARAMETERS:
        found.append(f'parameters: {count} of them, expected 1..{MOST_PARAMETERS}')
    for name in term.parameters:
        if not re.fullmatch(r'[A-Za-z][A-Za-z0-9_]{0,29}', name) or name in NAMES:
            found.append(f'parameters: {name[:40]!r} cannot be a name of a parameter')
    for name, ends in term.form.valid.items():
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


def check_name(name: str) -> str:
    """
    Return a name that a term may have.

    Raises
    ------
    EffectFileError
        If it may not.
    """
    problems = list(_name_problems(name))
    if problems:
        raise EffectFileError(name[:60], problems)
    return name


def _name_problems(name: str) -> Iterator[str]:
    if not _NAME.fullmatch(name):
        yield f'name: {name[:60]!r}, expected small letters, digits and _'
    if name in OWN:
        yield f'name: {name!r} is an effect of the library; give it another'


_NONE = TermEvidence((), 0.0, 0.0, False, 0.0)
_NEEDS = {'speed': 'u', 'time': 't', 'heading': 'psi', 'date': 'd', 'depth': 'h'}


def _refuse_wrong_variable(term: LearntTerm) -> None:
    """Expect the variable that is stated, and of the others the speed at most."""
    mine = _NEEDS[term.form.variable]
    names = set(term.formula.names)
    if mine not in names and term.form.shape != 'constant':
        raise FormulaError(f'goes by {term.form.variable}, and {mine} is not in it')
    for other in {'t', 'psi', 'd', 'h'} - {mine}:
        if other in names:
            raise FormulaError(f'goes by {term.form.variable}, and {other} is in it')
    if mine != 'psi' and mine in names and mine not in term.form.valid:
        raise FormulaError(f'has {mine} in it, and valid does not say between what it holds')


def _boxes(term: LearntTerm) -> dict[str, Range]:
    """Return ranges of all names, in boxes that cover all ships and what is valid."""
    axes = {}
    for name, ends in _AXES.items():
        valid = term.form.valid.get(name)
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
    some = Frame(
        Ship(length_m=100.0, displaced_volume_m3=9000.0),
        Scenario(speed_m_s=1.0, heading_rad=0.3),
        0.0,
    )
    low, high = term.form.valid.get('u', (0.5, 8.0))
    speed = np.linspace(max(low, 0.05 * high), high, 7)
    last = term.form.valid.get('t', (0.0, 1e3))[1]
    for share in (0.0, 0.1, 0.5, 1.0):
        worth = np.broadcast_to(term._worth(some, values, speed, share * last), speed.shape)
        if not is_finite(worth):
            raise FormulaError('is no finite number inside its valid range')
        over = worth / speed**2
        force_in_time = term.form.channel == 'force' and 't' in term.formula.names
        if force_in_time and np.ptp(over) > _ALIKE * np.abs(over).max():
            raise FormulaError('goes by time, and is not u**2 times a function of t alone')
