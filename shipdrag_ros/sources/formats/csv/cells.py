# SPDX-License-Identifier: Apache-2.0
"""What may stand in a cell: a number, a coordinate, a date or a count of the time."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from decimal import Decimal
from fractions import Fraction
from math import cos, hypot, isfinite, pi, remainder, sin
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.display import NUMBER
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import SECOND_NS, Float64, Int64
from shipdrag_ros.sources.formats.csv.columns import NANOSECONDS, Form, TimeColumn
from shipdrag_ros.sources.formats.csv.table import Cells, LogTable, texts_of
from shipdrag_ros.sources.log import BASE_NS, LIMIT_NS

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
        BadCell
            If it holds no usable number.
        """
        if not cell:
            raise BadCell('empty', cell)
        if self.comma and not self.side and '.' in cell:
            raise BadCell('a point where others have a decimal comma', cell)
        text = cell.replace(',', '.', 1) if self.comma else cell
        if self.side:
            return _coordinate(text.strip().upper(), self.side, self.minutes, cell)
        if not NUMBER.fullmatch(text):
            raise BadCell('not a number', cell)
        return float(text)

    def all(self, cells: Cells, bad: dict[int, BadCell]) -> Float64:
        """
        Return (n,) numbers, NaN where there is none.

        Parameters
        ----------
        cells : (n,)
            Of a column.
        bad
            Filled with why, by the place of a cell that holds none.
        """
        if isinstance(cells, np.ndarray):
            if not self.minutes:
                return self._of_numbers(cells.astype(np.float64), bad)
            cells = texts_of(cells)
        if not (self.comma or self.side) and _PLAIN.issuperset(''.join(cells)):
            with suppress(ValueError):  # an empty cell for instance
                found = np.array([float(cell) for cell in cells])
                if np.isfinite(found).all():
                    return found
        found = np.full(len(cells), np.nan)
        for place, cell in enumerate(cells):
            try:
                found[place] = self.one(cell)
            except BadCell as error:
                bad.setdefault(place, error)
        return found

    def _of_numbers(self, values: Float64, bad: dict[int, BadCell]) -> Float64:
        good = np.isfinite(values)
        if self.side:
            largest = 90.0 if self.side == 'NS' else 180.0
            good &= np.abs(values) <= (largest if self.side == 'NS' else 2.0 * largest)
            values = np.where(values > largest, values - 360.0, values)
        why = 'no latitude and longitude' if self.side else 'not a number'
        for place in np.flatnonzero(~good).tolist():
            none = np.isnan(values[place])
            cell = '' if none else str(values[place])
            bad.setdefault(place, BadCell('empty' if none else why, cell))
        return np.where(good, values, np.nan)


def _coordinate(text: str, side: str, minutes: bool, cell: str) -> float:
    found = _JOINED.fullmatch(text) if minutes else _PARTED.fullmatch(text)
    if found is not None and not (minutes and found[1] and found[4]):
        *_, whole, rest, letter = found.groups()
        value = _checked(float(whole), float(rest), letter or side[0], side, cell)
        return -value if minutes and found[1] == '-' else value
    found = None if minutes else _DECIMAL.fullmatch(text)
    if found is None or (found[2] and text[0] in '+-'):
        raise BadCell('no latitude and longitude', cell)
    return _checked(float(found[1]), 0.0, found[2] or side[0], side, cell)


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


def coordinate_readers(latitudes: Sequence[str], longitudes: Sequence[str]) -> list[CellReader]:
    """
    Return what reads latitudes and longitudes, by how some of them are written.
    """
    minutes = are_in_minutes(latitudes, longitudes)
    return [
        CellReader(comma=not minutes and has_decimal_commas(cells), side=side, minutes=minutes)
        for cells, side in ((latitudes, 'NS'), (longitudes, 'EW'))
    ]


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


def combined(form: Form, values: Sequence[Float64]) -> tuple[Float64, Float64]:
    """
    Return the two values (n,) of samples from those of their columns, in SI units.
    """
    first = values[0]
    nothing = np.zeros(len(first))
    if form is Form.COMPASS:
        return np.array([remainder(each, 2.0 * pi) for each in _finite(pi / 2.0 - first)]), nothing
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


ORDERS = ('ymd', 'dmy', 'mdy')
"""Of year, month and day in a date."""

