# SPDX-License-Identifier: Apache-2.0
"""
Sentences of NMEA 0183 to samples with a time, in their order.

One pass takes what the sentences hold, their times counted from the first midnight;
then it is known who sends what, and which day that was. A sample whose sentence states
no time has that of the last one that did; where an input speaks several times before
the next, its samples are spread evenly until then.
"""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from datetime import date
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.nmea.sentences import (
    DAY_NS,
    NoValue,
    Sentence,
    SentenceTime,
    days_of,
)
from shipdrag_ros.samples import SECOND_NS, Block, Channel, Int64, UInt8
from shipdrag_ros.sources.log import LIMIT_NS, Tally
from shipdrag_ros.sources.stream import SourcedValues

GAP_NS = 10 * SECOND_NS
"""A longer step of the time is a gap; what was measured inside it has no time."""


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
                self.shift_days = rollover_days(day, self._given)
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


TextsAt = Callable[[Collection[int]], Mapping[int, tuple[int, str]]]

_NONE = -1  # no time of receipt
_GAP, _BEFORE = 'in a gap of the time', 'before the first time'
_BEYOND = 'no possible date'
_SHOWN = 3  # rejected sentences of a reason whose text is shown


class TakenSentences:
    """
    What the sentences of a log hold.

    Parameters
    ----------
    clock
        At the start of the log. What it cannot tell the time of is rejected.
    tally
        Where to.

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

    def __init__(self, clock: SentenceClock, tally: Tally) -> None:
        self.addresses: Counter[tuple[str, str]] = Counter()
        self.received = self.timed = False
        self.values = SourcedValues()
        self._clock = clock
        self._tally = tally
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
                self._tally.reject('time', f'{talker}{kind}: {why}', text, line)
                return
            self._stated.extend((place, time_ns))
            if self._clock.now_ns != before_ns:
                self._steps.extend((place, time_ns, received))
        for channel, reason in refused:
            self._tally.reject(channel.input, f'{talker}{kind}: {reason}', text, line)
        for channel, source, a, b in values:
            self.values.add(channel, source, place, a, b)
            self._received.append(received)

    @property
    def count(self) -> int:
        """Number of sentences."""
        return self.addresses.total()

    def samples(self, texts: TextsAt) -> Block:
        """
        Return the samples of the chosen sources, in the order of their sentences.

        Parameters
        ----------
        texts
            Gives line and text of the sentences at some places.
        """
        stated, steps = _columns(self._stated, 2), _columns(self._steps, 3)
        stated[1] += self._clock.start_ns or 0
        steps[1] += self._clock.start_ns or 0
        which, code = self.values.taken()
        place = np.array(self.values.at)[which]
        stamps, reason = _Moments(*stated, *steps).stamps(
            place, code, np.array(self._received)[which]
        )
        reason[(reason == '') & ((stamps < 0) | (stamps >= LIMIT_NS))] = _BEYOND
        lost = [
            (why, channel, place[(reason == why) & (code == channel)].tolist())
            for why in (_BEFORE, _GAP, _BEYOND)
            for channel in np.unique(code[reason == why])
        ]
        shown = texts({each for *_, places in lost for each in places[:_SHOWN]})
        for why, channel, places in lost:
            for each in places:
                line, text = shown.get(each, (0, ''))
                self._tally.reject(Channel(channel).input, why, text, line)
        good = reason == ''
        return self.values.block(which[good], code[good], stamps[good])


def _columns(values: array[int], width: int) -> Int64:
    """Return what stands one row behind the other as columns (width, n)."""
    return np.array(values, np.int64).reshape(-1, width).T.copy()


class _Moments(NamedTuple):
    """
    Times of sentences [ns].

    Attributes
    ----------
    place, time_ns
        Of those that state one.
    set_place, set_ns, set_received_ns
        Of these, those that moved the clock, and when they were received.
    """

    place: Int64
    time_ns: Int64
    set_place: Int64
    set_ns: Int64
    set_received_ns: Int64

    def stamps(self, place: Int64, code: UInt8, received: Int64) -> tuple[Int64, NDArray[np.str_]]:
        """
        Return the times (n,) of samples, and why one has none.

        Parameters
        ----------
        place, code, received : (n,)
            Of their sentences, channels and times of receipt.
        """
        stamps = received.copy()  # before the first time
        reason = np.where(received == _NONE, _BEFORE, '').astype('U32')
        if len(self.set_place):
            self._since(place, code, received, stamps, reason)
        if len(self.place):
            at = np.searchsorted(self.place, place).clip(max=len(self.place) - 1)
            own = self.place[at] == place
            stamps[own], reason[own] = self.time_ns[at[own]], ''
        return stamps, reason

    def _since(
        self,
        place: Int64,
        code: UInt8,
        received: Int64,
        stamps: Int64,
        reason: NDArray[np.str_],
    ) -> None:
        """Fill in what the last time before each sample gives."""
        last = np.searchsorted(self.set_place, place, 'right') - 1
        own = np.isin(place, self.place)
        begun = last >= 0
        noted = begun & (received != _NONE) & (self.set_received_ns[last] != _NONE)
        stamps[noted] = (self.set_ns[last] + received - self.set_received_ns[last])[noted]
        spread = np.flatnonzero(begun & ~noted & ~own)
        last = last[spread]
        step_ns = np.diff(self.set_ns)
        step_ns = np.where((step_ns > 0) & (step_ns <= GAP_NS), step_ns, 0)
        step_ns = np.append(step_ns, step_ns[-1:] if len(step_ns) else 0)  # as if it came again
        _, group, share = np.unique(
            last * len(Channel) + code[spread], return_inverse=True, return_counts=True
        )
        order = np.argsort(group, kind='stable')
        rank = np.empty(len(order), np.int64)
        rank[order] = np.arange(len(order)) - np.repeat(np.cumsum(share) - share, share)
        stamps[spread] = self.set_ns[last] + rank * step_ns[last] // share[group]
        reason[spread] = np.where((rank > 0) & (step_ns[last] == 0), _GAP, '')
        reason[noted] = ''
