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

from benchmarks._asked import asked
from benchmarks.speed.live_page import read
from benchmarks.speed.node_latency import PARAMETERS, SEED, late_ms, onboard, record

RATE_HZ = 10.0
LIVE_S = 700.0  # at most
SETTLE_S = 3.0
CATCH_UP_S = 120.0

Span = tuple[float, float]
"""Begin and end [s, steady clock]."""


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


def measure(pairs: int, viewers: int, seconds: float) -> dict[bool, np.ndarray]:
    """Return latencies [ms] with nobody and with viewers."""
    fast, live = record(RATE_HZ, LIVE_S)
    spans: dict[bool, list[Span]] = {False: [], True: []}
    with onboard(**PARAMETERS) as node:
        received = node.subscribe()
        node.player.connect(fast, timeout_s=60.0)
        node.player.play(fast, speed=20.0)
        last_ns = int(fast.stamp_ns[-1])
        end_s = time.monotonic() + CATCH_UP_S
        while not received or received[-1][1] < last_ns - 2 * 10**9:  # played fast, and behind
            assert time.monotonic() < end_s, 'the node does not catch up: a busy machine?'
            node.spin_for(0.5)
        node.spin_for(SETTLE_S)
        received.clear()
        ended = threading.Event()
        turns = threading.Thread(
            target=take_turns, args=(spans, pairs, viewers, seconds, ended), daemon=True
        )
        turns.start()
        sent_s = node.play(live, ended.is_set)
        if not ended.is_set():
            raise SystemExit(f'the record of {LIVE_S:g} s ended before the turns: fewer --pairs')
        turns.join()
    late = late_ms(received, sent_s, live.stamp_ns)
    return {
        looked: np.array([ms for at, ms in late if any(begin <= at < end for begin, end in of_it)])
        for looked, of_it in spans.items()
    }


def main() -> None:
    """Print the table."""
    options = asked(__doc__, viewers=50, pairs=4, seconds=20.0)
    late = measure(options.pairs, options.viewers, options.seconds)
    print(
        f'an estimate each second at {RATE_HZ:g} Hz, {options.pairs} turns of '
        f'{options.seconds:g} s each; load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores'
    )
    print(f'{"who looks on":>24} {"estimates":>10} {"median ms":>10} {"p99 ms":>10}')
    for looked, name in ((False, 'nobody'), (True, f'a page, {options.viewers} viewers')):
        if not len(late[looked]):
            raise SystemExit('no estimate was received: is this machine too busy for the node?')
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
