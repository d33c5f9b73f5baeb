# SPDX-License-Identifier: Apache-2.0
"""`shipdrag import`: a table of measurements as a bag."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from shipdrag_ros.bags import ImportResult, import_csv, parse_input, parse_time
from shipdrag_ros.cli.arguments import add_json, number
from shipdrag_ros.cli.output import Output
from shipdrag_ros.report import words
from shipdrag_ros.report.cells import Table
from shipdrag_ros.ship import Ship


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.description = (
        'Write the measurements of a CSV file as a bag for replay. What a cell holds is never '
        'mended: what is no number is counted and told.'
    )
    parser.add_argument('source', type=Path, metavar='SOURCE', help='CSV file')
    parser.add_argument(
        '-o',
        '--out',
        required=True,
        type=Path,
        metavar='BAG',
        help='MCAP file to make; an existing one is not overwritten',
    )
    parser.add_argument(
        '--map',
        action='append',
        required=True,
        metavar='INPUT=COLUMN[:unit]',
        help='column (name, or number from 1) of an input; more than once for more inputs. '
        'position and wind_apparent take two: position=x,y:km, and in deg a position is latitude '
        'and longitude. Units: speeds m/s kn km/h ft/s, lengths m km ft nmi, angles rad deg, '
        'shaft rad/s rpm (default: the first of each)',
    )
    times = parser.add_mutually_exclusive_group(required=True)
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
    parser.add_argument(
        '--where',
        action='append',
        default=[],
        type=_where,
        metavar='COLUMN=VALUE',
        help='take only rows with this text in the column; more than once for more conditions',
    )
    parser.add_argument(
        '--ship',
        type=Path,
        metavar='FILE',
        help='ship file (YAML) to attach, so that replay needs no --ship',
    )
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """
    Write the bag and tell what became of the table.
    """
    output = Output(options.json)
    attachments = {}
    if options.ship is not None:
        attachments['ship.yaml'] = Ship.load(options.ship).to_yaml()
    with output.progress(f'reading {options.source}') as progress:
        result = import_csv(
            options.source,
            options.out,
            inputs=[parse_input(text) for text in options.map],
            time=None if options.time is None else parse_time(options.time),
            rate_hz=options.rate,
            where=options.where,
            attachments=attachments,
            progress=progress,
        )
    _show(output, options.out, result)
    output.json({'bag': str(options.out), **asdict(result)})
    return 0


def _show(output: Output, bag: Path, result: ImportResult) -> None:
    length_s = (result.end_ns - result.start_ns) * 1e-9
    output.say(
        f'{bag}: {sum(result.written.values())} messages of {result.rows - result.left_out} rows, '
        f'{words.duration(length_s)}, from {words.utc(result.start_ns)}'
    )
    if result.base_ns is not None:
        output.say(f'The times count from a start; it was put at {words.utc(result.base_ns)}.')
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