_DAY = re.compile(r'(\d{1,4})([-/.])(\d{1,2})\2(\d{1,4})')
_MIDNIGHT = re.compile(r'00?:00(?::00(?:[.,]0+)?)?')
_COMPACT = re.compile(r'(\d{4})(\d\d)(\d\d)')
_CLOCK = re.compile(
    r'(\d{1,2}):(\d\d)(?::(\d\d)(?:[.,](\d{1,12}))?)?(?:\s*([aApP][mM]))?\s*'
    r'(Z|UTC|GMT|[-+]\d\d:?\d\d|[-+]\d\d)?'
)
_IN_TITLE = re.compile(r'(?<!\d)(20\d\d)[-_./]?(\d\d)[-_./]?(\d\d)(?!\d)')


def parts(text: str) -> tuple[str, str]:
    """
    Split a cell into date and time of day; either may be empty.
    """
    day, blank, clock = re.sub(r'(?<=\d)T(?=\d)', ' ', text, count=1).partition(' ')
    if _DAY.fullmatch(day) or _COMPACT.fullmatch(day):
        midnight, _, rest = clock.strip().partition(' ')
        if ':' in rest and _MIDNIGHT.fullmatch(midnight):  # a date of a spreadsheet, and the time
            return day, rest.strip()
        return day, clock.strip()
    if blank and _DAY.fullmatch(clock.strip()):  # the time first
        return clock.strip(), day
    return '', text


def is_date(text: str) -> bool:
    """
    Say whether a cell holds a date, a time of day, or both.
    """
    day, clock = parts(text)
    if day and not _COMPACT.fullmatch(day):
        return not clock or _CLOCK.fullmatch(clock) is not None
    return bool(clock) and _CLOCK.fullmatch(clock) is not None


def is_midnight(clock: str) -> bool:
    """
    Say whether a time of day is midnight or none.
    """
    return not clock or _MIDNIGHT.fullmatch(clock) is not None


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
    days = [day for text in texts if (day := parts(text)[0])]
    if not days:
        return '', 'times of day without a date'
    possible = [order for order in ORDERS if all(_fits(day, order) for day in days)]
    if len(possible) == 1:
        return possible[0], 'the dates themselves'
    for hint in (*table.titles, table.path.name):
        for found in _IN_TITLE.finditer(hint):
            date = (int(found[1]), int(found[2]), int(found[3]))
            fitting = [order for order in possible if _numbers(days[0], order, '') == date]
            if len(fitting) == 1:
                return fitting[0], f'{found[0]} in {hint.strip("- ")!r}'
    if not possible:
        raise ImportDataError(
            f'{str(table.path)!r}: the dates, {days[0]!r} for instance, are in no order known here'
        )
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


def _fits(day: str, order: str) -> bool:
    try:
        datetime(*_numbers(day, order, day))
    except (BadCell, ValueError):
        return False
    return True


def _numbers(day: str, order: str, text: str) -> tuple[int, int, int]:
    """Return year, month and day of the month."""
    if found := _COMPACT.fullmatch(day):
        return int(found[1]), int(found[2]), int(found[3])
    found = _DAY.fullmatch(day)
    if found is None:
        raise BadCell('no date', text)
    written = dict(zip(order, (found[1], found[3], found[4]), strict=True))
    year = written['y']
    if len(year) not in (2, 4) or len(written['d']) > 2 or (order == 'ymd' and len(year) != 4):
        raise BadCell('no possible date', text)
    century = 2000 if len(year) == 2 else 0
    return century + int(year), int(written['m']), int(written['d'])


def _clock_ns(text: str, whole: str) -> tuple[int, tzinfo | None]:
    """Return the time of day [ns], and its zone where it states one."""
    if not text:
        return 0, None
    found = _CLOCK.fullmatch(text)
    if found is None:
        raise BadCell('no time of day', whole)
    hour, minute, second = int(found[1]), int(found[2]), int(found[3] or 0)
    if found[5] and 1 <= hour <= 12:
        hour = hour % 12 + (12 if found[5].lower() == 'pm' else 0)
    elif found[5] or hour > 23:
        raise BadCell('no time of day', whole)
    if minute > 59 or second > 59:
        raise BadCell('no time of day', whole)
    zone = zone_of(found[6] if found[6][0] in '+-' else 'UTC') if found[6] else None
    fraction_ns = int((found[4] or '')[:9].ljust(9, '0'))
    return (3600 * hour + 60 * minute + second) * SECOND_NS + fraction_ns, zone


