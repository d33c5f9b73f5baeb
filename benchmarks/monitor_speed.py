# SPDX-License-Identifier: Apache-2.0
"""
How many samples a second the monitor goes through.

    python benchmarks/monitor_speed.py [OTHER]

Steady sailing at 8.2 m/s with white noise (log 0.05 m/s, position 10 m, heading 0.01 rad, shaft
0.05 rad/s), seed 0, the same day over and over, in pieces of 65536 samples; then a year of one log
at 1 Hz with four coastdowns, found and estimated; then samples one by one, as they come live.
CPU time of the process. OTHER is the folder of another checkout to compare with: both are
measured in turn, three times each, and the best counts.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

import numpy as np

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import EndedCoastdown, Update
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship

START_NS = 1_700_000_000_000_000_000
DAY_S = 86400
DAY_NS = DAY_S * 1_000_000_000
PIECE = 1 << 16
SPEED_M_S = 8.2
ROUNDS = 3
LOG, POSITION, GEODETIC, HEADING, SHAFT = (
    Channel.SPEED_THROUGH_WATER,
    Channel.POSITION,
    Channel.POSITION_GEODETIC,
    Channel.HEADING,
    Channel.SHAFT,
)
MIXES = {
    'log, 1 Hz': ((LOG,), 1),
    'position alone, 1 Hz': ((GEODETIC,), 1),
    'log, position, heading, 1 Hz': ((LOG, POSITION, HEADING), 1),
    'log, position, heading, shaft, 1 Hz': ((LOG, POSITION, HEADING, SHAFT), 1),
    'log, position, heading, shaft, 10 Hz': ((LOG, POSITION, HEADING, SHAFT), 10),
}
LENGTHS = (1, 4, 16, 64)  # days, of the log


def day(channels: tuple[Channel, ...], rate_hz: int) -> Block:
    """Read a day of steady sailing."""
    rng = np.random.default_rng(0)
    n = DAY_S * rate_hz
    stamps = START_NS + np.arange(n) * (1_000_000_000 // rate_hz)
    blocks = []
    for channel in channels:
        noise = rng.standard_normal((n, 2))
        value = {
            LOG: SPEED_M_S + 0.05 * noise,
            HEADING: 0.01 * noise,
            SHAFT: 10.0 + 0.05 * noise,
        }.get(channel)
        if value is None:
            value = 10.0 * noise
            value[:, 0] += SPEED_M_S / rate_hz * np.arange(n)
            if channel is GEODETIC:
                value = np.array([0.0, 179.0]) + value / 111_195.0
        else:
            value = value[:, 0]
        blocks.append(Block.of(channel, stamps, value))
    return in_arrival_order(blocks)


def days(block: Block, number: int) -> Iterator[Block]:
    """Repeat a day, in pieces."""
    for i in range(number):
        shifted = Block(
            block.channel,
            block.stamp_ns + i * DAY_NS,
            block.receive_ns + i * DAY_NS,
            block.value,
            block.variance,
        )
        for first in range(0, len(block), PIECE):
            yield shifted[first : first + PIECE]


def spent(monitor: Monitor, blocks: Iterator[Block]) -> tuple[int, float]:
    """Return samples and CPU time [s] of going through them."""
    samples, seconds = 0, 0.0
    for block in blocks:
        began = time.process_time()
        monitor.update(block)
        seconds += time.process_time() - began
        samples += len(block)
    return samples, seconds


def year(ship: Ship) -> dict[str, float]:
    """Go through a year of one log, a coastdown each quarter."""
    steady = day((LOG,), 1)
    value = steady.value.copy()
    coast_s = np.maximum(0.0, np.arange(DAY_S) - 0.5 * DAY_S)
    value[:, 0] += np.where(coast_s < 1500.0, SPEED_M_S / (1.0 + coast_s / 410.0) - SPEED_M_S, 0.0)
    coast = Block(steady.channel, steady.stamp_ns, steady.receive_ns, value, steady.variance)
    monitor = Monitor(ship, Parameters())
    samples, coastdowns, estimates = 0, 0, 0
    seconds = 0.0
    for i in range(365):
        block = coast if i % 91 == 45 else steady
        shifted = Block(
            block.channel,
            block.stamp_ns + i * DAY_NS,
            block.receive_ns + i * DAY_NS,
            block.value,
            block.variance,
        )
        began = time.process_time()
        for event in monitor.update(shifted):
            coastdowns += isinstance(event, EndedCoastdown)
            estimates += isinstance(event, Update)
        seconds += time.process_time() - began
        samples += len(block)
    return {
        'samples': samples,
        'coastdowns': coastdowns,
        'estimates': estimates,
        'seconds': seconds,
    }


def measure() -> dict[str, dict[str, float]]:
    """Return samples a second of each mix, CPU time by length, a year, and one by one."""
    text = files('shipdrag_ros').joinpath('data/vitus_bering.yaml').read_text()
    ship = Ship.from_yaml(text, subject='example')
    rates = {}
    for name, (channels, rate_hz) in MIXES.items():
        block = day(channels, rate_hz)
        samples, seconds = spent(
            Monitor(ship, Parameters()), days(block, max(1, 3_000_000 // len(block)))
        )
        rates[name] = samples / seconds
    block = day((LOG,), 1)
    lengths = {
        str(number): min(
            spent(Monitor(ship, Parameters()), days(block, number))[1]
            for _ in range(max(1, 8 // number))
        )
        for number in LENGTHS
    }
    singles = (block[i : i + 1] for i in range(20_000))
    samples, seconds = spent(Monitor(ship, Parameters()), singles)
    rates['log, one by one'] = samples / seconds
    return {'rates': rates, 'lengths': lengths, 'year': year(ship)}


def best(folder: Path) -> dict[str, dict[str, float]]:
    """Measure a checkout in a process of its own."""
    found = subprocess.run(
        [sys.executable, __file__, '--measure'],
        env={**os.environ, 'PYTHONPATH': str(folder)},
        check=True,
        timeout=300,
        stdout=subprocess.PIPE,
    )
    return json.loads(found.stdout)


def main() -> None:
    if sys.argv[1:] == ['--measure']:
        print(json.dumps(measure()))
        return
    folders = [Path(__file__).parents[1], *map(Path, sys.argv[1:])]
    rounds = [[best(folder) for folder in folders] for _ in range(ROUNDS)]
    print(
        f'{"samples a second":40}' + ''.join(f'{name:>12}' for name in ('here', 'other', 'ratio'))
    )
    for name in rounds[0][0]['rates']:
        rates = [max(one[i]['rates'][name] for one in rounds) for i in range(len(folders))]
        print(f'{name:40}' + ''.join(f'{rate:12.3g}' for rate in rates), end='')
        print(f'{rates[0] / rates[1]:12.1f}' if len(rates) > 1 else '')
    for i, name in enumerate(('here', 'other')[: len(folders)]):
        seconds = [min(one[i]['lengths'][str(n)] for one in rounds) for n in LENGTHS]
        slope = np.polyfit(np.log(LENGTHS), np.log(seconds), 1)[0]
        whole = min((one[i]['year'] for one in rounds), key=lambda found: found['seconds'])
        print(
            f'{name}: CPU time grows as length to the {slope:.2f}, {LENGTHS[0]} to {LENGTHS[-1]}'
            f' days; a year, {whole["samples"]:.3g} samples, {whole["coastdowns"]} coastdowns with'
            f' {whole["estimates"]} estimates in {whole["seconds"]:.1f} s'
        )


if __name__ == '__main__':
    main()
