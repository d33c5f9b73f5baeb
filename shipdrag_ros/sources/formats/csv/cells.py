# SPDX-License-Identifier: Apache-2.0
"""What may stand in a cell: a number with a point or a comma, or a coordinate."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from enum import Enum
from math import cos, hypot, pi, remainder, sin

import numpy as np

from shipdrag_ros.display import NUMBER
from shipdrag_ros.samples import Float64

_PLAIN = frozenset('0123456789+-.eE')
_COMMA = re.compile(r'[-+]?(\d+,\d*|,\d+)([eE][-+]?\d{1,4})?')
_SIDES = {'N': 1.0, 'E': 1.0, 'S': -1.0, 'W': -1.0}
_DECIMAL = re.compile(r'([-+]?\d{1,3}(?:\.\d*)?)\s*°?\s*([NSEW])?')
_PARTED = re.compile(r"(\d{1,3})[°\s]\s*(\d{1,2}(?:\.\d*)?)\s*'?\s*([NSEW])")
_JOINED = re.compile(r'([-+]?)(\d{1,3})(\d{2}(?:\.\d*)?)\s*([NSEW])?')
_THOUSANDS = re.compile(r'[-+]?[1-9]\d{0,2}(\.\d{3})+')


class BadCell(Exception):
    """A cell without a usable number."""

    def __init__(self, reason: str, cell: str) -> None:
        super().__init__(reason)
        self.reason = reason
        self.cell = cell


class Form(Enum):
    """How the columns of an input make its value."""

    PLAIN = 'plain'
    HYPOT = 'hypot'  # a speed from two components
    POLAR = 'polar'  # apparent wind: speed, and where it comes from, clockwise from ahead
    COMPASS = 'compass'  # deg clockwise from north


def number(cell: str) -> float:
    """
    Read a number with a decimal point.

    Raises
    ------
    BadCell
        If it is none.
    """
    if not cell:
        raise BadCell('empty', cell)
    if not NUMBER.fullmatch(cell):
        raise BadCell('not a number', cell)
    return float(cell)


def number_with_comma(cell: str) -> float:
    """
    Read a number with a decimal comma; one without either is a number too.

    Raises
    ------
    BadCell
        If it is none.
    """
    if '.' in cell:
        raise BadCell('a point where others have a decimal comma', cell)
    return number(cell.replace(',', '.', 1))


def has_decimal_commas(cells: Iterable[str]) -> bool:
    """
    Say whether the cells of a table are numbers with decimal commas.

    Not where all have three digits behind the comma, which may be thousands, nor
    where any has a point.
    """
    commas = points = parted = plain = 0
    for cell in cells:
        if _COMMA.fullmatch(cell):
            commas += 1
            parted += len(cell.partition(',')[2]) != 3
        elif NUMBER.fullmatch(cell):
            points += '.' in cell and not _THOUSANDS.fullmatch(cell)  # 1.234 beside 12,5
            plain += 1
    # a few that are otherwise are damaged, and rejected one by one
    return bool(commas > 1 and parted and 10 * commas >= plain and 50 * points <= commas)


def degrees_of(side: str) -> Callable[[str], float]:
    """
    Return a reader of latitudes or longitudes in degrees, with or without a letter.

    Parameters
    ----------
    side
        'NS' or 'EW'.
    """

    def read(cell: str) -> float:
        text = cell.strip().upper()
        if not text:
            raise BadCell('empty', cell)
        if found := _PARTED.fullmatch(text):
            return _checked(float(found[1]), float(found[2]), found[3], side, cell)
        found = _DECIMAL.fullmatch(text)
        if found is None or (found[2] and text[0] in '+-'):
            raise BadCell('no latitude and longitude', cell)
        return _checked(float(found[1]), 0.0, found[2] or side[0], side, cell)

    return read


def minutes_of(side: str) -> Callable[[str], float]:
    """
    Return a reader of degrees and minutes written as one number, ddmm.mmmm, and a letter.
    """

    def read(cell: str) -> float:
        text = cell.strip().upper()
        if not text:
            raise BadCell('empty', cell)
        found = _JOINED.fullmatch(text)
        if found is None or (found[1] and found[4]):
            raise BadCell('no latitude and longitude', cell)
        value = _checked(float(found[2]), float(found[3]), found[4] or side[0], side, cell)
        return -value if found[1] == '-' else value

    return read


def are_in_minutes(latitudes: Iterable[str], longitudes: Iterable[str]) -> bool:
    """
    Say whether coordinates are written as ddmm.mmmm.

    The latitudes show it: four digits before the point are no degrees. Three may
    be a longitude in the wrong column, unless the longitudes are written so too.
    A longitude alone shows nothing: 200.5 is one from 0 to 360 degrees.
    """
    if _share_in_minutes(latitudes, 90.0, 4) > 0.5:
        return True
    three = _share_in_minutes(latitudes, 90.0, 3), _share_in_minutes(longitudes, 180.0, 3)
    return min(three) > 0.5


def _share_in_minutes(cells: Iterable[str], largest: float, digits: int) -> float:
    """Return which share of the cells, without empty ones and zeros, can be dddmm.mmmm."""
    fitting = count = 0
    for cell in cells:
        text = cell.strip().upper()
        if not text.strip('+-0. NSEW'):
            continue
        count += 1
        if found := _JOINED.fullmatch(text):
            degrees, minutes = float(found[2]), float(found[3])
            long = len(found[2]) + 2 >= digits
            fitting += long and minutes < 60.0 and degrees + minutes / 60.0 <= largest
    return fitting / max(count, 1)


def _checked(degrees: float, minutes: float, letter: str, side: str, cell: str) -> float:
    value = abs(degrees) + minutes / 60.0
    largest = 90.0 if side == 'NS' else 180.0
    # a longitude counted from 0 to 360 is one too
    if letter not in side or minutes >= 60.0 or value > (largest if side == 'NS' else 360.0):
        raise BadCell('no latitude and longitude', cell)
    value *= _SIDES[letter] * (-1.0 if degrees < 0.0 else 1.0)
    return value - 360.0 if value > largest else value


def numbers(
    cells: Sequence[str], read: Callable[[str], float], bad: dict[int, BadCell]
) -> Float64:
    """
    Return (n,) numbers of cells, NaN where there is none.

    Parameters
    ----------
    cells
        Of a column.
    read
        Reads one.
    bad
        Filled with why, by the place of the first column's cell that holds none.
    """
    if read is number and _PLAIN.issuperset(''.join(cells)):
        with suppress(ValueError):  # an empty cell for instance
            found = np.array([float(cell) for cell in cells])
            if np.isfinite(found).all():
                return found
    found = np.full(len(cells), np.nan)
    for place, cell in enumerate(cells):
        try:
            found[place] = read(cell)
        except BadCell as error:
            bad.setdefault(place, error)
    return found


def combined(form: Form, values: Sequence[Float64]) -> tuple[Float64, Float64]:
    """
    Return the two values (n,) of samples from those of their columns, in SI units.
    """
    first = values[0]
    nothing = np.zeros(len(first))
    if form is Form.COMPASS:
        turns = [remainder(pi / 2.0 - each, 2.0 * pi) for each in _finite(first)]
        return np.array(turns), nothing
    if form is Form.HYPOT:
        return np.array([*map(hypot, first, values[1])]), nothing
    if form is Form.POLAR:
        angle = _finite(values[1])
        return -first * [*map(cos, angle)], first * [*map(sin, angle)]
    return first, values[1] if len(values) > 1 else nothing


def _finite(values: Float64) -> list[float]:
    """Return numbers that the C library takes; what is none stays none."""
    found: list[float] = np.where(np.isfinite(values), values, np.nan).tolist()
    return found
