# SPDX-License-Identifier: Apache-2.0
"""When the rows of a table were measured: by their number, a count, or a date."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC
from decimal import Decimal
from fractions import Fraction
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import SECOND_NS, Int64
from shipdrag_ros.sources.formats.csv.cells import (
    BadCell,
    CellReader,
    DateForm,
    has_decimal_commas,
    is_date,
    order_of,
    parts,
)
from shipdrag_ros.sources.formats.csv.columns import NANOSECONDS, TimeColumn
from shipdrag_ros.sources.log import LIMIT_NS
from shipdrag_ros.sources.table import Cells, LogTable, texts_of

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
                plain = text.replace(',', '.', 1) if self._comma else text
                count = abs(CellReader().one(plain))
            except BadCell:
                continue
            unit = next((unit for unit, least in _COUNTS_FROM if count >= least), 's')
            if unit != 's':
                self._unit_ns = NANOSECONDS[unit]
                self.notes.append(f'The times are counts of {unit} since 1970, by their size.')

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
        if self._row_ns is not None:
            parts = range(first, first + len(cells))
            times = [self._start_ns + round(number * self._row_ns) for number in parts]
            return np.array(times, np.int64)
        if self._dates is None and isinstance(cells, np.ndarray):
            return self._counted(cells, bad)
        found = np.zeros(len(cells), np.int64)
        for place, cell in enumerate(texts_of(cells) if isinstance(cells, np.ndarray) else cells):
            try:
                found[place] = self._time_ns(cell)
            except BadCell as error:
                bad[place] = error
        return found

    def _time_ns(self, cell: str) -> int:
        if self._dates is None:
            time_ns = self._count_ns(cell)
            self._begin(time_ns)
            time_ns += self.base_ns or 0
        else:
            time_ns = self._dates.read(cell)
            if not self._dates.order:
                time_ns = self._since_midnight(time_ns)
        if not 0 <= time_ns < LIMIT_NS:
            raise BadCell('no possible date', cell)
        return time_ns

    def _count_ns(self, cell: str) -> int:
        plain = cell.replace(',', '.', 1) if self._comma and '.' not in cell else cell
        CellReader().one(plain)
        exact = Decimal(plain) * self._unit_ns
        if exact.copy_abs() >= LIMIT_NS:
            raise BadCell('no possible date', cell)
        return int(exact.to_integral_value())

    def _begin(self, time_ns: int) -> None:
        """Say by the first count whether they count from 1970 or from a start."""
        if not self._known:
            self.base_ns = self._start_ns if time_ns < _RELATIVE_BELOW_NS else None
            self._known = True

    def _counted(self, counts: NDArray[Any], bad: dict[int, BadCell]) -> Int64:
        """Return what `_time_ns` makes of the text of each number."""
        times, exact = _counts_ns(counts, len(str(self._unit_ns)) - 1)
        for place in np.flatnonzero(~exact).tolist():
            (cell,) = texts_of(counts[place : place + 1])
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
            bad[place] = BadCell('no possible date', str(counts[place]))
        return times

    def _since_midnight(self, of_day_ns: int) -> int:
        """Add the midnights passed: a time of day that goes back by hours is of the next day."""
        if of_day_ns < self._last_of_day_ns - _DAY_NS // 2:
            self._midnights += 1
        elif self._midnights and of_day_ns > self._last_of_day_ns + 23 * _DAY_NS // 24:
            self._midnights -= 1  # a row from before the midnight behind one from after it
        self._last_of_day_ns = of_day_ns
        return self._start_ns + self._midnights * _DAY_NS + of_day_ns


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
