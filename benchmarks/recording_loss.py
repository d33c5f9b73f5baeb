# SPDX-License-Identifier: Apache-2.0
"""
What a recording loses when the process is killed or the power goes, and what safety costs.

Three inputs at 10 Hz each. The recorder of the node runs in a forked process that is
killed (SIGKILL) at random instants, in half of the runs with a new part every 0.7 s, so
that also the making of parts and their compaction is hit; a loss of power is the same
instant with the file cut where it was last brought to the disk. Then the node itself,
fed over DDS on loopback; then files cut inside records of every kind. Seed 1.

`--quick`: fewer runs, and the node is left out.
"""

from __future__ import annotations

import argparse
import mmap
import os
import random
import signal
import statistics
import struct
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from shipdrag_ros.bags import open_runs
from shipdrag_ros.bags.durable import SYNC_S, PartLimits
from shipdrag_ros.bags.live import LiveFile
from shipdrag_ros.bags.records import MAGIC, walk
from shipdrag_ros.bags.recover import compact
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import EncodedMessage, encode
from shipdrag_ros.node.recorder import RawMessage, Recorder
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship

SEED = 1
RATE_HZ = 10.0
AT_ONCE = 6  # processes, each nearly idle
SHIP_FILE = Path(__file__).parents[1] / 'config' / 'vitus_bering.yaml'
CHANNELS = (Channel.SPEED_THROUGH_WATER, Channel.POSITION, Channel.SHAFT)
START_NS = 1_700_000_000 * 10**9
PARTS = (PartLimits(), PartLimits(duration_s=0.7))
# last message handed over [ns], bytes on the disk of the file that grows, its name
_STATE = struct.Struct('<qq200p')


def record(seconds: float) -> Block:
    """Return readings of three inputs, in order of arrival."""
    rng = np.random.default_rng(SEED)
    stamps = START_NS + np.arange(int(seconds * RATE_HZ)) * round(1e9 / RATE_HZ)
    blocks = []
    for channel in CHANNELS:
        shape = (len(stamps), 2) if channel is Channel.POSITION else len(stamps)
        value = rng.normal(5.0, 0.05, shape)
        arrival = stamps + rng.integers(10**6, 10**7, len(stamps))
        blocks.append(Block.of(channel, stamps, value, receive_ns=np.sort(arrival)))
    return in_arrival_order(blocks)


@dataclass
class Victim:
    """A process that records until it is killed."""

    folder: Path
    state: mmap.mmap
    pid: int

    @classmethod
    def start(cls, folder: Path, limits: PartLimits, messages: Sequence[EncodedMessage]) -> Victim:
        folder.mkdir()
        state = mmap.mmap(-1, _STATE.size)
        pid = os.fork()
        if pid == 0:
            try:
                _feed(folder, limits, messages, state)
            finally:
                os._exit(1)
        return cls(folder, state, pid)

    def kill(self) -> tuple[float, float]:
        """Return the seconds lost by the kill, and by the cut of power at that instant."""
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)
        last_ns, synced, name = _STATE.unpack(self.state[:])
        killed_s = (last_ns - self._last_ns()) * 1e-9
        growing = self.folder / name.decode()
        # a part that was finished meanwhile is on the disk as a whole
        if not growing.read_bytes().endswith(MAGIC):
            os.truncate(growing, synced)
        return killed_s, (last_ns - self._last_ns()) * 1e-9

    def _last_ns(self) -> int:
        paths = sorted(self.folder.glob('*.mcap'))
        (run,) = open_runs(paths)
        whole = [number for path in paths for number in _whole(path.read_bytes())]
        assert sum(topic.messages for topic in run.topics) == len(whole)
        assert run.span_ns is not None
        return run.span_ns[1]


def _feed(
    folder: Path, limits: PartLimits, messages: Sequence[EncodedMessage], state: mmap.mmap
) -> None:
    recorder = Recorder(
        folder,
        namespace='',
        ship=Ship.load(SHIP_FILE),
        parameters=Parameters(),
        history_ns=10**9,
        limits=limits,
    )
    recorder.start()
    begun_ns = time.monotonic_ns() - START_NS
    for message in messages:
        time.sleep(max(message.log_ns + begun_ns - time.monotonic_ns(), 0) * 1e-9)
        now_ns = time.monotonic_ns() - begun_ns
        name = message.topic.strip('/')
        recorder.input(RawMessage(name, message.type, message.payload, now_ns, now_ns))
        progress = recorder.status().progress
        assert progress is not None
        growing = '' if progress.path is None else progress.path.name
        state[:] = _STATE.pack(now_ns, progress.size_bytes, growing.encode())


