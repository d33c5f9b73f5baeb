# SPDX-License-Identifier: Apache-2.0
"""
Effects as data: terms with units, what their parameters are, and what they rest on.

The library's are declared so, and those that are learnt. They may come from anywhere, each in a
file or all in a ship file. They are read as plain data, every value is checked, and the formulas
are never run: `expression` walks them. `simulation.declared` makes effects of them.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from os import PathLike
from pathlib import Path
from pkgutil import iter_modules

import numpy as np

from shipdrag_ros.errors import EffectFileError
from shipdrag_ros.fields import (
    INVALID,
    Kind,
    Problems,
    declare,
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
    unexpected,
)
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship.declared import (
    BY_SPEED,
    CHANNELS,
    NAMES,
    OWN_UNITS,
    UNITS,
    VARIABLES,
    DeclaredTerm,
    TermParameter,
    worth,
)
from shipdrag_ros.ship.expression import (
    PURE,
    Formula,
    FormulaError,
    Range,
    Ranges,
    Units,
    unit_text,
)

_MOST_PARAMETERS = 6
_ALIKE = 1e-6  # relative
_MOSTLY_SD = 2.0  # of a prior, that must be inside of the bounds
_SIZES: tuple[Callable[[TermParameter], float], ...] = (
    lambda each: each.expected.typical if each.value is None else each.value,
    lambda each: max(each.within(1.0), key=abs),
    lambda each: each.expected.typical,
)
"""Sizes that are judged; by the last, how it changes too."""


def problems_of(term: DeclaredTerm) -> list[str]:
    """
    Return everything that is wrong with a term.
    """
    found = [*_of_parameters(term), *_of_form(term)]
    if found:
        return found
    unused = set(term.parameters)
    for place, channel, formula in term.formulas:
        try:
            unused -= _refuse_unsound(term, channel, formula, main=place == 'term.expression')
        except FormulaError as error:
            found.append(f'{place}: {error}')
    if unused and not found:
        found.append(f'term.expression: does not use the parameter {min(unused)}')
    return found


def _of_parameters(term: DeclaredTerm) -> Iterator[str]:
    count = len(term.parameters)
    if not 1 <= count <= _MOST_PARAMETERS:
        yield f'parameters: {count} of them, expected 1..{_MOST_PARAMETERS}'
    for name, each in term.parameters.items():
        if not re.fullmatch(r'[A-Za-z][A-Za-z0-9_]{0,29}', name) or name in NAMES:
            yield f'parameters: {name[:40]!r} cannot be a name of a parameter'
        yield from (f'parameters.{name[:40]}{wrong}' for wrong in _of_parameter(each))


def _of_parameter(each: TermParameter) -> Iterator[str]:
    counted = Formula.parse(each.scale).walk(Units(), OWN_UNITS)
    if each.counted_in is not None and UNITS[each.unit] != counted:
        yield f'.counted_in: is no {each.unit}'
    if each.value is None and each.prior is None:
        yield ': neither value nor prior'
    elif each.bounds is not None and len(each.bounds) != 2:
        yield '.bounds: expected two'
    else:
        low, high = each.accepted
        if each.value is not None and not low <= each.value <= high:
            yield f'.value: {each.value:g}, and {low:g}..{high:g} is accepted'
        first, last = each.within(_MOSTLY_SD) if each.prior else (low, high)
        if not low <= first <= last <= high:
            yield f'.prior: {first:g}..{last:g} is likely, and {low:g}..{high:g} is accepted'


def _of_form(term: DeclaredTerm) -> Iterator[str]:
    """Yield what is wrong beside parameters and formulas."""
    channel, variable = term.term.channel, term.term.variable
    if variable not in CHANNELS[channel].by:
        able = '; '.join(f'{name} by {", ".join(each.by)}' for name, each in CHANNELS.items())
        yield f'term: channel {channel} by {variable} cannot be simulated yet; that can: {able}'
    if len(term.parts) > _MOST_PARAMETERS:
        yield f'also: {len(term.also)} formulas, at most {_MOST_PARAMETERS - 1}'
    for place, acts_on, _ in term.formulas:
        if place.endswith('to_port') and not CHANNELS[acts_on].is_vector:
            yield f'{place}: a {acts_on} has no direction'
    for name, ends in term.term.valid.items():
        if name not in VARIABLES.values() or name == 'psi' or len(ends) != 2:
            yield f'term.valid.{name[:40]}: expected u, t, d or h, with two ends each'


def _refuse_unsound(term: DeclaredTerm, channel: str, text: str, *, main: bool) -> set[str]:
    """Expect a formula of the right unit, finite wherever it holds; return its names."""
    formula = Formula.parse(text)
    unit, most = formula.walk(Units(), term.names), CHANNELS[channel].most
    if unit not in most:
        needed = ' or '.join(unit_text(each) for each in most)
        raise FormulaError(f'gives {unit_text(unit)}, a {channel} needs {needed}')
    if channel == 'log' and unit == PURE and {'u', 't', *BY_SPEED} & set(formula.names):
        raise FormulaError('is a share of the speed that changes; write it times u')
    _refuse_wrong_variable(term, channel, set(formula.names), main=main)
    formula.walk(Ranges(), _boxes(term, formula.names))
    _refuse_mixed(term, channel, formula, most[unit])
    return set(formula.names)


def _refuse_wrong_variable(
    term: DeclaredTerm, channel: str, names: set[str], *, main: bool
) -> None:
    """Expect the variable that is stated, and of the others the speed at most."""
    mine = VARIABLES[term.term.variable]
    variables = {'u' if name in BY_SPEED else name for name in names} & {*VARIABLES.values()}
    if main and mine not in variables and term.term.shape != 'constant':
        raise FormulaError(f'goes by {term.term.variable}, and {mine} is not in it')
    for other in sorted(variables - {mine, 'u'}):
        raise FormulaError(f'goes by {term.term.variable}, and {other} is in it')
    for other in sorted(variables & {'u', 't'} - set(CHANNELS[channel].during)):
        raise FormulaError(f'is a {channel}, which does not go by {other}')
    if mine in variables and mine not in ('psi', *term.term.valid):
        raise FormulaError(f'has {mine} in it, and valid does not say between what it holds')


def _boxes(term: DeclaredTerm, names: Collection[str]) -> dict[str, Range]:
    """Return ranges of all names, in boxes that cover all ships and what is valid."""
    axes = {}
    for name, each in NAMES.items():
        if name in ('L', *names) or len(each.ends) == 2:
            valid = term.term.valid.get(name)
            axes[name] = np.linspace(*valid, len(each.ends)) if valid else np.array(each.ends)
    lows = np.meshgrid(*(axis[:-1] for axis in axes.values()), indexing='ij')
    highs = np.meshgrid(*(axis[1:] for axis in axes.values()), indexing='ij')
    ends = {name: (low.ravel(), high.ravel()) for name, low, high in zip(axes, lows, highs)}
    short, long = ends['L']
    found = {
        name: Range(low * short ** NAMES[name].power, high * long ** NAMES[name].power)
        for name, (low, high) in ends.items()
    }
    algebra = Ranges()
    for name, q in term.parameters.items():
        counted = Formula.parse(q.scale).walk(algebra, found)
        low, high = (np.array([end]) for end in q.ends)
        found[name] = algebra.binary('*', Range(low, high), counted)
    return found


def _refuse_mixed(term: DeclaredTerm, channel: str, formula: Formula, most: float) -> None:
    """Expect what can be simulated, of a size that can be."""
    low, high = term.term.valid.get('u', (0.5, 8.0))
    speed = np.linspace(max(low, 0.05 * high), high, 7)
    last = term.term.valid.get('t', (0.0, 1e3))[1]
    shares = np.array([0.0, 0.1, 0.5, 1.0] if 't' in formula.names else [0.0])[:, None]
    ship = {name: np.asarray(each.usual) for name, each in NAMES.items()}
    now = ship | {'u': speed, 't': shares * last, 't_end': np.asarray(last)}
    inside = {name: term.inside(name, value) for name, value in now.items()}
    for which in _SIZES:
        some = {name: which(q) * worth(q.scale, ship) for name, q in term.parameters.items()}
        rows = worth(formula.text, inside | some) * np.ones((len(shares), len(speed)))
        if (largest := float(np.abs(rows).max())) > most:
            wrong = f'is {largest:.2g} in SI on a ship of 100 m, at most {most:.2g} can be'
            raise FormulaError(wrong)
    # a force in time goes as the square of the speed, and water gains evenly in time
    over = rows / speed**2
    force_in_time = channel == 'force' and 't' in formula.names
    if force_in_time and np.any(np.ptp(over, axis=1) > _ALIKE * np.abs(over).max(axis=1)):
        raise FormulaError('goes by time, and is not u**2 times a function of t alone')
    even = rows[0] + shares * (rows[-1] - rows[0])
    if channel == 'water' and np.ptp(even - rows) > _ALIKE * np.ptp(rows):
        raise FormulaError('is water that does not gain evenly in time')


_NAME = re.compile(r'(?!(none|unknown)$)[a-z][a-z0-9_]{0,59}')  # these are answers of a diagnosis
_MOST_TERMS = 200  # in a folder, or of a ship
_MOST_RUNS = 10_000
_LONGEST = 100  # characters of a name that is quoted
_ROUNDING = 1e-3  # of correlations in a text


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
class LearntTerm(DeclaredTerm):
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
        if problems := [*self._unsupported(), *problems_of(self)]:
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
        return cls.from_yaml(_text_of(path), subject=str(path))

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
        problems: Problems = []
        data = parse(content, subject=subject, error=EffectFileError)
        found = read_terms({'': data}, problems)
        if problems:
            raise EffectFileError(subject, problems)
        return found[0]

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

    def _unsupported(self) -> list[str]:
        """Return what is wrong with what it rests on."""
        found, count = [], len(self.parameters)
        matrix = self.covariance
        if matrix and {len(matrix), *map(len, matrix)} != {count}:
            found.append(f'covariance: expected {count} rows of {count} numbers')
        elif matrix and not _is_covariance(np.array(matrix)):
            found.append('covariance: not symmetric, or a variance of it is negative')
        unknown = [name for name in self.limits or {} if name not in self.parameters]
        if unknown:
            found.append(f'limits.{unknown[0][:40]}: no parameter of this name')
        runs = self.evidence.runs if self.evidence else ()
        if len(runs) > _MOST_RUNS:
            found.append(f'evidence.runs: {len(runs)} runs, at most {_MOST_RUNS}')
        if any(len(each) > _LONGEST for each in (*self.looks_like, *runs)):
            found.append(f'looks_like, evidence.runs: a text of more than {_LONGEST} characters')
        return found


def _is_covariance(matrix: Float64) -> bool:
    """Say whether it is symmetric, and no variance of a sum negative by more than rounding."""
    variance = np.diag(matrix)
    is_symmetric = np.allclose(matrix, matrix.T, rtol=1e-6, atol=0.0)
    if not is_symmetric or variance.min() < 0.0 or matrix[variance == 0.0].any():
        return False
    scale = 1.0 / np.sqrt(np.where(variance > 0.0, variance, 1.0))
    return bool(np.linalg.eigvalsh(matrix * np.outer(scale, scale)).min() > -_ROUNDING)


@cache
def _library() -> frozenset[str]:
    """Return the names of the library, each an entry of its file or a module."""
    package = resources.files('shipdrag_ros')
    file = package / 'data' / 'effects.yaml'
    entries = parse(file.read_text('utf-8'), subject=file.name, error=EffectFileError)
    modules = iter_modules([str(package / 'simulation' / 'effects')])
    return frozenset([*entries, *(module.name for module in modules)])


def check_name(name: str) -> None:
    """
    Expect a name that a learnt term may have.

    Raises
    ------
    EffectFileError
        If it may not.
    """
    if wrong := _wrong_name(name):
        raise EffectFileError(name[:60], wrong)


def _wrong_name(name: str) -> list[str]:
    if not _NAME.fullmatch(name):
        expected = 'small letters, digits and _, and not none or unknown'
        return [f'name: {name[:60]!r}, expected {expected}']
    if name in _library():
        return [f'name: {name!r} is an effect of the library; give it another']
    return []


def read_terms(given: Mapping[str, object], problems: Problems) -> tuple[LearntTerm, ...]:
    """
    Return learnt terms that may stand together, of a ship file or of a folder.

    Parameters
    ----------
    given
        Plain data of each, by what stands before its problems.
    problems
        Each finding is added.
    """
    if len(given) > _MOST_TERMS:
        problems.append(f'{len(given)} learnt effects, at most {_MOST_TERMS}')
        return ()
    found: dict[str, LearntTerm] = {}
    for place, value in given.items():
        wrong: Problems = []
        accepted = read_keys(keys_of(LearntTerm), value, '', wrong)
        name: str = accepted.get('name', '')
        if 'name' in accepted:
            wrong += _wrong_name(name)
        if name in found:
            wrong.append(f'name: {name!r} is that of another')
        if not wrong:
            try:
                found[name] = LearntTerm(**accepted)
            except EffectFileError as error:
                wrong += error.problems
        problems += [place + problem for problem in wrong]
    return tuple(found.values())


def learnt_terms() -> Kind:
    """
    Expect a list of learnt terms.
    """
    expectation = f'a list, each with the keys {", ".join(keys_of(LearntTerm))}'

    def read(value: object, path: str, problems: Problems) -> object:
        before = len(problems)
        if not isinstance(value, list):
            return unexpected(value, path, problems, expectation)
        found = read_terms({f'{path}[{i}].': item for i, item in enumerate(value)}, problems)
        return INVALID if len(problems) > before else found

    return Kind(read, expectation)


def read_folders(folders: Sequence[Path]) -> tuple[LearntTerm, ...]:
    """
    Return the terms of all `.yaml` files of some folders, by name of the file.

    Raises
    ------
    EffectFileError
        If a folder cannot be read or holds none, files cannot be used, or two have one name; with
        every problem of all files.
    """
    problems: Problems = []
    given: dict[str, object] = {}
    for folder in folders:
        try:
            files = sorted(path for path in folder.iterdir() if path.suffix == '.yaml')
        except OSError as error:
            problems.append(f'{folder}: cannot be read: {error.strerror}; give a folder')
            continue
        if not files:
            problems.append(f'{folder}: no .yaml file, expected learnt effects')
        for path in files:
            try:
                content = _text_of(path)
                given[f'{path}: '] = parse(content, subject=str(path), error=EffectFileError)
            except EffectFileError as error:
                problems += [f'{path}: {problem}' for problem in error.problems]
    found = read_terms(given, problems)
    if problems:
        raise EffectFileError('learnt effects', problems)
    return found


def _text_of(path: str | PathLike[str]) -> str:
    return text_of(path, what='a learnt effect (YAML)', error=EffectFileError)
