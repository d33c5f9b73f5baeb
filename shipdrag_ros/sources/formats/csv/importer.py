# SPDX-License-Identifier: Apache-2.0
"""
Tables separated by comma, semicolon, tab, bar or blanks, with titles above, units below the
header, decimal commas, dates, coordinates as 4530.20N. Columns are known by their usual names
(STW SOG HDG Lat Lon RPM AWS AWA ...) where their unit is stated or can be worked out; other
columns are listed and not used. With --map these columns alone are taken.
"""

# What cannot be read in a cell is counted by reason with its first lines; what can be read is
# written, plausible or not, for the monitor to judge.

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from shipdrag_ros import display, strict_yaml
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.progress import PartDone
from shipdrag_ros.samples import (
    ABSURD_SPEED_M_S,
    BACKWARD_JUMP_NS,
    SET_BACK,
    Block,
    Channel,
    Int64,
)
from shipdrag_ros.sources.format import LIKELY, NO, POSSIBLE, RATE, Format, Head, Job, Option
from shipdrag_ros.sources.formats.csv.cells import (
    ORDERS,
    Bad,
    BadCell,
    CellReader,
    combined,
    coordinate_readers,
    has_decimal_commas,
    row_clock,
    zone_of,
)
from shipdrag_ros.sources.formats.csv.columns import (
    SPEED_UNITS,
    InputColumns,
    parse_time,
    role_and_unit,
)
from shipdrag_ros.sources.formats.csv.guess import Guess
from shipdrag_ros.sources.formats.csv.table import LogTable, TableRows, are_numbers
from shipdrag_ros.sources.log import (
    ATTACHMENT,
    ImportResult,
    Log,
    Refused,
    Understood,
    reject,
    rejected_words,
)


@dataclass(frozen=True, kw_only=True)
class TableResult(ImportResult):
    """
    What became of a table; `not_used` are columns, and out of order are rows.

    Attributes
    ----------
    rows
        Below the header.
    left_out
        Rows that `where` does not choose.
    base_ns
        What was added to the times of the table [ns]; None if they are dates.
    delimiter
        That of the table.
    header
        Whether the table has one.
    """

    rows: int
    left_out: int
    base_ns: int | None
    delimiter: str
    header: bool
    unused: ClassVar = 'Columns not used'
    counted: ClassVar = ('rows', '')

    @property
    def size(self) -> str:
        """What was read."""
        return f'{self.rows - self.left_out} rows'

    def summary(self, bag: Path) -> list[str]:
        """
        Say how much was read, and what is to be known of it.
        """
        first, *others = super().summary(bag)
        if self.base_ns is not None:
            since = f'The times count from a start; it was put at {display.utc(self.base_ns)}.'
            others = [since, *others]
        if self.left_out:
            others.append(f'{self.left_out} rows were not chosen by --where.')
        return [first, *others]


_FEW = 10
_SAMPLE_ROWS = 2000  # by which the way of writing is known
_SPEEDS = (Channel.SPEED_THROUGH_WATER, Channel.SPEED_OVER_GROUND)


def read_csv(
    table: LogTable, log: Log, options: Mapping[str, Any], *, progress: PartDone | None = None
) -> TableResult:
    """
    Read a table by its options, and what they leave open by its names and values.

    Parameters
    ----------
    table
    log
        Where to.
    options
        By `Option.key`; those that are not there were not given.
    progress
        Called with how many bytes are read, and of how many.

    Raises
    ------
    ImportDataError
        If a column is not there, nothing that moves has a known unit, the options do not go
        together, or nothing can be read.
    """
    if options.get('time') is not None and options.get('rate') is not None:
        raise ImportDataError('--time and --rate: both give the times of the rows; keep one')
    found = Guess(table, options)
    record = _RowSamples(table, found, options)
    about = {
        'source': table.path.name,  # the name alone, whatever the machine
        'inputs': {each.name: list(each.names) for each in found.inputs},
        'time': None if found.time is None else ', '.join(found.time.names),
        'rate_hz': options.get('rate'),
        'where': dict(options.get('where', ())),
    }
    log.attachments[ATTACHMENT] = strict_yaml.dump(about)
    for rows in table.rows(progress):
        log.write_samples(record.take(rows))
    return record.result(log)