def _whole(data: bytes) -> list[int]:
    """Return the log times that a plain reader finds in whole chunks."""
    found = []
    with TemporaryDirectory() as folder:
        path = Path(folder) / 'a'
        path.write_bytes(data)
        with path.open('rb') as stream:
            try:
                for item in StreamReader(stream, validate_crcs=True).records:
                    if isinstance(item, Message):
                        found.append(item.log_time)
            except (EndOfFile, struct.error):
                pass
    return found


def kill_recorders(runs: int, folder: Path) -> None:
    """Print the seconds lost."""
    messages = list(encode(record(20.0)))
    rng = random.Random(SEED)
    lost: list[tuple[float, float]] = []
    for first in range(0, runs, AT_ONCE):
        numbers = range(first, min(first + AT_ONCE, runs))
        victims = [Victim.start(folder / f'{n}', PARTS[n % 2], messages) for n in numbers]
        due = [(time.monotonic() + rng.uniform(1.0, 4.0), victim) for victim in victims]
        for due_s, victim in sorted(due, key=lambda item: item[0]):
            time.sleep(max(due_s - time.monotonic(), 0.0))
            lost.append(victim.kill())
    print(f'recorder killed, {len(lost)} times: input lost [s]')
    _show('  killed', [killed for killed, _ in lost])
    _show('  power cut', [power for _, power in lost])


def _show(name: str, seconds: Sequence[float]) -> None:
    print(
        f'{name:12s} median {statistics.median(seconds):.2f}, worst {max(seconds):.2f}, '
        f'above 1 s: {sum(each > 1.0 for each in seconds)}; every whole message is read'
    )


def kill_nodes(runs: int, folder: Path) -> None:
    """Print the seconds lost by the node itself."""
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    block = record(20.0)
    rng = random.Random(SEED)
    lost = [_kill_node(folder / f'node{n}', block, rng.uniform(1.0, 4.0), n) for n in range(runs)]
    _show('node', lost)


def _kill_node(folder: Path, block: Block, after_s: float, number: int) -> float:
    import rclpy
    from rclpy.executors import SingleThreadedExecutor

    from shipdrag_ros.node.rehearsal import Player

    domain = 1 + number % 9  # the tests and the demonstration are above
    given = ('-p', f'ship_file:={SHIP_FILE}', '-p', f'output_directory:={folder}')
    command = [sys.executable, '-m', 'shipdrag_ros.node.main', '--ros-args', *given]
    environment = os.environ | {'ROS_DOMAIN_ID': str(domain)}
    node = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    peer = rclpy.create_node('peer', context=context)
    try:
        player = Player(peer, executor := SingleThreadedExecutor(context=context))
        player.connect(block, timeout_s=90.0)
        end_s = time.monotonic() + after_s
        begun_ns = time.monotonic_ns() - START_NS
        place = 0
        while time.monotonic() < end_s:
            if block.receive_ns[place] + begun_ns <= time.monotonic_ns():
                last_ns = time.time_ns()
                player.publish(block[place : place + 1])
                place += 1
            executor.spin_once(timeout_sec=0.001)
    finally:
        node.kill()
        node.wait()
        executor.shutdown()
        peer.destroy_node()
        rclpy.try_shutdown(context=context)
    (run,) = open_runs(sorted(folder.glob('*.mcap')))
    assert run.span_ns is not None
    return (last_ns - run.span_ns[1]) * 1e-9


def cut_records(folder: Path) -> None:
    """Print what is left of files that are cut inside records of every kind."""
    folder.mkdir()
    path = folder / 'a.mcap'
    messages = list(encode(record(30.0)))
    _grow(path, messages)
    _cut('as it grows', path)
    compact(path, messages=len(messages))
    _cut('compacted', path)


