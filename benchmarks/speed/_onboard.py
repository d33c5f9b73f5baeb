# SPDX-License-Identifier: Apache-2.0
"""The node in a process of its own, for the benchmarks of it; DDS on loopback."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

os.environ.setdefault('ROS_DOMAIN_ID', '5')  # the tests and the demonstration are above
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

import psutil
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from shipdrag_ros.node.spectator import Player

SHIP_FILE = Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml'


@dataclass(frozen=True)
class Onboard:
    """A running node and the peer that feeds it."""

    process: psutil.Process
    peer: Node
    executor: SingleThreadedExecutor
    player: Player
    directory: Path

    def spin_for(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self.executor.spin_once(timeout_sec=left)

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
            yield Onboard(psutil.Process(node.pid), peer, executor, player, Path(folder))
            node.send_signal(signal.SIGINT)
            status = node.wait(timeout=30)
            assert status == 0, (Path(folder) / 'log').read_text()
        finally:
            node.kill()
            executor.shutdown()
            peer.destroy_node()
            rclpy.try_shutdown(context=context)
