# SPDX-License-Identifier: Apache-2.0
"""
A listener that publishes nothing and offers no service: it hears a node for others, and
calls its `~/engine_stopped` where that is allowed.

It may start before the node, and the node may come and go.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, Self

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import String
from std_srvs.srv import Trigger

from shipdrag_ros.display import printable
from shipdrag_ros.errors import reason_of
from shipdrag_ros.messages import OUTPUT_TOPICS, TOPICS, MalformedMessage, Source, decode
from shipdrag_ros.messages.heard import DIAGNOSTICS, Health, Heard, NodeMessage, Samples, ShipFile
from shipdrag_ros.messages.heard import read_health as decode_health
from shipdrag_ros.messages.topics import RESISTANCE_CURVE
from shipdrag_ros.node.inputs import LATCHED, is_installed, message_class

LOOK_S = 1.0
SAID_S = 10.0  # a message that cannot be shown is said so often at most
ANSWER_S = 5.0  # that a mark waits for the node
CLOSEST_S = 0.04  # a reading of an input that comes sooner after the last one is not decoded
_RELIABLE = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
_READINGS = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)


class Spectator:
    """
    Hears one node, in a thread of its own; a context manager.

    Parameters
    ----------
    hear
        Called in that thread with everything heard; must return at once.
    node
        Full name of the node, '' for the first one that is found.
    marks
        It may tell the node that the engine was stopped.

    Attributes
    ----------
    node
        The one heard, '' while there is none.
    others
        Nodes of the same kind that are not heard.
    """

    def __init__(
        self, hear: Callable[[Heard], None], *, node: str = '', marks: bool = False
    ) -> None:
        self.node = ''
        self.others: tuple[str, ...] = ()
        self._hear = hear
        self._wanted = node
        self._context = rclpy.Context()
        # the caller has a process to end; Ctrl-C stays what it is there
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._ros = rclpy.create_node(
            'shipdrag_watch', context=self._context, start_parameter_services=False
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._ros)
        self._marks = marks
        self._stopped: Any = None
        self._of_node: list[Any] = []
        self._of_inputs: dict[str, tuple[str, str, Any]] = {}
        self._last_s: dict[str, float] = {}
        self._ros.create_subscription(
            message_class(DIAGNOSTICS), '/diagnostics', self._on_diagnostics, _RELIABLE, raw=True
        )
        self._ros.create_timer(LOOK_S, self._look)
        self._thread = threading.Thread(target=self._spin, name='spectator', daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._context.try_shutdown()
        self._thread.join()
        self._ros.destroy_node()

    def mark_stop(self) -> str:
        """
        Tell the node that the engine was stopped just now, and return its answer.
        """
        client = self._stopped
        if client is None or not client.service_is_ready():
            return 'no node is there to be told: the stop was not marked'
        done = threading.Event()
        asked = client.call_async(Trigger.Request())
        asked.add_done_callback(lambda _: done.set())
        if not done.wait(ANSWER_S):
            asked.cancel()
            return f'the node did not answer within {ANSWER_S:.0f} s: the stop may not be marked'
        return str(asked.result().message)

    def _spin(self) -> None:
        while self._context.ok():
            try:
                self._executor.spin_once(timeout_sec=0.5)
            except ExternalShutdownException:
                return
            except Exception as error:  # of what one peer sent; the next may be sound
                why = printable(reason_of(error))
                self._ros.get_logger().error(
                    f'a message is not shown: {why}; find who publishes it',
                    throttle_duration_sec=SAID_S,
                )

    def _look(self) -> None:
        """Find the node by the curve that it offers, and hear it."""
        ending = f'/{RESISTANCE_CURVE.name}'
        found = sorted(
            topic.removesuffix(ending)
            for topic, kinds in self._ros.get_topic_names_and_types()
            if topic.endswith(ending)
            and RESISTANCE_CURVE.type in kinds
            and self._ros.count_publishers(topic)
        )
        if self._wanted:
            chosen = self._wanted
        else:
            chosen = self.node if self.node in found or not found else found[0]
        self.others = tuple(name for name in found if name != chosen)
        if chosen and chosen != self.node:
            self._follow(chosen)

    def _follow(self, node: str) -> None:
        for subscription in self._of_node:
            self._ros.destroy_subscription(subscription)
        self.node = node
        if self._marks:
            if self._stopped is not None:
                self._ros.destroy_client(self._stopped)
            self._stopped = self._ros.create_client(Trigger, f'{node}/engine_stopped')
        self._of_node = [
            self._ros.create_subscription(
                message_class(topic.type),
                topic.under(node),
                lambda payload, name=topic.name: self._hear(NodeMessage(name, payload)),
                LATCHED if topic.latched else _RELIABLE,
                raw=True,
            )
            for topic in OUTPUT_TOPICS
        ]
        self._of_node.append(
            self._ros.create_subscription(
                String,
                f'{node}/ship',
                lambda message: self._hear(ShipFile(message.data)),
                LATCHED,
            )
        )

    def _on_diagnostics(self, payload: bytes) -> None:
        try:
            heard = decode_health(payload)
        except MalformedMessage:
            return  # of somebody else: nobody's health is known by it
        own = [health for health in heard if self._is_own(health)]
        if own:
            self._hear_inputs(own[0])
            self._hear(own[0])

    def _is_own(self, health: Health) -> bool:
        """Whether it is of the node heard; a status may give its name with or without place."""
        name = health.statuses[0].node.strip('/')
        full = (self._wanted or self.node).strip('/')
        return not full or name == full or full.endswith(f'/{name}')

    def _hear_inputs(self, health: Health) -> None:
        """Hear the topics that the node hears, in the types that it hears."""
        for status in health.inputs:
            topic, kind = status.values.get('topic', ''), status.values.get('type', '')
            accepted = TOPICS.get(status.input, ())
            if not topic or kind not in accepted or not is_installed(kind):
                continue
            known = self._of_inputs.get(status.input)
            if known is not None:
                if known[:2] == (topic, kind):
                    continue
                self._ros.destroy_subscription(known[2])
            source = Source(status.input, kind)
            subscription = self._ros.create_subscription(
                message_class(kind),
                topic,
                lambda payload, source=source: self._on_reading(source, payload),
                _READINGS,
                raw=True,
            )
            self._of_inputs[status.input] = (topic, kind, subscription)

    def _on_reading(self, source: Source, payload: bytes) -> None:
        now_s = time.monotonic()
        if now_s - self._last_s.get(source.input, 0.0) < CLOSEST_S:
            return
        self._last_s[source.input] = now_s
        block = decode(source, [payload], [time.time_ns()]).block
        if len(block):
            self._hear(Samples(block))
