# SPDX-License-Identifier: Apache-2.0
"""The page in a browser: how late a reading is in it, and how long a picture takes to draw."""

from __future__ import annotations

import shutil
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import sync_playwright

from benchmarks import ROOT
from shipdrag_ros.bags import open_runs
from shipdrag_ros.cli import main as shipdrag
from shipdrag_ros.live.app import LivePage
from shipdrag_ros.live.figures import LATE_S, LONGEST_S
from shipdrag_ros.live.serve import listen, serve
from shipdrag_ros.live.source import BagSource, NodeSource, PictureFeed
from shipdrag_ros.messages.topics import Samples
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship

SHIP = ROOT / 'config' / 'vitus_bering.yaml'
Milliseconds = np.ndarray[Any, np.dtype[np.float64]]
FLAGS = ['--no-sandbox', '--disable-gpu']
EVERY_S = 0.1
FIRST_S = 1_700_000_000
SHOWN = """
() => {
  window.seen = [];
  const figure = document.getElementById('figure-speed');
  const note = () => window.seen.push([Date.now(), parseFloat(figure.textContent)]);
  const all = {childList: true, characterData: true, subtree: true};
  new MutationObserver(note).observe(figure, all);
}
"""


@contextmanager
def in_browser(source: PictureFeed) -> Iterator[Any]:
    """Serve a page over a source, and yield it in Chromium."""
    ended = threading.Event()
    with listen('127.0.0.1', 0) as found, sync_playwright() as playwright:
        server = threading.Thread(
            target=serve, args=(LivePage(source), [found]), kwargs={'until': ended}
        )
        server.start()
        browser = playwright.chromium.launch(executable_path=shutil.which('chromium'), args=FLAGS)
        try:
            page = browser.new_page(viewport={'width': 1920, 'height': 1080})
            page.goto(f'http://127.0.0.1:{found.getsockname()[1]}/')
            yield page
        finally:
            browser.close()
            ended.set()
            server.join()


def sample_to_pixel_ms(count: int) -> Milliseconds:
    """Return how long after it was heard each reading stood in the page; NaN: it never did."""
    source = NodeSource()
    sent_s: dict[float, float] = {}
    with in_browser(source) as page:
        page.click('#units')  # m/s, two digits: each reading has a text of its own
        page.evaluate(SHOWN)
        for number in range(count):
            value = round(5.0 + 0.01 * number, 2)
            stamp_ns = (FIRST_S + number) * 10**9  # a second each: no mean with the last one
            sent_s[value] = time.time()
            source.hear(Samples(Block.of(Channel.SPEED_THROUGH_WATER, [stamp_ns], [value])))
            page.wait_for_timeout(1000.0 * EVERY_S)
        page.wait_for_timeout(1000)
        seen: dict[float, float] = {}
        for at_ms, value in page.evaluate('window.seen'):
            seen.setdefault(value, at_ms)
    return np.array([seen.get(value, np.nan) - 1000.0 * at for value, at in sent_s.items()])


def draw_ms(count: int) -> Milliseconds:
    """
    Return how long six hours, a curve with its band and a verdict take to be drawn.

    From their arrival in a page just opened, code not warm, to the screen.
    """
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / 'run.mcap'
        line = ['simulate', '--ship', str(SHIP), '-o', str(bag), '--speed', '8', '--seed', '1']
        line += ['--lead-in', '20700', '--duration', '900', '--effect', 'fouling=0.5']
        assert shipdrag(line) == 0
        source = BagSource(open_runs([bag]), speed=1000.0)
        try:
            with in_browser(source) as page:
                page.wait_for_selector('#verdict h3', timeout=200_000)
                return np.array([_opened_ms(page) for _ in range(count)])
        finally:
            source.close()


def _opened_ms(page: Any) -> float:
    page.reload()
    while (found := page.evaluate('window.shipdrag?.wholeMs')) is None:
        page.wait_for_timeout(20)
    return float(found)


def heap_mb(hours: int, speed: float) -> list[float]:
    """
    Return what the page's JavaScript holds after each hour, two days of history being full.

    Parameters
    ----------
    speed
        Seconds at 1 Hz in a second.
    """
    source = NodeSource(Ship.load(SHIP))
    found = []

    def hear(begin_s: int, end_s: int) -> None:
        stamps = np.arange(begin_s, end_s) * 1_000_000_000
        values = 8.0 + np.sin(np.arange(begin_s, end_s) / 500.0)
        for channel in (Channel.SPEED_THROUGH_WATER, Channel.SHAFT):
            source.hear(Samples(Block.of(channel, stamps, values)))

    # the readings of each input come after those of the other: a step is shorter than what is late
    step_s = min(round(speed * EVERY_S), LATE_S)
    hear(FIRST_S - LONGEST_S, FIRST_S)
    with in_browser(source) as page:
        tools = page.context.new_cdp_session(page)
        for second in range(0, hours * 3600, step_s):
            hear(FIRST_S + second, FIRST_S + second + step_s)
            page.wait_for_timeout(1000.0 * EVERY_S)
            if (second + step_s) % 3600 < step_s:
                for _ in range(3):  # once leaves what was young
                    tools.send('HeapProfiler.collectGarbage')
                found.append(tools.send('Runtime.getHeapUsage')['usedSize'] / 1e6)
    return found
