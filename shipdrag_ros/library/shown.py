# SPDX-License-Identifier: Apache-2.0
"""How a result shows itself: in a line, in a notebook, as a frame, as a picture."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache, wraps
from html import escape
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from shipdrag_ros.display import Table, plain_json
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.imports import what_to_install
from shipdrag_ros.sources import formats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame


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


_SIZE = (6.4, 4.2)  # of a picture [inches]


class Text(str):
    """
    A text that shows its lines wherever it is shown: printed, at a prompt, in a notebook.
    """

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return ''.join(f'<p>{escape(line)}</p>' for line in self.splitlines())


class Shown(ABC):
    """
    A result that says what it holds.

    A short `repr`, `summary()` in sentences, `table()` as text, both of them in a
    notebook, `to_dict()` for JSON, `to_frame()` in pandas and `plot()` in matplotlib.
    """

    def summary(self) -> Text:
        """
        Return the result in sentences, a line each, to be printed.
        """
        return Text('\n'.join(map(in_python, self._lines())))

    @abstractmethod
    def _lines(self) -> Sequence[str]:
        """Return the sentences, in the words of the command line."""

    @abstractmethod
    def table(self) -> Table:
        """
        Show the main figures as text.
        """

    @abstractmethod
    def _title(self) -> str:
        """Say in some words what this is."""

    @abstractmethod
    def _columns(self) -> Mapping[str, Any]:
        """Return the columns of the frame, in SI units."""

    @abstractmethod
    def _document(self) -> Mapping[str, Any]:
        """Return what `to_dict` makes plain."""

    def to_dict(self) -> dict[str, Any]:
        """
        Return the JSON document of the command line, as `json.dumps` takes it.
        """
        return dict(plain_json(self._document()))

    def to_frame(self) -> DataFrame:
        """
        Return the figures as a pandas frame, in the units that the columns name.

        Raises
        ------
        ShipdragError
            Without pandas.
        """
        try:
            import pandas
        except ImportError as error:
            raise ShipdragError(
                'to_frame() needs pandas, which is not installed: pip install pandas'
            ) from error
        return pandas.DataFrame(dict(self._columns()))

    def __repr__(self) -> str:
        return f'<{type(self).__name__}: {self._title()}>'

    def _repr_html_(self) -> str:
        table = self.table()
        rows = [_row(table.columns, 'th')] if any(table.columns) else []
        rows += [_row(row, 'td') for row in table.rows]
        shown = f'<table>{"".join(rows)}</table>' if table.rows else ''
        title = f'<p><strong>{escape(self._title())}</strong></p>'
        return f'<div>{title}{self.summary()._repr_html_()}{shown}</div>'


class ShownResistance(Shown):
    """
    A result that can be drawn as resistance against speed.
    """

    def plot(self, ax: Axes | None = None) -> Axes:
        """
        Draw resistance against speed with its band, over the clean hull.

        Parameters
        ----------
        ax
            To draw on; None: new axes.

        Returns
        -------
        matplotlib.axes.Axes
            Knots and kN, of a model ship m/s and N.
        """
        draw = self._drawing()
        with drawing(ax) as axis:
            draw(axis)
        return axis

    @abstractmethod
    def _drawing(self) -> Callable[[Axes], None]:
        """Return what draws it; an EstimationError where there is nothing to draw."""


def _row(cells: Sequence[str], tag: str) -> str:
    return f'<tr>{"".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells)}</tr>'


@contextmanager
def writing(path: str | PathLike[str]) -> Iterator[Path]:
    """
    Give the path of a page to write; a failure says which and why.

    Raises
    ------
    ShipdragError
        If it cannot be written.
    """
    try:
        yield Path(path)
    except OSError as error:
        raise ShipdragError(f'{str(path)!r} cannot be written: {error.strerror}') from error


@contextmanager
def drawing(ax: Axes | None) -> Iterator[Axes]:
    """
    Give the axes to draw on: those given, or new ones that a notebook shows.
    """
    import matplotlib.pyplot as plt  # takes long to import

    from shipdrag_ros.report.drawing import STYLE

    with plt.rc_context(STYLE):
        yield plt.subplots(figsize=_SIZE, layout='constrained')[1] if ax is None else ax
