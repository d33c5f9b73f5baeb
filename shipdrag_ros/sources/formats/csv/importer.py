# SPDX-License-Identifier: Apache-2.0
"""
A table of measurements as a bag.

What cannot be read in a cell is counted by reason with its first lines; what
can be read is written, plausible or not, for the monitor to judge.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, zip_longest
from pathlib import Path

import numpy as np

from shipdrag_ros import strict_yaml
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.progress import PartDone
from shipdrag_ros.samples import ABSURD_SPEED_M_S, Block, Channel, Int64
from shipdrag_ros.sources.formats.csv.cells import (
    BadCell,
    are_in_minutes,
    combined,
    degrees_of,
    has_decimal_commas,
    minutes_of,
    number,
    number_with_comma,
    numbers,
)
from shipdrag_ros.sources.formats.csv.columns import InputColumns, TimeColumn
from shipdrag_ros.sources.formats.csv.result import TableResult
from shipdrag_ros.sources.formats.csv.row_clock import BASE_NS, RowClock
from shipdrag_ros.sources.log import (
    ATTACHMENT,
    BATCH_SAMPLES,
    Log,
    Rejected,
    Understood,
)
from shipdrag_ros.sources.table import LogRow, LogTable

_FEW = 10
_SAMPLE_ROWS = 2000  # by which the way of writing is known
_SPEEDS = (Channel.SPEED_THROUGH_WATER, Channel.SPEED_OVER_GROUND)
CellReader = Callable[[str], float]


@dataclass(frozen=True)
class TableColumns:
    """
    What is to be taken from a table.

    Attributes
    ----------
    inputs
        Columns of the inputs, from `parse_input`.
    time
        Column of the time, from `parse_time`; or else
    rate_hz
        Rows a second.
    where
        (column, text): only rows with this text there are taken.
    start_ns
        Date of time 0, for times that count from the start of a test [ns].
    """

    inputs: Sequence[InputColumns]
    time: TimeColumn | None = None
    rate_hz: float | None = None
    where: Sequence[tuple[str, str]] = ()
    start_ns: int = BASE_NS

    def check(self) -> None:
        """
        Refuse what is missing, or given twice.

        Raises
        ------
        ImportDataError
        """
        if (self.time is None) == (self.rate_hz is None):
            raise ImportDataError(
                'the times of the rows: give either --time COLUMN[:unit] or --rate'
            )
        if not self.inputs:
            raise ImportDataError('no column is mapped; give --map INPUT=COLUMN[:unit]')
        for name, count in Counter(each.name for each in self.inputs).items():
            if count > 1:
                raise ImportDataError(f'--map {name}=...: given {count} times; keep one')


def read_csv(
    source: Path | LogTable,
    log: Log,
    columns: TableColumns,
    *,
    progress: PartDone | None = None,
) -> TableResult:
    """
    Read the measurements of a table.

    Parameters
    ----------
    source
        Table, see `LogTable`.
    log
        Where to.
    columns
        Which of it to take.
    progress
        Called with how many bytes are read, and of how many.

    Raises
    ------
    ImportDataError
        If a column is not there, or nothing can be read.
    """
    columns.check()
    table = source if isinstance(source, LogTable) else LogTable(source)
    time = columns.time
    places = [] if time is None else [table.column(name) for name in time.names]
    channels = [each for mapped in columns.inputs for each in mapped.by_channel()]
    mapped_places = [[table.column(name) for name in each.names] for each in channels]
    chosen = [(table.column(name), text) for name, text in columns.where]
    sample = list(islice(table.rows(), _SAMPLE_ROWS))
    texts = [row_text(row, places) for row in sample]
    clock = RowClock.of(time, columns.rate_hz, columns.start_ns, texts, table)
    record = _RowSamples(
        list(zip(channels, mapped_places, _readers(channels, mapped_places, sample), strict=True)),
        chosen,
        clock,
        places,
        table.width,
    )
    log.attach(ATTACHMENT, _provenance(table.path, columns))
    rows = table.rows(progress)
    while some := list(islice(rows, BATCH_SAMPLES)):
        log.write_samples(record.take(some))
    return record.result(table, log)


def row_text(row: LogRow, places: Sequence[int]) -> str:
    """
    Return the text of one or two cells of a row, as a date and its time of day stand in them.
    """
    return ' '.join(_cell(row, place) for place in places)


class _RowSamples:
    """Turns rows into samples and counts what becomes of them."""

    def __init__(
        self,
        inputs: Sequence[tuple[InputColumns, Sequence[int], Sequence[CellReader]]],
        where: Sequence[tuple[int, str]],
        clock: RowClock,
        time_places: Sequence[int],
        width: int,
    ) -> None:
        self._inputs = inputs
        self._width = width
        self._where = where
        self._clock = clock
        self._time_places = time_places
        self._too_fast: Counter[Channel] = Counter()
        self._used = {place for _, places, _ in inputs for place in places} | {*time_places}
        self._rows = 0
        self._left_out = 0
        self._backward = 0
        self._repeated = 0
        self._first_ns: int | None = None
        self._newest_ns = -1
        self._written: Counter[str] = Counter()
        self._rejected: dict[str, dict[str, Rejected]] = {}
        self._index = 0
        self._seen: dict[str, None] = {}  # a set that keeps the order

    def take(self, rows: Sequence[LogRow]) -> Block:
        """Return the samples of some rows, a row after the other."""
        rows = self._chosen(rows)
        times, rows = self._times(rows)
        n = len(rows)
        if not n:
            return Block.empty()
        if self._first_ns is None:
            self._first_ns = int(times[0])
        # arrival never goes back, so that a replay sees the rows in their order
        before = np.maximum.accumulate(np.r_[self._newest_ns, times])
        self._backward += int(np.sum(times < before[:-1]))
        self._repeated += int(np.sum(times == before[:-1]))
        self._newest_ns = int(before[-1])
        wide = [*zip_longest(*(row.cells for row in rows), fillvalue='')]
        texts = dict(enumerate(wide))
        nothing = [''] * n
        value, known = np.zeros((n, len(self._inputs), 2)), np.zeros((n, len(self._inputs)), bool)
        for k, (columns, places, readers) in enumerate(self._inputs):
            bad: dict[int, BadCell] = {}
            values = []
            for read, place, factor in zip(readers, places, columns.factors, strict=True):
                found = numbers(texts.get(place, nothing), read, bad)
                values.append(found * factor)
            for i in sorted(bad):
                self._reject(columns.channel.input, rows[i], bad[i])
            good = np.ones(n, np.bool_)
            good[list(bad)] = False
            made = combined(columns.form, values)
            value[:, k, 0], value[:, k, 1] = made
            known[:, k] = good
            if columns.channel in _SPEEDS:
                count = int(np.sum(np.abs(value[good, k, 0]) > ABSURD_SPEED_M_S))
                if count:
                    self._too_fast[columns.channel] = (
                        self._too_fast.get(columns.channel, 0) + count
                    )
            self._written[columns.channel.input] += int(good.sum())
        row, which = np.nonzero(known)
        channel = np.array([columns.channel for columns, _, _ in self._inputs], np.uint8)
        return Block(
            channel[which],
            times[row],
            before[1:][row],
            value[row, which],
            np.full((len(row), 2), np.nan),
        )

    def _chosen(self, rows: Sequence[LogRow]) -> Sequence[LogRow]:
        """Leave out rows without the texts that were asked for."""
        self._rows += len(rows)
        for place, text in self._where:
            kept = [row for row in rows if _cell(row, place) == text]
            for row in rows if len(self._seen) < _FEW else ():
                if _cell(row, place) != text and len(self._seen) < _FEW:
                    self._seen[_cell(row, place)] = None
            self._left_out += len(rows) - len(kept)
            rows = kept
        return rows

    def _times(self, rows: Sequence[LogRow]) -> tuple[Int64, Sequence[LogRow]]:
        """Return the times of rows, and the rows that have one."""
        times, kept = [], []
        for row in rows:
            try:
                _check_width(row, self._width)
                cell = row_text(row, self._time_places).strip()
                times.append(self._clock.time_ns(self._index, cell))
                kept.append(row)
            except BadCell as bad:
                self._reject('time', row, bad)
            self._index += 1
        return np.array(times, np.int64), kept

    def result(self, table: LogTable, log: Log) -> TableResult:
        """Sum up; ImportDataError if there is nothing."""
        if self._first_ns is None or not +self._written:
            raise ImportDataError(
                f'{str(table.path)!r} gave no sample from {self._rows} row(s); {self._why_not()}'
            )
        return TableResult(
            rows=self._rows,
            left_out=self._left_out,
            written=dict(+self._written),
            rejected=self._rejected,
            start_ns=self._first_ns,
            end_ns=self._newest_ns,
            base_ns=self._clock.base_ns,
            backward=self._backward,
            repeated=self._repeated,
            delimiter=table.delimiter,
            header=table.header is not None,
            understood=self._understood(log),
            notes=tuple(self._notes(table)),
            not_used=tuple(
                name for place, name in enumerate(table.header or ()) if place not in self._used
            ),
        )

    def _understood(self, log: Log) -> tuple[Understood, ...]:
        return tuple(
            Understood(
                columns.name,
                ', '.join(repr(name) for name in columns.names),
                ', '.join(dict.fromkeys(columns.units)),
                log.first[columns.channel],
                geodetic=columns.channel is Channel.POSITION_GEODETIC,
            )
            for columns, _, _ in self._inputs
            if columns.channel in log.first
        )

    def _notes(self, table: LogTable) -> Iterator[str]:
        if table.titles:
            yield f'{len(table.titles)} line(s) above the table were left out.'
        if table.joined_lines:
            yield (
                f'{table.joined_lines} line(s) were taken as part of a cell in quotation marks; a '
                'mark that is not closed does that.'
            )
        yield from self._clock.notes
        for channel, count in (+self._too_fast).items():
            yield (
                f'{channel.input}: {count} of {self._written[channel.input]} values are above '
                f'{ABSURD_SPEED_M_S:g} m/s, faster than any displacement ship; is the unit right?'
            )

    def _why_not(self) -> str:
        if self._left_out == self._rows and self._seen:
            return f'--where chooses none of them: the column holds {", ".join(self._seen)}'
        reasons = [
            f'{name}: {reason} {rejected.count} times, {"; ".join(rejected.first)}'
            for name, by_reason in self._rejected.items()
            for reason, rejected in by_reason.items()
        ]
        if not reasons:
            return 'give a table with a line a sample'
        return (
            f'{"; ".join(reasons)}; expected numbers with a decimal point and without a unit, '
            'times in seconds or in the unit given'
        )

    def _reject(self, name: str, row: LogRow, bad: BadCell) -> None:
        by_reason = self._rejected.setdefault(name, {})
        by_reason.setdefault(bad.reason, Rejected()).add(row.line, bad.cell)


def _cell(row: LogRow, place: int) -> str:
    return row.cells[place] if place < len(row.cells) else ''


def _check_width(row: LogRow, width: int) -> None:
    """Refuse a row that does not fit the columns, as decimal commas make it."""
    beyond = [cell for cell in row.cells[width:] if cell]
    if beyond:
        raise BadCell(f'more than {width} columns', ','.join(row.cells))


def _readers(
    inputs: Sequence[InputColumns], places: Sequence[Sequence[int]], sample: Sequence[LogRow]
) -> list[list[CellReader]]:
    """Return what reads the cells of each column, as they are written in the first rows."""
    cells = {place: [_cell(row, place) for row in sample] for each in places for place in each}
    plain = number
    if has_decimal_commas(cell for row in sample for cell in row.cells):
        plain = number_with_comma
    found: list[list[CellReader]] = []
    for columns, here in zip(inputs, places, strict=True):
        if columns.channel is Channel.POSITION_GEODETIC:
            minutes = are_in_minutes(*(cells[each] for each in here))
            sides = zip(here, ('NS', 'EW'))
            found.append([_coordinate(cells[each], s, minutes) for each, s in sides])
        else:
            found.append([plain] * len(here))
    return found


def _coordinate(cells: Sequence[str], side: str, minutes: bool) -> CellReader:
    if minutes:
        return minutes_of(side)
    if has_decimal_commas(cells):
        read = degrees_of(side)
        return lambda cell: read(cell.replace(',', '.', 1))
    return degrees_of(side)


def _provenance(source: Path, columns: TableColumns) -> str:
    """Say where the samples come from; the name alone, whatever the machine."""
    about = {
        'source': source.name,
        'inputs': {each.name: list(each.names) for each in columns.inputs},
        'time': None if columns.time is None else ', '.join(columns.time.names),
        'rate_hz': columns.rate_hz,
        'where': dict(columns.where),
    }
    return strict_yaml.dump(about)
