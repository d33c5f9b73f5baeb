# SPDX-License-Identifier: Apache-2.0
"""The rest of the ship, for a demonstration: sends samples, hears the estimates."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.messages import DEFAULT_NODE
from shipdrag_ros.messages.heard import health_of
from shipdrag_ros.messages.topics import RESISTANCE, SPEED
from shipdrag_ros.node.inputs import message_class
from shipdrag_ros.node.player import Player
from shipdrag_ros.samples import SECOND_NS, Block


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

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
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
        self._speeds[_stamp_ns(message)] = message.twist.twist.linear.x
        self._join(_stamp_ns(message))

    def _hear_resistance(self, message: Any) -> None:
        variance = message.accel.covariance[0]
        self._resistances[_stamp_ns(message)] = message.accel.accel.linear.x, variance**0.5
        self._join(_stamp_ns(message))

    def _join(self, stamp_ns: int) -> None:
        """Report a moment once both of its figures are there, whichever came first."""
        if stamp_ns not in self._speeds or stamp_ns not in self._resistances:
            return
        resistance, sigma = self._resistances.pop(stamp_ns)
        self.estimates += 1
        self._heard(LiveEstimate(stamp_ns, self._speeds.pop(stamp_ns), resistance, sigma))


def _stamp_ns(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * SECOND_NS + int(stamp.nanosec)
