# SPDX-License-Identifier: Apache-2.0
"""
NMEA 0183 received by the node, fed to the session as topics are.

An input is fed by a topic or by NMEA, whichever was used first since the node
was activated, until the other is plainly better: twice the readings of ten
seconds, which is also the case where the first falls silent. NMEA waits some
seconds before it feeds, so a topic that is there at the start has it. The other
is counted and reported, and never mixed in. What feeds is published below
`~/nmea`, for the page and whatever else looks on.
"""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from time import monotonic

import numpy as np
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.publisher import Publisher

from shipdrag_ros.messages import EventKind, Source, decode
from shipdrag_ros.messages.topics import ERROR, OK, STALE, WARN, Status
from shipdrag_ros.nmea.interpreter import SILENT_NS, TOPIC, Interpreter, raw_message
from shipdrag_ros.nmea.live import Address, LiveNmea, SourceCounts, parse_addresses
from shipdrag_ros.nmea.sentences import NOT_STATED, READERS
from shipdrag_ros.node.health import SILENT_S
from shipdrag_ros.node.inputs import InputTopic, message_class
from shipdrag_ros.node.session import Session
from shipdrag_ros.node.settings import NodeSettings
from shipdrag_ros.samples import ALL_MOTION, SECOND_NS

_MOTION = ', '.join(
    kind
    for kind, readers in READERS.items()
    if any(channel.input in ALL_MOTION for channel, _ in readers)
)
COMPARED_S = 10.0
BETTER = 2  # times the readings in that time, from which the other source takes over
KEPT = 200  # readings of that time, more are as good
TOPIC_FEEDS, NMEA_FEEDS = 'a topic', 'NMEA'
AT_ONCE = 200  # lines between two turns of everything else
BAD_SHARE = 0.05  # of the lines of a healthy line fewer are damaged
_LOOK = 'look at what sends them, and on a serial line at baud rate and wiring'


class Rivals:
    """
    Which of a topic and NMEA feeds one input.

    Attributes
    ----------
    holder
        `TOPIC_FEEDS`, `NMEA_FEEDS`, or '' before the first reading.
    """

    def __init__(self) -> None:
        self.holder = ''
        self._readings: dict[str, deque[float]] = {}
        self._since_s: dict[str, float] = {}

    def admits(self, who: str, now_s: float) -> tuple[bool, str]:
        """
        Take a sound reading; say whether it is used, and from whom it took over, '' from none.

        Parameters
        ----------
        now_s
            Steady time [s].
        """
        self._readings.setdefault(who, deque(maxlen=KEPT)).append(now_s)
        counts = {}
        for name, times in self._readings.items():
            while times and times[0] < now_s - COMPARED_S:
                times.popleft()
            counts[name] = len(times)
        if counts[who] == 1:
            self._since_s[who] = now_s  # after a silence it has to show again that it is there
        before = self.holder
        compared = now_s >= self._since_s[who] + 0.9 * COMPARED_S
        if before not in ('', who) and compared:
            better = counts[who] >= BETTER * counts.get(before, 0)
            self.holder = who if better else before
        self.holder = self.holder or who
        changed = before not in ('', self.holder)
        return self.holder == who, before if changed else ''


