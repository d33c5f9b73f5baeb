# SPDX-License-Identifier: Apache-2.0
"""A text file as a table: its delimiter, header, rows and numbers; which column is which input."""

from __future__ import annotations

import csv
import gzip
import re
import zlib
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, tzinfo
from importlib import resources
from itertools import islice, zip_longest
from math import pi
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros import strict_yaml
from shipdrag_ros.display import NUMBER
from shipdrag_ros.errors import DataError, ImportDataError
from shipdrag_ros.progress import PartDone
from shipdrag_ros.samples import (
    FURTHER,
    GEODETIC,
    PITCHES,
    SHAFTS,
    Channel,
    Float64,
    Int64,
    kind_of,
)
from shipdrag_ros.sources.format import lines_of

_KNOT, _KMH, _MPH = 1852.0 / 3600.0, 1.0 / 3.6, 0.44704
SPEED_UNITS = {'m/s': 1.0, 'kn': _KNOT, 'km/h': _KMH, 'ft/s': 0.3048, 'mph': _MPH}
"""Units of speed [m/s]."""
LENGTH_UNITS = {'m': 1.0, 'km': 1000.0, 'ft': 0.3048, 'nmi': 1852.0}
"""Units of length [m]."""
ANGLE_UNITS = {'rad': 1.0, 'deg': pi / 180.0}
"""Units of angles [rad]."""
_TURN_RATE = {'rad/s': 1.0, 'rpm': pi / 30.0, 'rev/s': 2.0 * pi, 'rps': 2.0 * pi}
_PITCH = {'ratio': 1.0, '%': 0.01, **ANGLE_UNITS}
COMPASS = 'compass'
_UNITS: dict[Channel, Mapping[str, float]] = {
    Channel.SPEED_THROUGH_WATER: SPEED_UNITS,
    Channel.SPEED_OVER_GROUND: SPEED_UNITS,
    Channel.POSITION: LENGTH_UNITS,
    Channel.POSITION_GEODETIC: {'deg': 1.0},  # as they are sent
    Channel.HEADING: {**ANGLE_UNITS, COMPASS: pi / 180.0},
    Channel.SHAFT: _TURN_RATE,
    Channel.PITCH: _PITCH,
    Channel.RUDDER: ANGLE_UNITS,
    Channel.WIND_APPARENT: {**SPEED_UNITS, **ANGLE_UNITS},
    Channel.DEPTH: LENGTH_UNITS,
}
_UNITS |= {each: _UNITS[each.kind] for each in Channel if each.input in FURTHER}
_COUNTS = {
    'position': (2,),
    'wind_apparent': (2,),
    'speed_over_ground': (1, 2),
    'shaft': (1, 2, 3, 4),
    'pitch': (1, 2, 3, 4),
}
NANOSECONDS = {'s': 10**9, 'ms': 10**6, 'us': 10**3, 'ns': 1}


@dataclass(frozen=True)
class InputColumns:
    """
    The columns of one input.

    Attributes
    ----------
    channel
        What they hold; of several shafts or pitches, the first one.
    names
        Names or numbers, counted from 1; of one value, or of one a shaft.
    units
        In which they stand, as `--map` takes them.
    stated
        Whether a unit is stated; where not, they are SI.
    """

    channel: Channel
    names: tuple[str, ...]
    units: tuple[str, ...]
    stated: bool = True

    @property
    def name(self) -> str:
        """What they are mapped to."""
        return _name(self.channel)

    @property
    def factors(self) -> list[float]:
        """What each is multiplied by for the unit of `Channel`."""
        return [_UNITS[self.channel.kind][unit] for unit in self.units]

    @property
    def is_polar(self) -> bool:
        """Whether a wind is its speed, and where it comes from, clockwise from ahead."""
        return [unit in ANGLE_UNITS for unit in self.units] == [False, True]

    def by_channel(self) -> Iterator[InputColumns]:
        """Yield the columns of each channel: of several shafts, one each."""
        for channels in (SHAFTS, PITCHES):
            if self.channel is channels[0]:
                for channel, name, unit in zip(channels, self.names, self.units, strict=False):
                    yield InputColumns(channel, (name,), (unit,))
                return
        yield self


