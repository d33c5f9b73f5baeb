# SPDX-License-Identifier: Apache-2.0
"""
How fast bags are read into arrays, beside other readers of Python, and replayed.

TwistWithCovarianceStamped and PoseWithCovarianceStamped, 5 to 2, zstd, of a ship
that sails steadily and coasts down once in 1.4 million messages. Processor time of
one process, best of several rounds, the readers in turn; peers that are slow read
a part of the messages. The limit is what decompression and checksum of the chunks
cost alone. Growth up to 10 million messages, each length in a process of its own.
Needs `make peers`; takes four minutes on an idle machine.
"""

from __future__ import annotations

import argparse
import struct
import subprocess
import sys
import tempfile
import time
import zlib
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np
import zstandard
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from numpy.typing import NDArray

from shipdrag_ros.bags import BagWriter, open_runs
from shipdrag_ros.messages import encode, types
from shipdrag_ros.replay import replay
from shipdrag_ros.samples import Block, Channel

SEED = 1
ROUNDS = 3
PEER_MESSAGES = 35_000
STEADY_M_S = 8.0
EVERY_S = 1e5
START_NS = 1_700_000_000_000_000_000
TWIST, POSE = types.TWIST_WITH_COVARIANCE, types.POSE_WITH_COVARIANCE


def write(path: Path, messages: int) -> Path:
    """
    Write a bag of noisy readings at 10 and 4 Hz, five of speed to two of position.
    """
    ship = files('shipdrag_ros') / 'data' / 'vitus_bering.yaml'
    rng = np.random.default_rng(SEED)
    n = messages // 7
    speed_ns = START_NS + np.arange(5 * n) * 100_000_000
    position_ns = START_NS + np.arange(2 * n) * 250_000_000 + 7_000_000
    topics = np.repeat([0, 1], [5 * n, 2 * n])
    stamps = np.concatenate([speed_ns, position_ns])
    values = np.zeros((7 * n, 2))
    time_s = np.arange(5 * n) * 0.1
    speed = speed_m_s(time_s)
    values[: 5 * n, 0] = speed + rng.normal(0.0, 0.05, 5 * n)
    values[5 * n :, 0] = np.interp(np.arange(2 * n) * 0.25, time_s, np.cumsum(speed) * 0.1)
    values[5 * n :] += rng.normal(0.0, 10.0, (2 * n, 2))
    received = stamps + rng.integers(10**6, 10**7, 7 * n)
    kinds = (
        _Kind(Channel.SPEED_THROUGH_WATER, [0.0025, np.nan]),
        _Kind(Channel.POSITION, [100.0, 100.0]),
    )
    with BagWriter(path) as bag:
        bag.attach('ship.yaml', ship.read_text())
        for place in np.argsort(received, kind='stable').tolist():
            stamp_ns, log_ns = int(stamps[place]), int(received[place])
            kind = kinds[topics[place]]
            payload = kind.payload(stamp_ns, values[place].tolist())
            bag.write(kind.topic, kind.type, payload, log_ns=log_ns, publish_ns=stamp_ns)
    return path


