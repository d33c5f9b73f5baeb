# SPDX-License-Identifier: Apache-2.0
"""
Which columns of a table are which inputs, where nobody says so.

A column is taken where its name says what it is and its unit is sure: stated in
the name or below it, told by its values (degrees beyond 2 pi), or by the
positions of the same table. What is not sure is told with what to type, and
not used.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import tzinfo
from itertools import islice
from pathlib import Path

import numpy as np

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.importing.formats.csv.agreement import plane_speed, track_speed, unit_of
from shipdrag_ros.importing.formats.csv.cells import (
    BadCell,
    are_in_minutes,
    degrees_of,
    has_decimal_commas,
    minutes_of,
    number,
)
from shipdrag_ros.importing.formats.csv.columns import (
    COMPASS,
    NANOSECONDS,
    SPEED_UNITS,
    InputColumns,
    TimeColumn,
    columns_of,
)
from shipdrag_ros.importing.formats.csv.dates import is_date, is_midnight, parts
from shipdrag_ros.importing.formats.csv.names import role_and_unit
from shipdrag_ros.importing.formats.csv.row_clock import RowClock
from shipdrag_ros.importing.table import LogTable
from shipdrag_ros.samples import MOTION_INPUTS, Float64

PLAIN_TIMES = ('time', 'time_s', 't', 't_s')
PLAIN_COLUMNS = {
    'speed_through_water': 'speed_through_water',
    'speed_over_ground': 'speed_over_ground',
    'heading': 'heading',
    'shaft': 'shaft',
    'rudder': 'rudder',
    'depth': 'depth',
    'x,y': 'position',
    'latitude,longitude': 'position',
}
"""Columns named as the inputs are, in SI units, and their input."""

_SAMPLE_ROWS = 20_000
_TURN = 6.4  # no angle in rad is larger
_NO_COORDINATES = ('rad', 'mrad', 'gon', 'm', 'km', 'ft', 'nmi', 'min')
_DAYS = 20_000.0  # a spreadsheet's count of days, from 1954 on
_QUICK_S = 0.002  # of rows a day apart by that, 86400 / 500 s
_SPEED_UNIT = 'kn'  # in what is to be typed


@dataclass
class Guess:
    """
    What was understood of a table.

    Attributes
    ----------
    inputs
        Columns to take.
    time
        Column of the time; None where rows are counted.
    notes
        How it is known, a sentence each.
    unclear
        What was not sure, and what to type, a sentence each.
    """

    inputs: list[InputColumns] = field(default_factory=list)
    time: TimeColumn | None = None
    notes: list[str] = field(default_factory=list)
    unclear: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class _Column:
    """A column with a role; `key` is its name, or its number where that does not tell it."""

    key: str
    place: int
    unit: str

    @property
    def typed(self) -> str:
        """As `--map` takes it."""
        return str(self.place + 1) if set(self.key) & set(',:=') else self.key


def guess(
    table: LogTable, *, time: TimeColumn | None = None, counted: bool = False, speed_unit: str = ''
) -> Guess:
    """
    Find the inputs in a table.

    Parameters
    ----------
    table
    time
        Column of the time, where it is given.
    counted
        Whether the rows are counted, so that none is needed.
    speed_unit
        Of speeds whose columns state none; '' where it is not given.

    Raises
    ------
    ImportDataError
        If nothing that moves has a known unit, saying what to type.
    """
    if table.header is None:
        raise ImportDataError(
            f'{str(table.path)!r} has no names of columns; say what they are by their numbers, '
            'for instance --map speed_through_water=1:kn --rate 1'
        )
    made = _Guesser(table, speed_unit)
    if time is None and not counted:
        time = made.time()
    made.found.time = time
    if made.is_plain():
        made.plain()
    else:
        made.by_names(time)
    if not any(each.channel.input in MOTION_INPUTS for each in made.found.inputs):
        raise ImportDataError(made.nothing())
    return made.found


def guess_time(table: LogTable, found: Guess) -> TimeColumn:
    """
    Find the column of the time alone; how it is known goes to the notes.

    Raises
    ------
    ImportDataError
        If there is none.
    """
    made = _Guesser(table, '')
    made.found = found
    return made.time()


class _Guesser:
    """Reads the first rows of a table and guesses."""

    def __init__(self, table: LogTable, speed_unit: str) -> None:
        assert table.header is not None
        self._table = table
        self._speed_unit = speed_unit
        self._rows = list(islice(table.rows(), _SAMPLE_ROWS))
        self._roles: dict[str, list[_Column]] = {}
        self._track: Float64 | None = None
        self._used: set[int] = set()
        self.found = Guess()
        for place, name in enumerate(table.header):
            below = table.units[place] if table.units and place < len(table.units) else ''
            role, unit = role_and_unit(name, below)
            key = name if table.header.count(name) == 1 else str(place + 1)
            if role:
                self._roles.setdefault(role, []).append(_Column(key, place, unit))

    # the columns

    def _texts(self, place: int) -> list[str]:
        return [row.cells[place] if place < len(row.cells) else '' for row in self._rows]

    def _values(self, column: _Column) -> Float64:
        texts = self._texts(column.place)
        comma = has_decimal_commas(texts)
        return _numbers([text.replace(',', '.', 1) if comma else text for text in texts])

    def _one(self, role: str) -> _Column | None:
        columns = self._roles.get(role, [])
        if len(columns) > 1:
            others = ', '.join(repr(each.key) for each in columns[1:])
            self._doubt(f'{others}: {columns[0].key!r} is taken for the same thing')
        return columns[0] if columns else None

    def _doubt(self, text: str) -> None:
        if text not in self.found.unclear:
            self.found.unclear.append(text)

    def _take(self, name: str, columns: Sequence[_Column], units: Sequence[str]) -> None:
        self.found.inputs.append(columns_of(name, [each.key for each in columns], list(units)))

    # the time

    def time(self) -> TimeColumn:
        days, times = self._roles.get('date', []), self._roles.get('time', [])
        dated = [each for each in (*times, *days) if self._holds_date(each)]
        if dated:
            clock = next((each for each in times if each not in dated), None)
            clocks = [parts(text)[1] for text in self._texts(dated[0].place)]
            bare = not any(clocks[:5])
            if clock is not None and not bare:  # a spreadsheet gives a date a midnight
                bare = self._holds_time_of_day(clock) and all(map(is_midnight, clocks))
            if bare and clock is not None:
                return TimeColumn((dated[0].key, clock.key), NANOSECONDS['s'])
            return TimeColumn((dated[0].key,), NANOSECONDS['s'])
        if not times:
            header = ', '.join(map(repr, self._table.header or ()))
            raise ImportDataError(
                f'{str(self._table.path)!r} has no column that is known as a time; it has '
                f'{header}. Give --time COLUMN[:unit], or --rate HZ'
            )
        column = times[0]
        if column.unit in NANOSECONDS:
            return TimeColumn((column.key,), NANOSECONDS[column.unit], given=True)
        return self._counted(column)

    def _holds_date(self, column: _Column) -> bool:
        texts = [text for text in self._texts(column.place)[:200] if text]
        return bool(texts) and is_date(texts[0]) and bool(parts(texts[0])[0])

    def _holds_time_of_day(self, column: _Column) -> bool:
        texts = [text for text in self._texts(column.place)[:200] if text]
        return bool(texts) and is_date(texts[0]) and not parts(texts[0])[0]

    def _counted(self, column: _Column) -> TimeColumn:
        """Return a time without a unit; whole numbers in large steps may be milliseconds."""
        texts = [text for text in self._texts(column.place) if text]
        if texts and is_date(texts[0]):
            return TimeColumn((column.key,), NANOSECONDS['s'])
        values = self._values(column)
        values = values[np.isfinite(values)]
        step = float(np.median(np.diff(values))) if len(values) > 1 else 0.0
        small = len(values) > 0 and abs(values[0]) < 1e11
        if column.unit:
            raise ImportDataError(
                f'{str(self._table.path)!r}: the time {column.key!r} is said to be in '
                f'{column.unit}; counts are read in {", ".join(NANOSECONDS)}. Write it in one of '
                'them, or give --rate HZ'
            )
        if small and values[0] >= _DAYS and 0.0 < step < _QUICK_S:
            raise ImportDataError(
                f'{str(self._table.path)!r}: the time {column.key!r} goes by {step:.3g} from '
                f'{values[0]:.8g}, as the days of a spreadsheet do. Save it as dates; or, if they '
                f'are seconds, give --time {shlex.quote(column.typed)}:s'
            )
        if small and step >= 10.0:
            raise ImportDataError(
                f'{str(self._table.path)!r}: the unit of the time {column.key!r} is not known; '
                f'its steps are {step:g}. Give --time {shlex.quote(column.typed)}:ms, or :s'
            )
        if small:
            self.found.notes.append(f'The time {column.key!r} states no unit and is taken as s.')
        return TimeColumn((column.key,), NANOSECONDS['s'])

    # columns named as the inputs are

    def is_plain(self) -> bool:
        header = set(self._table.header or ())
        known = {name for names in PLAIN_COLUMNS for name in names.split(',')}
        named = {each.key for columns in self._roles.values() for each in columns}
        return (
            bool(header & set(PLAIN_TIMES))
            and bool(header & known - {'x', 'y'})
            and (named <= known | set(PLAIN_TIMES))
        )

    def plain(self) -> None:
        header = self._table.header or ()
        for names, name in PLAIN_COLUMNS.items():
            columns = names.split(',')
            if not all(column in header for column in columns):
                continue
            unit = 'deg' if names.startswith('latitude') else None
            found = columns_of(name, columns, [unit] * len(columns))
            if name in ('heading', 'rudder') and self._largest(columns[0]) > _TURN:
                raise ImportDataError(
                    f'{str(self._table.path)!r}: {name!r} goes to {self._largest(columns[0]):g}, '
                    f'which is no angle in rad; a column of this name is in SI units. Name the '
                    f'unit in it, {name}_deg, or give --map'
                )
            self.found.inputs.append(found)
        self.found.notes.append('The columns have the names of the inputs: their units are SI.')

    def _largest(self, name: str) -> float:
        values = self._values(_Column(name, self._table.column(name), ''))
        return float(np.nanmax(np.abs(values), initial=0.0))

    # columns by their usual names

    def by_names(self, time: TimeColumn | None) -> None:
        self._position(time)
        known = [
            self._speed('stw', 'speed_through_water'),
            self._speed('sog', 'speed_over_ground'),
        ]
        if not known[1]:
            self._components()
        self._heading()
        self._rudder()
        self._wind()
        for role, name, units in (('shaft', 'shaft', 'rpm'), ('depth', 'depth', 'm')):
            column = self._one(role)
            if column is None:
                continue
            try:
                self._take(name, [column], [column.unit])
            except ImportDataError:  # of none, or of another quantity
                self._unit_unknown(column, name, units)

    def _position(self, time: TimeColumn | None) -> None:
        latitude, longitude = self._one('lat'), self._one('lon')
        x, y = self._one('x'), self._one('y')
        seconds = self._seconds(time)
        if latitude is not None and longitude is not None:
            for unit in (latitude.unit, longitude.unit):
                if unit in _NO_COORDINATES:
                    self._doubt(
                        f'{latitude.key!r}, {longitude.key!r}: coordinates in {unit} are not read'
                    )
                    return
            self._take('position', [latitude, longitude], ['deg', 'deg'])
            texts = [self._texts(each.place) for each in (latitude, longitude)]
            minutes = are_in_minutes(*texts)
            values = [
                _coordinates(cells, side, minutes)
                for cells, side in zip(texts, ('NS', 'EW'), strict=True)
            ]
            if seconds is not None:
                self._track = track_speed(seconds, *values)
        elif x is not None and y is not None:
            if x.unit == y.unit and x.unit in ('m', 'km', 'ft', 'nmi'):
                self._take('position', [x, y], [x.unit, y.unit])
                if seconds is not None and x.unit == 'm':
                    self._track = plane_speed(seconds, self._values(x), self._values(y))
            else:
                self._doubt(
                    f'{x.key!r}, {y.key!r}: unit not known; --map '
                    f'{shlex.quote(f"position={x.typed},{y.typed}:m")}'
                )

    def _seconds(self, time: TimeColumn | None) -> Float64 | None:
        """Return the times of the first rows from the first one [s], NaN where there is none."""
        if time is None:
            return None
        places = [self._table.column(name) for name in time.names]
        texts = [' '.join(cells).strip() for cells in zip(*map(self._texts, places), strict=True)]
        try:
            clock = RowClock.of(time, None, 0, texts, self._table)
        except ImportDataError:
            return None
        found = np.full(len(texts), np.nan)
        first: int | None = None
        for index, text in enumerate(texts):
            try:
                time_ns = clock.time_ns(index, text)
            except BadCell:
                continue
            first = time_ns if first is None else first
            found[index] = (time_ns - first) * 1e-9
        return found

    def _speed(self, role: str, name: str) -> bool:
        column = self._one(role)
        if column is None:
            return False
        values = self._values(column)
        unit = self._unit_of_speed(column)
        seen = '' if self._track is None else unit_of(values, self._track, unit)
        if column.unit and not unit:
            self._unit_unknown(column, name, _SPEED_UNIT)
            return False
        if unit and seen and seen != unit:
            self._doubt(
                f'{column.key!r} is said to be in {unit}, and agrees with the positions in '
                f'{seen}; --map {shlex.quote(f"{name}={column.typed}:{unit}")}, or {seen}'
            )
            return False
        if not unit and seen:
            self.found.notes.append(
                f'{column.key!r} states no unit; it agrees with the way between the positions in '
                f'{seen}.'
            )
        if not (unit or seen):
            self._unit_unknown(column, name, _SPEED_UNIT)
            return False
        self._take(name, [column], [unit or seen])
        if self._track is None:  # the other speed is held against this one
            self._track = values * SPEED_UNITS[unit or seen]
        return True

    def _unit_of_speed(self, column: _Column) -> str:
        """Return the unit that is stated or given; '' for none, or one of no speed."""
        if column.unit:
            return column.unit if column.unit in SPEED_UNITS else ''
        return self._speed_unit

    def _components(self) -> None:
        east, north = self._one('east'), self._one('north')
        if east is None or north is None:
            return
        unit = east.unit if east.unit == north.unit else ''
        if not unit and self._track is not None:
            unit = unit_of(np.hypot(self._values(east), self._values(north)), self._track)
            if unit:
                self.found.notes.append(
                    f'{east.key!r}, {north.key!r} agree with the way between the positions in '
                    f'{unit}.'
                )
        unit = unit or self._speed_unit
        if unit in SPEED_UNITS:
            self._take('speed_over_ground', [east, north], [unit, unit])
        else:
            self._doubt(
                f'{east.key!r}, {north.key!r}: unit not known; --map '
                f'{shlex.quote(f"speed_over_ground={east.typed},{north.typed}:m/s")}, or another'
            )

    def _heading(self) -> None:
        column = self._one('heading')
        if column is None:
            return
        largest = self._largest(column.key)
        if column.unit == 'deg' or (not column.unit and largest > _TURN):
            self._take('heading', [column], [COMPASS])
            self.found.notes.append(f'{column.key!r} is taken as degrees clockwise from north.')
        else:
            unit = column.unit if column.unit == 'rad' else COMPASS
            self._doubt(
                f'{column.key!r}: whether it is yaw or compass, or its unit, is not known; --map '
                f'{shlex.quote(f"heading={column.typed}:{unit}")}, or rad deg '
                'compass'
            )

    def _rudder(self) -> None:
        column = self._one('rudder')
        if column is None:
            return
        unit = column.unit or ('deg' if self._largest(column.key) > _TURN else '')
        if unit in ('deg', 'rad'):
            self._take('rudder', [column], [unit])
        else:
            self._unit_unknown(column, 'rudder', 'deg')

    def _wind(self) -> None:
        speed, angle = self._one('aws'), self._one('awa')
        if speed is None or angle is None:
            return
        unit = self._unit_of_speed(speed)
        turn = angle.unit or ('deg' if self._largest(angle.key) > _TURN else '')
        if unit and turn in ('deg', 'rad'):
            self._take('wind_apparent', [speed, angle], [unit, turn])
        else:
            turn = turn if turn in ('deg', 'rad') else 'deg'
            typed = f'wind_apparent={speed.typed}:{_SPEED_UNIT},{angle.typed}:{turn}'
            self._doubt(
                f'{speed.key!r}, {angle.key!r}: unit not known; --speed-unit {_SPEED_UNIT} or '
                f'm/s, or --map {shlex.quote(typed)}'
            )

    def _unit_unknown(self, column: _Column, name: str, unit: str) -> None:
        speeds = f'--speed-unit {unit} or m/s, or ' if unit in SPEED_UNITS else ''
        self._doubt(
            f'{column.key!r}: unit not known; {speeds}--map '
            f'{shlex.quote(f"{name}={column.typed}:{unit}")}, or another unit'
        )

    def nothing(self) -> str:
        """Say that nothing that moves is known, and what to type."""
        path = str(self._table.path)
        why = '; '.join(self.found.unclear) or (
            f'its columns are {", ".join(map(repr, self._table.header or ()))}, and none has a '
            'usual name of a speed or a position; say which it is, for instance --map '
            'speed_over_ground=COLUMN:kn --map position=LAT,LON:deg'
        )
        return f'{path!r} tells no speed and no position in a unit that is known: {why}'


def _numbers(texts: Sequence[str]) -> Float64:
    found = np.full(len(texts), np.nan)
    for place, text in enumerate(texts):
        try:
            found[place] = number(text)
        except BadCell:
            continue
    return found


def _coordinates(texts: Sequence[str], side: str, minutes: bool) -> Float64:
    read = minutes_of(side) if minutes else degrees_of(side)
    found = np.full(len(texts), np.nan)
    for place, text in enumerate(texts):
        try:
            found[place] = read(text)
        except BadCell:
            continue
    return found


def with_dates(time: TimeColumn | None, order: str, zone: tzinfo | None) -> TimeColumn | None:
    """
    Return the column of a time with what was said of its dates.
    """
    if time is None:
        return None
    return replace(time, order=order or time.order, zone=zone or time.zone)


def is_table(path: Path) -> bool:
    """
    Say whether a file can be read as a table with several columns or numbers alone.
    """
    try:
        table = LogTable(path)
    except ImportDataError:
        return False
    return table.width > 1 or table.header is None
