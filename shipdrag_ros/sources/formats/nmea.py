# SPDX-License-Identifier: Apache-2.0
"""
VHW VBW VTG RMC GGA GLL HDT HDG THS RPM MWV DPT DBT RSA ZDA, each input from one talker; of
RPM, up to four shafts (numbers 0 to 4) and their pitch. A sentence without a time has that of
the last one with a time; where the logger wrote the time of receipt before each line (also as
OpenRVDAS does), the time since is added.

Options
-------
--no-checksum
    take sentences without a checksum too; one that is there must be right
"""

# What a sentence does not hold is counted by reason with its first lines; what it holds is
# written, plausible or not, for the monitor to judge. The log itself is attached, if it is not
# too long, so that nothing is lost.
#
# One pass takes what the sentences hold, their times counted from the first midnight; then it
# is known who sends what, and which day that was. A sample whose sentence states no time has
# that of the last one that did; where an input speaks several times before the next, its
# samples are spread evenly until then.

from __future__ import annotations

import re
from array import array
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, date
from decimal import Decimal
from itertools import islice
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pynmeagps.nmeatypes_core import NMEA_TALKERS

from shipdrag_ros import display, strict_yaml
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.nmea.sentences import (
    DAY_NS,
    MAGNETIC,
    READERS,
    START,
    TIMED,
    USED,
    NoValue,
    Sentence,
    SentenceReader,
    SentenceTime,
    checksum_of,
    days_of,
)
from shipdrag_ros.progress import PartDone
from shipdrag_ros.samples import INPUTS, SECOND_NS, Block, Channel, Int64, UInt8
from shipdrag_ros.sources import format
from shipdrag_ros.sources.format import BROKEN, Lines, opened
from shipdrag_ros.sources.log import (
    ATTACHMENT,
    LIMIT_NS,
    ImportResult,
    Log,
    Tally,
    iso_ns,
    most_of,
    rejected_words,
)
from shipdrag_ros.sources.stream import SourcedValues

_UTF_8_MARK = '\xef\xbb\xbf'  # as it looks in the encoding below
# every byte is a character, so that checksums are those of the bytes
_ENCODING = 'latin-1'
_LONGEST = 4096  # a sentence has 82 characters; some with a prefix have more
_TAG = re.compile(r'\\([^\\]*)\*([0-9A-Fa-f]{2})\\')
_TAGS = re.compile(f'(?:{_TAG.pattern})+')
_TAG_TIME = re.compile(r'(?:^|,)c:(\d{9,14})(?:,|$)')
_EPOCH = re.compile(r'\[?((?:\d{9,10}|\d{13})(?:\.\d+)?)\]?[\s,;:]*')
_DATED = re.compile(r'(?:\w{1,40}\s+)?\[?(\d{4}-[^\]]{1,60}?)\]?[\s,;:]*')
_MILLISECONDS_FROM = 100_000_000_000  # a count of seconds that large is past the year 5000


