# SPDX-License-Identifier: Apache-2.0
"""
Coastdowns an hour and a core of `shipdrag fleet`, on one and on two workers.

    python -m benchmarks.speed.fleet_throughput [--kept DIR] [--coastdowns 1000] [--workers 2 1]

A few different bags are simulated (30 minutes at 1 Hz, four inputs, 7204 messages) and linked
under many names. Each link has a run file of its own, so that each has another content hash and
is replayed and diagnosed for itself. An empty store is brought up to date with each number of
workers. What is done stays in the folder `--kept`: stopped and started again, the script goes on
and adds up what its parts took. Starting and warming the workers is not counted.

It prints messages and coastdowns an hour and a core, the efficiency from one worker to two, the
memory of the largest worker and of this process against the number of bags, and what more cores
would give on paper. There a bag costs its worker what it costs here, and this process, scheduler
and writer of the store, what cannot be shared. Where other programs use the machine, the figures
by the time of the processors are those to read.
"""

from __future__ import annotations

import json
import os
import shutil
import time
from pathlib import Path
from typing import Any

from benchmarks import ROOT
from benchmarks._asked import asked
from shipdrag_ros.cli import main as shipdrag
from shipdrag_ros.fleet.find import RUN_FILE, SHIP_FILE, find
from shipdrag_ros.fleet.store import Store
from shipdrag_ros.fleet.update import Engine, update

OUT = ROOT / 'benchmarks' / 'out' / 'fleet_throughput'
DISTINCT = 20
CORES = 1, 2, 16, 370
SAMPLES = 4  # of memory, over all bags
EVERY = 10  # bags: so many are not counted where the script is killed


class Enough(Exception):
    """The time is over; what is done is kept."""


def make_bags(kept: Path, coastdowns: int) -> Path:
    """Simulate a few bags, link them until there are enough, and return the folder."""
    first, folder = kept / 'first', kept / f'fleet of {coastdowns}'
    if not (first / 'truth.yaml').exists():
        shutil.rmtree(first, ignore_errors=True)
        line = ['simulate-fleet', '-o', str(first), '--ships', '1', '--every', '1', '--sound']
        shipdrag([*line, '--months', f'{DISTINCT / 30.0}'])
    sources = sorted(first.glob('*/*.mcap'))
    folder.mkdir(exist_ok=True)
    shutil.copy(sources[0].with_name(SHIP_FILE), folder)
    for number in range(coastdowns):
        source, name = sources[number % len(sources)], f'{number:05d}.mcap'
        run = source.with_name(f'{source.name}.{RUN_FILE}').read_text()
        (folder / f'{name}.{RUN_FILE}').write_text(f'{run}# copy {number}\n')
        if not (folder / name).exists():
            os.link(source, folder / name)
    return folder


def memory_mb() -> float:
    """Return the memory of this process that is in use [MB]."""
    status = Path('/proc/self/status').read_text()
    return int(status.partition('VmRSS:')[2].split()[0]) / 1e3


