# SPDX-License-Identifier: Apache-2.0
"""
Sentences of NMEA 0183 to samples with a time, in their order.

One pass takes what the sentences hold; then it is known who sends what, and on which
day. A sample whose sentence states no time has that of the last one that did; where an
input speaks several times before the next, its samples are spread evenly until then.
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
    SentenceSource,
    SentenceTime,
    days_of,
)
from shipdrag_ros.samples import INPUTS, SECOND_NS, Block, Channel, Int64, UInt8
from shipdrag_ros.sources.log import Refused, Rejected
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


TextsAt = Callable[[Collection[int]], Mapping[int, tuple[int, str]]]

_NONE = -1  # no time of receipt, no date
_GAP, _BEFORE = 'in a gap of the time', 'before the first time'
_SHOWN = 3  # rejected sentences of a reason whose text is shown


class TakenSentences:
    """
    What the sentences of a log hold.

    Attributes
    ----------
    values
        What they measure, by the places of their texts.
    addresses
        Number of sentences by talker and kind.
    received
        Whether any has a time of receipt.
    first, first_received_ns
        The first time with a date that its source calls valid, and when it was received.
    """

    def __init__(self) -> None:
        self.addresses: Counter[tuple[str, str]] = Counter()
        self.received = False
        self.first: SentenceTime | None = None
        self.first_received_ns: int | None = None
        self.values: SourcedValues[SentenceSource] = SourcedValues()
        self._received = array('q')  # of the values
        self._reasons: dict[tuple[str, str], int] = {}
        self._times = array('q')  # six of each sentence that states one, or should
        self._rejected = array('q'), array('i')  # places and reasons by number
        self._without_time = array('q')
        self._texts: dict[int, tuple[int, str]] = {}
        self._addresses: dict[str, int] = {}

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
        before = len(self._rejected[0])
        talker, kind, moment, values, refused = sentence
        self.addresses[talker, kind] += 1
        received = _NONE
        if receive_ns is not None:
            received, self.received = receive_ns, True
        if moment is not None:
            self._take_time(place, sentence, received)
        for channel, reason in refused:
            self._reject(channel.input, f'{talker}{kind}: {reason}', place)
        for channel, source, a, b in values:
            self.values.add(channel, source, place, a, b)
            self._received.append(received)
        if len(self._rejected[0]) > before and len(self._texts) < _SHOWN * len(self._reasons):
            self._texts[place] = line, text

    def _take_time(self, place: int, sentence: Sentence, received: int) -> None:
        moment = sentence.time
        if isinstance(moment, NoValue):
            self._without_time.append(place)
            self._reject('time', f'{sentence.talker}{sentence.kind}: {moment}', place)
            return
        assert moment is not None
        if self.first is None and moment.trusted and moment.day is not None:
            self.first, self.first_received_ns = moment, None if received == _NONE else received
        known, address = self._addresses, sentence.talker + sentence.kind
        day = _NONE if moment.day is None else moment.day
        number = known.setdefault(address, len(known))
        self._times.extend((place, received, moment.of_day_ns, day, moment.trusted, number))

    def _reject(self, name: str, reason: str, place: int) -> None:
        places, reasons = self._rejected
        places.append(place)
        reasons.append(self._reasons.setdefault((name, reason), len(self._reasons)))

    @property
    def timed(self) -> bool:
        """Whether any states a time."""
        return bool(self._times)

    @property
    def count(self) -> int:
        """Number of sentences."""
        return self.addresses.total()

    def samples(self, clock: SentenceClock) -> Block:
        """
        Return the samples of the chosen sources, in the order of their sentences.

        Parameters
        ----------
        clock
            At the start of the log. What it cannot tell the time of is rejected.
        """
        moments = self._resolve(clock)
        which, code = self.values.taken()
        place = np.array(self.values.at)
        timed = ~np.isin(place[which], self._without_time)
        which, code = which[timed], code[timed]
        place, received = place[which], np.array(self._received)[which]
        stamps, reason = moments.stamps(place, code, received)
        for why in (_BEFORE, _GAP):
            for where, number in zip(place[reason == why], code[reason == why], strict=True):
                self._reject(Channel(number).input, why, int(where))
        good = reason == ''
        return self.values.block(which[good], code[good], stamps[good])

    def _resolve(self, clock: SentenceClock) -> _Moments:
        """Follow the clock through the sentences that state a time."""
        stated, steps = array('q'), array('q')
        addresses = list(self._addresses)
        for place, received, of_day_ns, day, trusted, address in zip(*6 * [iter(self._times)]):
            moment = SentenceTime(of_day_ns, None if day == _NONE else day, bool(trusted))
            receive_ns = None if received == _NONE else received
            try:
                time_ns = clock.resolve(moment, receive_ns)
            except NoValue as reason:
                self._without_time.append(place)
                self._reject('time', f'{addresses[address]}: {reason}', place)
                continue
            now_ns = clock.now_ns
            # a little earlier: sentences of one fix, or of two receivers, out of order
            if now_ns is None or time_ns > now_ns or time_ns < now_ns - GAP_NS:
                clock.now_ns = time_ns
                steps.extend((place, time_ns, received))
            stated.extend((place, time_ns))
        return _Moments(*_columns(stated, 2), *_columns(steps, 3))

    def rejected(self, texts: TextsAt) -> Refused:
        """
        Return what was rejected, by input or 'time', and reason.

        Parameters
        ----------
        texts
            Gives line and text of the sentences at some places.
        """
        places, reasons = (np.array(each) for each in self._rejected)
        lost = np.isin(places, self._without_time)  # of these their time alone is said
        shown: dict[tuple[str, str], list[int]] = {}
        counts: dict[tuple[str, str], int] = {}
        for key, number in self._reasons.items():
            of_reason = places[(reasons == number) & ((key[0] == 'time') | ~lost)]
            if len(of_reason):
                counts[key] = len(of_reason)
                shown[key] = np.sort(of_reason)[:_SHOWN].tolist()
        wanted = {place for some in shown.values() for place in some}
        found = {**self._texts, **texts(wanted - self._texts.keys())}
        made: Refused = {}
        for name in (*INPUTS, 'time'):
            for (of, reason), first in shown.items():
                if of == name:
                    rejected = made.setdefault(name, {}).setdefault(reason, Rejected())
                    for place in first:
                        rejected.add(*found[place])
                    rejected.count = counts[of, reason]
        return made


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
