# SPDX-License-Identifier: Apache-2.0
"""
What is said in the words of the command line, said in those of Python.

Estimation, diagnosis and importers say what to do as options of `shipdrag`, which
is their usual face. A script has arguments for these; here is the one place that
knows which.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from shipdrag_ros.errors import ShipdragError

P = ParamSpec('P')
R = TypeVar('R')

_READ = {
    'date',
    'date-order',
    'format',
    'gear',
    'no-checksum',
    'speed-unit',
    'transducer',
    'where',
    'zone',
}
"""Options of `shipdrag import` that `read` takes as `options`."""
_PLAIN = {'and', 'or', 'where', 'with', 'otherwise', 'chooses'}  # no value of an option
_VALUE = r"((?:'[^']*'|,(?=\S)|[^\s;()'\"`,])+)"
_OPTION = re.compile(
    rf'--(window|remap|ship|fact|map|time|rate|{"|".join(sorted(_READ, reverse=True))})\b(?!-)'
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
    return _OPTION.sub(_argument, text)


def _argument(found: re.Match[str]) -> str:
    name, typed = found[1], found[2]
    value, end = _split(typed)
    if name == 'window':
        return 'window=(START, END)' + end
    if name in _READ:
        key = name.replace('-', '_')
        shown = 'True' if name == 'no-checksum' else repr(value) if value else '...'
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

    return speaking