# a count of seconds below this, March 1973, is no date
_RELATIVE_BELOW_NS = 100_000_000 * SECOND_NS
_DAY_NS = 86_400 * SECOND_NS
_COUNTS_FROM = (('ns', 10**17), ('us', 10**14), ('ms', 10**11))  # since 1970, from 1973 on


class RowClock:
    """
    Times of rows [ns], each from its cell.

    Attributes
    ----------
    base_ns
        What was added to the times of the table [ns]; None if they are dates.
    notes
        What was assumed, a sentence each.
    """

    def __init__(self) -> None:
        self.base_ns: int | None = None
        self.notes: list[str] = []

    def times(self, cells: Cells, first: int, bad: dict[int, BadCell]) -> Int64:
        """
        Return (n,) times of rows [ns].

        Parameters
        ----------
        cells : (n,)
            Of the time.
        first
            Number of the first row, from 0.
        bad
            Filled with why, by the place of a cell that holds none.
        """
        found = np.zeros(len(cells), np.int64)
        for place, cell in enumerate(texts_of(cells) if isinstance(cells, np.ndarray) else cells):
            try:
                time_ns = self._time_ns(cell)
                if not 0 <= time_ns < LIMIT_NS:
                    raise BadCell('no possible date', cell)
                found[place] = time_ns
            except BadCell as error:
                bad[place] = error
        return found

    def _time_ns(self, cell: str) -> int:
        raise NotImplementedError