def speed_m_s(time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """
    Return 8 m/s, but for 1200 s of coasting and 300 s of starting again now and then.
    """
    coasting_s = time_s % EVERY_S - (EVERY_S - 2000.0)
    glide = STEADY_M_S / (1.0 + np.clip(coasting_s, 0.0, 1200.0) / 400.0)
    again = np.clip((coasting_s - 1200.0) / 300.0, 0.0, 1.0)
    return glide + again * (STEADY_M_S - glide)


class _Kind:
    """Messages of a channel that differ in stamp and value alone: quicker than to encode."""

    def __init__(self, channel: Channel, variance: list[float]) -> None:
        (message,) = encode(Block.of(channel, [1], [[0.125, 0.25]], variance=[variance]))
        self.topic, self.type = message.topic, message.type
        self._payload = bytearray(message.payload)
        self._at = message.payload.index(np.float64(0.125).tobytes())
        self._values = 2 if channel is Channel.POSITION else 1

    def payload(self, stamp_ns: int, value: list[float]) -> bytes:
        struct.pack_into('<iI', self._payload, 4, *divmod(stamp_ns, 10**9))
        struct.pack_into(f'<{self._values}d', self._payload, self._at, *value[: self._values])
        return bytes(self._payload)


def ours(path: Path) -> int:
    (run,) = open_runs([path])
    return sum(len(item) for item in run.inputs() if isinstance(item, Block))


def limit(path: Path) -> int:
    """Decompress and check each chunk, and do nothing with it."""
    (run,) = open_runs([path])
    data = path.read_bytes()
    decompressor = zstandard.ZstdDecompressor()
    for segment in run.parts[0].contents.segments:
        size = int.from_bytes(data[segment.offset + 25 : segment.offset + 33], 'little')
        checksum = int.from_bytes(data[segment.offset + 33 : segment.offset + 37], 'little')
        packed = data[segment.offset + 9 + 40 + 4 : segment.end]
        assert zlib.crc32(decompressor.decompress(packed, max_output_size=size)) == checksum
    return sum(run.parts[0].contents.counts.values())


def stream_reader(path: Path) -> int:
    """Walk the records, without decoding the messages."""
    with path.open('rb') as file:
        return sum(isinstance(record, Message) for record in StreamReader(file).records)


def rosbags(path: Path) -> int:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    rows = []
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection, log_ns, payload in reader.messages():
            message = reader.deserialize(payload, connection.msgtype)
            rows.append(_row(connection.msgtype, log_ns, message))
    return len(np.array(rows))


def mcap_ros2(path: Path) -> int:
    from mcap_ros2.decoder import DecoderFactory

    return _decoded(path, DecoderFactory())


def mcap_ros2_fast(path: Path) -> int:
    from mcap_ros2_support_fast.decoder import DecoderFactory

    return _decoded(path, DecoderFactory())


def rclpy(path: Path) -> int:
    from geometry_msgs.msg import PoseWithCovarianceStamped, TwistWithCovarianceStamped
    from rclpy.serialization import deserialize_message

    kinds = {TWIST: TwistWithCovarianceStamped, POSE: PoseWithCovarianceStamped}
    rows = []
    with path.open('rb') as file:
        for schema, _, message in make_reader(file).iter_messages():
            found = deserialize_message(message.data, kinds[schema.name])
            rows.append(_row(schema.name, message.log_time, found))
    return len(np.array(rows))


def _decoded(path: Path, factory: object) -> int:
    rows = []
    with path.open('rb') as file:
        reader = make_reader(file, decoder_factories=[factory])
        for schema, _, message, found in reader.iter_decoded_messages():
            rows.append(_row(schema.name, message.log_time, found))
    return len(np.array(rows))


def _row(kind: str, log_ns: int, message: object) -> tuple[float, ...]:
    stamp = message.header.stamp  # type: ignore[attr-defined]
    if kind == TWIST:
        twist = message.twist  # type: ignore[attr-defined]
        value = (twist.twist.linear.x, 0.0, twist.covariance[0], 0.0)
    else:
        pose = message.pose  # type: ignore[attr-defined]
        at = pose.pose.position
        value = (at.x, at.y, pose.covariance[0], pose.covariance[7])
    return (log_ns, stamp.sec * 10**9 + stamp.nanosec, *value)


def seconds(read: Callable[[Path], int], path: Path) -> tuple[float, int]:
    begun = time.process_time()
    messages = read(path)
    return time.process_time() - begun, messages


def compare(messages: int, folder: Path) -> None:
    """
    Print messages a second of each reader, and how much faster this package is.
    """
    whole = write(folder / 'whole.mcap', messages)
    part = write(folder / 'part.mcap', min(messages, PEER_MESSAGES))
    ours(part)
    best: dict[Callable[[Path], int], float] = {}
    for _ in range(ROUNDS):
        for read, path in ((ours, whole), (limit, whole), *((peer, part) for peer in PEERS)):
            taken, found = seconds(read, path)
            assert found == (messages if path == whole else min(messages, PEER_MESSAGES))
            best[read] = max(best.get(read, 0.0), found / taken)
    mine = best[ours]
    print(f'{"reader":<36}{"messages/s":>12}{"ours is faster by":>20}')
    for read, rate in sorted(best.items(), key=lambda item: -item[1]):
        print(f'{NAMES[read]:<36}{rate:>12,.0f}{mine / rate:>20.2f}')
    print(f'{100 * mine / best[limit]:.0f} % of the limit')


def replayed(path: Path) -> int:
    """Find and estimate its coastdowns; return their number."""
    (run,) = open_runs([path])
    return len(replay(run).coastdowns)


def show_growth(messages: int, folder: Path) -> None:
    """
    Print time and memory for bags of several sizes, each in a process of its own.
    """
    rows = []
    for n in (messages // 28, messages // 7, messages):
        n -= n % 7
        path = write(folder / f'{n}.mcap', n)
        said = subprocess.run(
            [sys.executable, __file__, '--measure', str(path)],
            check=True,
            timeout=900,
            capture_output=True,
            text=True,
        ).stdout.split()
        read_s, read_mb, replay_s, replay_mb, coastdowns = map(float, said)
        rows.append((n, read_s, replay_s))
        print(
            f'{n:>9} messages, {path.stat().st_size / 1e6:4.0f} MB: read in '
            f'{1e9 * read_s / n:.0f} ns each, peak {read_mb:.0f} MB; replayed in '
            f'{1e9 * replay_s / n:.0f} ns each, {coastdowns:.0f} coastdowns, '
            f'peak {replay_mb:.0f} MB; replay at {100 * read_s / replay_s:.0f} % of reading',
            flush=True,
        )
        path.unlink()
    counts, reading, replaying = np.log(np.array(rows)).T
    for name, taken in (('reading', reading), ('replay', replaying)):
        print(f'{name}: log time over log messages {np.polyfit(counts, taken, 1)[0]:.3f}')


def measure(path: Path) -> None:
    """
    Print best time [s] and peak memory [MB] of reading and of replaying one bag.

    And how many coastdowns were found.
    """
    ours(path)  # loads compiled code
    print(min(seconds(ours, path)[0] for _ in range(3)), _peak_mb())
    taken = [seconds(replayed, path) for _ in range(2)]
    print(min(taken)[0], _peak_mb(), taken[0][1])


def _peak_mb() -> float:
    """Peak of this process; `getrusage` would give that of the one that started it."""
    return int(Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0]) / 1e3


PEERS = (stream_reader, rosbags, mcap_ros2_fast, mcap_ros2, rclpy)
NAMES = {
    ours: 'shipdrag_ros, into arrays',
    limit: 'decompression and checksum alone',
    stream_reader: 'mcap StreamReader, not decoded',
    rosbags: 'rosbags',
    mcap_ros2_fast: 'mcap-ros2-support-fast',
    mcap_ros2: 'mcap-ros2-support',
    rclpy: 'mcap make_reader and rclpy',
}


def main() -> None:
    """
    Print the table.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--messages', type=int, default=1_400_000)
    parser.add_argument('--growth', type=int, default=10_000_000, help='messages at most')
    parser.add_argument('--measure', type=Path, help='a bag of which to print time and memory')
    options = parser.parse_args()
    if options.measure is not None:
        measure(options.measure)
        return
    messages = options.messages - options.messages % 7
    print(
        f'{messages} messages, peers {min(messages, PEER_MESSAGES)}, seed {SEED}, best of {ROUNDS}'
    )
    with tempfile.TemporaryDirectory() as folder:
        compare(messages, Path(folder))
        show_growth(options.growth, Path(folder))


if __name__ == '__main__':
    main()
