# SPDX-License-Identifier: Apache-2.0
"""The node in a process of its own, and a peer that talks to it over DDS on loopback."""

from __future__ import annotations

import gc
import os
import resource
import signal
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.node import forked
from tests.sources.log_samples import sentence

START_S = 400.0  # the first start of a machine compiles the kernels
ANSWER_S = 200.0  # of a machine that has much else to do
READY = 'ready to estimate'


class NodeProcess:
    """
    `coastdown_node` in a process of its own.

    `tests/peers` start it as a user does.
    """

    def __init__(self, directory: Path, arguments: list[str], *, fresh: bool = False) -> None:
        self._log = directory / 'node.log'
        self._log.touch()
        given = (str(self._log), dict(os.environ), arguments)
        context = forked.FRESH if fresh else forked.SERVER
        self._process = context.Process(target=forked.run, args=given)
        self._process.start()

    @property
    def log(self) -> str:
        return self._log.read_text()

    def wait_for_log(self, text: str) -> None:
        end = time.monotonic() + START_S
        while text not in self.log:
            assert self._process.is_alive(), self.log
            assert time.monotonic() < end, f'no {text!r} in\n{self.log}'
            time.sleep(0.05)

    def wait_for_file(self, directory: Path) -> None:
        """
        Return once a recording is there, which is after the first input.
        """
        end = time.monotonic() + ANSWER_S
        while not any(directory.glob('*.mcap')):
            assert time.monotonic() < end, f'no recording in {directory}'
            time.sleep(0.05)

    def wait(self, within_s: float = START_S) -> int:
        """
        Return the exit status.
        """
        self._process.join(within_s)
        assert self._process.exitcode is not None, self.log
        return self._process.exitcode

    def stop(self, number: signal.Signals = signal.SIGINT) -> int:
        """
        Ask for the end and return the exit status.
        """
        self._signal(number)
        return self.wait(ANSWER_S)

    def fill_disk(self, full_bytes: int | None) -> None:
        """
        Let no file grow beyond a size, as a full disk would; None: as before.
        """
        assert self._process.pid is not None
        _, hard = resource.prlimit(self._process.pid, resource.RLIMIT_FSIZE)
        soft = hard if full_bytes is None else full_bytes
        resource.prlimit(self._process.pid, resource.RLIMIT_FSIZE, (soft, hard))

    def _signal(self, number: signal.Signals) -> None:
        assert self._process.pid is not None
        os.kill(self._process.pid, number)

    def pause(self) -> None:
        """
        Let it stand still.
        """
        self._signal(signal.SIGSTOP)

    def go_on(self) -> None:
        """
        Let it run again.
        """
        self._signal(signal.SIGCONT)

    def kill(self) -> None:
        """
        End it at once, with no chance to close anything.
        """
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


