# SPDX-License-Identifier: Apache-2.0
"""What may stand in a cell: a number, a coordinate, a date or a count of the time."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from decimal import Decimal
from fractions import Fraction
from itertools import count
from math import cos, hypot, isfinite, pi, remainder, sin
from typing import Any, NamedTuple, NoReturn
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.display import NUMBER
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.nmea.sentences import DAY_NS, NoValue, of_day_ns
from shipdrag_ros.samples import SECOND_NS, Channel, Float64, Int64
from shipdrag_ros.sources.formats.csv.table import (
    COMPASS,
    NANOSECONDS,
    Cells,
    InputColumns,
    LogTable,
    TimeColumn,
    are_numbers,
    texts_of,
    written,
)
from shipdrag_ros.sources.log import BASE_NS, DATE_FROM_NS, LIMIT_NS

_PLAIN = frozenset('0123456789+-.eE')
_COMMA = re.compile(r'[-+]?(\d+,\d*|,\d+)([eE][-+]?\d{1,4})?')
# sign, degrees, minutes and side of a coordinate
_DECIMAL = re.compile(r'([-+]?)(\d{1,3}(?:\.\d*)?)()\s*°?\s*([NSEW])?')
_PARTED = re.compile(r"()(\d{1,3})[°\s]\s*(\d{1,2}(?:\.\d*)?)\s*'?\s*([NSEW])")
_JOINED = re.compile(r'([-+]?)(\d{1,3})(\d{2}(?:\.\d*)?)\s*([NSEW])?')
_SIDES = {'N': 1.0, 'E': 1.0, 'S': -1.0, 'W': -1.0}
_THOUSANDS = re.compile(r'[-+]?[1-9]\d{0,2}(\.\d{3})+')


class BadCell(NamedTuple):
    """Why a cell cannot be used, and what it holds."""

    reason: str
    cell: str


Bad = dict[int, BadCell]
"""Cells that cannot be used, by their places."""


def usable(count: int, bad: Bad) -> NDArray[np.bool_]:
    """Return whether each of so many cells can be used."""
    good = np.ones(count, np.bool_)
    good[list(bad)] = False
    return good


def read_each(
    read: Callable[[str], float], cells: Cells, some: NDArray[Any], found: NDArray[Any], bad: Bad
) -> None:
    """
    Read cells one by one.

    Parameters
    ----------
    read
        Returns the value of a cell, or raises `NoValue`.
    cells, some : (n,)
        Of a column, and which of them are to be read.
    found : (n,)
        Where the values go.
    bad
        Where the others go.
    """
    for place, cell in zip(np.flatnonzero(some).tolist(), texts_of(cells[some]), strict=True):
        try:
            found[place] = read(cell)
        except NoValue as reason:
            bad.setdefault(place, BadCell(str(reason), cell))


@dataclass(frozen=True)
class CellReader:
    """
    Reads the cells of a column as numbers.

    Attributes
    ----------
    comma
        Whether they have a decimal comma; one without comma and point is a number too.
    side
        'NS' of latitudes, 'EW' of longitudes [deg], with or without a letter; '' of others.
    minutes
        Whether these are degrees and minutes written as one number, ddmm.mmmm.
    """

    comma: bool = False
    side: str = ''
    minutes: bool = False

    def one(self, cell: str) -> float:
        """
        Read a cell.

        Raises
        ------
        NoValue
            If it holds no usable number.
        """
        if not cell:
            raise NoValue('empty')
        if self.comma and not self.side and '.' in cell:
            raise NoValue('a point where others have a decimal comma')
        text = cell.replace(',', '.', 1) if self.comma else cell
        if self.side:
            return self._coordinate(text.strip().upper())
        if not NUMBER.fullmatch(text):
            raise NoValue('not a number')
        return float(text)

    def all(self, cells: Cells, bad: Bad) -> Float64:
        """
        Return (n,) numbers, NaN where there is none.

        Parameters
        ----------
        cells : (n,)
            Of a column.
        bad
            Filled with those that hold none.
        """
        if are_numbers(cells):
            cells = written(cells) if self.minutes else cells.astype(np.float64)
        found = self._at_once(cells)
        read_each(self.one, cells, np.isnan(found), found, bad)
        return found

    def _at_once(self, cells: Cells) -> Float64:
        """Return (n,) numbers, NaN where a cell is to be looked at by itself."""
        if are_numbers(cells):
            most = {'': np.finfo(np.float64).max, 'NS': 90.0, 'EW': 360.0}[self.side]
            turned = np.where(cells > 180.0, cells - 360.0, cells) if self.side == 'EW' else cells
            return np.where(np.abs(cells) <= most, turned, np.nan)
        if not (self.comma or self.side) and _PLAIN.issuperset(''.join(cells)):
            with suppress(ValueError):  # an empty cell for instance
                found = np.array([*map(float, cells)], np.float64)
                return np.where(np.isfinite(found).all(), found, np.nan)
        return np.full(len(cells), np.nan)

    def _coordinate(self, text: str) -> float:
        found = (_JOINED if self.minutes else _PARTED).fullmatch(text)
        if found is None and not self.minutes:
            found = _DECIMAL.fullmatch(text)
        if found is not None and not (found[1] and found[4]):
            minutes, side = float(found[3] or 0.0), found[4] or self.side[0]
            value = float(found[2]) + minutes / 60.0
            half, whole = (90.0, 90.0) if self.side == 'NS' else (180.0, 360.0)
            if side in self.side and minutes < 60.0 and value <= whole:
                value *= _SIDES[side]
                value = 0.0 - value if found[1] == '-' else value
                # a longitude counted from 0 to 360 is one too
                return value - 360.0 if value > half else value
        raise NoValue('no latitude and longitude')


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


def coordinate_readers(latitudes: Cells, longitudes: Cells) -> list[CellReader]:
    """
    Return what reads latitudes and longitudes, by how some of them are written.

    The latitudes show whether it is ddmm.mmmm: four digits before the point are no
    degrees. Three may be a longitude in the wrong column, unless the longitudes are
    written so too. A longitude alone shows nothing: 200.5 is one from 0 to 360 degrees.
    """
    four = _share_in_minutes(latitudes, 90.0, 4)
    three = min(_share_in_minutes(latitudes, 90.0, 3), _share_in_minutes(longitudes, 180.0, 3))
    minutes = max(four, three) > 0.5
    return [
        CellReader(comma=not minutes and has_decimal_commas(cells), side=side, minutes=minutes)
        for cells, side in ((latitudes, 'NS'), (longitudes, 'EW'))
    ]


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


def combined(columns: InputColumns, values: Sequence[Float64]) -> tuple[Float64, Float64]:
    """Return the two values (n,) of samples from those of their columns, in SI units."""
    first, second = values if len(values) > 1 else (values[0], np.zeros(len(values[0])))
    if COMPASS in columns.units:
        yaw = [remainder(each, 2.0 * pi) for each in _finite(pi / 2.0 - first)]
        return np.array(yaw), second
    if columns.is_polar:
        angle = _finite(second)
        return -first * [*map(cos, angle)], first * [*map(sin, angle)]
    if columns.channel.kind is Channel.SPEED_OVER_GROUND and len(values) > 1:
        return np.array([*map(hypot, first, second)]), np.zeros(len(first))
    return first, second


def _finite(values: Float64) -> list[float]:
    """Return numbers that the C library takes; what is none stays none."""
    found: list[float] = np.where(np.isfinite(values), values, np.nan).tolist()
    return found


ORDERS = ('ymd', 'dmy', 'mdy')
"""Of year, month and day in a date."""

MIDNIGHT = re.compile(r'(00?:00(?::00(?:[.,]0+)?)?)?')
"""Of a time of day that is midnight or none."""

_DAY = re.compile(r'(\d{1,4})([-/.])(\d{1,2})\2(\d{1,4})')
_COMPACT = re.compile(r'(\d{4})(\d\d)(\d\d)')
_CLOCK = re.compile(
    r'(\d{1,2}):(\d\d)(?::(\d\d)(?:[.,](\d{1,12}))?)?(?:\s*([aApP][mM]))?\s*'
    r'(Z|UTC|GMT|[-+]\d\d:?\d\d|[-+]\d\d)?'
)
_IN_TITLE = re.compile(r'(?<!\d)(20\d\d)[-_./]?(\d\d)[-_./]?(\d\d)(?!\d)')


def parts(text: str) -> tuple[str, str]:
    """Split a cell into date and time of day; either may be empty."""
    day, blank, clock = re.sub(r'(?<=\d)T(?=\d)', ' ', text, count=1).partition(' ')
    clock = clock.strip()
    if _DAY.fullmatch(day) or _COMPACT.fullmatch(day):
        midnight, _, rest = clock.partition(' ')
        if ':' in rest and MIDNIGHT.fullmatch(midnight):  # a date of a spreadsheet, and the time
            clock = rest.strip()
        return day, clock
    if blank and _DAY.fullmatch(clock):  # the time first
        return clock, day
    return '', text


def is_date(text: str) -> bool:
    """Say whether a cell holds a date, a time of day, or both."""
    day, clock = parts(text)
    return bool(_CLOCK.fullmatch(clock) if clock else _DAY.fullmatch(day))


def order_of(texts: Iterable[str], table: LogTable) -> tuple[str, str]:
    """
    Find the order of year, month and day.

    Parameters
    ----------
    texts
        Cells.
    table
        Its titles and the name of its file may hold the date as 20170311.

    Returns
    -------
    order, known_by
        The order is '' where day and month are ambiguous.
    """
    days = [*dict.fromkeys(day for text in texts if (day := parts(text)[0]))]
    if not days:
        return '', 'times of day without a date'
    possible = [order for order in ORDERS if all(_fits(day, order) for day in days)]
    if len(possible) == 1:
        return possible[0], 'the dates themselves'
    for hint in (*table.titles, table.path.name):
        for found in _IN_TITLE.finditer(hint):
            date = (int(found[1]), int(found[2]), int(found[3]))
            fitting = [order for order in possible if _numbers(days[0], order) == date]
            if len(fitting) == 1:
                return fitting[0], f'{found[0]} in {hint.strip("- ")!r}'
    if not possible:
        raise table.error(f': the dates, {days[0]!r} for instance, are in no order known here')
    return '', f'{days[0]!r} is {" or ".join(possible)}'


def zone_of(text: str) -> tzinfo:
    """
    Read a time zone: `UTC`, `+02:00` or `Europe/Rome`.

    Raises
    ------
    ImportDataError
        If it is none.
    """
    found = re.fullmatch(r'([-+])(\d\d):?(\d\d)?', text)
    if found is not None and int(found[2]) < 24 and int(found[3] or 0) < 60:
        minutes = 60 * int(found[2]) + int(found[3] or 0)
        return timezone(timedelta(minutes=-minutes if found[1] == '-' else minutes))
    try:
        return ZoneInfo(text)
    except (OSError, ValueError, KeyError):
        raise ImportDataError(
            f'{text!r} is no time zone; give UTC, +02:00 or Europe/Rome'
        ) from None


def _numbers(day: str, order: str) -> tuple[int, int, int]:
    """Return year, month and day of the month."""
    if found := _COMPACT.fullmatch(day):
        return int(found[1]), int(found[2]), int(found[3])
    found = _DAY.fullmatch(day)
    if found is None:
        raise NoValue('no date')
    named = dict(zip(order, (found[1], found[3], found[4]), strict=True))
    year = named['y']
    short = len(named['m']) <= 2 and len(named['d']) <= 2
    if not short or len(year) not in (2, 4) or (order == 'ymd' and len(year) != 4):
        raise NoValue('no possible date')
    century = 2000 if len(year) == 2 else 0
    return century + int(year), int(named['m']), int(named['d'])


def _fits(day: str, order: str) -> bool:
    try:
        datetime(*_numbers(day, order))
    except (NoValue, ValueError):
        return False
    return True


def _clock_ns(text: str) -> tuple[int, tzinfo | None]:
    """Return the time of day [ns], and its zone where it states one."""
    if not text:
        return 0, None
    found = _CLOCK.fullmatch(text)
    if found is None:
        raise NoValue('no time of day')
    hour, half = found[1], found[5]
    if half and not 1 <= int(hour) <= 12:
        raise NoValue('no time of day')  # half a day has no such hour
    if half:
        hour = str(int(hour) % 12 + (12 if half.lower() == 'pm' else 0))
    zone = zone_of(found[6] if found[6][0] in '+-' else 'UTC') if found[6] else None
    return of_day_ns(hour, found[2], found[3], found[4]), zone


_COUNTS_FROM = (('ns', 10**17), ('us', 10**14), ('ms', 10**11))  # since 1970, from 1973 on


@dataclass
class RowClock:
    """
    Times of rows [ns], each from its cell.

    Attributes
    ----------
    read
        Returns the time of a cell as it is counted [ns].
    base_ns
        What is added to the times of the table [ns]; None if they are dates.
    notes
        What was assumed, a sentence each.
    unit
        Of counts; '' of others. The first count shows whether they are dates.
    """

    read: Callable[[str], int | Decimal]
    base_ns: int | None = None
    notes: list[str] = field(default_factory=list)
    unit: str = ''
    _begun: bool = False

    def times(self, cells: Cells, bad: Bad) -> Int64:
        """
        Return (n,) times of rows [ns].

        Parameters
        ----------
        cells : (n,)
            Of the time.
        bad
            Filled with those that hold none.
        """
        found, exact = np.zeros(len(cells), np.int64), np.zeros(len(cells), np.bool_)
        if are_numbers(cells):
            found, exact = _counts_ns(cells, len(str(NANOSECONDS[self.unit])) - 1)
        read_each(self._bounded_ns, cells, ~exact, found, bad)
        good = usable(len(found), bad)
        if self.unit and not self._begun and good.any():
            self._begun = True
            self.base_ns = BASE_NS if found[good.argmax()] < DATE_FROM_NS else None
        found += self.base_ns or 0
        beyond = good & ((found < 0) | (found >= LIMIT_NS))
        read_each(_impossible, cells, beyond, found, bad)
        return found

    def _bounded_ns(self, cell: str) -> int:
        time_ns = self.read(cell)
        return int(time_ns) if -LIMIT_NS < time_ns < LIMIT_NS else _impossible(cell)


def _impossible(cell: str) -> NoReturn:
    raise NoValue('no possible date')


def row_clock(
    time: TimeColumn | None, rate_hz: float | None, cells: Cells, table: LogTable
) -> RowClock:
    """
    Make the clock of a table.

    Parameters
    ----------
    time, rate_hz
        One of the two: the column of the time, or rows a second.
    cells
        Of the time, in the first rows.
    table
        Whose titles and name may show the date.

    Raises
    ------
    ImportDataError
        If the rate is none, or day and month are ambiguous.
    """
    if time is None:
        assert rate_hz is not None
        if not (isfinite(rate_hz) and rate_hz > 0.0):
            raise ImportDataError(
                f'--rate {rate_hz!r}: expected a number of rows a second above 0'
            )
        row_ns, rows = SECOND_NS / Fraction(rate_hz), count()
        return RowClock(lambda _: round(next(rows) * row_ns), BASE_NS)
    texts = [*filter(None, texts_of(cells))]
    if len(time.names) == 1 and not (texts and is_date(texts[0])):
        return _counts(time, texts)
    order, known_by = (time.order, '') if time.order else order_of(texts, table)
    if order:
        return RowClock(_Dates(order, time.zone).ns, notes=[*_notes(time, order, known_by, texts)])
    if texts and parts(texts[0])[0]:
        raise table.error(
            f': day and month are ambiguous, {known_by}; give --date-order dmy or --date-order mdy'
        )
    return RowClock(_Dates().ns, BASE_NS, ['The times are times of day without a date.'])


def _notes(time: TimeColumn, order: str, known_by: str, texts: Sequence[str]) -> Iterator[str]:
    """Say what is assumed of dates."""
    if known_by and order != 'ymd':
        words = {'d': 'day', 'm': 'month', 'y': 'year'}
        yield f'Dates are {"/".join(words[each] for each in order)}, as {known_by} show.'
    clock = ''.join(parts(text)[1] for text in texts[:1])
    stated = clock.endswith(('Z', 'UTC', 'GMT')) or {*'+-'} & {*clock}
    if time.zone is UTC and not (stated or 'utc' in ' '.join(time.names).lower()):
        yield 'The times state no zone and are taken as UTC (--zone).'


def _counts(time: TimeColumn, texts: Sequence[str]) -> RowClock:
    """Return the clock of counts since 1970, or from a start."""
    comma, unit, check = has_decimal_commas(texts), time.unit, CellReader().one
    notes: list[str] = []

    def number(cell: str) -> Decimal:
        plain = cell.replace(',', '.', 1) if comma and '.' not in cell else cell
        check(plain)
        return Decimal(plain)

    def ns(cell: str) -> Decimal:
        return (number(cell) * NANOSECONDS[unit]).to_integral_value()

    for text in texts[: not unit]:
        with suppress(NoValue):
            size = abs(number(text))
            unit = next((each for each, least in _COUNTS_FROM if size >= least), '')
    if unit != time.unit:
        notes.append(f'The times are counts of {unit} since 1970, by their size.')
    unit = unit or 's'
    return RowClock(ns, notes=notes, unit=unit)


class _Dates:
    """Reads dates in an order of year, month and day, or, without one, times of day alone."""

    def __init__(self, order: str = '', zone: tzinfo = UTC) -> None:
        self._order = order
        self._zone = zone
        self._midnights = 0
        self._last_of_day_ns = 0

    def ns(self, cell: str) -> int:
        """Return the time of a cell [ns], of a time of day from the first midnight on."""
        if not cell:
            raise NoValue('empty')
        day, clock = parts(cell)
        clock_ns, zone = _clock_ns(clock)
        if not self._order:
            if day:
                raise NoValue('a date where others have none')
            return self._since_midnight(clock_ns)
        try:
            midnight = datetime(*_numbers(day, self._order), tzinfo=zone or self._zone)
            # the zone's offset at the time itself, which a change of the clocks moves
            local = midnight + timedelta(seconds=clock_ns // SECOND_NS)
            return int(local.timestamp()) * SECOND_NS + clock_ns % SECOND_NS
        except (ValueError, OverflowError):
            _impossible(cell)

    def _since_midnight(self, of_day_ns: int) -> int:
        """Add the midnights passed: a time of day that goes back by hours is of the next day."""
        if of_day_ns < self._last_of_day_ns - DAY_NS // 2:
            self._midnights += 1
        elif self._midnights and of_day_ns > self._last_of_day_ns + 23 * DAY_NS // 24:
            self._midnights -= 1  # a row from before the midnight behind one from after it
        self._last_of_day_ns = of_day_ns
        return self._midnights * DAY_NS + of_day_ns


def _counts_ns(counts: NDArray[Any], digits: int) -> tuple[Int64, NDArray[np.bool_]]:
    """
    Return counts (n,) of 10^digits ns in ns, and which are exact.

    A number is the one with the fewest decimals that reads back as it, as in its text.
    """
    size = np.abs(counts.astype(np.float64))
    left = size < 2.0**62 / 10.0**digits  # false of NaN
    if counts.dtype.kind != 'f':
        return np.where(left, counts, 0).astype(np.int64) * 10**digits, left
    size = np.where(left, size, 0.0)
    whole = np.floor(size)
    part = size - whole
    fine = part * 10.0**digits
    ns = np.rint(fine)
    # one of more decimals is rounded, where it is clear to which side
    exact = left & (np.abs(fine - ns) + np.spacing(size) * 10.0**digits < 0.5)
    for k in reversed(range(digits + 1)):
        decimal = np.rint(part * 10.0**k)
        fits = left & (whole + decimal / 10.0**k == size)
        ns[fits] = decimal[fits] * 10.0 ** (digits - k)
        exact |= fits
    whole_ns = whole.astype(np.int64) * 10**digits
    return np.where(np.signbit(counts), -1, 1) * (whole_ns + ns.astype(np.int64)), exact
