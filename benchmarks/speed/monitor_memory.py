# SPDX-License-Identifier: Apache-2.0
"""
Memory and speed of the monitor over a month at sea.

    python -m benchmarks.speed.monitor_memory --days 30

Days of steady sailing with a coastdown each day, log, position and heading once a second,
in blocks of an hour; seed 0. Then the same sequence rate at 10 and 100 Hz for speed alone.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import psutil

from benchmarks._asked import asked
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import EndedCoastdown, Update
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order
from shipdrag_ros.ship import Ship

START_NS = 1_700_000_000_000_000_000
HOUR_S = 3600


def hour(speed: Float64, first_s: float, way_m: float, rng: np.random.Generator) -> Block:
    """Read an hour at the given true speeds, evenly spaced."""
    n = len(speed)
    stamps = START_NS + np.round((first_s + np.arange(n) * (HOUR_S / n)) * 1e9).astype(np.int64)
    track = np.zeros((n, 2))
    track[:, 0] = way_m + np.cumsum(speed) * (HOUR_S / n)
    return in_arrival_order(
        [
            Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed + 0.05 * rng.standard_normal(n)),
            Block.of(Channel.POSITION, stamps, track + 10.0 * rng.standard_normal((n, 2))),
            Block.of(Channel.HEADING, stamps, 0.01 * rng.standard_normal(n)),
        ]
    )


def month(ship: Ship, days: int) -> None:
    rng = np.random.default_rng(0)
    monitor = Monitor(ship, Parameters())
    way, estimates, coastdowns, samples, busy_s = 0.0, 0, 0, 0, 0.0
    coast = np.maximum(0.0, np.arange(HOUR_S) - 1200.0)
    for day in range(days):
        for of_day in range(24):
            speed = np.full(HOUR_S, 8.2)
            if of_day == 12:
                speed = 8.2 / (1.0 + coast / 410.0)
            block = hour(speed, (day * 24 + of_day) * HOUR_S, way, rng)
            way += float(np.sum(speed))
            began = time.perf_counter()
            events = monitor.update(block)
            busy_s += time.perf_counter() - began
            samples += len(block)
            estimates += sum(isinstance(event, Update) for event in events)
            coastdowns += sum(isinstance(event, EndedCoastdown) for event in events)
        if day in (0, 1, 2) or day % 5 == 4:
            kept = held_bytes(monitor._memory) / 2**20
            resident = psutil.Process().memory_info().rss / 2**20
            print(
                f'day {day + 1:3d}: process {resident:6.1f} MiB, monitor {kept:5.2f} MiB,'
                f' {coastdowns} coastdowns, {estimates} estimates',
                flush=True,
            )
    print(f'{samples} samples in {busy_s:.1f} s, estimates included: {samples / busy_s:.3g}/s')


def held_bytes(part: Any) -> int:
    """Bytes of the arrays of a state, however deep they lie."""
    return part.nbytes if hasattr(part, 'nbytes') else sum(map(held_bytes, part))


def steady(ship: Ship, rate_hz: int) -> None:
    rng = np.random.default_rng(1)
    monitor = Monitor(ship, Parameters())
    blocks = []
    hours = max(1, 40 // rate_hz)
    for i in range(hours + 1):
        speed = np.full(HOUR_S * rate_hz, 8.2)
        blocks.append(hour(speed, i * HOUR_S, i * HOUR_S * 8.2, rng))
    monitor.update(blocks[0])
    began = time.process_time()
    for block in blocks[1:]:
        monitor.update(block)
    spent = time.process_time() - began
    samples = sum(len(block) for block in blocks[1:])
    print(f'steady, 3 inputs at {rate_hz:3d} Hz: {samples / spent / 1e6:5.2f} M samples/s')


def main() -> None:
    ship = Ship.example()
    month(ship, asked(__doc__, days=30).days)
    for rate_hz in (1, 10, 100):
        steady(ship, rate_hz)


if __name__ == '__main__':
    main()