class NmeaFeed:
    """
    Hears from `configure` to `close`, feeds while there is a session.

    Parameters
    ----------
    node
        Whose clock stamps what is heard.
    settings
        `nmea`, addresses separated by blanks, and `nmea_transducer_m` are used.
    session
        Returns the session, None while the node is not active.

    Raises
    ------
    ShipdragError
        If an address is none.
    """

    def __init__(
        self, node: Node, settings: NodeSettings, *, session: Callable[[], Session | None]
    ) -> None:
        self._node = node
        self._session = session
        self._topics: dict[str, InputTopic] = {}
        transducer_m = settings.nmea_transducer_m
        self._transducer_m = transducer_m if transducer_m >= 0.0 else None
        self.renew()
        self._unused = 0
        self._problems: dict[Address, str] = {}
        self._published: dict[Source, Publisher] = {}
        self._live = LiveNmea(
            parse_addresses(settings.nmea),
            clock_ns=lambda: int(node.get_clock().now().nanoseconds),
            wake=self._wake,
        )
        self._guard = node.create_guard_condition(self._drain)

    def start(self, topics: list[InputTopic]) -> None:
        """
        Begin to hear, for these inputs.
        """
        self._topics = {topic.name: topic for topic in topics}
        for topic in topics:
            topic.may_be_fed = bool(self._live.counts())
        self._live.start()
        for address in self._live.counts():
            self._node.get_logger().info(f'hearing NMEA 0183 on {address}')

    def close(self) -> None:
        """
        End all threads.
        """
        self._live.close()
        self._node.destroy_guard_condition(self._guard)
        for publisher in self._published.values():
            self._node.destroy_publisher(publisher)

    def renew(self) -> None:
        """
        Choose anew who feeds what: the node was activated.
        """
        self._interpreter = Interpreter(self._transducer_m)
        self._rivals: defaultdict[str, Rivals] = defaultdict(Rivals)
        self._topic_refused: Counter[str] = Counter()
        self._nmea_refused: Counter[str] = Counter()
        for topic in self._topics.values():
            topic.fed_by, topic.fed = '', None

    def admits(self, source: Source, payload: bytes, now_ns: int) -> bool:
        """
        Say whether a message of a topic may be used.
        """
        if not self._live.counts():
            return True
        rivals = self._rivals[source.input]
        sound = rivals.holder == TOPIC_FEEDS or _is_sound(source, payload)
        if not (rivals.holder or sound):
            return True
        if not (sound and self._decides(source.input, TOPIC_FEEDS, now_ns)):
            self._topic_refused[source.input] += 1
            return False
        self._topics[source.input].fed_by, self._topics[source.input].fed = '', None
        return True

    def _decides(self, name: str, who: str, now_ns: int) -> bool:
        """Say whether a reading of one of both is used; a change is said and recorded."""
        used, before = self._rivals[name].admits(who, monotonic())
        session = self._session()
        if before and session is not None:
            text = f'{name}: now from {who}, no longer from {before}, which sends less'
            self._say(text, session, now_ns)
        return used

    def _say(self, text: str, session: Session, now_ns: int) -> None:
        self._node.get_logger().warning(text)
        session.note(EventKind.SOURCE, text, now_ns)

    def silence(self) -> str:
        """
        Say what is heard of each source while no motion is known; '' without sources.
        """
        return '; '.join(
            f'NMEA {address}: {self._heard(str(address), count)}'
            for address, count in self._live.counts().items()
        )

    def _heard(self, address: str, counts: SourceCounts) -> str:
        if counts.problem:
            return counts.problem
        if not counts.lines:
            return 'open, nothing heard yet'
        if not self._interpreter.sentences[address]:
            return f'{counts.lines} lines heard, none a sentence{self._why(address)}: {_LOOK}'
        if counts.age_s is not None and counts.age_s > SILENT_S:
            return f'no line for {counts.age_s:.0f} s'
        if before := self._interpreter.gives_way_to(address):
            return (
                f'{counts.lines} lines heard; {before} was chosen, and gives way when it has '
                f'said nothing for {SILENT_NS / SECOND_NS:.0f} s'
            )
        return f'{counts.lines} lines heard, none of use yet for speed or position ({_MOTION})'

    def _why(self, address: str) -> str:
        reasons = ', '.join(self._interpreter.rejected[address])
        return f' ({reasons})' if reasons else ''

    def statuses(self) -> list[Status]:
        """
        Say how each source is doing; a change of the line is logged too.
        """
        said = []
        for address, counts in self._live.counts().items():
            if counts.problem != self._problems.get(address, 'not opened yet'):
                log = self._node.get_logger()
                if counts.problem:
                    self._interpreter.lose(str(address))
                    log.warning(f'NMEA {address}: {counts.problem}')
                else:
                    log.info(f'NMEA {address}: open')
                self._problems[address] = counts.problem
            said.append(self._status(str(address), counts))
        return said

    def _wake(self) -> None:
        with suppress(rclpy_implementation.InvalidHandle):  # the node goes while a line comes
            self._guard.trigger()

    def _drain(self) -> None:
        for line in self._live.take(AT_ONCE):
            session = self._session()
            now_ns = int(self._node.get_clock().now().nanoseconds)
            if session is None or now_ns == 0 or line.read_ns == 0:
                self._unused += 1
                continue
            raw = raw_message(line.text, receive_ns=line.read_ns)
            session.keep(Source(TOPIC, raw.type), raw.payload, now_ns)
            for message in self._interpreter.messages(line.text, str(line.address), line.read_ns):
                source = Source(message.topic.lstrip('/'), message.type)
                topic = self._topics[source.input]
                if not self._decides(source.input, NMEA_FEEDS, now_ns):
                    self._nmea_refused[source.input] += 1
                    continue
                topic.feed(f'NMEA {line.address}', self._publish(source, message.payload))
                session.receive(source, message.payload, now_ns, topic.count)
            while self._interpreter.changes:
                self._say(self._interpreter.changes.pop(0), session, now_ns)
        if self._live.waiting:
            self._wake()

    def _publish(self, source: Source, payload: bytes) -> Source:
        """Show a reading to other processes; return topic and type."""
        if source not in self._published:
            self._published[source] = self._node.create_publisher(
                message_class(source.type), f'~/nmea/{source.input}', 10
            )
        self._published[source].publish(payload)
        return Source(self._published[source].topic_name, source.type)

    def _status(self, address: str, counts: SourceCounts) -> Status:
        level, text = self._health(address, counts)
        found = self._interpreter
        values: dict[str, object] = {
            'times opened': counts.opened,
            'lines': counts.lines,
            'age [s]': counts.age_s,
            'lines too long': counts.too_long,
            'lines that are not text': counts.binary,
            'waits for a flood to pass': counts.flooded,
            'datagrams dropped by the system': counts.dropped,
            'of all sources: lines lost, none took them': self._live.lost,
            'of all sources: lines not used, node inactive or without clock': self._unused,
            'sentences': found.sentences[address],
        }
        groups: tuple[tuple[str, Mapping[str, object]], ...] = (
            ('rejected', found.rejected[address]),
            ('of all sources: unknown sentence', found.unknown),
            ('of all sources: no value', found.no_value),
            ('feeds', found.feeding(address)),
            ('of all sources: used', found.used),
            ('of a backlog, stamped by their own times', found.behind),
            ('not taken, of another source', found.not_taken[address]),
            ('not used, a topic feeds', self._nmea_refused),
            ('messages of the topic not used, NMEA feeds', self._topic_refused),
        )
        for group, entries in groups:
            values |= {f'{group} {name}': value for name, value in entries.items()}
        return Status.of(f'nmea {address}', level, text, values)

    def _health(self, address: str, counts: SourceCounts) -> tuple[int, str]:
        found = self._interpreter
        sound = found.sentences[address]
        bad = found.rejected[address].total() + counts.too_long + counts.binary
        if counts.problem:
            return ERROR, counts.problem
        if counts.age_s is None:
            return WARN, 'open, nothing heard yet'
        if counts.age_s > SILENT_S:
            return STALE, f'no line for {counts.age_s:.0f} s'
        if counts.dropped or counts.flooded or self._live.lost:
            return WARN, 'more lines than any ship sends: not all of them can be used'
        if bad > BAD_SHARE * max(sound + bad, 20):
            return WARN, (f'{bad} of {sound + bad} lines are damaged{self._why(address)}: {_LOOK}')
        if self._topic_refused:
            names = ', '.join(self._topic_refused)
            return WARN, f'{names}: also published as a topic, which is not used; NMEA was first'
        used = [f'{name} from {source}' for name, source in found.feeding(address).items()]
        if 'depth' not in found.used and any(each.endswith(NOT_STATED) for each in found.no_value):
            used.append(
                'depth is not used: set nmea_transducer_m, as the sentences state no offset'
            )
        return OK, '; '.join(used) or 'heard, nothing used yet'


def _is_sound(source: Source, payload: bytes) -> bool:
    """Whether a message holds a reading that is a number."""
    block = decode(source, [payload], [0]).block
    return len(block) > 0 and bool(np.isfinite(block.value[:, 0]).any())
