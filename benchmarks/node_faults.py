# SPDX-License-Identifier: Apache-2.0
"""
Faults on the topics of a running node, and what /diagnostics says of each.

Starts the node as a user does, talks to it over DDS on loopback, and prints the
table of docs/results/node_faults.txt, `--write` puts it there: about two minutes.
"""

from __future__ import annotations

import argparse
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
os.environ.setdefault('ROS_DOMAIN_ID', '97')

import rclpy
from _tables import put, table
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, TwistStamped
from rclpy.executors import SingleThreadedExecutor

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'results' / 'node_faults.txt'
SHIP = 'name: test\nlength_m: 150.0\ndisplaced_volume_m3: 20200.0\n'
LEVELS = ('OK', 'WARN', 'ERROR', 'STALE')
SECONDS = 6.0
RATE_HZ = 20.0
START_S = 120.0

Speed = Callable[[int], float]


class Fault:
    """What is published for some seconds, and on what the node is asked."""

    def __init__(
        self,
        name: str,
        before: str,
        *,
        speed: Speed | None = lambda k: 5.0 + 0.001 * math.sin(k),
        ahead_s: float | None = 0.0,
        logs: int = 1,
        position: Callable[[int], float] | None = None,
        about: str = 'speed_through_water',
    ) -> None:
        self.name, self.before, self.speed, self.ahead_s = name, before, speed, ahead_s
        self.logs, self.position, self.about = logs, position, about


def _mostly(value: float, other: float, every: int) -> Callable[[int], float]:
    return lambda k: other if k % every == 0 else value + 0.25 * k + 0.001 * math.sin(k)


FAULTS = (
    Fault('nothing is wrong', 'OK: receiving'),
    Fault('every reading NaN', 'OK: receiving', speed=lambda k: math.nan),
    Fault('one value for ever', 'OK: receiving', speed=lambda k: 5.0),
    Fault('not stamped', 'OK: receiving', ahead_s=None),
    Fault('stamps an hour ahead', 'OK: receiving', ahead_s=3600.0),
    Fault(
        'log 4 s behind position', 'OK: receiving', ahead_s=-4.0, position=_mostly(0.0, 0.0, 10**9)
    ),
    Fault(
        'one position of twenty absurd',
        'OK: receiving',
        position=_mostly(0.0, 1e308, 20),
        about='position',
    ),
    Fault('three logs on one topic', 'OK: receiving', logs=3),
    Fault('no publisher', 'OK: no publisher', speed=None),
)


class Bench:
    """A node and a peer."""

    def __init__(self, directory: Path) -> None:
        ship = directory / 'ship.yaml'
        ship.write_text(SHIP)
        self.log = (directory / 'log').open('w')
        line = [sys.executable, '-m', 'shipdrag_ros.node.main', '--ros-args']
        line += ['-p', f'ship_file:={ship}', '-p', f'output_directory:={directory}']
        self.process = subprocess.Popen(line, stdout=self.log, stderr=self.log)
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node('faults', context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.latest: dict[str, Any] = {}
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._hear, 10)
        self._spin(self._is_ready, START_S)

    def of(self, fault: Fault) -> tuple[str, str]:
        """Publish a fault and return level and message."""
        kinds = [TwistStamped] * fault.logs if fault.speed else []
        logs = [self.node.create_publisher(kind, 'speed_through_water', 10) for kind in kinds]
        track = (
            self.node.create_publisher(PointStamped, 'position', 10) if fault.position else None
        )
        begin = time.monotonic()
        k = 0
        while time.monotonic() < begin + SECONDS:
            for log in logs:
                message = TwistStamped()
                self._stamp(message, fault.ahead_s)
                message.twist.linear.x = fault.speed(k) if fault.speed else 0.0
                log.publish(message)
            if track is not None and fault.position is not None:
                place = PointStamped()
                self._stamp(place, 0.0)
                place.point.x = fault.position(k)
                track.publish(place)
            k += 1
            self._spin(lambda: False, 1.0 / RATE_HZ)
        self._spin(lambda: False, 0.5)
        found = self.latest[f'coastdown_node: input {fault.about}']
        for publisher in (*logs, *([track] if track else [])):
            self.node.destroy_publisher(publisher)
        return LEVELS[found.level[0]], found.message

    def close(self) -> None:
        """End the node."""
        self.process.send_signal(signal.SIGINT)
        self.process.wait(30.0)
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)
        self.log.close()

    def _stamp(self, message: Any, ahead_s: float | None) -> None:
        if ahead_s is None:
            return
        stamp_ns = time.time_ns() + round(ahead_s * 1e9)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)

    def _hear(self, message: DiagnosticArray) -> None:
        self.latest |= {status.name: status for status in message.status}

    def _is_ready(self) -> bool:
        status = self.latest.get('coastdown_node: state')
        values = {} if status is None else {item.key: item.value for item in status.values}
        return values.get('lifecycle') == 'active' and 'compiling [s]' not in values

    def _spin(self, done: Callable[[], bool], within_s: float) -> None:
        end = time.monotonic() + within_s
        while not done() and (left := end - time.monotonic()) > 0.0:
            self.executor.spin_once(timeout_sec=left)


def main() -> None:
    """Print the table, and write it if asked to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--write', action='store_true', help='put the table into the page')
    options = parser.parse_args()
    rows = []
    for fault in FAULTS:
        # a node for each: what one leaves behind is no part of the next
        with tempfile.TemporaryDirectory() as directory:
            bench = Bench(Path(directory))
            try:
                level, text = bench.of(fault)
            finally:
                bench.close()
        rows.append((fault.name, fault.before, f'{level}: {text}'))
        print(rows[-1], file=sys.stderr, flush=True)
    made = '\n'.join(table(['fault', 'before', 'now'], rows))
    print(made)
    if options.write:
        put(PAGE, {'faults': made})


if __name__ == '__main__':
    main()
