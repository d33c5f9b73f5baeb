# SPDX-License-Identifier: Apache-2.0
"""Which column of a table is its time, where nobody says so."""

from __future__ import annotations

import shlex
from dataclasses import replace
from datetime import tzinfo

import numpy as np

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import Float64
from shipdrag_ros.sources.formats.csv.cells import BadCell
from shipdrag_ros.sources.formats.csv.columns import NANOSECONDS, TimeColumn
from shipdrag_ros.sources.formats.csv.dates import is_date, is_midnight, parts
from shipdrag_ros.sources.formats.csv.first_rows import FirstRows, NamedColumn
from shipdrag_ros.sources.formats.csv.row_clock import RowClock

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
    dated = [each for each in (*times, *days) if _holds_date(rows, each)]
    if dated:
        clock = next((each for each in times if each not in dated), None)
        clocks = [parts(text)[1] for text in rows.texts(dated[0].place)]
        bare = not any(clocks[:5])
        if clock is not None and not bare:  # a spreadsheet gives a date a midnight
            bare = _holds_time_of_day(rows, clock) and all(map(is_midnight, clocks))
        if bare and clock is not None:
            return TimeColumn((dated[0].key, clock.key), NANOSECONDS['s'])
        return TimeColumn((dated[0].key,), NANOSECONDS['s'])
    if not times:
        header = ', '.join(map(repr, rows.header))
        raise ImportDataError(
            f'{rows.path!r} has no column that is known as a time; it has '
            f'{header}. Give --time COLUMN[:unit], or --rate HZ'
        )
    column = times[0]
    if column.unit in NANOSECONDS:
        return TimeColumn((column.key,), NANOSECONDS[column.unit], given=True)
    return _counted(rows, column, notes)


def _holds_date(rows: FirstRows, column: NamedColumn) -> bool:
    texts = [text for text in rows.texts(column.place)[:200] if text]
    return bool(texts) and is_date(texts[0]) and bool(parts(texts[0])[0])


def _holds_time_of_day(rows: FirstRows, column: NamedColumn) -> bool:
    texts = [text for text in rows.texts(column.place)[:200] if text]
    return bool(texts) and is_date(texts[0]) and not parts(texts[0])[0]


def _counted(rows: FirstRows, column: NamedColumn, notes: list[str]) -> TimeColumn:
    """Return a time without a unit; whole numbers in large steps may be milliseconds."""
    texts = [text for text in rows.texts(column.place) if text]
    if texts and is_date(texts[0]):
        return TimeColumn((column.key,), NANOSECONDS['s'])
    values = rows.values(column.place)
    values = values[np.isfinite(values)]
    step = float(np.median(np.diff(values))) if len(values) > 1 else 0.0
    small = len(values) > 0 and abs(values[0]) < 1e11
    if column.unit:
        raise ImportDataError(
            f'{rows.path!r}: the time {column.key!r} is said to be in '
            f'{column.unit}; counts are read in {", ".join(NANOSECONDS)}. Write it in one of '
            'them, or give --rate HZ'
        )
    if small and values[0] >= _DAYS and 0.0 < step < _QUICK_S:
        raise ImportDataError(
            f'{rows.path!r}: the time {column.key!r} goes by {step:.3g} from '
            f'{values[0]:.8g}, as the days of a spreadsheet do. Save it as dates; or, if they '
            f'are seconds, give --time {shlex.quote(column.typed)}:s'
        )
    if small and step >= 10.0:
        raise ImportDataError(
            f'{rows.path!r}: the unit of the time {column.key!r} is not known; '
            f'its steps are {step:g}. Give --time {shlex.quote(column.typed)}:ms, or :s'
        )
    if small:
        notes.append(f'The time {column.key!r} states no unit and is taken as s.')
    return TimeColumn((column.key,), NANOSECONDS['s'])


def row_seconds(rows: FirstRows, time: TimeColumn | None) -> Float64 | None:
    """
    Return (n,) times of the first rows from the first one [s], NaN where there is none.
    """
    if time is None:
        return None
    places = [rows.table.column(name) for name in time.names]
    texts = [' '.join(cells).strip() for cells in zip(*map(rows.texts, places), strict=True)]
    try:
        clock = RowClock.of(time, None, 0, texts, rows.table)
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


def with_dates(time: TimeColumn | None, order: str, zone: tzinfo | None) -> TimeColumn | None:
    """
    Return the column of a time with what was said of its dates.
    """
    if time is None:
        return None
    return replace(time, order=order or time.order, zone=zone or time.zone)
