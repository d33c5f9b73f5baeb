# SPDX-License-Identifier: Apache-2.0
"""Tables as a format of `shipdrag import`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.progress import PartDone
from shipdrag_ros.sources.format import LIKELY, NO, POSSIBLE, RATE, Format, Head, Job, Option
from shipdrag_ros.sources.formats.csv.cells import (
    ORDERS,
    zone_of,
)
from shipdrag_ros.sources.formats.csv.columns import (
    SPEED_UNITS,
    parse_input,
    parse_time,
    role_and_unit,
)
from shipdrag_ros.sources.formats.csv.guess import (
    FirstRows,
    Guess,
    guess,
    guessed_time,
    is_table,
    with_dates,
)
from shipdrag_ros.sources.formats.csv.importer import TableColumns, TableResult, read_csv
from shipdrag_ros.sources.log import Log
from shipdrag_ros.sources.table import LogTable


def _score(head: Head) -> float:
    if not head.lines or head.lines[0][0] in '{<[' or not is_table(head.path):
        return NO
    names = LogTable(head.path).header or ()
    return LIKELY if any(role_and_unit(name)[0] for name in names) else POSSIBLE


def _open(job: Job, log: Log) -> TableResult:
    return read_table(LogTable(job.source), log, job.options, progress=job.progress)


def read_table(
    table: LogTable, log: Log, options: Mapping[str, Any], *, progress: PartDone | None = None
) -> TableResult:
    """
    Read a table by its options, and what they leave open by its names and values.

    Raises
    ------
    ImportDataError
        If nothing that moves has a known unit, or the options do not go together.
    """
    time, rate = options.get('time'), options.get('rate')
    if time is not None and rate is not None:
        raise ImportDataError('--time and --rate: both give the times of the rows; keep one')
    time = with_dates(time, options.get('date_order', ''), options.get('zone'))
    found = _inputs(table, time, options)
    time = with_dates(found.time, options.get('date_order', ''), options.get('zone'))
    result = read_csv(
        table,
        log,
        TableColumns(found.inputs, time, rate, options.get('where', ())),
        progress=progress,
    )
    doubts = tuple(f'Not used: {each}' for each in found.unclear)
    return replace(result, notes=(*found.notes, *result.notes, *doubts))


def _inputs(table: LogTable, time: Any, options: Any) -> Guess:
    """Return the columns that were given, or else those that are guessed."""
    counted = options.get('rate') is not None
    mapped = options.get('map', ())
    if not mapped:
        speed_unit = options.get('speed_unit', '')
        return guess(table, time=time, counted=counted, speed_unit=speed_unit)
    found = Guess([parse_input(text) for text in mapped], time)
    if time is None and not counted:
        if table.header is None:
            raise ImportDataError('the times of the rows: give --time COLUMN[:unit] or --rate HZ')
        found.time = guessed_time(FirstRows(table), found.notes)
    return found


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
    about='Tables separated by comma, semicolon, tab, bar or blanks, with titles above, units '
    'below the header, decimal commas, dates, coordinates as 4530.20N. Columns are known by '
    'their usual names (STW SOG HDG Lat Lon RPM AWS AWA ...) where their unit is stated or can '
    'be worked out; other columns are listed and not used. With --map these columns alone are '
    'taken.',
    score=_score,
    read=_open,
    options=(
        Option(
            '--map',
            'INPUT=COLUMN[:unit]',
            'column (name, or number from 1) of an input; more than once for more inputs. '
            'position and wind_apparent take two, and a unit given once holds for both: '
            'position=x,y:km is position=x:km,y:km. A position in deg is latitude and longitude: '
            'position=lat,lon:deg. speed_over_ground takes two where they are its components. '
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
