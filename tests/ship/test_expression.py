# SPDX-License-Identifier: Apache-2.0
"""Formulas: what is allowed is worth what Python says, and nothing else is read."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.ship.expression import (
    LONGEST,
    PURE,
    Formula,
    FormulaError,
    Range,
    Ranges,
    Units,
    Values,
    unit_text,
)

NUMBERS = st.floats(0.1, 9.0).map(lambda value: f'{value:.3f}')
LEAVES = st.one_of(NUMBERS, st.sampled_from(['a', 'b']))


def _grown(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.one_of(
        st.tuples(inner, st.sampled_from('+-*/'), inner).map(lambda p: f'({p[0]}{p[1]}{p[2]})'),
        st.tuples(inner, st.sampled_from(['2', '3', '0.5', '-1'])).map(
            lambda p: f'{p[0]}**{p[1]}'
        ),
        st.tuples(st.sampled_from(['exp', 'tanh', 'sqrt', 'cos', 'sin', 'abs']), inner).map(
            lambda p: f'{p[0]}({p[1]})'
        ),
        st.tuples(st.sampled_from(['min', 'max']), inner, inner).map(
            lambda p: f'{p[0]}({p[1]}, {p[2]})'
        ),
    )


FORMULAS = st.recursive(LEAVES, _grown, max_leaves=8)
PYTHON = {name: getattr(np, name) for name in ('exp', 'tanh', 'sqrt', 'cos', 'sin', 'abs')}
PYTHON |= {'min': np.minimum, 'max': np.maximum}


def worth(formula: Formula, **names: float) -> float:
    values = {name: np.asarray(value) for name, value in names.items()}
    with np.errstate(all='ignore'):
        return float(formula.walk(Values(), values))


@given(text=FORMULAS, a=st.floats(0.2, 5.0), b=st.floats(-5.0, 5.0))
@settings(max_examples=300, deadline=None)
def test_a_formula_is_worth_what_python_says(text: str, a: float, b: float) -> None:
    formula = Formula.parse(text)
    with np.errstate(all='ignore'):
        names = {'a': np.float64(a), 'b': np.float64(b)}
        # the text was made here, of the lists above
        try:
            wanted = float(eval(text, {'__builtins__': {}}, PYTHON | names))
        except ZeroDivisionError:
            return
    assert np.isclose(worth(formula, a=a, b=b), wanted, rtol=1e-9, equal_nan=True)


@given(text=FORMULAS, a=st.floats(0.2, 5.0), b=st.floats(-5.0, 5.0), wide=st.floats(0.0, 2.0))
@settings(max_examples=300, deadline=None)
def test_no_value_lies_outside_of_its_range(text: str, a: float, b: float, wide: float) -> None:
    formula = Formula.parse(text)
    box = {
        'a': Range(np.array([a]), np.array([a + wide])),
        'b': Range(np.array([b]), np.array([b + wide])),
    }
    try:
        found = formula.walk(Ranges(), box)
    except FormulaError:
        return  # a pole may be inside
    for share in (0.0, 0.3, 1.0):
        value = worth(formula, a=a + share * wide, b=b + (1.0 - share) * wide)
        slack = 1e-9 * max(1.0, abs(value))
        assert found.low[0] - slack <= value <= found.high[0] + slack


@given(text=st.text(max_size=60))
@settings(max_examples=500, deadline=None)
def test_any_text_is_a_formula_or_a_plain_error(text: str) -> None:
    try:
        formula = Formula.parse(text)
    except FormulaError:
        return
    assert set(formula.names) <= set(text.replace('(', ' ').split()) | set(formula.names)


@pytest.mark.parametrize(
    'text',
    [
        '__import__("os").system("true")',
        'open("x")',
        'a.__class__',
        '(lambda: 1)()',
        '[a for a in b]',
        'a if b else a',
        'a < b',
        'a and b',
        'a[0]',
        '{a}',
        '(a, b)',
        '"a"',
        "b'a'",
        'f"{a}"',
        '1j',
        'True',
        'None',
        '...',
        'a := 1',
        'a; b',
        'import os',
        'exp(x=a)',
        'exp(*a)',
        'exp(a, b)',
        'log(a)',
        'eval(a)',
        'a @ b',
        'a // b',
        'a % b',
        'a << b',
        'not a',
        '~a',
        'await a',
        'yield a',
        '1e999',
        '9' * 300,
        'a**13',
        '-' * 60 + 'a',
        'a' * (LONGEST + 1),
        'a+' * 190 + 'a',
        'a\x00',
        '\u0430',  # a Cyrillic letter that looks like the Latin one
        '',
    ],
)
def test_what_is_no_formula_is_refused(text: str) -> None:
    box = {'a': Range(np.array([1.0]), np.array([2.0]))}
    with pytest.raises(FormulaError):
        Formula.parse(text).walk(Ranges(), box)


@given(text=FORMULAS, place=st.integers(0, 99), said=st.text(max_size=9))
@settings(max_examples=100, deadline=None)
def test_a_formula_has_no_comment(text: str, place: int, said: str) -> None:
    place = min(place, len(text))
    with pytest.raises(FormulaError):
        Formula.parse(f'{text[:place]}#{said}{text[place:]}')


@pytest.mark.parametrize(
    'text', ['1/(a - 1.5)', 'sqrt(a - 1.5)', '(a - 1.5)**0.5', 'a**(0 - b*0 - 40*a)*0/0']
)
def test_a_pole_is_refused(text: str) -> None:
    box = {name: Range(np.array([1.0]), np.array([2.0])) for name in 'ab'}
    with pytest.raises(FormulaError):
        Formula.parse(text).walk(Ranges(), box)


def test_units_are_joined_and_refused() -> None:
    units = {'u': (0.0, 1.0, -1.0), 'g': (0.0, 1.0, -2.0), 'L': (0.0, 1.0, 0.0)}
    assert Formula.parse('u/sqrt(g*L)').walk(Units(), units) == PURE
    assert Formula.parse('L**(2/3)').walk(Units(), units)[1] == pytest.approx(2 / 3)
    assert unit_text(Formula.parse('m*g').walk(Units(), units | {'m': (1.0, 0.0, 0.0)})) == 'N'
    for wrong in ('u + g', 'exp(u)', 'step(u, 1)', 'u**L', 'min(u, L)', 'cos(L)', '2**u'):
        with pytest.raises(FormulaError):
            Formula.parse(wrong).walk(Units(), units)
    assert math.isclose(worth(Formula.parse('step(a, 1)'), a=0.0), 0.5)
