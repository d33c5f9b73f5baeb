# SPDX-License-Identifier: Apache-2.0
"""What lies beside a bag or a log, on a disk or in an object store: the `run.yaml` of its run."""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path

from shipdrag_ros.bags import Run
from shipdrag_ros.bags.mcap_file import PART, is_bag_folder
from shipdrag_ros.errors import ShipFileError
from shipdrag_ros.ship import RunSheet

RUN_FILE = 'run.yaml'
FIRST_BYTES = 1 << 13
"""Of a file, by which its format is known."""

BAGS = ('.mcap', '.mcap.zstd', '.db3', '.db3.zstd')
_LOGS = ('.nmea', '.nmea.gz', '.csv', '.tsv')
_SOURCES = (*BAGS, '.bag', *_LOGS)
_NONE = ('truth.csv', 'events.csv')  # of `shipdrag simulate-fleet`, and of a fleet


def is_source(name: str, beginning: Callable[[], bytes]) -> bool:
    """
    Say whether a file is a bag or a log, by its name, else by its first bytes.

    Parameters
    ----------
    name
        Of the file.
    beginning
        Called for its first bytes, packed with gzip or not, where the name says nothing.
    """
    if name in _NONE or name.endswith('.yaml'):
        return False
    if name.endswith(_SOURCES):
        return True
    first = beginning()
    from shipdrag_ros.sources import formats  # where all names say what they are, not needed
    from shipdrag_ros.sources.format import CERTAIN, GZIP, Head

    if first.startswith(GZIP):
        try:
            first = zlib.decompressobj(wbits=31).decompress(first, FIRST_BYTES)
        except zlib.error:
            return False
    head = Head(Path(name), first)
    return bool(first) and any(
        each.by_head and each.score(head) >= CERTAIN for each in formats.found()
    )


def run_file(
    own: Collection[str],
    exists: Callable[[str], bool],
    beside: Callable[[], Collection[str]],
    say: Callable[[str], None],
    *,
    folder: bool = False,
) -> str | None:
    """
    Find the file that holds for one run: `BAG.run.yaml`, or `run.yaml` of a bag that is alone.

    Parameters
    ----------
    own
        Names of what the run was read from, in one folder.
    exists
        Says whether a file is there, by its path from that folder.
    beside
        Called for the names of all bags and logs in that folder.
    say
        Called where `run.yaml` may be of several.
    folder
        Whether the bag is a folder.

    Returns
    -------
    str or None
        Its path from that folder.

    Raises
    ------
    ShipFileError
        If there is more than one.
    """
    bag = next(iter(own))
    stem = bag.removesuffix('.gz').removesuffix('.zstd').rpartition('.')[0]
    names = (f'{bag}.{RUN_FILE}', f'{bag}/{RUN_FILE}' if folder else f'{stem}.{RUN_FILE}')
    found = [name for name in names if exists(name)]
    if exists(RUN_FILE):
        of_run = {PART.sub('', each) for each in own}
        others = [
            each
            for each in beside()
            if PART.sub('', each) not in of_run
            # a log beside a bag may be what that was imported from
            and (bag.endswith(_LOGS) or not each.endswith(_LOGS))
        ]
        if not others:
            found.append(RUN_FILE)
        elif not found:
            say(
                f'lies beside {len(others) + len(own)} bags and is used for none of them; name it '
                f'BAG.{RUN_FILE}'
            )
    if len(found) > 1:
        raise ShipFileError(bag, [f'two run files, {found[0]} and {found[1]}: keep one'])
    return found[0] if found else None


def sheet_of(run: Run, say: Callable[[str], None]) -> tuple[RunSheet, str]:
    """
    Return what the file beside a run says of it, and where that stands; an empty one without.

    Parameters
    ----------
    run
        Of bags or logs on the disk; a frame lies in no folder.
    say
        Called with a sentence where there is such a file.

    Raises
    ------
    ShipFileError
        If it cannot be used, or there are two.
    """
    folders = run.folders
    if not folders:
        return RunSheet(), ''
    folder, inside = folders[-1], len(folders) > 1
    alike = [path.name for path in run.paths if path.parent == folder]
    found = run_file(
        [folders[0].name] if inside else alike,
        lambda name: (folder / name).is_file(),
        partial(_sources_in, folder),
        lambda text: say(f'{folder / RUN_FILE} {text}'),
        folder=inside,
    )
    if found is None:
        return RunSheet(), ''
    path = folder / found
    sheet = RunSheet.load(path)
    say(f'{path} holds for this run')
    return sheet, str(path)


def _sources_in(folder: Path) -> list[str]:
    """Return the names of all bags and logs in a folder."""
    return [
        each.name
        for each in folder.iterdir()
        if (each.is_dir() and is_bag_folder(os.listdir(each)))
        or (each.is_file() and is_source(each.name, partial(_beginning, each)))
    ]


def _beginning(path: Path) -> bytes:
    with path.open('rb') as file:
        return file.read(FIRST_BYTES)
