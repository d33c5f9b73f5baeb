# SPDX-License-Identifier: Apache-2.0
"""
Coastdowns found and manoeuvres left alone, in one table; no r(v) is estimated.

Ships, propellers, engines, sea and instruments are those of `worlds/propulsion`, which shares
nothing with the package: every way to stop a propeller x three ships, a sea in turn, and
manoeuvres that are no coastdown; and, of another author, a ship that the sea makes
wander (`vouching`). Half an hour of one core for six seeds.

    python -m benchmarks.accuracy.regimes_found [--seeds 61 63 65]
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from benchmarks._asked import asked
from benchmarks._tables import table
from benchmarks.accuracy.vouching import LEAD_S, START_NS, faulty, ship_of
from benchmarks.worlds.propulsion.cases import others, stops
from benchmarks.worlds.propulsion.score import FEWER, SUITES, Row, score
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Channel

LOG, GROUND = Channel.SPEED_THROUGH_WATER, Channel.SPEED_OVER_GROUND
MIDDLE_S = 180.0
HEARD = {'log': [LOG], 'speed over ground': [GROUND], 'both': [LOG, GROUND]}


def of(some: list[Row], within_s: float) -> str:
    """Return how many are dated as near, of those that are found."""
    found = [row for row in some if row.found]
    return f'{sum(abs(row.dated_s) < within_s for row in found)} of {len(found)}'


def column(coasts: list[Row], none: list[Row]) -> list[str]:
    """Return the figures of one suite of inputs."""
    middle = [row for row in coasts if row.glide_s >= MIDDLE_S]
    late = [row.delay_s for row in coasts if row.found]
    announced = np.nanquantile(late, [0.5, 0.9]) if late else [np.nan, np.nan]
    return [
        f'{sum(row.found for row in coasts)} of {len(coasts)}',
        f'{sum(row.found for row in middle)} of {len(middle)}',
        f'{sum(row.found and row.long for row in coasts)} of {sum(row.long for row in coasts)}',
        of(coasts, 5.0),
        of(coasts, 20.0),
        f'{announced[0]:.0f}, {announced[1]:.0f}',
        f'{sum(row.wrong > 0 for row in none)} + '
        f'{sum(row.idle > 0 and not row.wrong for row in none)} of {len(none)}',
        f'{sum(row.wrong_live > 0 for row in none)} of {len(none)}',
        '{1:.3f}, {2:.3f} of {0:.1f} + {3:.1f}'.format(*_sure([*coasts, *none])),
    ]


def _sure(some: list[Row]) -> tuple[float, float, float, float]:
    """Return hours in which she is said to glide, shares expected and true, and hours besides."""
    said_s, expected_s, true_s, idle_s = np.sum([row.sure_s for row in some], axis=0).tolist()
    return said_s / 3600.0, expected_s / said_s, true_s / said_s, idle_s / 3600.0


def untrue(suites: dict[str, list[Row]]) -> list[list[str]]:
    """Return by kind of case how long she is said to glide, with 0.7 or more, and does not [s]."""
    seconds: dict[str, dict[str, float]] = defaultdict(lambda: dict.fromkeys(SUITES, 0.0))
    for suite, rows in suites.items():
        for row in rows:
            seconds[row.case.kind][suite] += row.sure_s[0] - row.sure_s[2]
    return [
        [kind, *(f'{each:.0f}' for each in of_kind.values())]
        for kind, of_kind in seconds.items()
        if any(of_kind.values())
    ]


def fewer(rows: list[Row], which: str) -> list[str]:
    """Return what an input more brings and costs: cases found by one set of inputs alone."""
    found = {(row.case, row.suite): row.found for row in rows}
    cells = []
    for less, more in FEWER:
        both = [(found[case, less], found[case, more]) for case in {row.case for row in rows}]
        gained = sum(b and not a for a, b in both)
        lost = sum(a and not b for a, b in both)
        error = float(np.sqrt(lost * (1.0 - lost / len(both))))
        cells.append([f'{less} -> {more}', gained, f'{lost} ± {error:.1f}', len(both)])
    return table((f'an input more, {which}', 'gained', 'lost, ± standard error', 'of'), cells)


NAMES = (
    'found', 'from 3 min', 'long ones', 'dated within 5 s', 'within 20 s',
    'announced after, median and 90 % [s]', 'no coastdowns left as one, + an idling screw',
    'announced that were none',
    'said to glide with 0.7 or more: expected, true, of so many hours + where nothing pushes',
)  # fmt: skip


def wandering(heard: list[Channel], seeds: int = 10) -> str:
    """Return how many glides of a ship that the sea makes wander are found in one piece."""
    whole = 0
    for seed in range(seeds):
        block = faulty('none', GROUND, seed=seed)
        monitor = Monitor(ship_of(60.0), Parameters(), estimate=None)
        events = [*monitor.update(block[np.isin(block.channel, heard)]), *monitor.finish()]
        ended = [event for event in events if hasattr(event, 'stands') and event.stands]
        spans = [((e.start_ns - START_NS) / SECOND_NS, e.end_ns - e.start_ns) for e in ended]
        whole += len(spans) == 1 and abs(spans[0][0] - LEAD_S) < 20.0 and spans[0][1] > 4e11
    return f'{whole} of {seeds}'


def main() -> None:
    """Run and print."""
    seeds = asked(__doc__, seeds=[61, 63, 65]).seeds
    coasts: dict[str, list[Row]] = defaultdict(list)
    none: dict[str, list[Row]] = defaultdict(list)
    for seed in seeds:
        for made, rows in ((stops, coasts), (others, none)):
            for case in made(seed):
                for row in score(case, SUITES, spans=True):
                    rows[row.suite].append(row)
    columns = [column(coasts[suite], none[suite]) for suite in SUITES]
    print(*table((f'seeds {seeds}', *SUITES), zip(NAMES, *columns, strict=True)), sep='\n')
    print()
    found = [row for rows in coasts.values() for row in rows]
    print(*fewer(found, f'seeds {seeds}'), '', sep='\n')
    rows = untrue({suite: [*coasts[suite], *none[suite]] for suite in SUITES})
    print(*table(('said to glide and does not [s]', *SUITES), rows), sep='\n')
    heard = [('', *map(wandering, HEARD.values()))]
    print('', *table(('a ship that wanders, in one piece', *HEARD), heard), sep='\n')


if __name__ == '__main__':
    main()
