# SPDX-License-Identifier: Apache-2.0
"""
Who sends what in a log of NMEA 0183, before anything is taken from it.

Several instruments, and several sentences of one, may hold the same input.
"""

from __future__ import annotations

from collections import Counter
from datetime import date

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.nmea.clock import (
    DAY_NS,
    ROLLOVER_DAYS,
    SentenceClock,
    SentenceTime,
    days_of,
    rollover_days,
)
from shipdrag_ros.nmea.framing import Sentence
from shipdrag_ros.nmea.sentences import TIMED, Fields, Mounting, NoValue
from shipdrag_ros.nmea.values import SentenceSource, best, read_values
from shipdrag_ros.samples import Channel
from shipdrag_ros.sources.formats.nmea.log import NmeaLog


class Survey:
    """
    Sees who sends what, and on which day.

    Attributes
    ----------
    addresses
        Number of sentences by talker and kind.
    values
        Number of values by source, of each channel.
    """

    def __init__(self, mounting: Mounting) -> None:
        self._mounting = mounting
        self._received = False
        self._timed = False
        self._first: SentenceTime | None = None
        self._first_received_ns: int | None = None
        self.addresses: Counter[tuple[str, str]] = Counter()
        self.values: dict[Channel, Counter[SentenceSource]] = {}

    def take(self, sentence: Sentence) -> None:
        """
        Count one sentence.
        """
        self.addresses[sentence.talker, sentence.kind] += 1
        self._received |= sentence.receive_ns is not None
        if sentence.kind in TIMED:
            self._time(Fields(sentence.kind, sentence.fields), sentence.receive_ns)
        for channel, source, _ in read_values(sentence, self._mounting):
            if source is not None:
                self.values.setdefault(channel, Counter())[source] += 1

    def _time(self, fields: Fields, receive_ns: int | None) -> None:
        if self._first is not None:
            return
        try:
            moment = SentenceTime(fields)
        except NoValue:
            return
        self._timed = True
        if moment.trusted and moment.day is not None:
            self._first, self._first_received_ns = moment, receive_ns

    @property
    def days_early(self) -> int:
        """Days that the receiver is before the receipt where these are whole cycles; or 0."""
        if self._first is None or self._first.day is None or self._first_received_ns is None:
            return 0
        days = round(self._first_received_ns / DAY_NS) - self._first.day
        cycles = round(days / ROLLOVER_DAYS)
        return cycles * ROLLOVER_DAYS if abs(days - cycles * ROLLOVER_DAYS) <= 2 else 0

    def chosen(self) -> dict[Channel, SentenceSource]:
        """
        Return the one source of each input.
        """
        return {channel: best(counts) for channel, counts in self.values.items()}

    def clock(self, log: NmeaLog, day: date | None) -> SentenceClock:
        """
        Return the clock at the start of the log.

        Parameters
        ----------
        log
            Read to its end.
        day
            Date (UTC) of its first time, from outside.

        Raises
        ------
        ImportDataError
            If there is no sentence, or nothing states time and date.
        """
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
            return SentenceClock(near_ns, shift_days=shift_days)
        if day is not None:
            return SentenceClock(days_of(day) * DAY_NS + DAY_NS // 2 - 1)  # noon: of the whole day
        if self._received:
            return SentenceClock(None)
        if self._timed:
            raise ImportDataError(
                f'{name} has times of day, but no date (no RMC or ZDA with a fix and a date); '
                'give --date YYYY-MM-DD of its first time, in UTC'
            )
        raise ImportDataError(
            f'{name} states no time: it has none of {", ".join(TIMED)} with a time, and no time '
            'of receipt before its lines'
        )


def _bare(log: NmeaLog) -> bool:
    return 'without checksum' in log.rejected
