# SPDX-License-Identifier: Apache-2.0
"""`shipdrag import` of an NMEA 0183 log: its arguments, and what became of it in words."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from datetime import date
from pathlib import Path

from shipdrag_ros import display
from shipdrag_ros.cli.arguments import number
from shipdrag_ros.cli.log_format import LogFormat
from shipdrag_ros.cli.output import Output
from shipdrag_ros.display import Table
from shipdrag_ros.importing.formats.nmea.importer import NmeaResult, import_nmea
from shipdrag_ros.nmea.framing import Checksum


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


def _write(
    options: argparse.Namespace,
    attachments: Mapping[str, str],
    progress: Callable[[int, int], None],
) -> NmeaResult:
    return import_nmea(
        options.source,
        options.out,
        day=options.date,
        transducer_m=options.transducer,
        checksum=options.checksum or Checksum.REQUIRED,
        attachments=attachments,
        progress=progress,
    )


def _show(output: Output, bag: Path, result: NmeaResult) -> None:
    """Print messages by input, and what was not used and why."""
    length_s = (result.end_ns - result.start_ns) * 1e-9
    output.say(
        f'{bag}: {sum(result.written.values())} messages of {result.sentences} sentences in '
        f'{result.lines} lines, {display.duration(length_s)}, from {display.utc(result.start_ns)}'
    )
    if result.damage:
        output.say(f'The log could not be read to its end, {result.damage}; this is what is left.')
    if result.shift_days:
        output.say(
            f'All dates were shifted by {result.shift_days} days, whole cycles of the GPS week.'
        )
    if result.dates_put_right:
        output.say(f'{result.dates_put_right} date(s) were a day off at midnight and put right.')
    if result.magnetic_heading:
        output.say(
            'The heading is MAGNETIC, as the log states no variation: good for finding turns, '
            'not for directions over ground.'
        )
    if result.backward:
        output.say(
            f'{result.backward} messages are stamped before an earlier one of their input; a '
            'replay rejects those.'
        )
    if result.repeated:
        output.say(
            f'{result.repeated} messages have the stamp of an earlier one of their input; a '
            'replay rejects those.'
        )
    output.say(
        'The log is attached to the bag.'
        if result.log_attached
        else 'The log is NOT attached to the bag (too long, damaged or no UTF-8): keep it.'
    )
    output.table(
        Table(
            ('input', 'from', 'messages'),
            tuple((name, result.sources[name], f'{n}') for name, n in result.written.items()),
        )
    )
    for name, counts in result.not_taken.items():
        others = ', '.join(f'{source} {count}' for source, count in counts.items())
        output.say(f'{name}: not taken from {others}')
    for name, reasons in result.rejected.items():
        for reason, rejected in reasons.items():
            output.say(f'{name}: {rejected.count} rejected, {reason}: {rejected.first[0]}')
    if result.not_used:
        others = ', '.join(f'{address} {count}' for address, count in result.not_used.items())
        output.say(f'Sentences not used: {others}')
    if result.unknown_talkers:
        names = ', '.join(f'{name} {count}' for name, count in result.unknown_talkers.items())
        output.say(f'Talkers that NMEA 0183 does not know: {names}')


def _date(text: str) -> date:
    try:
        return date.fromisoformat(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r}, expected YYYY-MM-DD') from None


FORMAT = LogFormat(
    title='NMEA 0183',
    kind='an NMEA 0183 log',
    chosen_by='',
    arguments={'--date': 'date', '--transducer': 'transducer', '--no-checksum': 'checksum'},
    add_arguments=_add_nmea,
    missing=lambda options: '',
    write=_write,
    show=_show,
)
