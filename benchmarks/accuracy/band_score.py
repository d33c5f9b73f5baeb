# SPDX-License-Identifier: Apache-2.0
"""
Score of r(v) and its band, on coastdowns of world A or B.

    python -m benchmarks.accuracy.band_score --world a --first 539 --count 40
    python -m benchmarks.accuracy.band_score --world b --half odd --count 40 --seed 5

Runs `shipdrag replay` on each run by itself, in this process, and holds the curve against the
true one. By default only cases in which r(v) is what a coastdown shows: nothing hidden, or
something that belongs to the hull. Of world A the cases before 539 are for choosing methods, of
world B the even ones; the others are for scoring. `--hidden` takes others too; `--each` prints
each run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks import _verbs
from benchmarks._asked import asked
from benchmarks._tables import table as markdown
from benchmarks.accuracy._coasts import rms
from benchmarks.accuracy.diagnosis_score import HALVES, drawn, half_of, write_bags
from benchmarks.worlds.hidden_b import cases as cases_b
from shipdrag_ros.simulation.effect import Scope
from shipdrag_ros.simulation.effects import LIBRARY

OWN = (
    'fouling', 'shallow_water', 'towed_cable', 'locked_propeller', 'windmilling_propeller',
    'displacement',
)  # fmt: skip
"""What is part of r(v), and nothing else beside it."""
ROWS = {
    Scope.HULL: 'hull', Scope.EARTH: 'weather', Scope.SENSOR: 'instrument', Scope.RUN: 'manoeuvre',
}  # fmt: skip
WIDE = 1.96


@dataclass(frozen=True)
class Score:
    """
    How the curve of a run compares with the true one.

    Attributes
    ----------
    case, run, hidden, condition
    rmse
        Over the curve, of the largest true r.
    cover
        Share of speeds at which the band of 95 % holds the truth.
    chi2
        Mean square of error over sigma.
    sigma
        Mean sigma, of the largest true r.
    cpu_s
    """

    case: int
    run: int
    hidden: str
    condition: str
    rmse: float
    cover: float
    chi2: float
    sigma: float
    cpu_s: float


def replay(ship: Path, bag: Path, estimator: str = 'one') -> dict[str, Any]:
    """
    Replay a bag with the public command and the estimator of a name.
    """
    parameters = bag.parent / 'estimator.yaml'
    parameters.write_text(f'estimator: {estimator}\n', encoding='utf-8')
    return _verbs.found('replay', str(bag), '--ship', str(ship), '--parameters', str(parameters))


def score(world: Any, number: int, run: int, found: dict[str, Any], cpu_s: float) -> Score | None:
    """
    Return the score of a run, None where no coastdown was found after its stop.
    """
    stop = world.stops_ns(number)[run]
    later = [each for each in found['coastdowns'] if each['end_ns'] > stop]
    if not later:
        return None
    best = max(later, key=lambda each: each['end_ns'] - max(stop, each['start_ns']))
    first = world.first_speed(number, run)
    speed, r, sigma = (
        np.array(best[name], np.float64) for name in ('speed_m_s', 'resistance_m_s2', 'sigma_m_s2')
    )
    use = (speed > 0.0) & (speed <= first) & np.isfinite(r) & np.isfinite(sigma)
    speed, r, sigma = speed[use], r[use], sigma[use]
    if len(speed) < 3:
        return None
    true = world.true_r(number, speed, run, calm=True)
    largest = float(true.max())
    error = r - true
    return Score(
        number,
        run,
        ' + '.join(world.names(number)) or 'nothing',
        str(world.condition(number)),
        rms(error) / largest,
        float(np.mean(np.abs(error) <= WIDE * sigma)),
        float(np.mean((error / sigma) ** 2)),
        float(np.mean(sigma)) / largest,
        cpu_s,
    )


def chosen(world: Any, half: str, hidden: str, first: int, count: int) -> list[int]:
    """
    Return numbers of cases: of a half, and of those with what is wanted hidden.
    """

    def wanted(number: int) -> bool:
        names = world.names(number)
        own = not names or (len(names) == 1 and names[0] in OWN)
        return {'own': own, 'nothing': not names, 'all': True}[hidden]

    return list(filter(wanted, half_of(world, half, first)))[:count]


def scored(
    world: Any, numbers: Sequence[int], estimator: str = 'one'
) -> Iterator[tuple[int, int, Score | None, str]]:
    """
    Yield case, run, score, and the error where the command failed.
    """
    for number in numbers:
        seen = world.observe(number)
        with TemporaryDirectory() as folder:
            ship, bags = write_bags(seen, Path(folder))
            for run, bag in enumerate(bags):
                start = time.process_time()
                try:
                    found = replay(ship, bag, estimator)
                    cpu_s = time.process_time() - start
                    yield number, run, score(world, number, run, found, cpu_s), ''
                except RuntimeError as error:
                    yield number, run, None, str(error)


def summary(scores: Sequence[Score], runs: int) -> dict[str, float]:
    """
    Return the figures of some runs.
    """
    if not scores:
        return {'runs': runs, 'with an estimate, %': 0.0}

    def of(name: str, mean: Callable[..., Any] = np.mean, part: float = 100.0) -> float:
        values = np.array([getattr(each, name) for each in scores])
        return part * float(mean(values[np.isfinite(values)]))

    def low(covers: np.ndarray) -> float:
        return float(np.mean(covers < 0.5))

    return {
        'runs': runs,
        'with an estimate, %': 100.0 * len(scores) / runs,
        'RMSE, % of the largest r': of('rmse', rms),
        'mean sigma, % of the largest r': of('sigma'),
        'cover of the 95 % band, %': of('cover'),
        'runs with cover below 50 %, %': of('cover', low),
        'chi^2, mean of runs': of('chi2', part=1.0),
        'CPU s a run, median': of('cpu_s', np.median, 1.0),
    }


def row_of(names: Sequence[str]) -> str:
    """
    Return the row of the report for what is hidden.
    """
    if len(names) != 1:
        return 'pair' if names else 'nothing hidden'
    return ROWS[LIBRARY[names[0]].scope] if names[0] in LIBRARY else 'stranger'


def table(
    rows: Sequence[tuple[int, int, Score | None, str]], names: Callable[[int], Sequence[str]]
) -> Iterator[str]:
    """
    Yield the lines of the report: all runs, and those of each row of what is hidden.
    """
    groups = {'all': list(rows)}
    for row in sorted(rows, key=lambda row: row_of(names(row[0]))):
        groups.setdefault(row_of(names(row[0])), []).append(row)
    columns = {
        name: summary([each for _, _, each, _ in part if each is not None], len(part))
        for name, part in groups.items()
    }
    heads = list(columns['all'])
    cells = (
        [name, *(f'{each[head]:.3g}' if head in each else '-' for head in heads)]
        for name, each in columns.items()
    )
    yield from markdown(['', *heads], cells)


def main(arguments: Sequence[str] | None = None) -> None:
    """
    Replay, score and print.
    """
    options = asked(
        __doc__, arguments, world=('b', 'a'), half=tuple(HALVES), hidden=('own', 'nothing', 'all'),
        first=0, count=40, seed=cases_b.SEED, estimator='one', each=False,
    )  # fmt: skip
    world = drawn(options.world, options.seed)
    numbers = chosen(world, options.half, options.hidden, options.first, options.count)
    rows = []
    for row in scored(world, numbers, options.estimator):
        rows.append(row)
        number, run, found, error = row
        if options.each:
            print(found or f'case {number} run {run}: {error or "no coastdown"}', flush=True)
    print(
        f'{len(numbers)} cases of world {options.world} from {options.first} on, '
        f'seed {world.SEED}, half {options.half}'
    )
    for error in sorted({error for *_, error in rows if error})[:5]:
        print(error)
    print(*table(rows, world.names), sep='\n')


if __name__ == '__main__':
    main()
