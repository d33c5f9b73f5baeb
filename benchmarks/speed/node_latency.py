# SPDX-License-Identifier: Apache-2.0
"""
How long an estimate takes to come, and what the node costs meanwhile.

Two processes over DDS on loopback. A simulated coastdown is played fast until it
is confirmed, then in real time while an estimate is asked for every second.
Latency runs from publishing the sample that makes an estimate due to hearing
`~/speed`; the processor time is that of the node alone.
"""

from __future__ import annotations

import numpy as np

from benchmarks.speed._onboard import CONFIRMED_S, PARAMETERS, SEED, late_ms, onboard, record

MEASURED_S = 60.0  # played in real time
RATES_HZ = (1.0, 10.0, 100.0)
MESSAGES_PER_S = 1000.0  # while played fast, and no more than
SPEED_UP = 60.0
IDLE_S = 5.0


def measure(rate_hz: float) -> str:
    """One row of the table."""
    fast, live = record(rate_hz, MEASURED_S)
    with onboard(**PARAMETERS) as node:
        received = node.subscribe()
        node.player.connect(fast, timeout_s=60.0)
        idle_s = node.cpu_s()
        node.spin_for(IDLE_S)
        idle = (node.cpu_s() - idle_s) / IDLE_S
        node.player.play(fast, speed=min(SPEED_UP, MESSAGES_PER_S / (2.0 * rate_hz)))
        node.spin_for(5.0)
        received.clear()
        busy_s = node.cpu_s()
        sent_s = node.play(live)
        busy = (node.cpu_s() - busy_s) / MEASURED_S
        node.spin_for(1.0)
        memory_mb = node.process.memory_info().rss / 2**20
    late = late_ms(received, sent_s, live.stamp_ns)[:, 1]
    if not len(late):
        raise SystemExit('no estimate was received: is this machine too busy for the node?')
    median, high = np.percentile(late, [50, 99])
    return (
        f'{rate_hz:8g} {len(late):10d} {median:10.2f} {high:10.2f} {max(late):10.2f}'
        f' {100 * busy:9.1f} {100 * idle:9.1f} {memory_mb:11.0f}'
    )


def main() -> None:
    """Print the table."""
    print(
        f'simulated coastdown, speed and position at the rate given, seed {SEED}; an estimate '
        f'each second for {MEASURED_S:g} s, {CONFIRMED_S:g} s into the coastdown'
    )
    print(
        f'{"rate Hz":>8} {"estimates":>10} {"median ms":>10} {"p99 ms":>10} {"max ms":>10}'
        f' {"CPU %":>9} {"idle %":>9} {"memory MB":>11}'
    )
    for rate_hz in RATES_HZ:
        print(measure(rate_hz), flush=True)


if __name__ == '__main__':
    main()
