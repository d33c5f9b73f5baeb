# SPDX-License-Identifier: Apache-2.0
"""
The rest of the ship, for a demonstration: sends samples, hears the estimates.

A stand-in for the drivers plays faster than life: simulated time is published ahead of the data.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.messages import DEFAULT_NODE, encode, input_type
from shipdrag_ros.messages.heard import health_of
from shipdrag_ros.messages.topics import RESISTANCE, SPEED
from shipdrag_ros.messages.types import stamp_ns
from shipdrag_ros.node.inputs import message_class
from shipdrag_ros.samples import SECOND_NS, Block, Channel

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
        self._clock: Publisher | None = None

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
        if self._clock is None:
            self._clock = self._topics['/clock'] = self._node.create_publisher(
                Clock, '/clock', QOS
            )
            self._wait_for_listeners(TIMEOUT_S)
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(int(time_ns), SECOND_NS)
        self._clock.publish(message)

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
    """

    def __init__(self, heard: Callable[[LiveEstimate], None]) -> None:
        self.estimates = 0
        self._heard = heard
        self._speeds: dict[int, float] = {}
        self._resistances: dict[int, tuple[float, float]] = {}
        self._context = rclpy.Context()
        # Ctrl-C stays what it is in Python; the caller has a process to end
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node('rehearsal', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._player = Player(self._node, self._executor)
        self._ready = False
        self._node.create_subscription(DiagnosticArray, '/diagnostics', self._hear_health, 10)
        for topic, callback in ((SPEED, self._hear_speed), (RESISTANCE, self._hear_resistance)):
            self._node.create_subscription(
                message_class(topic.type), topic.under(DEFAULT_NODE), callback, 1000
            )

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
                self._player.connect(block, timeout_s=1.0)
            except ShipdragError:
                if time.monotonic() > end_s:
                    raise
            else:
                break
        while not self._ready:  # a first start compiles, which ends by itself
            alive()
            self._executor.spin_once(timeout_sec=0.1)

    def play(self, block: Block, *, speed: float, progress: Callable[[float], None]) -> None:
        """
        Send samples under simulated time.

        Parameters
        ----------
        speed
            Seconds of data in a second of life.
        progress
            Called with the fraction done.
        """
        self._player.play(block, speed=speed, progress=progress)

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
        for health in health_of(message.status):
            state = health.of('state')
            assert state is not None  # by which a node is known
            compiling = 'compiling [s]' in state.values
            self._ready = state.values['lifecycle'] == 'active' and not compiling

    def _hear_speed(self, message: Any) -> None:
        self._speeds[stamp_ns(message)] = message.twist.twist.linear.x
        self._join(stamp_ns(message))

    def _hear_resistance(self, message: Any) -> None:
        variance = message.accel.covariance[0]
        self._resistances[stamp_ns(message)] = message.accel.accel.linear.x, variance**0.5
        self._join(stamp_ns(message))

    def _join(self, stamp_ns: int) -> None:
        """Report a moment once both of its figures are there, whichever came first."""
        if stamp_ns not in self._speeds or stamp_ns not in self._resistances:
            return
        resistance, sigma = self._resistances.pop(stamp_ns)
        self.estimates += 1
        self._heard(LiveEstimate(stamp_ns, self._speeds.pop(stamp_ns), resistance, sigma))
