# SPDX-License-Identifier: Apache-2.0
"""
Tables separated by comma, semicolon, tab, bar or blanks, with titles above, units below the
header, decimal commas, dates, coordinates as 4530.20N. Columns are known by their usual names
(STW SOG HDG Lat Lon RPM AWS AWA ...) where their unit is stated or can be worked out; other
columns are listed and not used. With --map these columns alone are taken.

Options
-------
--map INPUT=COLUMN[:unit]
    column (name, or number from 1) of an input; more than once for more inputs. position and
    wind_apparent take two, and a unit given once holds for both: position=x,y:km is
    position=x:km,y:km. A position in deg is latitude and longitude: position=lat,lon:deg, as
    one without a unit whose columns have such names. speed_over_ground takes two where they
    are its components. Units: speeds m/s kn km/h ft/s mph, lengths m km ft nmi, angles rad
    deg, of a heading also compass (deg clockwise from north), shaft rad/s rpm rev/s, pitch
    ratio %% rad deg (default: the first of each); wind_apparent=AWS:kn,AWA:deg is speed and
    angle. shaft and pitch take up to four, one a shaft: shaft=port,starboard:rpm. A further
    log, speed or position: speed_through_water_2=COLUMN:kn, and so on to _3
--time COLUMN[:unit]
    column of the time: a date, or a count since 1970 or from the start of the test; units s ms
    us ns (default: s); DATE,TIME for a date and a time of day
--speed-unit UNIT
    unit of the speeds whose columns state none: m/s kn km/h ft/s mph
--date-order ORDER
    order of day and month in dates that leave it open: dmy, mdy or ymd
--zone ZONE
    time zone of dates that state none: +02:00 or Europe/Rome (default: UTC)
--where COLUMN=VALUE
    take only rows with this text in the column; more than once for more conditions
"""

