# SPDX-License-Identifier: Apache-2.0
"""
Lines received live to messages of the inputs, as a driver would send them and when.

A value is stamped with the time at which its line was read: the clocks of a log
and of a GNSS receiver are not the node's. Lines that waited, as their own times show,
are stamped that much earlier. Each input is fed by one source, so
that two instruments of different place or scale are never mixed.

Few sentences state their time. The others have that of the last one that did;
where an input speaks several times before the next, its samples are spread
evenly until then. Where the logger noted when it received each line, the time
since is measured instead, on its clock.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from typing import NamedTuple

from pynmeagps.nmeatypes_core import NMEA_TALKERS

from shipdrag_ros.messages import EncodedMessage, encode, types
from shipdrag_ros.nmea import sentences
from shipdrag_ros.samples import ALL_MOTION, SECOND_NS, Block, Channel

BEHIND_NS = SECOND_NS
"""A line that comes later than others by more waited somewhere: it is of a backlog."""
_MEMORY_NS = 60 * SECOND_NS  # of the least delay; a clock that was set is known after it


class Stamped(NamedTuple):
    """A sentence, when it was measured by the clock of its receipt, and its receipt [ns]."""

    sentence: sentences.Sentence
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
        self._held: list[tuple[sentences.Sentence, int]] = []
        self._read_ns = 0
        self._stamp_ns = 0
        self._due_ns = 0  # the next that states a time
        self._waited = False
        self._timed = False

    def stamped(self, sentence: sentences.Sentence, read_ns: int) -> list[Stamped]:
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
        if isinstance(moment, sentences.SentenceTime) and moment.trusted:
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

    def _timed_by(self, behind_ns: int, sentence: sentences.Sentence) -> list[Stamped]:
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
        self.every_ns = sentences.DAY_NS  # between the last two times that it stated
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
    return (difference_ns + sentences.DAY_NS // 2) % sentences.DAY_NS - sentences.DAY_NS // 2


TOPIC = 'nmea'
"""Where lines are recorded as they came."""

SETTLE_NS = 3_000_000_000
"""So long the sources of an input are compared, before one is chosen."""

SILENT_NS = 60_000_000_000
"""A chosen source that says nothing for so long gives way to another."""

_KINDS = 50  # of unknown sentences are counted apart; a hostile talker may invent any number
_OTHERS = 'others'

# a source of an input, and the address it is heard on
HeardSentence = tuple[sentences.SentenceSource, str]


def raw_message(text: str, *, receive_ns: int) -> EncodedMessage:
    """
    Return a line as the message that is recorded.

    Parameters
    ----------
    text
        The line.
    receive_ns
        When it was read [ns since the epoch].
    """
    payload = types.serialize(types.STRING, types.make(types.STRING, data=text))
    return EncodedMessage(f'/{TOPIC}', types.STRING, payload, receive_ns, receive_ns)


@dataclass
class _Choice:
    """Which source feeds a channel."""

    since_ns: int
    counts: Counter[HeardSentence] = field(default_factory=Counter)
    held: HeardSentence | None = None
    before: HeardSentence | None = None
    last_ns: int = 0

    def takes(self, heard: HeardSentence, now_ns: int) -> bool:
        """Say whether a value of this source is used."""
        # a clock that was set back must not make it wait
        self.since_ns, self.last_ns = min(self.since_ns, now_ns), min(self.last_ns, now_ns)
        if self.held not in (None, heard) and now_ns - self.last_ns > SILENT_NS:
            self.before, self.held, self.since_ns = self.held, None, now_ns
            self.counts.clear()
        if len(self.counts) < _KINDS or heard in self.counts:
            self.counts[heard] += 1
        if self.held is None:
            if now_ns - self.since_ns < SETTLE_NS:
                return False
            self.held = sentences.best(self.counts)
        if heard != self.held:
            return False
        self.last_ns = now_ns
        return True


class Interpreter:
    """
    Makes messages of lines, and counts what gives none.

    Parameters
    ----------
    transducer_m
        Depth of the echo sounder below the surface [m]; None if unknown.

    Attributes
    ----------
    sentences
        Whose checksum is right, by address.
    rejected
        Lines that are no sentence, by address, then by reason.
    unknown
        Sentences that measure nothing that is used here, by talker and kind.
    no_value
        Values that a known sentence does not hold, by input and reason.
    behind
        Sentences of a backlog, stamped earlier than they were read, by address.
    used
        Values by input.
    not_taken
        Those of a source that was not chosen, and those that came while it was being chosen,
        by address, then by input.
    changes
        What is fed by another source than before, a sentence each, until it is taken from here.
    """

    def __init__(self, transducer_m: float | None = None) -> None:
        self.sentences: Counter[str] = Counter()
        self.rejected: defaultdict[str, Counter[str]] = defaultdict(Counter)
        self.unknown: Counter[str] = Counter()
        self.no_value: Counter[str] = Counter()
        self.behind: Counter[str] = Counter()
        self.used: Counter[str] = Counter()
        self.not_taken: defaultdict[str, Counter[str]] = defaultdict(Counter)
        self.changes: list[str] = []
        self._reader = sentences.SentenceReader(transducer_m)
        self._clocks: dict[str, WireClock] = {}
        self._choices: dict[Channel, _Choice] = {}

    def messages(self, text: str, address: str, read_ns: int) -> list[EncodedMessage]:
        """
        Return what is known of the inputs with this line.

        Lines of a backlog that state no time are held until the next one that does.

        Parameters
        ----------
        text
            The line.
        address
            Where it was heard.
        read_ns
            When it was read [ns since the epoch].
        """
        # a lost line end leaves two sentences in a line
        _, *texts = sentences.START.split(text)
        if not texts:
            self.rejected[address]['no sentence'] += 1
        found = []
        for each in texts:
            sentence = self._reader.read(each.strip())
            if isinstance(sentence, str):
                self.rejected[address][sentence] += 1
            else:
                self.sentences[address] += 1
                clock = self._clocks.setdefault(address, WireClock())
                for stamped in clock.stamped(sentence, read_ns):
                    found += self._of_sentence(stamped, address)
        return found

    def feeding(self, address: str) -> dict[str, str]:
        """Return by input the sources on an address that are used."""
        by_input: dict[str, dict[str, None]] = {}
        for channel, choice in sorted(self._choices.items()):
            if choice.held is not None and choice.held[1] == address:
                by_input.setdefault(channel.input, {})[str(choice.held[0])] = None
        return {name: ', '.join(sources) for name, sources in by_input.items()}

    def gives_way_to(self, address: str) -> str:
        """
        Return the address of the source of a motion that one on this address could take over.

        It is '' where there is none.
        """
        for channel, choice in self._choices.items():
            before = '' if choice.held is None else choice.held[1]
            speaks = any(each == address for _, each in choice.counts)
            if channel.input in ALL_MOTION and speaks and before not in ('', address):
                return before
        return ''

    def lose(self, address: str) -> None:
        """Let the sources on an address give way at once: its line is gone."""
        for choice in self._choices.values():
            if choice.held is not None and choice.held[1] == address:
                choice.last_ns = 0

    def _of_sentence(self, stamped: Stamped, address: str) -> list[EncodedMessage]:
        sentence, stamp_ns, read_ns = stamped
        if stamp_ns < read_ns:
            _count(self.behind, address)
        if sentence.name not in sentences.USED:
            _count(self.unknown, sentence.talker + sentence.kind)
        elif sentence.kind and sentence.talker not in NMEA_TALKERS:
            _count(self.unknown, f'talker {sentence.talker}')
        for channel, reason in sentence.refused:
            _count(self.no_value, f'{channel.input} {sentence.name}: {reason}')
        samples = []
        for value in sentence.values:
            choice = self._choices.setdefault(value.channel, _Choice(read_ns))
            if not choice.takes((value.source, address), read_ns):
                self.not_taken[address][value.channel.input] += 1
                continue
            before, choice.before = choice.before, None
            if before not in (None, choice.held):
                self.changes.append(
                    f'{value.channel.input}: now from {value.source} on {address}, no longer from '
                    f'{before[0]} on {before[1]}'
                )
            self.used[value.channel.input] += 1
            samples.append((int(value.channel), stamp_ns, read_ns, value.a, value.b))
        return list(encode(Block.of_samples(samples)))


def _count(counter: Counter[str], key: str) -> None:
    counter[key if key in counter or len(counter) < _KINDS else _OTHERS] += 1
