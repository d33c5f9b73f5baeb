# SPDX-License-Identifier: Apache-2.0
"""`shipdrag import` of a table: its arguments, and what became of it in words."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path

from shipdrag_ros import display
from shipdrag_ros.cli.arguments import number
from shipdrag_ros.cli.log_format import LogFormat
from shipdrag_ros.cli.output import Output
from shipdrag_ros.display import Table
from shipdrag_ros.importing.formats.csv.columns import parse_input, parse_time
from shipdrag_ros.importing.formats.csv.importer import ImportResult, import_csv


def _add_csv(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        '--map',
        action='append',
        default=[],
        metavar='INPUT=COLUMN[:unit]',
        help='column (name, or number from 1) of an input; more than once for more inputs. '
        'position and wind_apparent take two, and a unit given once holds for both: '
        'position=x,y:km is position=x:km,y:km. A position in deg is latitude and longitude: '
        'position=lat,lon:deg. Units: speeds m/s kn km/h ft/s, lengths m km ft nmi, angles rad '
        'deg, shaft rad/s rpm rev/s, pitch ratio %% rad deg (default: the first of each). '
        'shaft and pitch take up to four, one a shaft: shaft=port,starboard:rpm',
    )
    times = group.add_mutually_exclusive_group()
    times.add_argument(
        '--time',
        metavar='COLUMN[:unit]',
        help='column of the time, as a date since 1970 or from the start of the test; units s '
        'ms us ns (default: s)',
    )
    times.add_argument(
        '--rate',
        type=number(0.0, unit='Hz', above=True),
        metavar='HZ',
        help='without a time column: rows a second [Hz]',
    )
    group.add_argument(
        '--where',
        action='append',
        default=[],
        type=_where,
        metavar='COLUMN=VALUE',
        help='take only rows with this text in the column; more than once for more conditions',
    )


def _missing(options: argparse.Namespace) -> str:
    if options.time is None and options.rate is None:
        return 'one of the arguments --time --rate is required with --map'
    return ''


def _write(
    options: argparse.Namespace,
    attachments: Mapping[str, str],
    progress: Callable[[int, int], None],
) -> ImportResult:
    return import_csv(
        options.source,
        options.out,
        inputs=[parse_input(text) for text in options.map],
        time=None if options.time is None else parse_time(options.time),
        rate_hz=options.rate,
        where=options.where,
        attachments=attachments,
        progress=progress,
    )


def _show(output: Output, bag: Path, result: ImportResult) -> None:
    length_s = (result.end_ns - result.start_ns) * 1e-9
    output.say(
        f'{bag}: {sum(result.written.values())} messages of {result.rows - result.left_out} rows, '
        f'{display.duration(length_s)}, from {display.utc(result.start_ns)}'
    )
    if result.base_ns is not None:
        output.say(f'The times count from a start; it was put at {display.utc(result.base_ns)}.')
    if result.left_out:
        output.say(f'{result.left_out} rows were not chosen by --where.')
    if result.backward:
        output.say(
            f'In {result.backward} rows the time is before that of an earlier row; a replay '
            'rejects those.'
        )
    if result.repeated:
        output.say(
            f'In {result.repeated} rows the time is that of an earlier row; a replay rejects '
            'those.'
        )
    output.table(
        Table(('input', 'messages'), tuple((name, f'{n}') for name, n in result.written.items()))
    )
    for name, reasons in result.rejected.items():
        for reason, rejected in reasons.items():
            output.say(
                f'{name}: {rejected.count} cell(s) rejected, {reason}: {", ".join(rejected.first)}'
            )


def _where(text: str) -> tuple[str, str]:
    column, equals, value = text.partition('=')
    if not (column and equals):
        raise argparse.ArgumentTypeError(f'{text!r}, expected COLUMN=VALUE')
    return column, value


FORMAT = LogFormat(
    title='CSV',
    kind='a CSV file',
    chosen_by='--map',
    arguments={'--time': 'time', '--rate': 'rate', '--where': 'where'},
    add_arguments=_add_csv,
    missing=_missing,
    write=_write,
    show=_show,
)
