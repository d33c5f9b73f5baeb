# SPDX-License-Identifier: Apache-2.0
"""Events of a ship that someone wrote down: `events.csv` beside her ship file."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

KINDS = ('cleaning', 'docking', 'propeller_polish', 'coating')
HEADER = ('date', 'kind', 'note')
_EARLIEST, _LATEST = 1900, 2200
_LONGEST = 10_000  # characters of a line
_AROUND = 60  # characters shown of what is wrong


@dataclass(frozen=True, order=True)
class HullEvent:
    """
    Something that was done to a hull.

    Attributes
    ----------
    time_ns
        [ns since the epoch]; of a date alone, its start in UTC.
    kind
        One of `KINDS`.
    note
        What else was written.
    """

    time_ns: int
    kind: str
    note: str = ''


def read_events(text: str) -> tuple[tuple[HullEvent, ...], tuple[str, ...]]:
    """
    Read `date,kind[,note]`.

    Parameters
    ----------
    text
        Of the file; a header is not needed.

    Returns
    -------
    events, problems
        In the order of time, each once; and of each line that is left out, why.
    """
    events: set[HullEvent] = set()
    problems: list[str] = []
    # a line too long for the module csv is cut: no note needs as much
    reader = csv.reader(line[:_LONGEST] for line in text.splitlines())
    for cells in reader:
        row = [cell.strip() for cell in cells]
        if not any(row) or row[0].startswith('#') or row[0].lower() == HEADER[0]:
            continue
        date, kind = row[0], row[1].lower() if len(row) > 1 else ''
        place = f'events.csv line {reader.line_num}'
        try:
            moment = datetime.fromisoformat(date)
        except ValueError:
            problems.append(
                f'{place} is left out: {date[:_AROUND]!r}, expected a date as 2026-03-01'
            )
            continue
        if kind not in KINDS:
            problems.append(
                f'{place} is left out: {kind[:_AROUND]!r}, expected one of {", ".join(KINDS)}'
            )
            continue
        utc = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
        if not _EARLIEST <= moment.year <= _LATEST:
            problems.append(
                f'{place} is left out: {date[:_AROUND]!r}, expected a year from {_EARLIEST} to '
                f'{_LATEST}'
            )
            continue
        seconds = round(utc.timestamp())
        events.add(HullEvent(seconds * 1_000_000_000, kind, ','.join(row[2:])))
    return tuple(sorted(events)), tuple(problems)


def write_events(events: Sequence[HullEvent]) -> str:
    """
    Return the text that `read_events` reads back.
    """
    lines = [','.join(HEADER)]
    for event in events:
        moment = datetime.fromtimestamp(event.time_ns // 1_000_000_000, UTC)
        cells = (moment.strftime('%Y-%m-%dT%H:%M:%SZ'), event.kind, event.note)
        lines.append(','.join(cells).rstrip(','))
    return '\n'.join(lines) + '\n'
