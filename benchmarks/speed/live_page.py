# SPDX-License-Identifier: Apache-2.0
"""
The page under load: how late a reading is, CPU for many viewers, connections refused, eight hours
of simulated time in memory.

    python -m benchmarks.speed.live_page [--viewers 50] [--connections 10000]

Readings come at 10 Hz and a frame is made for each. The server runs in this
process, the viewers in another; CPU is that of the server alone.
"""

from __future__ import annotations

import multiprocessing
import os
import resource
import socket
import threading
import time
from contextlib import suppress
from functools import partial

import numpy as np

from benchmarks._asked import asked
from shipdrag_ros.live.app import PAGE, LivePage
from shipdrag_ros.live.serve import CONNECTIONS, listen, server_of
from shipdrag_ros.live.source import NodeSource
from shipdrag_ros.messages.topics import Health, Samples, Status
from shipdrag_ros.samples import Block, Channel

ASK = b'GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n'
HISTORY_S = 6 * 3600


def feed(source: NodeSource, stop: threading.Event) -> None:
    """Send six hours at once, then a reading and a status at 10 Hz."""
    now_s = int(time.time())
    stamps = np.arange(now_s - HISTORY_S, now_s) * 1_000_000_000
    source.hear(Samples(Block.of(Channel.SPEED_THROUGH_WATER, stamps, np.full(len(stamps), 8.0))))
    values = {'lifecycle': 'active', 'monitor': 'steady', 'steady lead used at most [s]': '1800'}
    count = 0
    while not stop.wait(0.1):
        count += 1
        block = Block.of(Channel.SPEED_THROUGH_WATER, [time.time_ns()], [8.0 + 0.001 * count])
        source.hear(Samples(block))
        state = Status('node', 'state', 0, 'steady', {**values, 'steady lead [s]': f'{count}'})
        source.hear(Health((state,)))


def read(address: tuple[str, int], viewers: int, seconds: float, result: object) -> None:
    """Read streams in a process of its own, and count frames."""
    streams = [socket.create_connection(address) for _ in range(viewers)]
    for each in streams:
        each.sendall(ASK)
        each.setblocking(False)
    frames, end_s = 0, time.monotonic() + seconds
    while time.monotonic() < end_s:
        for each in streams:
            with suppress(BlockingIOError):
                frames += each.recv(1 << 20).count(b'event: ')
        time.sleep(0.02)
    result.put(frames)  # type: ignore[attr-defined]


def cpu_with(address: tuple[str, int], viewers: int, seconds: float) -> tuple[float, float]:
    """Return the share of a core that the server takes, and frames a viewer and second."""
    queue: multiprocessing.Queue[int] = multiprocessing.Queue()
    reader = multiprocessing.Process(target=read, args=(address, viewers, seconds, queue))
    reader.start()
    time.sleep(1.0)  # the whole pictures are out
    cpu_s, wall_s = time.process_time(), time.monotonic()
    time.sleep(seconds - 2.0)
    share = (time.process_time() - cpu_s) / (time.monotonic() - wall_s)
    frames = queue.get()
    reader.join()
    return share, frames / viewers / seconds


def connect(address: tuple[str, int], count: int) -> tuple[int, float]:
    """Open connections that ask nothing; return how many were closed, and the slowest look."""
    opened, closed, slowest = [], 0, 0.0
    for number in range(count):
        with suppress(OSError):
            each = socket.create_connection(address, timeout=5.0)
            each.setblocking(False)
            opened.append(each)
        if number % 500 == 499:
            time.sleep(0.05)
    time.sleep(0.5)
    for each in opened:
        try:
            closed += each.recv(64)[:12] in (b'', b'HTTP/1.1 503')
        except BlockingIOError:
            continue
        except OSError:
            closed += 1
    for each in opened:
        each.close()
    for _ in range(20):
        begin_s = time.monotonic()
        with socket.create_connection(address, timeout=5.0) as each:
            each.sendall(b'GET / HTTP/1.1\r\nHost: localhost\r\n\r\n')
            each.recv(1000)
        slowest = max(slowest, time.monotonic() - begin_s)
    return closed, slowest


def in_the_browser() -> None:
    """Print how late a reading is in the page, how long a picture takes, and what it holds."""
    from benchmarks.speed._live_browser import draw_ms, heap_mb, sample_to_pixel_ms

    late = sample_to_pixel_ms(300)
    half, most = np.nanpercentile(late, (50, 99))
    print(
        f'a reading heard to its figure in the page: median {half:.0f} ms, p99 {most:.0f} ms '
        f'({np.isfinite(late).sum()} of {len(late)} readings at 10 Hz)'
    )
    drawn = draw_ms(20)
    print(
        f'six hours, curve, band and verdict drawn in a page just opened: median '
        f'{np.median(drawn):.0f} ms, at most {drawn.max():.0f} ms (20 times)'
    )
    held = heap_mb(8, speed=600.0)
    print(
        '8 h at 600 times in the browser, two days of history: JavaScript heap after each hour '
        f'{", ".join(f"{each:.1f}" for each in held)} MB'
    )


def main() -> None:
    """Print the figures."""
    options = asked(__doc__, viewers=50, connections=10000, seconds=10.0)
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(65536, hard), hard))
    size = sum(path.stat().st_size for path in PAGE.rglob('*') if path.is_file())
    print(f'page: {size / 1000:.0f} kB')
    print(f'load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores')
    in_the_browser()
    source, ended = NodeSource(), threading.Event()
    page = LivePage(source)
    with listen('127.0.0.1', 0) as found:
        address = found.getsockname()
        serving = partial(server_of(page).run, [found])
        for target in (serving, partial(feed, source, ended)):
            threading.Thread(target=target, daemon=True).start()
        time.sleep(2.0)
        print(f'whole picture with six hours: {len(page.frames.whole()) / 1000:.0f} kB')
        for viewers in (1, options.viewers):
            share, rate = cpu_with(address, viewers, options.seconds)
            print(f'{viewers} viewers: {100 * share:.1f} % of a core, {rate:.1f} frames/s each')
        closed, slowest = connect(address, options.connections)
        print(
            f'{options.connections} connections at once that ask nothing: {closed} closed (limit '
            f'{CONNECTIONS}); then a page within {1000 * slowest:.0f} ms'
        )
        ended.set()
        time.sleep(0.5)


if __name__ == '__main__':
    main()
