# SPDX-License-Identifier: Apache-2.0
"""
The first start of a machine: nothing compiled is kept.

Starts the node with an empty cache, sends readings at 10 Hz over DDS on loopback, and
asks it to end after some seconds, each time anew, the last time when it is ready. Prints
the table of docs/results/node_faults.txt, `--write` puts it there; a few minutes.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ.setdefault('ROS_DOMAIN_ID', '96')

import rclpy
from _onboard import SHIP_FILE
from _tables import put, table
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from mcap.reader import make_reader
from rclpy.executors import SingleThreadedExecutor

from shipdrag_ros.messages.heard import health_of

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'results' / 'node_faults.txt'
RATE_HZ = 10.0
ENDS_S = (1.0, 4.0, 15.0, None)  # after the first words of the node; None: when it is ready
LONGEST_S = 900.0


@dataclass
class Start:
    """What became of one start."""

    first_s: float = 0.0
    ready_s: float | None = None
    sent: int = 0
    used: int = 0
    recorded: int = 0
    end_s: float = 0.0
    status: int | None = None


class Peer:
    """Who hears and feeds the nodes."""

    def __init__(self) -> None:
        rclpy.init()
        self._node = rclpy.create_node('cold_start')
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._node.create_subscription(DiagnosticArray, '/diagnostics', self._hear, 10)
        self._publisher = self._node.create_publisher(TwistStamped, 'speed_through_water', 1000)
        self._start, self._begin_s = Start(), 0.0

    def start(self, end_s: float | None) -> Start:
        """Start a node and end it after a while."""
        self._start = Start()
        with tempfile.TemporaryDirectory() as folder:
            environment = {**os.environ, 'SHIPDRAG_CACHE_DIR': f'{folder}/cache'}
            line = [sys.executable, '-m', 'shipdrag_ros.node.main', '--ros-args']
            line += ['-p', f'ship_file:={SHIP_FILE}', '-p', f'output_directory:={folder}']
            line += ['--log-level', 'warn']
            node = subprocess.Popen(line, env=environment)
            self._begin_s = time.monotonic()
            self._sail(end_s)
            ask_s = time.monotonic()
            node.send_signal(signal.SIGINT)
            self._start.status = node.wait(60.0)
            self._start.end_s = time.monotonic() - ask_s
            for bag in Path(folder).glob('*.mcap'):
                with bag.open('rb') as stream:
                    messages = make_reader(stream).iter_messages(['/speed_through_water'])
                    self._start.recorded += sum(1 for _ in messages)
        return self._start

    def _sail(self, end_s: float | None) -> None:
        """Send readings until it is time, and until those have been heard."""
        start = self._start
        while True:
            now_s = time.monotonic() - self._begin_s
            assert now_s < LONGEST_S, 'the node is not ready'
            if end_s is None and start.ready_s is not None and now_s > start.ready_s + 5.0:
                break
            if end_s is not None and start.first_s and now_s > start.first_s + end_s:
                break
            if self._publisher.get_subscription_count():
                self._send()
            self._spin(1.0 / RATE_HZ)
        self._spin(0.5)

    def _send(self) -> None:
        message = TwistStamped()
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.twist.linear.x = 5.0 + 0.01 * (self._start.sent % 7)
        self._publisher.publish(message)
        self._start.sent += 1

    def _hear(self, message: DiagnosticArray) -> None:
        now_s = time.monotonic() - self._begin_s
        for health in health_of(message.status):
            state, log = health.of('state'), health.of('input speed_through_water')
            assert state is not None
            assert log is not None
            self._start.first_s = self._start.first_s or now_s
            self._start.used = int(log.number('used') or 0)
            if state.values['lifecycle'] == 'active' and 'compiling [s]' not in state.values:
                self._start.ready_s = self._start.ready_s or now_s

    def _spin(self, seconds: float) -> None:
        end_s = time.monotonic() + seconds
        while (left_s := end_s - time.monotonic()) > 0.0:
            self._executor.spin_once(left_s)


def main() -> None:
    """Print the table, and write it if asked to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--write', action='store_true', help='put the table into the page')
    options = parser.parse_args()
    peer = Peer()
    rows = []
    for end_s in ENDS_S:
        found = peer.start(end_s)
        state = 'compiling' if found.ready_s is None else f'ready after {found.ready_s:.0f} s'
        rows.append(
            (
                state,
                f'{found.first_s:.1f}',
                f'{found.end_s:.1f}',
                found.status,
                found.sent,
                found.recorded,
                found.used,
            )
        )
        print(rows[-1], file=sys.stderr, flush=True)
    head = ['asked to end while', 'first words [s]', 'it ended after [s]', 'exit status']
    head += ['readings sent', 'recorded', 'used']
    made = '\n'.join(table(head, rows))
    load = f'{os.cpu_count()} cores, of which others used {os.getloadavg()[0]:.0f}'
    made = f'{made}\n\nOn a machine with {load} on average (load of the last minute).'
    print(made)
    if options.write:
        put(PAGE, {'cold start': made})


if __name__ == '__main__':
    main()
