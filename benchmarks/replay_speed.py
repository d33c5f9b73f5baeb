# SPDX-License-Identifier: Apache-2.0
"""
How fast bags are written, read and replayed, and in how much memory.

Four inputs at 1 Hz, one simulated coastdown after the other; the memory is
that of a process of its own for each length.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from importlib.resources import files
from pathlib import Path

from shipdrag_ros.bags import BagWriter, Compression, open_runs, replay
from shipdrag_ros.samples import Block
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, sense, simulate, standard_sensors

SEED = 1
LEAD_IN_S = 3600.0
DURATION_S = 1500.0
VOYAGE_NS = round((LEAD_IN_S + DURATION_S + 60.0) * 1e9)


def main() -> None:
    """
    Print a table; with a bag given, replay that one and print its line alone.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('bag', nargs='?', type=Path)
    bag: Path | None = parser.parse_args().bag
    if bag is not None:
        _measure(bag)
        return
    ship = Ship.load(Path(str(files('shipdrag_ros') / 'data' / 'vitus_bering.yaml')))
    truth = simulate(
        ship, Scenario(speed_m_s=7.9, lead_in_s=LEAD_IN_S, duration_s=DURATION_S, seed=SEED)
    )
    block = sense(truth, standard_sensors(rate_hz=1.0, noise=1.0), seed=SEED)
    print(f'bags of {len(block)} messages a coastdown, seed {SEED}')
    with tempfile.TemporaryDirectory() as folder:
        for compression, coastdowns in (
            (Compression.NONE, 2),
            (Compression.LZ4, 2),
            (Compression.ZSTD, 2),
            (Compression.ZSTD, 20),
        ):
            path = Path(folder) / f'{compression.value}_{coastdowns}.mcap'
            written = _write(path, ship, block, coastdowns, compression)
            size = path.stat().st_size / 1e6
            print(
                f'{coastdowns:3d} coastdowns, {compression.value:4s}: {size:6.1f} MB, '
                f'written at {written:7.0f} messages/s; ',
                end='',
                flush=True,
            )
            subprocess.run([sys.executable, __file__, str(path)], check=True, timeout=280)


def _write(
    path: Path, ship: Ship, block: Block, coastdowns: int, compression: Compression
) -> float:
    begun = time.perf_counter()
    with BagWriter(path, compression=compression) as bag:
        bag.attach('ship.yaml', ship.to_yaml())
        for number in range(coastdowns):
            later = number * VOYAGE_NS
            bag.write_samples(
                Block(
                    block.channel,
                    block.stamp_ns + later,
                    block.receive_ns + later,
                    block.value,
                    block.variance,
                )
            )
    return coastdowns * len(block) / (time.perf_counter() - begun)


def _measure(path: Path) -> None:
    (run,) = open_runs([path])
    begun = time.perf_counter()
    samples = sum(len(item) for item in run.inputs() if isinstance(item, Block))
    read_s = time.perf_counter() - begun
    begun = time.perf_counter()
    result = replay(run)
    replay_s = time.perf_counter() - begun
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(
        f'read at {samples / read_s:6.0f}, replayed at {samples / replay_s:6.0f} messages/s, '
        f'{len(result.coastdowns)} found, {memory:.0f} MB'
    )


if __name__ == '__main__':
    main()