class NmeaLog:
    """
    The sentences of a log, plain or compressed with gzip, and a count of what is none.

    Parameters
    ----------
    path
        File with a sentence a line. Before a sentence may stand a TAG block,
        or the time of its receipt: seconds or milliseconds since 1970, or ISO
        8601, taken as UTC without a zone.
    progress
        Called with how many bytes are read, and of how many.

    Attributes
    ----------
    lines
        All that stands in it, from its last reading.
    tally
        Of lines without a sentence, and of sentences without a value.
    """

    def __init__(self, path: Path, progress: PartDone | None = None) -> None:
        self.lines = Lines(path, encoding=_ENCODING, longest=_LONGEST, progress=progress)
        self.tally = Tally()

    def texts(self) -> Iterator[tuple[int, str, int | None]]:
        """Yield line, text and time of receipt [ns] of what may be sentences, in their order."""
        lines = self.lines
        for line in lines:
            if line[:1] == '$' and line.rfind('$') == 0 and '!' not in line:
                yield lines.number, line[1:].strip(), None
            elif line:
                yield from self._of_line(lines.number, line.removeprefix(_UTF_8_MARK))
        for number in lines.too_long:
            self.tally.reject('line', f'longer than {_LONGEST} characters', '', number)

    def lines_of(self, places: Collection[int]) -> dict[int, tuple[int, str]]:
        """Return line and text of what stands at some places among the texts."""
        texts = islice(NmeaLog(self.lines.path).texts(), max(places, default=-1) + 1)
        return {
            place: (line, text) for place, (line, text, _) in enumerate(texts) if place in places
        }

    def _of_line(self, number: int, line: str) -> Iterator[tuple[int, str, int | None]]:
        # a lost line end leaves two sentences in a line
        prefix, *texts = START.split(line)
        if not texts:
            self.tally.reject('line', 'no sentence', line, number)
            return
        prefix = prefix.strip()
        try:
            receive_ns = _receive_ns(prefix) if prefix else None
        except ValueError as error:
            self.tally.reject('line', str(error), prefix, number)
            receive_ns = None
        for text in texts:
            yield number, text.strip(), receive_ns


def _receive_ns(prefix: str) -> int | None:
    """Return the time before a sentence [ns]; ValueError says why there is none."""
    if _TAGS.fullmatch(prefix):
        tags = _TAG.findall(prefix)
        if any(checksum_of(content) != checksum.upper() for content, checksum in tags):
            raise ValueError('wrong checksum of a TAG block')
        times = [found for content, _ in tags if (found := _TAG_TIME.search(content))]
        if not times:
            return None
        receive_ns = _counted_ns(times[0][1])
    elif epoch := _EPOCH.fullmatch(prefix):
        receive_ns = _counted_ns(epoch[1])
    else:
        dated = _DATED.fullmatch(prefix)
        time_ns = None if dated is None else iso_ns(dated[1], UTC)
        if time_ns is None:
            raise ValueError('prefix not understood')
        receive_ns = time_ns
    if not 0 <= receive_ns < LIMIT_NS:
        raise ValueError('no possible date before it')
    return receive_ns


def _counted_ns(text: str) -> int:
    count = Decimal(text)
    return round(count * (1_000_000 if count >= _MILLISECONDS_FROM else SECOND_NS))


GAP_NS = 10 * SECOND_NS
"""A longer step of the time is a gap; what was measured inside it has no time."""


ROLLOVER_DAYS = 1024 * 7
"""An old receiver shows a date so much early: a week number of GPS has ten bits."""


class SentenceClock:
    """
    Follows the time through a log, whose days count from that of its first time.

    Parameters
    ----------
    given
        Date of the first time, where it is given.

    Attributes
    ----------
    first, first_received_ns
        The first time with a date that its source calls valid, and when it was received.
    shift_days
        To be added to every date of the log, whole cycles of the GPS week; None where the
        date that is given is no such number of days away.
    dates_put_right
        Number of times whose date was a day off at midnight.
    now_ns
        The present time [ns]; None before the first.
    start_ns
        When the days of the log began [ns since the epoch]; None while nothing states it.
    """

    def __init__(self, given: date | None) -> None:
        self.first: SentenceTime | None = None
        self.first_received_ns: int | None = None
        self.shift_days: int | None = 0
        self.dates_put_right = 0
        self.now_ns: int | None = None
        self.start_ns = None if given is None else days_of(given) * DAY_NS
        self._given = given

    def resolve(self, moment: SentenceTime, receive_ns: int | None) -> int:
        """
        Return the time of a sentence [ns]; one without a date has that nearest to the last.

        Raises
        ------
        NoValue
            If a time without a fix does not go on from the last one.
        """
        now_ns, of_day_ns, day = self.now_ns, moment.of_day_ns, moment.day
        days = 0 if now_ns is None else round((now_ns - of_day_ns) / DAY_NS)
        time_ns = near_ns = days * DAY_NS + of_day_ns
        if self.first is None and day is not None and moment.trusted:
            self.first, self.first_received_ns = moment, receive_ns
            if self._given is not None:
                difference = days_of(self._given) - day
                self.shift_days = None if difference % ROLLOVER_DAYS else difference
            self.start_ns = (day + (self.shift_days or 0) - days) * DAY_NS
        elif self.first is not None and self.start_ns is not None and day is not None:
            time_ns = (day + (self.shift_days or 0)) * DAY_NS + of_day_ns - self.start_ns
            if now_ns is not None and abs(abs(time_ns - now_ns) - DAY_NS) < GAP_NS:
                # some receivers change the date a sentence too late or too early
                time_ns = near_ns
                self.dates_put_right += 1
        if not moment.trusted and (now_ns is None or not 0 <= time_ns - now_ns <= GAP_NS):
            # before its first fix a receiver shows any date
            raise NoValue('without a fix, and not going on from the last')
        # a little earlier: sentences of one fix, or of two receivers, out of order
        if now_ns is None or time_ns > now_ns or time_ns < now_ns - GAP_NS:
            self.now_ns = time_ns
        if self.start_ns is None and receive_ns is not None:
            self.start_ns = round((receive_ns - time_ns) / DAY_NS) * DAY_NS
        return time_ns


