# SPDX-License-Identifier: Apache-2.0
"""
A log of messages, each with its time.

What every format of messages shares: one source an input, times that do not
jump, and a count of what is left out. A format is a module with a function that reads its
file and yields readings, declared by `stream_format`.
"""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from math import cos, isfinite, pi, remainder, sin
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros import strict_yaml
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.nmea.sentences import best
from shipdrag_ros.samples import INPUTS, SECOND_NS, Block, Channel, Int64, UInt8
from shipdrag_ros.sources.format import Format, Head, Job, Lines, Option
from shipdrag_ros.sources.log import (
    ATTACHMENT,
    LIMIT_NS,
    ImportResult,
    Log,
    Tally,
    Understood,
    most_of,
    out_of_order,
    rejected_words,
)

JUMP_NS = 10 * SECOND_NS
"""A time that steps further forward, and back with the next one, is a damaged one."""

_HELD = 4096  # readings of one moment that are held until the next moment is known
_LARGEST = {
    Channel.SPEED_THROUGH_WATER: 1e3,
    Channel.SPEED_OVER_GROUND: 1e3,
    Channel.WIND_APPARENT: 1e3,
    Channel.POSITION: 1e9,
    Channel.POSITION_GEODETIC: 360.0,
    Channel.DEPTH: 2e4,
}


class Origin(NamedTuple):
    """Who sends an input; of two with as many values the smaller is the better."""

    rank: int
    name: str
    unit: str = ''

    def __str__(self) -> str:
        return self.name


class Reading(NamedTuple):
    """A value, in the unit of its channel, and when it was measured."""

    channel: Channel
    origin: Origin
    stamp_ns: int
    a: float
    b: float = 0.0


def yaw(compass: float) -> float:
    """Return REP-103 yaw [rad] of an angle clockwise from north [rad]; what is none stays none."""
    angle = pi / 2.0 - compass
    return remainder(angle, 2.0 * pi) if isfinite(angle) else angle


def wind(speed: float, angle: float) -> tuple[float, float]:
    """
    Return the velocity forward and to port of a wind that comes from an angle off the bow [rad].
    """
    return -speed * cos(angle), speed * sin(angle)


FileReader = Callable[[Tally], Iterator[Reading]]


@dataclass(frozen=True, kw_only=True)
class StreamResult(ImportResult):
    """
    What became of a log of messages.

    Attributes
    ----------
    format
    records
        Lines or messages in it.
    """

    format: str
    records: int

    @property
    def size(self) -> str:
        """What was read."""
        return f'{self.records} records'


class SourcedValues:
    """
    Values with who sends them, from which one source an input is chosen in the end.

    Attributes
    ----------
    at
        Where each stands, or when it was measured, as it was added.
    a, b
        The values.
    """

    def __init__(self) -> None:
        self.at, self.a, self.b = array('q'), array('d'), array('d')
        self._source = array('i')
        self._numbers: dict[tuple[Channel, Any], int] = {}

    def add(self, channel: Channel, origin: Any, at: int, a: float, b: float) -> None:
        """Take one more."""
        self._source.append(self._numbers.setdefault((channel, origin), len(self._numbers)))
        self.at.append(at)
        self.a.append(a)
        self.b.append(b)

    def counts(self) -> dict[Channel, Counter[Any]]:
        """Return the number of values by source, of each channel."""
        found: dict[Channel, Counter[Any]] = {}
        counts = np.bincount(np.array(self._source), minlength=len(self._numbers)).tolist()
        for (channel, origin), number in zip(self._numbers, counts, strict=True):
            found.setdefault(channel, Counter())[origin] = number
        return dict(sorted(found.items()))

    def chosen(self) -> dict[Channel, Any]:
        """Return the one source of each channel."""
        return {channel: best(each) for channel, each in self.counts().items()}

    def taken(self) -> tuple[NDArray[np.intp], UInt8]:
        """Return the places (n,) of the values of the chosen sources, and their channels."""
        chosen, source = self.chosen(), np.array(self._source, np.intp)
        use = np.array([chosen[c] == each for c, each in self._numbers], np.bool_)
        code = np.array([channel for channel, _ in self._numbers], np.uint8)
        place = np.flatnonzero(use[source])
        return place, code[source[place]]

    def block(self, place: NDArray[np.intp], code: UInt8, stamp_ns: Int64) -> Block:
        """
        Return samples (n,) whose arrival never goes back, so that a replay has their order.

        Parameters
        ----------
        place, code : (n,)
            Of those that `taken` gives.
        stamp_ns : (n,)
        """
        value = np.column_stack((np.array(self.a)[place], np.array(self.b)[place]))
        arrived = np.maximum.accumulate(stamp_ns)
        return Block(code, stamp_ns, arrived, value, np.full(value.shape, np.nan))

    def about(self, block: Block, log: Log) -> dict[str, Any]:
        """
        Write samples into a log; return what `ImportResult` says of them.

        Parameters
        ----------
        block
            From `block`, with one sample at least.
        log
        """
        log.take(block)
        chosen = self.chosen()
        sources: dict[str, dict[str, None]] = {}
        not_taken: dict[str, Counter[str]] = {}
        for channel, counts in self.counts().items():
            sources.setdefault(channel.input, {})[str(chosen[channel])] = None
            others = {str(each): n for each, n in counts.items() if each != chosen[channel]}
            if others:
                not_taken.setdefault(channel.input, Counter()).update(others)
        stamps = [block.stamp_ns[block.channel == code] for code in np.unique(block.channel)]
        backward, repeated = map(sum, zip(*map(out_of_order, stamps), strict=True))
        written: Counter[str] = Counter()
        for (topic, _), count in log.counts.items():
            written[topic[1:]] += count
        return {
            'written': {name: written[name] for name in INPUTS if written[name]},
            'sources': {name: ', '.join(each) for name, each in sources.items()},
            'not_taken': {name: dict(counts) for name, counts in not_taken.items()},
            'start_ns': int(block.stamp_ns[0]),
            'end_ns': int(block.receive_ns[-1]),
            'backward': backward,
            'repeated': repeated,
            'understood': tuple(
                Understood(
                    channel.input,
                    str(chosen[channel]),
                    getattr(chosen[channel], 'unit', ''),
                    first,
                    geodetic=channel is Channel.POSITION_GEODETIC,
                )
                for channel, first in sorted(log.first.items())
            ),
        }


