# SPDX-License-Identifier: Apache-2.0
"""
Score of r(v) and its band, on coastdowns of world B.

    python benchmarks/band_score.py --world b --half odd --count 40 --seed 5

Runs `shipdrag replay` on each run by itself, in this process, and holds the curve against the
true one. By default only cases in which r(v) is what a coastdown shows: nothing hidden, or
something that belongs to the hull. Even cases are for choosing methods, odd ones for scoring.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

os.environ.setdefault('OMP_NUM_THREADS', '1')
sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from diagnosis_score import HALVES, write_bags
from hidden_b import cases
from hidden_b.plans import plans_of

from shipdrag_ros import cli

OWN = (
    'fouling',
    'shallow_water',
    'towed_cable',
    'locked_propeller',
    'windmilling_propeller',
    'displacement',
)
"""What is part of r(v), and nothing else beside it."""
NINE_TENTHS = 0.9
WIDE = 1.96


@dataclass(frozen=True)
class Score:
    """
    How the curve of a run compares with the true one.

    Attributes
    ----------
    case, run, hidden, condition
    rmse, rmse_below
        Of the largest true r: over the curve, and below nine tenths of the first speed.
    cover
        Share of speeds at which the band of 95 % holds the truth.
    chi2
        Mean square of error over sigma.
    sigma
        Mean sigma, of the largest true r.
    late_s
        Start of the window after the stop.
    cpu_s
    """

    case: int
    run: int
    hidden: str
    condition: str
    rmse: float
    rmse_below: float
    cover: float
    chi2: float
    sigma: float
    late_s: float
    cpu_s: float


def replay(ship: Path, bag: Path, window: tuple[float, float] | None) -> dict[str, Any]:
    """
    Replay a bag with the public command.

    Parameters
    ----------
    ship, bag
    window
        Given start and end, s from the start of the bag; None to find them.
    """
    asked = ['replay', str(bag), '--ship', str(ship), '--json']
    if window is not None:
        asked += ['--window', *(f'{at:.3f}' for at in window)]
    written, said = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(written), contextlib.redirect_stderr(said):
        try:
            status = cli.main(asked)
        except SystemExit as ended:
            status = ended.code
    if status:
        raise RuntimeError(f'shipdrag replay ended with {status}: {said.getvalue().strip()}')
    found: dict[str, Any] = json.loads(written.getvalue())
    return found


def score(number: int, run: int, found: dict[str, Any], seed: int, cpu_s: float) -> Score | None:
    """
    Return the score of a run, None where no coastdown was found after its stop.
    """
    stop = cases.stops_ns(number, seed)[run]
    later = [each for each in found['coastdowns'] if each['end_ns'] > stop]
    if not later:
        return None
    best = max(later, key=lambda each: each['end_ns'] - max(stop, each['start_ns']))
    first = cases.first_speed(number, run, seed)
    speed, r, sigma = (
        np.array(best[name], np.float64) for name in ('speed_m_s', 'resistance_m_s2', 'sigma_m_s2')
    )
    use = (speed > 0.0) & (speed <= first) & np.isfinite(r) & np.isfinite(sigma)
    speed, r, sigma = speed[use], r[use], sigma[use]
    if len(speed) < 3:
        return None
    true = cases.true_r(number, speed, run, seed)
    largest = float(true.max())
    error = r - true
    below = speed < NINE_TENTHS * first
    return Score(
        number,
        run,
        ' + '.join(cases.reveal(number, seed).what) or 'nothing',
        str(cases.condition(number, seed)),
        float(np.sqrt(np.mean(error**2))) / largest,
        float(np.sqrt(np.mean(error[below] ** 2))) / largest if below.any() else float('nan'),
        float(np.mean(np.abs(error) <= WIDE * sigma)),
        float(np.mean((error / sigma) ** 2)),
        float(np.mean(sigma)) / largest,
        (best['start_ns'] - stop) * 1e-9,
        cpu_s,
    )


def chosen(half: str, hidden: str, first: int, count: int, seed: int) -> list[int]:
    """
    Return numbers of cases: of a half, and of those with what is wanted hidden.
    """
    remainder, divisor = HALVES[half]
    numbers = []
    for number, (names, _) in enumerate(plans_of(seed)):
        own = not names or (len(names) == 1 and names[0] in OWN)
        wanted = {'own': own, 'nothing': not names, 'all': True}[hidden]
        if number >= first and number % divisor == remainder and wanted:
            numbers.append(number)
    return numbers[:count]


def scored(
    numbers: Sequence[int], seed: int, given: bool
) -> Iterator[tuple[int, int, Score | None, str]]:
    """
    Yield case, run, score, and the error where the command failed.
    """
    for number in numbers:
        seen = cases.observe(number, seed=seed)
        with TemporaryDirectory() as folder:
            ship, bags = write_bags(seen, Path(folder))
            for run, bag in enumerate(bags):
                series = seen.runs[run].values()
                begins = min(int(each.receive_ns[0]) for each in series)
                ends = max(int(each.stamp_ns[-1]) for each in series)
                window = (
                    (cases.stops_ns(number, seed)[run] - begins) * 1e-9,
                    (ends - begins) * 1e-9,
                )
                start = time.process_time()
                try:
                    found = replay(ship, bag, window if given else None)
                    cpu_s = time.process_time() - start
                    yield number, run, score(number, run, found, seed, cpu_s), ''
                except RuntimeError as error:
                    yield number, run, None, str(error)


def summary(scores: Sequence[Score], runs: int) -> dict[str, float]:
    """
    Return the figures of some runs.
    """
    if not scores:
        return {'runs': runs, 'with an estimate, %': 0.0}

    def of(name: str) -> np.ndarray:
        values = np.array([getattr(each, name) for each in scores])
        return values[np.isfinite(values)]

    return {
        'runs': runs,
        'with an estimate, %': 100.0 * len(scores) / runs,
        'RMSE, % of the largest r': 100.0 * float(np.sqrt(np.mean(of('rmse') ** 2))),
        'RMSE, median of runs': 100.0 * float(np.median(of('rmse'))),
        'RMSE below 0.9 of the first speed': 100.0
        * float(np.sqrt(np.mean(of('rmse_below') ** 2))),
        'the same, median of runs': 100.0 * float(np.median(of('rmse_below'))),
        'mean sigma, % of the largest r': 100.0 * float(np.mean(of('sigma'))),
        'sigma, median of runs': 100.0 * float(np.median(of('sigma'))),
        'cover of the 95 % band, %': 100.0 * float(np.mean(of('cover'))),
        'runs with cover below 50 %, %': 100.0 * float(np.mean(of('cover') < 0.5)),
        'chi^2, mean of runs': float(np.mean(of('chi2'))),
        'chi^2, median of runs': float(np.median(of('chi2'))),
        'CPU s a run, median': float(np.median(of('cpu_s'))),
    }


def table(rows: Sequence[tuple[int, int, Score | None, str]], seed: int) -> Iterator[str]:
    """
    Yield the lines of the report: all runs, and apart those with and without anything hidden.
    """
    clean = {
        number for number, _, each, _ in rows if each is not None and each.hidden == 'nothing'
    }
    groups = {'all': rows}
    for name, inside in (('nothing hidden', True), ('something hidden', False)):
        part = [row for row in rows if (row[0] in clean) == inside]
        if part and len(part) < len(rows):
            groups[name] = part
    columns = {
        name: summary([each for _, _, each, _ in part if each is not None], len(part))
        for name, part in groups.items()
    }
    yield '| | ' + ' | '.join(columns) + ' |'
    yield '|---|' + '---|' * len(columns)
    for name in columns['all']:
        cells = [f'{column[name]:.3g}' if name in column else '-' for column in columns.values()]
        yield f'| {name} | ' + ' | '.join(cells) + ' |'


def main(arguments: Sequence[str] | None = None) -> None:
    """
    Replay, score and print.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--world', choices=('b',), default='b')
    parser.add_argument('--half', choices=tuple(HALVES), default='all', help='by number')
    parser.add_argument('--hidden', choices=('own', 'nothing', 'all'), default='own')
    parser.add_argument('--first', type=int, default=0)
    parser.add_argument('--count', type=int, default=40, help='how many cases')
    parser.add_argument('--seed', type=int, default=cases.SEED)
    parser.add_argument('--given', action='store_true', help='the time of the stop is given')
    parser.add_argument('--each', action='store_true', help='print each run')
    parser.add_argument('--out', type=Path, help='one line of JSON a run')
    options = parser.parse_args(arguments)
    numbers = chosen(options.half, options.hidden, options.first, options.count, options.seed)
    rows = []
    for row in scored(numbers, options.seed, options.given):
        rows.append(row)
        number, run, found, error = row
        if options.each:
            print(found or f'case {number} run {run}: {error or "no coastdown"}', flush=True)
        if options.out is not None:
            with options.out.open('a', encoding='utf-8') as file:
                line = asdict(found) if found else {'case': number, 'run': run, 'error': error}
                file.write(json.dumps(line) + '\n')
    print(f'{len(numbers)} cases of world b, seed {options.seed}, half {options.half}')
    for error in sorted({error for *_, error in rows if error})[:5]:
        print(error)
    for line in table(rows, options.seed):
        print(line)


if __name__ == '__main__':
    main()
