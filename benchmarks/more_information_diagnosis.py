# SPDX-License-Identifier: Apache-2.0
"""
Does a diagnosis that is given more know more? Paired, on the same hidden ships.

    python benchmarks/more_information_diagnosis.py --world b --count 12
    python benchmarks/more_information_diagnosis.py --count 20

Cases of one bare run in which an effect of the library is hidden; of world b the even ones. Each
is diagnosed as it is and with more: further runs, each instrument, and in world b what the crew
knows. Printed is by how much the log probability of the truth rises on what each is held against,
with two standard errors; a mean below minus two of them contradicts that more information never
makes it worse. Answers are kept in a file; a run that was broken off goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

os.environ.setdefault('OMP_NUM_THREADS', '1')  # before numpy
sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from diagnosis_score import OUT, WORLDS, diagnosis
from hidden import scoring

_LEAST = 1e-3  # probability of a truth that is not among the candidates, which hold 99 %
_MOTION = ('speed_through_water', 'position')
_OTHER = ('wind_apparent', 'depth', 'heading', 'shaft', 'speed_over_ground')
_WITH = {'pitch': 'shaft'}  # what is read along with another


@dataclass(frozen=True)
class Given:
    """
    What a diagnosis is given: number of runs, instruments beside log and position, facts.

    Attributes
    ----------
    runs, instruments, facts
    against
        Names of what have less.
    """

    runs: int = 1
    instruments: tuple[str, ...] = ()
    facts: bool = False
    against: tuple[str, ...] = ('one run',)


GIVEN = {
    'one run': Given(against=()),
    'two runs': Given(2),
    'three runs': Given(3, against=('one run', 'two runs')),
    **{name: Given(instruments=(name,)) for name in _OTHER},
    'facts': Given(facts=True),
}


def given_of(world: str) -> dict[str, Given]:
    """
    Return what can be tried in a world: world a has two runs at most, and no facts.
    """
    return {
        name: given
        for name, given in GIVEN.items()
        if world == 'b' or (given.runs < 3 and not given.facts)
    }


def bare(world: str) -> Iterator[int]:
    """
    Yield the cases of one bare run in which something of the library is hidden.
    """
    hidden = WORLDS[world]
    for number in range(0, hidden.count(), 2 if world == 'b' else 1):
        condition = hidden.condition(number)
        plain = condition.runs == 1 and not condition.context and not condition.misstated
        if plain and hidden.reveal(number).kind in ('one', 'pair'):
            yield number


def everything(world: str, number: int) -> Any:
    """
    Return all that can be seen of a case.
    """
    hidden = WORLDS[world]
    more = (hidden.THIRD,) if world == 'b' else ()
    return hidden.observe(number, added=(*hidden.TESTS, *more))


def only(seen: Any, given: Given) -> Any:
    """
    Return what is left of an observation where less is given.
    """
    kept = {*_MOTION, *given.instruments}
    runs = [
        {name: series for name, series in run.items() if _instrument(name) in kept}
        for run in seen.runs[: given.runs]
    ]
    return replace(seen, runs=tuple(runs))


def _instrument(name: str) -> str:
    """Return the instrument of an input: `shaft_2` and `pitch` are of `shaft`."""
    name = name.removesuffix('_geodetic').removesuffix('_2')
    return _WITH.get(name, name)


def log_probability(found: Mapping[str, Any], names: Sequence[str]) -> float:
    """
    Return the log probability that an answer gives to what was hidden.
    """
    for candidate, probability in scoring.parse(found).candidates:
        if candidate == tuple(names):
            return float(np.log(max(probability, _LEAST)))
    return float(np.log(_LEAST))


def answers(task: tuple[str, int, Sequence[str]]) -> dict[str, Any]:
    """
    Return the log probability of the truth of a case with each thing given, and the answers.
    """
    world, number, wanted = task
    names = WORLDS[world].reveal(number).names
    seen = everything(world, number)
    row: dict[str, Any] = {'case': number, 'log_probability': {}, 'found': {}}
    for name in wanted:
        given = GIVEN[name]
        diagnose = diagnosis('command', 'bags', number, world, given.facts)
        found, _ = diagnose(only(seen, given))
        row['log_probability'][name] = log_probability(found, names)
        row['found'][name] = {key: found[key] for key in ('verdict', 'candidates')}
    return row


def lines(rows: Sequence[Mapping[str, float]], given: Mapping[str, Given]) -> Iterator[str]:
    """
    Yield mean log probability, and mean and two standard errors of what each brings.
    """
    yield '| given | log probability of the truth | against | gain | |'
    yield '|---|---|---|---|---|'
    for name, each in given.items():
        mean = f'{np.mean([row[name] for row in rows]):.2f}'
        if not each.against:
            yield f'| {name} | {mean} | | | |'
        for less in [name for name in each.against if name in given]:
            gains = np.array([row[name] - row[less] for row in rows])
            gain, twice = float(gains.mean()), np.inf
            if len(gains) > 1:
                twice = 2.0 * float(gains.std(ddof=1)) / len(gains) ** 0.5
            judged = 'LOWER' if gain < -twice else 'not lower'
            yield f'| {name} | {mean} | {less} | {gain:+.2f} ± {twice:.2f} | {judged} |'


def main(arguments: Sequence[str] | None = None) -> None:
    """
    Diagnose and print.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--world', choices=tuple(WORLDS), default='a')
    parser.add_argument('--skip', type=int, default=0, help='that many cases at the beginning')
    parser.add_argument('--count', type=int, default=20)
    parser.add_argument('--processes', type=int, default=2)
    parser.add_argument('--only', nargs='+', choices=tuple(GIVEN), help='all there is otherwise')
    parser.add_argument('--out', type=Path, help='answers, one line of JSON a case')
    options = parser.parse_args(arguments)
    given = given_of(options.world)
    if options.only is not None:
        given = {name: each for name, each in given.items() if name in options.only}
    out = options.out or OUT / f'more_information_{options.world}.jsonl'
    out.parent.mkdir(parents=True, exist_ok=True)
    kept = {}
    if out.exists():
        rows = map(json.loads, out.read_text(encoding='utf-8').splitlines())
        kept = {row['case']: row for row in rows if given.keys() <= row['log_probability'].keys()}
    numbers = list(islice(bare(options.world), options.skip, options.skip + options.count))
    tasks = [(options.world, number, list(given)) for number in numbers if number not in kept]
    with ProcessPoolExecutor(options.processes) as pool, out.open('a', encoding='utf-8') as file:
        for row in pool.map(answers, tasks):
            file.write(json.dumps(row) + '\n')
            file.flush()
            kept[row['case']] = row
    seed = WORLDS[options.world].SEED
    print(f'{len(numbers)} cases of world {options.world}, seed {seed}; natural logarithms')
    for line in lines([kept[number]['log_probability'] for number in numbers], given):
        print(line)


if __name__ == '__main__':
    main()