@dataclass(frozen=True)
class TimeColumn:
    """
    The column of the time of measurement.

    Attributes
    ----------
    names
        One column, or one of the date and one of the time of day.
    unit
        Of a count, see `NANOSECONDS`; '' where none is given.
    order
        Of year, month and day in a date, see `cells.ORDERS`; '' to be found.
    zone
        Of dates that state none.
    """

    names: tuple[str, ...]
    unit: str = ''
    order: str = ''
    zone: tzinfo = UTC


def parse_input(text: str) -> InputColumns:
    """
    Read `INPUT=COLUMN[:unit]`.

    `position` and `wind_apparent` take two columns, `speed_over_ground` one or the
    components east and north, `shaft` and `pitch` up to four, one a shaft. An
    apparent wind `aws:kn,awa:deg` is its speed and where it comes from, clockwise
    from ahead. A heading in `compass` is in degrees clockwise from north. A unit
    given once holds for all, `position=x,y:km` as much as `position=x:km,y`; several are
    taken as written, `position=x:km,y:m`. A position in `deg` is
    latitude and longitude; so is one without a unit whose columns say so. Others without
    a unit are SI, a pitch is a ratio.
    `speed_through_water_2` and the like are further instruments of a kind.

    Raises
    ------
    ImportDataError
        If the input or a unit is not known, or a column is missing.
    """
    name, _, rest = text.partition('=')
    name = name.strip()
    known = {unit for channel in _UNITS if _name(channel) == name for unit in _UNITS[channel]}
    if not known:
        inputs = ', '.join(dict.fromkeys(map(_name, _UNITS)))
        raise ImportDataError(f'--map {text!r}: no input {name!r}; inputs are {inputs}')
    counts = _COUNTS.get(kind_of(name), (1,))
    columns, units = zip(*(_split_unit(piece, known) for piece in rest.split(',')), strict=True)
    if len(columns) not in counts or not all(columns):
        expected = f'{counts[0]}' if len(counts) == 1 else f'{counts[0]} to {counts[-1]}'
        example = f'{name}={",".join(["COLUMN[:unit]"] * counts[0])}'
        raise ImportDataError(f'--map {text!r}: expected {expected} column(s), {example}')
    return columns_of(name, columns, units)


def columns_of(name: str, columns: Sequence[str], stated: Sequence[str]) -> InputColumns:
    """
    Return the columns of an input.

    Parameters
    ----------
    name
        Of the input, as `--map` takes it.
    columns
        Their names.
    stated
        Unit of each, '' where none is stated.

    Raises
    ------
    ImportDataError
        If the units do not go together.
    """
    given = [*filter(None, stated)]
    channel = next(channel for channel in _UNITS if _name(channel) == name)
    if 'deg' in given:
        channel = GEODETIC.get(channel, channel)
    known = _UNITS[channel]
    common = given[0] if given else next(iter(known))
    units = tuple(unit or common for unit in stated)  # a unit given once holds for all
    found = InputColumns(channel, tuple(columns), units, stated=bool(given))
    expected = ''
    if not known.keys() >= {*units}:
        expected = f'in deg, or both in {", ".join(LENGTH_UNITS)}'
    elif channel is Channel.WIND_APPARENT and ANGLE_UNITS.keys() & {*units} and not found.is_polar:
        expected = 'in a unit of speed, or the second in deg'
    if expected:
        text = f'{name}={",".join(columns)}'
        raise ImportDataError(f'--map {text!r}: expected both columns {expected}')
    return found


def parse_time(text: str) -> TimeColumn:
    """
    Read `COLUMN[:unit]` of the time, or `DATE,TIME` of two columns; s without a unit.

    Raises
    ------
    ImportDataError
        If the unit is not known.
    """
    column, unit = _split_unit(text, NANOSECONDS)
    names = (column,) if unit else tuple(name.strip() for name in column.split(','))
    if not all(names) or len(names) > 2:
        raise ImportDataError(f'--time {text!r}: expected COLUMN[:unit], or DATE,TIME')
    return TimeColumn(names, unit)


def _name(channel: Channel) -> str:
    return 'pitch' if channel in PITCHES else channel.input


