# SPDX-License-Identifier: Apache-2.0
"""Attacks on a running node by a ROS peer of the same machine."""

from __future__ import annotations

import atexit
import math
import os
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import yaml

from benchmarks._attack import Attack, check
from shipdrag_ros.messages import encode
from shipdrag_ros.messages.heard import DIAGNOSTICS, Health, health_of
from shipdrag_ros.samples import Block, Channel

NAME = '/coastdown_node'
NODE_LINE = (sys.executable, '-m', 'shipdrag_ros.node.main')
START_S = 240.0
ANSWER_S = 30.0
SECRET = 'hunter2'
SPEED_TYPE = 'geometry_msgs/msg/TwistWithCovarianceStamped'

JOINTS_TYPE = 'sensor_msgs/msg/JointState'


class Node:
    """The node that is attacked, started when first needed, and its peer."""

    def __init__(self) -> None:
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def start(self) -> None:
        """Start the node and the peer, once."""
        if self._folder is not None:
            return
        os.environ['ROS_DOMAIN_ID'] = '101'
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        from shipdrag_ros.node.inputs import message_class

        self._folder = tempfile.TemporaryDirectory()
        self.folder = Path(self._folder.name).resolve()
        self.bags = self.folder / 'bags'
        ship = self.folder / 'ship.yaml'
        ship.write_text('length_m: 150.0\ndisplaced_volume_m3: 20200.0\n')
        given = {'ship_file': str(ship), 'output_directory': str(self.bags)}
        parameters = self.folder / 'parameters.yaml'
        parameters.write_text(yaml.safe_dump({'/**': {'ros__parameters': given}}))
        self._log = self.folder / 'log'
        with self._log.open('w') as log:
            self.process = subprocess.Popen(
                [*NODE_LINE, '--ros-args', '--params-file', str(parameters)],
                stdout=log,
                stderr=subprocess.STDOUT,
            )
        atexit.register(self.close)
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self.peer = rclpy.create_node('attacker', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.peer)
        self._health: Health | None = None
        self.peer.create_subscription(message_class(DIAGNOSTICS), '/diagnostics', self._hear, 10)
        self.until(lambda: 'ready to estimate' in self.log, START_S)

    @property
    def log(self) -> str:
        """All that the node has said."""
        return self._log.read_text()

    def until(self, condition: Callable[[], object], within_s: float = ANSWER_S) -> None:
        """Spin until something is so."""
        end_s = time.monotonic() + within_s
        while not condition():
            check(self.process.poll() is None, 'the node ended')
            check(time.monotonic() < end_s, 'no answer')
            self._executor.spin_once(timeout_sec=0.02)

    def ask(self, service: str, request: Any, kind: Any, times: int = 1) -> list[Any]:
        """Ask a service, many times at once, and return the answers."""
        client = self.peer.create_client(kind, f'{NAME}/{service}')
        self.until(client.service_is_ready)
        self.spin_for(0.3)  # discovery
        futures = []
        for _ in range(times):
            futures.append(client.call_async(request))
            if times > 1:
                self._executor.spin_once(timeout_sec=0.0)
        # of many at once the middleware itself drops some
        least = 1 if times > 1 else times
        self.until(lambda: sum(future.done() for future in futures) >= least)
        if times > 1:
            self.spin_for(3.0)
        self.peer.destroy_client(client)
        return [future.result() for future in futures if future.done()]

    def spin_for(self, seconds: float) -> None:
        """Go on for so long."""
        end_s = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end_s)

    def set(self, **values: object) -> list[Any]:
        """Ask for parameters to be set; return the results."""
        from rcl_interfaces.srv import SetParameters
        from rclpy.parameter import Parameter

        request = SetParameters.Request()
        request.parameters = [Parameter(k, value=v).to_parameter_msg() for k, v in values.items()]
        return list(self.ask('set_parameters', request, SetParameters)[0].results)

    def change(self, label: str) -> bool:
        """Ask for a transition."""
        from lifecycle_msgs.srv import ChangeState

        request = ChangeState.Request()
        request.transition.label = label
        return bool(self.ask('change_state', request, ChangeState)[0].success)

    def state(self) -> str:
        """Ask where the node stands."""
        from lifecycle_msgs.srv import GetState

        answer = self.ask('get_state', GetState.Request(), GetState)[0]
        return str(answer.current_state.label)

    def _hear(self, message: Any) -> None:
        self._health = next(iter(health_of(message.status)), self._health)

    def number(self, input_name: str, key: str) -> int:
        """Return what the node says next of one of its inputs."""
        self._health = None
        self.until(lambda: self._health is not None)
        status = self._health and self._health.of(f'input {input_name}')
        return int(status.number(key) or 0) if status else 0

    def publish(
        self, payloads: list[Any], topic: str = 'speed_through_water', kind: str = SPEED_TYPE
    ) -> None:
        """Publish bytes or messages, as a speed log if nothing else is said."""
        from rclpy.duration import Duration

        from shipdrag_ros.node.inputs import message_class

        publisher = self.peer.create_publisher(message_class(kind), topic, 1000)
        self.until(publisher.get_subscription_count)
        self.spin_for(0.3)
        for payload in payloads:
            publisher.publish(payload)
        # a publisher that goes takes with it what is still on its way
        publisher.wait_for_all_acked(Duration(seconds=ANSWER_S))
        self.spin_for(1.0)
        self.peer.destroy_publisher(publisher)

    def close(self) -> None:
        """End what was started."""
        if self._folder is None:
            return
        import rclpy

        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(ANSWER_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        self._executor.shutdown()
        self.peer.destroy_node()
        rclpy.try_shutdown(context=self._context)
        self._folder.cleanup()
        self._folder = None


NODE = Node()


def on_node(attack: Callable[[Node, Path], str]) -> Callable[[Path], str]:
    """Run an attack on the node, and see whether it still answers as active."""

    def run(folder: Path) -> str:
        NODE.start()
        said = attack(NODE, folder)
        check(NODE.state() == 'active', f'the node is {NODE.state()}')
        check(SECRET not in NODE.log, 'a secret is in the log')
        return said

    return run


def refuses(**values: object) -> Callable[[Node, Path], str]:
    """Return an attack by parameters, in the active and in the unconfigured state."""

    def attack(node: Node, folder: Path) -> str:
        results = node.set(**values)
        for label in ('deactivate', 'cleanup'):
            check(node.change(label), 'no transition')
        results += [] if 'use_sim_time' in values else node.set(**values)
        for label in ('configure', 'activate'):
            check(node.change(label), 'no transition')
        check(not any(result.successful for result in results), 'it was set')
        return f'refused: {results[0].reason}'.replace('\n', ' ')[:120]

    return attack


def illegal(node: Node, folder: Path) -> str:
    """Ask for transitions that are not there."""
    for label in ('configure', 'activate', 'no_such', ''):
        check(not node.change(label), 'it was done')
    return 'refused, and said in the log'


def recordings(node: Node, folder: Path) -> str:
    """Stop and start recording fifty times, with inputs in memory."""
    from std_srvs.srv import Trigger

    before = len(list(node.bags.glob('*')))
    node.publish(readings([5.0, 5.1, 5.2]))
    for service in ('stop_recording', 'start_recording') * 50:
        node.ask(service, Trigger.Request(), Trigger)
    made = len(list(node.bags.glob('*'))) - before
    check(made < 30, f'{made} files')
    return f'{made} files made by 100 requests'


def resets(node: Node, folder: Path) -> str:
    """Ask for a reset three hundred times at once."""
    from std_srvs.srv import Trigger

    answers = node.ask('reset', Trigger.Request(), Trigger, 300)
    done = sum(answer.success for answer in answers)
    check(done < 60, f'{done} were done')
    return f'{done} of 300 done, the rest refused'


def reads(node: Node, folder: Path) -> str:
    """Ask for all parameters two thousand times at once."""
    from rcl_interfaces.srv import ListParameters

    start_s = time.monotonic()
    answers = node.ask('list_parameters', ListParameters.Request(), ListParameters, 2000)
    given = sum(bool(answer.result.names) for answer in answers)
    check(given < 1500, 'all were answered')
    return f'{given} of 2000 answered in full, in {time.monotonic() - start_s:.1f} s'


def payloads(made: Callable[[], list[bytes]], said: str) -> Callable[[Node, Path], str]:
    """Return an attack by messages."""

    def attack(node: Node, folder: Path) -> str:
        node.publish(made())
        return said

    return attack


def lying_length() -> list[bytes]:
    """Say that the name of the frame has four billion characters."""
    head = b'\x00\x01\x00\x00' + struct.pack('<iI', 1_700_000_000, 0)
    return [head + struct.pack('<I', size) + b'x' * 300 for size in (2**32 - 1, 2**31, 400)]


def huge(node: Node, folder: Path) -> str:
    """Send names of frames of 200 kB, and a million shafts in one message."""
    from shipdrag_ros.node.inputs import message_class

    process = psutil.Process(node.process.pid)
    before_mb = process.memory_info().rss / 2**20
    speed = message_class(SPEED_TYPE)()
    speed.header.frame_id = 'x' * 200_000
    shafts = message_class(JOINTS_TYPE)()
    shafts.name, shafts.velocity = ['shaft'] * 10**6, [10.0] * 10**6
    node.publish([speed] * 200)
    node.publish([shafts] * 3, 'shaft', JOINTS_TYPE)
    counts = [
        node.number(name, 'unreadable too_long') for name in ('speed_through_water', 'shaft')
    ]
    check(all(counts), f'{counts} were counted')
    more_mb = process.memory_info().rss / 2**20 - before_mb
    check(more_mb < 256.0, f'the node took {more_mb:.0f} MB more')
    bag_mb = sum(bag.stat().st_size for bag in node.bags.glob('*.mcap')) / 2**20
    check(bag_mb < 8.0, f'{bag_mb:.0f} MB were recorded')
    return f'{counts[0]} and {counts[1]} counted too_long, not recorded; {more_mb:+.0f} MB memory'


def odd_stamps(node: Node, folder: Path) -> str:
    """Send stamps before 1970, nanoseconds beyond a second and variances that are none."""
    from shipdrag_ros.node.inputs import message_class

    made = []
    for sec, nanosec in ((-(2**31), 0), (-5, 2**32 - 1), (2**31 - 1, 2**32 - 1), (0, 0)):
        message = message_class(SPEED_TYPE)()
        message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec
        message.twist.covariance = [math.nan] * 18 + [-math.inf] * 18
        made.append(message)
    before = node.number('speed_through_water', 'used')
    node.publish(made)
    used = node.number('speed_through_water', 'used') - before
    check(used <= 1, f'{used} of {len(made)} were used')
    return f'{len(made) - used} of {len(made)} rejected and counted'


def readings(values: list[float], *, ahead_s: float = 0.0, count: int = 1) -> list[bytes]:
    """Encode readings of a speed log, stamped now or ahead."""
    stamps = time.time_ns() + round(ahead_s * 1e9) + np.arange(len(values) * count) * 10**3
    block = Block.of(Channel.SPEED_THROUGH_WATER, stamps, np.tile(values, count))
    return [message.payload for message in encode(block)]


def other_file(node: Node, folder: Path) -> str:
    """Have another file read as a ship file, and look for it in the log."""
    secret = folder / 'secret.yaml'
    secret.write_text(f'password: {SECRET}\n')
    return refuses(ship_file=str(secret))(node, folder)


NUMBERS = [math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324]
ATTACKS = [
    Attack('node', 'another ship file over a service', on_node(other_file)),
    Attack('node', 'a pipe as ship file', on_node(refuses(ship_file='/dev/stdin'))),
    Attack('node', 'recordings elsewhere', on_node(refuses(output_directory='/etc/cron.d'))),
    Attack('node', 'a source of NMEA', on_node(refuses(nmea='tcp://127.0.0.1:22'))),
    Attack('node', 'keep nothing', on_node(refuses(keep_bytes=1))),
    Attack('node', 'its clock taken away', on_node(refuses(use_sim_time=True))),
    Attack('node', 'transitions that are not there', on_node(illegal)),
    Attack('node', 'recordings started and stopped', on_node(recordings)),
    Attack('node', 'resets at once', on_node(resets)),
    Attack('node', 'questions at once', on_node(reads)),
    Attack(
        'node',
        'random bytes as messages',
        on_node(payloads(lambda: [os.urandom(n) for n in range(1, 400, 7)], 'counted malformed')),
    ),
    Attack('node', 'a length that lies', on_node(payloads(lying_length, 'counted malformed'))),
    Attack(
        'node',
        'numbers that are none',
        on_node(payloads(lambda: readings(NUMBERS), 'rejected: nan, infinite, absurd')),
    ),
    Attack(
        'node',
        'readings from next year',
        on_node(payloads(lambda: readings([5.0], ahead_s=3e7), 'rejected: future')),
    ),
    Attack(
        'node',
        'ten thousand readings at once',
        on_node(payloads(lambda: readings([5.0], count=10_000), 'heard, lost ones counted')),
    ),
    Attack('node', 'messages of 200 kB, a million joints', on_node(huge)),
    Attack('node', 'stamps and variances that are none', on_node(odd_stamps)),
]
