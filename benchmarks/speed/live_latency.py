# SPDX-License-Identifier: Apache-2.0
"""
Does the page delay the node? Latency of its estimates with and without 50 viewers, in one run.

    python -m benchmarks.speed.live_latency [--viewers 50] [--pairs 4] [--seconds 20]

One node, one coastdown in real time, an estimate each second. By turns nothing looks on, and a
page of its own process (`shipdrag watch`) with viewers who read every frame. The node goes on
meanwhile; what falls into a change from one to the other is left out. Latency runs from
publishing the sample that makes an estimate due to hearing `~/speed`.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from geometry_msgs.msg import TwistWithCovarianceStamped

from benchmarks.speed._onboard import SHIP_FILE, Onboard, onboard
from benchmarks.speed.live_page import read
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Scenario, sense, simulate, standard_sensors

SEED = 1
RATE_HZ = 10.0
LEAD_IN_S = 150.0
CONFIRMED_S = 120.0  # played fast, after the stop
LIVE_S = 700.0  # at most
SETTLE_S = 3.0
CATCH_UP_S = 120.0
PARAMETERS = {'update_s': 1.0, 'steady_s': 60.0, 'slope_window_s': 30.0}

Span = tuple[float, float]
"""Begin and end [s, steady clock]."""


def record() -> Block:
    """Speed and position of a coastdown."""
    scenario = Scenario(speed_m_s=8.2, lead_in_s=LEAD_IN_S, duration_s=CONFIRMED_S + LIVE_S)
    channels = (Channel.SPEED_THROUGH_WATER, Channel.POSITION)
    sensors = [each for each in standard_sensors(rate_hz=RATE_HZ) if each.channel in channels]
    return sense(simulate(Ship.load(SHIP_FILE), scenario), sensors, seed=SEED)


@contextmanager
def watched(viewers: int, seconds: float, log: Path) -> Iterator[None]:
    """Run the page with viewers who read all."""
    with log.open('w') as file:
        page = subprocess.Popen(
            [sys.executable, '-m', 'shipdrag_ros.cli', 'watch', '--port', '0'],
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=file,
        )
    try:
        while (found := re.search(r'http://127\.0\.0\.1:(\d+)', log.read_text())) is None:
            assert page.poll() is None, log.read_text()
            time.sleep(0.2)
        queue: multiprocessing.Queue[int] = multiprocessing.get_context('spawn').Queue()
        readers = multiprocessing.get_context('spawn').Process(
            target=read, args=(('127.0.0.1', int(found[1])), viewers, seconds, queue)
        )
        readers.start()
        time.sleep(SETTLE_S + 2.0)  # the process of the viewers has begun
        yield
        frames = queue.get(timeout=seconds + 30.0)
        readers.join()
        assert frames > viewers, 'the viewers saw nothing'
    finally:
        page.terminate()
        page.wait(timeout=30.0)


def take_turns(
    spans: dict[bool, list[Span]], pairs: int, viewers: int, seconds: float, ended: threading.Event
) -> None:
    """Note when somebody looked on, and when nobody did."""

    def note(looked: bool) -> None:
        begin_s = time.monotonic()
        time.sleep(seconds)
        spans[looked].append((begin_s, time.monotonic()))

    try:
        with tempfile.TemporaryDirectory() as folder:
            for number in range(pairs):
                print(f'turn {number + 1} of {pairs}', file=sys.stderr, flush=True)
                note(False)
                with watched(viewers, seconds + 2.0 * SETTLE_S + 2.0, Path(folder) / f'{number}'):
                    note(True)
                time.sleep(SETTLE_S)
    finally:
        ended.set()


def play(node: Onboard, block: Block, ended: threading.Event) -> tuple[list[float], list[int]]:
    """Publish each sample at its own time until all turns are over; times and stamps."""
    offsets_s = ((block.receive_ns - block.receive_ns[0]) * 1e-9).tolist()
    stamps_ns, times = block.stamp_ns.tolist(), []
    start, clock_s = time.monotonic(), -1.0
    for i, offset_s in enumerate(offsets_s):
        if ended.is_set():
            return times, stamps_ns
        node.spin_for(start + offset_s - time.monotonic())
        if offset_s >= clock_s + 1.0:
            clock_s = np.floor(offset_s)
            node.player.set_clock(int(block.receive_ns[0]) + int((clock_s + 1.0) * 1e9))
        times.append(time.monotonic())
        node.player.publish(block[i : i + 1])
    raise SystemExit(f'the record of {LIVE_S:g} s ended before the turns: fewer --pairs')


def measure(pairs: int, viewers: int, seconds: float) -> dict[bool, np.ndarray]:
    """Return latencies [ms] with nobody and with viewers."""
    block = record()
    fast = (block.receive_ns - block.receive_ns[0]) < (LEAD_IN_S + CONFIRMED_S) * 1e9
    heard: list[tuple[float, int]] = []

    def hear(message: TwistWithCovarianceStamped) -> None:
        stamp = message.header.stamp
        heard.append((time.monotonic(), stamp.sec * 10**9 + stamp.nanosec))

    spans: dict[bool, list[Span]] = {False: [], True: []}
    with onboard(**PARAMETERS) as node:
        node.peer.create_subscription(
            TwistWithCovarianceStamped, '/coastdown_node/speed', hear, 1000
        )
        node.player.connect(block, timeout_s=60.0)
        node.player.play(block[fast], speed=20.0)
        last_ns = int(block.stamp_ns[fast][-1])
        end_s = time.monotonic() + CATCH_UP_S
        while not heard or heard[-1][1] < last_ns - 2 * 10**9:  # what was played fast is behind
            assert time.monotonic() < end_s, 'the node does not catch up: a busy machine?'
            node.spin_for(0.5)
        node.spin_for(SETTLE_S)
        heard.clear()
        ended = threading.Event()
        turns = threading.Thread(
            target=take_turns, args=(spans, pairs, viewers, seconds, ended), daemon=True
        )
        turns.start()
        times, stamps_ns = play(node, block[~fast], ended)
        turns.join()
    found: dict[bool, list[float]] = {False: [], True: []}
    for when, stamp_ns in heard:
        # an estimate of all samples up to a stamp is due at the first one after it
        i = int(np.searchsorted(stamps_ns, stamp_ns, side='right'))
        for looked, of_it in spans.items():
            if i < len(times) and any(begin <= times[i] < end for begin, end in of_it):
                found[looked].append(1e3 * (when - times[i]))
    return {looked: np.array(late) for looked, late in found.items()}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--viewers', type=int, default=50)
    parser.add_argument('--pairs', type=int, default=4)
    parser.add_argument('--seconds', type=float, default=20.0)
    options = parser.parse_args()
    late = measure(options.pairs, options.viewers, options.seconds)
    print(
        f'an estimate each second at {RATE_HZ:g} Hz, {options.pairs} turns of '
        f'{options.seconds:g} s each; load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores'
    )
    print(f'{"who looks on":>24} {"estimates":>10} {"median ms":>10} {"p99 ms":>10}')
    for looked, name in ((False, 'nobody'), (True, f'a page, {options.viewers} viewers')):
        if not len(late[looked]):
            raise SystemExit('no estimate was heard: is this machine too busy for the node?')
        median, high = np.percentile(late[looked], [50, 99])
        print(f'{name:>24} {len(late[looked]):10d} {median:10.2f} {high:10.2f}')
    more = np.median(late[True]) - np.median(late[False])
    draws = np.random.default_rng(SEED)
    means = [
        np.median(draws.choice(late[True], len(late[True])))
        - np.median(draws.choice(late[False], len(late[False])))
        for _ in range(2000)
    ]
    low, high = np.percentile(means, [2.5, 97.5])
    print(
        f'median later by {more:.2f} ms with viewers (95 % by bootstrap: {low:.2f} to {high:.2f})'
    )


if __name__ == '__main__':
    main()
