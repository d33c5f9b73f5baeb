# SPDX-License-Identifier: Apache-2.0
"""
Sentences of NMEA 0183 to samples with a time, in their order.

A sample whose sentence states no time waits until the next time is stated.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from shipdrag_ros.nmea.clock import GAP_NS, SentenceClock, SentenceTime
from shipdrag_ros.nmea.framing import Sentence
from shipdrag_ros.nmea.sentences import (
    TIMED,
    Fields,
    MeasuredValue,
    Mounting,
    NoValue,
)
from shipdrag_ros.nmea.values import SentenceSource, read_values
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.sources.log import Rejected

_WAITING_SAMPLES = 16384  # in GAP_NS, of all inputs
_GAP = 'in a gap of the time'


@dataclass
class _Waiting:
    """A sample; its time is None until the next time is stated."""

    channel: Channel
    value: MeasuredValue
    line: int
    text: str
    stamp_ns: int | None


@dataclass
class SentenceConverter:
    """
    Turns sentences into samples and counts what becomes of them.

    Attributes
    ----------
    chosen
        Source of each channel.
    clock
        At the start of the log.
    mounting
        See there.
    written
        Samples by input.
    rejected
        By input or 'time', and reason.
    sentences
        Number taken.
    backward, repeated
        Samples stamped before, or as, an earlier one of their channel.
    start_ns, newest_ns
        First and largest stamp [ns].
    """

    chosen: Mapping[Channel, SentenceSource]
    clock: SentenceClock
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
        """
        Take the samples of one sentence.
        """
        self.sentences += 1
        try:
            stamp_ns = self._time(sentence)
        except NoValue as reason:
            self._reject('time', sentence, reason)
            return
        for channel, source, value in read_values(sentence, self.mounting):
            if isinstance(value, NoValue):
                self._reject(channel.input, sentence, value)
            elif source == self.chosen[channel]:
                self._wait(_Waiting(channel, value, sentence.line, sentence.text, stamp_ns))

    def finish(self) -> None:
        """
        Take what still waits, as if the last step of the time came once more.
        """
        self._settle(self._step_ns)

    def pop(self) -> Block:
        """
        Return the samples taken since the last time.
        """
        samples, self._samples = self._samples, []
        return Block.of_samples(samples)

    def _time(self, sentence: Sentence) -> int | None:
        """Return the time of a sentence, None if only the next one states it; NoValue if none."""
        fields = Fields(sentence.kind, sentence.fields) if sentence.kind in TIMED else None
        if fields is None or not fields['time']:
            return self.clock.since(sentence.receive_ns)
        time_ns = self.clock.resolve(SentenceTime(fields), sentence.receive_ns)
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
