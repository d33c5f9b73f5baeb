# SPDX-License-Identifier: Apache-2.0
"""
Input topics: found in the graph, subscribed as bytes, counted.

Nobody has to say which of the accepted types a driver publishes, or whether it
sends reliably, and nobody is left wondering why a topic is silent.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import Any, NamedTuple

from rclpy.event_handler import (
    QoSMessageLostInfo,
    QoSRequestedIncompatibleQoSInfo,
    SubscriptionEventCallbacks,
    UnsupportedEventTypeError,
)
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_policy_name_from_kind,
)
from rclpy.subscription import Subscription

from shipdrag_ros.coastdown.events import InputCounts
from shipdrag_ros.display import printable
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.messages import Decoded, Source
from shipdrag_ros.messages.types import is_stamped
from shipdrag_ros.node.health import InputFacts
from shipdrag_ros.samples import FURTHER, SECOND_NS


class Sequences:
    """
    Holes in the sequence numbers of the publishers of one topic: what never came.

    A middleware says that a queue ran over, if at all, only where it notices; the numbers that
    a publisher gives its messages show every hole.

    Parameters
    ----------
    publishers
        Returns the identities of the publishers there are now.

    Attributes
    ----------
    lost
        Messages that were sent and not heard.
    numbered
        Whether the middleware gives numbers at all.

    Notes
    -----
    A message does not say who sent it. Its number is taken to follow the nearest one
    below it, which counts right as long as no publisher comes while another loses messages.
    What was sent before the first message heard is not lost: nobody listened.
    """

    def __init__(self, publishers: Callable[[], frozenset[str]]) -> None:
        self.lost = 0
        self.numbered = False
        self._publishers = publishers
        self._known: frozenset[str] = frozenset()
        self._last: list[int] = []  # of each stream, the one heard longest ago first

    def take(self, number: int | None) -> None:
        """
        Take the sequence number of the next message, None if it has none.
        """
        if number is None:
            return
        self.numbered = True
        if number - 1 not in self._last:
            self.look()  # a hole, or a publisher that nobody knew
        new = number - 1 not in self._last and len(self._last) < len(self._known)
        before = max((last for last in self._last if last < number), default=None)
        if before is not None and not new:
            self.lost += number - before - 1
            self._last.remove(before)
        self._last.append(number)

    def look(self) -> None:
        """
        Note which publishers there are.
        """
        now = self._publishers()
        if self._known - now:
            self._last.clear()  # whose stream has ended is not known
        self._known = now
        del self._last[: max(len(self._last) - max(len(now), 1), 0)]


MOST = 200  # messages of a topic at once: some tens of ms, so that timers are kept


class Mailbox:
    """
    The messages of some topics, in the order in which they came.

    An executor takes one message of each topic in turn. After a pause, a topic at 1 Hz would
    so be ten times further in time than one at 10 Hz, whose readings would then be rejected
    as late.

    Parameters
    ----------
    topics
        Where they wait.
    """

    def __init__(self, topics: Sequence[InputTopic]) -> None:
        self._topics = topics
        self._waiting: list[HeardMessage] = []

    def take(self, *, ahead: bool) -> list[HeardMessage]:
        """
        Return what has come so far, or the older part of it where that is much.

        Parameters
        ----------
        ahead
            Whether to take what the executor has not come to. Not under simulated time: /clock
            waits among its messages, and what overtakes it seems to come from the future.
        """
        until_ns = sys.maxsize
        for topic in self._topics:
            taken = topic.take(MOST, ahead=ahead)
            self._waiting += taken
            if len(taken) == MOST:  # there may be more, that the others must wait for
                until_ns = min(until_ns, taken[-1].received_ns)
        self._waiting.sort(key=lambda heard: heard.received_ns)
        ready = sum(heard.received_ns <= until_ns for heard in self._waiting)
        taken, self._waiting = self._waiting[:ready], self._waiting[ready:]
        return taken


# As deep as Fast DDS goes unless set otherwise, some seconds of a flood: one estimate may take
# as long as many messages.
DEPTH = 5000
LONGEST_BYTES = 65536  # no instrument sends a message as long; thousands may have to wait
TRIES = 5
SHARE_HZ = 1000  # of one input, as of one source of NMEA; a flood takes no time from the others
_OFFSETS = 32  # readings whose clock offset is kept
# who joins late still gets the last message
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PATIENCE_S = 10.0  # a type that is subscribed has so long to show that it is sound
_UNKNOWN = '_NODE_NAME_UNKNOWN_'  # of rcl


def message_class(type_name: str) -> Any:
    """
    Return the class of a type such as `geometry_msgs/msg/TwistStamped`.

    Raises
    ------
    ShipdragError
        If its package is not installed.
    """
    package, kind, name = type_name.split('/')
    try:
        return getattr(importlib.import_module(f'{package}.{kind}'), name)
    except ModuleNotFoundError as error:
        raise ShipdragError(
            f'{type_name} cannot be heard: the package {package} is not installed here'
        ) from error


def is_installed(type_name: str) -> bool:
    """
    Say whether the package of a type is there.
    """
    return importlib.util.find_spec(type_name.partition('/')[0]) is not None


class HeardMessage(NamedTuple):
    """A message, and when the middleware of this computer got it [ns, 0 if it does not say]."""

    topic: InputTopic
    type: str
    data: bytes
    received_ns: int


class InputTopic:
    """
    One input: its subscription, once its type is known, and what became of its messages.

    Parameters
    ----------
    name
        Of the input, which is its topic before remapping.
    accepted
        Types that can be decoded, the preferred one first.
    fixed
        Type set by the user, '' for the one in the graph.
    arrived
        Called when there is something to `take`.
    simulated
        Whether the clock is simulated, so that a second may hold any number of messages.

    Attributes
    ----------
    accepted, absent
        Types that can be heard; that could be, were their packages installed.
    type
        Type subscribed to, None until known.
    reliable
        Whether the subscription asks for what got lost again; only where all publishers offer
        it, because one that does not would not be heard.
    publishers
        Number by type.
    senders
        Names of the nodes that publish, one a publisher of the type heard.
    received, unused
        Messages heard; heard while not active or without a clock.
    reported_lost
        Messages that the middleware says it lost.
    dropped
        Messages that came while too many waited here.
    unreadable
        Messages that gave no sample, by reason, and joints that have no place.
    fed_by
        What feeds the input instead of its topic, '' if nothing does.
    fed
        Topic and type under which that is published again; None without it.
    may_be_fed
        Whether something else than the topic could feed it.
    unstamped
        Readings whose header holds no time.
    """

    def __init__(
        self,
        node: Node,
        name: str,
        *,
        accepted: tuple[str, ...],
        fixed: str,
        arrived: Callable[[], object],
        simulated: bool,
    ) -> None:
        self._node = node
        self._arrived = arrived
        self._subscription: Subscription | None = None
        self._last_s: float | None = None
        self._taken: list[HeardMessage] = []
        self._found: list[Any] = []
        self._sequences = Sequences(self._identities)
        self._offsets_s: deque[float] = deque(maxlen=_OFFSETS)
        self._least_lag_s: float | None = None
        self._fixed = bool(fixed)
        self._share = None if simulated else [0, 0]  # second of arrival, messages in it
        self._since_s = 0.0
        self.name = name
        self.topic = node.resolve_topic_name(name)
        self.accepted = tuple(filter(is_installed, accepted))
        self.absent = tuple(name for name in accepted if name not in self.accepted)
        self.type: str | None = None
        self.reliable = True
        self.publishers: Counter[str] = Counter()
        self.senders: tuple[str, ...] = ()
        self.incompatible_qos: str | None = None
        self.received = 0
        self.unused = 0
        self.reported_lost = 0
        self.dropped = 0
        self.unstamped = 0
        self.unreadable: Counter[str] = Counter()
        self.fed_by = ''
        self.fed: Source | None = None
        self.may_be_fed = False
        if fixed:
            self._subscribe(fixed, reliable=True)

    def look(self) -> None:
        """
        Read the graph, and subscribe once a type is there, as its publishers offer it.
        """
        self._sequences.look()
        self.publishers = Counter(printable(info.topic_type) for info in self._found)
        type_name = self.type
        if type_name is None or (not self._fixed and type_name not in self.publishers):
            type_name = next(iter(self._published()), type_name)
            if type_name is None:
                return
        heard = [info for info in self._found if info.topic_type == type_name]
        self.senders = tuple(sorted(_sender(info) for info in heard))
        reliable = all(
            info.qos_profile.reliability == ReliabilityPolicy.RELIABLE for info in heard
        )
        if self.type != type_name or (heard and reliable is not self.reliable):
            self._subscribe(type_name, reliable=reliable)

    def rebind(self, why: str) -> bool:
        """
        Subscribe to another accepted type that is published, as the one subscribed is no use.

        Parameters
        ----------
        why
            What is wrong with it, for the log.

        Returns
        -------
        bool
            False where the user has fixed the type, no other is published, or the last
            subscription is younger than `PATIENCE_S`.
        """
        others = [name for name in self._published() if name != self.type]
        if self._fixed or not others or time.monotonic() < self._since_s + PATIENCE_S:
            return False
        self._node.get_logger().warning(
            f'{self.name}: {self.type} is given up for {others[0]}, which is published too: {why}'
        )
        self._subscribe(others[0], reliable=False)  # the next look asks for more
        return True

    def _published(self) -> list[str]:
        return [name for name in self.accepted if name in self.publishers]

    @property
    def is_shown(self) -> bool:
        """Whether to speak of it: of a further instrument, where it is published or remapped."""
        return (
            self.name not in FURTHER
            or bool(self.publishers)
            or self.type is not None
            or self.topic != self._node.resolve_topic_name(self.name, only_expand=True)
        )

    @property
    def other_types(self) -> tuple[str, ...]:
        """Types that others publish here and that are not heard."""
        return tuple(sorted(name for name in self.publishers if name != self.type))

    @property
    def age_s(self) -> float | None:
        """Time since the last message [s, steady clock], None before the first."""
        return None if self._last_s is None else time.monotonic() - self._last_s

    def feed(self, by: str, source: Source) -> None:
        """
        Note a message that came another way than by the topic.

        Parameters
        ----------
        by
            What sends it.
        source
            Topic and type under which it is published again.
        """
        self.fed_by, self.fed = by, source
        self.received += 1
        self._last_s = time.monotonic()

    @property
    def lost(self) -> int:
        """Messages that were sent and not heard, or had no place."""
        of_middleware = self._sequences.lost if self._sequences.numbered else self.reported_lost
        return of_middleware + self.dropped

    @property
    def clock_offset_s(self) -> float | None:
        """Median of arrival minus stamp of the last readings, used or not [s]."""
        return median(self._offsets_s) if self._offsets_s else None

    def facts(self, judged: InputCounts | None, doubt: str) -> InputFacts:
        """
        Return what the input is judged by.

        Parameters
        ----------
        judged
            By the monitor; None while the node is not active.
        doubt
            What is odd about it besides.
        """
        about: dict[str, object] = {
            'topic': self.topic if self.fed is None else self.fed.input,
            'type': (self.type if self.fed is None else self.fed.type) or 'not yet known',
            **({'fed by': self.fed_by} if self.fed_by else {}),
            'publishers': sum(self.publishers.values()),
            'published by': ', '.join(self.senders) or 'none',
            'reliability': 'reliable' if self.reliable else 'best effort',
            'messages': self.received,
            'messages lost': self.lost,
            'clock offset [s]': self.clock_offset_s,
            'not used, node inactive or without clock': self.unused,
            **{f'unreadable {reason}': times for reason, times in self.unreadable.items()},
        }
        used = 0 if judged is None else judged.used
        rejected = dict(self.unreadable) | dict({} if judged is None else judged.rejected)
        return InputFacts(
            self.name,
            type=self.type or self.fed_by or None,
            stamped=self.type is None or is_stamped(self.type),
            fed=bool(self.fed_by),
            may_be_fed=self.may_be_fed,
            other_types=self.other_types,
            accepted=self.accepted,
            absent=self.absent,
            senders=self.senders,
            misfit=self.incompatible_qos,
            active=judged is not None,
            age_s=self.age_s,
            total=InputCounts(self.received, used, rejected, self.lost, self.unstamped),
            offset_s=self.clock_offset_s,
            doubt=doubt,
            about=about,
        )

    def least_lag_s(self) -> float | None:
        """
        Return the smallest arrival minus stamp since the last call [s]; None without a reading.
        """
        least, self._least_lag_s = self._least_lag_s, None
        return least

    def take(self, most: int, *, ahead: bool = True) -> list[HeardMessage]:
        """
        Return the messages that have arrived, at most so many.

        Parameters
        ----------
        ahead
            With those that the executor has not come to.
        """
        subscription = self._subscription if ahead else None
        for _ in range(TRIES * most):  # a flood may come faster than it can be counted
            if subscription is None or len(self._taken) >= most:
                break
            with subscription.handle:
                found = subscription.handle.take_message(subscription.msg_type, True)
            if found is None:
                break
            self._note(*found)
        taken, self._taken = self._taken[:most], self._taken[most:]
        return taken

    def count(self, decoded: Decoded, received_ns: int = 0) -> None:
        """
        Take what became of one message.

        Parameters
        ----------
        received_ns
            When this computer got it [ns]; 0: when the node took it.
        """
        for reason, times in decoded.unreadable.items():
            self.unreadable[reason.value] += times
        if self.type is not None and not is_stamped(self.type):
            return  # arrivals show nothing of a clock
        for stamp_ns, receive_ns in zip(
            decoded.block.stamp_ns.tolist(), decoded.block.receive_ns.tolist(), strict=True
        ):
            if stamp_ns <= 0:
                self.unstamped += 1
            else:
                lag_s = ((received_ns or receive_ns) - stamp_ns) * 1e-9
                self._offsets_s.append(lag_s)
                if self._least_lag_s is None or lag_s < self._least_lag_s:
                    self._least_lag_s = lag_s

    def close(self) -> None:
        """
        Stop hearing.
        """
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None

    def _identities(self) -> frozenset[str]:
        self._found = self._node.get_publishers_info_by_topic(self.topic)
        return frozenset(
            bytes(info.endpoint_gid).hex()
            for info in self._found
            if self.type is None or info.topic_type == self.type
        )

    def _subscribe(self, type_name: str, *, reliable: bool) -> None:
        again = self._subscription is not None
        self._taken = self.take(DEPTH) + self._taken  # they would go with the subscription
        self.close()
        offered = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
        qos = QoSProfile(depth=DEPTH, reliability=offered)
        try:
            self._subscription = self._create(type_name, qos, message_lost=self._on_message_lost)
        except UnsupportedEventTypeError:  # not every middleware says so
            self._subscription = self._create(type_name, qos)
        if self.type != type_name:
            self._since_s, self._last_s = time.monotonic(), None
        self.type, self.reliable = type_name, reliable
        self.incompatible_qos = None
        how = 'reliably' if reliable else 'as best effort, as it is sent'
        what = 'now ' if again else ''
        self._node.get_logger().info(
            f'{self.name}: {what}hearing {type_name} on {self.topic}, {how}'
        )

    def _create(self, type_name: str, qos: QoSProfile, **callbacks: Any) -> Subscription:
        return self._node.create_subscription(
            message_class(type_name),
            self.name,
            self._on_message,
            qos,
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=self._on_incompatible_qos, **callbacks
            ),
        )

    def _on_message(self, data: bytes, info: Mapping[str, int | None]) -> None:
        self._note(data, info)
        self._arrived()

    def _note(self, data: bytes, info: Mapping[str, int | None]) -> None:
        self._last_s = time.monotonic()
        self._sequences.take(info.get('publication_sequence_number'))
        if len(self._taken) >= DEPTH:
            self.dropped += 1
            return
        self.received += 1
        if self._over_share(info.get('received_timestamp') or 0):
            self.unreadable['flood'] += 1
        elif len(data) > LONGEST_BYTES:
            self.unreadable['too_long'] += 1
        else:
            assert self.type is not None
            received_ns = info.get('received_timestamp') or 0
            self._taken.append(HeardMessage(self, self.type, data, received_ns))

    def _over_share(self, received_ns: int) -> bool:
        """Count a message in its second of arrival, and say whether that holds too many."""
        if self._share is None or not received_ns:
            return False
        second = received_ns // SECOND_NS
        if second != self._share[0]:
            self._share = [second, 0]
        self._share[1] += 1
        return self._share[1] > SHARE_HZ

    def _on_message_lost(self, event: QoSMessageLostInfo) -> None:
        self.reported_lost += event.total_count_change

    def _on_incompatible_qos(self, event: QoSRequestedIncompatibleQoSInfo) -> None:
        policy = qos_policy_name_from_kind(event.last_policy_kind)
        if policy == 'RELIABILITY':
            return  # the next look asks for less
        self.incompatible_qos = policy
        self._node.get_logger().warning(
            f'{self.name}: a publisher on {self.topic} is not heard, its {policy} QoS does not fit'
        )


def _sender(info: Any) -> str:
    if info.node_name == _UNKNOWN:  # its name comes a little after its publishers
        return 'a node without a name yet'
    return printable(f'{info.node_namespace.rstrip("/")}/{info.node_name}')
