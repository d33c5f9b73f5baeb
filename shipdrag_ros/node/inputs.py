# SPDX-License-Identifier: Apache-2.0
"""
Input topics: found in the graph, subscribed as bytes, counted.

Nobody has to say which of the accepted types a driver publishes, and nobody is
left wondering why a topic is silent.
"""

from __future__ import annotations

import importlib
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

from rclpy.event_handler import QoSRequestedIncompatibleQoSInfo, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_policy_name_from_kind,
)
from rclpy.subscription import Subscription

from shipdrag_ros.messages import Decoded

# best effort hears every publisher; deep, because one estimate may take as long as many messages
INPUT_QOS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1000,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)

Receive = Callable[['InputTopic', bytes], None]


def message_class(type_name: str) -> Any:
    """
    Return the class of a type such as `geometry_msgs/msg/TwistStamped`.
    """
    package, kind, name = type_name.split('/')
    return getattr(importlib.import_module(f'{package}.{kind}'), name)


class InputTopic:
    """
    One input: its subscription, once its type is known, and its health.

    Parameters
    ----------
    name
        Of the input, which is its topic before remapping.
    accepted
        Types that can be decoded, the preferred one first.
    fixed
        Type set by the user, '' for the one in the graph.
    receive
        Called with this object and the bytes of each message.

    Attributes
    ----------
    type
        Type subscribed to, None until known.
    received, unused
        Messages heard; heard while not active or without a clock.
    unreadable
        Messages that gave no sample, by reason, and joints that have no place.
    fed_by
        What feeds the input instead of its topic, '' if nothing does.
    rate_hz
        Messages a second of steady time, before the last `tick`.
    """

    def __init__(
        self, node: Node, name: str, *, accepted: tuple[str, ...], fixed: str, receive: Receive
    ) -> None:
        self._node = node
        self._receive = receive
        self._subscription: Subscription | None = None
        self._last_s: float | None = None
        self._tick_s = time.monotonic()
        self._tick_received = 0
        self.name = name
        self.topic = node.resolve_topic_name(name)
        self.accepted = accepted
        self.type: str | None = None
        self.publishers: Counter[str] = Counter()
        self.incompatible_qos: str | None = None
        self.received = 0
        self.unused = 0
        self.unreadable: Counter[str] = Counter()
        self.fed_by = ''
        self.rate_hz = 0.0
        if fixed:
            self._subscribe(fixed)

    def look(self) -> None:
        """
        Read the graph, and subscribe once a type is there.
        """
        found = self._node.get_publishers_info_by_topic(self.topic)
        self.publishers = Counter(info.topic_type for info in found)
        if self.type is None:
            usable = [name for name in self.accepted if name in self.publishers]
            if usable:
                self._subscribe(usable[0])

    @property
    def other_types(self) -> tuple[str, ...]:
        """Types that others publish here and that are not heard."""
        return tuple(sorted(name for name in self.publishers if name != self.type))

    @property
    def age_s(self) -> float | None:
        """Time since the last message [s, steady clock], None before the first."""
        return None if self._last_s is None else time.monotonic() - self._last_s

    def feed(self, by: str) -> None:
        """
        Note a message that came another way than by the topic.
        """
        self.fed_by = by
        self.received += 1
        self._last_s = time.monotonic()

    def count(self, decoded: Decoded) -> None:
        """
        Take what became of one message.
        """
        for reason, times in decoded.unreadable.items():
            self.unreadable[reason.value] += times

    def tick(self) -> None:
        """
        Refresh the rate, from the messages since the last tick.
        """
        now = time.monotonic()
        if now > self._tick_s:
            self.rate_hz = (self.received - self._tick_received) / (now - self._tick_s)
        self._tick_s, self._tick_received = now, self.received

    def close(self) -> None:
        """
        Stop hearing.
        """
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None

    def _subscribe(self, type_name: str) -> None:
        self._subscription = self._node.create_subscription(
            message_class(type_name),
            self.name,
            self._on_message,
            INPUT_QOS,
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=self._on_incompatible_qos),
        )
        self.type = type_name
        self._node.get_logger().info(f'{self.name}: hearing {type_name} on {self.topic}')

    def _on_message(self, data: bytes) -> None:
        self.received += 1
        self._last_s = time.monotonic()
        self._receive(self, data)

    def _on_incompatible_qos(self, event: QoSRequestedIncompatibleQoSInfo) -> None:
        policy = qos_policy_name_from_kind(event.last_policy_kind)
        self.incompatible_qos = policy
        self._node.get_logger().warning(
            f'{self.name}: a publisher on {self.topic} is not heard, its {policy} QoS does not fit'
        )
