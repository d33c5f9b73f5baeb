# SPDX-License-Identifier: Apache-2.0
"""Events of a ship that someone wrote down: `events.csv` beside her ship file."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from io import StringIO

KINDS = ('cleaning', 'docking', 'propeller_polish', 'coating')
HEADER = ('date', 'kind', 'note')
_EARLIEST, _LATEST = 1900, 2200
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
        Of the file, an event a line; a header is not needed.

    Returns
    -------
    events, problems
        In the order of time, each once; and of each line that is left out, why.
    """
    events: set[HullEvent] = set()
    problems: list[str] = []
    # a line at a time: a quote that is not closed must not swallow the lines after it
    for number, line in enumerate(map(str.strip, text.splitlines()), start=1):
        try:
            event = None if not line or line.startswith('#') else _read_line(line)
        except ValueError as error:
            problems.append(f'events.csv line {number} is left out: {error}')
        else:
            events |= {event} if event else set()
    return tuple(sorted(events)), tuple(problems)


def _read_line(line: str) -> HullEvent | None:
    """Return the event of a line; None for a header and for empty cells."""
    try:
        [cells] = csv.reader([line], strict=True)
    except csv.Error as error:
        raise ValueError(
            f'{line[:_AROUND]!r}: {error}; write a note as "a note", a quote inside it twice'
        ) from error
    date, kind, *note = (cell.strip() for cell in (*cells, '')[: max(len(cells), 2)])
    if not any((date, kind, *note)) or date.lower() == HEADER[0]:
        return None
    try:
        moment = datetime.fromisoformat(date)
    except ValueError:
        raise ValueError(f'{date[:_AROUND]!r}, expected a date as 2026-03-01') from None
    kind = kind.lower()
    if kind not in KINDS:
        raise ValueError(f'{kind[:_AROUND]!r}, expected one of {", ".join(KINDS)}')
    if not _EARLIEST <= moment.year <= _LATEST:
        raise ValueError(f'{date[:_AROUND]!r}, expected a year from {_EARLIEST} to {_LATEST}')
    utc = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return HullEvent(round(utc.timestamp()) * 1_000_000_000, kind, ','.join(note))


def write_events(events: Sequence[HullEvent]) -> str:
    """
    Return the text that `read_events` reads back.
    """
    text = StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(HEADER)
    for event in events:
        moment = datetime.fromtimestamp(event.time_ns // 1_000_000_000, UTC)
        date = f'{moment:%Y-%m-%dT%H:%M:%SZ}'
        writer.writerow((date, event.kind, *([event.note] if event.note else [])))
    return text.getvalue()
