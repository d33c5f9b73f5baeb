# SPDX-License-Identifier: Apache-2.0
"""Whether what is declared can be: units, poles, variables and sizes, on any ship."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator

import numpy as np

from shipdrag_ros.ship.declared import DeclaredTerm, TermParameter, worth
from shipdrag_ros.ship.expression import (
    PURE,
    Formula,
    FormulaError,
    Range,
    Ranges,
    Units,
    is_finite,
    unit_text,
)
from shipdrag_ros.ship.vocabulary import BY_SPEED, CHANNELS, NAMES, OWN_UNITS, UNITS, VARIABLES

_MOST_PARAMETERS = 6
_ALIKE = 1e-6  # relative
_MOSTLY_SD = 2.0  # of a prior, that must be inside of the bounds
_SIZES: tuple[Callable[[TermParameter], float], ...] = (
    lambda each: each.typical if each.value is None else each.value,
    lambda each: max(each.within(1.0), key=abs),
    lambda each: each.typical,
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
    """
    Expect what can be simulated, of a size that can be.

    A force in time goes as the square of the speed, and water gains evenly in time.
    """
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
        if not is_finite(rows):
            raise FormulaError('is no finite number inside its valid range')
        if (largest := float(np.abs(rows).max())) > most:
            wrong = f'is {largest:.2g} in SI on a ship of 100 m, at most {most:.2g} can be'
            raise FormulaError(wrong)
    over = rows / speed**2
    force_in_time = channel == 'force' and 't' in formula.names
    if force_in_time and np.any(np.ptp(over, axis=1) > _ALIKE * np.abs(over).max(axis=1)):
        raise FormulaError('goes by time, and is not u**2 times a function of t alone')
    even = rows[0] + shares * (rows[-1] - rows[0])
    if channel == 'water' and np.ptp(even - rows) > _ALIKE * np.ptp(rows):
        raise FormulaError('is water that does not gain evenly in time')
