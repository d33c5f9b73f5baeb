# SPDX-License-Identifier: Apache-2.0
"""
When the sentences of a log, or of a wire, were measured.

Few sentences state their time. The others have that of the last one that did;
where an input speaks several times before the next, its samples are spread
evenly until then. Where the logger noted when it received each line, the time
since is measured instead, on its clock.
"""

from __future__ import annotations

from datetime import date
from typing import NamedTuple

from shipdrag_ros.nmea.reading import DAY_NS, Sentence, SentenceTime, days_of
from shipdrag_ros.nmea.sentences import NoValue
from shipdrag_ros.samples import SECOND_NS

GAP_NS = 10 * SECOND_NS
"""A longer step of the time is a gap; what was measured inside it has no time."""

BEHIND_NS = SECOND_NS
"""A line that comes later than others by more waited somewhere: it is of a backlog."""

_MEMORY_NS = 60 * SECOND_NS  # of the least delay; a clock that was set is known after it
ROLLOVER_DAYS = 1024 * 7  # a week number of GPS has ten bits


def rollover_days(day: int, true: date) -> int | None:
    """
    Return what is to be added to the days of a log whose date is known.

    GPS counts weeks modulo 1024, and an old receiver shows a date that many
    weeks early. None if the difference is no such number of weeks.
    """
    difference = days_of(true) - day
    return difference if difference % ROLLOVER_DAYS == 0 else None


class SentenceClock:
    """
    Follows the time through a log.

    Parameters
    ----------
    near_ns
        A time at most half a day from the first one [ns since the epoch]; None
        if nothing states it but the receipt of the lines.
    shift_days
        Added to every date of the log.

    Attributes
    ----------
    shift_days
        As given.
    dates_put_right
        Number of times whose date was a day off at midnight.
    now_ns
        The present time [ns since the epoch]; None before the first.
    """

    def __init__(self, near_ns: int | None, shift_days: int = 0) -> None:
        self._near_ns = near_ns
        self.shift_days = shift_days
        self.dates_put_right = 0
        self.now_ns: int | None = None

    def resolve(self, moment: SentenceTime, receive_ns: int | None) -> int:
        """
        Return the time of a sentence [ns since the epoch].

        One without a date has that nearest to the last time, or to that of
        its receipt before the first.

        Raises
        ------
        NoValue
            If nothing states the date, or a time without a fix does not go on
            from the last one.
        """
        if moment.day is None:
            time_ns = self._nearest(moment.of_day_ns, receive_ns)
        else:
            time_ns = (moment.day + self.shift_days) * DAY_NS + moment.of_day_ns
            if self.now_ns is not None and abs(abs(time_ns - self.now_ns) - DAY_NS) < GAP_NS:
                # some receivers change the date a sentence too late or too early
                time_ns = self._nearest(moment.of_day_ns, receive_ns)
                self.dates_put_right += 1
        if not moment.trusted and (
            self.now_ns is None or not 0 <= time_ns - self.now_ns <= GAP_NS
        ):
            # before its first fix a receiver shows any date
            raise NoValue('without a fix, and not going on from the last')
        return time_ns

    def _nearest(self, of_day_ns: int, receive_ns: int | None) -> int:
        known = (self.now_ns, self._near_ns, receive_ns)
        near_ns = next((time_ns for time_ns in known if time_ns is not None), None)
        if near_ns is None:
            raise NoValue('no date')
        day = round((near_ns - of_day_ns) / DAY_NS)
        return day * DAY_NS + of_day_ns


class Stamped(NamedTuple):
    """A sentence, when it was measured by the clock of its receipt, and its receipt [ns]."""

    sentence: Sentence
    stamp_ns: int
    read_ns: int


