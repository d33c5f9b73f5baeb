# SPDX-License-Identifier: Apache-2.0
"""
Which columns of a table are which inputs, where nobody says so.

A column is taken where its name says what it is and its unit is sure: stated in
the name or below it, shown by its values (degrees beyond 2 pi), or by the
positions of the same table. What is not sure is named with what to type, and
not used.
"""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import ALL_MOTION, FURTHER, Channel, Float64
from shipdrag_ros.sources.formats.csv.cells import (
    MIDNIGHT,
    Bad,
    CellReader,
    RowClock,
    coordinate_readers,
    has_decimal_commas,
    is_date,
    parts,
    row_clock,
    usable,
)
from shipdrag_ros.sources.formats.csv.table import (
    ANGLE_UNITS,
    COMPASS,
    LENGTH_UNITS,
    NANOSECONDS,
    SPEED_UNITS,
    Cells,
    InputColumns,
    LogTable,
    TimeColumn,
    are_numbers,
    columns_of,
    parse_input,
    role_and_unit,
)

_STEP_S = 10.0  # over which the way is measured: long against the scatter of a position
_MOVING_M_S = 0.4
_FEWEST = 10
_NEAR = 1.25  # two units differ by 1.7 and more; a current or a log by less than this
_SPREAD = 1.6  # of the middle half of the ratios


def track_speed(time_s: Float64, latitude: Float64, longitude: Float64) -> Float64:
    """
    Return (n,) speeds over ground [m/s] around each sample, from positions; NaN where none is.

    Parameters
    ----------
    time_s : (n,)
        Ascending where it can be used [s].
    latitude, longitude : (n,)
        [deg].
    """
    if not np.isfinite(latitude).any():
        return np.full(len(time_s), np.nan)
    radius_m = 6.371e6
    north = np.radians(latitude) * radius_m
    east = np.radians(longitude) * radius_m * np.cos(np.radians(np.nanmean(latitude)))
    return plane_speed(time_s, east, north)


