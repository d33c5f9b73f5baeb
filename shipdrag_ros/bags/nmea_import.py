# SPDX-License-Identifier: Apache-2.0
"""
A log of NMEA 0183 as a bag.

What a sentence does not hold is counted by reason with its first lines; what
it holds is written, plausible or not, for the monitor to judge. The log itself
is attached, if it is not too long, so that nothing is lost.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from datetime import date
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from pynmeagps.nmeatypes_core import NMEA_TALKERS

from shipdrag_ros.bags.csv_import import ATTACHMENT, Rejected
from shipdrag_ros.bags.nmea_clock import DAY_NS, GAP_NS, Clock, Moment, days_of, rollover_days
from shipdrag_ros.bags.nmea_log import Checksum, NmeaLog, Sentence
from shipdrag_ros.bags.nmea_sentences import (
    MAGNETIC,
    READERS,
    TIMED,
    Fields,
    Measured,
    Mounting,
    NoValue,
)
from shipdrag_ros.bags.writer import BagWriter
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import INPUTS, Block, Channel

LOG_ATTACHMENT = 'log.nmea'
LOG_LIMIT_BYTES = 16 << 20
"""A longer log is not attached."""

_BATCH_SAMPLES = 4096
_WAITING_SAMPLES = 16384  # in GAP_NS, of all inputs
_GAP = 'in a gap of the time'
_RANK = {kind: place for place, kind in enumerate(READERS)}


class Source(NamedTuple):
    """Who tells an input; the better source is the smaller."""

    rank: int
    detail: str
    talker: str
    kind: str

    def __str__(self) -> str:
        return f'{self.talker}{self.kind} {self.detail}'.strip()


@dataclass(frozen=True)
class NmeaResult:
    """
    What became of a log.

    Attributes
    ----------
    lines, sentences
        Lines in the log, and sentences in them whose checksum is right.
    written
        Samples by input.
    sources
        Talker and sentence that each input is taken from.
    not_taken
        By input, values of the sentences that it is not taken from.
    not_used
        Sentences that tell no input and no time, by address.
    unknown_talkers
        Sentences by talker, where NMEA 0183 knows none of the name.
    rejected
        By input, 'time' or 'line', and reason.
    start_ns, end_ns
        First and last time written [ns].
    backward, repeated
        Samples whose time is before that, or is that, of an earlier one of
        the same input; a replay rejects them and says so.
    magnetic_heading
        Whether the heading is magnetic, for want of a variation.
    shift_days
        Added to every date of the log, whole cycles of the GPS week.
    log_attached
        Whether the log is attached to the bag.
    damage
        Why the log could not be read to its end; empty if it could.
    """

    lines: int
    sentences: int
    written: dict[str, int]
    sources: dict[str, str]
    not_taken: dict[str, dict[str, int]]
    not_used: dict[str, int]
    unknown_talkers: dict[str, int]
    rejected: dict[str, dict[str, Rejected]]
    start_ns: int
    end_ns: int
    backward: int
    repeated: int
    magnetic_heading: bool
    shift_days: int
    log_attached: bool
    damage: str


def import_nmea(
    source: Path,
    out: Path,
    *,
    day: date | None = None,
    transducer_m: float | None = None,
    checksum: Checksum = Checksum.REQUIRED,
    attachments: Mapping[str, str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> NmeaResult:
    """
    Write the measurements of a log as a bag.

    Parameters
    ----------
    source
        Log, see `NmeaLog`.
    out
        MCAP file to make.
    day
        Date (UTC) of the first time in the log; needed if the log has none. Of a
        log whose dates are a whole number of GPS week cycles (1024 weeks)
        away from it, the dates are shifted.
    transducer_m
        Depth of the echo sounder below the surface [m], for sentences that
        do not tell it.
    checksum
        Whether sentences without one are taken.
    attachments
        Text by name, a ship file for instance.
    progress
        Told how much is read, and of how much.

    Raises
    ------
    ImportDataError
        If the log cannot be read, or nothing in it has a value and a time.
    BagError
        If the bag cannot be made.

    Notes
    -----
    The log is read twice: first to see who tells what. Each input is taken
    from one talker and sentence, the first in `READERS` of those that have at
    least half as many values as the most frequent; two instruments of
    different place or scale are never mixed.
    """
    log = NmeaLog(source, checksum=checksum)
    mounting = Mounting(transducer_m)
    survey = _Survey(mounting)
    for sentence in log.sentences(_part(progress, 0)):
        survey.take(sentence)
    clock = survey.clock(log, day)
    record = _Record(survey.chosen(), clock, mounting)
    writer = BagWriter(out)
    try:
        with writer:
            for name, text in (attachments or {}).items():
                writer.attach(name, text)
            text_of_log = log.text(LOG_LIMIT_BYTES)
            if text_of_log is not None:
                writer.attach(LOG_ATTACHMENT, text_of_log)
            for sentence in log.sentences(_part(progress, 1)):
                record.take(sentence)
                if len(record) >= _BATCH_SAMPLES:
                    writer.write_samples(record.pop())
            record.finish()
            writer.write_samples(record.pop())
            result = _result(log, survey, record, clock, attached=text_of_log is not None)
            about = {'source': source.name, 'date': day, 'transducer_m': transducer_m}
            about |= {'checksum': checksum.value, **asdict(result)}
            writer.attach(ATTACHMENT, yaml.safe_dump(about, sort_keys=False, allow_unicode=True))
        return result
    except BaseException:
        out.unlink(missing_ok=True)  # what was made and is of no use
        raise


def _part(
    progress: Callable[[int, int], None] | None, part: int
) -> Callable[[int, int], None] | None:
    """Return the progress of one of two readings."""
    if progress is None:
        return None
    return lambda done, total: progress(part * total + done, 2 * total)


def _read(
    sentence: Sentence, mounting: Mounting
) -> list[tuple[Channel, Source | None, Measured | NoValue]]:
    """Return what a sentence measures, or why it does not."""
    found: list[tuple[Channel, Source | None, Measured | NoValue]] = []
    fields = Fields(sentence.kind, sentence.fields)
    for channel, read in READERS.get(sentence.kind, ()):
        try:
            value = read(fields, mounting)
        except NoValue as reason:
            found.append((channel, None, reason))
        else:
            rank = _RANK[sentence.kind]
            source = Source(rank, value.detail, sentence.talker, sentence.kind)
            found.append((channel, source, value))
    return found


class _Survey:
    """Sees who tells what, and on which day."""

    def __init__(self, mounting: Mounting) -> None:
        self._mounting = mounting
        self._received = False
        self._timed = False
        self._first: Moment | None = None
        self.addresses: Counter[tuple[str, str]] = Counter()
        self.values: dict[Channel, Counter[Source]] = {}

    def take(self, sentence: Sentence) -> None:
        """Count one sentence."""
        self.addresses[sentence.talker, sentence.kind] += 1
        self._received |= sentence.receive_ns is not None
        if sentence.kind in TIMED:
            self._time(Fields(sentence.kind, sentence.fields))
        for channel, source, _ in _read(sentence, self._mounting):
            if source is not None:
                self.values.setdefault(channel, Counter())[source] += 1

    def _time(self, fields: Fields) -> None:
        if self._first is not None:
            return
        try:
            moment = Moment(fields)
        except NoValue:
            return
        self._timed = True
        if moment.trusted and moment.day is not None:
            self._first = moment

    def chosen(self) -> dict[Channel, Source]:
        """Return the one source of each input."""
        return {
            channel: min(source for source, n in counts.items() if 2 * n >= max(counts.values()))
            for channel, counts in self.values.items()
        }

    def clock(self, log: NmeaLog, day: date | None) -> Clock:
        """Return the clock at the start of the log; ImportDataError if none can be had."""
        name = repr(str(log.path))
        if not self.addresses:
            reasons = ', '.join(
                f'{reason} {rejected.count} times, {rejected.first[0]}'
                for reason, rejected in log.rejected.items()
            )
            hint = '; for sentences without give --no-checksum' if _bare(log) else ''
            raise ImportDataError(
                f'{name} holds no sentence of NMEA 0183 in {log.lines} line(s): '
                f'{reasons or "all are blank"}{hint}; for a table give --map and --time'
            )
        if self._first is not None and self._first.day is not None:
            shift_days = 0
            if day is not None:
                shifted = rollover_days(self._first.day, day)
                if shifted is None:
                    own = date.fromordinal(date(1970, 1, 1).toordinal() + self._first.day)
                    raise ImportDataError(
                        f'--date {day}: {name} begins on {own}, which is no whole number of '
                        '1024 weeks away; leave --date out'
                    )
                shift_days = shifted
            near_ns = (self._first.day + shift_days) * DAY_NS + self._first.of_day_ns
            return Clock(near_ns, shift_days=shift_days)
        if day is not None:
            return Clock(days_of(day) * DAY_NS + DAY_NS // 2 - 1)  # noon: of the whole day
        if self._received:
            return Clock(None)
        if self._timed:
            raise ImportDataError(
                f'{name} tells times of day, but no date (no RMC or ZDA with a fix and a date); '
                'give --date YYYY-MM-DD of its first time, in UTC'
            )
        raise ImportDataError(
            f'{name} tells no time: it has none of {", ".join(TIMED)} with a time, and no time '
            'of receipt before its lines'
        )


def _bare(log: NmeaLog) -> bool:
    return 'without checksum' in log.rejected


@dataclass
class _Waiting:
    """A sample; its time is None until the next time is told."""

    channel: Channel
    value: Measured
    line: int
    text: str
    stamp_ns: int | None


@dataclass
class _Record:
    """Turns sentences into samples and counts what becomes of them."""

    chosen: Mapping[Channel, Source]
    clock: Clock
    mounting: Mounting
    written: Counter[str] = field(default_factory=Counter)
    rejected: dict[str, dict[str, Rejected]] = field(default_factory=dict)
    sentences: int = 0
    backward: int = 0
    repeated: int = 0
    start_ns: int | None = None
    newest_ns: int = -1

    def __post_init__(self) -> None:
        self._waiting: list[_Waiting] = []
        self._step_ns: int | None = None
        self._lost = False
        self._newest: dict[Channel, int] = {}
        self._samples: list[tuple[int, int, int, float, float]] = []

    def __len__(self) -> int:
        return len(self._samples)

    def take(self, sentence: Sentence) -> None:
        """Take the samples of one sentence."""
        self.sentences += 1
        try:
            stamp_ns = self._time(sentence)
        except NoValue as reason:
            self._reject('time', sentence, reason)
            return
        for channel, source, value in _read(sentence, self.mounting):
            if isinstance(value, NoValue):
                self._reject(channel.input, sentence, value)
            elif source == self.chosen[channel]:
                self._wait(_Waiting(channel, value, sentence.line, sentence.text, stamp_ns))

    def finish(self) -> None:
        """Take what still waits, as if the last step of the time came once more."""
        self._settle(self._step_ns)

    def pop(self) -> Block:
        """Return the samples taken since the last time."""
        samples, self._samples = self._samples, []
        if not samples:
            return Block.empty()
        channel, stamp_ns, receive_ns, a, b = zip(*samples, strict=True)
        value = np.array([a, b], np.float64).T
        return Block(
            np.array(channel, np.uint8),
            np.array(stamp_ns, np.int64),
            np.array(receive_ns, np.int64),
            np.ascontiguousarray(value),
            np.full(value.shape, np.nan),
        )

    def _time(self, sentence: Sentence) -> int | None:
        """Return the time of a sentence, None if only the next one tells; NoValue if none."""
        fields = Fields(sentence.kind, sentence.fields) if sentence.kind in TIMED else None
        if fields is None or not fields['time']:
            return self.clock.since(sentence.receive_ns)
        time_ns = self.clock.resolve(Moment(fields), sentence.receive_ns)
        now_ns = self.clock.now_ns
        # a little earlier: sentences of one fix, or of two receivers, out of order
        if now_ns is None or time_ns > now_ns or time_ns < now_ns - GAP_NS:
            self._settle(None if now_ns is None else time_ns - now_ns)
            self.clock.set(time_ns, sentence.receive_ns)
            self._lost = False
        return time_ns

    def _wait(self, sample: _Waiting) -> None:
        if sample.stamp_ns is None and (self._lost or self.clock.now_ns is None):
            self._no_time(sample, _GAP if self._lost else 'before the first time')
            return
        self._waiting.append(sample)
        if len(self._waiting) > _WAITING_SAMPLES:
            self._settle(None)
            self._lost = True

    def _settle(self, step_ns: int | None) -> None:
        """Give times to what waits, now that the step to the next time is known."""
        within = step_ns is not None and 0 < step_ns <= GAP_NS
        self._step_ns = step_ns if within else None
        share = Counter(each.channel for each in self._waiting if each.stamp_ns is None)
        place: Counter[Channel] = Counter()
        for sample in self._waiting:
            stamp_ns = sample.stamp_ns
            if stamp_ns is None:
                assert self.clock.now_ns is not None
                k = place[sample.channel]
                place[sample.channel] += 1
                if k > 0 and self._step_ns is None:
                    self._no_time(sample, _GAP)
                    continue
                stamp_ns = self.clock.now_ns + k * (self._step_ns or 0) // share[sample.channel]
            self._append(sample, stamp_ns)
        self._waiting = []

    def _append(self, sample: _Waiting, stamp_ns: int) -> None:
        newest_ns = self._newest.get(sample.channel, -1)
        self.backward += stamp_ns < newest_ns
        self.repeated += stamp_ns == newest_ns
        self._newest[sample.channel] = max(newest_ns, stamp_ns)
        if self.start_ns is None:
            self.start_ns = stamp_ns
        # arrival never goes back, so that a replay sees the sentences in their order
        self.newest_ns = max(self.newest_ns, stamp_ns)
        self._samples.append(
            (sample.channel, stamp_ns, self.newest_ns, sample.value.a, sample.value.b)
        )
        self.written[sample.channel.input] += 1

    def _no_time(self, sample: _Waiting, reason: str) -> None:
        by_reason = self.rejected.setdefault(sample.channel.input, {})
        by_reason.setdefault(reason, Rejected()).add(sample.line, sample.text)

    def _reject(self, name: str, sentence: Sentence, value: NoValue) -> None:
        by_reason = self.rejected.setdefault(name, {})
        reason = f'{sentence.talker}{sentence.kind}: {value.reason}'
        by_reason.setdefault(reason, Rejected()).add(sentence.line, sentence.text)


def _result(
    log: NmeaLog, survey: _Survey, record: _Record, clock: Clock, *, attached: bool
) -> NmeaResult:
    """Sum up; ImportDataError if there is nothing."""
    rejected = {
        name: record.rejected[name] for name in (*INPUTS, 'time') if name in record.rejected
    }
    if log.rejected:
        rejected['line'] = log.rejected
    if record.start_ns is None:
        reasons = [
            f'{name}: {reason} {each.count} times, {each.first[0]}'
            for name, by_reason in rejected.items()
            for reason, each in by_reason.items()
        ]
        raise ImportDataError(
            f'{str(log.path)!r} gave no sample from {record.sentences} sentence(s); '
            f'{"; ".join(reasons) or "give a log with any of " + ", ".join(READERS)}'
        )
    not_used: Counter[str] = Counter()
    unknown: Counter[str] = Counter()
    for (talker, kind), count in survey.addresses.items():
        if kind not in READERS and kind not in TIMED:
            not_used[talker + kind] += count
        if talker not in NMEA_TALKERS:
            unknown[talker] += count
    heading = record.chosen.get(Channel.HEADING)
    return NmeaResult(
        lines=log.lines,
        sentences=record.sentences,
        written={name: record.written[name] for name in INPUTS if record.written[name]},
        sources={channel.input: str(source) for channel, source in sorted(record.chosen.items())},
        not_taken={
            channel.input: {
                str(source): count
                for source, count in counts.items()
                if source != record.chosen[channel]
            }
            for channel, counts in sorted(survey.values.items())
            if len(counts) > 1
        },
        not_used=dict(not_used.most_common()),
        unknown_talkers=dict(unknown),
        rejected=rejected,
        start_ns=record.start_ns,
        end_ns=record.newest_ns,
        backward=record.backward,
        repeated=record.repeated,
        magnetic_heading=heading is not None and heading.detail == MAGNETIC,
        shift_days=clock.shift_days,
        log_attached=attached,
        damage=log.damage,
    )