class Peer:
    """
    The rest of the ROS graph, one context of this process.
    """

    def __init__(self, name: str = 'peer') -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        from shipdrag_ros.node.spectator import Player

        self._rclpy = rclpy
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self.node = rclpy.create_node(name, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.player = Player(self.node, self._executor)

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._rclpy.try_shutdown(context=self._context)

    def spin_until(self, condition: Callable[[], Any], *, within_s: float = ANSWER_S) -> Any:
        """
        Return the first true value of the condition.
        """
        end = time.monotonic() + within_s
        while not (value := condition()):
            assert time.monotonic() < end, f'not within {within_s} s'
            self._executor.spin_once(timeout_sec=0.05)
        return value

    def spin_for(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def listen(
        self, topic: str, type_name: str, *, latched: bool = False, raw: bool = False
    ) -> list[Any]:
        """
        Return the list that messages will appear in.
        """
        from rclpy.qos import DurabilityPolicy, QoSProfile

        from shipdrag_ros.node.inputs import message_class

        heard: list[Any] = []
        qos = QoSProfile(depth=1000)
        if latched:
            qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
        self.node.create_subscription(message_class(type_name), topic, heard.append, qos, raw=raw)
        return heard

    def advertise(self, topic: str, type_name: str, qos: Any = 10) -> Any:
        """
        Return a publisher that is none of the player's.
        """
        from shipdrag_ros.node.inputs import message_class

        return self.node.create_publisher(message_class(type_name), topic, qos)

    def wait_for_listener(self, publisher: Any) -> None:
        """
        Return once the next message of a publisher is heard.
        """
        from shipdrag_ros.node.spectator import DISCOVERY_S

        self.spin_until(publisher.get_subscription_count)
        self.spin_for(DISCOVERY_S)

    def call(self, service: str, request: Any, kind: Any) -> Any:
        """
        Return the answer of a service.
        """
        from shipdrag_ros.node.spectator import DISCOVERY_S

        client = self.node.create_client(kind, service)
        self.spin_until(client.service_is_ready)
        # the node must have discovered this client too, or its answer is lost
        self.spin_for(DISCOVERY_S)
        future = client.call_async(request)
        self.spin_until(future.done)
        self.node.destroy_client(client)
        return future.result()

    def trigger(self, name: str) -> Any:
        from std_srvs.srv import Trigger

        return self.call(f'/coastdown_node/{name}', Trigger.Request(), Trigger)

    def change_state(self, label: str) -> bool:
        from lifecycle_msgs.srv import ChangeState

        request = ChangeState.Request()
        request.transition.label = label
        answer = self.call('/coastdown_node/change_state', request, ChangeState)
        return bool(answer.success)

    def state(self) -> str:
        from lifecycle_msgs.srv import GetState

        answer = self.call('/coastdown_node/get_state', GetState.Request(), GetState)
        return str(answer.current_state.label)


def values(status: Any) -> dict[str, str]:
    return {item.key: item.value for item in status.values}


class Diagnostics:
    """
    The latest status of each part of the node.
    """

    def __init__(self, peer: Peer) -> None:
        self._peer = peer
        self._heard = peer.listen('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray')

    def of(self, part: str) -> Any:
        name = f'coastdown_node: {part}'
        for array in reversed(self._heard):
            for status in array.status:
                if status.name in (name, f'ship/{name}'):
                    return status
        return None

    def forget(self) -> None:
        """
        Forget what was told so far, as by a node that is gone.
        """
        self._heard.clear()

    def set_clock(self, time_ns: int) -> None:
        """
        Publish simulated time until the node goes by it.
        """

        def heard() -> bool:
            self._peer.player.set_clock(time_ns)
            if not self._heard:
                return False
            stamp = self._heard[-1].header.stamp
            return bool(stamp.sec * 10**9 + stamp.nanosec == time_ns)

        self._peer.spin_until(heard)

    def wait_for(self, part: str, text: str, *, value: str | None = None) -> Any:
        """
        Return the status once its message contains a text, or the value of a key is that.
        """

        def found() -> Any:
            status = self.of(part)
            if status is None:
                return None
            there = text in status.message if value is None else values(status).get(value) == text
            return status if there else None

        try:
            return self._peer.spin_until(found)
        except AssertionError:
            raise AssertionError(f'{part}: {self.of(part)}, expected {text!r}') from None


StartNode = Callable[..., NodeProcess]


@pytest.fixture
def start_node(tmp_path: Path, ship_file: Path) -> Iterator[StartNode]:
    """A function that starts a node, forked or fresh, and waits until it is up."""
    started: list[NodeProcess] = []

    def start(
        *arguments: str,
        up: str | None = 'ready to estimate',
        ship: bool = True,
        fresh: bool = False,
        **parameters: object,
    ) -> NodeProcess:
        directory = tmp_path / f'node{len(started)}'
        directory.mkdir()
        given = {'output_directory': str(tmp_path / 'bags'), **parameters}
        if ship:
            given = {'ship_file': str(ship_file), **given}
        file = directory / 'parameters.yaml'
        file.write_text(yaml.safe_dump({'/**': {'ros__parameters': given}}))
        line = ['--ros-args', '--params-file', str(file), *arguments]
        node = NodeProcess(directory, line, fresh=fresh)
        started.append(node)
        if up is not None:
            node.wait_for_log(up)
        return node

    yield start
    for node in started:
        node.kill()


@pytest.fixture
def ship_file(tmp_path: Path) -> Path:
    """The least that a ship file may say."""
    path = tmp_path / 'ship.yaml'
    path.write_text('length_m: 150.0\ndisplaced_volume_m3: 20200.0\n')
    return path


@pytest.fixture
def peer() -> Iterator[Peer]:
    """The rest of the graph."""
    pytest.importorskip('rclpy')
    # a closed node of this process answers for a living one until its cycles are collected
    gc.collect()
    peer = Peer()
    yield peer
    peer.close()


@pytest.fixture
def diagnostics(peer: Peer) -> Diagnostics:
    """What the node says about itself."""
    return Diagnostics(peer)


class Instruments:
    """A multiplexer that speaks over UDP."""

    def __init__(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(('127.0.0.1', 0))
            self.port = probe.getsockname()[1]
        self.source = f'udp://127.0.0.1:{self.port}'
        self.sent: list[str] = []
        self._line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def say(self, *lines: str) -> None:
        for line in lines:
            self._line.sendto(line.encode() + b'\r\n', ('127.0.0.1', self.port))
            self.sent.append(line)

    def until(self, condition: Any, peer: Any, *contents: str) -> None:
        """Repeat sentences, their number at the end of a field of no meaning, until it is so."""
        end = time.monotonic() + 200.0
        while not condition():
            assert time.monotonic() < end
            self.say(*(sentence(content) for content in contents))
            peer.spin_for(0.1)

    def close(self) -> None:
        self._line.close()


@pytest.fixture
def instruments() -> Iterator[Instruments]:
    it = Instruments()
    yield it
    it.close()
