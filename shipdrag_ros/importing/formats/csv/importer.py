# SPDX-License-Identifier: Apache-2.0
"""
A table of measurements as a bag.

What cannot be read in a cell is counted by reason with its first lines; what
can be read is written, plausible or not, for the monitor to judge.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from math import isfinite
from pathlib import Path

from shipdrag_ros import strict_yaml
from shipdrag_ros.display import NUMBER
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.importing.bag import (
    ATTACHMENT,
    BATCH_SAMPLES,
    LIMIT_NS,
    Rejected,
    new_bag,
)
from shipdrag_ros.importing.formats.csv.columns import InputColumns, TimeColumn
from shipdrag_ros.importing.table import Row, Table
from shipdrag_ros.samples import SECOND_NS, Block

BASE_NS = 946_684_800 * SECOND_NS
"""2000-01-01, where a time that counts from the start of a test begins."""

# a count of seconds below this, March 1973, is no date
_RELATIVE_BELOW_NS = 100_000_000 * SECOND_NS
_FEW = 10


@dataclass(frozen=True)
class ImportResult:
    """
    What became of a table.

    Attributes
    ----------
    rows
        Below the header.
    left_out
        Rows that `where` does not choose.
    written
        Samples by input; pitches are of `shaft`.
    rejected
        By input, or 'time' for a whole row, and reason.
    start_ns, end_ns
        First and last time written [ns].
    base_ns
        What was added to the times of the table [ns]; None if they are dates.
    backward
        Rows whose time is before that of an earlier row; a replay rejects
        them and says so.
    repeated
        Rows whose time is that of the newest row before; a replay rejects them
        too.
    delimiter
        That of the table.
    header
        Whether the table has one.
    """

    rows: int
    left_out: int
    written: dict[str, int]
    rejected: dict[str, dict[str, Rejected]]
    start_ns: int
    end_ns: int
    base_ns: int | None
    backward: int
    repeated: int
    delimiter: str
    header: bool


def import_csv(
    source: Path,
    out: Path,
    *,
    inputs: Sequence[InputColumns],
    time: TimeColumn | None = None,
    rate_hz: float | None = None,
    where: Sequence[tuple[str, str]] = (),
    start_ns: int = BASE_NS,
    attachments: Mapping[str, str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> ImportResult:
    """
    Write the measurements of a table as a bag.

    Parameters
    ----------
    source
        Table, see `Table`.
    out
        MCAP file to make.
    inputs
        Columns to take, from `parse_input`.
    time
        Column of the time, from `parse_time`; or else
    rate_hz
        Rows a second.
    where
        (column, text): only rows with this text there are taken.
    start_ns
        Date of time 0, for times that count from the start of a test [ns].
    attachments
        Text by name, a ship file for instance.
    progress
        Told how many bytes are read, and of how many.

    Raises
    ------
    ImportDataError
        If a column is not there, or nothing can be read.
    BagError
        If the bag cannot be made.
    """
    clock = _clock(time, rate_hz, start_ns)
    _check_inputs(inputs)
    table = Table(source)
    record = _Record(
        [
            (each, [table.column(name) for name in each.names])
            for mapped in inputs
            for each in mapped.by_channel()
        ],
        [(table.column(name), text) for name, text in where],
        clock,
        None if time is None else table.column(time.name),
        table.width,
    )
    with new_bag(out, attachments) as bag:
        bag.attach(ATTACHMENT, _provenance(source, inputs, time, rate_hz, where))
        for row in table.rows(progress):
            record.take(row)
            if len(record) >= BATCH_SAMPLES:
                bag.write_samples(record.pop())
        bag.write_samples(record.pop())
        return record.result(table)


class _BadCell(Exception):
    """A cell without a usable number."""

    def __init__(self, reason: str, cell: str) -> None:
        super().__init__(reason)
        self.reason = reason
        self.cell = cell


class _Clock:
    """Times of rows [ns], from their number or from a cell."""

    def __init__(self, unit_ns: Decimal | None, row_ns: Fraction | None, start_ns: int) -> None:
        self._unit_ns = unit_ns
        self._row_ns = row_ns
        self._start_ns = start_ns
        self.base_ns: int | None = start_ns if row_ns is not None else None
        self._known = row_ns is not None

    def time_ns(self, index: int, cell: str) -> int:
        if self._row_ns is not None:
            time_ns = self._start_ns + round(index * self._row_ns)
        else:
            assert self._unit_ns is not None
            _number(cell)
            exact = Decimal(cell) * self._unit_ns
            if exact.copy_abs() >= LIMIT_NS:
                raise _BadCell('no possible date', cell)
            time_ns = int(exact.to_integral_value())
            if not self._known:
                self.base_ns = self._start_ns if time_ns < _RELATIVE_BELOW_NS else None
                self._known = True
            time_ns += self.base_ns or 0
        if not 0 <= time_ns < LIMIT_NS:
            raise _BadCell('no possible date', cell)
        return time_ns


class _Record:
    """Turns rows into samples and counts what becomes of them."""

    def __init__(
        self,
        inputs: Sequence[tuple[InputColumns, Sequence[int]]],
        where: Sequence[tuple[int, str]],
        clock: _Clock,
        time_place: int | None,
        width: int,
    ) -> None:
        self._inputs = inputs
        self._width = width
        self._where = where
        self._clock = clock
        self._time_place = time_place
        self._rows = 0
        self._left_out = 0
        self._backward = 0
        self._repeated = 0
        self._first_ns: int | None = None
        self._newest_ns = -1
        self._written: Counter[str] = Counter()
        self._rejected: dict[str, dict[str, Rejected]] = {}
        self._samples: list[tuple[int, int, int, float, float]] = []
        self._seen: dict[str, None] = {}  # a set that keeps the order

    def __len__(self) -> int:
        return len(self._samples)

    def take(self, row: Row) -> None:
        """Take the samples of one row."""
        self._rows += 1
        for place, text in self._where:
            if _cell(row, place) != text:
                if len(self._seen) < _FEW:
                    self._seen[_cell(row, place)] = None
                self._left_out += 1
                return
        try:
            _check_width(row, self._width)
            cell = '' if self._time_place is None else _cell(row, self._time_place)
            time_ns = self._clock.time_ns(self._rows - self._left_out - 1, cell)
        except _BadCell as bad:
            self._reject('time', row, bad)
            return
        if self._first_ns is None:
            self._first_ns = time_ns
        # arrival never goes back, so that a replay sees the rows in their order
        self._backward += time_ns < self._newest_ns
        self._repeated += time_ns == self._newest_ns
        self._newest_ns = max(self._newest_ns, time_ns)
        for columns, places in self._inputs:
            try:
                a, b = self._values(row, columns, places)
            except _BadCell as bad:
                self._reject(columns.channel.input, row, bad)
            else:
                self._samples.append((columns.channel, time_ns, self._newest_ns, a, b))
                self._written[columns.channel.input] += 1

    def pop(self) -> Block:
        """Return the samples taken since the last time."""
        samples, self._samples = self._samples, []
        return Block.of_samples(samples)

    def result(self, table: Table) -> ImportResult:
        """Sum up; ImportDataError if there is nothing."""
        if self._first_ns is None or not self._written:
            raise ImportDataError(
                f'{str(table.path)!r} gave no sample from {self._rows} row(s); {self._why_not()}'
            )
        return ImportResult(
            rows=self._rows,
            left_out=self._left_out,
            written=dict(self._written),
            rejected=self._rejected,
            start_ns=self._first_ns,
            end_ns=self._newest_ns,
            base_ns=self._clock.base_ns,
            backward=self._backward,
            repeated=self._repeated,
            delimiter=table.delimiter,
            header=table.header is not None,
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

    def _values(
        self, row: Row, columns: InputColumns, places: Sequence[int]
    ) -> tuple[float, float]:
        values = [
            _number(_cell(row, place)) * factor
            for place, factor in zip(places, columns.factors, strict=True)
        ]
        return values[0], values[1] if len(values) > 1 else 0.0

    def _reject(self, name: str, row: Row, bad: _BadCell) -> None:
        by_reason = self._rejected.setdefault(name, {})
        by_reason.setdefault(bad.reason, Rejected()).add(row.line, bad.cell)


def _cell(row: Row, place: int) -> str:
    return row.cells[place] if place < len(row.cells) else ''


def _check_width(row: Row, width: int) -> None:
    """Refuse a row that does not fit the columns, as decimal commas make it."""
    beyond = [cell for cell in row.cells[width:] if cell]
    if beyond:
        raise _BadCell(f'more than {width} columns', ','.join(row.cells))


def _number(cell: str) -> float:
    if not cell:
        raise _BadCell('empty', cell)
    if not NUMBER.fullmatch(cell):
        raise _BadCell('not a number', cell)
    return float(cell)


def _clock(time: TimeColumn | None, rate_hz: float | None, start_ns: int) -> _Clock:
    if (time is None) == (rate_hz is None):
        raise ImportDataError('the times of the rows: give either --time COLUMN[:unit] or --rate')
    if time is not None:
        return _Clock(time.unit_ns, None, start_ns)
    assert rate_hz is not None
    if not (isfinite(rate_hz) and rate_hz > 0.0):
        raise ImportDataError(f'--rate {rate_hz!r}: expected a number of rows a second above 0')
    return _Clock(None, SECOND_NS / Fraction(rate_hz), start_ns)


def _check_inputs(inputs: Sequence[InputColumns]) -> None:
    if not inputs:
        raise ImportDataError('no column is mapped; give --map INPUT=COLUMN[:unit]')
    for name, count in Counter(each.name for each in inputs).items():
        if count > 1:
            raise ImportDataError(f'--map {name}=...: given {count} times; keep one')


def _provenance(
    source: Path,
    inputs: Sequence[InputColumns],
    time: TimeColumn | None,
    rate_hz: float | None,
    where: Sequence[tuple[str, str]],
) -> str:
    """Say where the samples come from; the name alone, whatever the machine."""
    about = {
        'source': source.name,
        'inputs': {each.name: list(each.names) for each in inputs},
        'time': None if time is None else time.name,
        'rate_hz': rate_hz,
        'where': dict(where),
    }
    return strict_yaml.dump(about)
