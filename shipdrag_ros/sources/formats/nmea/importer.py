# SPDX-License-Identifier: Apache-2.0
"""
A log of NMEA 0183 as a bag.

What a sentence does not hold is counted by reason with its first lines; what
it holds is written, plausible or not, for the monitor to judge. The log itself
is attached, if it is not too long, so that nothing is lost.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path

from pynmeagps.nmeatypes_core import NMEA_TALKERS

from shipdrag_ros import display, strict_yaml
from shipdrag_ros.display import Table
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.nmea.clock import DAY_NS
from shipdrag_ros.nmea.framing import Checksum
from shipdrag_ros.nmea.sentences import MAGNETIC, READERS, TIMED, Mounting
from shipdrag_ros.progress import PartDone
from shipdrag_ros.samples import INPUTS, Channel
from shipdrag_ros.sources.formats.nmea.log import NmeaLog
from shipdrag_ros.sources.formats.nmea.record import SentenceConverter
from shipdrag_ros.sources.formats.nmea.survey import Survey
from shipdrag_ros.sources.log import (
    ATTACHMENT,
    BATCH_SAMPLES,
    Log,
    Rejected,
    Understood,
)
from shipdrag_ros.sources.words import (
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
    The log is read twice: first to see who sends what. Each input is taken
    from one talker and sentence, the first in `READERS` of those that have at
    least half as many values as the most frequent; two instruments of
    different place or scale are never mixed.
    """
    text = NmeaLog(source, checksum=checksum)
    mounting = Mounting(transducer_m)
    survey = Survey(mounting)
    for sentence in text.sentences(_part(progress, 0)):
        survey.take(sentence)
    clock = survey.clock(text, day)
    record = SentenceConverter(survey.chosen(), clock, mounting)
    whole = text.text(LOG_LIMIT_BYTES)
    if whole is not None:
        log.attach(LOG_ATTACHMENT, whole)
    for sentence in text.sentences(_part(progress, 1)):
        record.take(sentence)
        if len(record) >= BATCH_SAMPLES:
            log.write_samples(record.pop())
    record.finish()
    log.write_samples(record.pop())
    understood = _understood(log, record)
    result = _result(text, survey, record, understood, attached=whole is not None)
    about = {'source': source.name, 'date': day, 'transducer_m': transducer_m}
    about |= {'checksum': checksum.value, **asdict(result)}
    log.attach(ATTACHMENT, strict_yaml.dump(about))
    return result


def _part(progress: PartDone | None, part: int) -> PartDone | None:
    """Return the progress of one of two readings."""
    if progress is None:
        return None
    return lambda done, total: progress(part * total + done, 2 * total)


def _result(
    log: NmeaLog,
    survey: Survey,
    record: SentenceConverter,
    understood: tuple[Understood, ...],
    *,
    attached: bool,
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
        if kind not in READERS and kind not in TIMED and talker not in READERS:
            not_used[talker + kind] += count
        if kind and talker not in NMEA_TALKERS:
            unknown[talker] += count
    heading = record.chosen.get(Channel.HEADING)
    return NmeaResult(
        lines=log.lines,
        sentences=record.sentences,
        written={name: record.written[name] for name in INPUTS if record.written[name]},
        sources=_sources(record),
        not_taken=_not_taken(survey, record),
        not_used=dict(not_used.most_common()),
        unknown_talkers=dict(unknown),
        rejected=rejected,
        start_ns=record.start_ns,
        end_ns=record.newest_ns,
        backward=record.backward,
        repeated=record.repeated,
        dates_put_right=record.clock.dates_put_right,
        magnetic_heading=heading is not None and heading.detail == MAGNETIC,
        shift_days=record.clock.shift_days,
        days_early=survey.days_early,
        log_attached=attached,
        damage=log.damage,
        checksums=log.checksum is Checksum.REQUIRED,
        understood=understood,
    )


def _understood(log: Log, record: SentenceConverter) -> tuple[Understood, ...]:
    return tuple(
        Understood(
            channel.input,
            str(record.chosen[channel]),
            '',
            first,
            geodetic=channel is Channel.POSITION_GEODETIC,
        )
        for channel, first in sorted(log.first.items())
    )


def _sources(record: SentenceConverter) -> dict[str, str]:
    """Say what each input is taken from; of several shafts and pitches, each once."""
    by_input: dict[str, dict[str, None]] = {}
    for channel, source in sorted(record.chosen.items()):
        by_input.setdefault(channel.input, {})[str(source)] = None
    return {name: ', '.join(sources) for name, sources in by_input.items()}


def _not_taken(survey: Survey, record: SentenceConverter) -> dict[str, dict[str, int]]:
    """Count by input the values of the sources that nothing is taken from."""
    counts: dict[str, dict[str, int]] = {}
    for channel, of_channel in sorted(survey.values.items()):
        for source, count in of_channel.items():
            if source != record.chosen[channel]:
                others = counts.setdefault(channel.input, {})
                others[str(source)] = others.get(str(source), 0) + count
    return counts
