# SPDX-License-Identifier: Apache-2.0
"""Attacks by files: what is given as a ship file, and where recordings are written."""

from __future__ import annotations

import csv
import os
import time
from collections.abc import Callable
from pathlib import Path

from shipdrag_ros.bags.durable import DurableRecording, PartLimits
from shipdrag_ros.display import spreadsheet_text
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.messages import EncodedMessage
from shipdrag_ros.node.settings import NodeSettings
from shipdrag_ros.ship import Ship
from tests.attacks.attack import Attack, Succeeded, check

SECRET = 'hunter2'
WITHIN_S = 5.0


def refused(path: Path) -> str:
    """Load a ship file that must be refused soon, without a word of what is in it."""
    start_s = time.monotonic()
    try:
        Ship.load(path)
    except ShipdragError as error:
        said = str(error)
    else:
        raise Succeeded('it was read')
    check(time.monotonic() - start_s < WITHIN_S, 'it took long')
    check(SECRET not in said, 'the file was repeated')
    return said.splitlines()[-1].strip(' -').replace('|', ' ')[:120]


def text(content: str) -> Callable[[Path], str]:
    """Return an attack by the content of a ship file."""

    def run(folder: Path) -> str:
        path = folder / 'ship.yaml'
        path.write_text(content)
        return refused(path)

    return run


def fifo(folder: Path) -> str:
    """Hang the reader with a pipe that nobody writes."""
    os.mkfifo(folder / 'pipe')
    return refused(folder / 'pipe')


def endless(folder: Path) -> str:
    """Fill the memory with a device that never ends."""
    (folder / 'link').symlink_to('/dev/zero')
    return refused(folder / 'link')


def huge(folder: Path) -> str:
    """Fill the memory with a sparse file of a terabyte."""
    path = folder / 'huge'
    with path.open('wb') as file:
        file.truncate(2**40)
    return refused(path)


def outside(way: str) -> Callable[[Path], str]:
    """Return an attack that leaves the folders that are allowed."""

    def run(folder: Path) -> str:
        inside = folder / 'inside'
        inside.mkdir()
        (inside / 'link').symlink_to('/etc')
        given = {'ship_file': str(inside / 'ship.yaml'), 'path_roots': str(inside)}
        settings = NodeSettings.from_mapping(
            {**given, 'output_directory': way.format(inside=inside)}, subject='attack'
        )
        try:
            settings.paths()
        except ShipdragError as error:
            return str(error).splitlines()[-1].strip(' -').replace(str(folder), '...')
        raise Succeeded('the path was taken')

    return run


def record(directory: Path) -> str:
    """Record one message into a folder; return what was said of an error."""
    it = DurableRecording(
        directory, stem='coastdown_x', attachments={}, limits=PartLimits(), at_once=False
    )
    it.put(EncodedMessage('/depth', 'sensor_msgs/msg/Range', b'\x00\x01\x00\x00', 1, 1))
    time.sleep(0.5)
    it.stop()
    it.wait_ended(WITHIN_S)
    return it.progress().error


def folder_made_a_link(folder: Path) -> str:
    """Put a link where the folder of recordings was."""
    target = folder / 'target'
    target.mkdir()
    (folder / 'bags').symlink_to(target)
    said = record(folder / 'bags')
    check(not list(target.iterdir()), 'a file was made there')
    return said.replace(str(folder), '...')


def name_made_a_link(folder: Path) -> str:
    """Put a link to a file where the next recording will be."""
    victim = folder / 'victim'
    victim.write_text('precious')
    bags = folder / 'bags'
    bags.mkdir()
    (bags / 'coastdown_x_000.mcap').symlink_to(victim)
    record(bags)
    check(victim.read_text() == 'precious', 'it was written through')
    made = [path.name for path in bags.iterdir() if not path.is_symlink()]
    check(made, 'nothing was recorded')
    return f'recorded as {made[0]}'


def formula(folder: Path) -> str:
    """Bring a formula into a spreadsheet by the name of a bag."""
    with (folder / 'curves.csv').open('w', newline='') as file:
        csv.writer(file).writerow([spreadsheet_text('=cmd|calc!A0'), -1.5])
    line = (folder / 'curves.csv').read_text().strip()
    check(line[0] not in '=+-@', 'a spreadsheet runs it')
    return f'written as {line}'.replace('|', '\\|')


BOMB = 'a0: &a0 [x, x]\n' + ''.join(
    f'a{i}: &a{i} [{", ".join([f"*a{i - 1}"] * 9)}]\n' for i in range(1, 12)
)
ATTACKS = [
    Attack('ship file', 'a pipe that nobody writes', fifo),
    Attack('ship file', 'a device that never ends', endless),
    Attack('ship file', 'a terabyte of zeros', huge),
    Attack('ship file', 'another file, to read it in the error', text(f'password: {SECRET}\n')),
    Attack('ship file', 'another file that is no mapping', text(f'root:x:{SECRET}:/bin/sh\n')),
    Attack('ship file', 'references that multiply', text(BOMB)),
    Attack('ship file', 'brackets without end', text('length_m: ' + '[' * 100_000)),
    Attack('ship file', 'code in a tag', text('length_m: !!python/object/apply:os.abort []\n')),
    Attack('paths', 'recordings by an absolute path', outside('/etc/cron.d')),
    Attack('paths', 'recordings by two dots', outside('{inside}/../elsewhere')),
    Attack('paths', 'recordings through a link', outside('{inside}/link')),
    Attack('paths', 'the folder becomes a link', folder_made_a_link),
    Attack('paths', 'the next name is a link', name_made_a_link),
    Attack('spreadsheet', 'a bag named as a formula', formula),
]
