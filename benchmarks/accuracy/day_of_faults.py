# SPDX-License-Identifier: Apache-2.0
"""
A day of simulated sailing with a fault of the log every hour, at the speed of a replay.

    python -m benchmarks.accuracy.day_of_faults --hours 24 --write

The ship of 150 m is sailed about as in `vouching`: courses, orders, stops, a tide of 1.5 m/s,
waves, a log that is some per cent off. Ten minutes of each hour the log is wrong, one kind an hour
in turn. Counted are the minutes in which the health of the inputs is green while the log is wrong,
and those in which it is not while nothing is, but for the five minutes after a fault: so long is
a source that was doubted held.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks import ROOT
from benchmarks._asked import asked
from benchmarks._tables import table
from benchmarks.accuracy.vouching import START_NS, by_seconds, sailing, ship_of, spoilt, well
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.node.health import InputStates
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Channel

PAGE = ROOT / 'docs' / 'results' / 'day_of_faults.txt'
KINDS = (
    'random', 'zero', 'constant', 'reversed', 'other axis', '20 % spikes', 'in knots', '0.5 times',
)  # fmt: skip
LENGTH_M, HOUR_S, BEGINS_S, LASTS_S, HELD_S = 150.0, 3600, 1800, 600, 330


def main() -> None:
    options = asked(__doc__, hours=24, seed=0, write=False)
    rng = np.random.default_rng(options.seed)
    block = sailing(options.seed, options.hours, LENGTH_M, 'lp', heading=True)
    second = (block.stamp_ns - START_NS) // SECOND_NS
    value = block.value.copy()
    for hour in range(options.hours):
        begins = hour * HOUR_S + BEGINS_S
        rows = (second >= begins) & (second < begins + LASTS_S)
        rows &= block.channel == Channel.SPEED_THROUGH_WATER
        value[rows, 0] = spoilt(KINDS[hour % len(KINDS)], value[rows, 0], rng)
    block = replace(block, value=value)
    monitor, states = Monitor(ship_of(LENGTH_M), Parameters(), estimate=None), InputStates()
    green, false = dict.fromkeys(KINDS, 0), dict.fromkeys(KINDS, 0)
    first: dict[int, int] = {}
    for at_s, part in enumerate(by_seconds(block)):
        monitor.update(part)
        sound = well(monitor, states, at_s)
        hour, since = at_s // HOUR_S, at_s % HOUR_S - BEGINS_S
        kind = KINDS[hour % len(KINDS)]
        if 0 <= since < LASTS_S:
            green[kind] += sound
            if not sound:
                first.setdefault(hour, since)
        elif since >= LASTS_S + HELD_S or (since < 0 and hour):
            # until the next one begins it is that of before
            false[kind if since > 0 else KINDS[(hour - 1) % len(KINDS)]] += not sound
    rows = []
    for place, kind in enumerate(KINDS):
        hours = range(place, options.hours, len(KINDS))
        seen = ', '.join(f'{first[h]}' if h in first else 'never' for h in hours)
        minutes = (f'{each[kind] / 60.0:.1f}' for each in (green, false))
        rows.append((kind, len(hours), seen, *minutes))
    wrong = options.hours * LASTS_S / 60.0
    head = (
        'the log', 'faults of 10 min', 'not green after [s]', 'green while wrong [min]',
        'not green later [min]',
    )  # fmt: skip
    lines = [
        *table(head, rows),
        '',
        f'Green in {sum(green.values()) / 60.0:.0f} of {wrong:.0f} minutes in which the log was '
        f'wrong; not green in {sum(false.values()) / 60.0:.0f} of '
        f'{options.hours * 60 - wrong:.0f} in which nothing was.',
    ]
    print('\n'.join(lines))
    if options.write:
        text = ['Made by `python -m benchmarks.accuracy.day_of_faults --write`.', '', *lines, '']
        PAGE.write_text('\n'.join(text), encoding='utf-8')


if __name__ == '__main__':
    main()
