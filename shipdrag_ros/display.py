# SPDX-License-Identifier: Apache-2.0
"""Figures, times and tables as text; the parts that a page is made of."""

from __future__ import annotations

import json
import math
import re
import reprlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar('T')

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60

MILE_M = 1852.0
M_S_PER_KNOT = MILE_M / 3600.0
_UNITS_M_S = {'m/s': 1.0, 'knots': M_S_PER_KNOT, 'km/h': 1.0 / 3.6, 'mph': 0.44704}
UNIT_RATIOS = {
    of / other: f'{shown} over {meant}'
    for meant, of in _UNITS_M_S.items()
    for shown, other in _UNITS_M_S.items()
    if shown != meant
}
# relative, as a current and the error of a log are in a ratio too; and of the way to one unit
_UNITS_NEAR, _UNITS_NEARER = 0.1, 0.14
# what `float` takes too, 1_000 or nan or infinity, is no measured number
NUMBER = re.compile(r'[-+]?(\d+(?:\.\d*)?|\.\d+)([eE][-+]?\d{1,4})?')
LIGHT_KG = 1e4
"""Below it a ship is stated in kg and N, above in t and kN."""

TRACK_LABELS = {
    'speed_through_water': ('Speed through water', 'm/s'),
    'speed_over_ground': ('Speed over ground', 'm/s'),
    'position': ('Distance along the track', 'm'),
    'position_across': ('Distance to port of the track', 'm'),
}


def track_label(name: str) -> tuple[str, str]:
    """
    Return label and unit of what an input of the motion measures.
    """
    kind = name.rstrip('_23')  # of further instruments
    label, unit = TRACK_LABELS.get(kind, (name, ''))
    return (label if kind == name else f'{label}, {name[-1]}'), unit


class Link(str):
    """
    The text of a cell that leads somewhere; where nothing can be followed it is the text alone.

    Parameters
    ----------
    text
    href
        Where it leads.
    """

    __slots__ = ('href',)
    href: str

    def __new__(cls, text: str, href: str) -> Link:
        made = super().__new__(cls, text)
        made.href = href
        return made


