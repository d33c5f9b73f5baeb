# SPDX-License-Identifier: Apache-2.0
"""
Memory of the node over hours of simulated time.

Speed and position at 10 Hz with a coastdown every half hour, played over DDS
on loopback faster than life; recording all the while.
"""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np
from _onboard import SHIP_FILE, onboard
from geometry_msgs.msg import TwistWithCovarianceStamped

from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import (
    STOP,
    EngineOrder,
    Scenario,
    sense,
    simulate,
    standard_sensors,
)

SEED = 1
SPEED_M_S = 8.2
RATE_HZ = 10.0
HOURS = 3
STEP_S = 600.0  # between two readings of the memory
STOPPED_S, UNDER_WAY_S = 900.0, 900.0
MESSAGES_PER_S = 1500.0


def record() -> Block:
    """Speed and position of a ship that stops its engine again and again."""
    length_s = HOURS * 3600.0
    times = np.arange(0.0, length_s - UNDER_WAY_S, STOPPED_S + UNDER_WAY_S)
    orders = [
        order
        for time_s in times.tolist()
        for order in (
            EngineOrder(time_s, shaft=STOP.shaft, thrust=STOP.thrust),
            EngineOrder(time_s + STOPPED_S, shaft=1.0, thrust=1.0),
        )
    ]
    scenario = Scenario(
        speed_m_s=SPEED_M_S,
        lead_in_s=UNDER_WAY_S,
        duration_s=length_s - UNDER_WAY_S,
        orders=tuple(orders),
    )
    sensors = [
        sensor
        for sensor in standard_sensors(rate_hz=RATE_HZ)
        if sensor.channel in (Channel.SPEED_THROUGH_WATER, Channel.POSITION)
    ]
    return sense(simulate(Ship.load(SHIP_FILE), scenario), sensors, seed=SEED)


def main() -> None:
    """Print the memory as simulated time goes by."""
    block = record()
    time_s = (block.receive_ns - block.receive_ns[0]) * 1e-9
    print(
        f'{len(block)} messages, speed and position at {RATE_HZ:g} Hz, seed {SEED}; '
        f'{HOURS} h of simulated time'
    )
    print(f'{"hours":>6} {"memory MB":>10} {"estimates":>10} {"bag MB":>8}')
    estimates = 0

    def count(_: bytes) -> None:
        nonlocal estimates
        estimates += 1

    started = time.monotonic()
    with onboard(steady_s=600.0) as node:
        node.peer.create_subscription(
            TwistWithCovarianceStamped, '/coastdown_node/speed', count, 1000, raw=True
        )
        node.player.connect(block, timeout_s=60.0)
        edges = np.searchsorted(time_s, np.arange(0.0, HOURS * 3600.0 + STEP_S, STEP_S))
        for i, j in pairwise(edges.tolist()):
            node.player.play(block[i:j], speed=MESSAGES_PER_S / (2.0 * RATE_HZ))
            node.spin_for(1.0)
            memory_mb = node.process.memory_info().rss / 2**20
            bag_mb = sum(bag.stat().st_size for bag in node.directory.glob('*.mcap')) / 2**20
            print(
                f'{time_s[j - 1] / 3600.0:6.2f} {memory_mb:10.1f} {estimates:10d} {bag_mb:8.1f}',
                flush=True,
            )
    print(f'{time.monotonic() - started:.0f} s of life')


if __name__ == '__main__':
    main()
