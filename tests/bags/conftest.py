# SPDX-License-Identifier: Apache-2.0
"""Bags to read, made by this package and by others."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import Event
from shipdrag_ros.messages import (
    EncodedMessage,
    OutputMessage,
    Source,
    decode,
    encode,
    outputs,
    reset_request,
)
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship

START_NS = 1_700_000_000_000_000_000
PARAMETERS = Parameters(update_s=30.0)


def record(seed: int = 1, seconds: int = 60) -> Block:
    """All channels, noisy and at uneven times, in order of arrival."""
    rng = np.random.default_rng(seed)
    blocks = []
    for channel in Channel:
        if channel is Channel.POSITION_GEODETIC:
            continue  # one type a topic
        n = int(rng.integers(seconds, 3 * seconds))
        stamps = START_NS + np.sort(rng.integers(0, seconds * 10**9, n))
        two = channel in (Channel.POSITION, Channel.WIND_APPARENT)
        value = rng.normal(3.0, 0.1, (n, 2)) if two else rng.normal(3.0, 0.1, n)
        if channel in (Channel.DEPTH, Channel.HEADING):
            value = np.full(n, 0.25)  # survives float32, and sine and cosine
        variance = np.full((n, 2), np.nan)
        if channel <= Channel.SPEED_OVER_GROUND:
            variance[:, 0] = 0.01
        if channel is Channel.POSITION:
            variance[:] = 4.0
        delays = rng.integers(10**6, 10**8, n)
        blocks.append(
            Block.of(channel, stamps, value, receive_ns=stamps + delays, variance=variance)
        )
    return in_arrival_order(blocks)


def write(
    path: Path, block: Block, ship: Ship | None = None, parameters: str = '', **options: Any
) -> Path:
    with BagWriter(path, **options) as bag:
        if ship is not None:
            bag.attach('ship.yaml', ship.to_yaml())
        if parameters:
            bag.attach('parameters.yaml', parameters)
        for message in encode(block):
            bag.write(
                message.topic,
                message.type,
                message.payload,
                log_ns=message.log_ns,
                publish_ns=message.publish_ns,
            )
    return path


@pytest.fixture(scope='session')
def block() -> Block:
    return record()


@pytest.fixture
def write_bag(tmp_path: Path) -> Callable[..., Path]:
    """Write a block to a new file of the test's folder."""

    def new(name: str, block: Block, **options: Any) -> Path:
        return write(tmp_path / name, block, **options)

    return new


@pytest.fixture(scope='session')
def sample_bag(tmp_path_factory: pytest.TempPathFactory, block: Block) -> bytes:
    """The bytes of a small bag with attachments, several chunks and an index."""
    path = tmp_path_factory.mktemp('sample') / 'sample.mcap'
    with BagWriter(path, chunk_bytes=4096) as bag:
        bag.attach('ship.yaml', 'name: x\n')
        for message in encode(block[:200]):
            bag.write(
                message.topic,
                message.type,
                message.payload,
                log_ns=message.log_ns,
                publish_ns=message.publish_ns,
            )
    return path.read_bytes()


def samples(items: Sequence[Any]) -> Block:
    """Join the blocks among what a run gives."""
    from shipdrag_ros.samples import concatenate

    return concatenate([item for item in items if isinstance(item, Block)])


@pytest.fixture
def read_samples() -> Callable[[Any], Block]:
    return lambda run: samples(list(run.inputs()))


@pytest.fixture
def assert_same() -> Callable[[Block, Block], None]:
    def check(one: Block, other: Block) -> None:
        for name in ('channel', 'stamp_ns', 'receive_ns', 'variance'):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
        # a heading has passed through sine and cosine
        np.testing.assert_allclose(one.value, other.value, rtol=0, atol=1e-15)

    return check


