# SPDX-License-Identifier: Apache-2.0
"""Runs as the node records them, without ROS."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import Event
from shipdrag_ros.messages import EncodedMessage, OutputMessage, Source, decode, encode
from shipdrag_ros.messages.publishing import outputs
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship

START_NS = 1_700_000_000_000_000_000
PARAMETERS = Parameters(update_s=30.0)


def sail(seed: int = 1, *, steady_s: float = 400.0, coast_s: float = 700.0) -> Block:
    """A steady ship whose engine stops; r = v^2 / 3000, at 1 Hz."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, steady_s + coast_s)
    coasting = np.maximum(t - steady_s, 0.0)
    speed = 8.0 / (1.0 + 8.0 * coasting / 3000.0)
    track = np.where(
        t < steady_s, 8.0 * (t - steady_s), 3000.0 * np.log1p(8.0 * coasting / 3000.0)
    )
    shaft = 10.0 * np.exp(-coasting)  # as the thrust, which is gone at once
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

    def start(self, path: Path) -> None:
        self.bag = BagWriter(path)
        self.bag.attach('ship.yaml', self.ship.to_yaml())
        self.bag.attach('parameters.yaml', self.parameters.to_yaml())

    def receive(self, message: EncodedMessage) -> None:
        self.write(message, message.log_ns, message.publish_ns)
        source = Source(message.topic.removeprefix('/'), message.type)
        block = decode(source, [message.payload], [message.log_ns]).block
        self.report(self.monitor.update(block), message.log_ns)

    def stop(self, now_ns: int) -> None:
        self.report(self.monitor.finish(), now_ns)
        assert self.bag is not None
        self.bag.close()
        self.bag = None

    def report(self, events: list[Event], now_ns: int) -> None:
        self.events += events
        for event in events:
            for message in outputs(event):
                self.write(message, now_ns, message.stamp_ns)

    def record(self, path: Path, block: Block) -> None:
        """Receive all of a record, and record it."""
        self.start(path)
        for message in encode(block):
            self.receive(message)
        self.stop(int(block.receive_ns[-1]))

    def write(self, message: EncodedMessage | OutputMessage, log_ns: int, publish_ns: int) -> None:
        if self.bag is not None:
            content = (message.topic, message.type, message.payload)
            self.bag.put(EncodedMessage(*content, log_ns=log_ns, publish_ns=publish_ns))


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
    live.record(path, sail())
    return path, live.events
