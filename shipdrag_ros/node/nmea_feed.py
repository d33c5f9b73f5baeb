# SPDX-License-Identifier: Apache-2.0
"""
NMEA 0183 heard by the node, fed to the session as topics are.

An input is fed by a topic or by NMEA, whichever was used first since the node
was activated; NMEA waits some seconds before it feeds, so a topic that is there
at the start has it. The other is counted and reported, and never mixed in.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

from shipdrag_ros.messages import Source
from shipdrag_ros.nmea.address import Address, parse_addresses
from shipdrag_ros.nmea.interpreter import TOPIC, Interpreter, raw_message
from shipdrag_ros.nmea.listener import SourceCounts
from shipdrag_ros.nmea.live import LiveNmea
from shipdrag_ros.nmea.sentences import NOT_STATED, READERS, Mounting
from shipdrag_ros.node.diagnostics import ERROR, OK, STALE, WARN, nmea_status
from shipdrag_ros.node.inputs import InputTopic
from shipdrag_ros.node.judging import SILENT_S
from shipdrag_ros.node.session import Session
from shipdrag_ros.node.settings import NodeSettings
from shipdrag_ros.samples import MOTION_INPUTS

_MOTION = ', '.join(
    kind
    for kind, readers in READERS.items()
    if any(channel.input in MOTION_INPUTS for channel, _ in readers)
)
AT_ONCE = 200  # lines between two turns of everything else
BAD_SHARE = 0.05  # of the lines of a healthy line fewer are damaged


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
        self._mounting = Mounting(transducer_m if transducer_m >= 0.0 else None)
        self._interpreter = Interpreter(self._mounting)
        self._fed_by_topic: set[str] = set()
        self._fed_by_nmea: set[str] = set()
        self._topic_refused: Counter[str] = Counter()
        self._nmea_refused: Counter[str] = Counter()
        self._unused = 0
        self._problems: dict[str, str] = {}
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

    def renew(self) -> None:
        """
        Choose anew who feeds what: the node was activated.
        """
        self._interpreter = Interpreter(self._mounting)
        for one in (self._fed_by_topic, self._fed_by_nmea):
            one.clear()
        self._topic_refused.clear()
        self._nmea_refused.clear()
        for topic in self._topics.values():
            topic.fed_by = ''

    def admits(self, topic: InputTopic) -> bool:
        """
        Say whether a message of a topic may be used.
        """
        if topic.name in self._fed_by_nmea:
            self._topic_refused[topic.name] += 1
            return False
        self._fed_by_topic.add(topic.name)
        return True

    def silence(self) -> str:
        """
        Say what is heard of each source while no motion is known; '' without sources.
        """
        return '; '.join(
            f'NMEA {address}: {self._heard(count)}'
            for address, count in self._live.counts().items()
        )

    def _heard(self, counts: SourceCounts) -> str:
        if counts.problem:
            return counts.problem
        if not counts.lines:
            return 'open, nothing heard yet'
        if not self._interpreter.sentences:
            return f'{counts.lines} lines heard, none a sentence: look at baud rate and wiring'
        if counts.age_s is not None and counts.age_s > SILENT_S:
            return f'no line for {counts.age_s:.0f} s'
        return f'{counts.lines} lines heard, none of use yet for speed or position ({_MOTION})'

    def statuses(self) -> list[DiagnosticStatus]:
        """
        Say how each source is doing; a change of the line is logged too.
        """
        counts = self._live.counts()
        self._log_changes(counts)
        return [self._status(str(address), of_one) for address, of_one in counts.items()]

    def _log_changes(self, counts: Mapping[Address, SourceCounts]) -> None:
        for address, count in counts.items():
            before = self._problems.get(str(address), 'not opened yet')
            if count.problem != before:
                log = self._node.get_logger()
                if count.problem:
                    log.warning(f'NMEA {address}: {count.problem}')
                else:
                    log.info(f'NMEA {address}: open')
                self._problems[str(address)] = count.problem

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
                if source.input in self._fed_by_topic:
                    self._nmea_refused[source.input] += 1
                    continue
                self._fed_by_nmea.add(source.input)
                topic.feed(f'NMEA {line.address}')
                session.receive(source, message.payload, now_ns, topic.count)
        if self._live.waiting:
            self._wake()

    def _status(self, address: str, counts: SourceCounts) -> DiagnosticStatus:
        level, text = self._health(counts)
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
            'of all sources: sentences': found.sentences,
        }
        groups: tuple[tuple[str, Mapping[str, object]], ...] = (
            ('rejected', found.rejected),
            ('unknown sentence', found.unknown),
            ('no value', found.no_value),
            ('feeds', found.feeding()),
            ('used', found.used),
            ('of a backlog, stamped by their own times', found.behind),
            ('not taken, of another source', found.not_taken),
            ('not used, a topic feeds', self._nmea_refused),
            ('messages of the topic not used, NMEA feeds', self._topic_refused),
        )
        for group, entries in groups:
            values |= {f'{group} {name}': value for name, value in entries.items()}
        return nmea_status(address, level, text, values)

    def _health(self, counts: SourceCounts) -> tuple[bytes, str]:
        found = self._interpreter
        bad = found.rejected.total() + counts.too_long + counts.binary
        if counts.problem:
            return ERROR, counts.problem
        if counts.age_s is None:
            return WARN, 'open, nothing heard yet'
        if counts.age_s > SILENT_S:
            return STALE, f'no line for {counts.age_s:.0f} s'
        if counts.dropped or counts.flooded or self._live.lost:
            return WARN, 'more lines than any ship sends: not all of them can be used'
        if bad > BAD_SHARE * max(found.sentences + bad, 20):
            return WARN, (
                f'{bad} of {found.sentences + bad} lines are damaged; look at baud rate and wiring'
            )
        if self._topic_refused:
            names = ', '.join(self._topic_refused)
            return WARN, f'{names}: also published as a topic, which is not used; NMEA was first'
        feeding = found.feeding()
        used = [f'{name} from {source}' for name, source in feeding.items()]
        unstated = any(each.endswith(NOT_STATED) for each in found.no_value)
        if unstated and 'depth' not in feeding:
            used.append(
                'depth is not used: set nmea_transducer_m, as the sentences state no offset'
            )
        return OK, '; '.join(used) or 'heard, nothing used yet'
