# SPDX-License-Identifier: Apache-2.0
"""
What is said in the words of the command line, said in those of Python.

Estimation, diagnosis and importers say what to do as options of `shipdrag`, which
is their usual face. A script has arguments for these; here is the one place that
knows which. What a format of log files takes, the format declares.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.imports import what_to_install
from shipdrag_ros.sources import formats

P = ParamSpec('P')
R = TypeVar('R')

_ARGUMENTS = {'window', 'remap', 'ship', 'fact', 'earlier', 'map', 'time', 'rate'}
"""Options that the functions take as arguments of their own."""
_PLAIN = {'and', 'or', 'where', 'with', 'otherwise', 'chooses'}  # no value of an option
_VALUE = r"((?:'[^']*'|,(?=\S)|[^\s;()'\"`,])+)"


@cache
def _read() -> dict[str, bool]:
    """Return the options that `read` takes as `options`, and whether each has a value."""
    known = {'format': True}
    for each in formats.found():
        known |= {option.flag.lstrip('-'): bool(option.metavar) for option in each.options}
    return {name: has_value for name, has_value in known.items() if name not in _ARGUMENTS}


@cache
def _option() -> re.Pattern[str]:
    names = sorted({*_ARGUMENTS, *_read()}, reverse=True)  # the longer of two that begin alike
    return re.compile(
        rf'--({"|".join(map(re.escape, names))})\b(?!-)'
        rf'(?: START END|[ =](?!(?:{"|".join(sorted(_PLAIN))})\b){_VALUE})?'
    )


def in_python(text: str) -> str:
    """
    Replace options of the command line by arguments of the functions of this package.

    Parameters
    ----------
    text
        A message, with `--ship FILE` for instance.

    Examples
    --------
    >>> in_python('give --map speed_through_water=STW:kn and --speed-unit kn')
    "give columns={'speed_through_water': 'STW:kn'} and options={'speed_unit': 'kn'}"
    >>> in_python('say so with --window START END')
    'say so with window=(START, END)'
    """
    # without an option nothing of the formats need be known
    return _option().sub(_argument, text) if '--' in text else text


def _argument(found: re.Match[str]) -> str:
    name, typed = found[1], found[2]
    value, end = _split(typed)
    if name == 'window':
        return 'window=(START, END)' + end
    if name in _read():
        key = name.replace('-', '_')
        shown = (repr(value) if value else '...') if _read()[name] else 'True'
        return f'options={{{key!r}: {shown}}}{end}'
    if name == 'rate':
        return f'rate_hz={value or "HZ"}{end}'
    if name == 'fact':
        return f'facts=[{value!r}]{end}' if value else f'facts={end}'
    if name in ('map', 'remap'):
        argument, sign = ('columns', '=') if name == 'map' else ('remap', ':=')
        key, _, rest = value.partition(sign)
        return f'{argument}={{{key!r}: {rest!r}}}{end}' if rest else f'{argument}={end}'
    return f'{name}={value!r}{end}' if value else f'{name}={end}'


def _split(typed: str | None) -> tuple[str, str]:
    """Return the value without its quotation marks, and the mark of the sentence behind it."""
    value = (typed or '').rstrip('.:,')
    return value.replace("'", ''), (typed or '')[len(value) :]


def says_it_in_python(door: Callable[P, R]) -> Callable[P, R]:
    """
    Let the errors of a function speak of arguments instead of options.
    """

    @wraps(door)
    def speaking(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return door(*args, **kwargs)
        except ShipdragError as error:
            error.args = tuple(
                in_python(each) if isinstance(each, str) else each for each in error.args
            )
            raise
        except ModuleNotFoundError as error:
            advice = what_to_install(error)
            if advice is None:
                raise
            raise ShipdragError(advice) from error

    return speaking