def row_clock(
    time: TimeColumn | None, rate_hz: float | None, cells: Sequence[str], table: LogTable
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
        return _Steady(rate_hz)
    texts = [cell.strip() for cell in cells if cell.strip()]
    if len(time.names) == 2 or (texts and is_date(texts[0])):
        return _Dates(time, texts, table)
    return _Counts(time, texts)


class _Steady(RowClock):
    """Of rows that are so many a second."""

    def __init__(self, rate_hz: float) -> None:
        super().__init__()
        if not (isfinite(rate_hz) and rate_hz > 0.0):
            raise ImportDataError(
                f'--rate {rate_hz!r}: expected a number of rows a second above 0'
            )
        self.base_ns = BASE_NS
        self._row_ns = SECOND_NS / Fraction(rate_hz)

    def times(self, cells: Cells, first: int, bad: dict[int, BadCell]) -> Int64:
        rows = range(first, first + len(cells))
        return np.array([BASE_NS + round(number * self._row_ns) for number in rows], np.int64)


class _Dates(RowClock):
    """Of dates, or of times of day alone."""

    def __init__(self, time: TimeColumn, texts: Sequence[str], table: LogTable) -> None:
        super().__init__()
        self._zone = time.zone
        self._midnights = 0
        self._last_of_day_ns = 0
        self._order, known_by = time.order, ''
        if not self._order:
            self._order, known_by = order_of(texts, table)
        order = self._order
        if not order and texts and parts(texts[0])[0]:
            raise ImportDataError(
                f'{str(table.path)!r}: day and month are ambiguous, {known_by}; give '
                '--date-order dmy or --date-order mdy'
            )
        if not order:
            self.base_ns = BASE_NS
            self.notes.append('The times are times of day without a date.')
            return
        if known_by and order != 'ymd':
            words = {'d': 'day', 'm': 'month', 'y': 'year'}
            written = '/'.join(words[each] for each in order)
            self.notes.append(f'Dates are {written}, as {known_by} show.')
        stated = 'utc' in ' '.join(time.names).lower() or any(map(_has_zone, texts[:1]))
        if time.zone is UTC and not stated:
            self.notes.append('The times state no zone and are taken as UTC (--zone).')

    def _time_ns(self, cell: str) -> int:
        if not cell:
            raise BadCell('empty', cell)
        day, clock = parts(cell)
        clock_ns, zone = _clock_ns(clock, cell)
        if not self._order:
            if day:
                raise BadCell('a date where others have none', cell)
            return self._since_midnight(clock_ns)
        year, month, number = _numbers(day, self._order, cell)
        try:
            midnight = datetime(year, month, number, tzinfo=zone or self._zone)
            # the zone's offset at the time itself, which a change of the clocks moves
            local = midnight + timedelta(seconds=clock_ns // SECOND_NS)
            seconds = int(local.timestamp())
        except (ValueError, OverflowError):
            raise BadCell('no possible date', cell) from None
        return seconds * SECOND_NS + clock_ns % SECOND_NS

    def _since_midnight(self, of_day_ns: int) -> int:
        """Add the midnights passed: a time of day that goes back by hours is of the next day."""
        if of_day_ns < self._last_of_day_ns - _DAY_NS // 2:
            self._midnights += 1
        elif self._midnights and of_day_ns > self._last_of_day_ns + 23 * _DAY_NS // 24:
            self._midnights -= 1  # a row from before the midnight behind one from after it
        self._last_of_day_ns = of_day_ns
        return BASE_NS + self._midnights * _DAY_NS + of_day_ns


class _Counts(RowClock):
    """Of counts since 1970, or from a start."""

    def __init__(self, time: TimeColumn, texts: Sequence[str]) -> None:
        super().__init__()
        self._comma = has_decimal_commas(texts)
        self._unit_ns = time.unit_ns
        self._known = False
        self._plain = CellReader()
        for text in () if time.given else texts[:1]:
            try:
                count = abs(self._plain.one(text.replace(',', '.', 1) if self._comma else text))
            except BadCell:
                continue
            unit = next((unit for unit, least in _COUNTS_FROM if count >= least), 's')
            if unit != 's':
                self._unit_ns = NANOSECONDS[unit]
                self.notes.append(f'The times are counts of {unit} since 1970, by their size.')

    def times(self, cells: Cells, first: int, bad: dict[int, BadCell]) -> Int64:
        if not isinstance(cells, np.ndarray):
            return super().times(cells, first, bad)
        times, exact = _counts_ns(cells, len(str(self._unit_ns)) - 1)
        for place in np.flatnonzero(~exact).tolist():
            (cell,) = texts_of(cells[place : place + 1])
            try:
                times[place] = self._count_ns(cell)
            except BadCell as error:
                bad[place] = error
        good = np.ones(len(times), np.bool_)
        good[list(bad)] = False
        if good.any():
            self._begin(int(times[good.argmax()]))
        times += self.base_ns or 0
        for place in np.flatnonzero(good & ((times < 0) | (times >= LIMIT_NS))).tolist():
            bad[place] = BadCell('no possible date', str(cells[place]))
        return times

    def _time_ns(self, cell: str) -> int:
        time_ns = self._count_ns(cell)
        self._begin(time_ns)
        return time_ns + (self.base_ns or 0)

    def _count_ns(self, cell: str) -> int:
        plain = cell.replace(',', '.', 1) if self._comma and '.' not in cell else cell
        self._plain.one(plain)
        exact = Decimal(plain) * self._unit_ns
        if exact.copy_abs() >= LIMIT_NS:
            raise BadCell('no possible date', cell)
        return int(exact.to_integral_value())

    def _begin(self, time_ns: int) -> None:
        """Say by the first count whether they count from 1970 or from a start."""
        if not self._known:
            self.base_ns = BASE_NS if time_ns < _RELATIVE_BELOW_NS else None
            self._known = True


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
    part, ns = size - whole, np.zeros(len(counts), np.int64)
    exact = np.zeros(len(counts), np.bool_)
    for k in range(digits + 1):
        decimal = np.rint(part * 10.0**k)
        fits = left & ~exact & (whole + decimal / 10.0**k == size)
        ns[fits] = decimal[fits].astype(np.int64) * 10 ** (digits - k)
        exact |= fits
    # one of more decimals is rounded, where it is clear to which side
    fine = part * 10.0**digits
    near = np.abs(fine - np.rint(fine)) + np.spacing(size) * 10.0**digits < 0.5
    fits = left & ~exact & near
    ns[fits] = np.rint(fine[fits]).astype(np.int64)
    whole_ns = whole.astype(np.int64) * 10**digits
    return np.where(np.signbit(counts), -1, 1) * (whole_ns + ns), exact | fits


def _has_zone(text: str) -> bool:
    clock = parts(text)[1]
    return clock.endswith(('Z', 'UTC', 'GMT')) or '+' in clock or '-' in clock