class Measured:
    """What bringing a store up to date took, over all parts of the work; kept in a file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.found: dict[str, Any] = {'clock_s': 0.0, 'workers_s': 0.0, 'alone_s': 0.0}
        self.found |= {'bags': 0, 'memory': [], 'stops': 0}
        if path.exists():
            self.found = json.loads(path.read_text())
            self.found['stops'] += 1

    def run(self, folder: Path, store: Path, workers: int, minutes: float) -> None:
        """Bring the store up to date, or as far as the time goes."""
        with Engine(workers=workers) as engine:
            warm = [str(path) for path in sorted(folder.glob('*.mcap'))[: 2 * workers]]
            trial = store.with_name('trial')
            shutil.rmtree(trial, ignore_errors=True)
            update(find(warm), Store(trial), engine, lambda text, done, total: None)
            before = dict(self.found)
            begun, alone = time.monotonic(), time.process_time()
            busy = sum(engine.on_each(time.process_time).values())

            def note(text: str, done: int, total: int) -> None:
                now = time.monotonic() - begun
                bags = before['bags'] + (done if text.startswith('replaying') else 0)
                over = now > 60.0 * minutes
                if not (over or done == total or done % EVERY == 0):
                    return
                spent = sum(engine.on_each(time.process_time).values()) - busy
                self.found['bags'] = bags
                self.found['clock_s'] = before['clock_s'] + now
                self.found['workers_s'] = before['workers_s'] + spent
                self.found['alone_s'] = before['alone_s'] + time.process_time() - alone
                if text.startswith('replaying'):
                    largest = max(engine.on_each(memory_mb).values())
                    self.found['memory'].append([bags, largest, memory_mb()])
                self._path.write_text(json.dumps(self.found))
                if over:
                    raise Enough

            try:
                update(find([str(folder)]), Store(store), engine, note)
            except Enough:
                print(f'{minutes:g} minutes are over; start it again to go on')


def totals(store: Path) -> tuple[int, int, int]:
    """Return bags, coastdowns and messages of a store."""
    from shipdrag_ros.fleet.store import read_bags

    rows = read_bags(store).to_pylist()
    return len(rows), sum(row['coastdowns'] for row in rows), sum(row['messages'] for row in rows)


def show(workers: int, measured: dict[str, Any], store: Path) -> tuple[float, float, float]:
    """Print what was measured; return coastdowns an hour, and each bag's cost [s]."""
    bags, coastdowns, messages = totals(store)
    hours = measured['clock_s'] / 3600.0
    each_s, alone_s = measured['workers_s'] / bags, measured['alone_s'] / bags
    hourly = coastdowns / hours
    print(
        f'{workers} worker(s): {bags} bags, {coastdowns} coastdowns, {messages} messages in '
        f'{measured["clock_s"]:.0f} s, stopped {measured["stops"]} time(s): {hourly:.0f} '
        f'coastdowns and {messages / hours:.3g} messages an hour, {hourly / workers:.0f} and '
        f'{messages / hours / workers:.3g} an hour and a core; by the time of the processors '
        f'{3600.0 / each_s:.0f} coastdowns an hour and a core; a bag takes a worker '
        f'{each_s:.2f} s and this process {1e3 * alone_s:.0f} ms'
    )
    found = measured['memory']
    picked = found[:: max(len(found) // SAMPLES, 1)]
    figures = ', '.join(f'{bags}: {worker:.0f} and {own:.0f}' for bags, worker, own in picked)
    print(
        f'  memory after so many bags, largest worker and this process [MB]: {figures}', flush=True
    )
    return hourly, each_s, alone_s


def on_paper(each_s: float, alone_s: float) -> None:
    """Print what more cores would give."""
    for cores in CORES:
        shared, limit = cores * 3600.0 / each_s, 3600.0 / alone_s
        what = 'its workers' if shared < limit else 'the one process that writes'
        print(
            f'on paper, {cores} cores: {min(shared, limit):.0f} bags an hour, limited by {what}; '
            f'10 000 bags in {1e4 / min(shared, limit):.2f} h'
        )


def main() -> None:
    """Measure and print."""
    options = asked(__doc__, kept=OUT, coastdowns=1000, workers=[2, 1], minutes=30.0)
    options.kept.mkdir(parents=True, exist_ok=True)
    folder = make_bags(options.kept, options.coastdowns)
    print(
        f'{options.coastdowns} bags, {DISTINCT} of them different; {os.cpu_count()} cores, load '
        f'{os.getloadavg()[0]:.1f} when it began',
        flush=True,
    )
    hourly: dict[int, float] = {}
    for workers in options.workers:
        name = f'{workers} of {options.coastdowns}'
        measured, store = Measured(options.kept / f'{name}.json'), options.kept / f'store {name}'
        measured.run(folder, store, workers, options.minutes)
        hourly[workers], each_s, alone_s = show(workers, measured.found, store)
        on_paper(each_s, alone_s)
    if 1 in hourly and 2 in hourly:
        print(f'efficiency from 1 to 2 workers: {hourly[2] / hourly[1] / 2.0:.2f}')


if __name__ == '__main__':
    main()
