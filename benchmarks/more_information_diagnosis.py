# SPDX-License-Identifier: Apache-2.0
"""
Does a diagnosis that is given more know more? Paired, on the same hidden ships.

    python benchmarks/more_information_diagnosis.py --count 20
    python benchmarks/more_information_diagnosis.py --world b --count 20

Cases of one bare run in which an effect of the library is hidden. Each is diagnosed as it is, and
with one thing more: a run on the reciprocal heading, each instrument, and in world b what the crew
knows. Printed is by how much the log probability of the truth rises, with two standard errors;
a mean below minus two of them contradicts that more information never makes it worse.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

os.environ.setdefault('OMP_NUM_THREADS', '1')  # before numpy
sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from diagnosis_score import WORLDS, diagnosis
from hidden import scoring

FACTS = 'facts'
_LEAST = 1e-3  # probability of a truth that is not among the candidates, which hold 99 %


def bare(world: str) -> Iterator[int]:
    """
    Yield the cases of one bare run in which something of the library is hidden.
    """
    hidden = WORLDS[world]
    for number in range(0, hidden.count(), 2 if world == 'b' else 1):
        truth = hidden.reveal(number)
        condition = truth.condition
        plain = condition.runs == 1 and not condition.context and not condition.misstated
        if plain and truth.kind in ('one', 'pair'):
            yield number


def log_probability(found: Mapping[str, Any], names: Sequence[str]) -> float:
    """
    Return the log probability that an answer gives to what was hidden.
    """
    for candidate, probability in scoring.parse(found).candidates:
        if candidate == tuple(names):
            return float(np.log(max(probability, _LEAST)))
    return float(np.log(_LEAST))


def gains(task: tuple[str, int]) -> dict[str, float]:
    """
    Return by how much each thing more raises the log probability of the truth of a case.
    """
    world, number = task
    hidden = WORLDS[world]
    names = hidden.reveal(number).names

    def of(*added: str, facts: bool = False) -> float:
        diagnose = diagnosis('command', 'bags', number, world, facts)
        return log_probability(diagnose(hidden.observe(number, added=added))[0], names)

    alone = of()
    found = {'as it is': alone, **{test: of(test) - alone for test in hidden.TESTS}}
    if world == 'b':
        found[FACTS] = of(facts=True) - alone
    return found


def lines(rows: Sequence[Mapping[str, float]]) -> Iterator[str]:
    """
    Yield mean and two standard errors of each thing more.
    """
    for name in rows[0]:
        values = np.array([row[name] for row in rows])
        mean = float(values.mean())
        twice = 2.0 * float(values.std(ddof=1)) / len(values) ** 0.5 if len(values) > 1 else np.inf
        judged = ''
        if name != 'as it is':
            judged = ', LOWER' if mean < -twice else ', not lower'
        yield f'{name}: {mean:+.2f} +- {twice:.2f}{judged}'


def main(arguments: Sequence[str] | None = None) -> None:
    """
    Diagnose and print.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--world', choices=tuple(WORLDS), default='a')
    parser.add_argument('--count', type=int, default=20)
    parser.add_argument('--processes', type=int, default=2)
    options = parser.parse_args(arguments)
    numbers = [number for number, _ in zip(bare(options.world), range(options.count))]
    with ProcessPoolExecutor(options.processes) as pool:
        rows = list(pool.map(gains, [(options.world, number) for number in numbers]))
    seed = WORLDS[options.world].SEED
    print(f'{len(rows)} cases of world {options.world}, seed {seed}; log probability of the truth')
    for line in lines(rows):
        print(line)


if __name__ == '__main__':
    main()
