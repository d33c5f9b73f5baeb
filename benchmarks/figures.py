# SPDX-License-Identifier: Apache-2.0
"""
Write docs/figures.md from the result files in docs/results.

    python -m benchmarks.figures                    # the page, from the files as they are
    python -m benchmarks.figures final_accuracy     # run what made a file first; WORD... or `all`

A result file begins with the command that printed it, `$ python benchmarks/...`, and
holds what it printed. All of them take hours.
"""

from __future__ import annotations

import argparse
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from benchmarks import ROOT
from benchmarks._tables import filled, table

PAGE, RESULTS = ROOT / 'docs' / 'figures.md', ROOT / 'docs' / 'results'


class Figure(NamedTuple):
    """
    A figure of the page.

    Attributes
    ----------
    question
        That it answers.
    file
        Of `RESULTS`, without its ending.
    pattern
        Finds the figure there; its groups are put into `says`.
    says
        The answer.
    """

    question: str
    file: str
    pattern: str
    says: str


_ROW = r' +│ +\d+ │ +([\d.]+) │.*│ +(\d+) │ +[\d.]+ │ +\d+ │'
_THIRD = r' +│[^│]+│[^│]+│ +(.+?) │'  # column, n = 500
_ACCURACY = 'rms error {0} % of the largest r; ±2 sigma holds {1} % of the curve'
FIGURES = tuple(Figure(*each) for each in (
    ('How far off is the final curve? Log and position',
     'final_accuracy', f'white noise{_ROW}', _ACCURACY),
    ('The same in gusts that move the ship by 0.05 m/s, with shaft speed',
     'final_accuracy', rf'gusts[\s\S]*?the same, shaft{_ROW}', _ACCURACY),
    ('The same of a yacht whose r has a hump',
     'final_accuracy', f'yacht with a hump{_ROW}', _ACCURACY),
    ('How long does an estimate take?',
     'estimator_speed', rf'live{_THIRD}[\s\S]*?final{_THIRD}',
     '{0} during a coastdown, {1} after it'),
    ('How soon is a stop noticed, by the log alone in a moderate sea?',
     'onset', r'coastdown +log +moderate +(\d+) +(\d+) +([\d.]+) ±',
     'median {0} s, 90 % within {1} s; dated {2} s late on average'),
    ('How often is a stop imagined in steady sailing?',
     'onset', r'calm.+: ([\d.]+) a day\nmoderate.+: ([\d.]+) a day\nrough.+: ([\d.]+) a day',
     '{0}, {1} and {2} times a day, in a calm, moderate and rough sea'),
    ('Does the monitor grow?',
     'monitor_memory',
     r'day +1: process +([\d.]+) MiB[\s\S]*day +30: process +([\d.]+) MiB',
     '{0} MiB after a day, {1} MiB after 30'),
    ('How fast is a replay, a coastdown every 85 minutes?',
     'replay_speed', r'20 coastdowns .* replayed at +(\d+) messages/s',
     '{0} messages a second'),
    ('What is saved of damaged bags?',
     'recover', r'all +\d+ +\d+ +(\d+) +(\d+)', '{1} of {0} whole messages'),
    ('How late is an estimate on board, at 1 Hz?',
     'node_latency', r'\| 1 Hz \| ([\d.]+) / (\d+) \| ([\d.]+) % \|',
     'median {0} ms, 99 % within {1} ms; {2} % of a core'),
    ('Is a name of `diagnose` right? World B, by another author, one effect hidden',
     'diagnosis_score', r'something is named \| (\d+ of \d+) \| (\d+ of \d+)',
     '{0}, with facts {1}'),
    ('Is something named where nothing is hidden? World B',
     'diagnosis_score', r'nothing hidden: false name; plain "none" \| (\d+); (\d+) of (\d+)',
     '{0} false names and {1} plain `none` in {2}; the rest are sets that hold "nothing"'),
))  # fmt: skip


def found(figure: Figure) -> str:
    """
    Return the answer of a figure.

    Raises
    ------
    SystemExit
        If its file does not hold it.
    """
    text = (RESULTS / f'{figure.file}.txt').read_text(encoding='utf-8')
    match = re.search(figure.pattern, text)
    if match is None:
        raise SystemExit(f'{figure.file}.txt does not answer {figure.question!r}')
    return figure.says.format(*match.groups())


def page() -> str:
    """
    Return the page, with the table as the files have it.
    """
    rows = [
        (each.question, found(each), f'[{each.file}](results/{each.file}.txt)') for each in FIGURES
    ]
    lines = table(('question', 'figure', 'file'), rows)
    return filled(PAGE.read_text(encoding='utf-8'), {'figures': '\n'.join(lines)})


def renew(file: Path, limit_s: float) -> None:
    """
    Run the command that a file begins with, and keep what it prints.
    """
    command = file.read_text(encoding='utf-8').partition('\n')[0]
    if not command.startswith('$ python '):
        return
    print(command, file=sys.stderr, flush=True)
    words = shlex.split(command.removeprefix('$ python '))
    try:
        done = subprocess.run(
            [sys.executable, *words], cwd=ROOT, stdout=subprocess.PIPE, timeout=limit_s, check=True
        )
    except (subprocess.SubprocessError, OSError) as error:
        print(f'left as it was: {error}', file=sys.stderr)
        return
    file.write_text(f'{command}\n{done.stdout.decode().strip()}\n', encoding='utf-8')


def main() -> None:
    """
    Make the files that were asked for again, and write the page.
    """
    parser = argparse.ArgumentParser(description=__doc__.strip().partition('\n')[0])
    parser.add_argument('words', nargs='*', help='files to make again, by a word of their names')
    parser.add_argument('--limit', type=float, default=3600.0, help='seconds for each')
    options = parser.parse_args()
    for file in sorted(RESULTS.glob('*.txt')):
        if any(word == 'all' or word in file.stem for word in options.words):
            renew(file, options.limit)
    PAGE.write_text(page(), encoding='utf-8')


if __name__ == '__main__':
    main()
