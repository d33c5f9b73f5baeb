# SPDX-License-Identifier: Apache-2.0
"""
Makes the pictures of pages in docs/pictures: bridge*.png, diagnosis.png and fleet.png.

    python docs/screenshots.py [bridge] [diagnosis] [fleet] [--store STORE]

By Chromium, from simulated bags. The bridge and the diagnosis take a minute, the fleet some
minutes.
"""

from __future__ import annotations

import argparse
import os
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from shipdrag_ros.bags import open_runs
from shipdrag_ros.cli import main as shipdrag
from shipdrag_ros.live.app import LivePage
from shipdrag_ros.live.serve import listen, serve
from shipdrag_ros.live.source import BagSource

ROOT = Path(__file__).parents[1]
PICTURES = ROOT / 'docs' / 'pictures'
SHIP = ROOT / 'config' / 'vitus_bering.yaml'
SENSORS = 'speed_through_water,position,heading,shaft,speed_over_ground,rudder,wind_apparent,depth'
FLAGS = ['--no-sandbox', '--disable-gpu']
WIDTH = 1200
LARGEST_BYTES = 200_000


def coastdown(folder: Path, seed: int, *more: str) -> Path:
    """Simulate a coastdown of a ship that has fouled."""
    bag = folder / f'run{seed}.mcap'
    line = ['simulate', '--ship', str(SHIP), '-o', str(bag), '--seed', str(seed), '--speed', '8']
    line += ['--lead-in', '1800', '--duration', '1200', '--inputs', SENSORS]
    run(*line, '--effect', 'fouling=0.5', *more)
    return bag


def run(*line: str) -> None:
    """Run a verb; a fleet that has skipped a bag is fine."""
    if shipdrag(line) not in ((0, 1) if line[0] == 'fleet' else (0,)):
        raise SystemExit(f'failed: {" ".join(line)}')


@contextmanager
def played(bags: list[Path]) -> Iterator[tuple[str, BagSource]]:
    """Serve the page over bags that have been played to the last verdict."""
    source, ended = BagSource(open_runs(bags), speed=1000.0), threading.Event()
    with listen('127.0.0.1', 0) as found:
        server = threading.Thread(
            target=serve, args=(LivePage(source), [found]), kwargs={'until': ended}
        )
        server.start()
        try:
            while (player := source.player()) and player['playing']:
                time.sleep(0.2)
            yield f'http://127.0.0.1:{found.getsockname()[1]}/', source
        finally:
            ended.set()
            server.join()
            source.close()


def bridge(folder: Path, open_page: Callable[..., Page]) -> None:
    """The second run of a pair: before the stop, seven minutes after it, and at its end."""
    first = coastdown(folder, 1, '--start', '2026-06-01T08:00:00')
    heading = ('--heading', '3.1416', '--first-heading', '0')
    second = coastdown(folder, 2, *heading, '--start', '2026-06-01T09:30:00')
    with played([first, second]) as (url, source):
        page = open_page(url, height=1400)
        page.wait_for_selector('#verdict h3', timeout=120_000)
        player = source.player()
        assert player is not None
        save(page, 'bridge_after.png')
        for at_s, said, name in ((1500, 'STEADY', 'bridge_before'), (2220, 'COAST', 'bridge')):
            # over the wire: the page's own thread reads on
            page.request.post(
                f'{url}player', data={'action': 'seek', 'value': player['start_s'] + at_s}
            )
            page.locator('#headline', has_text=said).wait_for()
            page.wait_for_timeout(1000)
            save(page, f'{name}.png')


def diagnosis(folder: Path, open_page: Callable[..., Page]) -> None:
    """Fouling, named from a pair of runs and what the log book knows."""
    os.chdir(folder)  # the page names the bags as they were given
    bags = [coastdown(Path(), 3, '--start', '2026-06-01T08:00:00')]
    heading = ('--heading', '3.1416', '--first-heading', '0')
    bags.append(coastdown(Path(), 4, *heading, '--start', '2026-06-01T10:00:00'))
    facts = [f'--fact={fact}' for fact in ('no_towed_cable', 'draughts_read', 'shaft=free')]
    report = Path('diagnosis.html').absolute()
    run('diagnose', *map(str, bags), *facts, '--report', str(report))
    save(open_page(report.as_uri(), height=1180), 'diagnosis.png')


def fleet(folder: Path, open_page: Callable[..., Page], store: Path | None) -> None:
    """A year of three ships."""
    bags, report = folder / 'fleet', folder / 'fleet.html'
    if store is None:
        store = folder / 'store'
        run('simulate-fleet', '-o', str(bags), '--ships', '3', '--seed', '7', '--sound')
        run('fleet', str(bags), '-o', str(store), '--workers', '1')
    run('trend', str(store), '--report', str(report))
    save(open_page(report.as_uri(), height=1100), 'fleet.png')


def save(page: Page, name: str) -> None:
    """Write what stands on the screen."""
    path = PICTURES / name
    page.screenshot(path=path)
    with Image.open(path) as image:
        image.convert('RGB').quantize(128).save(path, optimize=True)
    size = path.stat().st_size
    if size > LARGEST_BYTES:
        raise SystemExit(f'{name}: {size} bytes, at most {LARGEST_BYTES}')
    print(f'{path}: {size / 1000:.0f} kB')


def main() -> None:
    """Make the pictures that are asked for."""
    kinds: dict[str, Callable[..., None]] = {
        'bridge': bridge,
        'diagnosis': diagnosis,
        'fleet': fleet,
    }
    parser = argparse.ArgumentParser(description=__doc__.partition('\n\n')[0])
    parser.add_argument('pictures', nargs='*', metavar='PICTURE', help=f'of {", ".join(kinds)}')
    parser.add_argument('--store', type=Path, help='of a fleet, instead of simulating one')
    options = parser.parse_args()
    kinds['fleet'] = partial(fleet, store=options.store)
    asked = options.pictures or list(kinds)
    for name in asked:
        if name not in kinds:
            parser.error(f'{name!r}: expected {", ".join(kinds)}')
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        program = shutil.which('chromium')
        browser = playwright.chromium.launch(executable_path=program, args=FLAGS)

        def open_page(url: str, *, height: int) -> Any:
            page = browser.new_page(viewport={'width': WIDTH, 'height': height})
            page.goto(url)
            return page

        for name in asked:
            kinds[name](Path(folder), open_page)
        browser.close()


if __name__ == '__main__':
    main()
