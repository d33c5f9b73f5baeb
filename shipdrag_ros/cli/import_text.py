# SPDX-License-Identifier: Apache-2.0
"""What became of an NMEA 0183 log, in words."""

from __future__ import annotations

from pathlib import Path

from shipdrag_ros.bags import NmeaResult
from shipdrag_ros.cli.output import Output
from shipdrag_ros.report import words
from shipdrag_ros.report.cells import Table


def show(output: Output, bag: Path, result: NmeaResult) -> None:
    """
    Print messages by input, and what was not used and why.
    """
    length_s = (result.end_ns - result.start_ns) * 1e-9
    output.say(
        f'{bag}: {sum(result.written.values())} messages of {result.sentences} sentences in '
        f'{result.lines} lines, {words.duration(length_s)}, from {words.utc(result.start_ns)}'
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