class _RowSamples:
    """Turns rows into samples and counts what becomes of them."""

    def __init__(self, table: LogTable, found: Guess, options: Mapping[str, Any]) -> None:
        self._table, self._found = table, found
        channels = [each for mapped in found.inputs for each in mapped.by_channel()]
        places = [[*map(table.column, each.names)] for each in channels]
        time = () if found.time is None else found.time.names
        self._time_places = [*map(table.column, time)]
        self._where = [(table.column(name), text) for name, text in options.get('where', ())]
        sample = table.first_rows(_SAMPLE_ROWS)
        self._clock = row_clock(
            found.time, options.get('rate'), sample.joined(self._time_places), table
        )
        self._inputs = [*zip(channels, places, _readers(channels, places, sample), strict=True)]
        self._too_fast: Counter[Channel] = Counter()
        self._rows = self._left_out = self._backward = self._repeated = 0
        self._first_ns: int | None = None
        self._newest_ns = self._arrived_ns = -1
        self._set_back_ns = 0  # by which a clock was set back so far
        self._written: Counter[str] = Counter()
        self._rejected: Refused = {}
        self._seen: dict[str, None] = {}  # a set that keeps the order

    def take(self, rows: TableRows) -> Block:
        """Return the samples of some rows, a row after the other."""
        times, rows = self._timed(self._chosen(rows))
        n, m = len(rows), len(self._inputs)
        if not n:
            return Block.empty()
        if self._first_ns is None:
            self._first_ns = int(times[0])
        before = np.maximum.accumulate(np.r_[self._newest_ns, times])
        self._backward += int(np.sum(times < before[:-1]))
        self._repeated += int(np.sum(times == before[:-1]))
        self._newest_ns = int(before[-1])
        arrived = self._arrived(times)
        value, known = np.zeros((n, m, 2)), np.ones((n, m), np.bool_)
        for k, (columns, places, readers) in enumerate(self._inputs):
            bad: Bad = {}
            values = [
                read.all(rows.columns[place], bad) * factor
                for read, place, factor in zip(readers, places, columns.factors, strict=True)
            ]
            self._reject(columns.channel.input, rows, bad)
            known[list(bad), k] = False
            value[:, k, 0], value[:, k, 1] = combined(columns, values)
            if columns.channel.kind in _SPEEDS:
                fast = np.abs(value[known[:, k], k, 0]) > ABSURD_SPEED_M_S
                self._too_fast[columns.channel] += int(np.sum(fast))
            self._written[columns.channel.input] += n - len(bad)
        row, which = np.nonzero(known)
        channel = np.array([columns.channel for columns, _, _ in self._inputs], np.uint8)
        return Block(
            channel[which],
            times[row],
            arrived[row],
            value[row, which],
            np.full((len(row), 2), np.nan),
        )

    def _arrived(self, times: Int64) -> Int64:
        """
        Return arrivals that never go back, so that a replay sees the rows in their order.

        Where a clock was set back they go on with it: what follows has a time in the record.
        """
        first = 0
        arrived: Int64 = np.empty(0, np.int64)
        while True:
            clock = times[first:] + self._set_back_ns
            later: Int64 = np.maximum.accumulate(np.r_[self._arrived_ns, clock])[1:]
            behind = clock < later - BACKWARD_JUMP_NS
            behind &= np.diff(clock, prepend=clock[0]) > 0
            agree = np.flatnonzero(np.convolve(behind, np.ones(SET_BACK), 'valid') == SET_BACK)
            at = int(agree[0]) - 1 if len(agree) else len(clock)
            arrived = np.r_[arrived, later[:at]]
            self._arrived_ns = int(arrived[-1]) if len(arrived) else self._arrived_ns
            if at == len(clock):
                return arrived
            first += at
            self._set_back_ns = self._arrived_ns - int(times[first])

    def _chosen(self, rows: TableRows) -> TableRows:
        """Leave out rows without the texts that were asked for."""
        self._rows += len(rows)
        for place, text in self._where:
            cells = rows.texts(place)
            kept = np.array([cell == text for cell in cells], np.bool_)
            others = dict.fromkeys(cells[~kept])
            self._seen = dict.fromkeys([*(self._seen | others)][:_FEW])
            self._left_out += int(np.sum(~kept))
            rows = rows[kept]
        return rows

    def _timed(self, rows: TableRows) -> tuple[Int64, TableRows]:
        """Return the times of rows, and the rows that have one."""
        cells, fits = rows.joined(self._time_places), np.ones(len(rows), np.bool_)
        if rows.beyond:
            fits = ~np.isin(rows.lines, [*rows.beyond])
            cells = np.where(fits, cells, '')
        bad: Bad = {}
        times = self._clock.times(cells, bad)
        for place in np.flatnonzero(~fits).tolist():
            bad[place] = BadCell(f'more than {len(rows.columns)} columns')
            bad[place].cell = rows.beyond[rows.lines[place]]
        self._reject('time', rows, bad)
        fits[list(bad)] = False
        return times[fits], rows[fits]

    def result(self, log: Log) -> TableResult:
        """Sum up; ImportDataError if there is nothing."""
        table = self._table
        if self._first_ns is None or not +self._written:
            raise table.error(f' gave no sample from {self._rows} row(s); {self._why_not()}')
        used = {place for _, places, _ in self._inputs for place in places}
        used.update(self._time_places)
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
            notes=tuple(self._notes()),
            not_used=tuple(
                name for place, name in enumerate(table.header or ()) if place not in used
            ),
        )

    def _understood(self, log: Log) -> tuple[Understood, ...]:
        return tuple(
            Understood(
                columns.name,
                ', '.join(repr(name) for name in columns.names),
                ', '.join(dict.fromkeys(columns.units)),
                log.first[columns.channel],
                geodetic=columns.channel.kind is Channel.POSITION_GEODETIC,
            )
            for columns, _, _ in self._inputs
            if columns.channel in log.first
        )

    def _notes(self) -> Iterator[str]:
        yield from self._found.notes
        if self._table.titles:
            yield f'{len(self._table.titles)} line(s) above the table were left out.'
        if self._table.joined_lines:
            yield (
                f'{self._table.joined_lines} line(s) were taken as part of a cell in quotation '
                'marks; a mark that is not closed does that.'
            )
        yield from self._clock.notes
        for channel, count in (+self._too_fast).items():
            yield (
                f'{channel.input}: {count} of {self._written[channel.input]} values are above '
                f'{ABSURD_SPEED_M_S:g} m/s, faster than any displacement ship; is the unit right?'
            )
        yield from (f'Not used: {each}' for each in self._found.unclear)

    def _why_not(self) -> str:
        if self._left_out == self._rows and self._seen:
            return f'--where chooses none of them: the column holds {", ".join(self._seen)}'
        reasons = rejected_words(self._rejected)
        if not reasons:
            return 'give a table with a line a sample'
        return (
            f'{"; ".join(reasons)}; expected numbers with a decimal point and without a unit, '
            'times in seconds or in the unit given'
        )

    def _reject(self, name: str, rows: TableRows, bad: Bad) -> None:
        for place, why in sorted(bad.items()):
            reject(self._rejected, name, why.reason, rows.lines[place], why.cell)


