# SPDX-License-Identifier: Apache-2.0
"""Known events of a ship: what `events.csv` beside its ship file tells."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

KINDS = ('cleaning', 'docking', 'propeller_polish', 'coating')
_HEAD = ['date', 'kind']
_NS = 1_000_000_000


@dataclass(frozen=True)
class KnownEvent:
    """
    Something that was done to the hull, by the log book.

    Attributes
    ----------
    time_ns
        When, ns since the epoch; a date alone is its noon in UTC.
    kind
        One of `KINDS`.
    note
        Free text.
    """

    time_ns: int
    kind: str
    note: str = ''


def read_events(text: str) -> tuple[list[KnownEvent], list[str]]:
    """
    Read the text of an `events.csv`.

    Parameters
    ----------
    text
        Lines of `date,kind[,note]`, dates in ISO 8601, with that head line.

    Returns
    -------
    events, problems
        In the order of time; and what could not be read, a sentence each.

    Examples
    --------
    >>> from shipdrag_ros.trend.log_book import read_events
    >>> events, problems = read_events('date,kind,note\\n2025-03-01,cleaning,divers\\n')
    >>> events[0].kind, problems
    ('cleaning', [])
    """
    rows = list(csv.reader(io.StringIO(text.removeprefix('\ufeff'))))
    rows = [[cell.strip() for cell in row] for row in rows if any(cell.strip() for cell in row)]
    if not rows:
        return [], []
    if [cell.lower() for cell in rows[0][:2]] != _HEAD:
        return [], [f'its first line is {",".join(rows[0])!r}, expected date,kind[,note]']
    events: list[KnownEvent] = []
    problems: list[str] = []
    for number, row in enumerate(rows[1:], start=2):
        read = _event(row)
        if isinstance(read, str):
            problems.append(f'line {number}: {read}; it is left out')
        else:
            events.append(read)
    return sorted(events, key=lambda event: event.time_ns), problems


def _event(row: Sequence[str]) -> KnownEvent | str:
    """Return the event of a line, or what is wrong with it."""
    if len(row) < 2:
        return f'{",".join(row)!r} has no kind'
    if row[1] not in KINDS:
        return f'kind {row[1]!r} is none of {", ".join(KINDS)}'
    try:
        moment = datetime.fromisoformat(row[0])
    except ValueError:
        return f'{row[0]!r} is no date of ISO 8601, 2025-03-01 for instance'
    if len(row[0]) <= 10:
        moment = moment.replace(hour=12)
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    return KnownEvent(round(moment.timestamp()) * _NS, row[1], ','.join(row[2:]))
