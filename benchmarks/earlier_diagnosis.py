# SPDX-License-Identifier: Apache-2.0
"""
Is a diagnosis better for the one of the day before? Paired, on the same hidden ships.

    python benchmarks/earlier_diagnosis.py --count 10

Ships of world a, with one effect of hull or instruments or with none. The first run is
diagnosed by itself, as of the day before, the second one alone and with that diagnosis: where
the effect is in both, gone in the second, new in it, and in neither. Printed is by how much
the log probability of the truth rises, with two standard errors, and the most that a wrong
diagnosis may cost by the model of how long effects last.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

os.environ.setdefault('OMP_NUM_THREADS', '1')  # before numpy
sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from diagnosis_score import as_block
from hidden import cases
from hidden.recording import BETWEEN_RUNS_NS, START_NS
from hidden.sailing import LEAD_IN_S

from shipdrag_ros.diagnosis import CoastRun, DiagnosisResult, diagnose
from shipdrag_ros.diagnosis.carried import carried
from shipdrag_ros.diagnosis.earlier import EarlierDiagnosis
from shipdrag_ros.diagnosis.facts import Facts
from shipdrag_ros.diagnosis.result import SeenRun
from shipdrag_ros.estimation import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.effects import ways_of
from shipdrag_ros.posterior.hypotheses import Explanation
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import LIBRARY

AGO_S = 86400.0
WAYS = ('in both', 'gone', 'new', 'in neither')
_LEAST = 1e-3  # probability of a truth that is not among the candidates, which hold 99 %


def numbers(count: int) -> Iterator[int]:
    """
    Yield cases of two runs with one effect that lasts, as many of each effect in turn.
    """
    found: dict[str, list[int]] = {}
    for number in range(cases.count()):
        truth = cases.reveal(number)
        lasts = truth.kind == 'one' and LIBRARY[truth.names[0]].lasts_s > 0.0
        if lasts and truth.condition.runs == 2 and not truth.condition.misstated:
            found.setdefault(truth.names[0], []).append(number)
    places = range(max(map(len, found.values())))
    every = [each[place] for place in places for each in found.values() if place < len(each)]
    yield from every[:count]


def diagnosed(
    seen: cases.Observation, run: int, earlier: Sequence[EarlierDiagnosis] = ()
) -> DiagnosisResult:
    """
    Diagnose one run by itself.
    """
    block = as_block(seen.runs[run])
    first_ns = START_NS + run * BETWEEN_RUNS_NS
    stop_ns = first_ns + round(LEAD_IN_S * 1e9)
    window = Window.from_block(block, stop_ns, int(block.stamp_ns.max()), before_ns=first_ns)
    ship = Ship.from_yaml(seen.ship_file, subject='ship file')
    runs = [CoastRun('run', window)]
    return diagnose(runs, ship, Parameters(), earlier=earlier, advise=False)


def log_probability(found: DiagnosisResult, names: Sequence[str]) -> float:
    """
    Return the log probability that an answer gives to what was hidden.
    """
    known = {each.names: each.probability for each in found.candidates}
    return float(np.log(max(known.get(tuple(names), 0.0), _LEAST)))


def trials(number: int) -> dict[str, tuple[float, float, float]]:
    """
    Return the log probability of the truth of a ship, in each of `WAYS`.

    Returns
    -------
    dict
        Without and with the diagnosis of before, and by how much less it may be
        where that one was wrong.
    """
    names = cases.reveal(number).names
    seen = {names: cases.observe(number), (): cases.observe_hiding(number, ())}
    ship = Ship.from_yaml(seen[names].ship_file, subject='ship file')
    before = {each: of_before(seen[each], ship) for each in seen}
    alone = {each: diagnosed(seen[each], 1) for each in seen}
    found = {}
    for way, (first, second) in zip(WAYS, ((names, names), (names, ()), ((), names), ((), ()))):
        with_before = diagnosed(seen[second], 1, [before[first]])
        found[way] = (
            log_probability(alone[second], second),
            log_probability(with_before, second),
            allowed(before[first], ship, alone[second], second),
        )
    return found


def of_before(seen: cases.Observation, ship: Ship) -> EarlierDiagnosis:
    """
    Diagnose the first run, as of the day before.
    """
    found = EarlierDiagnosis.of(diagnosed(seen, 0), ship, name='of the day before')
    return replace(found, runs=(SeenRun('run', found.last_ns - round(AGO_S * 1e9)),))


def allowed(
    before: EarlierDiagnosis, ship: Ship, now: DiagnosisResult, names: Sequence[str]
) -> float:
    """
    Return the log odds of the truth against what was likeliest before; 0 where it is that.
    """
    weight = carried([before], ship, now.runs, Facts(ship))
    assert weight is not None

    def of(names: Sequence[str], kept: bool) -> float:
        ways = (next(ways_of(LIBRARY[name], ship, 1.0, 1)) for name in names)
        return weight.log_weight(Explanation(tuple(replace(way, kept=kept) for way in ways)))

    likeliest = max(of(tuple(each.effects), True) for each in before.candidates)
    return min(max(of(names, False), of(names, True)) - likeliest, 0.0)


def line(way: str, rows: Sequence[tuple[float, float, float]]) -> str:
    """
    Say means and two standard errors.
    """
    alone, with_before, allowed = np.array(rows).T
    gain = with_before - alone
    twice = 2.0 * float(gain.std(ddof=1)) / len(gain) ** 0.5
    beyond = int((gain < allowed - 0.05).sum())
    return (
        f'{way}: {len(rows)} cases, {alone.mean():+.2f} alone, {gain.mean():+.2f} +- {twice:.2f} '
        f'with the diagnosis of before; worst {gain.min():+.2f}, {beyond} lower than the model '
        'allows'
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """
    Diagnose and print.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--count', type=int, default=36, help='cases, each in four ways')
    parser.add_argument('--processes', type=int, default=2)
    options = parser.parse_args(arguments)
    chosen = list(numbers(options.count))
    print(f'{len(chosen)} ships of world a, seed {cases.SEED}; log probability of the truth')
    with ProcessPoolExecutor(options.processes) as pool:
        rows = []
        for found in pool.map(trials, chosen):
            rows.append(found)
            print(f'{len(rows)} of {len(chosen)}', file=sys.stderr, flush=True)
    for way in WAYS:
        print(line(way, [each[way] for each in rows]))


if __name__ == '__main__':
    main()