_NONE = -1  # no time of receipt
_GAP, _BEFORE = 'in a gap of the time', 'before the first time'
_BEYOND = 'no possible date'
_SHOWN = 3  # rejected sentences of a reason whose text is shown


class TakenSentences:
    """
    What the sentences of a log hold.

    Parameters
    ----------
    log
        At its start. What is rejected goes to its tally.
    clock
        What it cannot tell the time of is rejected.

    Attributes
    ----------
    values
        What they measure, by the places of their texts.
    addresses
        Number of sentences by talker and kind.
    received
        Whether any has a time of receipt.
    timed
        Whether any states a time.
    """

    def __init__(self, log: NmeaLog, clock: SentenceClock) -> None:
        self.addresses: Counter[tuple[str, str]] = Counter()
        self.received = self.timed = False
        self.values = SourcedValues()
        self._log, self._clock = log, clock
        self._received = array('q')  # of the values
        self._stated = array('q')  # place and time of the sentences that state one
        self._steps = array('q')  # place, time and receipt of those that moved the clock

    def take(
        self, place: int, line: int, text: str, sentence: Sentence, receive_ns: int | None
    ) -> None:
        """
        Take one sentence.

        Parameters
        ----------
        place
            Of its text among those of the log.
        line, text
            Where it stands.
        sentence, receive_ns
        """
        talker, kind, moment, values, refused = sentence
        self.addresses[talker, kind] += 1
        received = _NONE
        if receive_ns is not None:
            received, self.received = receive_ns, True
        if moment is not None:
            before_ns = self._clock.now_ns
            try:
                if isinstance(moment, NoValue):
                    raise moment
                self.timed = True
                time_ns = self._clock.resolve(moment, receive_ns)
            except NoValue as why:  # of such a sentence its time alone is said
                self._log.tally.reject('time', f'{talker}{kind}: {why}', text, line)
                return
            self._stated.extend((place, time_ns))
            if self._clock.now_ns != before_ns:
                self._steps.extend((place, time_ns, received))
        for channel, reason in refused:
            self._log.tally.reject(channel.input, f'{talker}{kind}: {reason}', text, line)
        for channel, source, a, b in values:
            self.values.add(channel, source, place, a, b)
            self._received.append(received)

    @property
    def count(self) -> int:
        """Number of sentences."""
        return self.addresses.total()

    def samples(self) -> Block:
        """Return the samples of the chosen sources, in the order of their sentences."""
        stated, steps = _columns(self._stated, 2), _columns(self._steps, 3)
        stated[1] += self._clock.start_ns or 0
        steps[1] += self._clock.start_ns or 0
        which, code = self.values.taken()
        place = np.array(self.values.at)[which]
        received = np.array(self._received)[which]
        stamps, reason = _stamps(place, code, received, stated, steps)
        reason[(reason == '') & ((stamps < 0) | (stamps >= LIMIT_NS))] = _BEYOND
        lost = [
            (why, channel, place[(reason == why) & (code == channel)].tolist())
            for why in (_BEFORE, _GAP, _BEYOND)
            for channel in np.unique(code[reason == why])
        ]
        shown = self._log.lines_of({each for *_, places in lost for each in places[:_SHOWN]})
        for why, channel, places in lost:
            for each in places:
                line, text = shown.get(each, (0, ''))
                self._log.tally.reject(Channel(channel).input, why, text, line)
        good = reason == ''
        return self.values.block(which[good], code[good], stamps[good])