def _readers(
    inputs: Sequence[InputColumns], places: Sequence[Sequence[int]], sample: TableRows
) -> list[list[CellReader]]:
    """Return what reads the cells of each column, as they are written in the first rows."""
    texts = (cells for cells in sample.columns if not are_numbers(cells))
    comma = has_decimal_commas(chain.from_iterable(texts))
    return [
        coordinate_readers(*map(sample.texts, here))
        if columns.channel.kind is Channel.POSITION_GEODETIC
        else [CellReader(comma=comma)] * len(here)
        for columns, here in zip(inputs, places, strict=True)
    ]


def _score(head: Head) -> float:
    if not head.lines or head.lines[0][0] in '{<[':
        return NO
    try:
        table = LogTable(head.path)
    except ImportDataError:
        return NO
    if table.header is None:  # numbers alone, perhaps in one column
        return POSSIBLE
    known = any(role_and_unit(name)[0] for name in table.header)
    return NO if table.width == 1 else LIKELY if known else POSSIBLE


def _open(job: Job, log: Log) -> TableResult:
    return read_csv(LogTable(job.source), log, job.options, progress=job.progress)


def _where(text: str) -> tuple[str, str]:
    column, equals, value = text.partition('=')
    if not (column and equals):
        raise ImportDataError(f'{text!r}, expected COLUMN=VALUE')
    return column, value


def _one_of(known: tuple[str, ...]) -> Any:
    def read(text: str) -> str:
        if text not in known:
            raise ImportDataError(f'{text!r}, expected one of {", ".join(known)}')
        return text

    return read


FORMAT = Format(
    name='csv',
    kind='a CSV file',
    about=__doc__,
    score=_score,
    read=_open,
    options=(
        Option(
            '--map',
            'INPUT=COLUMN[:unit]',
            'column (name, or number from 1) of an input; more than once for more inputs. '
            'position and wind_apparent take two, and a unit given once holds for both: '
            'position=x,y:km is position=x:km,y:km. A position in deg is latitude and longitude: '
            'position=lat,lon:deg, as one without a unit whose columns have such names. '
            'speed_over_ground takes two where they are its components. '
            'Units: speeds m/s kn km/h ft/s mph, lengths m km ft nmi, angles rad deg, of a '
            'heading also compass (deg clockwise from north), shaft rad/s rpm rev/s, pitch ratio '
            '%% rad deg (default: the first of each); wind_apparent=AWS:kn,AWA:deg is speed and '
            'angle. shaft and pitch take up to four, one a shaft: shaft=port,starboard:rpm. '
            'A further log, speed or position: speed_through_water_2=COLUMN:kn, and so on to _3',
            many=True,
        ),
        Option(
            '--time',
            'COLUMN[:unit]',
            'column of the time: a date, or a count since 1970 or from the start of the test; '
            'units s ms us ns (default: s); DATE,TIME for a date and a time of day',
            parse_time,
        ),
        RATE,
        Option(
            '--speed-unit',
            'UNIT',
            'unit of the speeds whose columns state none: m/s kn km/h ft/s mph',
            _one_of(tuple(SPEED_UNITS)),
        ),
        Option(
            '--date-order',
            'ORDER',
            'order of day and month in dates that leave it open: dmy, mdy or ymd',
            _one_of(ORDERS),
        ),
        Option(
            '--zone',
            'ZONE',
            'time zone of dates that state none: +02:00 or Europe/Rome (default: UTC)',
            zone_of,
        ),
        Option(
            '--where',
            'COLUMN=VALUE',
            'take only rows with this text in the column; more than once for more conditions',
            _where,
            many=True,
        ),
    ),
    chosen_by='map',
    by_head=False,
)