class WireClock:
    """
    Knows a backlog on a wire: lines whose own times are further back than those of others.

    A line that flows is stamped with its receipt: what it states holds the delay of its
    source, and the difference of two clocks. The least difference between receipt and stated
    time, of the last minute or two, is that of a line that flows; what exceeds it has waited,
    after a stall of TCP for instance. Most lines state no time. Behind a silence in which
    one that does was due, and as long as the wire has not caught up, they are held until the
    next that does, and are spread evenly until then.
    """

    def __init__(self) -> None:
        self._receivers: dict[str, _Receiver] = {}
        self._held: list[tuple[Sentence, int]] = []
        self._read_ns = 0
        self._stamp_ns = 0
        self._due_ns = 0  # the next that states a time
        self._waited = False
        self._timed = False

    def stamped(self, sentence: Sentence, read_ns: int) -> list[Stamped]:
        """
        Return the sentences whose time is known now, in the order of their receipt.

        Parameters
        ----------
        sentence
            The next one.
        read_ns
            When its line was read [ns since the epoch].
        """
        silent = read_ns - self._read_ns > BEHIND_NS and read_ns > self._due_ns
        self._read_ns = read_ns
        moment = sentence.time
        if isinstance(moment, SentenceTime) and moment.trusted:
            receiver = self._receivers.setdefault(sentence.talker, _Receiver())
            behind_ns = receiver.behind_ns(moment.of_day_ns, read_ns)
            self._due_ns = read_ns + receiver.every_ns
            return self._timed_by(behind_ns, sentence)
        if not (self._timed and (self._held or self._waited or silent)):
            self._stamp_ns = read_ns
            return [Stamped(sentence, read_ns, read_ns)]
        self._held.append((sentence, read_ns))
        if 0 <= read_ns - self._held[0][1] <= BEHIND_NS:
            return []
        self._timed = self._waited = False  # nobody states a time any more
        return self._released(0, read_ns)

    def _timed_by(self, behind_ns: int, sentence: Sentence) -> list[Stamped]:
        before, read_ns = self._waited, self._read_ns
        # a backlog ends where its lines have caught up
        self._waited = behind_ns > (BEHIND_NS // 10 if before else BEHIND_NS)
        self._timed = True
        stamp_ns = read_ns - behind_ns if self._waited else read_ns
        step_ns = 0
        if before or self._waited:
            step_ns = max(stamp_ns - self._stamp_ns, 0) // (len(self._held) + 1)
        return [*self._released(step_ns, stamp_ns), Stamped(sentence, stamp_ns, read_ns)]

    def _released(self, step_ns: int, stamp_ns: int) -> list[Stamped]:
        """Return what was held, so far apart since the last stamp; 0: each by its receipt."""
        held, self._held = self._held, []
        since_ns, self._stamp_ns = self._stamp_ns, stamp_ns
        return [
            Stamped(sentence, since_ns + number * step_ns if step_ns else read_ns, read_ns)
            for number, (sentence, read_ns) in enumerate(held, 1)
        ]


class _Receiver:
    """The clock of one talker beside that of the receipt; the day does not count."""

    def __init__(self) -> None:
        self.every_ns = DAY_NS  # between the last two times that it stated
        self._least_ns: list[int] = []  # of this minute, then of the one before
        self._since_ns = 0
        self._stated_ns = -1
        self._behind_ns = 0

    def behind_ns(self, stated_ns: int, read_ns: int) -> int:
        """Return how long a line that states a time of day has waited [ns]."""
        if stated_ns == self._stated_ns:  # of the same fix, or of a clock that stands still
            return self._behind_ns
        if self._least_ns:
            self.every_ns = abs(_within_a_day(stated_ns - self._stated_ns))
        self._stated_ns = stated_ns
        difference_ns = read_ns - stated_ns
        if not self._least_ns or not 0 <= read_ns - self._since_ns <= _MEMORY_NS:
            self._least_ns, self._since_ns = [difference_ns, *self._least_ns[:1]], read_ns
        self._least_ns[0] += min(_within_a_day(difference_ns - self._least_ns[0]), 0)
        self._behind_ns = max(_within_a_day(difference_ns - each) for each in self._least_ns)
        return max(self._behind_ns, 0)


def _within_a_day(difference_ns: int) -> int:
    return (difference_ns + DAY_NS // 2) % DAY_NS - DAY_NS // 2
