# SPDX-License-Identifier: Apache-2.0
"""
Other nodes beside the node: one that only listens, and one that plays a ship to it.

The listener publishes nothing and offers no service; it calls `~/engine_stopped` where that is
allowed. It may start before the node, and the node may come and go.
"""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any, Self

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import Trigger

from shipdrag_ros.display import printable
from shipdrag_ros.errors import ShipdragError, reason_of
from shipdrag_ros.messages import MalformedMessage, decode, encode, input_type, topics
from shipdrag_ros.messages.types import DIAGNOSTIC_ARRAY, stamp_ns
from shipdrag_ros.node.inputs import LATCHED, is_installed, message_class
from shipdrag_ros.samples import SECOND_NS, Block, Channel

LOOK_S = 1.0
SAID_S = 10.0  # a message that cannot be shown is said so often at most
ANSWER_S = 5.0  # that a mark waits for the node
CLOSEST_S = 0.04  # a reading of an input that comes sooner after the last one is not decoded
_RELIABLE = QoSProfile(depth=100)
_READINGS = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)


def _beside(name: str) -> tuple[rclpy.Context, Node, SingleThreadedExecutor]:
    """Make a node on a context of its own, with what spins it."""
    context = rclpy.Context()
    # the caller has a process to end; Ctrl-C stays what it is there
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(name, context=context, start_parameter_services=False)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    return context, node, executor


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
        self, hear: Callable[[topics.Heard], None], *, node: str = '', marks: bool = False
    ) -> None:
        self.node = ''
        self.others: tuple[str, ...] = ()
        self._hear = hear
        self._wanted = node
        self._context, self._ros, self._executor = _beside('shipdrag_watch')
        self._marks = marks
        self._stopped: Any = None
        self._of_node: list[Any] = []
        self._of_inputs: dict[str, tuple[object, Any]] = {}
        self._last_s: dict[str, float] = {}
        self._subscribe(DIAGNOSTIC_ARRAY, '/diagnostics', self._on_diagnostics, _RELIABLE)
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
        answer = client.call(Trigger.Request(), timeout_sec=ANSWER_S)
        if answer is None:
            return f'the node did not answer within {ANSWER_S:.0f} s: the stop may not be marked'
        return str(answer.message)

    def _subscribe(self, kind: str, topic: str, hear: Callable[..., None], qos: QoSProfile) -> Any:
        return self._ros.create_subscription(message_class(kind), topic, hear, qos, raw=True)

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
        ending = f'/{topics.RESISTANCE_CURVE.name}'
        found = sorted(
            topic.removesuffix(ending)
            for topic, kinds in self._ros.get_topic_names_and_types()
            if topic.endswith(ending)
            and topic != ending  # at the root there is no node
            and topics.RESISTANCE_CURVE.type in kinds
            and self._ros.count_publishers(topic)
        )
        kept = self.node if self.node in found or not found else found[0]
        chosen = self._wanted or kept
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
            self._subscribe(
                topic.type,
                topic.under(node),
                lambda payload, name=topic.name: self._hear(topics.NodeMessage(name, payload)),
                LATCHED if topic.latched else _RELIABLE,
            )
            for topic in topics.OUTPUT_TOPICS
        ]
        self._of_node.append(
            self._ros.create_subscription(
                String,
                f'{node}/ship',
                lambda message: self._hear(topics.ShipFile(message.data)),
                LATCHED,
            )
        )

    def _on_diagnostics(self, payload: bytes) -> None:
        try:
            heard = topics.read_health(payload)
        except MalformedMessage:
            return  # of somebody else: nobody's health is known by it
        own = [health for health in heard if self._is_own(health)]
        if own:
            self._hear_inputs(own[0])
            self._hear(own[0])

    def _is_own(self, health: topics.Health) -> bool:
        """Whether it is of the node heard; a status may give its name with or without place."""
        name = health.statuses[0].node.strip('/')
        full = (self._wanted or self.node).strip('/')
        return not full or name == full or full.endswith(f'/{name}')

    def _hear_inputs(self, health: topics.Health) -> None:
        """Hear the topics that the node hears, in the types that it hears."""
        for status in health.inputs:
            topic, kind = status.values.get('topic', ''), status.values.get('type', '')
            accepted = topics.TOPICS.get(status.input, ())
            if not topic or kind not in accepted or not is_installed(kind):
                continue
            known, subscription = self._of_inputs.get(status.input, (None, None))
            if known == (topic, kind):
                continue
            if subscription is not None:
                self._ros.destroy_subscription(subscription)
            hear = partial(self._on_reading, topics.Source(status.input, kind))
            subscription = self._subscribe(kind, topic, hear, _READINGS)
            self._of_inputs[status.input] = (topic, kind), subscription

    def _on_reading(self, source: topics.Source, payload: bytes) -> None:
        now_s = time.monotonic()
        if now_s - self._last_s.get(source.input, 0.0) < CLOSEST_S:
            return
        self._last_s[source.input] = now_s
        block = decode(source, [payload], [time.time_ns()]).block
        if len(block):
            self._hear(topics.Samples(block))


