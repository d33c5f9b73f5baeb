# SPDX-License-Identifier: Apache-2.0
"""
A client of the node that knows the README and nothing of the package's code.

It publishes over DDS with rclpy, reads bags with `mcap`, asks the page with the
standard library, and has a ship of its own. What the package believes of itself
cannot hide a mistake from it.
"""

from __future__ import annotations

import json
import os
import re
import signal
import struct
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PointStamped, TwistStamped
from mcap.exceptions import McapError
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rosgraph_msgs.msg import Clock

WITHIN_S = 240.0  # of a machine that compiles first, and has much else to do
SHIP = 'name: a stranger\nlength_m: 60.0\ndisplaced_volume_m3: 900.0\n'
OK = 0


def cdr_twist(stamp_ns: int, speed_m_s: float) -> bytes:
    """Return a TwistStamped as bytes, made by hand: little endian, aligned behind the head."""
    seconds, rest = divmod(stamp_ns, 10**9)
    frame = b'stranger\0'
    body = struct.pack('<iII', seconds, rest, len(frame)) + frame
    body += b'\0' * (-len(body) % 8)
    return b'\x00\x01\x00\x00' + body + struct.pack('<6d', speed_m_s, *[0.0] * 5)


def coasting(time_s: float, *, speed_m_s: float = 5.0, slowing_1_m: float = 8e-4) -> float:
    """Return the speed of a ship whose drag goes with its square, since her engine stopped."""
    return speed_m_s / (1.0 + slowing_1_m * speed_m_s * max(time_s, 0.0))


class Program:
    """A verb of the command line in a process of its own."""

    def __init__(self, log: Path, *line: str | Path) -> None:
        self._log = log
        with log.open('w') as file:
            self.process = subprocess.Popen(
                [Path(sys.executable).with_name('shipdrag'), *line],
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                env={**os.environ, 'PYTHONUNBUFFERED': '1'},
            )

    @property
    def log(self) -> str:
        return self._log.read_text(errors='replace')

    def wait_for(self, pattern: str) -> str:
        """Return what a pattern's group is once it stands in the log."""
        end_s = time.monotonic() + WITHIN_S
        while (found := re.search(pattern, self.log)) is None:
            assert self.process.poll() is None, self.log
            assert time.monotonic() < end_s, f'no {pattern!r} in\n{self.log}'
            time.sleep(0.05)
        return found[0]

    def end(self, number: signal.Signals = signal.SIGKILL) -> None:
        if self.process.poll() is None:
            self.process.send_signal(number)
            self.process.wait(timeout=WITHIN_S)


class Stranger:
    """A participant of the graph that publishes what it likes, and hears /diagnostics."""

    def __init__(self, ground: Any = TwistStamped, *, name: str = 'stranger') -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node(name, context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self.arrays: list[DiagnosticArray] = []
        self.heard_s: list[float] = []
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._hear, 100)
        self.log = self.node.create_publisher(TwistStamped, 'speed_through_water', 1000)
        if ground is not None:
            self.send_ground(ground)
        self.place = self.node.create_publisher(PointStamped, 'position', 1000)
        self.clock = self.node.create_publisher(Clock, '/clock', 10)

    def send_ground(self, kind: Any) -> None:
        self.ground = self.node.create_publisher(kind, 'speed_over_ground', 1000)

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)

    def _hear(self, array: DiagnosticArray) -> None:
        self.arrays.append(array)
        self.heard_s.append(time.monotonic())

    def call(self, client: Client, request: Any) -> Any:
        """Return the answer of a service."""
        future = client.call_async(request)
        self._executor.spin_until_future_complete(future, timeout_sec=WITHIN_S)
        return future.result()

    def spin(self, seconds: float = 0.0) -> None:
        end_s = time.monotonic() + seconds
        while True:
            self._executor.spin_once(timeout_sec=max(end_s - time.monotonic(), 0.0))
            if time.monotonic() >= end_s:
                return

    def until(self, found: Callable[[], Any], *, meanwhile: Callable[[], None]) -> Any:
        """Return the first true answer; something goes on meanwhile, twenty times a second."""
        end_s = time.monotonic() + WITHIN_S
        while not (answer := found()):
            assert time.monotonic() < end_s, self.last()
            meanwhile()
            self.spin(0.05)
        return answer

    def last(self) -> dict[str, str]:
        return {each.name: each.message for each in self.arrays[-1].status} if self.arrays else {}

    def said(self, part: str, *, since: int = 0) -> Iterator[DiagnosticStatus]:
        """Yield what was said of a part of the node, from an array on."""
        for array in self.arrays[since:]:
            for status in array.status:
                if status.name == f'coastdown_node: {part}':
                    yield status

    def now(self, part: str) -> DiagnosticStatus | None:
        return next(iter(self.said(part, since=max(len(self.arrays) - 1, 0))), None)

    def rejected(self, part: str) -> dict[str, float]:
        """Return how many readings of an input were rejected, by reason."""
        status = self.now(part)
        values = {} if status is None else {item.key: item.value for item in status.values}
        return {
            key: float(value)
            for key, value in values.items()
            if key.startswith(('rejected ', 'unreadable '))
        }

    def value(self, part: str, key: str) -> float:
        """Return a figure of a part, 0 where there is none."""
        status = self.now(part)
        values = {} if status is None else {item.key: item.value for item in status.values}
        return float(values.get(key, 0))


def twist(stamp_ns: int, speed_m_s: float) -> TwistStamped:
    message = TwistStamped()
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    message.header.frame_id = 'stranger'
    message.twist.linear.x = speed_m_s
    return message


def point(stamp_ns: int, metres: float) -> PointStamped:
    message = PointStamped()
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    message.point.x = metres
    return message


def nmea(text: str) -> bytes:
    """Return a sentence with its checksum."""
    total = 0
    for byte in text.encode('latin-1'):
        total ^= byte
    return f'${text}*{total:02X}\r\n'.encode('latin-1')


def records(bags: Sequence[Path]) -> Iterator[tuple[str, Message]]:
    """Yield topic and message of files that may have been cut off anywhere."""
    for path in bags:
        channels: dict[int, str] = {}
        with path.open('rb') as stream:
            try:
                for record in StreamReader(stream).records:
                    if isinstance(record, Channel):
                        channels[record.id] = record.topic
                    elif isinstance(record, Message):
                        yield channels[record.channel_id], record
            except (McapError, EOFError, struct.error):
                pass  # here the power went


def payloads(bags: Sequence[Path], topic: str) -> list[bytes]:
    """Return the messages of a topic."""
    return [message.data for found, message in records(bags) if found == topic]


def get(url: str) -> Any:
    """Return the JSON behind an address."""
    with urllib.request.urlopen(url, timeout=WITHIN_S) as answer:
        return json.load(answer)
