# SPDX-License-Identifier: Apache-2.0
"""
Lines heard live to messages of the inputs, as a driver would send them.

A value is stamped with the time at which its line was read: the clocks of a log
and of a GNSS receiver are not the node's. Lines that waited, as their own times show,
are stamped that much earlier. Each input is fed by one source, so
that two instruments of different place or scale are never mixed.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from pynmeagps.nmeatypes_core import NMEA_TALKERS

from shipdrag_ros.messages import EncodedMessage, encode, types
from shipdrag_ros.nmea.clock import Stamped, WireClock
from shipdrag_ros.nmea.reading import START, SentenceReader, SentenceSource, best
from shipdrag_ros.nmea.sentences import READERS, TIMED, Mounting
from shipdrag_ros.samples import Block, Channel

TOPIC = 'nmea'
"""Where lines are recorded as they came."""

SETTLE_NS = 3_000_000_000
"""So long the sources of an input are compared, before one is chosen."""

SILENT_NS = 60_000_000_000
"""A chosen source that says nothing for so long gives way to another."""

_KINDS = 50  # of unknown sentences are counted apart; a hostile talker may invent any number
_OTHERS = 'others'

# a source of an input, and the address it is heard on
HeardSentence = tuple[SentenceSource, str]


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
    last_ns: int = 0

    def takes(self, heard: HeardSentence, now_ns: int) -> bool:
        """Say whether a value of this source is used."""
        # a clock that was set back must not make it wait
        self.since_ns, self.last_ns = min(self.since_ns, now_ns), min(self.last_ns, now_ns)
        if self.held not in (None, heard) and now_ns - self.last_ns > SILENT_NS:
            self.held, self.since_ns = None, now_ns
            self.counts.clear()
        if len(self.counts) < _KINDS or heard in self.counts:
            self.counts[heard] += 1
        if self.held is None:
            if now_ns - self.since_ns < SETTLE_NS:
                return False
            self.held = best(self.counts)
        if heard != self.held:
            return False
        self.last_ns = now_ns
        return True


class Interpreter:
    """
    Makes messages of lines, and counts what gives none.

    Parameters
    ----------
    mounting
        What the sentences do not say about the ship.

    Attributes
    ----------
    sentences
        Whose checksum is right.
    rejected
        Lines that are no sentence, by reason.
    unknown
        Sentences that measure nothing that is used here, by address.
    no_value
        Values that a known sentence does not hold, by input and reason.
    behind
        Sentences of a backlog, stamped earlier than they were read, by address.
    used, not_taken
        Values by input; not taken are those of a source that was not chosen, and those that
        came while it was being chosen.
    """

    def __init__(self, mounting: Mounting | None = None) -> None:
        self.sentences = 0
        self.rejected: Counter[str] = Counter()
        self.unknown: Counter[str] = Counter()
        self.no_value: Counter[str] = Counter()
        self.behind: Counter[str] = Counter()
        self.used: Counter[str] = Counter()
        self.not_taken: Counter[str] = Counter()
        self._reader = SentenceReader(mounting)
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
        _, *texts = START.split(text)
        if not texts:
            self.rejected['no sentence'] += 1
        found = []
        for each in texts:
            sentence = self._reader.read(each.strip())
            if isinstance(sentence, str):
                self.rejected[sentence] += 1
            else:
                self.sentences += 1
                clock = self._clocks.setdefault(address, WireClock())
                for stamped in clock.stamped(sentence, read_ns):
                    found += self._of_sentence(stamped, address)
        return found

    def feeding(self) -> dict[str, str]:
        """
        Return by input the sources that are used.
        """
        by_input: dict[str, dict[str, None]] = {}
        for channel, choice in sorted(self._choices.items()):
            if choice.held is not None:
                by_input.setdefault(channel.input, {})[str(choice.held[0])] = None
        return {name: ', '.join(sources) for name, sources in by_input.items()}

    def _of_sentence(self, stamped: Stamped, address: str) -> list[EncodedMessage]:
        sentence, stamp_ns, read_ns = stamped
        if stamp_ns < read_ns:
            _count(self.behind, address)
        if sentence.kind not in READERS:
            if sentence.kind not in TIMED:
                _count(self.unknown, sentence.talker + sentence.kind)
            return []
        if sentence.talker not in NMEA_TALKERS:
            _count(self.unknown, f'talker {sentence.talker}')
        for channel, reason in sentence.refused:
            _count(self.no_value, f'{channel.input} {sentence.kind}: {reason}')
        samples = []
        for value in sentence.values:
            choice = self._choices.setdefault(value.channel, _Choice(read_ns))
            if not choice.takes((value.source, address), read_ns):
                self.not_taken[value.channel.input] += 1
                continue
            self.used[value.channel.input] += 1
            samples.append((int(value.channel), stamp_ns, read_ns, value.a, value.b))
        return list(encode(Block.of_samples(samples)))


def _count(counter: Counter[str], key: str) -> None:
    counter[key if key in counter or len(counter) < _KINDS else _OTHERS] += 1
