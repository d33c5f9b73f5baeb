# SPDX-License-Identifier: Apache-2.0
"""
Formulas as data: parsed, checked for units and poles, and evaluated without running any code.

A formula is walked once for each question, with the algebra of that question: units, ranges
or values. What is no number, name, operator or function of the list is refused.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Protocol, TypeVar

import numpy as np

from shipdrag_ros.samples import Float64

LONGEST, MOST_NODES, DEEPEST = 400, 120, 30
"""Characters, parts and levels of a formula that is read."""
FUNCTIONS = dict.fromkeys(('step', 'min', 'max'), 2) | (
    dict.fromkeys(('abs', 'exp', 'tanh', 'sqrt', 'cos', 'sin'), 1)
)
"""What may be called, with how many arguments; step(x, w) grows from 0 to 1 about x = 0."""
_LARGEST = 1e12  # number in a formula, or exponent times what it is of
_OVERFLOW = 1e30
_STEEPEST = 12.0  # exponent

T = TypeVar('T')


class FormulaError(Exception):
    """What is wrong with a formula, without the name of its file."""


class Algebra(Protocol[T]):
    """What the parts of a formula are, for one question."""

    def number(self, value: float) -> T:
        """Return a number."""

    def binary(self, operator: str, left: T, right: T) -> T:
        """Return left + - * / right."""

    def power(self, base: T, exponent: float) -> T:
        """Return a power whose exponent is a number."""

    def power_of(self, base: T, exponent: T) -> T:
        """Return a power whose exponent is not."""

    def call(self, name: str, values: list[T]) -> T:
        """Return a function of the list."""


_Walk = Callable[[Any, Mapping[str, Any]], Any]
_SIGNS = {ast.Add: '+', ast.Sub: '-', ast.Mult: '*', ast.Div: '/'}


@dataclass(frozen=True)
class Formula:
    """
    A formula that was parsed and holds nothing but what is allowed.

    Attributes
    ----------
    text
    names
        That it needs, sorted.
    walked
        From an algebra and what it has for each name to the whole.
    """

    text: str
    names: tuple[str, ...]
    walked: _Walk = field(repr=False, compare=False)

    @classmethod
    @lru_cache(512)  # a fit needs one formula some thousand times
    def parse(cls, text: str) -> Formula:
        """
        Read a formula.

        Raises
        ------
        FormulaError
            If it is too long or too deep, or holds anything but the list.
        """
        tree = _tree(text)
        if len([*ast.walk(tree)]) > 3 * MOST_NODES:
            raise FormulaError(f'has more than {MOST_NODES} parts; write a shorter one')
        return cls(text, tuple(sorted(_check(tree, 0))), _walked(tree))

    def walk(self, algebra: Algebra[T], names: Mapping[str, T]) -> T:
        """
        Return the whole in some algebra.

        Raises
        ------
        FormulaError
            If a name is not among those given, or the algebra refuses a part.
        """
        unknown = [name for name in self.names if name not in names]
        if unknown:
            raise FormulaError(
                f'{", ".join(unknown)} is not known; known are {", ".join(sorted(names))}'
            )
        result: T = self.walked(algebra, names)
        return result


def _tree(text: str) -> ast.expr:
    if len(text) > LONGEST:
        raise FormulaError(f'has {len(text)} characters, at most {LONGEST} are read')
    if not text.isascii() or not text.isprintable() or '#' in text:
        raise FormulaError('holds characters that are no plain text, or a comment')
    try:
        return ast.parse(text.strip(), mode='eval').body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        raise FormulaError(f'is no formula: {getattr(error, "msg", error)}') from None


def _check(node: ast.expr, depth: int) -> set[str]:
    """Refuse what is not on the list; return the names."""
    if depth > DEEPEST:
        raise FormulaError(f'is nested more than {DEEPEST} deep')
    match node:
        case ast.Constant(value=bool() | complex() | str() | bytes() | None):
            raise FormulaError(f'holds {node.value!r}, expected numbers, names and + - * / **')
        case ast.Constant(value=int() | float() as value):
            if not abs(value) <= _LARGEST:
                raise FormulaError(f'holds a number above {_LARGEST:g}')
            return set()
        case ast.Name(id=name):
            return {name}
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
            return _check(operand, depth + 1)
        case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div() | ast.Pow()):
            return _check(node.left, depth + 1) | _check(node.right, depth + 1)
        case ast.Call(func=ast.Name(id=name), args=values, keywords=[]) if name in FUNCTIONS:
            if len(values) != FUNCTIONS[name]:
                raise FormulaError(f'{name} takes {FUNCTIONS[name]} values, not {len(values)}')
            found: set[str] = set()
            return found.union(*(_check(value, depth + 1) for value in values))
    raise FormulaError(
        f'holds {ast.unparse(node)[:40]!r}; allowed are numbers, names, + - * / ** and '
        f'{", ".join(FUNCTIONS)}'
    )


def _walked(node: ast.expr) -> _Walk:
    """Return what walks a part of a tree that was checked, looked at once."""
    match node:
        case ast.Name(id=name):
            return lambda algebra, names: names[name]
        case ast.Constant(value=int() | float() as value):
            return lambda algebra, names: algebra.number(float(value))
        case ast.UnaryOp(op=op, operand=operand):
            inner = _walked(operand)
            if isinstance(op, ast.UAdd):
                return inner
            return lambda a, names: a.binary('*', a.number(-1.0), inner(a, names))
        case ast.Call(func=ast.Name(id=name), args=values):
            parts = [*map(_walked, values)]
            return lambda a, names: a.call(name, [part(a, names) for part in parts])
    assert isinstance(node, ast.BinOp)
    left, right = _walked(node.left), _walked(node.right)
    if not isinstance(node.op, ast.Pow):
        sign = _SIGNS[type(node.op)]
        return lambda a, names: a.binary(sign, left(a, names), right(a, names))
    exponent = _literal(node.right)
    if exponent is None:
        return lambda a, names: a.power_of(left(a, names), right(a, names))
    return lambda a, names: a.power(left(a, names), _no_steeper(exponent))


def _no_steeper(exponent: float) -> float:
    if abs(exponent) > _STEEPEST:
        raise FormulaError(f'has the exponent {exponent:g}, at most {_STEEPEST:g} is allowed')
    return exponent


def _literal(node: ast.expr) -> float | None:
    """Return a number, or a ratio of two; None of anything else."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return float(value)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            inner = _literal(operand)
            return None if inner is None else -inner
        case ast.BinOp(op=ast.Div(), left=left, right=right):
            over, under = _literal(left), _literal(right)
            return over / under if over is not None and under else None
    return None


