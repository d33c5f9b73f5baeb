# SPDX-License-Identifier: Apache-2.0
"""
Whether log and track vouch for each other: faults that are plausible numbers, and sound sailing.

    python -m benchmarks.accuracy.vouching --hours 4 --seed 0 --write

Each fault lasts from the first reading on; the engine stops after 20 minutes of steady sailing at
5 m/s. What counts is how soon a health is not green, how many seconds it is green after the first
minute all the same, when the log is left out, and whether the stop is found by what is sound. A
log in a wrong scale shows when she slows: before, a current may make the same difference.
Sound sailing has courses, engine orders and stops, a current of 1.5 m/s with the tide, waves and a
log that is off by 5 %: every contradiction that is said is a false alarm. With SHIPDRAG_DATA the
NMEA records in it are counted too.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import pairwise, product
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from benchmarks import ROOT
from benchmarks._asked import asked
from benchmarks._tables import table
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import Onset
from shipdrag_ros.messages.topics import OK
from shipdrag_ros.node.health import InputFacts, InputStates
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import (
    MOTION_INPUTS,
    SECOND_NS,
    Block,
    Channel,
    Float64,
    concatenate,
    in_arrival_order,
)
from shipdrag_ros.ship import Ship
from shipdrag_ros.sources.reading import read_any

PAGE = ROOT / 'docs' / 'results' / 'vouching.txt'
START_NS = 1_700_000_000 * SECOND_NS
LEAD_S, COAST_S = 1200, 600
LASTS_S = LEAD_S + COAST_S - 60
SCALES = {
    '0.4 times': 0.4, '0.5 times': 0.5, '0.6 times': 0.6, '0.7 times': 0.7, '1.4 times': 1.4,
    '1.5 times': 1.5, '1.7 times': 1.7, 'in knots': 3600.0 / 1852.0, '5 % high, current 1.5': 1.05,
    '5 % low, current 1.5': 0.95,
}  # fmt: skip
CURRENTS_M_S = {
    'current 1.5': 1.5, 'current 2.5': 2.5, 'current -1.5': -1.5, '5 % high, current 1.5': 1.5,
    '5 % low, current 1.5': 1.5,
}  # fmt: skip
FAULTS = (
    'random', 'zero', 'constant', 'reversed', 'other axis', '20 % spikes', 'position in km'
)  # fmt: skip
SOUND = ('none', *CURRENTS_M_S)
WRONG_SCALES = tuple(name for name in SCALES if name not in CURRENTS_M_S)
LENGTHS_M = (8.0, 60.0, 150.0)
INPUTS = ('ls', 'lp', 'lsp')  # log, speed over ground, position


def ship_of(length_m: float) -> Ship:
    """Return a ship of ordinary fullness."""
    volume = 0.0045 * length_m**3
    text = f'length_m: {length_m}\ndisplaced_volume_m3: {volume}\n'
    return Ship.from_yaml(text, subject='vouching')


def slow(rng: np.random.Generator, count: int, sd: float, time_s: float) -> Float64:
    """Return Gauss-Markov noise, one value a second."""
    keep = float(np.exp(-1.0 / time_s))
    steps = sd * np.sqrt(1.0 - keep**2) * rng.normal(size=count)
    steps[0] = 0.0
    return np.asarray(lfilter([1.0], [1.0, -keep], steps))


def filtered(values: Float64, time_s: float) -> Float64:
    """Return values through a first-order filter, one a second."""
    keep = float(np.exp(-1.0 / time_s))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])[0])


def spoilt(fault: str, log: Float64, rng: np.random.Generator) -> Float64:
    """Return what a log reads with a fault, or in a wrong scale."""
    count = len(log)
    nonsense = {
        'random': rng.uniform(0.0, 10.0, count),
        'zero': np.zeros(count),
        'constant': np.full(count, 3.0),
        'reversed': -log,
        'other axis': rng.normal(0.0, 0.1, count) + 0.1 * np.sin(np.arange(count) / 9.0),
        '20 % spikes': np.where(rng.random(count) < 0.2, rng.uniform(-30.0, 30.0, count), log),
    }
    return nonsense.get(fault, log * SCALES.get(fault, 1.0))


def faulty(fault: str, ground: Channel, *, seed: int = 0) -> Block:
    """
    Return the record of a coastdown with a fault from its first reading on.

    Parameters
    ----------
    fault
        One of `FAULTS`, `WRONG_SCALES` or `SOUND`.
    ground
        What is sound beside the log, `SPEED_OVER_GROUND` or `POSITION`.
    seed
        Of the noise.
    """
    rng = np.random.default_rng(seed)
    count = LEAD_S + COAST_S
    time_s = np.arange(count, dtype=np.float64)
    # about as friction and waves slow hulls of that length and volume
    speed = 5.0 / (1.0 + 5e-3 * np.maximum(time_s - LEAD_S, 0.0)) + slow(rng, count, 0.03, 60.0)
    log = spoilt(fault, speed + rng.normal(0.0, 0.03, count), rng)
    speed = speed + CURRENTS_M_S.get(fault, 0.0) + 0.005 * np.cumsum(rng.normal(size=count))
    track = np.column_stack([np.cumsum(speed), np.zeros(count)]) + rng.normal(0, 0.7, (count, 2))
    track *= 1e-3 if fault == 'position in km' else 1.0
    stamp_ns = START_NS + np.arange(count) * SECOND_NS
    value = track if ground is Channel.POSITION else speed + rng.normal(0.0, 0.03, count)
    parts = [Block.of(Channel.SPEED_THROUGH_WATER, stamp_ns, log)]
    return in_arrival_order([*parts, Block.of(ground, stamp_ns, value)])


def by_seconds(block: Block) -> Iterator[Block]:
    """Yield the readings of each second."""
    seconds = block.stamp_ns // SECOND_NS
    edges = np.flatnonzero(np.diff(seconds, prepend=-1, append=seconds[-1] + 1))
    for first, last in pairwise(edges.tolist()):
        yield block[first:last]


def judged(block: Block) -> tuple[int | None, int, int | None, list[float]]:
    """
    Return after how many seconds a health is not green, how many are green after a minute
    all the same, when an input is left out, and when stops were found [s].
    """
    monitor, states = Monitor(ship_of(60.0), Parameters(), estimate=None), InputStates()
    first, green, out, stops = None, 0, None, []
    for second, part in enumerate(by_seconds(block)):
        events = monitor.update(part)
        stops += [(e.start_ns - START_NS) / SECOND_NS for e in events if isinstance(e, Onset)]
        out = second if out is None and monitor.left_out() else out
        sound = well(monitor, states, second)
        if not sound and first is None:
            first = second
        green += sound and second >= 60
    return first, green, out, stops


def well(monitor: Monitor, states: InputStates, second: int) -> bool:
    """Return whether the health of every input is green at a second."""
    doubts = monitor.doubts()
    facts = [
        InputFacts(
            name,
            type=name,
            age_s=0.0,
            doubt=doubts.get(name, ''),
            total=counts,
        )
        for name, counts in monitor.counts().items()
        if counts.messages
    ]
    found = states.tick(facts, simulated=True, now_s=float(second))
    return all(each.finding.level == OK for each in found)


def engine(rng: np.random.Generator, count: int, length_m: float) -> tuple[Float64, Float64]:
    """Return speed through water [m/s] and course [rad] of a ship that is sailed about."""
    small = length_m < 20.0
    fastest, pace_s, rate = (3.0, 8.0, 0.15) if small else (6.0, 60.0, 0.02)
    speed, course = np.zeros(count), np.zeros(count)
    order = u = 0.8 * fastest
    angle = wanted = 0.0
    next_order = next_course = 0
    for i in range(count):
        if i >= next_order:
            drawn = rng.random()
            order = 0.0 if drawn < 0.2 else float(rng.uniform(0.3, 1.0)) * fastest
            order = -0.2 * fastest if drawn > 0.95 else order
            next_order = i + (90 if order < 0.0 else int(rng.uniform(300, 2400)))
        if i >= next_course:
            wanted = angle + float(rng.uniform(-np.pi, np.pi)) * (rng.random() < 0.8)
            next_course = i + int(rng.uniform(200, 2000))
        drag = u * abs(u) / (100.0 if small else 3000.0)
        u += (order - u) / pace_s if order else -drag
        angle += float(np.clip(wanted - angle, -rate, rate))
        speed[i], course[i] = u, angle
    return speed + slow(rng, count, 0.05, 60.0), course


def sailing(seed: int, hours: float, length_m: float, inputs: str, *, heading: bool) -> Block:
    """
    Return hours of sound readings, one a second.

    Parameters
    ----------
    inputs
        `l` for the log, `s` for the speed over ground, `p` for the position.
    """
    rng = np.random.default_rng(seed)
    count = round(3600 * hours)
    time_s = np.arange(count, dtype=np.float64)
    speed, course = engine(rng, count, length_m)
    strength = 1.5 * np.abs(np.cos(np.pi * time_s / 22357.0 + rng.uniform(0.0, 6.0)))
    whither = 2.0 * np.pi * time_s / 44714.0 + rng.uniform(0.0, 6.0)
    leeway, tide = slow(rng, count, 0.1, 120.0), slow(rng, count, 0.05, 600.0)
    waves = 0.3 * np.sin(2.0 * np.pi * time_s / 7.3 + slow(rng, count, 2.0, 30.0))
    ahead, aside = np.cos(course), np.sin(course)
    east = speed * ahead - leeway * aside + strength * np.cos(whither) + tide
    north = speed * aside + leeway * ahead + strength * np.sin(whither) + tide
    log = filtered((1.0 + rng.normal(0.0, 0.05)) * speed + waves, rng.uniform(1.0, 8.0))
    log += slow(rng, count, 0.05, 60.0) + rng.normal(0.0, 0.05, count)
    over = np.hypot(east + 0.5 * waves * ahead, north + 0.5 * waves * aside)
    ground = filtered(over + rng.normal(0.0, 0.1, count), rng.uniform(1.0, 4.0))
    track = np.column_stack([np.cumsum(east), np.cumsum(north)])
    track += np.column_stack([slow(rng, count, 2.0, 200.0), slow(rng, count, 2.0, 200.0)])
    readings = {
        'l': (Channel.SPEED_THROUGH_WATER, np.round(log / 0.0514) * 0.0514),
        's': (Channel.SPEED_OVER_GROUND, np.abs(ground)),
        'p': (Channel.POSITION, track + rng.normal(0.0, 0.8, (count, 2))),
        'h': (Channel.HEADING, course + rng.normal(0.0, 0.01, count)),
    }
    stamp_ns = START_NS + np.arange(count) * SECOND_NS
    used = inputs + 'h' * heading
    return in_arrival_order([Block.of(readings[k][0], stamp_ns, readings[k][1]) for k in used])


def alarms(block: Block, ship: Ship) -> list[tuple[int, str]]:
    """Return when a contradiction began to be said [s], and the words."""
    monitor, found, before = Monitor(ship, Parameters(), estimate=None), [], set()
    for part in by_seconds(block):
        monitor.update(part)
        said = {text for name, text in monitor.doubts().items() if name in MOTION_INPUTS}
        at_s = int(part.stamp_ns[-1] - block.stamp_ns[0]) // SECOND_NS
        found += [(at_s, text) for text in sorted(said - before)]
        before = said
    return found


def main() -> None:
    options = asked(__doc__, hours=4.0, seed=0, write=False)
    rows = []
    for fault in (*SOUND, *FAULTS, *WRONG_SCALES):
        for ground in (Channel.SPEED_OVER_GROUND, Channel.POSITION):
            if fault == 'position in km' and ground is not Channel.POSITION:
                continue
            first, green, out, stops = judged(faulty(fault, ground, seed=options.seed))
            near = [stop for stop in stops if abs(stop - LEAD_S) < 30.0]
            beside = ground.name.lower().replace('_', ' ')
            said, left = ('never' if at is None else f'after {at} s' for at in (first, out))
            rows.append((fault, beside, said, green, left, 'found' if near else 'missed'))
    head = (
        'the log', 'sound beside it', 'not green', f'green after a minute [s of {LASTS_S}]',
        'left out', 'stop',
    )  # fmt: skip
    lines = [*(__doc__ or '').splitlines()[5:12], '', *table(head, rows), '']
    number, sailed = 0, dict.fromkeys(LENGTHS_M, 0)
    for length_m, inputs, heading in product(LENGTHS_M, INPUTS, (True, False)):
        number += 1
        seed = options.seed + number
        block = sailing(seed, options.hours, length_m, inputs, heading=heading)
        sailed[length_m] += len(alarms(block, ship_of(length_m)))
    hours = options.hours * number
    each = ', '.join(f'{count} for {length_m:.0f} m' for length_m, count in sailed.items())
    lines.append(f'Contradictions said in {hours:.0f} h of sound sailing (simulated): {each}.')
    lines += _records()
    print('\n'.join(lines))
    if options.write:
        PAGE.write_text('\n'.join([*lines, '']), encoding='utf-8')


def _records() -> list[str]:
    """Return what is said of measured records."""
    lines = []
    for path in sorted(Path(os.environ.get('SHIPDRAG_DATA', '/nowhere')).glob('*.nmea.gz')):
        (run,) = read_any([path])
        block = concatenate([part for part in run.inputs() if isinstance(part, Block)])
        said = alarms(block, ship_of(10.0))
        hours = int(block.stamp_ns[-1] - block.stamp_ns[0]) / SECOND_NS / 3600.0
        words = '; '.join(f'{at_s} s: {text}' for at_s, text in said[:1])
        lines.append(f'{path.name}: {len(said)} in {hours:.1f} h {words}'.rstrip())
    return lines


if __name__ == '__main__':
    main()
