# SPDX-License-Identifier: Apache-2.0
"""
Sizes that a coastdown would name, as said before the stop and as its own diagnosis has them.

    python -m benchmarks.accuracy.foretold_limits --world a --first 539 --count 12
    python -m benchmarks.accuracy.foretold_limits --world b --half odd --count 12 --seed 7

The first run of cases in which nothing is hidden: what the steady record foretells, over what is
found once she has coasted; quantiles over the cases. "one only": foretold or found, not both.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks._asked import asked
from benchmarks._tables import table
from benchmarks.accuracy.band_score import chosen
from benchmarks.accuracy.diagnosis_score import HALVES, drawn, write_bags
from benchmarks.worlds.hidden_b import cases as cases_b
from shipdrag_ros.bags import open_runs
from shipdrag_ros.diagnosis import CoastRun, diagnose
from shipdrag_ros.diagnosis.ahead import look_ahead
from shipdrag_ros.diagnosis.result import Limit
from shipdrag_ros.replay import coast_windows, replay

NEAR = 1.3
Pairs = dict[str, list[tuple[Limit, Limit]]]


def pairs_of(world: Any, numbers: Sequence[int]) -> Pairs:
    """
    Return the limits of each effect, foretold and found, by its name.
    """
    found: Pairs = defaultdict(list)
    for number in numbers:
        with TemporaryDirectory() as folder:
            _, bags = write_bags(world.observe(number), Path(folder))
            result = replay(*open_runs([bags[0]]))
            (_, window), *_ = coast_windows(result)
        if window.before is None or result.ship is None:
            continue
        ahead = look_ahead(window.before, result.ship, result.parameters)
        run = CoastRun('run', window)
        after = diagnose([run], result.ship, result.parameters, advise=False)
        for name in ahead.found.limits.keys() & after.limits.keys():
            found[name].append((ahead.found.limits[name], after.limits[name]))
    return found


def rows_of(pairs: Pairs) -> Iterator[list[str]]:
    """
    Yield the cells of each effect, and of all.
    """
    every: list[float] = []
    for name, of_effect in sorted(pairs.items()):
        sizes = [(one.would_be_named, other.would_be_named) for one, other in of_effect]
        ratio = [one / other for one, other in sizes if one and other]
        alone = sum((one is None) != (other is None) for one, other in sizes)
        bound = [one.value / other.value for one, other in of_effect]
        every += ratio
        yield [name, quantiles(bound), quantiles(ratio), str(len(ratio)), str(alone)]
    near = np.mean(np.abs(np.log(every)) <= np.log(NEAR))
    said = f'{quantiles(every)}; {100.0 * near:.0f} % within {NEAR}'
    yield ['all', '', said, str(len(every)), '']


def quantiles(ratio: Sequence[float]) -> str:
    """
    Return the tenth, the middle and the ninth of ten.
    """
    if not ratio:
        return '-'
    low, middle, high = np.quantile(ratio, [0.1, 0.5, 0.9])
    return f'{low:.2g} {middle:.2g} {high:.2g}'


def main(arguments: Sequence[str] | None = None) -> None:
    """
    Foretell, diagnose and print.
    """
    options = asked(
        __doc__, arguments, world=('b', 'a'), half=tuple(HALVES), first=0, count=12,
        seed=cases_b.SEED,
    )  # fmt: skip
    world = drawn(options.world, options.seed)
    numbers = chosen(world, options.half, 'nothing', options.first, options.count)
    print(f'{len(numbers)} cases of world {options.world} from {options.first} on, nothing hidden')
    heads = ['effect', 'upper_95, foretold over found', 'named from, the same', 'runs', 'one only']
    print(*table(heads, [*rows_of(pairs_of(world, numbers))]), sep='\n')


if __name__ == '__main__':
    main()