def _split_unit(text: str, units: Collection[str]) -> tuple[str, str]:
    """Return column and unit; a colon may also be part of a column's name."""
    column, colon, unit = text.strip().rpartition(':')
    if not colon:
        return unit, ''
    if unit.strip() in units:
        return column.strip(), unit.strip()
    raise ImportDataError(
        f'{text!r}: no unit {unit!r} here; units are {", ".join(sorted(units))}. '
        'For a colon in the name of a column write its number'
    )


_NAMES = strict_yaml.load(
    (resources.files('shipdrag_ros') / 'data' / 'columns.yaml').read_text(encoding='utf-8')
)
UNITS: Mapping[str, str] = {
    name: unit for unit, names in _NAMES['units'].items() for name in names
}
"""How units are written in names of columns, and how `--map` takes them."""

OTHER_UNITS = frozenset(_NAMES['other_units'])
"""Units in brackets or below a name that `--map` does not take: none is guessed for these."""

_BRACKETS = re.compile(r'[\[(]([^\[\]()]*)[\])]')
_ROLE_OF = {name: role for role, names in _NAMES['roles'].items() for name in names}


def role_and_unit(name: str, below: str = '') -> tuple[str, str]:
    """
    Return the role of a column and the unit that its name states; '' for neither.

    Parameters
    ----------
    name
        Of the column.
    below
        What a line of units says of it.
    """
    text = name.strip().lower()
    unit = _stated(below)
    for found in _BRACKETS.findall(text):
        unit = unit or _stated(found)
    plain = _words(_BRACKETS.sub(' ', text))
    words = plain.split()
    if 'rpm' in words and unit not in ('', 'rpm'):
        return ('shaft' if plain == 'rpm' else _ROLE_OF.get(plain, '')), ''
    if plain in _ROLE_OF and (unit or plain not in UNITS):
        return _ROLE_OF[plain], unit or UNITS.get(words[-1] if len(words) > 1 else '', '')
    for length in (3, 2, 1):  # `m_s` is two words
        tail = ' '.join(words[-length:])
        if len(words) > length and tail in UNITS:
            return _ROLE_OF.get(' '.join(words[:-length]), ''), unit or UNITS[tail]
    if plain == 'rpm':
        return 'shaft', 'rpm'
    return _ROLE_OF.get(plain, ''), unit


def _stated(text: str) -> str:
    text = text.strip().strip('[]()').strip().lower()
    return UNITS.get(text, text if text in OTHER_UNITS else '')


def _words(text: str) -> str:
    return ' '.join(
        re.sub(r'[^\w/°%-]+|_', ' ', text.replace('/', ' / ')).replace(' / ', ' ').split()
    )


DELIMITERS = ',;\t|'
BLANKS = ' '
"""Delimiter of a table whose columns stand apart by blanks alone."""

ROWS = 1 << 10
"""Read at a time."""

_SAMPLE_LINES, _LOOKED_AT = 400, 10_001  # those that are not blank, of the first
_LINE = 1 << 20  # characters; no row of a table is as long
_DATE = re.compile(r'\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}([T ].*)?|\d{1,2}:\d\d(:\d\d.*)?')
_KNOWN_UNITS = {*UNITS, *OTHER_UNITS, 'utc', 'hh:mm:ss'}
_UNIT = re.compile(r'[\[(]?([^\[\]()]*)[\])]?')


LogRow = tuple[int, Sequence[str]]
"""The line a row ends on, and its cells, stripped."""

Cells = NDArray[Any]
"""Of a column: numbers, or objects, which are texts, stripped."""


def are_numbers(cells: Cells) -> bool:
    """Say whether a column holds numbers, and no texts."""
    return cells.dtype.kind in 'fiu'


def written(values: NDArray[Any]) -> Cells:
    """Return the shortest text that reads back as the same value; '' where there is none."""
    listed = values.tolist()
    texts = ['' if each is None or each != each else str(each).strip() for each in listed]
    return np.array(texts, object)


def texts_of(cells: Cells) -> Cells:
    """Return cells as text."""
    return written(cells) if are_numbers(cells) else cells


