# SPDX-License-Identifier: Apache-2.0
"""
Replay and diagnose every bag below folders, here or in an object store, and write one row a
coastdown into a data set of Parquet files. The ship file of a bag is the nearest ship.yaml
upwards, or the one attached. What is done already is not done again. Bags that cannot be read
are skipped and listed, and the exit status is then 1.

Options
-------
DIR_OR_URL
    folder, or URL as s3://bucket/folder (the usual AWS variables say where and who): bags (MCAP,
    rosbag2, ROS 1), tables (.csv, .tsv) whose columns `shipdrag import` knows without options,
    and logs that `shipdrag import` knows by their first bytes, whatever their names
--out STORE
    folder; made if missing
--workers N
    processes on this machine (default: one a core)
--scheduler ADDRESS
    a Dask cluster that exists, as tcp://host:8786; its workers have one thread each, this version
    of the program, and see the folders under the same paths

Examples
--------
shipdrag fleet records -o store --workers 1
shipdrag fleet records -o store --json fleet.json
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from shipdrag_ros.cli.arguments import add, whole
from shipdrag_ros.cli.output import Output, ProgressLines
from shipdrag_ros.display import Table
from shipdrag_ros.errors import FleetError
from shipdrag_ros.progress import Progress

if TYPE_CHECKING:  # help must come at once
    from shipdrag_ros.fleet.update import Report

_SKIPPED = 1
_EVERY_S = 15.0  # a line of progress, where there is no terminal
_SHOWN = 50  # of the bags that were skipped; all are in the JSON and in the store


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    parser.add_argument('folders', nargs='+', metavar='DIR_OR_URL')
    parser.add_argument('-o', '--out', required=True, type=Path)
    engine = parser.add_mutually_exclusive_group()
    engine.add_argument('--workers', type=whole(1, 1024))
    engine.add_argument('--scheduler')
    add(parser, '--json')


def run(options: argparse.Namespace) -> int:
    """
    Bring the store up to date and say what became of the bags.
    """
    from shipdrag_ros.fleet.engine import Engine
    from shipdrag_ros.fleet.find import find
    from shipdrag_ros.fleet.store import Store
    from shipdrag_ros.fleet.update import update

    output = Output(options.json)
    found = find(options.folders, without=options.out)
    if not (found.sources or found.skipped):
        raise FleetError(
            f'no bag lies below {", ".join(map(repr, options.folders))}: no .mcap file, directory '
            'of rosbag2, .csv table or log of a format that `shipdrag import` knows'
        )
    store = Store(options.out)
    output.log(
        f'{len(found.sources)} bag(s) found; {found.left_alone} other file(s) left alone; '
        'starting workers'
    )
    with (
        Engine(
            workers=options.workers, scheduler=options.scheduler, at_most=len(found.sources)
        ) as engine,
        _progress(output) as progress,
    ):
        report = update(found, store, engine, progress)
    _show(output, options.out, report)
    output.json(_document(options.out, report))
    return _SKIPPED if report.skipped else 0


def _show(output: Output, store: Path, report: Report) -> None:
    coastdowns = sum(done.coastdowns for done in report.bags.values())
    read = [done for done in report.bags.values() if done.error is None]
    output.say(
        f'{store}: {coastdowns} coastdown(s) of {len(read)} bag(s); {report.new} bag(s) replayed '
        f'now, {len(read) - report.new} done before, {len(report.skipped)} skipped'
    )
    ships = _ships(report)
    if ships:
        rows = tuple((name, f'{bags}', f'{many}') for name, bags, many in ships)
        output.table(Table(('ship', 'bags', 'coastdowns'), rows))
    without = sum(done.coastdowns == 0 for done in read)
    if without:
        output.say(f'{without} bag(s) hold no coastdown; the warnings of each in bags/ say why')
    if report.removed:
        output.say(f'{report.removed} bag(s) have changed; their former rows are removed.')
    for twin in report.twins[:_SHOWN]:
        other = ', with another ship or run file beside it, which is not used,'
        output.say(
            f'{twin.bag!r} has the content of {twin.same_as!r}{other * twin.differs} and is '
            'counted once'
        )
    for note in report.notes:
        output.say(note)
    if report.skipped:
        output.heading(f'{len(report.skipped)} skipped')
    for each in report.skipped[:_SHOWN]:
        output.say(f'  {each.bag!r}: {each.reason}')
    if len(report.skipped) > _SHOWN:
        output.say(f'  and {len(report.skipped) - _SHOWN} more, which --json and bags/ list')


def _ships(report: Report) -> list[tuple[str, int, int]]:
    """Return name, number of bags and of coastdowns of each ship."""
    bags: Counter[str] = Counter()
    coastdowns: Counter[str] = Counter()
    for done in report.bags.values():
        if done.ship is not None:
            bags[done.ship] += 1
            coastdowns[done.ship] += done.coastdowns
    return [(name, bags[name], coastdowns[name]) for name in sorted(bags)]


def _document(store: Path, report: Report) -> dict[str, object]:
    return {
        'store': str(store),
        'bags': len(report.bags),
        'new': report.new,
        'coastdowns': sum(done.coastdowns for done in report.bags.values()),
        'ships': [
            {'name': name, 'bags': bags, 'coastdowns': coastdowns}
            for name, bags, coastdowns in _ships(report)
        ],
        'same_content': [twin._asdict() for twin in report.twins],
        'skipped': [{'bag': each.bag, 'reason': each.reason} for each in report.skipped],
        'notes': list(report.notes),
    }


@contextmanager
def _progress(output: Output) -> Iterator[Progress]:
    """Show a bar to a terminal; to a file a line now and then, with the time left."""
    if sys.stderr.isatty():
        with output.progress('') as bar:
            yield lambda text, done, total: bar(done, total)
        return
    yield ProgressLines(output.log, every_s=_EVERY_S, at_once=False).show
