# SPDX-License-Identifier: Apache-2.0
"""
The coastdown estimator as published (S1): its statements beside ours, and what the scripts print.

Runs s1_experiment, s1_accuracy, s1_order and s1_time and prints the page; `--write` puts it into
docs/s1_coastdown.md, its picture into docs/pictures. Two minutes.
"""

from __future__ import annotations

import os

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import argparse
import contextlib
import io
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

from benchmarks._tables import publish, table
from benchmarks.accuracy import s1_accuracy, s1_experiment, s1_order
from benchmarks.accuracy.s1_experiment import (
    RUNS,
    SEED,
    YACHT_NOISE,
    Stated,
    coastdowns,
    inflection,
    maxima,
)
from benchmarks.speed import s1_time
from shipdrag_ros.ship import Ship

DOCS = Path(__file__).resolve().parents[2] / 'docs'
PAGE = DOCS / 's1_coastdown.md'
PICTURE = 's1_experiment.png'

SECTIONS = {
    'The experiment': '`s1_experiment.py`. Orders are numbers of coefficients.',
    'Error and coverage': '`s1_accuracy.py`.',
    'The order rule': '`s1_order.py`. The paper compares neighbouring residual '
    'variances by eye; ours is an F test, and a higher order must keep its gain for some steps.',
    'Time': '`s1_time.py`.',
}


def printed(run: Callable[[], None]) -> str:
    """
    Return what a script prints.
    """
    kept = io.StringIO()
    with contextlib.redirect_stdout(kept):
        run()
    return kept.getvalue().rstrip()


def beside() -> list[str]:
    """
    Return the statements of the paper beside what is found.
    """
    truth, yachts = coastdowns()
    ship = truth.ship
    of = {name: Stated.of(truth, name, 100) for name in s1_experiment.LABELS}
    joint, half = of['s1_joint'], Stated.of(truth, 's1_joint', 50)
    means = ', '.join(f'{s1_experiment.LABELS[name]} {one.mean:.2f}' for name, one in of.items())
    found = []
    for name, yacht in yachts.items():
        tops, _ = maxima(yacht, YACHT_NOISE)
        found.append(f'{name}: significant in {len(tops)} of {RUNS} records')
    hull: Ship = next(iter(yachts.values())).ship
    rows = [
        (
            'n_r of the ship at rest and at 8.2 m/s',
            '0.0552, 0.1042 (its polynomial, by hand)',
            f'{float(ship.n_r(0.0)):.4f}, {float(ship.n_r(8.2)):.4f}',
        ),
        (
            'w = sigma_r / max r, n = 100, joint',
            'below 1 % is asked for; "high accuracy"',
            f'below 1 % from Fr {joint.small[0]:.3f} to {joint.small[1]:.3f}; largest '
            f'{joint.largest:.1f} %, at the ends',
        ),
        (
            'which problem has the smallest sigma_r, n = 100',
            'joint',
            f'joint; mean over Fr in %: {means}',
        ),
        (
            'joint from half the samples of each, n = 50',
            'smaller than either alone',
            f'{half.mean:.2f} %: smaller than speed alone from 100 by '
            f'{100.0 * (1.0 - half.mean / of["s1_speed"].mean):.0f} %',
        ),
        (
            'what w says of the error',
            'it is the criterion of acceptance',
            f'joint, n = 100: w {joint.mean:.2f} % on average, real error {joint.rmse:.2f} %, '
            f'{joint.at_top:.1f} % at the top, nearly all of it bias',
        ),
        (
            'Fr_max from 5 and from 6 knots',
            'the same (two records)',
            f'not confirmed: true inflection of this hull Fr {inflection(hull):.3f}; '
            f'{"; ".join(found)} (log {YACHT_NOISE[0]} m/s, position {YACHT_NOISE[1]} m)',
        ),
    ]
    return table(('', 'the paper', 'here'), rows)


def main() -> None:
    """
    Print the page; write it if asked.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--write', action='store_true', help='docs/s1_coastdown.md, its picture')
    write = parser.parse_args().write
    with tempfile.TemporaryDirectory() as folder:
        runs = (
            partial(s1_experiment.main, ['--out', folder]),
            partial(s1_accuracy.main, []),
            partial(s1_order.main, []),
            s1_time.main,
        )
        texts = [printed(run) for run in runs]
        picture = (Path(folder) / PICTURE).read_bytes()
    lines = [
        '# The coastdown estimator as published (S1)',
        '',
        'Devyatisilny, Dorozhko, Grinyak: *Determination of hydrodynamic resistance from '
        'trajectory data of inertial motion* (2003).',
        'Written by `python -m benchmarks.accuracy.s1_coastdown --write`. '
        'The records of the paper, sea trials of '
        'the cargo ship "Vitus Bering" and speeds of the yacht "Rowdy", are not',
        'printed in it. Here both are simulated: 150 m, 20 200 m³, from 8.2 m/s, 1500 s as it '
        'says, with resistance, and noise of log (0.05 m/s) and radar (10 m), of our',
        f'own; seed {SEED}, or {RUNS} records from seed 0.',
        '',
        '`estimator: s1_speed`, `s1_position` or `s1_joint` in the parameters chooses one of the '
        'three problems of the paper, certified against exact rational arithmetic',
        '(`tests/studies/s1/test_s1.py`).',
        'They are kept as the reference; what is used by default, and by how much it is better: '
        '`benchmarks/results/accuracy_beside_peers.md`.',
        '',
        '## The paper and what is found',
        '',
        *beside(),
        '',
        f'![Orders, r and dr/dFr, w, real error and sigma](pictures/{PICTURE})',
    ]
    for (heading, words), text in zip(SECTIONS.items(), texts):
        lines += ['', f'## {heading}', '', words, '', '```text', text, '```']
    page = '\n'.join(lines) + '\n'
    print(page)
    if write:
        publish(PAGE, lines, rows=6)
        (DOCS / 'pictures' / PICTURE).write_bytes(picture)


if __name__ == '__main__':
    main()