Unit = tuple[float, float, float]
"""Exponents of kilogram, metre and second."""
PURE: Unit = (0.0, 0.0, 0.0)


class Units:
    """The algebra of units."""

    def number(self, value: float) -> Unit:
        """Return that a number has none."""
        return PURE

    def binary(self, operator: str, left: Unit, right: Unit) -> Unit:
        """Add the exponents of factors; what is added must be alike."""
        if operator == '*':
            return _plus(left, right, 1.0)
        if operator == '/':
            return _plus(left, right, -1.0)
        self._alike(f'{operator}', left, right)
        return left

    def power(self, base: Unit, exponent: float) -> Unit:
        """Multiply the exponents."""
        return _plus(PURE, base, exponent)

    def power_of(self, base: Unit, exponent: Unit) -> Unit:
        """Expect pure numbers."""
        self._pure('a power with a name in its exponent', base, exponent)
        return PURE

    def call(self, name: str, values: list[Unit]) -> Unit:
        """Expect what each function takes."""
        if name in ('min', 'max', 'step'):
            self._alike(name, *values)
            return PURE if name == 'step' else values[0]
        if name == 'abs':
            return values[0]
        if name == 'sqrt':
            return _plus(PURE, values[0], 0.5)
        self._pure(name, values[0])
        return PURE

    def _alike(self, what: str, left: Unit, right: Unit) -> None:
        if left != right:
            raise FormulaError(f'{what} joins {unit_text(left)} and {unit_text(right)}')

    def _pure(self, what: str, *units: Unit) -> None:
        for unit in units:
            if unit != PURE:
                raise FormulaError(f'{what} needs pure numbers, not {unit_text(unit)}')


def _plus(left: Unit, right: Unit, factor: float) -> Unit:
    a, b, c = (round(x + factor * y, 6) for x, y in zip(left, right, strict=True))
    return a, b, c


_BASE: dict[str, Unit] = {'kg': (1.0, 0.0, 0.0), 'm': (0.0, 1.0, 0.0), 's': (0.0, 0.0, 1.0)}


def unit_of(text: str) -> Unit:
    """
    Return a unit that is written as a formula of kg, m and s.
    """
    return Formula.parse(text).walk(Units(), _BASE)


NEWTON = unit_of('kg*m/s**2')


def unit_text(unit: Unit) -> str:
    """
    Return a unit in words.
    """
    if unit == NEWTON:
        return 'N'
    parts = [
        name if power == 1.0 else f'{name}^{power:g}'
        for name, power in zip(_BASE, unit, strict=True)
        if power
    ]
    return ' '.join(parts) or 'a pure number'


@dataclass(frozen=True)
class Range:
    """
    Between what a part lies, for many boxes of its names at once.

    Attributes
    ----------
    low, high : (n,)
    """

    low: Float64
    high: Float64


