# SPDX-License-Identifier: Apache-2.0
"""
How soon a coastdown is noticed, how surely it is known from others, how often in vain.

    python -m benchmarks.accuracy.onset --runs 200 --days 20

The ship is data/vitus_bering.yaml at 8.2 m/s, the speed log reads once a second with
white noise of 0.05 m/s and the slow wandering of the sea on top: sd 0.02 (calm), 0.07 (moderate)
and 0.13 m/s (rough), correlation time 60 s. The record starts 40 minutes before the event.
`--runs` of each kind and sea, seeds 0.., `--days` of steady sailing in each sea. Announced by
160 s or in all the record, which ends 7 min after the event; "left" are those that have not been
withdrawn by then. When histories in the same state became one and the announcement was set to
0.6, seeds 0 to 39 had been looked at. A slow-down has the same thrust at any speed, which few
screws have.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks._asked import asked
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import EndedCoastdown, Onset, State
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Block, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import (
    START_NS,
    EngineOrder,
    GaussMarkov,
    Scenario,
    Sensor,
    Truth,
    Turn,
    sense,
    simulate,
)

LEAD_IN_S = 2400
SEAS = {'calm': 0.02, 'moderate': 0.07, 'rough': 0.13}
COLOUR_S = 60.0
SHAFT = Sensor(channel=Channel.SHAFT, sd=0.05)
COMPASS = Sensor(channel=Channel.HEADING, sd=0.01)


def log(sea: str) -> Sensor:
    return Sensor(
        channel=Channel.SPEED_THROUGH_WATER, sd=0.05, coloured=GaussMarkov(SEAS[sea], COLOUR_S)
    )


def no_estimate(window: Window, ship: Ship, parameters: Parameters) -> Estimate:
    raise EstimationError('only the onset matters here')


@dataclass(frozen=True)
class Found:
    """Seconds after the event; NaN where it was not noticed or not announced."""

    noticed_s: float
    started_s: float
    announced_s: float
    left: bool
    """A coastdown stands at the end of the record."""


def find(ship: Ship, block: Block) -> Found:
    """Watch one record, second by second from the event on."""
    monitor = Monitor(ship, Parameters(), estimate=no_estimate, final=no_estimate)
    event_ns = START_NS + LEAD_IN_S * SECOND_NS
    first = int(np.searchsorted(block.stamp_ns, event_ns))
    monitor.update(block[:first])
    noticed = started = announced = np.nan
    left = False
    seconds = np.arange(event_ns, int(block.stamp_ns[-1]), SECOND_NS)
    edges = np.searchsorted(block.stamp_ns, seconds)
    for now_ns, a, b in zip(seconds, edges, [*edges[1:], len(block)], strict=True):
        events = monitor.update(block[a:b])
        if now_ns == seconds[-1]:
            events += monitor.finish()
        after_s = (now_ns - event_ns) / SECOND_NS
        if np.isnan(noticed) and monitor.state is State.CANDIDATE:
            noticed = after_s
        for event in events:
            if isinstance(event, Onset) and np.isnan(announced):
                started, announced = (event.start_ns - event_ns) / SECOND_NS, after_s
            left |= isinstance(event, EndedCoastdown) and event.stands
    return Found(noticed, started, announced, left)


def truths(ship: Ship) -> dict[str, Truth]:
    """Simulate what happens; the sea is in the sensor."""
    # 1.2 times its own resistance on top, as hard over
    turn = Turn(0.0, 180.0, np.radians(0.8), drag_area_m2=14.0)
    kinds = {
        'coastdown': {},
        'turn': {'orders': (), 'turns': (turn,)},
        'slow-down to 70 %': {'orders': (EngineOrder(0.0, shaft=0.7, thrust=0.49),)},
        'slow-down to 50 %': {'orders': (EngineOrder(0.0, shaft=0.5, thrust=0.25),)},
    }
    return {
        kind: simulate(
            ship, Scenario(speed_m_s=8.2, lead_in_s=LEAD_IN_S, duration_s=420.0, **events)
        )
        for kind, events in kinds.items()
    }


def false_alarms(ship: Ship, sea: str, days: int) -> int:
    """Count how often steady sailing was taken for a candidate."""
    monitor = Monitor(ship, Parameters(), estimate=no_estimate, final=no_estimate)
    rng = np.random.default_rng(7)
    seconds = days * 86400
    speed = (
        8.2
        + 0.05 * rng.standard_normal(seconds)
        + GaussMarkov(SEAS[sea], COLOUR_S).sample(np.arange(float(seconds)), rng)
    )
    count, was = 0, False
    for first in range(0, seconds, 10):
        stamps = START_NS + np.arange(first, first + 10) * SECOND_NS
        monitor.update(Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed[first : first + 10]))
        now = monitor.state in (State.CANDIDATE, State.COASTDOWN)
        count += now and not was
        was = now
    return count


def spread(values: list[float]) -> str:
    """Return median and 90 % of all runs; those without count as never."""
    never = np.where(np.isnan(values), np.inf, values)
    middle, most = np.percentile(never, [50, 90], method='higher')
    return f'{middle:5.0f} {most:6.0f}'


def main() -> None:
    options = asked(__doc__, runs=200, days=20)
    runs, days, ship = options.runs, options.days, Ship.example()
    happenings = truths(ship)
    print(f'N = {runs} runs each, seeds 0..{runs - 1}; times in s after the event')
    print(
        f'{"event":18} {"inputs":20} {"sea":9} {"noticed 50 %":>12} {"90 %":>4}'
        f' {"start error":>14} {"by 160 s":>9} {"in all":>7} {"left":>7}'
    )
    for kind, truth in happenings.items():
        for more in ((), (COMPASS,), (SHAFT,)):
            if bool(more) and (more[0] is COMPASS) != (kind == 'turn'):
                continue
            for sea in SEAS:
                found = [
                    find(ship, sense(truth, (log(sea), *more), seed=seed, start_ns=START_NS))
                    for seed in range(runs)
                ]
                announced = np.array([one.announced_s for one in found])
                started = np.array([one.started_s for one in found])
                known = started[~np.isnan(started)]
                error = f'{known.mean():6.1f} ± {known.std():4.1f}' if len(known) else '-'
                names = ', '.join(['log', *(sensor.channel.input for sensor in more)])
                print(
                    f'{kind:18} {names:20} {sea:9} {spread([one.noticed_s for one in found]):>15}'
                    f' {error:>15} {np.mean(announced <= 160.0):9.1%}'
                    f' {np.mean(~np.isnan(announced)):7.1%}'
                    f' {np.mean([one.left for one in found]):7.1%}',
                    flush=True,
                )
    print(f'false alarms a day of steady sailing, {days} days, asked for: 0.1')
    for sea in SEAS:
        count = false_alarms(ship, sea, days)
        print(f'{sea:9} {count:4d} in {days} days: {count / days:.2f} a day', flush=True)


if __name__ == '__main__':
    main()