def _cut(name: str, path: Path) -> None:
    data = path.read_bytes()
    kinds: set[str] = set()
    cuts: set[int] = set()
    for place in walk(data, len(MAGIC), len(data) - len(MAGIC)):
        kinds.add(Opcode(place.opcode).name.lower())
        cuts |= {place.offset, (place.offset + place.end) // 2, place.end - 1}
    whole = salvaged = 0
    cut_path = path.with_name('cut.mcap')
    for cut in cuts:
        cut_path.write_bytes(data[:cut])
        whole += len(_whole(data[:cut]))
        try:
            (run,) = open_runs([cut_path])
        except BagError:  # nothing is left: then it was not whole either
            continue
        salvaged += sum(topic.messages for topic in run.topics)
    print(
        f'{name}, {len(cuts)} cuts before, in and at the end of each record '
        f'({", ".join(sorted(kinds))}): {salvaged} of {whole} messages that were whole are read'
    )


def _grow(path: Path, messages: Sequence[EncodedMessage], *, at_once: int = 3) -> None:
    file = LiveFile(path, recording_id='r', part=0, attachments={'ship.yaml': 'name: x\n'})
    for first in range(0, len(messages), at_once):
        file.append(messages[first : first + at_once])
    file.close()


def cost(folder: Path) -> None:
    """Print what it takes to bring half a second of input to the disk, and to hand it over."""
    folder.mkdir()
    messages = list(encode(record(100.0)))
    at_once = round(len(CHANNELS) * RATE_HZ * SYNC_S)
    file = LiveFile(folder / 'a.mcap', recording_id='r', part=0, attachments={})
    written_s, synced_s, waited_s = 0.0, 0.0, []
    for first in range(0, len(messages) - at_once, at_once):
        begun = time.process_time()
        file.append(messages[first : first + at_once])
        written = time.process_time()
        before = time.perf_counter()
        file.sync()
        waited_s.append(time.perf_counter() - before)
        written_s += written - begun
        synced_s += time.process_time() - written
    file.close()
    times = len(waited_s)
    print(
        f'every {SYNC_S} s at {len(CHANNELS) * RATE_HZ:.0f} messages/s, mean of {times}: chunk '
        f'{1e3 * written_s / times:.2f} ms, fsync {1e3 * synced_s / times:.2f} ms of processor, '
        f'{100 * (written_s + synced_s) / times / SYNC_S:.2f} % of a core; waiting for the disk '
        f'{1e3 * statistics.median(waited_s):.1f} ms, worst {1e3 * max(waited_s):.0f} ms'
    )


def sizes(folder: Path, seconds: float) -> None:
    """Print size and reading time of a part before and after compaction, and of mcap's writer."""
    folder.mkdir()
    messages = list(encode(record(seconds)))
    growing, default = folder / 'a.mcap', folder / 'default.mcap'
    _grow(growing, messages)
    _write_default(default, messages)
    _size('as it grows', growing, messages)
    begun = time.process_time()
    compact(growing, messages=len(messages))
    took_s = time.process_time() - begun
    _size('compacted', growing, messages)
    _size('default writer', default, messages)
    print(f'compaction: {len(messages) / took_s / 1e3:.0f} thousand messages a second')


def _write_default(path: Path, messages: Iterable[EncodedMessage]) -> None:
    """Write with the defaults of the mcap library, definitions left out."""
    with path.open('wb') as stream:
        writer = Writer(stream)
        writer.start('ros2')
        channels: dict[str, int] = {}
        for message in messages:
            if message.topic not in channels:
                schema = writer.register_schema(message.type, 'ros2msg', b'')
                channels[message.topic] = writer.register_channel(message.topic, 'cdr', schema)
            writer.add_message(
                channels[message.topic], message.log_ns, message.payload, message.publish_ns
            )
        writer.finish()


def _size(name: str, path: Path, messages: Sequence[EncodedMessage]) -> None:
    took_s = []
    for _ in range(3):
        begun = time.process_time()
        (run,) = open_runs([path])
        samples = sum(len(item) for item in run.inputs() if isinstance(item, Block))
        took_s.append(time.process_time() - begun)
        assert samples == len(messages)
    print(
        f'{name:15s} {path.stat().st_size / len(messages):6.1f} bytes a message, '
        f'opened and read at {len(messages) / min(took_s) / 1e3:.0f} thousand messages a second'
    )


def main() -> None:
    """
    Print the figures.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--quick', action='store_true')
    quick = parser.parse_args().quick
    with TemporaryDirectory(dir=Path.cwd()) as name:
        folder = Path(name)
        kill_recorders(12 if quick else 120, folder)
        cut_records(folder / 'cut')
        cost(folder / 'cost')
        sizes(folder / 'sizes', 300.0 if quick else 6000.0)
        if not quick:
            kill_nodes(10, folder)


if __name__ == '__main__':
    main()