# What cannot be read in a cell is counted by reason with its first lines; what can be read is
# written, plausible or not, for the monitor to judge.

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

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
from shipdrag_ros.sources.format import LIKELY, NO, POSSIBLE, RATE, Format, Head, Option
from shipdrag_ros.sources.formats.csv.cells import ORDERS, Bad, BadCell, combined, usable, zone_of
from shipdrag_ros.sources.formats.csv.guess import Guess
from shipdrag_ros.sources.formats.csv.table import (
    SPEED_UNITS,
    LogTable,
    TableRows,
    parse_time,
    role_and_unit,
)
from shipdrag_ros.sources.log import (
    ATTACHMENT,
    ImportResult,
    Log,
    Tally,
    Understood,
    out_of_order,
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
        """Say how much was read, and what is to be known of it."""
        first, *others = super().summary(bag)
        if self.base_ns is not None:
            since = f'The times count from a start; it was put at {display.utc(self.base_ns)}.'
            others = [since, *others]
        if self.left_out:
            others.append(f'{self.left_out} rows were not chosen by --where.')
        return [first, *others]


_FEW = 10
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
        record.take(rows)
    return record.result(log)


class _RowSamples:
    """Turns rows into samples and counts what becomes of them."""

    def __init__(self, table: LogTable, found: Guess, options: Mapping[str, Any]) -> None:
        self._table, self._found = table, found
        channels = [each for mapped in found.inputs for each in mapped.by_channel()]
        places = [table.columns(each.names) for each in channels]
        self._time_places = table.columns(() if found.time is None else found.time.names)
        self._where = [(table.column(name), text) for name, text in options.get('where', ())]
        self._clock = found.rows.clock(found.time, options.get('rate'))
        self._inputs = [*zip(channels, places, map(found.rows.readers, channels), strict=True)]
        self._left_out = 0
        self._tally = Tally()
        self._seen: dict[str, None] = {}  # a set that keeps the order
        # times (n,), values (n, m, 2) and whether one is known (n, m), of rows some at a time
        nothing = np.empty(0, np.int64), np.zeros((0, len(channels), 2))
        self._read = [(*nothing, np.ones((0, len(channels)), np.bool_))]

    def take(self, rows: TableRows) -> None:
        """Read some rows."""
        times, rows = self._timed(self._chosen(rows))
        n, m = len(rows), len(self._inputs)
        value, known = np.zeros((n, m, 2)), np.ones((n, m), np.bool_)
        for k, (columns, places, readers) in enumerate(self._inputs):
            bad: Bad = {}
            with np.errstate(over='ignore'):  # what is beyond any number is judged as infinite
                values = [
                    read.all(rows.columns[place], bad) * factor
                    for read, place, factor in zip(readers, places, columns.factors, strict=True)
                ]
            known[:, k] = self._usable(columns.channel.input, rows, bad)
            value[:, k, 0], value[:, k, 1] = combined(columns, values)
        self._read.append((times, value, known))

    def _chosen(self, rows: TableRows) -> TableRows:
        """Leave out rows without the texts that were asked for."""
        self._tally.records += len(rows)
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
            beyond = rows.beyond[rows.lines[place]]
            bad[place] = BadCell(f'more than {len(rows.columns)} columns', beyond)
        good = self._usable('time', rows, bad)
        return times[good], rows[good]

    def _usable(self, name: str, rows: TableRows, bad: Bad) -> NDArray[np.bool_]:
        """Count the cells that cannot be used; return (n,) whether one can."""
        for place, why in sorted(bad.items()):
            self._tally.reject(name, why.reason, why.cell, rows.lines[place])
        return usable(len(rows), bad)

    def result(self, log: Log) -> TableResult:
        """Write the samples into a log and sum up; ImportDataError if there are none."""
        table, tally = self._table, self._tally
        times, value, known = map(np.concatenate, zip(*self._read, strict=True))
        if not known.any():
            raise table.error(f' gave no sample from {tally.records} row(s); {self._why_not()}')
        row, which = np.nonzero(known)
        channel = np.array([columns.channel for columns, _, _ in self._inputs], np.uint8)
        unknown = np.full((len(row), 2), np.nan)
        arrived = _arrived(times)[row]
        log.take(Block(channel[which], times[row], arrived, value[row, which], unknown))
        written: Counter[str] = Counter()
        too_fast: dict[Channel, int] = {}
        for k, (columns, _, _) in enumerate(self._inputs):
            written[columns.channel.input] += int(np.sum(known[:, k]))
            if columns.channel.kind in _SPEEDS:
                fast = known[:, k] & (np.abs(value[:, k, 0]) > ABSURD_SPEED_M_S)
                too_fast[columns.channel] = int(np.sum(fast))
        backward, repeated = out_of_order(times)
        used = {place for _, places, _ in self._inputs for place in places}
        used.update(self._time_places)
        return TableResult(
            rows=tally.records,
            left_out=self._left_out,
            written=dict(+written),
            rejected=tally.rejected,
            start_ns=int(times[0]),
            end_ns=int(times.max()),
            base_ns=self._clock.base_ns,
            backward=backward,
            repeated=repeated,
            delimiter=table.delimiter,
            header=table.header is not None,
            understood=self._understood(log),
            notes=tuple(self._notes(written, too_fast)),
            not_used=tuple(
                table.key(place) for place in range(len(table.header or ())) if place not in used
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

    def _notes(self, written: Mapping[str, int], too_fast: Mapping[Channel, int]) -> Iterator[str]:
        yield from self._found.notes
        if self._table.titles:
            yield f'{len(self._table.titles)} line(s) above the table were left out.'
        if self._table.joined_lines:
            yield (
                f'{self._table.joined_lines} line(s) were taken as part of a cell in quotation '
                'marks; a mark that is not closed does that.'
            )
        yield from self._clock.notes
        for channel, count in too_fast.items():
            if count:
                yield (
                    f'{channel.input}: {count} of {written[channel.input]} values are above '
                    f'{ABSURD_SPEED_M_S:g} m/s, faster than any displacement ship; is the unit '
                    'right?'
                )
        yield from (f'Not used: {each}' for each in self._found.unclear)

    def _why_not(self) -> str:
        if self._left_out == self._tally.records and self._seen:
            return f'--where chooses none of them: the column holds {", ".join(self._seen)}'
        reasons = rejected_words(self._tally.rejected)
        if not reasons:
            return 'give a table with a line a sample'
        return (
            f'{"; ".join(reasons)}; expected numbers with a decimal point and without a unit, '
            'times in seconds or in the unit given'
        )


def _arrived(times: Int64) -> Int64:
    """
    Return arrivals (n,) that never go back, so that a replay sees the rows in their order.

    Where a clock was set back they go on with it: what follows has a time in the record.
    """
    arrived: Int64 = np.maximum.accumulate(times)
    if not np.any(times < arrived - BACKWARD_JUMP_NS):
        return arrived
    newest_ns = last_ns = int(times[0])
    set_back_ns = behind = 0
    for place, time_ns in enumerate(times.tolist()):
        clock_ns = time_ns + set_back_ns
        goes_on = last_ns < time_ns and clock_ns < newest_ns - BACKWARD_JUMP_NS
        behind, last_ns = behind + 1 if goes_on else 0, time_ns
        newest_ns = max(newest_ns, clock_ns)
        arrived[place] = newest_ns
        if behind == SET_BACK:  # the clock was set before the first of these
            since = slice(place - SET_BACK, place + 1)
            set_back_ns = int(arrived[place - SET_BACK - 1]) - int(times[since][0])
            arrived[since] = times[since] + set_back_ns
            newest_ns, behind = int(arrived[place]), 0
    return arrived


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
    read=lambda job, log: read_csv(LogTable(job.source), log, job.options, progress=job.progress),
    options=(
        Option('--map', 'INPUT=COLUMN[:unit]', many=True),
        Option('--time', 'COLUMN[:unit]', read=parse_time),
        RATE,
        Option('--speed-unit', 'UNIT', read=_one_of(tuple(SPEED_UNITS))),
        Option('--date-order', 'ORDER', read=_one_of(ORDERS)),
        Option('--zone', 'ZONE', read=zone_of),
        Option('--where', 'COLUMN=VALUE', read=_where, many=True),
    ),
    chosen_by='map',
    by_head=False,
)
