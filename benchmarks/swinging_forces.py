# SPDX-License-Identifier: Apache-2.0
"""
Forces that swing: does a diagnosis say that something is there?

    python benchmarks/swinging_forces.py --skip 40 --count 40

Ships, weather and instruments of world a in which nothing of the library is hidden. A force that
begins to swing with or after the stop, by 5 to 25 % of the resistance there over 100 to 600 s, is
to be answered 'unknown'. The same swing before the stop already is weather, of which the steady
record shows: it is to pass for noise. The method was built on the first 40 ships; `--skip 40`
takes others.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import ClassVar

os.environ.setdefault('OMP_NUM_THREADS', '1')  # before numpy
sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from diagnosis_score import by_bags, command
from hidden import cases
from hidden.effect import Effect, Leg, Size
from hidden.hull import Array


@dataclass(frozen=True)
class _Swinging(Effect):
    """A force that swings from a moment on, a part of the coastdown after the stop."""

    share: float
    period_s: float
    moment: float
    phase: float

    name = 'swinging force'
    sizes = (
        Size('share', 0.05, 0.25),
        Size('period_s', 100.0, 600.0),
        Size('moment', 0.003, 0.15),
        Size('phase', 0.1, 6.3, signed=True),
    )
    always: ClassVar[bool] = False

    def force_n(self, leg: Leg, time: Array) -> Array:
        """Return the force."""
        force = self.share * float(leg.hull.still_n(np.array([leg.speed_m_s]))[0])
        start = self.moment * leg.duration_s
        swing = force * np.sin(2.0 * np.pi * (time - start) / self.period_s + self.phase)
        if self.always:
            return swing
        return swing * np.clip((time - start) / (0.1 * self.period_s), 0.0, 1.0)


class AfterTheStop(_Swinging):
    """Something that the crew would want to know of."""


class AllTheTime(_Swinging):
    """Weather."""

    name = 'swinging weather'
    always = True


KINDS: dict[str, tuple[type[Effect], ...]] = {
    'after the stop': (AfterTheStop,),
    'all the time': (AllTheTime,),
    'none': (),
}


def quiet() -> Iterator[int]:
    """
    Yield the cases in which nothing is hidden, and the baseline is as stated.
    """
    for number in range(cases.count()):
        truth = cases.reveal(number)
        if truth.kind == 'none' and not truth.condition.misstated:
            yield number


def answer(task: tuple[int, str]) -> str:
    """
    Return the verdict on a case with a swing of a kind; 'refused' where there is none.
    """
    number, kind = task
    try:
        found, _ = by_bags(command)(cases.observe_hiding(number, KINDS[kind]))
    except RuntimeError:  # what the verb says then
        return 'refused'
    return str(found['verdict'])


def line(number: int, kind: str, verdict: str) -> str:
    """
    Say what was hidden in a case, and what the answer was.
    """
    run_s = cases.known(number).duration_s
    sizes = [each.parameters() for each in cases.hiding(number, KINDS[kind])]
    swing = ''.join(
        f'{100.0 * size["share"]:.0f} % over {size["period_s"]:.0f} s, '
        f'{run_s / size["period_s"]:.1f} times, '
        for size in sizes
    )
    return f'  case {number}, {cases.condition(number)}: {swing}{verdict}'


def main(arguments: Sequence[str] | None = None) -> None:
    """
    Print how often each verdict is given, and the cases that are not answered as they should.
    """
    parser = argparse.ArgumentParser(description=(__doc__ or '').strip().splitlines()[0])
    parser.add_argument('--count', type=int, default=40, help='cases of each kind')
    parser.add_argument('--skip', type=int, default=0, help='of them, from the first on')
    parser.add_argument('--kinds', nargs='+', choices=tuple(KINDS), default=list(KINDS))
    parser.add_argument('--processes', type=int, default=2)
    options = parser.parse_args(arguments)
    numbers = list(islice(quiet(), options.skip, options.skip + options.count))
    tasks = [(number, kind) for kind in options.kinds for number in numbers]
    verdicts = []
    with ProcessPoolExecutor(options.processes) as pool:
        for (number, kind), verdict in zip(tasks, pool.map(answer, tasks)):
            verdicts.append(verdict)
            print(f'{kind},{line(number, kind, verdict)}', file=sys.stderr, flush=True)
    print(f'{len(numbers)} cases of each kind, {options.skip} skipped, seed {cases.SEED}')
    for kind in options.kinds:
        own = [(v, number) for v, (number, of) in zip(verdicts, tasks) if of == kind]
        said = Counter(verdict for verdict, _ in own)
        shares = ', '.join(f'{verdict} {n} of {len(numbers)}' for verdict, n in said.most_common())
        print(f'swinging, {kind}: {shares}')
        wanted = 'unknown' if kind == 'after the stop' else 'none'
        for verdict, number in own:
            if verdict != wanted:
                print(line(number, kind, verdict))


if __name__ == '__main__':
    main()
