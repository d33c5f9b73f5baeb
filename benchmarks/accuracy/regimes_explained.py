# SPDX-License-Identifier: Apache-2.0
"""
How well the regimes explain the records that they were learnt on, and others.

Of each record: the mean log density of a reading of motion, over what the model expects of it.
The first table is `EXPLAINED` of the regimes; the others show what share of their records a
report would say is explained less well, which is 5, 25, 50, 75, 95 % where they are alike.

    python -m benchmarks.accuracy.regimes_explained [--learnt 1 3 5] [--others 73 75]
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks._asked import asked
from benchmarks.worlds.propulsion.cases import stops
from benchmarks.worlds.propulsion.score import SUITES
from benchmarks.worlds.propulsion.world import build, inputs
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import EndedCoastdown
from shipdrag_ros.coastdown.regimes.numbers import EXPLAINED_SHARE
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import in_arrival_order

SHOWN = (0.05, 0.25, 0.5, 0.75, 0.95)


def excesses(seeds: Sequence[int]) -> Iterator[tuple[float, float]]:
    """Yield excess and share said of each coastdown that is reported."""
    for seed in seeds:
        for case in stops(seed):
            world = build(case)
            for instruments in SUITES.values():
                monitor = Monitor(
                    world.ship, Parameters(), estimate=None, final=lambda window, _, __: window
                )
                block = in_arrival_order(inputs(world, instruments))
                for event in [*monitor.update(block), *monitor.finish()]:
                    if isinstance(event, EndedCoastdown) and event.regimes is not None:
                        yield event.regimes.excess, event.regimes.explained


def main() -> None:
    """Print both tables."""
    chosen = asked(__doc__, learnt=[1, 3, 5], others=[73, 75])
    learnt = np.array(list(excesses(chosen.learnt)))
    print(f'seeds {chosen.learnt}, {len(learnt)} coastdowns')
    for share, value in zip(
        EXPLAINED_SHARE, np.quantile(learnt[:, 0], EXPLAINED_SHARE), strict=True
    ):
        print(f'{share:.2f}  {value:+.3f} nats a reading')
    others = np.array(list(excesses(chosen.others)))[:, 1]
    print(f'seeds {chosen.others}, {len(others)} coastdowns: share said, at')
    for share, value in zip(SHOWN, np.quantile(others, SHOWN), strict=True):
        print(f'{share:.2f}  {value:.2f}')


if __name__ == '__main__':
    main()
