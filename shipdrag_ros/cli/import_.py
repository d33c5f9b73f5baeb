# SPDX-License-Identifier: Apache-2.0
"""`shipdrag import`: a log or a table of measurements as a bag."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from datetime import date
from pathlib import Path

from shipdrag_ros.bags import (
    Checksum,
    ImportResult,
    NmeaResult,
    import_csv,
    import_nmea,
    parse_input,
    parse_time,
)
from shipdrag_ros.cli import import_text
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
        'Write the measurements of an NMEA 0183 log, or with --map of a CSV file, as a bag for '
        'replay. What a sentence or a cell holds is never mended: what cannot be read is counted '
        'and told.'
    )
    parser.add_argument(
        'source', type=Path, metavar='SOURCE', help='NMEA 0183 log, also as .gz, or CSV file'
    )
    parser.add_argument(
        '-o',
        '--out',
        required=True,
        type=Path,
        metavar='BAG',
        help='MCAP file to make; an existing one is not overwritten',
    )
    parser.add_argument(
        '--ship',
        type=Path,
        metavar='FILE',
        help='ship file (YAML) to attach, so that replay needs no --ship',
    )
    add_json(parser)
    _add_nmea(parser.add_argument_group('NMEA 0183'))
    _add_csv(parser.add_argument_group('CSV'))
    parser.set_defaults(misused=parser.error)


def _add_nmea(group: argparse._ArgumentGroup) -> None:
    group.description = (
        'Of VHW VBW VTG RMC GGA GLL HDT HDG RPM MWV DPT DBT RSA ZDA, each input is taken from '
        'one talker; of RPM, up to four shafts (numbers 0 to 4) and their pitch. A sentence '
        'without a time has that of the last one with a time; where the logger wrote the time of '
        'receipt before each line, the time since is added.'
    )
    group.add_argument(
        '--date',
        type=_date,
        metavar='YYYY-MM-DD',
        help='date (UTC) of the first time, for a log that has only times of day, or one that '
        'is whole cycles of the GPS week (1024 weeks) early',
    )
    group.add_argument(
        '--transducer',
        type=number(0.0, unit='m'),
        metavar='M',
        help='depth of the echo sounder below the surface, where the log does not tell it [m]',
    )
    group.add_argument(
        '--no-checksum',
        action='store_const',
        const=Checksum.OPTIONAL,
        dest='checksum',
        help='take sentences without a checksum too; one that is there must be right',
    )


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


def run(options: argparse.Namespace) -> int:
    """
    Write the bag and tell what became of the source.
    """
    _check_use(options)
    output = Output(options.json)
    attachments = {}
    if options.ship is not None:
        attachments['ship.yaml'] = Ship.load(options.ship).to_yaml()
    result: ImportResult | NmeaResult
    with output.progress(f'reading {options.source}') as progress:
        if options.map:
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
        else:
            result = import_nmea(
                options.source,
                options.out,
                day=options.date,
                transducer_m=options.transducer,
                checksum=options.checksum or Checksum.REQUIRED,
                attachments=attachments,
                progress=progress,
            )
    if isinstance(result, ImportResult):
        _show(output, options.out, result)
    else:
        import_text.show(output, options.out, result)
    output.json({'bag': str(options.out), **asdict(result)})
    return 0


def _check_use(options: argparse.Namespace) -> None:
    """Refuse what the kind of source does not know."""
    of_csv = {'--time': options.time, '--rate': options.rate, '--where': options.where or None}
    of_nmea = {
        '--date': options.date,
        '--transducer': options.transducer,
        '--no-checksum': options.checksum,
    }
    if options.map:
        if options.time is None and options.rate is None:
            options.misused('one of the arguments --time --rate is required with --map')
        others, kind = of_nmea, 'an NMEA 0183 log, not of a CSV file (--map)'
    else:
        others, kind = of_csv, 'a CSV file, which requires --map'
    for name, value in others.items():
        if value is not None:
            options.misused(f'argument {name}: of {kind}')


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


def _date(text: str) -> date:
    try:
        return date.fromisoformat(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r}, expected YYYY-MM-DD') from None
