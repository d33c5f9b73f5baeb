# SPDX-License-Identifier: Apache-2.0
"""When the rows of a table were measured: by their number, a count, or a date."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC
from decimal import Decimal
from fractions import Fraction
from math import isfinite

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.sources.formats.csv.cells import BadCell, has_decimal_commas, number
from shipdrag_ros.sources.formats.csv.columns import NANOSECONDS, TimeColumn
from shipdrag_ros.sources.formats.csv.dates import DateForm, is_date, order_of, parts
from shipdrag_ros.sources.log import LIMIT_NS
from shipdrag_ros.sources.table import LogTable

BASE_NS = 946_684_800 * SECOND_NS
"""2000-01-01, where a time that counts from the start of a test begins."""

# a count of seconds below this, March 1973, is no date
_RELATIVE_BELOW_NS = 100_000_000 * SECOND_NS
_DAY_NS = 86_400 * SECOND_NS
_COUNTS_FROM = (('ns', 10**17), ('us', 10**14), ('ms', 10**11))  # since 1970, from 1973 on


class RowClock:
    """
    Times of rows [ns], from their number or from a cell.

    Attributes
    ----------
    base_ns
        What was added to the times of the table [ns]; None if they are dates.
    notes
        What was assumed, a sentence each.
    """

    def __init__(self, start_ns: int) -> None:
        self._start_ns = start_ns
        self._row_ns: Fraction | None = None
        self._unit_ns = NANOSECONDS['s']
        self._dates: DateForm | None = None
        self._comma = False
        self._known = False
        self._midnights = 0
        self._last_of_day_ns = 0
        self.base_ns: int | None = None
        self.notes: list[str] = []

    @classmethod
    def of(
        cls,
        time: TimeColumn | None,
        rate_hz: float | None,
        start_ns: int,
        cells: Sequence[str],
        table: LogTable,
    ) -> RowClock:
        """
        Make the clock of a table.

        Parameters
        ----------
        time, rate_hz
            One of the two; see `read_csv`.
        start_ns
            Date of time 0, for times that count from the start of a test [ns].
        cells
            Of the time, in the first rows.
        table
            Whose titles and name may show the date.

        Raises
        ------
        ImportDataError
            If the rate is none, or day and month are ambiguous.
        """
        clock = cls(start_ns)
        if time is None:
            assert rate_hz is not None
            if not (isfinite(rate_hz) and rate_hz > 0.0):
                raise ImportDataError(
                    f'--rate {rate_hz!r}: expected a number of rows a second above 0'
                )
            clock._row_ns = SECOND_NS / Fraction(rate_hz)
            clock.base_ns = start_ns
            return clock
        texts = [cell.strip() for cell in cells if cell.strip()]
        if len(time.names) == 2 or (texts and is_date(texts[0])):
            clock._read_dates(time, texts, table)
        else:
            clock._read_counts(time, texts)
        return clock

    def _read_dates(self, time: TimeColumn, texts: Sequence[str], table: LogTable) -> None:
        order, known_by = time.order, ''
        if not order:
            order, known_by = order_of(texts, (*table.titles, table.path.name))
            if not order and texts and parts(texts[0])[0]:
                raise ImportDataError(
                    f'{str(table.path)!r}: day and month are ambiguous, {known_by}; give '
                    '--date-order dmy or --date-order mdy'
                )
        self._dates = DateForm(order, time.zone)
        if not order:
            self.base_ns = self._start_ns
            self.notes.append('The times are times of day without a date.')
            return
        if known_by and order != 'ymd':
            words = {'d': 'day', 'm': 'month', 'y': 'year'}
            written = '/'.join(words[each] for each in order)
            self.notes.append(f'Dates are {written}, as {known_by} show.')
        stated = 'utc' in ' '.join(time.names).lower() or any(map(_has_zone, texts[:1]))
        if time.zone is UTC and not stated:
            self.notes.append('The times state no zone and are taken as UTC (--zone).')

    def _read_counts(self, time: TimeColumn, texts: Sequence[str]) -> None:
        self._comma = has_decimal_commas(texts)
        self._unit_ns = time.unit_ns
        if time.given:
            return
        for text in texts[:1]:
            try:
                count = abs(number(self._plain(text)))
            except BadCell:
                continue
            unit = next((unit for unit, least in _COUNTS_FROM if count >= least), 's')
            if unit != 's':
                self._unit_ns = NANOSECONDS[unit]
                self.notes.append(f'The times are counts of {unit} since 1970, by their size.')

    def _plain(self, cell: str) -> str:
        return cell.replace(',', '.', 1) if self._comma and '.' not in cell else cell

    def time_ns(self, index: int, cell: str) -> int:
        """
        Return the time of a row.

        Raises
        ------
        BadCell
            If its cell holds none.
        """
        if self._row_ns is not None:
            time_ns = self._start_ns + round(index * self._row_ns)
        elif self._dates is not None:
            time_ns = self._dates.read(cell)
            if not self._dates.order:
                time_ns = self._since_midnight(time_ns)
        else:
            time_ns = self._counted_ns(cell)
        if not 0 <= time_ns < LIMIT_NS:
            raise BadCell('no possible date', cell)
        return time_ns

    def _counted_ns(self, cell: str) -> int:
        plain = self._plain(cell)
        number(plain)
        exact = Decimal(plain) * self._unit_ns
        if exact.copy_abs() >= LIMIT_NS:
            raise BadCell('no possible date', cell)
        time_ns = int(exact.to_integral_value())
        if not self._known:
            self.base_ns = self._start_ns if time_ns < _RELATIVE_BELOW_NS else None
            self._known = True
        return time_ns + (self.base_ns or 0)

    def _since_midnight(self, of_day_ns: int) -> int:
        """Add the midnights passed: a time of day that goes back by hours is of the next day."""
        if of_day_ns < self._last_of_day_ns - _DAY_NS // 2:
            self._midnights += 1
        elif self._midnights and of_day_ns > self._last_of_day_ns + 23 * _DAY_NS // 24:
            self._midnights -= 1  # a row from before the midnight behind one from after it
        self._last_of_day_ns = of_day_ns
        return self._start_ns + self._midnights * _DAY_NS + of_day_ns


def _has_zone(text: str) -> bool:
    clock = parts(text)[1]
    return clock.endswith(('Z', 'UTC', 'GMT')) or '+' in clock or '-' in clock