def sail(seed: int = 1, *, steady_s: float = 400.0, coast_s: float = 700.0) -> Block:
    """A steady ship whose engine stops; r = v^2 / 3000, at 1 Hz."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, steady_s + coast_s)
    coasting = np.maximum(t - steady_s, 0.0)
    speed = 8.0 / (1.0 + 8.0 * coasting / 3000.0)
    track = np.where(
        t < steady_s, 8.0 * (t - steady_s), 3000.0 * np.log1p(8.0 * coasting / 3000.0)
    )
    shaft = 10.0 * np.exp(-coasting / 8.0)
    stamps = START_NS + np.round(t * 1e9).astype(np.int64)
    log = speed + rng.normal(0.0, 0.03, len(t))
    fixes = np.column_stack([track, 0.0 * track]) + rng.normal(0.0, 1.0, (len(t), 2))
    yaw = rng.normal(0.7, 0.005, len(t))
    received = stamps + 20_000_000

    def block(channel: Channel, value: np.ndarray, delay_ns: int) -> Block:
        return Block.of(channel, stamps, value, receive_ns=received + delay_ns)

    return in_arrival_order(
        [
            block(Channel.SPEED_THROUGH_WATER, log, 0),
            block(Channel.POSITION, fixes, 1),
            block(Channel.SHAFT, shaft, 2),
            block(Channel.HEADING, yaw, 3),
        ]
    )


class Live:
    """What the node does with messages, without ROS: one at a time, and recording."""

    def __init__(self, ship: Ship, parameters: Parameters = PARAMETERS) -> None:
        self.monitor = Monitor(ship, parameters)
        self.ship, self.parameters = ship, parameters
        self.bag: BagWriter | None = None
        self.events: list[Event] = []

    def start(self, path: Path, ring: Iterable[EncodedMessage] = ()) -> None:
        self.bag = BagWriter(path)
        self.bag.attach('ship.yaml', self.ship.to_yaml())
        self.bag.attach('parameters.yaml', self.parameters.to_yaml())
        for message in ring:
            self.write(message)

    def receive(self, message: EncodedMessage) -> None:
        self.write(message)
        source = Source(message.topic.removeprefix('/'), message.type)
        block = decode(source, [message.payload], [message.log_ns]).block
        self.report(self.monitor.update(block), message.log_ns)

    def reset(self, now_ns: int) -> None:
        self.write_output(reset_request(now_ns, 'service'), now_ns)
        self.report(self.monitor.reset(now_ns, 'service'), now_ns)

    def stop(self, now_ns: int, *, finish: bool = True) -> None:
        if finish:
            self.report(self.monitor.finish(), now_ns)
        assert self.bag is not None
        self.bag.close()
        self.bag = None

    def report(self, events: list[Event], now_ns: int) -> None:
        self.events += events
        for event in events:
            for message in outputs(event):
                self.write_output(message, now_ns)

    def write(self, message: EncodedMessage) -> None:
        if self.bag is not None:
            self.bag.write(
                message.topic,
                message.type,
                message.payload,
                log_ns=message.log_ns,
                publish_ns=message.publish_ns,
            )

    def write_output(self, message: OutputMessage, now_ns: int) -> None:
        if self.bag is not None:
            self.bag.write(
                message.topic,
                message.type,
                message.payload,
                log_ns=now_ns,
                publish_ns=message.stamp_ns,
            )


@pytest.fixture(scope='session')
def ship() -> Ship:
    return Ship(name='test ship', length_m=150.0, displaced_volume_m3=20200.0)


@pytest.fixture(scope='session')
def parameters() -> Parameters:
    """Those of the recording."""
    return PARAMETERS


@pytest.fixture(scope='session')
def voyage() -> Callable[..., Block]:
    return sail


@pytest.fixture(scope='session')
def live() -> type[Live]:
    return Live


@pytest.fixture(scope='session')
def recording(ship: Ship, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Event]]:
    path = tmp_path_factory.mktemp('recording') / 'live.mcap'
    live = Live(ship)
    live.start(path)
    block = sail()
    for message in encode(block):
        live.receive(message)
    live.stop(int(block.receive_ns[-1]))
    return path, live.events


@pytest.fixture
def write_run() -> Callable[..., Path]:
    """Write a block, and maybe a ship and parameters, to a file."""
    return write
