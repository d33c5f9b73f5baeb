# SPDX-License-Identifier: Apache-2.0
"""
Workers of `shipdrag fleet` killed amid the work: is the store the same to the byte?

    python -m benchmarks.speed.fleet_kills [--kills 20] [--bags 24]

Short coastdowns are brought into one store without, and into another with a worker
killed (SIGKILL) whenever a bag is done, until there were so many kills.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks import ROOT, _verbs
from benchmarks._asked import asked
from shipdrag_ros.fleet.find import find
from shipdrag_ros.fleet.store import Store
from shipdrag_ros.fleet.update import Engine, update

SHIP = ROOT / 'config' / 'vitus_bering.yaml'


def simulated(folder: Path, bags: int) -> None:
    """Write short coastdowns, too short for a diagnosis."""
    folder.mkdir()
    for seed in range(bags):
        line = ['simulate', '--ship', str(SHIP), '-o', str(folder / f'{seed}.mcap')]
        line += ['--seed', str(seed), '--lead-in', '250', '--duration', '500', '--speed', '7']
        _verbs.run(*line, '--rate', '0.5')


def contents(store: Path) -> dict[str, bytes]:
    """Return every file of a store."""
    return {
        str(path.relative_to(store)): path.read_bytes()
        for path in store.rglob('*')
        if path.is_file()
    }


def main() -> None:
    """Kill, compare and print."""
    options = asked(__doc__, kills=20, bags=24)
    random.seed(0)
    killed: list[int] = []
    with TemporaryDirectory() as made, Engine(workers=2) as engine:
        folder = Path(made) / 'fleet'
        simulated(folder, options.bags)

        def kill(text: str, done: int, total: int) -> None:
            if text.startswith('replaying') and len(killed) < options.kills:
                with contextlib.suppress(ProcessLookupError):  # dead already
                    pids = sorted(engine.on_each(os.getpid).values())
                    if pids:
                        os.kill(random.choice(pids), signal.SIGKILL)
                        killed.append(done)

        stores = Path(made) / 'plain', Path(made) / 'killed'
        found = find([str(folder)])
        update(found, Store(stores[0]), engine, lambda text, done, total: None)
        report = update(found, Store(stores[1]), engine, kill)
        same = contents(stores[0]) == contents(stores[1])
    print(
        f'{options.bags} bags, {len(killed)} kills: {report.new} replayed, '
        f'{len(report.skipped)} skipped, the store is {"the same" if same else "ANOTHER"}'
    )


if __name__ == '__main__':
    main()
