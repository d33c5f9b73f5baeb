# SPDX-License-Identifier: Apache-2.0
"""
Coastdowns an hour and a core of `shipdrag fleet`, on one and on two workers.

    python benchmarks/fleet_throughput.py [--coastdowns 40] [--workers 1 2]

Simulates small bags (30 minutes at 1 Hz, four inputs), brings an empty store up to
date with each number of workers, and again, when nothing is to be done. The workers
run first and have compiled what they need; starting them is told apart. Where other
programs use the machine, the figures by the time of the processors are those to read.
"""

from __future__ import annotations

import argparse
import os
import shutil
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from shipdrag_ros.cli import main as shipdrag
from shipdrag_ros.fleet.engine import Engine
from shipdrag_ros.fleet.find import find
from shipdrag_ros.fleet.store import Store
from shipdrag_ros.fleet.update import Report, update


def silent(text: str, done: int, total: int) -> None:
    """Take progress and say nothing."""


def bring_up_to_date(folder: Path, store: Path, engine: Engine) -> tuple[float, Report]:
    """Return how long it takes [s], and what became of the bags."""
    begun_s = time.monotonic()
    report = update(find([str(folder)]), Store(store), engine, silent)
    return time.monotonic() - begun_s, report


def main() -> None:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--coastdowns', type=int, default=40, metavar='N')
    parser.add_argument('--workers', type=int, nargs='+', default=[1, 2], metavar='N')
    options = parser.parse_args()
    with TemporaryDirectory() as made:
        folder = Path(made) / 'fleet'
        line = ['simulate-fleet', '-o', str(folder), '--ships', '1', '--every', '1', '--sound']
        shipdrag([*line, '--months', f'{options.coastdowns / 30.0}'])
        print(f'{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} when it began')
        print('workers  start [s]  work [s]  coastdowns  an hour  and worker  by CPU  again [s]')
        for workers in options.workers:
            warm, store = Path(made) / 'warm', Path(made) / f'store {workers}'
            begun_s = time.monotonic()
            with Engine(workers=workers) as engine:
                start_s = time.monotonic() - begun_s
                first = sorted((folder / 'alder').glob('*.mcap'))[: 2 * workers]
                update(find([str(path) for path in first]), Store(warm), engine, silent)
                shutil.rmtree(warm)
                before_s = sum(engine.on_each(time.process_time).values())
                work_s, report = bring_up_to_date(folder, store, engine)
                cpu_s = sum(engine.on_each(time.process_time).values()) - before_s
                again_s, _ = bring_up_to_date(folder, store, engine)
            many = sum(done.coastdowns for done in report.bags.values())
            hourly = 3600.0 * many / work_s
            print(
                f'{workers:7d}  {start_s:9.1f}  {work_s:8.1f}  {many:10d}  {hourly:7.0f}  '
                f'{hourly / workers:10.0f}  {3600.0 * many / cpu_s:6.0f}  {again_s:9.1f}'
            )


if __name__ == '__main__':
    main()
