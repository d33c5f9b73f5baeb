# SPDX-License-Identifier: Apache-2.0
"""Scores of many cases as tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from benchmarks.worlds.propulsion.score import FEWER, SUITES, WITH_HEADING, Row

MIDDLE_S = 180.0
LENGTHS_MIN = ((0, 3), (3, 5), (5, 10), (10, 60))


def stops_tables(rows: list[Row]) -> list[str]:
    """
    Return what was found of the coastdowns, how dated, and how right r is.
    """
    glides = [row for row in rows if np.isfinite(row.glide_s)]
    long = [row for row in glides if row.long]
    cases = len(glides) // len(SUITES)
    lines = ['', f'## Coastdowns: {cases}, of them long {len(long) // len(SUITES)}', '']
    lines += ['Long: 10 min or more from half of the service speed or more. Found, long ones:', '']
    lines += _by('way to stop', long, lambda row: row.case.kind, _share)
    lines += ['', 'by sea:', '', *_by('sea', long, lambda row: row.case.sea, _share)]
    lines += ['', 'by ship:', '', *_by('ship', long, lambda row: row.case.hull, _share)]
    some = [row for row in glides if row.glide_s >= MIDDLE_S]
    lines += ['', 'Found, glides of 3 min or more from any speed:', '']
    lines += _by('way to stop', some, lambda row: row.case.kind, _share)
    lines += ['', 'by length of the glide:', '', *_by('length', glides, _length, _share)]
    lines += ['', 'What the others lack, from 3 min / long:', '', *_why(some)]
    lines += ['', *fewer(long, 'long'), '', *fewer(some, 'from 3 min')]
    lines += ['', *fewer(glides, 'from half a minute')]
    lines += ['', 'Dating, long ones that are reported:', '', *_dating(long)]
    lines += ['', 'Dating, from 3 min:', '', *_dating(some)]
    lines += ['', 'r, long ones that are found: against hull, mean wind and propeller:', '']
    lines += _accuracy(long)
    return lines


def others_tables(rows: list[Row]) -> list[str]:
    """
    Return how many manoeuvres were left as coastdowns, at the end and live.
    """
    suites = {**SUITES, **WITH_HEADING}
    lines = ['', f'## No coastdowns: {len(rows) // len(suites)}', '']
    lines += ['Cases left with a coastdown that holds more than 10 s of drive, + others left with']
    lines += [
        'one that holds no push but no glide either (an engine that idles on the shaft):',
        '',
    ]

    def left(some: list[Row]) -> str:
        idle = sum(row.idle > 0 and not row.wrong for row in some)
        return f'{sum(row.wrong > 0 for row in some)} + {idle} / {len(some)}'

    def live(some: list[Row]) -> str:
        return _of(sum(row.wrong_live > 0 for row in some), len(some))

    lines += _by('manoeuvre', rows, lambda row: row.case.kind, left, suites)
    lines += ['', 'Announced live, whatever became of it:', '']
    lines += _by('manoeuvre', rows, lambda row: row.case.kind, live, suites)
    kicks = [row for row in rows if 'kick' in row.case.kind and np.isfinite(row.glide_s)]
    if kicks:
        lines += ['', 'Glides before a kick that are found:', '']
        lines += _by('manoeuvre', kicks, lambda row: row.case.kind, _share, suites)
    return lines


def steady_table(rows: list[Row]) -> list[str]:
    """
    Return false coastdowns in steady sailing, a day.
    """
    suites = {**SUITES, **WITH_HEADING}

    def a_day(some: list[Row], what: Callable[[Row], int]) -> str:
        days = sum(row.record_s for row in some) / 86400.0
        return f'{sum(map(what, some)) / days:.2f}' if days else ''

    days = sum(row.record_s for row in rows) / 86400.0 / len(suites)
    lines = ['', f'## Steady sailing: {days:.1f} days', '']
    columns = ['a day', *suites]
    cells = [
        [
            name,
            *(a_day([row for row in rows if row.suite == suite], what) for suite in suites),
        ]
        for name, what in (
            ('coastdowns left', lambda row: row.wrong + row.idle),
            ('announced live', lambda row: row.wrong_live),
            ('without estimate', lambda row: row.refused),
            ('withdrawn', lambda row: row.withdrawn),
        )
    ]
    return lines + _table(columns, cells)


def _by(
    name: str,
    rows: list[Row],
    key: Callable[[Row], str],
    cell: Callable[[list[Row]], str],
    suites: Iterable[str] = SUITES,
) -> list[str]:
    """A table with a line for each key and one for all."""
    keys = dict.fromkeys(map(key, rows))
    lines = []
    for wanted in (*keys, None):
        some = [row for row in rows if wanted is None or key(row) == wanted]
        cells = [cell([row for row in some if row.suite == suite]) for suite in suites]
        lines.append([wanted or 'all', *cells])
    return _table([name, *suites], lines)


def _length(row: Row) -> str:
    minutes = row.glide_s / 60.0
    return next(f'{a} to {b} min' for a, b in LENGTHS_MIN if minutes < b)


def _share(rows: list[Row]) -> str:
    return _of(sum(row.found for row in rows), len(rows))


def _of(part: int, n: int) -> str:
    return f'{part}/{n} {100 * part / n:.0f} %' if n else ''


def _why(rows: list[Row]) -> list[str]:
    words = {
        'none': 'none reported, or without estimate',
        'several': 'several reported',
        'driven': 'holds more than 10 s of drive',
        'short': 'holds less than 80 %',
    }
    lines = []
    for why, text in words.items():
        cells = []
        for suite in SUITES:
            some = [row for row in rows if row.suite == suite and row.why == why]
            cells.append(f'{len(some)} / {sum(row.long for row in some)}')
        lines.append([text, *cells])
    refused = [str(sum(row.refused for row in rows if row.suite == suite)) for suite in SUITES]
    lines.append(['(coastdowns without estimate)', *refused])
    back = [str(sum(row.withdrawn for row in rows if row.suite == suite)) for suite in SUITES]
    lines.append(['(coastdowns withdrawn)', *back])
    return _table(['', *SUITES], lines)


def fewer(rows: list[Row], which: str) -> list[str]:
    """
    Return what an input more brings and costs, paired: cases found by one set of inputs alone.
    """
    found = {(row.case, row.suite): row.found for row in rows}
    cases = dict.fromkeys(row.case for row in rows)
    cells = []
    for less, more in FEWER:
        both = [(found[case, less], found[case, more]) for case in cases]
        gained = sum(b and not a for a, b in both)
        lost = sum(a and not b for a, b in both)
        error = float(np.sqrt(lost * (1.0 - lost / len(both))))
        cells.append([f'{less} -> {more}', gained, f'{lost} ± {error:.1f}', len(both)])
    columns = [f'an input more, {which}', 'gained', 'lost, ± standard error', 'of']
    return _table(columns, cells)


def _dating(rows: list[Row]) -> list[str]:
    lines = []
    for suite in SUITES:
        some = [row for row in rows if row.suite == suite and np.isfinite(row.dated_s)]
        if 'shaft' not in suite:
            some = [row for row in some if row.case.sea != 'rough']
        if not some:
            continue
        off = np.array([row.dated_s for row in some])
        delay = np.array([row.delay_s for row in some])
        lines.append(
            [
                suite + ('' if 'shaft' in suite else ' (calm, moderate)'),
                _of(int(np.sum(np.abs(off) <= 5.0)), len(off)),
                _of(int(np.sum(np.abs(off) <= 20.0)), len(off)),
                f'{np.median(off):+.0f}',
                f'{np.quantile(np.abs(off), 0.9):.0f}',
                f'{np.nanmedian(delay):.0f} / {np.nanquantile(delay, 0.9):.0f}',
            ]
        )
    columns = ['inputs', 'within 5 s', 'within 20 s', 'median [s]', '90 % within [s]']
    return _table([*columns, 'announced after, median / 90 % [s]'], lines)


def _accuracy(rows: list[Row]) -> list[str]:
    lines = []
    for suite in SUITES:
        some = [row for row in rows if row.suite == suite and row.found and row.rms == row.rms]
        for name, part in (
            ('calm, moderate', [row for row in some if row.case.sea != 'rough']),
            ('rough', [row for row in some if row.case.sea == 'rough']),
        ):
            if part:
                rms = np.array([row.rms for row in part])
                cells = [f'{100 * np.quantile(rms, q):.1f}' for q in (0.5, 0.9)]
                cover = f'{100 * np.mean([row.cover for row in part]):.0f}'
                lines.append([suite, name, len(part), *cells, cover])
    columns = ['inputs', 'sea', 'n', 'rms, median [% of max r]', '90 %', 'within 2 sigma [%]']
    return _table(columns, lines)


def _table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    lines = [columns, ['---'] * len(columns), *rows]
    return [f'| {" | ".join(map(str, line))} |' for line in lines]
