# SPDX-License-Identifier: Apache-2.0
"""
A log of NMEA 0183 as a bag.

What a sentence does not hold is counted by reason with its first lines; what
it holds is written, plausible or not, for the monitor to judge. The log itself
is attached, if it is not too long, so that nothing is lost.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass, replace
from datetime import date
from pathlib import Path

import numpy as np
from pynmeagps.nmeatypes_core import NMEA_TALKERS

from shipdrag_ros import display, strict_yaml
from shipdrag_ros.display import Table
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.nmea.clock import ROLLOVER_DAYS, SentenceClock, rollover_days
from shipdrag_ros.nmea.reading import DAY_NS, Checksum, SentenceReader, days_of
from shipdrag_ros.nmea.sentences import MAGNETIC, READERS, TIMED, Mounting
from shipdrag_ros.progress import PartDone
from shipdrag_ros.samples import INPUTS, Block, Channel
from shipdrag_ros.sources.formats.nmea.log import NmeaLog
from shipdrag_ros.sources.formats.nmea.record import TakenSentences
from shipdrag_ros.sources.log import (
    ATTACHMENT,
    BATCH_SAMPLES,
    Log,
    Rejected,
    Understood,
    backward_and_repeated,
    not_taken_words,
    rejected_words,
    table_of_messages,
)

LOG_ATTACHMENT = 'log.nmea'
LOG_LIMIT_BYTES = 16 << 20
"""A longer log is not attached."""


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
        Talker and sentence that each input is taken from; several of several shafts.
    not_taken
        By input, values of the sentences that it is not taken from.
    not_used
        Sentences that state no input and no time, by address.
    unknown_talkers
        Sentences by talker, where NMEA 0183 knows none of the name.
    rejected
        By input, 'time' or 'line', and reason.
    start_ns, end_ns
        First and last time written [ns].
    backward, repeated
        Samples whose time is before that, or is that, of an earlier one of
        the same input; a replay rejects them and says so.
    dates_put_right
        Times whose date was a day off at midnight.
    magnetic_heading
        Whether the heading is magnetic, for want of a variation.
    shift_days
        Added to every date of the log, whole cycles of the GPS week.
    days_early
        Whole cycles of the GPS week that the dates are before the times of receipt.
    log_attached
        Whether the log is attached to the bag.
    damage
        Why the log could not be read to its end; empty if it could.
    checksums
        Whether its sentences had to have one.
    understood
        What each input was taken from.
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
    dates_put_right: int
    magnetic_heading: bool
    shift_days: int
    days_early: int
    log_attached: bool
    damage: str
    checksums: bool
    understood: tuple[Understood, ...]

    def summary(self, bag: Path) -> list[str]:
        """
        Say how much was read, and what is to be known of it.
        """
        length_s = (self.end_ns - self.start_ns) * 1e-9
        lines = [
            f'{bag}: {sum(self.written.values())} messages of {self.sentences} sentences in '
            f'{self.lines} lines, {display.duration(length_s)}, from {display.utc(self.start_ns)}'
        ]
        if not self.checksums:
            lines.append('The sentences have no checksums: a damaged digit is not noticed.')
        if self.damage:
            lines.append(
                f'The log could not be read to its end, {self.damage}; this is what is left.'
            )
        if self.shift_days:
            lines.append(
                f'All dates were shifted by {self.shift_days} days, whole cycles of the GPS week.'
            )
        if self.days_early and not self.shift_days:
            received = display.utc(self.start_ns + self.days_early * DAY_NS)[:10]
            lines.append(
                f'The dates of the receiver are {self.days_early} days, whole cycles of the GPS '
                f'week, before the times of receipt: give --date {received} to shift them.'
            )
        if self.dates_put_right:
            lines.append(
                f'{self.dates_put_right} date(s) were a day off at midnight and put right.'
            )
        if self.magnetic_heading:
            lines.append(
                'The heading is MAGNETIC, as the log states no variation: good for finding turns, '
                'not for directions over ground.'
            )
        lines += backward_and_repeated(self.backward, self.repeated)
        lines.append(
            'The log is attached to the bag.'
            if self.log_attached
            else 'The log is NOT attached to the bag (too long, damaged or no UTF-8): keep it.'
        )
        return lines

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
            others = ', '.join(f'{address} {count}' for address, count in self.not_used.items())
            lines.append(f'Sentences not used: {others}')
        if self.unknown_talkers:
            names = ', '.join(f'{name} {count}' for name, count in self.unknown_talkers.items())
            lines.append(f'Talkers that NMEA 0183 does not know: {names}')
        return lines


def read_nmea(
    source: Path,
    log: Log,
    *,
    day: date | None = None,
    transducer_m: float | None = None,
    checksum: Checksum = Checksum.REQUIRED,
    progress: PartDone | None = None,
) -> NmeaResult:
    """
    Read the measurements of a log.

    Parameters
    ----------
    source
        Log, see `NmeaLog`.
    log
        Where to.
    day
        Date (UTC) of the first time in the log; needed if the log has none. Of a
        log whose dates are a whole number of GPS week cycles (1024 weeks)
        away from it, the dates are shifted.
    transducer_m
        Depth of the echo sounder below the surface [m], for sentences that
        do not state it.
    checksum
        Whether sentences without one are taken.
    progress
        Called with how much is read, and of how much.

    Raises
    ------
    ImportDataError
        If the log cannot be read, or nothing in it has a value and a time.

    Notes
    -----
    Each input is taken from one talker and sentence, the first in `READERS` of those that have at
    least half as many values as the most frequent; two instruments of
    different place or scale are never mixed.
    """
    text = NmeaLog(source)
    reader = SentenceReader(Mounting(transducer_m), checksum)
    taken = TakenSentences()
    for place, (line, each, receive_ns) in enumerate(text.texts(progress)):
        sentence = reader.read(each)
        if isinstance(sentence, str):
            text.reject(sentence, line, each)
        else:
            taken.take(place, line, each, sentence, receive_ns)
    clock = _clock(text, taken, day)
    whole = text.text(LOG_LIMIT_BYTES)
    if whole is not None:
        log.attach(LOG_ATTACHMENT, whole)
    block = taken.samples(clock)
    for first in range(0, len(block), BATCH_SAMPLES):
        log.write_samples(block[first : first + BATCH_SAMPLES])
    result = _result(text, taken, clock, block, log)
    result = replace(
        result, log_attached=whole is not None, checksums=checksum is Checksum.REQUIRED
    )
    about = {'source': source.name, 'date': day, 'transducer_m': transducer_m}
    about |= {'checksum': checksum.value, **asdict(result)}
    log.attach(ATTACHMENT, strict_yaml.dump(about))
    return result


def _clock(log: NmeaLog, taken: TakenSentences, day: date | None) -> SentenceClock:
    """Return the clock at the start of the log; ImportDataError where nothing states it."""
    name, first = repr(str(log.path)), taken.first
    if not taken.count:
        reasons = ', '.join(
            f'{reason} {rejected.count} times, {rejected.first[0]}'
            for reason, rejected in log.rejected.items()
        )
        bare = 'without checksum' in log.rejected
        hint = '; for sentences without give --no-checksum' if bare else ''
        raise ImportDataError(
            f'{name} holds no sentence of NMEA 0183 in {log.lines} line(s): '
            f'{reasons or "all are blank"}{hint}; for a table give --map and --time'
        )
    if first is not None and first.day is not None:
        shift_days = 0 if day is None else rollover_days(first.day, day)
        if shift_days is None:
            own = date.fromordinal(date(1970, 1, 1).toordinal() + first.day)
            raise ImportDataError(
                f'--date {day}: {name} begins on {own}, which is no whole number of '
                '1024 weeks away; leave --date out'
            )
        return SentenceClock((first.day + shift_days) * DAY_NS + first.of_day_ns, shift_days)
    if day is not None:
        return SentenceClock(days_of(day) * DAY_NS + DAY_NS // 2 - 1)  # noon: of the whole day
    if taken.received:
        return SentenceClock(None)
    if taken.timed:
        raise ImportDataError(
            f'{name} has times of day, but no date (no RMC or ZDA with a fix and a date); '
            'give --date YYYY-MM-DD of its first time, in UTC'
        )
    raise ImportDataError(
        f'{name} states no time: it has none of {", ".join(TIMED)} with a time, and no time '
        'of receipt before its lines'
    )


def _days_early(taken: TakenSentences) -> int:
    """Return the days that the receiver is before the receipt where these are whole cycles."""
    first, received_ns = taken.first, taken.first_received_ns
    if first is None or first.day is None or received_ns is None:
        return 0
    days = round(received_ns / DAY_NS) - first.day
    cycles = round(days / ROLLOVER_DAYS)
    return cycles * ROLLOVER_DAYS if abs(days - cycles * ROLLOVER_DAYS) <= 2 else 0


def _result(
    log: NmeaLog, taken: TakenSentences, clock: SentenceClock, block: Block, into: Log
) -> NmeaResult:
    """Sum up; ImportDataError if there is nothing."""
    rejected = taken.rejected(log.lines_of)
    if log.rejected:
        rejected['line'] = log.rejected
    if not len(block):
        reasons = [
            f'{name}: {reason} {each.count} times, {each.first[0]}'
            for name, by_reason in rejected.items()
            for reason, each in by_reason.items()
        ]
        raise ImportDataError(
            f'{str(log.path)!r} gave no sample from {taken.count} sentence(s); '
            f'{"; ".join(reasons) or "give a log with any of " + ", ".join(READERS)}'
        )
    not_used, unknown = _of_no_use(taken)
    chosen = taken.chosen()
    sources: dict[str, dict[str, None]] = {}
    not_taken: dict[str, Counter[str]] = {}
    for channel, counts in sorted(taken.values().items()):
        sources.setdefault(channel.input, {})[str(chosen[channel])] = None
        others = {str(s): n for s, n in counts.items() if s != chosen[channel]}
        if others:
            not_taken.setdefault(channel.input, Counter()).update(others)
    backward, repeated = _out_of_order(block)
    written = Counter(Channel(code).input for code in block.channel.tolist())
    return NmeaResult(
        lines=log.lines,
        sentences=taken.count,
        written={name: written[name] for name in INPUTS if written[name]},
        sources={name: ', '.join(each) for name, each in sources.items()},
        not_taken={name: dict(counts) for name, counts in not_taken.items()},
        not_used=dict(not_used.most_common()),
        unknown_talkers=dict(unknown),
        rejected=rejected,
        start_ns=int(block.stamp_ns[0]),
        end_ns=int(block.receive_ns[-1]),
        backward=backward,
        repeated=repeated,
        dates_put_right=clock.dates_put_right,
        magnetic_heading=Channel.HEADING in chosen and chosen[Channel.HEADING].detail == MAGNETIC,
        shift_days=clock.shift_days,
        days_early=_days_early(taken),
        log_attached=False,
        damage=log.damage,
        checksums=True,
        understood=tuple(
            Understood(
                channel.input,
                str(chosen[channel]),
                '',
                first,
                geodetic=channel is Channel.POSITION_GEODETIC,
            )
            for channel, first in sorted(into.first.items())
        ),
    )


def _of_no_use(taken: TakenSentences) -> tuple[Counter[str], Counter[str]]:
    """Return how many sentences are of kinds without a reader, and of unknown talkers."""
    not_used: Counter[str] = Counter()
    unknown: Counter[str] = Counter()
    for (talker, kind), count in taken.addresses.items():
        if kind not in READERS and kind not in TIMED and talker not in READERS:
            not_used[talker + kind] += count
        if kind and talker not in NMEA_TALKERS:
            unknown[talker] += count
    return not_used, unknown


def _out_of_order(block: Block) -> tuple[int, int]:
    """Return how many samples are stamped before, and how many as, an earlier one."""
    backward = repeated = 0
    for code in np.unique(block.channel):
        stamps = block.stamp_ns[block.channel == code]
        newest = np.maximum.accumulate(stamps)[:-1]
        backward += int(np.sum(stamps[1:] < newest))
        repeated += int(np.sum(stamps[1:] == newest))
    return backward, repeated
