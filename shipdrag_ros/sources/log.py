# SPDX-License-Identifier: Apache-2.0
"""What every format shares: what is read of a file, what is left out, and how that is said."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, tzinfo
from pathlib import Path
from typing import ClassVar

import numpy as np

from shipdrag_ros import display
from shipdrag_ros.bags.run import BATCH
from shipdrag_ros.bags.writer import BagWriter
from shipdrag_ros.display import Table
from shipdrag_ros.messages import EncodedMessage, input_type
from shipdrag_ros.nmea.sentences import fraction_ns
from shipdrag_ros.samples import (
    BACKWARD_JUMP_NS,
    SECOND_NS,
    SET_BACK,
    Block,
    Channel,
    Int64,
    kind_of,
)

LIMIT_NS = 2**31 * SECOND_NS
"""Of the stamp of a message."""

BASE_NS = 946_684_800 * SECOND_NS
"""2000-01-01, where times that are no dates begin."""

DATE_FROM_NS = 100_000_000 * SECOND_NS
"""A count of less, which is before March 1973, is no time since 1970."""

UNDATED = 'The log has no fix that gives the date; its times count from 2000-01-01.'

ATTACHMENT = 'import.yaml'
"""Where a bag says what it was made from."""

_BACK = (
    f', or begins again where {SET_BACK} in a row are more than '
    f'{BACKWARD_JUMP_NS // SECOND_NS} s back'
)
_FIRST_LINES = 3
_LISTED = 20  # kinds that are not used
_SHOWN = 40  # characters of a cell


@dataclass
class Rejected:
    """Cells or sentences rejected for one reason: how many, and the first of them."""

    count: int = 0
    first: list[str] = field(default_factory=list)

    def add(self, line: int, text: str) -> None:
        """Count one more."""
        self.count += 1
        if len(self.first) < _FIRST_LINES:
            shown = text if len(text) <= _SHOWN else f'{text[:_SHOWN]}...'
            self.first.append(f'line {line}: {shown!r}')


Refused = dict[str, dict[str, Rejected]]
"""What was rejected, by input, 'time' or 'line', and reason."""


@dataclass
class Tally:
    """
    What becomes of a file while it is read.

    Attributes
    ----------
    records
        Lines or messages read.
    rejected
        By input, 'time' or 'line', and reason.
    not_used
        Messages that state no input, by name.
    notes
        Sentences for the user.
    """

    records: int = 0
    rejected: Refused = field(default_factory=dict)
    not_used: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)

    def reject(self, name: str, reason: str, text: str, line: int | None = None) -> None:
        """Count what was rejected; it stands on the line, or is the last of the `records`."""
        reasons = self.rejected.setdefault(name, {})
        reasons.setdefault(reason, Rejected()).add(self.records if line is None else line, text)

    def note(self, text: str) -> None:
        """Keep a sentence for the user, once."""
        if text not in self.notes:
            self.notes.append(text)


@dataclass(frozen=True)
class Understood:
    """
    What an input was taken from.

    Attributes
    ----------
    input
    source
        Column, sentence or message.
    unit
        In which it stands there; '' where the format fixes it.
    first
        First value, in the unit of `Channel`.
    geodetic
        Whether it is a latitude and a longitude.
    """

    input: str
    source: str
    unit: str
    first: tuple[float, ...]
    geodetic: bool = False

    def __str__(self) -> str:
        unit = f' [{self.unit}]' if self.unit else ''
        values = ', '.join(f'{value:.6g}' for value in self.first)
        si = 'deg' if self.geodetic else _SI[kind_of(self.input)]
        return f'{self.input} <- {self.source}{unit}, first {values} {si}'


_SI = {
    'speed_through_water': 'm/s',
    'speed_over_ground': 'm/s',
    'position': 'm',
    'heading': 'rad (yaw)',
    'shaft': 'rad/s (pitch: ratio or rad)',
    'pitch': 'ratio or rad',
    'rudder': 'rad',
    'wind_apparent': 'm/s (forward, to port)',
    'depth': 'm',
}
_TWO_VALUES = (Channel.POSITION, Channel.POSITION_GEODETIC, Channel.WIND_APPARENT)


class Log:
    """
    What was read of a file, or of several: samples in memory, or messages as they stand in it.

    Attributes
    ----------
    block
        Samples in order of arrival, their variances unknown.
    messages
        Yields the messages of a file that holds messages and no samples, in order of arrival;
        None of others.
    counts
        Messages by topic and type.
    attachments
        Text by name.
    first
        First value of each channel, in its unit.
    span_ns
        First and last time of arrival [ns]; None without any.
    """

    def __init__(self) -> None:
        self.block = Block.empty()
        self.messages: Callable[[], Iterator[EncodedMessage]] | None = None
        self.counts: Counter[tuple[str, str]] = Counter()
        self.attachments: dict[str, str] = {}
        self.first: dict[Channel, tuple[float, ...]] = {}
        self.span_ns: tuple[int, int] | None = None

    def include(self, *received_ns: int) -> None:
        """Widen the span by times of arrival [ns]."""
        times = (*(self.span_ns or ()), *received_ns)
        self.span_ns = (min(times), max(times))

    def take(self, block: Block) -> None:
        """Take the samples of a file, in order of arrival."""
        self.block = block
        for number, place, count in zip(
            *np.unique(block.channel, return_index=True, return_counts=True), strict=True
        ):
            channel = Channel(number)
            values = block.value[place, : 2 if channel.kind in _TWO_VALUES else 1]
            self.first[channel] = tuple(values.tolist())
            self.counts[key_of(channel)] += int(count)
        if len(block):
            self.include(int(block.receive_ns[0]), int(block.receive_ns[-1]))

    def pieces(self) -> Iterator[Block]:
        """Yield the samples, as many at a time as are encoded together."""
        for first in range(0, len(self.block), BATCH):
            yield self.block[first : first + BATCH]

    def copy_to(self, bag: BagWriter) -> None:
        """
        Write all of it into a bag.

        Raises
        ------
        BagError
            If the disk does not take it.
        """
        for name, text in self.attachments.items():
            bag.attach(name, text)
        for block in self.pieces():
            bag.write_samples(block)
        for message in self.messages() if self.messages is not None else ():
            bag.put(message)


def key_of(channel: Channel) -> tuple[str, str]:
    """Return topic and type that samples of a channel have in a bag."""
    return f'/{channel.input}', input_type(channel)


_ISO = re.compile(
    r'(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d:\d\d)(?:[.,](\d{1,12}))?\s*(Z|[+-]\d\d:?\d\d)?'
)


def iso_ns(text: str, zone: tzinfo) -> int | None:
    """
    Return the time of ISO 8601 [ns since 1970], exactly; None where it is none.

    Parameters
    ----------
    text
    zone
        Of a time that states none.
    """
    found = _ISO.fullmatch(text)
    if found is None:
        return None
    try:
        moment = datetime.fromisoformat(f'{found[1]}T{found[2]}{found[4] or ""}')
        if moment.tzinfo is None:
            moment = moment.replace(tzinfo=zone)
        seconds = int(moment.timestamp())
    except (ValueError, OverflowError):
        return None
    time_ns = seconds * SECOND_NS + fraction_ns(found[3])
    return time_ns if 0 <= time_ns < LIMIT_NS else None


@dataclass(frozen=True, kw_only=True)
class ImportResult:
    """
    What became of a file.

    Attributes
    ----------
    written
        Samples by input.
    rejected
        By input, 'time' or 'line', and reason.
    start_ns, end_ns
        First and last time written [ns].
    backward, repeated
        Samples stamped before, or as, an earlier one of their input.
    understood
        What each input was taken from.
    notes
        What is to be known of it, a sentence each.
    sources
        What each input is taken from, in short.
    not_taken
        By input, values of the sources that it is not taken from.
    not_used
        What states no input, by name.
    """

    written: Mapping[str, int]
    rejected: Mapping[str, Mapping[str, Rejected]]
    start_ns: int
    end_ns: int
    backward: int = 0
    repeated: int = 0
    understood: tuple[Understood, ...] = ()
    notes: tuple[str, ...] = ()
    sources: Mapping[str, str] = field(default_factory=dict)
    not_taken: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    not_used: Mapping[str, int] | Sequence[str] = field(default_factory=dict)

    counted: ClassVar = ('messages', ' of their input')
    """What `backward` and `repeated` count."""
    unused: ClassVar = 'Not used'
    """What `not_used` lists."""

    @property
    def size(self) -> str:
        """What was read, `7 lines` for instance."""
        raise NotImplementedError

    def summary(self, bag: Path) -> list[str]:
        """Say how much was read, and what is to be known of it."""
        length_s = (self.end_ns - self.start_ns) * 1e-9
        lines = [
            f'{bag}: {sum(self.written.values())} messages of {self.size}, '
            f'{display.duration(length_s)}, from {display.utc(self.start_ns)}',
            *self.notes,
        ]
        what, of = self.counted
        counts = (
            (self.backward, 'are stamped before', _BACK),
            (self.repeated, 'have the stamp of', ''),
        )
        return lines + [
            f'{count} {what} {how} an earlier one{of}; a replay rejects those{unless}.'
            for count, how, unless in counts
            if count
        ]

    def told(self, path: Path, kind: str) -> list[str]:
        """
        Return what is to be said of a file: what each input was taken from, what was left out.
        """
        lines = [f'{path}: {kind}', *(f'  {each}' for each in self.understood)]
        return [*lines, *self.summary(path)[1:], *self.details()]

    def table(self) -> Table:
        """Return messages by input, and what each was taken from."""
        if not self.sources:
            rows = tuple((name, f'{n}') for name, n in self.written.items())
            return Table(('input', 'messages'), rows)
        return Table(
            ('input', 'from', 'messages'),
            tuple((name, self.sources[name], f'{n}') for name, n in self.written.items()),
        )

    def details(self) -> list[str]:
        """Say what was not used, and why."""
        lines = [
            f'{name}: not taken from {", ".join(f"{source} {n}" for source, n in counts.items())}'
            for name, counts in self.not_taken.items()
        ]
        unused = [f'{self.unused}: {most_of(self.not_used)}'] if self.not_used else []
        return lines + rejected_words(self.rejected) + unused


def out_of_order(stamp_ns: Int64) -> tuple[int, int]:
    """Return how many of (n,) times are before, and how many as, the latest one before them."""
    newest = np.maximum.accumulate(stamp_ns)[:-1]
    return int(np.sum(stamp_ns[1:] < newest)), int(np.sum(stamp_ns[1:] == newest))


def most_of(counts: Mapping[str, int] | Sequence[str]) -> str:
    """List the most frequent ones, with how often they are."""
    if not isinstance(counts, Mapping):
        return ', '.join(map(repr, counts))
    shown = sorted(counts.items(), key=lambda each: -each[1])
    more = f' and {len(shown) - _LISTED} more kinds' if len(shown) > _LISTED else ''
    return ', '.join(f'{name} {count}' for name, count in shown[:_LISTED]) + more


def rejected_words(rejected: Mapping[str, Mapping[str, Rejected]]) -> list[str]:
    """Say what was rejected, and why."""
    return [
        f'{name}: {each.count} rejected, {reason}: {", ".join(each.first)}'
        for name, reasons in rejected.items()
        for reason, each in reasons.items()
    ]