QOS = QoSProfile(depth=1000)
TIMEOUT_S = 10.0
DISCOVERY_S = 0.5  # by which a listener knows its publisher after the publisher knew it
STEP_NS = SECOND_NS  # data and clock advance together by this much


class Player:
    """
    Publishes samples, and /clock where asked to.

    Parameters
    ----------
    node
        Owner of the publishers.
    executor
        Spun while waiting, so that the owner hears the answers.
    """

    def __init__(self, node: Node, executor: SingleThreadedExecutor) -> None:
        self._node = node
        self._executor = executor
        self._topics: dict[str, Publisher] = {}

    def connect(self, block: Block, *, timeout_s: float = TIMEOUT_S) -> None:
        """
        Wait until somebody hears every input of a block.

        Raises
        ------
        ShipdragError
            Naming the topics that nobody hears.
        """
        for code in np.unique(block.channel).tolist():
            channel = Channel(code)
            self._publisher(f'/{channel.input}', input_type(channel))
        self._wait_for_listeners(timeout_s)

    def publish(self, block: Block) -> None:
        """
        Publish samples at once, in the order of the block.
        """
        for message in encode(block):
            self._publisher(message.topic, message.type).publish(message.payload)

    def set_clock(self, time_ns: int) -> None:
        """
        Publish simulated time [ns].

        Raises
        ------
        ShipdragError
            If nobody hears it.
        """
        first = '/clock' not in self._topics
        clock = self._publisher('/clock', 'rosgraph_msgs/msg/Clock')
        if first:
            self._wait_for_listeners(TIMEOUT_S)
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(int(time_ns), SECOND_NS)
        clock.publish(message)

    def play(
        self, block: Block, *, speed: float, progress: Callable[[float], None] = lambda _: None
    ) -> None:
        """
        Publish a block by its times of arrival, /clock a second ahead.

        Parameters
        ----------
        speed
            Seconds of data in a second of life.
        progress
            Called with the fraction done.
        """
        first_ns = int(block.receive_ns[0])
        seconds = (block.receive_ns - first_ns) // STEP_NS
        starts = np.flatnonzero(np.diff(seconds, prepend=-1, append=seconds[-1] + 1))
        start_s = time.monotonic()
        for i, j in pairwise(starts.tolist()):
            due_s = start_s + float(seconds[i]) / speed
            self._spin_until(due_s)
            self.set_clock(first_ns + (int(seconds[i]) + 1) * STEP_NS)
            self.publish(block[i:j])
            progress(j / len(block))

    def _wait_for_listeners(self, timeout_s: float) -> None:
        if not self._deaf():
            return
        end_s = time.monotonic() + timeout_s
        while deaf := self._deaf():
            if time.monotonic() > end_s:
                raise ShipdragError(
                    f'nobody hears {", ".join(deaf)} within {timeout_s:g} s; is the node active?'
                )
            self._executor.spin_once(timeout_sec=0.05)
        self._spin_until(time.monotonic() + DISCOVERY_S)

    def _deaf(self) -> list[str]:
        return [name for name, topic in self._topics.items() if not topic.get_subscription_count()]

    def _spin_until(self, due_s: float) -> None:
        while True:  # once at least, to hear the answers also when late
            self._executor.spin_once(timeout_sec=max(due_s - time.monotonic(), 0.0))
            if time.monotonic() >= due_s:
                return

    def _publisher(self, topic: str, type_name: str) -> Publisher:
        if topic not in self._topics:
            self._topics[topic] = self._node.create_publisher(message_class(type_name), topic, QOS)
        return self._topics[topic]