def read_stream(
    job: Job, log: Log, name: str, read: FileReader, *, about: Mapping[str, object] | None = None
) -> StreamResult:
    """
    Take what a reader yields.

    Parameters
    ----------
    job
    log
        Where to.
    name
        Of the format.
    read
        Yields the readings of the file in their order.
    about
        Said of it besides.

    Raises
    ------
    ImportDataError
        If nothing in it has a value and a time.

    Notes
    -----
    Each input is taken from one source, the best ranked of those with at least
    half as many values as the most frequent.
    """
    tally = Tally()
    values = SourcedValues()
    for channel, origin, stamp_ns, a, b in _checked(read(tally), tally):
        values.add(channel, origin, stamp_ns, a, b)
    if not len(values.at):
        raise ImportDataError(_nothing(job.source, name, tally))
    place, code = values.taken()
    block = values.block(place, code, np.array(values.at)[place])
    result = StreamResult(
        format=name,
        records=tally.records,
        rejected=tally.rejected,
        not_used=dict(tally.not_used),
        notes=tuple(tally.notes),
        **values.about(block, log),
    )
    about_log = {'source': job.source.name, **(about or {}), **asdict(result)}
    log.attachments[ATTACHMENT] = strict_yaml.dump(about_log)
    return result


def stream_format(
    *,
    name: str,
    kind: str,
    about: str | None,
    score: Callable[[Head], float],
    read: Callable[[Job, Tally], Iterator[Reading]],
    options: tuple[Option, ...] = (),
) -> Format:
    """
    Declare a format of messages.

    Parameters
    ----------
    name, kind, about, score, options
        See `Format`.
    read
        Yields the readings of a file in their order.
    """

    def into(job: Job, log: Log) -> StreamResult:
        given = {option.key: job.options.get(option.key) for option in options}
        return read_stream(job, log, name, partial(read, job), about=given)

    return Format(name, kind, about, score, into, options)


def counted(lines: Lines, tally: Tally) -> Iterator[str]:
    """Yield the lines of a log that are not blank, and count all."""
    for line in lines:
        tally.records += 1
        if line:
            yield line
    if lines.damage:
        tally.note(f'The log could not be read to its end, {lines.damage}.')


def _checked(readings: Iterator[Reading], tally: Tally) -> Iterator[Reading]:
    """
    Leave out values that cannot be, and times that jump away and back again.

    What stands after a step of the time is held until the next one shows whether it was one.
    """
    held: list[Reading] = []
    last_ns: int | None = None
    sparse = False  # whether such steps are usual here

    def drop() -> None:
        for each in held:
            tally.reject('time', 'jumps away and back', f'{each.stamp_ns} ns')
        held.clear()

    for reading in readings:
        stamp_ns = reading.stamp_ns
        if not _possible(reading):
            tally.reject(reading.channel.input, 'no possible value', f'{reading.a}, {reading.b}')
            continue
        if not 0 < stamp_ns < LIMIT_NS:
            tally.reject('time', 'no possible date', str(stamp_ns))
            continue
        goes_on = _near(stamp_ns, last_ns)
        if goes_on:
            drop()
        elif held and (stamp_ns != held[0].stamp_ns or len(held) >= _HELD):
            first_ns = held[0].stamp_ns
            forward = last_ns is None or first_ns > last_ns
            goes_on = _near(stamp_ns, first_ns)
            if goes_on or forward != (stamp_ns < first_ns):
                yield from held
                held.clear()
                last_ns, sparse = first_ns, not goes_on
            else:
                drop()  # back to where it was, or beyond: the step was a damaged time
        if goes_on:
            last_ns = stamp_ns
            yield reading
        else:
            held.append(reading)
    if last_ns is not None and not sparse:
        drop()  # nothing goes on from it
    yield from held


def _near(one_ns: int, other_ns: int | None) -> bool:
    return other_ns is not None and abs(one_ns - other_ns) <= JUMP_NS


def _possible(reading: Reading) -> bool:
    """Say whether a value is a finite number within what its channel can hold at all."""
    largest = _LARGEST.get(reading.channel, 1e6)
    return abs(reading.a) <= largest and abs(reading.b) <= largest  # false of NaN too


def _nothing(source: Path, name: str, tally: Tally) -> str:
    reasons = [*tally.notes, *rejected_words(tally.rejected)]
    if tally.not_used:
        reasons.append(f'not used: {most_of(tally.not_used)}')
    return (
        f'{str(source)!r}, read as {name}, gave no sample from {tally.records} record(s); '
        f'{"; ".join(reasons) or "it holds no measurement of motion"}'
    )
