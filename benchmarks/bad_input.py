# SPDX-License-Identifier: Apache-2.0
"""
Every kind of bad input, tried for real: what the user sees.

`python benchmarks/bad_input.py` makes each kind in a folder of its own, runs the
command and prints a table; with `--write` it also goes into docs/results/bad_input.txt. No
random numbers but the noise of the simulated records (seed 1).
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import _bad_bags
import _bad_files
import _bad_messages
import _bad_tables
import _bad_use
from _bad_case import ROOT, Case, Seen, run

PAGE = ROOT / 'docs' / 'results' / 'bad_input.txt'
CASES: tuple[Case, ...] = (
    *_bad_bags.CASES,
    *_bad_files.CASES,
    *_bad_messages.CASES,
    *_bad_tables.CASES,
    *_bad_use.CASES,
)
_BEGIN, _END = '<!-- bad input -->', '<!-- end bad input -->'
_LINES, _WIDTH = 4, 240


def faults(case: Case, seen: Seen) -> list[str]:
    """
    Say what is not as it should be.
    """
    found = [f'does not say {phrase!r}' for phrase in case.says if phrase not in seen.text]
    if seen.status != case.status:
        found.append(f'exit code {seen.status}, expected {case.status}')
    if 'Traceback' in seen.text:
        found.append('a traceback')
    if not case.says:
        found.append('nothing is expected of it')
    return found


def cell(text: str) -> str:
    """
    Return text for a cell of a table, which a pipe would end.
    """
    return text.replace('|', '\\|')


def shown(case: Case, seen: Seen) -> str:
    """
    Return the lines that the user reads, shortened.
    """
    lines = [
        line
        for line in seen.text.splitlines()
        if line.startswith(('ERROR', '  - '))
        or ': error: ' in line
        or any(phrase in line for phrase in case.says)
    ]
    cut = [line if len(line) <= _WIDTH else f'{line[:_WIDTH]} ...' for line in lines[:_LINES]]
    return '<br>'.join(f'`` {cell(re.sub(r" {2,}", "  ", line).strip())} ``' for line in cut)


def table(results: list[tuple[Case, Seen]]) -> str:
    """
    Return one table an area.
    """
    lines = [f'{len(results)} kinds.']
    area = ''
    for case, seen in results:
        if case.area != area:
            area = case.area
            lines += [
                '',
                f'## {area}',
                '',
                '| kind | exit | what the user sees |',
                '|---|---|---|',
            ]
        lines.append(f'| {cell(case.kind)} | {seen.status} | {shown(case, seen)} |')
    return '\n'.join(lines)


def main() -> int:
    results = []
    bad = 0
    for case in CASES:
        with TemporaryDirectory() as folder:
            seen = run(case, Path(folder))
        results.append((case, seen))
        for fault in faults(case, seen):
            bad += 1
            print(f'{case.area}, {case.kind}: {fault}', file=sys.stderr)
    made = table(results)
    print(made)
    if '--write' in sys.argv[1:]:
        text = PAGE.read_text(encoding='utf-8')
        before, _, rest = text.partition(_BEGIN)
        after = rest.partition(_END)[2]
        PAGE.write_text(f'{before}{_BEGIN}\n{made}\n{_END}{after}', encoding='utf-8')
    return 1 if bad else 0


if __name__ == '__main__':
    sys.exit(main())
