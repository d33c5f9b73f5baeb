# SPDX-License-Identifier: Apache-2.0
"""
How long an estimate takes to come, and what the node costs meanwhile.

Two processes over DDS on loopback. A simulated coastdown is played fast until it
is confirmed, then in real time while an estimate is asked for every second.
Latency runs from publishing the sample that makes an estimate due to hearing
`~/speed`; the processor time is that of the node alone.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import TwistWithCovarianceStamped

from benchmarks.speed._onboard import SHIP_FILE, Onboard, onboard
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, sense, simulate, standard_sensors

SEED = 1
SPEED_M_S = 8.2
LEAD_IN_S = 150.0
CONFIRMED_S = 120.0  # played fast, after the stop
MEASURED_S = 60.0  # played in real time
RATES_HZ = (1.0, 10.0, 100.0)
MESSAGES_PER_S = 1000.0  # while played fast, and no more than
SPEED_UP = 60.0
IDLE_S = 5.0


def record(rate_hz: float) -> Block:
    """Speed and position of a coastdown."""
    length_s = CONFIRMED_S + MEASURED_S
    scenario = Scenario(speed_m_s=SPEED_M_S, lead_in_s=LEAD_IN_S, duration_s=length_s)
    sensors = [
        sensor
        for sensor in standard_sensors(rate_hz=rate_hz)
        if sensor.channel in (Channel.SPEED_THROUGH_WATER, Channel.POSITION)
    ]
    return sense(simulate(Ship.load(SHIP_FILE), scenario), sensors, seed=SEED)


@dataclass(frozen=True)
class Sent:
    """What was published in real time: when, with which stamps, at which cost of the node."""

    times: list[float]
    stamps_ns: list[int]
    cpu_s: float


def live(node: Onboard, block: Block) -> Sent:
    """Publish each sample at its own time; simulated time a second ahead, once a second."""
    offsets_s = ((block.receive_ns - block.receive_ns[0]) * 1e-9).tolist()
    stamps_ns = block.stamp_ns.tolist()
    times: list[float] = []
    cpu_s, start, clock_s = node.cpu_s(), time.monotonic(), -1.0
    for i, offset_s in enumerate(offsets_s):
        node.spin_for(start + offset_s - time.monotonic())
        if offset_s >= clock_s + 1.0:
            clock_s = np.floor(offset_s)
            node.player.set_clock(int(block.receive_ns[0]) + int((clock_s + 1.0) * 1e9))
        times.append(time.monotonic())
        node.player.publish(block[i : i + 1])
    return Sent(times, stamps_ns, node.cpu_s() - cpu_s)


def measure(rate_hz: float) -> str:
    """One row of the table."""
    block = record(rate_hz)
    fast = (block.receive_ns - block.receive_ns[0]) < (LEAD_IN_S + CONFIRMED_S) * 1e9
    parameters = {
        'update_s': 1.0,
        'steady_s': 60.0,
        'slope_window_s': 30.0,
    }
    heard: list[tuple[float, int]] = []  # when, stamp [ns]

    def hear(message: TwistWithCovarianceStamped) -> None:
        stamp = message.header.stamp
        heard.append((time.monotonic(), stamp.sec * 10**9 + stamp.nanosec))

    with onboard(**parameters) as node:
        node.peer.create_subscription(
            TwistWithCovarianceStamped, '/coastdown_node/speed', hear, 1000
        )
        node.player.connect(block, timeout_s=60.0)
        idle_s = node.cpu_s()
        node.spin_for(IDLE_S)
        idle = (node.cpu_s() - idle_s) / IDLE_S
        node.player.play(block[fast], speed=min(SPEED_UP, MESSAGES_PER_S / (2.0 * rate_hz)))
        node.spin_for(5.0)
        heard.clear()
        sent = live(node, block[~fast])
        node.spin_for(1.0)
        busy = sent.cpu_s / MEASURED_S
        memory_mb = node.process.memory_info().rss / 2**20

    latency_ms = []
    for when, stamp_ns in heard:
        # an estimate of all samples up to a stamp is due at the first one after it
        i = int(np.searchsorted(sent.stamps_ns, stamp_ns, side='right'))
        if i < len(sent.times):
            latency_ms.append(1e3 * (when - sent.times[i]))
    if not latency_ms:
        raise SystemExit('no estimate was heard: is this machine too busy for the node?')
    median, high = np.percentile(latency_ms, [50, 99])
    return (
        f'{rate_hz:8g} {len(latency_ms):10d} {median:10.2f} {high:10.2f} {max(latency_ms):10.2f}'
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