@dataclass(frozen=True)
class TableRows:
    """
    Rows of a table, by their columns.

    Attributes
    ----------
    lines : (n,)
        On which each row ends.
    columns
        Cells (n,) of each column; '' where a row is too short.
    beyond
        By line, the text of a row that has more cells than the table has columns.
    """

    lines: Int64
    columns: Sequence[Cells]
    beyond: Mapping[int, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.lines)

    def __getitem__(self, chosen: NDArray[np.bool_]) -> TableRows:
        """Return the rows that are chosen, (n,)."""
        if chosen.all():
            return self
        columns = [each[chosen] for each in self.columns]
        return TableRows(self.lines[chosen], columns, self.beyond)

    def texts(self, place: int) -> Cells:
        """Return the cells (n,) of a column as text."""
        return texts_of(self.columns[place])

    def joined(self, places: Sequence[int]) -> Cells:
        """Return the cells (n,) of one column, or the text of two: a date and its time of day."""
        if len(places) == 1:
            return self.columns[places[0]]
        joined = np.full(len(self), '', object)
        for place in places:
            joined += self.texts(place) + ' '
        return written(joined)


class LogTable:
    """
    A table in a file.

    Parameters
    ----------
    path
        UTF-8, with or without a byte-order mark, plain or packed with gzip;
        separated by comma, semicolon, tab or bar, or by blanks alone. Lines of a
        title may stand before it, and a line of units below the header.

    Attributes
    ----------
    delimiter
        One of `DELIMITERS`, or `BLANKS`.
    header
        Names of the columns; None if the first line holds measurements.
    units
        What stands below the header in a line of units; None without one.
    titles
        Lines before the table.
    width
        Number of columns.
    joined_lines
        Lines that the last reading of the rows took as part of a cell in quotation marks.

    Raises
    ------
    ImportDataError
        If the file cannot be read or has no line.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.joined_lines = 0
        lines = self._first_lines()
        first = lines[0][1] if lines else ''
        if not first:
            raise self.error(' is empty; give a table with a line a sample')
        if '\0' in first or first.startswith('PK'):  # as spreadsheets begin, which are archives
            raise self.error(f' is no text, it begins with {first[:4]!r}; save it as CSV')
        start, self.delimiter, named = self._layout([line for _, line in lines])
        self.titles = tuple(line.strip() for _, line in lines[:start])
        self._skip = lines[start][0] - 1
        if not named:
            raise self.error(' holds no cell; give a table with a line a sample')
        cells = (named[0].lstrip('# '), *named[1:])
        measured = [_is_measured(cell) for cell in cells if cell]
        self.header = cells if 2 * sum(measured) < len(measured) else None
        self.width = len(cells)
        below = ''.join(line for _, line in lines[start + 1 : start + 2])
        self.units = None if self.header is None else _units(self._cells(below, self.delimiter))

    def _first_lines(self) -> list[tuple[int, str]]:
        """Return the first lines that are not blank, with their numbers."""
        blank = DELIMITERS + ' \r\n'
        numbered = islice(enumerate(self._lines(), start=1), _LOOKED_AT)
        try:
            filled = ((number, line) for number, line in numbered if line.strip(blank).strip())
            return list(islice(filled, _SAMPLE_LINES))
        except OSError as error:
            why = error.strerror or error
            raise self.error(f' cannot be read: {why}; give a CSV file') from error

    def error(self, text: str) -> ImportDataError:
        """Return an error of the table, which names its file."""
        return ImportDataError(f'{str(self.path)!r}{text}')

    def _layout(self, lines: Sequence[str]) -> tuple[int, str, Sequence[str]]:
        """Return where the table begins, the delimiter that makes rows of it, its first row."""
        layouts = []
        for mark in DELIMITERS:
            rows = [self._cells(line, mark) for line in lines]
            start = _first_row(rows)
            if start is not None:
                layouts.append((start, mark, rows[start]))
        if layouts:
            return max(layouts, key=lambda each: (-each[0], len(each[2])))
        rows = [line.split() for line in lines]
        width = len(rows[-1])
        start = next(place for place, row in enumerate(rows) if len(row) == width)
        same = sum(len(row) == width for row in rows[start:])
        if width > 1 and same >= 0.8 * len(rows[start:]) and _DATE.match(rows[-1][0]):
            return start, BLANKS, rows[start]
        return 0, DELIMITERS[0], self._cells(lines[0], DELIMITERS[0])

    def column(self, name: str) -> int:
        """
        Return the place of a column given by name or number.

        Raises
        ------
        ImportDataError
            If there is none, or several of the name.
        """
        names = self.header or ()
        found = [place for place, each in enumerate(names) if each == name]
        if len(found) > 1:
            numbers = ' or '.join(str(place + 1) for place in found)
            raise self.error(f' has {len(found)} columns {name!r}; write a number: {numbers}')
        if found:
            return found[0]
        if name.isdecimal() and 1 <= int(name) <= self.width:
            return int(name) - 1
        listed = ', '.join(repr(each) for each in names) or 'no header'
        hint = f'and numbers 1 to {self.width} are names too'
        if self.width == 1:
            hint = 'and no comma, semicolon or tab that would separate columns'
        raise self.error(f' has no column {name!r}; it has {listed}, {hint}')

    def columns(self, names: Iterable[str]) -> list[int]:
        """Return the places of columns given by names or numbers."""
        return [self.column(name) for name in names]

    def key(self, place: int) -> str:
        """
        Return what `column` finds a column by: its name, or its number where that is not its own.
        """
        name, _ = self.about(place)
        return name if (self.header or ()).count(name) == 1 else str(place + 1)

    def about(self, place: int) -> tuple[str, str]:
        """
        Return the name of a column and the unit in the line below it; '' where none is there.
        """
        name, below = ([*(each or ())][place : place + 1] for each in (self.header, self.units))
        return ''.join(name), ''.join(below)

    def rows(self, progress: PartDone | None = None, *, most: int = ROWS) -> Iterator[TableRows]:
        """
        Yield the rows below the header, some at a time; lines without any cell are skipped.

        Parameters
        ----------
        progress
            Called with how many bytes are read, and of how many.
        most
            Rows at a time.
        """
        above = (self.header is not None) + (self.units is not None)
        self.joined_lines = 0
        lines = islice(self._lines(progress), self._skip, None)
        rows = islice(self._rows(lines, self.delimiter, self._skip), above, None)
        while some := list(islice(rows, most)):
            yield self._by_column(some)

    def first_rows(self, most: int) -> TableRows:
        """Return the first rows."""
        return next(self.rows(most=most), self._by_column([]))

    def _by_column(self, rows: Sequence[LogRow]) -> TableRows:
        empty = [''] * self.width
        padded = zip_longest(empty, *(cells for _, cells in rows), fillvalue='')
        columns = np.array([*padded], object)[:, 1:]
        beyond = {}
        if len(columns) > self.width:  # as decimal commas make it
            beyond = {line: ','.join(cells) for line, cells in rows if any(cells[self.width :])}
        lines = np.array([line for line, _ in rows], np.int64)
        return TableRows(lines, [*columns[: self.width]], beyond)

    def _cells(self, line: str, delimiter: str) -> Sequence[str]:
        return next((cells for _, cells in self._rows([line], delimiter)), ())

    def _rows(self, lines: Iterable[str], delimiter: str, above: int = 0) -> Iterator[LogRow]:
        if delimiter == BLANKS:
            for number, line in enumerate(lines, start=above + 1):
                if line.strip():
                    yield number, line.split()
            return
        reader = csv.reader(lines, delimiter=delimiter)
        try:
            last = 0
            for cells in reader:
                self.joined_lines += reader.line_num - last - 1
                last = reader.line_num
                stripped = [cell.strip() for cell in cells]
                if any(stripped):
                    yield above + reader.line_num, stripped
        except csv.Error as error:
            number = above + reader.line_num
            raise self.error(f' line {number} is no row of a table: {error}') from error

    def _lines(self, progress: PartDone | None = None) -> Iterator[str]:
        """Yield lines of a sane length."""
        number = 0
        try:
            # a name that is not UTF-8 may still be given by its number
            for line in lines_of(self.path, _LINE, newline='', progress=progress):
                number += 1
                if len(line) == _LINE:
                    why = f'it is longer than {_LINE} characters'
                    raise self.error(f' line {number} is no row of a table: {why}')
                yield line
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            where = f' after line {number}' if number else ''
            raise self.error(f' cannot be unpacked{where}: {error}') from error


def _first_row(rows: Sequence[Sequence[str]]) -> int | None:
    """
    Return where a table of several columns begins, None where the rows make none.

    Its last rows show its width, whatever stands above; its first row is one of that
    width of which most of those below are too.
    """
    below = rows[len(rows) // 2 :]
    usual = Counter(map(len, below)).most_common(1)[0][0]
    near = [len(row) > 1 and abs(len(row) - usual) <= 1 for row in rows]
    for start, row in enumerate(rows):
        # a title of a spreadsheet is followed by empty cells
        if not near[start] or sum(map(bool, row)) < 2:
            continue
        rest = near[start:]
        if sum(rest) >= 0.6 * len(rest) and sum(rest[:5]) >= 0.7 * len(rest[:5]):
            # titles may be as wide as the table: the header is the line with known names
            names = [
                0 if any(map(_is_measured, row)) else sum(bool(role_and_unit(c)[0]) for c in row)
                for row in rows[start:]
            ]
            return start + names.index(max(names))
    return None


def _is_measured(cell: str) -> bool:
    return bool(NUMBER.fullmatch(cell) or _DATE.fullmatch(cell))


def _units(cells: Sequence[str]) -> tuple[str, ...] | None:
    """Return the units of a line that holds nothing else; None of any other line."""
    found = [match[1].strip() if (match := _UNIT.fullmatch(cell)) else cell for cell in cells]
    known = sum(each.lower() in _KNOWN_UNITS for each in found)
    if not known or any(map(_is_measured, cells)):
        return None
    return tuple(found)


_SHOWN = 20  # cells that are shown one by one
_MOST = 1e30  # its tenth power is a number still


@dataclass(frozen=True)
class Numbers:
    """
    Columns of one file.

    Attributes
    ----------
    names : (k,)
        Of the columns.
    values : (n, k)
        Finite numbers, whose higher powers are finite too.
    """

    names: tuple[str, ...]
    values: Float64

    def column(self, name: str) -> Float64:
        """Return (n,) values of a column that is there."""
        return self.values[:, self.names.index(name)]


def read_numbers(
    path: str | PathLike[str], names: Sequence[str], *, optional: Sequence[str] = ()
) -> Numbers:
    """
    Read columns of a CSV file by name.

    Parameters
    ----------
    path
        Separated by comma, semicolon or tab, with a header.
    names
        Columns that must be there.
    optional
        Columns that are read where they are there.

    Raises
    ------
    DataError
        Naming every column that is missing, or every cell that is no usable
        number.
    ImportDataError
        If the file is no table.
    """
    table = LogTable(Path(path))
    there = [name for name in optional if name in (table.header or ()) and name not in names]
    wanted = (*names, *there)
    places, problems = [], []
    for name in wanted:
        try:
            places.append(table.column(name))
        except ImportDataError as error:
            problems.append(str(error))
    if problems:
        raise DataError(str(path), problems)
    rows: list[list[float]] = []
    for some in table.rows():
        for line, *cells in zip(some.lines, *(some.texts(place) for place in places)):
            rows.append([_number(line, *each, problems) for each in zip(wanted, cells)])
    if not rows:
        problems.append('no row below the header, expected a line a measurement')
    if problems:
        more = len(problems) - _SHOWN
        shown = [*problems[:_SHOWN], f'and {more} more'] if more > 0 else problems
        raise DataError(str(path), shown)
    return Numbers(wanted, np.array(rows, np.float64).reshape(len(rows), len(wanted)))


def _number(line: int, name: str, cell: str, problems: list[str]) -> float:
    """Return the number of a cell; of one that holds none, what is wrong goes to the problems."""
    if NUMBER.fullmatch(cell) and abs(value := float(cell)) <= _MOST:
        return value
    comma = NUMBER.fullmatch(cell.replace(',', '.', 1)) and ',' in cell
    problems.append(
        f'line {line}, {name}: {cell!r}, expected a number, at most {_MOST:g} in size'
        + ('; write a decimal point' if comma else '')
    )
    return 0.0