class Ranges:
    """The algebra of ranges: what may divide by zero, or grow without limit, is refused."""

    def number(self, value: float) -> Range:
        """Return a range of no width."""
        return Range(np.array([value]), np.array([value]))

    def binary(self, operator: str, left: Range, right: Range) -> Range:
        """Return all that can come of two ranges."""
        if operator == '+':
            return _finite(left.low + right.low, left.high + right.high)
        if operator == '-':
            return _finite(left.low - right.high, left.high - right.low)
        if operator == '/':
            self._not_zero(right)
            right = Range(1.0 / right.high, 1.0 / right.low)
        ends = [a * b for a in (left.low, left.high) for b in (right.low, right.high)]
        return _finite(np.minimum.reduce(ends), np.maximum.reduce(ends))

    def power(self, base: Range, exponent: float) -> Range:
        """Return a power; a root of what may be negative is refused."""
        if exponent < 0.0:
            return self.binary('/', self.number(1.0), self.power(base, -exponent))
        if exponent % 1.0:
            self._not_negative(base, 'a power that is not whole')
        low, high = base.low**exponent, base.high**exponent
        if exponent % 2.0 == 0.0 and exponent:
            inside = (base.low < 0.0) & (base.high > 0.0)
            low, high = np.where(inside, 0.0, np.minimum(low, high)), np.maximum(low, high)
        return _finite(low, high)

    def power_of(self, base: Range, exponent: Range) -> Range:
        """Return a power of what is above zero."""
        if not np.all(base.low > 0.0):
            raise FormulaError('has a power, with a name in its exponent, of what may be 0')
        logs = self.binary('*', exponent, Range(np.log(base.low), np.log(base.high)))
        return self.call('exp', [logs])

    def call(self, name: str, values: list[Range]) -> Range:
        """Return all that a function can give."""
        first = values[0]
        if name in ('cos', 'sin'):
            return Range(-np.ones_like(first.low), np.ones_like(first.low))
        if name == 'step':
            if not np.all(values[1].low > 0.0):
                raise FormulaError('has a step whose width may be 0 or less')
            return self.call('half_tanh', [self.binary('/', first, values[1])])
        if name == 'sqrt':
            self._not_negative(first, 'a square root')
        if name == 'abs':
            ends = np.abs(first.low), np.abs(first.high)
            low = np.where((first.low < 0.0) & (first.high > 0.0), 0.0, np.minimum(*ends))
            return _finite(low, np.maximum(*ends))
        if name in ('min', 'max'):
            pick = np.minimum if name == 'min' else np.maximum
            other = values[1]
            return _finite(pick(first.low, other.low), pick(first.high, other.high))
        rising: dict[str, Callable[[Float64], Float64]] = {
            'exp': lambda x: np.exp(np.minimum(x, 100.0)),
            'tanh': np.tanh,
            'sqrt': np.sqrt,
            'half_tanh': lambda x: 0.5 * (1.0 + np.tanh(x)),
        }
        return _finite(rising[name](first.low), rising[name](first.high))

    def _not_zero(self, divisor: Range) -> None:
        if np.any((divisor.low <= 0.0) & (divisor.high >= 0.0)):
            raise FormulaError('may divide by 0 inside its valid range: a pole')

    def _not_negative(self, base: Range, what: str) -> None:
        if np.any(base.low < 0.0):
            raise FormulaError(f'has {what} of what may be negative inside its valid range')


def _finite(low: Float64, high: Float64) -> Range:
    if not (np.all(low > -_OVERFLOW) and np.all(high < _OVERFLOW)):
        raise FormulaError('grows without limit inside its valid range')
    return Range(low, high)


class Values:
    """The algebra of numbers: what a formula is worth."""

    def number(self, value: float) -> Float64:
        """Return it."""
        return np.asarray(value, np.float64)

    def binary(self, operator: str, left: Float64, right: Float64) -> Float64:
        """Return what numpy does."""
        return _NUMPY[operator](left, right)

    def power(self, base: Float64, exponent: Float64 | float) -> Float64:
        """Return what numpy does."""
        return np.power(base, exponent)

    power_of = power

    def call(self, name: str, values: list[Float64]) -> Float64:
        """Return a function of the list."""
        return _NUMPY[name](*values)


_NUMPY: dict[str, Callable[..., Float64]] = {
    '+': np.add,
    '-': np.subtract,
    '*': np.multiply,
    '/': np.divide,
    'step': lambda x, width: np.asarray(0.5 * (1.0 + np.tanh(x / width)), np.float64),
    'min': np.minimum,
    'max': np.maximum,
    'abs': np.abs,
    'exp': np.exp,
    'tanh': np.tanh,
    'sqrt': np.sqrt,
    'cos': np.cos,
    'sin': np.sin,
}