def _columns(values: array[int], width: int) -> Int64:
    """Return what stands one row behind the other as columns (width, n)."""
    return np.array(values, np.int64).reshape(-1, width).T.copy()


def _stamps(
    place: Int64, code: UInt8, received: Int64, stated: Int64, steps: Int64
) -> tuple[Int64, NDArray[np.str_]]:
    """
    Return the times (n,) of samples [ns], and why one has none.

    Rows of `stated`: place and time; of `steps`: place, time and receipt.
    """
    stamps = received.copy()  # before the first time
    reason = np.where(received == _NONE, _BEFORE, '').astype('U32')
    own = np.isin(place, stated[0])
    at = np.searchsorted(stated[0], place[own])
    stamps[own], reason[own] = stated[1][at], ''
    set_place, set_ns, set_received_ns = steps
    last = np.searchsorted(set_place, place, 'right') - 1
    begun = (last >= 0) & ~own
    if not begun.any():
        return stamps, reason
    noted = begun & (received != _NONE) & (set_received_ns[last] != _NONE)
    stamps[noted] = (set_ns[last] + received - set_received_ns[last])[noted]
    reason[noted] = ''
    spread = np.flatnonzero(begun & ~noted)
    last = last[spread]
    step_ns = np.diff(set_ns)
    step_ns = np.where((step_ns > 0) & (step_ns <= GAP_NS), step_ns, 0)
    step_ns = np.append(step_ns, step_ns[-1:] if len(step_ns) else 0)  # as if it came again
    _, group, share = np.unique(
        last * len(Channel) + code[spread], return_inverse=True, return_counts=True
    )
    order = np.argsort(group, kind='stable')
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order)) - np.repeat(np.cumsum(share) - share, share)
    stamps[spread] = set_ns[last] + rank * step_ns[last] // share[group]
    reason[spread] = np.where((rank > 0) & (step_ns[last] == 0), _GAP, '')
    return stamps, reason


LOG_ATTACHMENT = 'log.nmea'
LOG_LIMIT_BYTES = 16 << 20
"""A longer log is not attached."""


