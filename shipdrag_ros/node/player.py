# SPDX-License-Identifier: Apache-2.0
"""
A stand-in for the drivers of a ship: samples become messages on real topics.

Plays faster than life: simulated time is published ahead of the data.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.messages import encode, input_type
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
    namespace
        Of the topics, '' or `/ship`.
    """

    def __init__(
        self, node: Node, executor: SingleThreadedExecutor, *, namespace: str = ''
    ) -> None:
        self._node = node
        self._executor = executor
        self._namespace = namespace
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
            self._publisher(f'{self._namespace}/{channel.input}', input_type(channel))
        self._wait_for_listeners(timeout_s)

    def publish(self, block: Block) -> None:
        """
        Publish samples at once, in the order of the block.
        """
        for message in encode(block, namespace=self._namespace):
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