@dataclass(frozen=True)
class Table:
    """Column heads and rows, ready to be shown."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Picture:
    """
    A picture that a page holds in itself.

    Attributes
    ----------
    uri
        The picture, as `data:`.
    caption
        What it shows, and what a reader should see in it.
    wide
        Whether it needs the whole width of a page; on a phone it scrolls in its box.
    """

    uri: str
    caption: str
    wide: bool = False


@dataclass(frozen=True)
class Section:
    """
    Part of a page: what it has of these, in this order.

    Attributes
    ----------
    heading
    level
        Of the heading, 2 to 4.
    quiet
        What it is about, in small print.
    lead
        What was found, a paragraph each.
    text
        Paragraphs.
    lines
        Points of a list.
    pictures
        Beside each other where there is room.
    tables
        Each with its caption; one without column heads is a list of facts.
    entry
        Its line in the list of contents; '' for none.
    """

    heading: str = ''
    level: int = 2
    quiet: str = ''
    lead: Sequence[str] = ()
    text: Sequence[str] = ()
    lines: Sequence[str] = ()
    pictures: Sequence[Picture] = ()
    tables: Sequence[tuple[str, Table]] = ()
    entry: str = ''


def spreadsheet_text(text: str) -> str:
    """
    Return a text that no spreadsheet takes for a formula.

    A file name may begin with `=`; a quote before it makes it text. Numbers are
    written as numbers and need none.
    """
    return f"'{text}" if text.startswith(('=', '+', '-', '@', '\t', '\r')) else text


def utc(time_ns: int) -> str:
    """
    Return a time in a form to read, in whole seconds of UTC.
    """
    seconds = time_ns // 1_000_000_000
    try:
        moment = datetime.fromtimestamp(seconds, UTC)
    except (ValueError, OverflowError, OSError):
        return f'{seconds} s'
    # clocks that start at zero (simulation, import) have no date worth reading
    if moment.year < 1980:
        return f'{seconds} s'
    return moment.strftime('%Y-%m-%d %H:%M:%S UTC')


def day(time_ns: int) -> str:
    """
    Return the day of a time, UTC, in ISO 8601.
    """
    return datetime.fromtimestamp(time_ns // 1_000_000_000, UTC).strftime('%Y-%m-%d')


def dated(items: Iterable[tuple[int, T]]) -> list[tuple[str, T]]:
    """
    Return each with `utc` of its time [ns], numbered where several are alike.
    """
    shown = [(utc(time_ns), item) for time_ns, item in items]
    texts = [text for text, _ in shown]
    return [
        (f'{text} ({texts[:i].count(text) + 1})' if texts.count(text) > 1 else text, item)
        for i, (text, item) in enumerate(shown)
    ]


def duration(seconds: float) -> str:
    """
    Return a length of time in s, and in min where that reads better.
    """
    if seconds < 600.0:
        return f'{seconds:.4g} s'
    return f'{seconds:.0f} s ({seconds / 60.0:.0f} min)'


def clock(seconds: float) -> str:
    """
    Return a length of time as minutes and seconds; below ten seconds with a tenth.

    Examples
    --------
    >>> clock(460.0), clock(8.31), clock(4000.0)
    ('7:40', '0:08.3', '66:40')
    """
    if seconds < 9.95:
        return f'0:{seconds:04.1f}'
    minutes, rest = divmod(round(seconds), 60)
    return f'{minutes}:{rest:02d}'


def way(metres: float, mass_kg: float, largest_m: float = 0.0) -> str:
    """
    Return a distance in nautical miles, of a light craft or beside no long way in metres.

    Examples
    --------
    >>> way(-1852.0, 2e7), way(-81.7, 2e7)
    ('-1.00 nm', '-81.7 m')
    """
    if mass_kg < LIGHT_KG or max(abs(metres), largest_m) < 0.1 * MILE_M:
        return f'{metres:.3g} m'
    return f'{metres / MILE_M:.2f} nm'


def plus_minus(value: float, spread: float, sign: str = '') -> str:
    """
    Return a value and its spread, both to the digits that the spread allows; '+' shows each sign.
    """
    if not (math.isfinite(value) and math.isfinite(spread) and spread > 0.0):
        return f'{value:{sign}.4g} ± {spread:.2g}'
    decimals = decimals_of(spread)
    if decimals < 0:
        value, spread, decimals = round(value, decimals), round(spread, decimals), 0
    return f'{value:{sign}.{decimals}f} ± {spread:.{decimals}f}'


def decimals_of(spread: float) -> int:
    """
    Return the decimals that show two digits of a spread > 0; negative above 100.
    """
    return 1 - math.floor(math.log10(spread))


def force_unit(mass_kg: float) -> tuple[float, str]:
    """
    Return what a force of a ship is shown in: newtons in the unit, and its name.
    """
    return (1.0, 'N') if mass_kg < LIGHT_KG else (1000.0, 'kN')


def power_unit(mass_kg: float) -> tuple[float, str]:
    """
    Return what a power of a ship is shown in: watts in the unit, and its name.
    """
    return (1.0, 'W') if mass_kg < LIGHT_KG else (1000.0, 'kW')


def speed_unit(mass_kg: float) -> tuple[float, str]:
    """
    Return what a speed of a ship is shown in: m/s in the unit, and its name.
    """
    return (1.0, 'm/s') if mass_kg < LIGHT_KG else (M_S_PER_KNOT, 'knots')


def ship_speed(speed_m_s: float, mass_kg: float) -> str:
    """
    Return a speed with its unit, in knots but for a model ship.
    """
    unit, name = speed_unit(mass_kg)
    return f'{speed_m_s / unit:.{1 if unit != 1.0 else 3}f} {name}'


def mistaken_units(ratio: float) -> str:
    """
    Say which two units may have been mistaken for each other, by two readings of one speed.

    Parameters
    ----------
    ratio
        Of one reading over the other.

    Returns
    -------
    str
        The units whose ratio is within 10 %, and a seventh of the way to one unit; each with its
        ratio; '' where there are none.
    """
    if not ratio > 0.0:
        return ''
    return ' and '.join(
        f'{words} ({each:.2f})'
        for each, words in UNIT_RATIOS.items()
        if abs(math.log(ratio / each)) < min(_UNITS_NEAR, _UNITS_NEARER * abs(math.log(each)))
    )


def speed_text(speed_m_s: float, *, highest_m_s: float) -> str:
    """
    Return a speed without its unit; a model ship needs one digit more.
    """
    return f'{speed_m_s:.{2 if highest_m_s >= 1.0 else 3}f}'


def printable(text: str) -> str:
    """
    Return a text of a peer as a terminal may have it, control characters as escapes.

    Examples
    --------
    >>> printable('log' + chr(27))
    'log\\\\x1b'
    """
    return ''.join(each if each.isprintable() else repr(each)[1:-1] for each in text)


def short_repr(result: DataclassInstance) -> str:
    """
    Return a line for a dataclass that holds arrays; its `__repr__`.

    Examples
    --------
    >>> import numpy as np
    >>> from dataclasses import dataclass
    >>> @dataclass
    ... class Curve:
    ...     speed_m_s: object
    ...     __repr__ = short_repr
    >>> Curve(np.linspace(1.0, 8.0, 200))
    Curve(speed_m_s=<200 float64, 1 to 8>)
    """
    parts = (f'{item.name}={_shown(getattr(result, item.name))}' for item in fields(result))
    return f'{type(result).__name__}({", ".join(parts)})'


def _shown(value: Any) -> str:
    if isinstance(value, np.ndarray):
        size = ' x '.join(map(str, value.shape)) or 'no axis,'
        numbers = value.dtype.kind in 'if' and value.size and np.isfinite(value).any()
        ends = f', {np.nanmin(value):.4g} to {np.nanmax(value):.4g}' if numbers else ''
        return f'<{size} {value.dtype}{ends}>'
    if is_dataclass(value) and not isinstance(value, type):
        return f'{type(value).__name__}(...)'
    if isinstance(value, tuple | list | Mapping) and len(value) > 1:
        return f'<{len(value)} items>'
    return _SHORT.repr(value)


def json_text(document: object, *, indent: int | None = 2) -> str:
    """
    Return a document as JSON; arrays are lists, and what is not finite is null.

    Parameters
    ----------
    indent
        None for one line without blanks, as programs send it.
    """
    separators = (',', ': ') if indent else (',', ':')
    try:
        text = json.dumps(document, indent=indent, separators=separators, allow_nan=False)
    except (TypeError, ValueError):
        plain = plain_json(document)
        text = json.dumps(plain, indent=indent, separators=separators, allow_nan=False)
    return f'{text}\n' if indent else text


def plain_json(value: Any) -> Any:
    """
    Turn arrays into lists, and what is not finite into None.
    """
    if isinstance(value, Mapping):
        return {str(key): plain_json(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain_json(value.tolist())
    if isinstance(value, list | tuple):
        return [plain_json(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
