# SPDX-License-Identifier: Apache-2.0
"""
Whether coastdowns are found on any ship, and whether what is none is left alone.

Every way to stop a propeller x three ships x three seas, with log, positions or
both, with and without the shafts; manoeuvres that are no coastdown; days of steady
sailing. Ships, propellers, engines, sea and instruments are those of `propulsion/`,
which shares nothing with the package. Writes the tables to `benchmarks/out/`.

    python -m benchmarks.accuracy.propulsion_found [--quick] [--part stops others steady]
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import time
from dataclasses import fields
from multiprocessing import get_context
from pathlib import Path

from benchmarks.worlds.propulsion.cases import OTHERS, STEADY, STOPS, Case
from benchmarks.worlds.propulsion.hull import HULLS
from benchmarks.worlds.propulsion.score import SUITES, WITH_HEADING, Row, score
from benchmarks.worlds.propulsion.sea import SEAS
from benchmarks.worlds.propulsion.tables import others_tables, steady_table, stops_tables

OUT = Path(__file__).parent / 'out'
STEADY_HOURS = 8.0


def stops(seeds: range, quick: bool) -> list[Case]:
    """
    Return the coastdowns: every way, ship and sea; a sea in turn where quick.
    """
    seas = list(SEAS)
    return [
        Case(kind, hull, sea, seed)
        for seed in seeds
        for i, kind in enumerate(STOPS)
        for j, hull in enumerate(HULLS)
        for sea in (seas[(i + j) % 3 : (i + j) % 3 + 1] if quick else seas)
    ]


def others(seeds: range, quick: bool) -> list[Case]:
    """
    Return the manoeuvres that are no coastdown, each ship in a sea in turn.
    """
    seas, hulls = list(SEAS), list(HULLS)
    return [
        Case(kind, hull, seas[(seed + i + j) % 3], seed)
        for seed in seeds
        for i, kind in enumerate(OTHERS)
        for j, hull in enumerate(hulls[i % 3 : i % 3 + 1] if quick else hulls)
    ]


def sailing(seeds: range) -> list[Case]:
    """
    Return steady sailing, a record of `STEADY_HOURS` for each ship and seed.
    """
    seas = list(SEAS)
    return [
        Case(STEADY, hull, seas[(seed + i) % 3], seed)
        for seed in seeds
        for i, hull in enumerate(HULLS)
    ]


def _score(case: Case) -> list[Row]:
    suites = SUITES if case.kind in STOPS else {**SUITES, **WITH_HEADING}
    return score(case, suites, STEADY_HOURS)


def run(cases: list[Case], jobs: int) -> list[Row]:
    """
    Score cases in several processes, in their order.
    """
    if jobs == 1:
        return [row for case in cases for row in _score(case)]
    with get_context('fork').Pool(jobs) as pool:
        return [row for rows in pool.imap(_score, cases, chunksize=2) for row in rows]


def write_rows(path: Path, rows: list[Row]) -> None:
    """
    Write every row as CSV, to hold two versions of the program against each other.
    """
    names = [field.name for field in fields(Row) if field.name != 'case']
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file)
        writer.writerow(['kind', 'hull', 'sea', 'seed', *names])
        for row in rows:
            case = row.case
            values = [getattr(row, name) for name in names]
            writer.writerow([case.kind, case.hull, case.sea, case.seed, *values])


def main() -> None:
    """
    Run and print.
    """
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--quick', action='store_true', help='a small part, under a minute')
    parser.add_argument('--seed', type=int, default=1, help='first seed')
    parser.add_argument('--seeds', type=int, default=6, help='each is 72 coastdowns')
    parser.add_argument('--jobs', type=int, default=os.cpu_count() or 1)
    parser.add_argument('--part', nargs='+', default=['stops', 'others', 'steady'])
    parser.add_argument('--kind', help='only kinds that hold this text')
    parser.add_argument('--name', default='propulsion_found', help='of the files in out/')
    given = parser.parse_args()
    first, quick = given.seed, given.quick
    n = 1 if quick else given.seeds
    parts = {
        'stops': stops(range(first, first + n), quick),
        'others': others(range(first, first + (n + 1) // 2), quick),
        'steady': sailing(range(first, first + (1 if quick else math.ceil(10 * n / 3)))),
    }
    tables = {'stops': stops_tables, 'others': others_tables, 'steady': steady_table}
    began = time.perf_counter()
    score(Case('declutched', 'ferry', 'calm', 1), {'both': ('log', 'track')})  # compiles
    lines = [
        f'{n} seeds from {first}{", quick" if quick else ""}; {given.jobs} processes; update_s 60'
    ]
    rows: list[Row] = []
    OUT.mkdir(exist_ok=True)
    print(*lines, sep='\n', flush=True)
    for part in given.part:
        cases = [case for case in parts[part] if not given.kind or given.kind in case.kind]
        found = run(cases, given.jobs)
        rows += found
        new = [*tables[part](found), '', f'{time.perf_counter() - began:.0f} s so far']
        print(*new, sep='\n', flush=True)
        lines += new
        # each part is there as soon as it is done
        (OUT / f'{given.name}.md').write_text('\n'.join(lines) + '\n', encoding='utf-8')
        write_rows(OUT / f'{given.name}.csv', rows)


if __name__ == '__main__':
    main()
