# SPDX-License-Identifier: Apache-2.0
"""Dates and times of day as people write them, to nanoseconds since 1970."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from zoneinfo import ZoneInfo

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.sources.formats.csv.cells import BadCell
from shipdrag_ros.sources.log import LIMIT_NS

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


@dataclass(frozen=True)
class DateForm:
    """
    How dates are written in a table.

    Attributes
    ----------
    order
        One of `ORDERS`; '' for times of day alone.
    zone
        Of times that state none.
    """

    order: str
    zone: tzinfo = UTC

    def read(self, text: str) -> int:
        """
        Return the time of a cell [ns since 1970], or [ns since midnight] of one without a date.

        Raises
        ------
        BadCell
            If it is none.
        """
        if not text:
            raise BadCell('empty', text)
        day, clock = parts(text)
        clock_ns, zone = _clock_ns(clock, text)
        if not self.order:
            if day:
                raise BadCell('a date where others have none', text)
            return clock_ns
        year, month, number = _numbers(day, self.order, text)
        try:
            midnight = datetime(year, month, number, tzinfo=zone or self.zone)
            # the zone's offset at the time itself, which a change of the clocks moves
            local = midnight + timedelta(seconds=clock_ns // SECOND_NS)
            seconds = int(local.timestamp())
        except (ValueError, OverflowError):
            raise BadCell('no possible date', text) from None
        time_ns = seconds * SECOND_NS + clock_ns % SECOND_NS
        if not 0 <= time_ns < LIMIT_NS:
            raise BadCell('no possible date', text)
        return time_ns


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


def order_of(texts: Iterable[str], hints: Sequence[str]) -> tuple[str, str]:
    """
    Find the order of year, month and day.

    Parameters
    ----------
    texts
        Cells.
    hints
        Titles of the table and name of the file, which may hold the date as 20170311.

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
    for hint in hints:
        for found in _IN_TITLE.finditer(hint):
            date = (int(found[1]), int(found[2]), int(found[3]))
            fitting = [order for order in possible if _numbers(days[0], order, '') == date]
            if len(fitting) == 1:
                return fitting[0], f'{found[0]} in {hint.strip("- ")!r}'
    if not possible:
        raise ImportDataError(f'the dates, {days[0]!r} for instance, are in no order known here')
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
    if found[5]:
        if not 1 <= hour <= 12:
            raise BadCell('no time of day', whole)
        hour = hour % 12 + (12 if found[5].lower() == 'pm' else 0)
    if hour > 23 or minute > 59 or second > 59:
        raise BadCell('no time of day', whole)
    fraction_ns = int((found[4] or '')[:9].ljust(9, '0'))
    zone = found[6]
    if not zone:
        known = None
    elif zone[0] in '+-':
        known = zone_of(zone)
    else:
        known = UTC
    return (3600 * hour + 60 * minute + second) * SECOND_NS + fraction_ns, known
