# SPDX-License-Identifier: Apache-2.0
"""
How fast bags are written, read and replayed, and in how much memory.

Four inputs at 1 Hz, one simulated coastdown after the other, after an hour or two
days of steady sailing; an estimate every ten seconds of each coastdown, and its
final figure. Reading and replay: processor time, best of three, and peak memory
of a process of its own for each bag.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from benchmarks._asked import asked
from shipdrag_ros.bags import BagWriter, Compression, open_runs
from shipdrag_ros.replay import replay
from shipdrag_ros.samples import Block
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, sense, simulate, standard_sensors

SEED = 1
HOUR_S = 3600.0
DURATION_S = 1500.0
ROUNDS = 3


def main() -> None:
    """
    Print a table; with a bag given, replay that one and print its line alone.
    """
    bag = asked(__doc__, bag=Path).bag
    if bag is not None:
        _measure(bag)
        return
    ship = Ship.example()
    print(f'seed {SEED}, best of {ROUNDS}')
    with tempfile.TemporaryDirectory() as folder:
        for compression, coastdowns, lead_in_s in (
            (Compression.NONE, 2, HOUR_S),
            (Compression.LZ4, 2, HOUR_S),
            (Compression.ZSTD, 2, HOUR_S),
            (Compression.ZSTD, 20, HOUR_S),
            (Compression.ZSTD, 1, 48 * HOUR_S),
            (Compression.ZSTD, 15, 48 * HOUR_S),
        ):
            truth = simulate(
                ship,
                Scenario(speed_m_s=7.9, lead_in_s=lead_in_s, duration_s=DURATION_S, seed=SEED),
            )
            block = sense(truth, standard_sensors(rate_hz=1.0, noise=1.0), seed=SEED)
            path = Path(folder) / f'{compression.name}_{coastdowns}.mcap'
            written = _write(path, ship, block, coastdowns, compression)
            size = path.stat().st_size / 1e6
            print(
                f'{coastdowns:3d} coastdowns after {lead_in_s / HOUR_S:2.0f} h, '
                f'{coastdowns * len(block)} messages, {compression.name:4s}: {size:6.1f} MB, '
                f'written at {written:7.0f} messages/s; ',
                end='',
                flush=True,
            )
            subprocess.run(
                [sys.executable, '-m', 'benchmarks.speed.replay_speed', '--bag', str(path)],
                check=True,
                timeout=280,
            )


def _write(
    path: Path, ship: Ship, block: Block, coastdowns: int, compression: Compression
) -> float:
    voyage_ns = round(block.stamp_ns[-1] - block.stamp_ns[0] + 60e9)
    begun = time.process_time()
    with BagWriter(path, compression=compression) as bag:
        bag.attach('ship.yaml', ship.to_yaml())
        for number in range(coastdowns):
            stamps, arrivals = (
                each + number * voyage_ns for each in (block.stamp_ns, block.receive_ns)
            )
            bag.write_samples(replace(block, stamp_ns=stamps, receive_ns=arrivals))
    return coastdowns * len(block) / (time.process_time() - begun)


def _measure(path: Path) -> None:
    read_s, replay_s = [], []
    for _ in range(ROUNDS):
        begun = time.process_time()
        (run,) = open_runs([path])
        samples = sum(len(item) for item in run.inputs() if isinstance(item, Block))
        read_s.append(time.process_time() - begun)
        begun = time.process_time()
        (run,) = open_runs([path])
        result = replay(run)
        replay_s.append(time.process_time() - begun)
    # ru_maxrss would be that of the process that started this one, if it was larger
    status = Path('/proc/self/status').read_text()
    memory = int(status.partition('VmHWM:')[2].split()[0]) / 1e3
    read, replayed = samples / min(read_s), samples / min(replay_s)
    print(
        f'read at {read:7.0f}, replayed at {replayed:7.0f} messages/s, {replayed / read:.2f} of '
        f'that; {len(result.coastdowns)} found, {memory:.0f} MB'
    )


if __name__ == '__main__':
    main()