@dataclass(frozen=True, kw_only=True)
class NmeaResult(ImportResult):
    """
    What became of a log.

    Attributes
    ----------
    lines, sentences
        Lines in the log, and sentences in them whose checksum is right.
    unknown_talkers
        Sentences by talker, where NMEA 0183 knows none of the name.
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
    """

    lines: int
    sentences: int
    unknown_talkers: Mapping[str, int]
    dates_put_right: int
    magnetic_heading: bool
    shift_days: int
    days_early: int
    log_attached: bool
    damage: str
    checksums: bool
    unused: ClassVar = 'Sentences not used'

    @property
    def size(self) -> str:
        """What was read."""
        return f'{self.sentences} sentences in {self.lines} lines'

    def summary(self, bag: Path) -> list[str]:
        """Say how much was read, and what is to be known of it."""
        first, *others = super().summary(bag)
        lost = 'NOT attached (too long, damaged or no UTF-8): keep it'
        kept = 'attached' if self.log_attached else lost
        return [f'{first}; the log is {kept}', *self._notes(), *others]

    def _notes(self) -> Iterator[str]:
        if not self.checksums:
            yield 'The sentences have no checksums: a damaged digit is not noticed.'
        if self.damage:
            yield f'The log could not be read to its end, {self.damage}; this is what is left.'
        if self.shift_days:
            cycles = 'whole cycles of the GPS week'
            yield f'All dates were shifted by {self.shift_days} days, {cycles}.'
        elif self.days_early:
            received = display.utc(self.start_ns + self.days_early * DAY_NS)[:10]
            yield (
                f'The dates of the receiver are {self.days_early} days, whole cycles of the GPS '
                f'week, before the times of receipt: give --date {received} to shift them.'
            )
        if self.dates_put_right:
            yield f'{self.dates_put_right} date(s) were a day off at midnight and put right.'
        if self.magnetic_heading:
            yield (
                'The heading is MAGNETIC, as the log states no variation: good for finding turns, '
                'not for directions over ground.'
            )

    def details(self) -> list[str]:
        """Say what was not used, and why."""
        lines = super().details()
        if self.unknown_talkers:
            lines.append(f'Talkers that NMEA 0183 does not know: {most_of(self.unknown_talkers)}')
        return lines