def plane_speed(time_s: Float64, x: Float64, y: Float64) -> Float64:
    """Return (n,) speeds [m/s] around each sample, from (n,) positions [m]."""
    speed = np.full(len(time_s), np.nan)
    good = np.flatnonzero(np.isfinite(time_s) & np.isfinite(x) & np.isfinite(y))
    good = good[np.diff(np.maximum.accumulate(time_s[good]), prepend=-np.inf) > 0.0]
    if len(good) < 2:
        return speed
    time = time_s[good]
    ends = np.minimum(np.searchsorted(time, time + _STEP_S), len(good) - 1)
    length_s = time[ends] - time
    whole = (length_s >= 0.5 * _STEP_S) & (length_s <= 3.0 * _STEP_S)
    way = np.hypot(x[good][ends] - x[good], y[good][ends] - y[good])
    middle = good[(np.arange(len(good)) + ends)[whole] // 2]
    speed[middle] = way[whole] / length_s[whole]
    return speed


def unit_of(values: Float64, track_m_s: Float64, stated: str = '') -> str:
    """
    Return the unit in which values agree with speeds over ground; '' where none clearly does.

    Parameters
    ----------
    values : (n,)
        In an unknown unit.
    track_m_s : (n,)
        From `track_speed`.
    stated
        Unit that may be another than m/s, kn and km/h, which are looked for.
    """
    use = np.isfinite(values) & np.isfinite(track_m_s) & (values > 0.0)
    use &= track_m_s > _MOVING_M_S
    if use.sum() < _FEWEST:
        return ''
    ratio = values[use] / track_m_s[use]
    low, middle, high = np.quantile(ratio, [0.25, 0.5, 0.75])
    if high > _SPREAD * low:
        return ''
    units = dict.fromkeys(('m/s', 'kn', 'km/h', stated or 'm/s'))
    off = {unit: abs(np.log(middle * SPEED_UNITS[unit])) for unit in units}
    nearest = min(off, key=lambda unit: off[unit])
    return nearest if off[nearest] < np.log(_NEAR) else ''


_SAMPLE_ROWS = 20_000
_STYLE_ROWS = 2000  # of these, by which the way of writing is known


@dataclass(frozen=True)
class NamedColumn:
    """A column with a role; `key` is its name, or its number where the name is not enough."""

    key: str
    place: int
    unit: str

    @property
    def typed(self) -> str:
        """As `--map` takes it."""
        return str(self.place + 1) if set(self.key) & set(',:=') else self.key


class FirstRows:
    """
    The first rows of a table.

    Parameters
    ----------
    table

    Attributes
    ----------
    header
        Of the table.
    roles
        Columns by what their names say they are, in their order.
    """

    def __init__(self, table: LogTable) -> None:
        self.table = table
        self.header = table.header or ()
        self.roles: dict[str, list[NamedColumn]] = {}
        self._rows = table.first_rows(_SAMPLE_ROWS)
        for place in range(len(self.header)):
            role, unit = role_and_unit(*table.about(place))
            if role:
                named = NamedColumn(table.key(place), place, unit)
                self.roles.setdefault(role, []).append(named)
        self._style = self._rows[np.arange(len(self._rows)) < _STYLE_ROWS]
        texts = (cells for cells in self._style.columns if not are_numbers(cells))
        self._comma = has_decimal_commas(chain.from_iterable(texts))

    def texts(self, place: int) -> Cells:
        """Return the cells of a column; '' where a row is too short."""
        return self._rows.texts(place)

    def values(self, place: int) -> Float64:
        """Return (n,) numbers of a column, NaN where a cell is none."""
        cells = self._rows.columns[place]
        return CellReader(not are_numbers(cells) and has_decimal_commas(cells)).all(cells, {})

    def largest(self, place: int) -> float:
        """Return the largest size of the numbers of a column; 0 where it has none."""
        return float(np.nanmax(np.abs(self.values(place)), initial=0.0))

    def coordinates(self, places: Sequence[int]) -> list[Float64]:
        """Return latitudes and longitudes [deg], (n,) each, NaN where a cell is none."""
        readers = coordinate_readers(*map(self._style.texts, places))
        cells = [self._rows.columns[place] for place in places]
        return [read.all(each, {}) for read, each in zip(readers, cells, strict=True)]

    def readers(self, columns: InputColumns) -> list[CellReader]:
        """Return what reads the cells of each column, as they are written in the first rows."""
        places = self.table.columns(columns.names)
        if columns.channel.kind is Channel.POSITION_GEODETIC:
            return coordinate_readers(*map(self._style.texts, places))
        return [CellReader(comma=self._comma)] * len(places)

    def may_be_degrees(self, places: Sequence[int]) -> bool:
        """Say whether all numbers of two columns can be latitudes and longitudes."""
        numbers = map(self.values, places)
        return all(
            np.all(np.isfinite(degrees) | ~np.isfinite(number))
            for degrees, number in zip(self.coordinates(places), numbers, strict=True)
        )

    def clock(self, time: TimeColumn | None, rate_hz: float | None = None) -> RowClock:
        """Return the clock of the table, see `row_clock`."""
        places = [] if time is None else self.table.columns(time.names)
        return row_clock(time, rate_hz, self._style.joined(places), self.table)

    def seconds(self, time: TimeColumn | None) -> Float64 | None:
        """Return (n,) times of the rows from the first one [s], NaN where there is none."""
        if time is None:
            return None
        bad: Bad = {}
        cells = self._rows.joined(self.table.columns(time.names))
        try:
            times = self.clock(time).times(cells, bad)
        except ImportDataError:
            return None
        good = usable(len(times), bad)
        return np.where(good, (times - times[good][:1].sum()) * 1e-9, np.nan)


_DAYS = 20_000.0  # a spreadsheet's count of days, from 1954 on
_QUICK_S = 0.002  # of rows a day apart by that, 86400 / 500 s


def guessed_time(rows: FirstRows, notes: list[str]) -> TimeColumn:
    """
    Find the column of the time; how it is known goes to the notes.

    Raises
    ------
    ImportDataError
        If there is none.
    """
    days, times = rows.roles.get('date', []), rows.roles.get('time', [])
    dated = [each for each in (*times, *days) if _holds(rows, each, date=True)]
    if dated:
        clock = next((each for each in times if each not in dated), None)
        clocks = [parts(text)[1] for text in rows.texts(dated[0].place)]
        names = [dated[0].key]
        if clock is not None and (
            not any(clocks[:5])
            # a spreadsheet gives a date a midnight
            or (_holds(rows, clock, date=False) and all(map(MIDNIGHT.fullmatch, clocks)))
        ):
            names.append(clock.key)
        return TimeColumn(tuple(names))
    if not times:
        header = ', '.join(map(repr, rows.header))
        raise rows.table.error(
            f' has no column that is known as a time; it has {header}. Give --time '
            'COLUMN[:unit], or --rate HZ'
        )
    column = times[0]
    if column.unit in NANOSECONDS:
        return TimeColumn((column.key,), column.unit)
    return _counted(rows, column, notes)


def _holds(rows: FirstRows, column: NamedColumn, *, date: bool) -> bool:
    """Say whether a column holds dates, or times of day alone."""
    text = next(filter(None, rows.texts(column.place)[:200]), '')
    return is_date(text) and bool(parts(text)[0]) is date


def _counted(rows: FirstRows, column: NamedColumn, notes: list[str]) -> TimeColumn:
    """Return a time without a unit; whole numbers in large steps may be milliseconds."""
    texts = [text for text in rows.texts(column.place) if text]
    if texts and is_date(texts[0]):
        return TimeColumn((column.key,))
    values = rows.values(column.place)
    values = values[np.isfinite(values)]
    step = float(np.median(np.diff(values))) if len(values) > 1 else 0.0
    small = len(values) > 0 and abs(values[0]) < 1e11
    why, typed = '', shlex.quote(column.typed)
    if column.unit:
        why = (
            f'is said to be in {column.unit}; counts are read in {", ".join(NANOSECONDS)}. Write '
            'it in one of them, or give --rate HZ'
        )
    elif small and values[0] >= _DAYS and 0.0 < step < _QUICK_S:
        why = (
            f'goes by {step:.3g} from {values[0]:.8g}, as the days of a spreadsheet do. Save it '
            f'as dates; or, if they are seconds, give --time {typed}:s'
        )
    elif small and step >= 10.0:
        why = f'has no known unit; its steps are {step:g}. Give --time {typed}:ms, or :s'
    if why:
        raise rows.table.error(f': the time {column.key!r} {why}')
    if small:
        notes.append(f'The time {column.key!r} states no unit and is taken as s.')
    return TimeColumn((column.key,))


PLAIN_TIMES = ('time', 'time_s', 't', 't_s')
PLAIN_COLUMNS = (
    *('speed_through_water', 'speed_over_ground', 'heading', 'shaft', 'rudder', 'depth'),
    *('x,y', 'latitude,longitude'),
    *(name for name, kind in FURTHER.items() if kind != 'position'),
)
"""Columns named as the inputs are, and those of a position, in SI units."""

_TURN = 6.4  # no angle in rad is larger
_NO_COORDINATES = ('rad', 'mrad', 'gon', 'm', 'km', 'ft', 'nmi', 'min')
# inputs, and the likely units of their columns by the roles of these
_USUAL: Sequence[tuple[str, Mapping[str, str]]] = (
    ('position', {'lat': 'deg', 'lon': 'deg'}),
    ('position', {'x': 'm', 'y': 'm'}),
    ('speed_through_water', {'stw': 'kn'}),
    ('speed_over_ground', {'sog': 'kn'}),
    ('speed_over_ground', {'east': 'm/s', 'north': 'm/s'}),
    ('heading', {'heading': 'deg'}),
    ('rudder', {'rudder': 'deg'}),
    ('wind_apparent', {'aws': 'kn', 'awa': 'deg'}),
    ('shaft', {'shaft': 'rpm'}),
    ('depth', {'depth': 'm'}),
)


class _Unclear(Exception):
    """What is not sure of an input, and what to type."""


class _Wanted(NamedTuple):
    """An input, its columns and their likely units."""

    name: str
    columns: Sequence[NamedColumn]
    likely: Sequence[str]

    @property
    def keys(self) -> str:
        """The columns as messages name them."""
        return ', '.join(repr(each.key) for each in self.columns)

    def taken(self, units: Sequence[str]) -> InputColumns:
        """Return the columns in some units."""
        return columns_of(self.name, [each.key for each in self.columns], units)

    def unclear(
        self, units: Sequence[str] = (), why: str = 'unit not known', other: str = 'another unit'
    ) -> _Unclear:
        """
        Say why the columns are not used, and what to type, in units where not in the likely ones.
        """
        asked = [*zip(self.columns, units or self.likely, strict=True)]
        typed = ','.join(f'{each.typed}:{unit}' for each, unit in asked)
        if len({unit for _, unit in asked}) == 1:  # given once it holds for all
            typed = typed.replace(f':{asked[0][1]},', ',')
        bare = {unit for each, unit in asked if not each.unit}
        speeds = '--speed-unit kn or m/s, or ' if bare & SPEED_UNITS.keys() else ''
        option = shlex.quote(f'{self.name}={typed}')
        return _Unclear(f'{self.keys}: {why}; {speeds}--map {option}, or {other}')


class Guess:
    """
    What is understood of a table: what is said of it, or else by its names and values.

    Parameters
    ----------
    table
    options
        By `Option.key`; those that are not there were not given.

    Attributes
    ----------
    inputs
        Columns to take.
    time
        Column of the time; None where rows are counted.
    rows
        The first rows of the table.
    notes
        How it is known, a sentence each.
    unclear
        What was not sure, and what to type, a sentence each.

    Raises
    ------
    ImportDataError
        If the options do not fit, or nothing that moves has a known unit, saying what to type.
    """

    def __init__(self, table: LogTable, options: Mapping[str, Any]) -> None:
        self.notes: list[str] = []
        self.unclear: list[str] = []
        self.rows = FirstRows(table)
        self._table = table
        self._speed_unit: str = options.get('speed_unit', '')
        self._track: Float64 | None = None
        self.inputs = [placed(self.rows, parse_input(text)) for text in options.get('map', ())]
        given = Counter(each.name for each in self.inputs)
        for name, count in given.items():
            if count > 1:
                raise ImportDataError(f'--map {name}=...: given {count} times; keep one')
        if not given and table.header is None:
            raise table.error(
                ' has no names of columns; say what they are by their numbers, for instance '
                '--map speed_through_water=1:kn --rate 1'
            )
        time: TimeColumn | None = options.get('time')
        if time is None and options.get('rate') is None:
            if table.header is None:
                why = 'give --time COLUMN[:unit] or --rate HZ'
                raise ImportDataError(f'the times of the rows: {why}')
            time = guessed_time(self.rows, self.notes)
        order, zone = options.get('date_order', ''), options.get('zone', UTC)
        self.time = None if time is None else replace(time, order=order, zone=zone)
        if not given:
            (self._plain if self._is_plain() else self._by_names)()
            if not any(each.channel.input in ALL_MOTION for each in self.inputs):
                raise self._nothing()

    def _all(self, roles: Iterable[str]) -> list[NamedColumn]:
        """Return the columns of some roles, none where one is missing."""
        found = [self.rows.roles.get(role, []) for role in roles]
        for first, *others in filter(None, found):
            if others:
                keys = ', '.join(repr(each.key) for each in others)
                self._doubt(f'{keys}: {first.key!r} is taken for the same thing')
        return [each[0] for each in found] if all(found) else []

    def _doubt(self, text: str) -> None:
        if text not in self.unclear:
            self.unclear.append(text)

    def _is_plain(self) -> bool:
        header = set(self.rows.header)
        known = {name for names in PLAIN_COLUMNS for name in names.split(',')}
        named = {each.key for columns in self.rows.roles.values() for each in columns}
        return (
            bool(header & set(PLAIN_TIMES))
            and bool(header & known - {'x', 'y'})
            and (named <= known | set(PLAIN_TIMES))
        )

    def _plain(self) -> None:
        header = self.rows.header
        for names in PLAIN_COLUMNS:
            name, columns = 'position' if ',' in names else names, names.split(',')
            if not all(column in header for column in columns):
                continue
            unit = 'deg' if names.startswith('latitude') else ''
            found = columns_of(name, columns, [unit] * len(columns))
            largest = self.rows.largest(self._table.column(columns[0]))
            if name in ('heading', 'rudder') and largest > _TURN:
                raise self._table.error(
                    f': {name!r} goes to {largest:g}, which is no angle in rad; a column of this '
                    f'name is in SI units. Name the unit in it, {name}_deg, or give --map'
                )
            self.inputs.append(found)
        self.notes.append('The columns have the names of the inputs: their units are SI.')

    # columns by their usual names

    def _by_names(self) -> None:
        self._time_s = self.rows.seconds(self.time)
        units_of = {'position': self._position, 'heading': self._heading}
        settled: set[str] = set()
        for name, likely in _USUAL:
            columns = [] if name in settled else self._all(likely)
            if not columns:
                continue
            wanted = _Wanted(name, columns, [*likely.values()])
            find = self._speed if 'speed' in name else units_of.get(name, self._other)
            try:
                self.inputs.append(wanted.taken(find(wanted)))
            except _Unclear as why:
                self._doubt(str(why))
                if name != 'position':  # no other one in place of one that is unclear
                    continue
            settled.add(name)

    # each returns the units of the columns of an input, or raises what is unclear

    def _position(self, wanted: _Wanted) -> list[str]:
        units, places = zip(*((each.unit, each.place) for each in wanted.columns), strict=True)
        if wanted.likely[0] == 'deg':
            if other := next((unit for unit in units if unit in _NO_COORDINATES), ''):
                raise _Unclear(f'{wanted.keys}: coordinates in {other} are not read')
            if self._time_s is not None:
                self._track = track_speed(self._time_s, *self.rows.coordinates(places))
            return ['deg', 'deg']
        if units[0] != units[1] or units[0] not in LENGTH_UNITS:
            raise wanted.unclear()
        if self._time_s is not None and units[0] == 'm':
            self._track = plane_speed(self._time_s, *map(self.rows.values, places))
        return [*units]

    def _speed(self, wanted: _Wanted) -> list[str]:
        """Of a speed of one column, or of two components."""
        columns = wanted.columns
        parts = [self.rows.values(each.place) for each in columns]
        values = np.hypot(*parts) if parts[1:] else parts[0]
        said = {each.unit for each in columns if each.unit} or {self._speed_unit} - {''}
        if len(said) > 1 or not said <= SPEED_UNITS.keys():
            raise wanted.unclear()
        unit = ''.join(said)
        seen = '' if self._track is None else unit_of(values, self._track, unit)
        if unit and seen and seen != unit:
            why = f'is said to be in {unit}, and agrees with the positions in {seen}'
            raise wanted.unclear([unit] * len(columns), why, seen)
        if len({bool(each.unit) for each in columns}) > 1:  # one of both is said, and no more
            unit = ''
        if not (unit or seen):
            raise wanted.unclear()
        if not unit:
            self.notes.append(
                f'{wanted.keys}: no unit is stated; in {seen} it agrees with the way between the '
                'positions.'
            )
        if self._track is None:  # the other speed is compared with this one
            self._track = values * SPEED_UNITS[unit or seen]
        return [unit or seen] * len(columns)

    def _heading(self, wanted: _Wanted) -> list[str]:
        (column,) = wanted.columns
        if column.unit == 'rad' and column.key.lower() == 'heading_rad':
            self.notes.append(
                f'{column.key!r} is taken as the input of this name, yaw from east to north.'
            )
            return ['rad']
        if self._unit(column, 'deg') == 'deg':
            self.notes.append(f'{column.key!r} is taken as degrees clockwise from north.')
            return [COMPASS]
        unit = column.unit if column.unit == 'rad' else COMPASS
        why = 'whether it is yaw or compass, or its unit, is not known'
        raise wanted.unclear([unit], why, 'rad deg compass')

    def _other(self, wanted: _Wanted) -> list[str]:
        units = [*map(self._unit, wanted.columns, wanted.likely)]
        with suppress(ImportDataError):  # of another quantity
            if all(units) and wanted.taken(units):
                return units
        found = zip(units, wanted.likely, strict=True)
        raise wanted.unclear([u if u and unit == 'deg' else unit for u, unit in found])

    def _unit(self, column: NamedColumn, likely: str) -> str:
        """Return the unit that is stated, given, or shown by the values; '' for none."""
        if column.unit:
            return '' if likely == 'deg' and column.unit not in ANGLE_UNITS else column.unit
        if likely in SPEED_UNITS:
            return self._speed_unit
        return 'deg' if likely == 'deg' and self.rows.largest(column.place) > _TURN else ''

    def _nothing(self) -> ImportDataError:
        """Say that nothing that moves is known, and what to type."""
        why = '; '.join(self.unclear) or (
            f'its columns are {", ".join(map(repr, self.rows.header))}, and none has a '
            'usual name of a speed or a position; say which it is, for instance --map '
            'speed_over_ground=COLUMN:kn --map position=LAT,LON:deg'
        )
        return self._table.error(f' gives no speed and no position in a unit that is known: {why}')


def placed(rows: FirstRows, mapped: InputColumns) -> InputColumns:
    """
    Return given columns, those of a position without a unit in the unit that its columns say.

    Raises
    ------
    ImportDataError
        If they may be degrees, and do not say it.
    """
    if mapped.stated or mapped.channel.kind is not Channel.POSITION:
        return mapped
    places = rows.table.columns(mapped.names)
    said = [role_and_unit(*rows.table.about(place)) for place in places]
    roles, units = [role for role, _ in said], {unit for _, unit in said if unit}
    units = units or ({'deg'} if roles == ['lat', 'lon'] else set())
    text = f'{mapped.name}={",".join(mapped.names)}'
    metres = shlex.quote(f'{text}:m')
    if roles == ['lon', 'lat']:
        swapped = f'{mapped.name}={",".join(mapped.names[::-1])}'
        why = f'latitude comes first; give {shlex.quote(swapped)}'
    elif len(units) == 1 and (units == {'deg'} or all(unit for _, unit in said)):
        return columns_of(mapped.name, mapped.names, [*units] * 2)
    elif units:
        stated = ' and '.join(unit or 'none' for _, unit in said)
        why = f'its columns do not say one unit, but {stated}; give one, as {metres}'
    elif roles == ['x', 'y'] or not ({'lat', 'lon'} & {*roles} or rows.may_be_degrees(places)):
        return mapped
    else:
        degrees = shlex.quote(f'{text}:deg')
        why = f'these may be degrees; give {degrees} for latitude and longitude, or {metres}'
    raise ImportDataError(f'--map {shlex.quote(text)}: {why}')
