# SPDX-License-Identifier: Apache-2.0
"""
How long an estimate takes to come, and what the node costs meanwhile.

Two processes over DDS on loopback. A simulated coastdown is played fast until it
is confirmed, then in real time while an estimate is asked for every second.
Latency runs from publishing the sample that makes an estimate due to hearing
`~/speed`; the processor time is that of the node alone.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks import ROOT

os.environ.setdefault('ROS_DOMAIN_ID', '5')  # the tests and the demonstration are above
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

import psutil
import rclpy
from geometry_msgs.msg import TwistWithCovarianceStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from shipdrag_ros.node.spectator import Player
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, sense, simulate, standard_sensors

SHIP_FILE = ROOT / 'config' / 'vitus_bering.yaml'
SEED = 1
LEAD_IN_S = 150.0
CONFIRMED_S = 120.0  # played fast, after the stop
PARAMETERS = {'update_s': 1.0, 'steady_s': 60.0, 'slope_window_s': 30.0}
Received = list[tuple[float, int]]
"""When [s, steady clock], and the stamp [ns]."""


def record(rate_hz: float, live_s: float) -> tuple[Block, Block]:
    """Return speed and position of a coastdown: what is played fast, and what in real time."""
    scenario = Scenario(speed_m_s=8.2, lead_in_s=LEAD_IN_S, duration_s=CONFIRMED_S + live_s)
    channels = (Channel.SPEED_THROUGH_WATER, Channel.POSITION)
    sensors = [each for each in standard_sensors(rate_hz=rate_hz) if each.channel in channels]
    block = sense(simulate(Ship.load(SHIP_FILE), scenario), sensors, seed=SEED)
    fast = (block.receive_ns - block.receive_ns[0]) < (LEAD_IN_S + CONFIRMED_S) * 1e9
    return block[fast], block[~fast]


def late_ms(received: Received, sent_s: list[float], stamps_ns: np.ndarray) -> np.ndarray:
    """Return when the sample was sent that made each estimate due, and how late it is (n, 2)."""
    late = []
    for when, stamp_ns in received:
        # an estimate of all samples up to a stamp is due at the first one after it
        i = int(np.searchsorted(stamps_ns, stamp_ns, side='right'))
        if i < len(sent_s):
            late.append((sent_s[i], 1e3 * (when - sent_s[i])))
    return np.array(late).reshape(-1, 2)


@dataclass(frozen=True)
class Onboard:
    """A running node and the peer that feeds it."""

    process: psutil.Process
    peer: Node
    executor: SingleThreadedExecutor
    player: Player

    def spin_for(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self.executor.spin_once(timeout_sec=left)

    def subscribe(self) -> Received:
        """Return the list to which every estimate is added."""
        received: Received = []

        def add(message: TwistWithCovarianceStamped) -> None:
            stamp = message.header.stamp
            received.append((time.monotonic(), stamp.sec * 10**9 + stamp.nanosec))

        topic = '/coastdown_node/speed'
        self.peer.create_subscription(TwistWithCovarianceStamped, topic, add, 1000)
        return received

    def play(self, block: Block, ended: Callable[[], bool] = lambda: False) -> list[float]:
        """
        Publish each sample at its own time, simulated time a second ahead; return when.
        """
        offsets_s = ((block.receive_ns - block.receive_ns[0]) * 1e-9).tolist()
        times: list[float] = []
        start, clock_s = time.monotonic(), -1.0
        for i, offset_s in enumerate(offsets_s):
            if ended():
                break
            self.spin_for(start + offset_s - time.monotonic())
            if offset_s >= clock_s + 1.0:
                clock_s = np.floor(offset_s)
                self.player.set_clock(int(block.receive_ns[0]) + int((clock_s + 1.0) * 1e9))
            times.append(time.monotonic())
            self.player.publish(block[i : i + 1])
        return times

    def cpu_s(self) -> float:
        """Return the processor time of the node so far [s]."""
        times = self.process.cpu_times()
        return times.user + times.system


@contextmanager
def onboard(**parameters: object) -> Iterator[Onboard]:
    """Start the node under simulated time; end it as a user would."""
    with TemporaryDirectory() as folder:
        given = {
            'ship_file': SHIP_FILE,
            'output_directory': folder,
            'use_sim_time': 'true',
            **parameters,
        }
        words = [word for name, value in given.items() for word in ('-p', f'{name}:={value}')]
        command = [sys.executable, '-m', 'shipdrag_ros.node.main', '--ros-args', *words]
        with (Path(folder) / 'log').open('w') as log:
            node = subprocess.Popen(command, stdout=log, stderr=log)
        while 'ready to estimate' not in (Path(folder) / 'log').read_text():
            assert node.poll() is None, (Path(folder) / 'log').read_text()
            time.sleep(0.1)
        context = rclpy.Context()
        rclpy.init(context=context)
        peer = rclpy.create_node('peer', context=context)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(peer)
        try:
            player = Player(peer, executor)
            yield Onboard(psutil.Process(node.pid), peer, executor, player)
            node.send_signal(signal.SIGINT)
            status = node.wait(timeout=30)
            assert status == 0, (Path(folder) / 'log').read_text()
        finally:
            node.kill()
            executor.shutdown()
            peer.destroy_node()
            rclpy.try_shutdown(context=context)


MEASURED_S = 60.0  # played in real time
RATES_HZ = (1.0, 10.0, 100.0)
MESSAGES_PER_S = 1000.0  # while played fast, and no more than
SPEED_UP = 60.0
IDLE_S = 5.0


def measure(rate_hz: float) -> str:
    """One row of the table."""
    fast, live = record(rate_hz, MEASURED_S)
    with onboard(**PARAMETERS) as node:
        received = node.subscribe()
        node.player.connect(fast, timeout_s=60.0)
        idle_s = node.cpu_s()
        node.spin_for(IDLE_S)
        idle = (node.cpu_s() - idle_s) / IDLE_S
        node.player.play(fast, speed=min(SPEED_UP, MESSAGES_PER_S / (2.0 * rate_hz)))
        node.spin_for(5.0)
        received.clear()
        busy_s = node.cpu_s()
        sent_s = node.play(live)
        busy = (node.cpu_s() - busy_s) / MEASURED_S
        node.spin_for(1.0)
        memory_mb = node.process.memory_info().rss / 2**20
    late = late_ms(received, sent_s, live.stamp_ns)[:, 1]
    if not len(late):
        raise SystemExit('no estimate was received: is this machine too busy for the node?')
    median, high = np.percentile(late, [50, 99])
    return (
        f'{rate_hz:8g} {len(late):10d} {median:10.2f} {high:10.2f} {max(late):10.2f}'
        f' {100 * busy:9.1f} {100 * idle:9.1f} {memory_mb:11.0f}'
    )


def main() -> None:
    """Print the table."""
    print(
        f'simulated coastdown, speed and position at the rate given, seed {SEED}; an estimate '
        f'each second for {MEASURED_S:g} s, {CONFIRMED_S:g} s into the coastdown'
    )
    print(
        f'{"rate Hz":>8} {"estimates":>10} {"median ms":>10} {"p99 ms":>10} {"max ms":>10}'
        f' {"CPU %":>9} {"idle %":>9} {"memory MB":>11}'
    )
    for rate_hz in RATES_HZ:
        print(measure(rate_hz), flush=True)


if __name__ == '__main__':
    main()