@dataclass(frozen=True)
class LiveEstimate:
    """What the node said of one moment, as a subscriber hears it."""

    stamp_ns: int
    speed_m_s: float
    resistance_m_s2: float
    sigma_m_s2: float


class Rehearsal:
    """
    A peer of the node on the ROS graph; a context manager.

    Parameters
    ----------
    heard
        Called with every estimate.

    Attributes
    ----------
    estimates
        How many were heard.
    player
        Sends samples to the node.
    """

    def __init__(self, heard: Callable[[LiveEstimate], None]) -> None:
        self.estimates = 0
        self._heard = heard
        self._figures: defaultdict[int, dict[str, Any]] = defaultdict(dict)
        self._context, self._node, self._executor = _beside('rehearsal')
        self.player = Player(self._node, self._executor)
        self._ready = False
        self._node.create_subscription(DiagnosticArray, '/diagnostics', self._hear_health, 10)
        for topic in (topics.SPEED, topics.RESISTANCE):
            kind, hear = message_class(topic.type), partial(self._hear_figure, topic.name)
            self._node.create_subscription(kind, topic.under(topics.DEFAULT_NODE), hear, 1000)

    def wait_for_node(self, block: Block, *, alive: Callable[[], None], timeout_s: float) -> None:
        """
        Wait until the node hears every input of a block, and is ready to estimate.

        Parameters
        ----------
        alive
            Called now and then; raises if there is nothing to wait for.

        Raises
        ------
        ShipdragError
            Naming the inputs that are not heard in time.
        """
        end_s = time.monotonic() + timeout_s
        while True:
            alive()
            try:
                self.player.connect(block, timeout_s=1.0)
            except ShipdragError:
                if time.monotonic() > end_s:
                    raise
            else:
                break
        while not self._ready:  # a first start compiles, which ends by itself
            alive()
            self._executor.spin_once(timeout_sec=0.1)

    def listen(self, *, until: Callable[[], bool] = lambda: False, timeout_s: float) -> None:
        """
        Hear on until a condition holds, or time is up.
        """
        end_s = time.monotonic() + timeout_s
        while not until() and time.monotonic() < end_s:
            self._executor.spin_once(timeout_sec=0.05)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _hear_health(self, message: DiagnosticArray) -> None:
        for health in topics.health_of(message.status):
            values = health.of('state').values
            self._ready = values['lifecycle'] == 'active' and 'compiling [s]' not in values

    def _hear_figure(self, name: str, message: Any) -> None:
        """Report a moment once both of its figures are there, whichever came first."""
        at_ns = stamp_ns(message)
        self._figures[at_ns][name] = message
        if len(self._figures[at_ns]) == 2:
            both = self._figures.pop(at_ns)
            speed, r = both[topics.SPEED.name].twist, both[topics.RESISTANCE.name].accel
            self.estimates += 1
            figures = speed.twist.linear.x, r.accel.linear.x, r.covariance[0] ** 0.5
            self._heard(LiveEstimate(at_ns, *figures))
