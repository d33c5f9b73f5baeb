# SPDX-License-Identifier: Apache-2.0
"""
A log of messages, each with its time.

What every format of messages shares: one source an input, times that do not
jump, and a count of what is left out. A format gives a function that reads its
file and yields readings; it is called twice, first to see who sends what.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import NamedTuple

from shipdrag_ros import display, strict_yaml
from shipdrag_ros.display import Table
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import INPUTS, SECOND_NS, Block, Channel
from shipdrag_ros.sources.format import Job
from shipdrag_ros.sources.log import (
    ATTACHMENT,
    BATCH_SAMPLES,
    LIMIT_NS,
    Log,
    Rejected,
    Understood,
    backward_and_repeated,
    not_taken_words,
    rejected_words,
    table_of_messages,
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
    rejected: dict[str, dict[str, Rejected]] = field(default_factory=dict)
    not_used: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)

    def reject(self, name: str, reason: str, text: str) -> None:
        """
        Count what was rejected; `records` is where it stands.
        """
        self.rejected.setdefault(name, {}).setdefault(reason, Rejected()).add(self.records, text)

    def note(self, text: str) -> None:
        """
        Keep a sentence for the user, once.
        """
        if text not in self.notes:
            self.notes.append(text)


FileReader = Callable[[Tally], Iterator[Reading]]


@dataclass(frozen=True)
class StreamResult:
    """
    What became of a log of messages.

    Attributes
    ----------
    format
    records
        Lines or messages in it.
    written
        Samples by input.
    sources
        What each input is taken from.
    not_taken
        By input, values of the sources that it is not taken from.
    not_used
        Messages that state no input, by name.
    rejected
        By input, 'time' or 'line', and reason.
    start_ns, end_ns
        First and last time written [ns].
    backward, repeated
        Samples stamped before, or as, an earlier one of their input; a replay
        rejects them and says so.
    notes
        What is to be known of it, a sentence each.
    understood
        What each input was taken from.
    """

    format: str
    records: int
    written: dict[str, int]
    sources: dict[str, str]
    not_taken: dict[str, dict[str, int]]
    not_used: dict[str, int]
    rejected: dict[str, dict[str, Rejected]]
    start_ns: int
    end_ns: int
    backward: int
    repeated: int
    notes: tuple[str, ...]
    understood: tuple[Understood, ...]

    def summary(self, bag: Path) -> list[str]:
        """
        Say how much was read, and what is to be known of it.
        """
        length_s = (self.end_ns - self.start_ns) * 1e-9
        return [
            f'{bag}: {sum(self.written.values())} messages of {self.records} records, '
            f'{display.duration(length_s)}, from {display.utc(self.start_ns)}',
            *self.notes,
            *backward_and_repeated(self.backward, self.repeated),
        ]

    def table(self) -> Table:
        """
        Return messages by input.
        """
        return table_of_messages(self.written, self.sources)

    def details(self) -> list[str]:
        """
        Say what was not used, and why.
        """
        lines = not_taken_words(self.not_taken) + rejected_words(self.rejected)
        if self.not_used:
            shown = sorted(self.not_used.items(), key=lambda each: -each[1])
            others = ', '.join(f'{name} {count}' for name, count in shown[:20])
            more = f' and {len(shown) - 20} more kinds' if len(shown) > 20 else ''
            lines.append(f'Not used: {others}{more}')
        return lines


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
        Yields the readings of the file in their order; called twice.
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
    counts: dict[Channel, Counter[Origin]] = {}
    survey = Tally()
    for reading in _checked(read(survey), survey):
        counts.setdefault(reading.channel, Counter())[reading.origin] += 1
    if not counts:
        raise ImportDataError(_nothing(job.source, name, survey))
    chosen = {channel: _best(found) for channel, found in counts.items()}
    tally = Tally()
    record = _ArrivedSamples()
    for reading in _checked(read(tally), tally):
        if reading.origin == chosen[reading.channel]:
            record.take(reading)
            if len(record.samples) >= BATCH_SAMPLES:
                log.write_samples(record.pop())
    log.write_samples(record.pop())
    result = _result(name, tally, record, _understood(log, chosen), counts, chosen)
    about_log = {'source': job.source.name, **(about or {}), **asdict(result)}
    log.attach(ATTACHMENT, strict_yaml.dump(about_log))
    return result


def _best(counts: Counter[Origin]) -> Origin:
    most = max(counts.values())
    return min(origin for origin, n in counts.items() if 2 * n >= most)


def _checked(readings: Iterator[Reading], tally: Tally) -> Iterator[Reading]:
    """Leave out values that cannot be, and times that jump away and back again."""
    jumps = _Jumps(tally)
    for reading in readings:
        if not _possible(reading):
            tally.reject(reading.channel.input, 'no possible value', f'{reading.a}, {reading.b}')
        elif not 0 < reading.stamp_ns < LIMIT_NS:
            tally.reject('time', 'no possible date', str(reading.stamp_ns))
        else:
            yield from jumps.take(reading)
    yield from jumps.finish()


class _Jumps:
    """Holds what stands after a step of the time until the next one shows whether it was one."""

    def __init__(self, tally: Tally) -> None:
        self._tally = tally
        self._held: list[Reading] = []
        self._last_ns: int | None = None
        self._sparse = False  # whether such steps are usual here

    def take(self, reading: Reading) -> list[Reading]:
        stamp_ns = reading.stamp_ns
        if self._near(stamp_ns, self._last_ns):
            self._drop()
            self._last_ns = stamp_ns
            return [reading]
        if not self._held or (stamp_ns == self._held[0].stamp_ns and len(self._held) < _HELD):
            self._held.append(reading)
            return []
        first_ns = self._held[0].stamp_ns
        forward = self._last_ns is None or first_ns > self._last_ns
        goes_on = self._near(stamp_ns, first_ns)
        if not goes_on and forward == (stamp_ns < first_ns):
            self._drop()  # back to where it was, or beyond: the step was a damaged time
            self._held = [reading]
            return []
        settled, self._held = self._held, []
        self._sparse = not goes_on
        self._last_ns = settled[-1].stamp_ns
        return settled + self.take(reading)

    def finish(self) -> list[Reading]:
        if self._last_ns is not None and not self._sparse:
            self._drop()  # nothing goes on from it
        return self._held

    def _drop(self) -> None:
        for each in self._held:
            self._tally.reject('time', 'jumps away and back', f'{each.stamp_ns} ns')
        self._held = []

    def _near(self, one_ns: int, other_ns: int | None) -> bool:
        return other_ns is not None and abs(one_ns - other_ns) <= JUMP_NS


def _possible(reading: Reading) -> bool:
    """Say whether a value is a finite number within what its channel can hold at all."""
    largest = _LARGEST.get(reading.channel, 1e6)
    return abs(reading.a) <= largest and abs(reading.b) <= largest  # false of NaN too


class _ArrivedSamples:
    """Samples with a time of arrival that never goes back."""

    def __init__(self) -> None:
        self.samples: list[tuple[int, int, int, float, float]] = []
        self.written: Counter[str] = Counter()
        self.backward = 0
        self.repeated = 0
        self.start_ns: int | None = None
        self.newest_ns = -1
        self._newest: dict[Channel, int] = {}

    def take(self, reading: Reading) -> None:
        newest_ns = self._newest.get(reading.channel, -1)
        self.backward += reading.stamp_ns < newest_ns
        self.repeated += reading.stamp_ns == newest_ns
        self._newest[reading.channel] = max(newest_ns, reading.stamp_ns)
        if self.start_ns is None:
            self.start_ns = reading.stamp_ns
        self.newest_ns = max(self.newest_ns, reading.stamp_ns)
        self.samples.append(
            (reading.channel, reading.stamp_ns, self.newest_ns, reading.a, reading.b)
        )
        self.written[reading.channel.input] += 1

    def pop(self) -> Block:
        samples, self.samples = self.samples, []
        return Block.of_samples(samples)


def _understood(log: Log, chosen: Mapping[Channel, Origin]) -> tuple[Understood, ...]:
    return tuple(
        Understood(
            channel.input,
            chosen[channel].name,
            chosen[channel].unit,
            first,
            geodetic=channel is Channel.POSITION_GEODETIC,
        )
        for channel, first in sorted(log.first.items())
    )


def _result(
    name: str,
    tally: Tally,
    record: _ArrivedSamples,
    understood: Sequence[Understood],
    counts: Mapping[Channel, Counter[Origin]],
    chosen: Mapping[Channel, Origin],
) -> StreamResult:
    not_taken: dict[str, dict[str, int]] = {}
    for channel, of_channel in sorted(counts.items()):
        for origin, count in of_channel.items():
            if origin != chosen[channel]:
                others = not_taken.setdefault(channel.input, {})
                others[origin.name] = others.get(origin.name, 0) + count
    sources: dict[str, dict[str, None]] = {}
    for each in understood:
        sources.setdefault(each.input, {})[each.source] = None
    assert record.start_ns is not None  # a source was chosen, which has a value
    return StreamResult(
        format=name,
        records=tally.records,
        written={each: record.written[each] for each in INPUTS if record.written[each]},
        sources={each: ', '.join(names) for each, names in sources.items()},
        not_taken=not_taken,
        not_used=dict(tally.not_used),
        rejected=tally.rejected,
        start_ns=record.start_ns,
        end_ns=record.newest_ns,
        backward=record.backward,
        repeated=record.repeated,
        notes=tuple(tally.notes),
        understood=tuple(understood),
    )


def _nothing(source: Path, name: str, tally: Tally) -> str:
    reasons = [*tally.notes, *rejected_words(tally.rejected)]
    if tally.not_used:
        others = ', '.join(f'{each} {n}' for each, n in tally.not_used.most_common(10))
        reasons.append(f'not used: {others}')
    return (
        f'{str(source)!r}, read as {name}, gave no sample from {tally.records} record(s); '
        f'{"; ".join(reasons) or "it holds no measurement of motion"}'
    )
