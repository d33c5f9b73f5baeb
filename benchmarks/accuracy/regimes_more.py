# SPDX-License-Identifier: Apache-2.0
"""
What passes for a glide when nobody reads the shaft, bad readings, and what the regimes cost.

    python -m benchmarks.accuracy.regimes_more [--parts unseen readings cost] [--runs 60] [--write]

All by a log at 1 Hz on data/vitus_bering.yaml, white noise of 0.04 m/s and a slow error of
0.01 m/s over 30 s; r(v) is the final figure of each coastdown. Each part replaces its own in
docs/results/regimes_more.txt.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from benchmarks import ROOT
from benchmarks._asked import asked
from benchmarks._tables import put, table
from benchmarks.accuracy._coasts import CARGO, errors, rms
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import EndedCoastdown
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Block, Channel, Float64
from shipdrag_ros.simulation import START_NS, GaussMarkov, Scenario, Sensor, sense, simulate

PAGE = ROOT / 'docs' / 'results' / 'regimes_more.txt'
SHIP, LENGTH_S, LEAD_S = CARGO.ship, 3600, 1800.0
SLOWEST_M_S = float(SHIP.speed(Parameters().froude_min))
KINDS = {
    'glide': 'pure glide', 'astern': 'own engine astern within 40 s of the stop',
    'tug': "a tug's line from the stop on", 'steps': 'power off in four steps',
    'ramp': 'power down to 35 to 70 % over 5 to 40 min',
}  # fmt: skip


def sailed(kind: str, seed: int) -> tuple[Float64, tuple[float, float]]:
    """Return the speed at each second [m/s], and when she glides with nothing but the water."""
    rng = np.random.default_rng(1000 * list(KINDS).index(kind) + seed)
    first, stop = rng.uniform(5.0, 7.5), rng.uniform(700.0, 1100.0)
    speeds = np.linspace(0.0, 9.0, 400)
    force = np.asarray(SHIP.resistance_n(speeds))
    at_first = float(np.interp(first, speeds, force))
    time_s = np.arange(float(LENGTH_S))
    revs, held, gone = np.where(time_s > stop, 0.0, 1.0), np.zeros(LENGTH_S), stop
    if kind in ('astern', 'tug'):
        begins = stop + (rng.uniform(0.0, 40.0) if kind == 'astern' else 0.0)
        held[time_s > begins] = at_first * rng.uniform(
            *(0.3, 1.0) if kind == 'astern' else (0.1, 0.4)
        )
    elif kind == 'steps':
        revs[:] = 1.0
        for level in (0.75, 0.5, 0.25, 0.0):
            revs[time_s > gone] = level
            gone += rng.uniform(60.0, 300.0) if level else 0.0
    elif kind == 'ramp':
        lasts, low = rng.uniform(300.0, 2400.0), rng.uniform(0.35, 0.7)
        revs = np.clip(1.0 - (time_s - stop) / lasts * (1.0 - low), low, 1.0)
    mass, speed = SHIP.mass_kg * (1.0 + float(SHIP.n_r(first))), np.full(LENGTH_S, first)
    for k in range(1, LENGTH_S):
        now, turns = speed[k - 1], revs[k - 1]
        thrust = at_first * (1.8 * turns**2 - turns * now / first) / 0.8 if turns else 0.0
        pull = thrust - float(np.interp(now, speeds, force)) - held[k - 1]
        speed[k] = max(now + pull / mass, 0.0)
    if held.any():
        speed = speed[: int(np.argmax(speed < 0.3)) or LENGTH_S]
    slow = int(np.argmax(speed < SLOWEST_M_S)) or len(speed)
    return speed, (gone, float(slow) if kind in ('glide', 'steps') else gone)


def read(speed: Float64, seed: int) -> Block:
    rng = np.random.default_rng([seed, 1])
    time_s = np.arange(float(len(speed)))
    value = speed + GaussMarkov(0.01, 30.0).sample(time_s, rng) + rng.normal(0.0, 0.04, len(speed))
    stamps = START_NS + np.round(time_s * SECOND_NS).astype(np.int64)
    return Block.of(Channel.SPEED_THROUGH_WATER, stamps, value)


def watched(block: Block) -> list[EndedCoastdown]:
    """Return the coastdowns with an estimate."""
    monitor = Monitor(SHIP, Parameters(), estimate=None)
    events = [*monitor.update(block), *monitor.finish()]
    ended = [event for event in events if isinstance(event, EndedCoastdown) and event.stands]
    return [each for each in ended if each.estimate is not None]


def holds(ended: list[EndedCoastdown], begin_s: float, end_s: float) -> bool:
    """Say whether there is one, and it holds 80 % of a stretch."""
    if len(ended) != 1:
        return False
    first, last = ((at - START_NS) / SECOND_NS for at in (ended[0].start_ns, ended[0].end_ns))
    return bool(min(last, end_s) - max(first, begin_s) >= 0.8 * (end_s - begin_s))


def covered(ended: EndedCoastdown) -> float:
    """Return the share of the valid range in which two sigma hold the resistance alone."""
    assert ended.estimate is not None
    curve = ended.estimate.valid_curve
    off = curve.resistance_m_s2 - np.asarray(SHIP.resistance_n(curve.speed_m_s)) / SHIP.mass_kg
    return float(np.mean(np.abs(off) <= 2.0 * curve.sigma_m_s2))


def unseen(runs: int) -> list[str]:
    rows = []
    for kind, what in KINDS.items():
        reported = low = found = 0
        for seed in range(runs):
            speed, glide = sailed(kind, seed)
            ended = watched(read(speed, seed))
            reported += bool(ended)
            low += any(covered(each) < 0.5 for each in ended)
            found += glide[1] > glide[0] and holds(ended, *glide)
        rows.append((what, reported, low, found if glide[1] > glide[0] else 'no glide'))
        print(rows[-1], flush=True)
    return table((f'of {runs}, seeds 0 to {runs - 1}', 'reported', 'cover < half', 'found'), rows)


def readings(runs: int) -> list[str]:
    """Found, and RMSE of r(v) over that of the same records as they are."""
    truth = simulate(SHIP, Scenario(speed_m_s=8.2, lead_in_s=LEAD_S, duration_s=1500.0))
    log = Sensor(channel=Channel.SPEED_THROUGH_WATER, sd=0.05, coloured=GaussMarkov(0.02, 60.0))
    draw, after = np.random.default_rng(0), np.arange(3300.0) - LEAD_S
    bursts = np.convolve(draw.random(3300) < 0.002, np.ones(10), 'full')[:3300] > 0.0
    faults = {
        'as it is': lambda v: v,
        'zeros, 1 in 20': lambda v: np.where(draw.random(len(v)) < 0.05, 0.0, v),
        'bursts of 10 zeros, 1 in 50': lambda v: np.where(bursts, 0.0, v),
        'a zero 30 s after the stop': lambda v: np.where(after == 30.0, 0.0, v),
        'spikes of up to 6 m/s, 1 %': lambda v: (
            v + np.where(draw.random(len(v)) < 0.01, draw.uniform(-6.0, 6.0, len(v)), 0.0)
        ),
        'stuck for 60 s, 30 s after it': lambda v: np.where(
            (after >= 30.0) & (after < 90.0), v[1830], v
        ),
        'nothing for 30 s, 10 s before it': lambda v: np.where(
            (after >= -10.0) & (after < 20.0), np.nan, v
        ),
    }  # fmt: skip
    blocks, before, rows = [sense(truth, [log], seed=seed) for seed in range(runs)], {}, []
    for name, spoil in faults.items():
        found = {}
        for seed, block in enumerate(blocks):
            value = block.value.copy()
            value[:3300, 0] = spoil(value[:3300, 0])
            ended = watched(replace(block, value=value)[~np.isnan(value[:, 0])])
            if holds(ended, LEAD_S, LEAD_S + 1500.0):
                curve = ended[0].estimate.valid_curve
                found[seed] = rms(errors(curve, truth.specific_resistance)[0])
        before = before or found
        both = [seed for seed in found if seed in before]
        ratio = rms([found[s] for s in both]) / rms([before[s] for s in both])
        rows.append((name, f'{len(found) / runs:.0%}', f'{ratio:.2f}'))
        print(rows[-1], flush=True)
    return table((f'the log, {runs} records', 'found', 'RMSE, over that as it is'), rows)


def cost(runs: int) -> list[str]:
    """Processor time, by a linear fit over minutes asleep, awake and with an estimate."""
    truth = simulate(SHIP, Scenario(speed_m_s=8.2, lead_in_s=6 * 3600.0, duration_s=1500.0))
    log = Sensor(channel=Channel.SPEED_THROUGH_WATER, sd=0.05, coloured=GaussMarkov(0.02, 60.0))
    columns, times = [], []
    for seed in range(4):
        block, monitor = sense(truth, [log], seed=seed), Monitor(SHIP, Parameters(), estimate=None)
        for first in range(0, len(block), 60):
            was, began = bool(monitor.progress.probability), time.process_time()
            events = monitor.update(block[first : first + 60])
            if first + 60 >= len(block):
                events += monitor.finish()
            spent, awake = time.process_time() - began, bool(monitor.progress.probability)
            ends = sum(isinstance(event, EndedCoastdown) for event in events)
            if seed:  # the first compiles
                columns.append((30.0 * ((not was) + (not awake)), 30.0 * (was + awake), ends))
                times.append(spent)
    (asleep, awake, ends), *_ = np.linalg.lstsq(np.array(columns), np.array(times), rcond=None)
    lasts_s = float(np.array(columns)[:, 1].sum()) / 3.0
    year = 365.25 * 86400.0 * asleep + 52.0 * (lasts_s * awake + ends)
    return [
        f'asleep {1e6 * asleep:.1f} us, awake {1e6 * awake:.0f} us per second of record; a final '
        f'estimate {ends:.2f} s.',
        f'Extrapolated by these slopes: a year of one log at 1 Hz, with a coastdown each week, '
        f'{lasts_s:.0f} s awake, takes {year / 60.0:.1f} min of one core.',
    ]


def main() -> None:
    """Run, print and write."""
    parts = {'unseen': unseen, 'readings': readings, 'cost': cost}
    chosen = asked(__doc__, parts=list(parts), runs=60, write=False)
    for part in chosen.parts:
        made = '\n'.join([f'{part}, --runs {chosen.runs}', '', *parts[part](chosen.runs)])
        print(made, flush=True)
        if chosen.write:
            put(PAGE, {part: made})


if __name__ == '__main__':
    main()