def read_nmea(job: format.Job, log: Log) -> NmeaResult:
    """
    Read the measurements of a log.

    Of a log whose dates are a whole number of GPS week cycles (1024 weeks) away from the
    `date` of the job, the dates are shifted.

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
    source, head = job.source, format.head_of(job.source)
    day, transducer_m = job.options.get('date'), job.options.get('transducer')
    bare = job.options.get('no_checksum')
    if bare is None:
        bare = _without_checksums(head)
    text = NmeaLog(source, job.progress)
    reader = SentenceReader(transducer_m, checksum=not bare)
    clock = SentenceClock(day)
    taken = TakenSentences(text, clock)
    for place, (line, each, receive_ns) in enumerate(text.texts()):
        sentence = reader.read(each)
        if isinstance(sentence, str):
            text.tally.reject('line', sentence, each, line)
        else:
            taken.take(place, line, each, sentence, receive_ns)
    _refuse_undated(text, taken, clock, day)
    whole = _whole(source)
    if whole is not None:
        log.attachments[LOG_ATTACHMENT] = whole
    block = taken.samples()
    rejected = {
        name: text.tally.rejected[name]
        for name in (*INPUTS, 'time', 'line')
        if name in text.tally.rejected
    }
    if not len(block):
        why = '; '.join(rejected_words(rejected)) or f'give a log with any of {", ".join(READERS)}'
        raise ImportDataError(
            f'{str(source)!r} gave no sample from {taken.count} sentence(s); {why}'
        )
    not_used, unknown = _of_no_use(taken)
    heading = taken.values.chosen().get(Channel.HEADING)
    result = NmeaResult(
        lines=text.lines.number,
        sentences=taken.count,
        rejected=rejected,
        not_used=dict(not_used.most_common()),
        unknown_talkers=dict(unknown),
        dates_put_right=clock.dates_put_right,
        magnetic_heading=heading is not None and heading.detail == MAGNETIC,
        shift_days=clock.shift_days or 0,
        days_early=_days_early(clock),
        log_attached=whole is not None,
        damage=text.lines.damage,
        checksums=not bare,
        **taken.values.about(block, log),
    )
    about = {'source': source.name, 'date': day, 'transducer_m': transducer_m}
    about |= {'checksum': 'optional' if bare else 'required', **asdict(result)}
    log.attachments[ATTACHMENT] = strict_yaml.dump(about)
    return result


def _whole(path: Path) -> str | None:
    """Return the whole log, or None if it is long or no text in UTF-8."""
    with opened(path) as (_, file):
        try:
            raw = file.read(LOG_LIMIT_BYTES + 1)
            return None if len(raw) > LOG_LIMIT_BYTES else raw.decode()
        except (*BROKEN, UnicodeDecodeError):
            return None


def _refuse_undated(
    log: NmeaLog, taken: TakenSentences, clock: SentenceClock, day: date | None
) -> None:
    """Refuse a log of which nothing states the date, or another than is given."""
    name, first = repr(str(log.lines.path)), clock.first
    if not taken.count:
        of_lines = log.tally.rejected.get('line', {})
        reasons = ', '.join(
            f'{reason} {rejected.count} times, {rejected.first[0]}'
            for reason, rejected in of_lines.items()
        )
        bare = 'without checksum' in of_lines
        hint = '; for sentences without give --no-checksum' if bare else ''
        raise ImportDataError(
            f'{name} holds no sentence of NMEA 0183 in {log.lines.number} line(s): '
            f'{reasons or "all are blank"}{hint}; for a table give --map and --time'
        )
    if first is not None and first.day is not None and clock.shift_days is None:
        own = date.fromordinal(date(1970, 1, 1).toordinal() + first.day)
        raise ImportDataError(
            f'--date {day}: {name} begins on {own}, which is no whole number of '
            '1024 weeks away; leave --date out'
        )
    if clock.start_ns is not None and not 0 <= clock.start_ns < LIMIT_NS:
        raise ImportDataError(f'--date {day}: no possible date; messages have dates to 2038')
    if clock.start_ns is not None or taken.received:
        return
    if taken.timed:
        raise ImportDataError(
            f'{name} has times of day, but no date (no RMC or ZDA with a fix and a date); '
            'give --date YYYY-MM-DD of its first time, in UTC'
        )
    raise ImportDataError(
        f'{name} states no time: it has none of {", ".join(TIMED)} with a time, and no time '
        'of receipt before its lines'
    )


def _days_early(clock: SentenceClock) -> int:
    """Return the days that the receiver is before the receipt where these are whole cycles."""
    first, received_ns = clock.first, clock.first_received_ns
    if first is None or first.day is None or received_ns is None:
        return 0
    days = round(received_ns / DAY_NS) - first.day
    cycles = round(days / ROLLOVER_DAYS)
    return cycles * ROLLOVER_DAYS if abs(days - cycles * ROLLOVER_DAYS) <= 2 else 0


def _of_no_use(taken: TakenSentences) -> tuple[Counter[str], Counter[str]]:
    """Return how many sentences are of kinds without a reader, and of unknown talkers."""
    not_used: Counter[str] = Counter()
    unknown: Counter[str] = Counter()
    for (talker, kind), count in taken.addresses.items():
        if (kind or talker) not in USED:
            not_used[talker + kind] += count
        if kind and talker not in NMEA_TALKERS:
            unknown[talker] += count
    return not_used, unknown


_SENTENCE = re.compile(r'[$!](?:[A-Z][A-Z0-9]{4}|P[A-Z0-9]{2,}),[^*]*(\*[0-9A-Fa-f]{2})?')
# sentences that wrap NMEA 2000, which has a format of its own
_WRAPPED = re.compile(r'[$!](PCDIN|MXPGN|PDGY),')


def _score(head: format.Head) -> float:
    share = head.share(_SENTENCE.search)
    if share == 0.0 or head.share(_WRAPPED.search) > 0.5:
        return format.NO
    return format.CERTAIN if share > 0.5 else format.LIKELY


def _without_checksums(head: format.Head) -> bool:
    """Say whether the logger has cut off all checksums: none of the first sentences has one."""
    found = [match for line in head.lines if (match := _SENTENCE.search(line))]
    return len(found) > 1 and not any(match[1] for match in found)


FORMAT = format.Format(
    name='nmea',
    kind='an NMEA 0183 log',
    about=__doc__,
    score=_score,
    read=read_nmea,
    options=(format.DATE, format.TRANSDUCER, format.Option('--no-checksum', '')),
)
