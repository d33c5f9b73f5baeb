# SPDX-License-Identifier: Apache-2.0
"""
Forecasts in simulated worlds: how often the band of 90 % holds what followed.

    python -m benchmarks.accuracy.forecast_worlds --world a --first 539 --count 30
    python -m benchmarks.accuracy.forecast_worlds --world b --half odd --count 30 --seed 31

The priors of `forecast/` were chosen on world A, cases 0 to 59. Each first run is foretold after a
quarter, a third and a half of what is recorded, and compared at the speeds that a forecast speaks
of. `--write` puts the table of both worlds into docs/forecast.md.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks import ROOT
from benchmarks._asked import asked
from benchmarks._tables import put, table
from benchmarks.accuracy.diagnosis_score import HALVES, as_block, drawn, half_of
from shipdrag_ros.coastdown import validate
from shipdrag_ros.coastdown.running import too_vague
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.estimation import Window, estimate, estimate_final
from shipdrag_ros.forecast.followed import Followed
from shipdrag_ros.forecast.foretell import foretell
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Reason
from shipdrag_ros.ship import Ship

PAGE = ROOT / 'docs' / 'forecast.md'
KEPT = ROOT / 'benchmarks' / 'results' / 'forecast_worlds.json'
PARTS = (0.25, 1.0 / 3.0, 0.5)
Row = tuple[float, bool, float, float]


def rows(world: Any, number: int, parameters: Parameters) -> Iterator[Row]:
    """Yield of each figure of a case: part known, whether inside, score, error relative."""
    seen = world.observe(number)
    ship = Ship.from_yaml(seen.ship_file, subject=str(number))
    block = as_block(seen.runs[0])
    block = block[np.flatnonzero(validate(block, parameters, ship.length_m) == Reason.ACCEPTED)]
    stop_ns, end_ns = world.stops_ns(number)[0], int(block.stamp_ns.max())
    window = Window.from_block(block, stop_ns, end_ns, before_ns=int(block.stamp_ns.min()))
    followed = Followed.of(window, estimate_final(window, ship, Parameters()))
    slow = np.flatnonzero(followed.speed_m_s <= float(ship.speed(parameters.froude_min)))
    length_s = float(followed.time_s[slow[0] if len(slow) else -1])
    for part in PARTS:
        known = window.part(stop_ns, stop_ns + round(part * length_s * SECOND_NS))
        found = estimate(known, ship, parameters)
        if too_vague(found, parameters):
            continue
        forecast = foretell(found, ship, froude_min=parameters.froude_min)
        for pair in followed.beside(forecast, stop_ns).pairs:
            off = (pair.band.median - pair.was) / (pair.done + pair.was)
            yield part, pair.inside, pair.score, abs(off)


def line(label: str, cases: dict[int, list[Row]]) -> list[str]:
    """Return a line of the table; cases weigh alike."""
    cells = [label, str(len(cases))]
    for part in PARTS:
        held = [[row[1] for row in each if row[0] == part] for each in cases.values()]
        held = [each for each in held if each]
        shares = [np.mean(each) for each in held]
        cells.append(
            f'{np.mean(shares):.0%} ± {2.0 * np.std(shares) / np.sqrt(max(len(shares), 1)):.0%}'
        )
    everything = [row for each in cases.values() for row in each]
    cells.append(f'{np.mean([row[2] for row in everything]):.2f}')
    half = [row[3] for row in everything if row[0] == PARTS[-1]]
    cells.append(f'{100.0 * np.median(half):.1f}')
    return cells


def main() -> None:
    """
    Print a line of the table, and write all that are kept into the page if asked.
    """
    options = asked(
        __doc__, world=('a', 'b'), half=tuple(HALVES), first=539, count=30, seed=31,
        estimator='one', write=False,
    )  # fmt: skip
    world = drawn(options.world, options.seed)
    first = options.first if options.world == 'a' else 0
    cases: dict[str, dict[int, list[Row]]] = {'nothing hidden': {}, 'anything hidden': {}}
    for number in half_of(world, options.half, first)[: options.count]:
        hidden = 'anything hidden' if world.names(number) else 'nothing hidden'
        try:
            found = list(rows(world, number, Parameters(estimator=options.estimator)))
        except ShipdragError as error:
            print(f'{number}: {error}', flush=True)
            continue
        if found:
            cases[hidden][number] = found
    kept = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    for hidden, of in cases.items():
        if of:
            label = f'{options.world.upper()}, {hidden}, `{options.estimator}`'
            kept[label] = line(label, of)
            print(kept[label])
    head = ['world', 'cases', *(f'inside, after {part:.0%}' for part in PARTS)]
    head += ['score', 'median error at half [%]']
    if options.write:
        KEPT.write_text(json.dumps(kept, indent=1) + '\n')
        put(PAGE, {'worlds': '\n'.join(table(head, [kept[label] for label in sorted(kept)]))})


if __name__ == '__main__':
    main()
