# SPDX-License-Identifier: Apache-2.0
"""Bags to read, made by this package and by others."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer
from rosbags.typesys import Stores, get_typestore

from shipdrag_ros.bags import BagWriter
from shipdrag_ros.messages import encode, types
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from tests.runs import write_run

START_NS = 1_700_000_000_000_000_000


def record(seed: int = 1, seconds: int = 60) -> Block:
    """All channels, noisy and at uneven times, in order of arrival."""
    rng = np.random.default_rng(seed)
    blocks = []
    for channel in Channel:
        if channel.kind is Channel.POSITION_GEODETIC:
            continue  # one type a topic
        n = int(rng.integers(seconds, 3 * seconds))
        stamps = START_NS + np.sort(rng.integers(0, seconds * 10**9, n))
        two = channel.kind in (Channel.POSITION, Channel.WIND_APPARENT)
        value = rng.normal(3.0, 0.1, (n, 2)) if two else rng.normal(3.0, 0.1, n)
        if channel in (Channel.DEPTH, Channel.HEADING):
            value = np.full(n, 0.25)  # survives float32, and sine and cosine
        variance = np.full((n, 2), np.nan)
        if channel.kind <= Channel.SPEED_OVER_GROUND:
            variance[:, 0] = 0.01
        if channel.kind is Channel.POSITION:
            variance[:] = 4.0
        delays = rng.integers(10**6, 10**8, n)
        blocks.append(
            Block.of(channel, stamps, value, receive_ns=stamps + delays, variance=variance)
        )
    return in_arrival_order(blocks)


def as_record(opcode: int, content: bytes, length: int | None = None) -> bytes:
    """A record of a file, perhaps with another length than its own."""
    return struct.pack('<BQ', opcode, len(content) if length is None else length) + content


def as_chunk(compression: str, packed: bytes, size: int, checksum: int = 0) -> bytes:
    """A chunk of records that unpack to so many bytes."""
    name = compression.encode()
    head = struct.pack('<QQQII', 1, 1, size, checksum, len(name)) + name
    return as_record(6, head + struct.pack('<Q', len(packed)) + packed)


@pytest.fixture(scope='session')
def block() -> Block:
    return record()


@pytest.fixture
def write_bag(tmp_path: Path) -> Callable[..., Path]:
    """Write a block to a new file of the test's folder."""

    def new(name: str, block: Block, **options: Any) -> Path:
        return write_run(tmp_path / name, block, **options)

    return new


@pytest.fixture(scope='session')
def sample_bag(tmp_path_factory: pytest.TempPathFactory, block: Block) -> bytes:
    """The bytes of a small bag with attachments, several chunks and an index."""
    path = tmp_path_factory.mktemp('sample') / 'sample.mcap'
    with BagWriter(path, chunk_bytes=4096) as bag:
        bag.attach('ship.yaml', 'name: x\n')
        bag.write_samples(block[:200])
    return path.read_bytes()


def assert_same(one: Block, other: Block) -> None:
    for name in ('channel', 'stamp_ns', 'receive_ns', 'variance'):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    # a heading has passed through sine and cosine
    np.testing.assert_allclose(one.value, other.value, rtol=0, atol=1e-15)


def rosbag2(path: Path, block: Block, mode: CompressionMode = CompressionMode.NONE) -> Path:
    store = get_typestore(Stores.ROS2_JAZZY)
    writer = Rosbag2Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for message in encode(block):
            if message.topic not in connections:
                connections[message.topic] = writer.add_connection(
                    message.topic, message.type, typestore=store
                )
            writer.write(connections[message.topic], message.log_ns, message.payload)
    return path


def listed(folder: Path, files: Sequence[str]) -> None:
    """Write the metadata of rosbag2 over files."""
    (folder / 'metadata.yaml').write_text(
        'rosbag2_bagfile_information:\n  storage_identifier: mcap\n'
        f'  relative_file_paths: {list(files)}\n  compression_mode: ""\n'
    )


def foreign(path: Path, block: Block, **options: Any) -> Path:
    """Write a file with the reference writer, any way it can."""
    with path.open('wb') as file:
        writer = Writer(file, **options)
        writer.start(profile='ros2')
        channels: dict[str, int] = {}
        for message in encode(block, namespace='/ship'):
            if message.topic not in channels:
                schema = writer.register_schema(
                    message.type, 'ros2msg', types.definition(message.type).encode()
                )
                channels[message.topic] = writer.register_channel(message.topic, 'cdr', schema)
            writer.add_message(
                channels[message.topic], message.log_ns, message.payload, message.publish_ns
            )
        writer.finish()
    return path
