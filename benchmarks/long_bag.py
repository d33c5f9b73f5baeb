# SPDX-License-Identifier: Apache-2.0
"""
One long bag: how fast it is replayed, beside what its bytes cost alone.

3 million TwistWithCovarianceStamped at 10 Hz in one topic, zstd, 1 MiB chunks, written by
mcap's own writer: a ship that sails steadily and coasts down once. Two questions.

End to end, process start included: `shipdrag replay` against a process in which mcap's
StreamReader lists the raw messages and does nothing with them. In one long-lived worker: a
replay of the same bag without a coastdown against decompression and checksum of its chunks.
The two of each question run in turn; the ratio is that of the best of each, by the time of
the processors and by the clock. Bytecode and compiled code are kept, as on every machine
that has started the program before.

    python benchmarks/long_bag.py [--messages 3000000] [--rounds 3]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.writer import CompressionType, Writer
from read_speed import limit as bytes_alone

from shipdrag_ros.bags import open_runs
from shipdrag_ros.messages import encode, types
from shipdrag_ros.replay import replay
from shipdrag_ros.samples import Block, Channel

SEED = 1
RATE_HZ = 10.0
STEADY_M_S = 8.0
COASTING_S, AGAIN_S = 1200.0, 300.0
START_NS = 1_700_000_000_000_000_000
CHUNK_BYTES = 1 << 20
LIST_RAW = """
import sys
from mcap.records import Message
from mcap.stream_reader import StreamReader
with open(sys.argv[1], 'rb') as file:
    print(sum(isinstance(record, Message) for record in StreamReader(file).records))
"""


class Cost(NamedTuple):
    """Time of the processors and by the clock [s]."""

    cpu_s: float
    clock_s: float


def speed_m_s(time_s: np.ndarray, coasts: bool) -> np.ndarray:
    """Return 8 m/s, and one coastdown in the middle."""
    since_s = time_s - 0.5 * time_s[-1]
    glide = STEADY_M_S / (1.0 + np.clip(since_s, 0.0, COASTING_S) / 400.0)
    again = np.clip((since_s - COASTING_S) / AGAIN_S, 0.0, 1.0)
    return glide + again * (STEADY_M_S - glide) if coasts else np.full(len(time_s), STEADY_M_S)


def write(path: Path, messages: int, *, coasts: bool) -> Path:
    """Write the bag."""
    rng = np.random.default_rng(SEED)
    channel = Channel.SPEED_THROUGH_WATER
    (sent,) = encode(Block.of(channel, [1], [[0.125, 0.0]], variance=[[0.0025, np.nan]]))
    assert sent.type == types.TWIST_WITH_COVARIANCE
    payload = bytearray(sent.payload)
    at = payload.index(np.float64(0.125).tobytes())
    time_s = np.arange(messages) / RATE_HZ
    speed = speed_m_s(time_s, coasts) + rng.normal(0.0, 0.05, messages)
    stamps = START_NS + np.round(time_s * 1e9).astype(np.int64)
    received = stamps + rng.integers(10**6, 10**7, messages)
    ship = files('shipdrag_ros') / 'data' / 'vitus_bering.yaml'
    with path.open('wb') as file:
        bag = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        bag.start(profile='ros2')
        schema = bag.register_schema(sent.type, 'ros2msg', types.definition(sent.type).encode())
        topic = bag.register_channel('/speed_through_water', 'cdr', schema)
        for number, (stamp, log) in enumerate(zip(stamps.tolist(), received.tolist())):
            second, rest = divmod(stamp, 10**9)
            payload[4:8] = second.to_bytes(4, 'little')
            payload[8:12] = rest.to_bytes(4, 'little')
            payload[at : at + 8] = speed[number].tobytes()
            bag.add_message(topic, log, bytes(payload), stamp, number)
        bag.add_attachment(START_NS, START_NS, 'ship.yaml', 'text/plain', ship.read_bytes())
        bag.finish()
    return path


def of_process(line: list[str], kept: Path) -> Cost:
    """Run a program; return what it and what it started cost. Its bytecode is kept in a folder."""
    environment = {**os.environ, 'PYTHONPYCACHEPREFIX': str(kept)}
    environment.pop('PYTHONDONTWRITEBYTECODE', None)
    begun, before = time.monotonic(), os.times()
    quiet = subprocess.DEVNULL
    subprocess.run(line, check=True, stdout=quiet, stderr=quiet, env=environment)
    after = os.times()
    cpu_s = after.children_user - before.children_user
    cpu_s += after.children_system - before.children_system
    return Cost(cpu_s, time.monotonic() - begun)


def of_call(call: Callable[[], object]) -> Cost:
    """Call something; return what it cost."""
    begun, before = time.monotonic(), time.process_time()
    call()
    return Cost(time.process_time() - before, time.monotonic() - begun)


def replayed(path: Path, coastdowns: int) -> None:
    """Replay as a worker does."""
    (run,) = open_runs([path])
    assert len(replay(run).coastdowns) == coastdowns


def show(what: str, ours: list[Cost], theirs: list[Cost], aim: float, messages: int) -> None:
    """Print the best of each and their ratio."""
    cpu = min(each.cpu_s for each in ours), min(each.cpu_s for each in theirs)
    clock = min(each.clock_s for each in ours), min(each.clock_s for each in theirs)
    print(
        f'{what}: {cpu[0]:.2f} s of CPU beside {cpu[1]:.2f} s '
        f'({1e9 * cpu[0] / messages:.0f} and {1e9 * cpu[1] / messages:.0f} ns a message): '
        f'{cpu[1] / cpu[0]:.2f} times as fast; by the clock {clock[1] / clock[0]:.2f} '
        f'({clock[0]:.2f} s, {clock[1]:.2f} s); aim {aim:g}',
        flush=True,
    )


def main() -> None:
    """Print both ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--messages', type=int, default=3_000_000, metavar='N')
    parser.add_argument('--rounds', type=int, default=3, metavar='N')
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        bag = write(Path(made) / 'one.mcap', options.messages, coasts=True)
        size = bag.stat().st_size / 1e6
        print(f'{options.messages} messages, {size:.0f} MB, best of {options.rounds}', flush=True)
        ours_line = [sys.executable, '-m', 'shipdrag_ros.cli', 'replay', str(bag), '--json']
        ours, theirs, bytecode = [], [], Path(made) / 'bytecode'
        for _ in range(options.rounds + 1):  # the first one makes the bytecode
            ours.append(of_process(ours_line, bytecode))
            theirs.append(of_process([sys.executable, '-c', LIST_RAW, str(bag)], bytecode))
        show('end to end, beside StreamReader', ours, theirs, 5.0, options.messages)
        bag = write(Path(made) / 'none.mcap', options.messages, coasts=False)
        ours, theirs = [], []
        replayed(bag, 0)  # loads compiled code
        for _ in range(options.rounds):
            ours.append(of_call(lambda: replayed(bag, 0)))
            theirs.append(of_call(lambda: bytes_alone(bag)))
        show('in a worker, beside its bytes', ours, theirs, 0.75, options.messages)


if __name__ == '__main__':
    main()
