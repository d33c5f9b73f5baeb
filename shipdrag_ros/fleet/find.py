# SPDX-License-Identifier: Apache-2.0
"""
The bags below folders: which files make up which, and what lies beside them.

A bag is an MCAP file, a directory of rosbag2, or a log or table of a format that is
imported. A file whose name does not say so is known by its first bytes, where its
format shows in them (`Format.by_head`). What is none of these is left alone.
"""

from __future__ import annotations

import posixpath
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from shipdrag_ros.errors import FleetError
from shipdrag_ros.fleet.walk import LOCAL, Entry, Folder, Tree

SHIP_FILE, EVENTS_FILE, RUN_FILE = 'ship.yaml', 'events.csv', 'run.yaml'
LIMIT_BYTES = 64 << 30
"""Of a file; a longer one is skipped."""

_NO_BAGS = (EVENTS_FILE, 'truth.csv')  # the second: of `shipdrag simulate-fleet`
_METADATA = 'metadata.yaml'
_BAGS = ('.mcap', '.mcap.zstd')
_FOREIGN = ('.db3', '.bag')  # of rosbag2 in sqlite3, and of ROS 1
LOGS = ('.nmea', '.nmea.gz')
TABLES = ('.csv', '.tsv')
_FIRST_BYTES = 1 << 13
_PART = re.compile(r'(.*)_\d+\.mcap(\.zstd)?')


@dataclass(frozen=True)
class Beside:
    """
    What lies beside bags, as text.

    Attributes
    ----------
    ship
        The nearest `ship.yaml` upwards, not above the folder that was given; '' without one.
    events
        `events.csv` beside that.
    ship_name
        Name of the folder of that ship file, for a ship without a name.
    """

    ship: str = ''
    events: str = ''
    ship_name: str = ''


@dataclass(frozen=True)
class BagToRead:
    """
    A bag to be read.

    Attributes
    ----------
    root
        Last part of the folder that was given.
    bag
        Path relative to that folder, '/' separated.
    files
        Paths or URLs of its files.
    folder
        Whether they are the files of one directory of rosbag2.
    beside
    run
        Text of its `run.yaml`; '' without one.
    """

    root: str
    bag: str
    files: tuple[str, ...]
    folder: bool
    beside: Beside
    run: str = ''

    @property
    def may_be_part(self) -> bool:
        """Whether the name is that of one part of a recording."""
        return not self.folder and _PART.fullmatch(posixpath.basename(self.bag)) is not None


@dataclass(frozen=True)
class Skipped:
    """A bag, or a folder, that was not read, and why."""

    root: str
    bag: str
    reason: str


@dataclass(frozen=True)
class FoundBags:
    """
    What was found.

    Attributes
    ----------
    sources
        In the order of the folders given, then of their names.
    skipped
        What looks like a bag and must not be read.
    left_alone
        Number of files that are no bags.
    notes
        What lies beside bags and is not used, a sentence each.
    """

    sources: tuple[BagToRead, ...]
    skipped: tuple[Skipped, ...]
    left_alone: int
    notes: tuple[str, ...] = ()


def find(places: Sequence[str], *, without: Path | None = None) -> FoundBags:
    """
    Find the bags below folders.

    Parameters
    ----------
    places
        Folders or single bags: paths, or URLs that fsspec knows.
    without
        A folder that is not entered, that of the store.

    Raises
    ------
    FleetError
        If one of the places does not exist or cannot be reached.
    """
    sources: list[BagToRead] = []
    skipped: list[Skipped] = []
    notes: list[str] = []
    left_alone = 0
    for place in places:
        search = _Search(Tree(place), None if without is None else str(without.resolve()))
        sources += search.sources()
        skipped += search.skipped
        left_alone += search.left_alone
        notes += search.notes
    return FoundBags(tuple(sources), tuple(skipped), left_alone, tuple(notes))


class _Search:
    """The search of one folder; what it skips is gathered."""

    def __init__(self, tree: Tree, without: str | None) -> None:
        self._tree = tree
        self._without = without
        self._top = tree.root
        self._ships: dict[str, Beside] = {}
        self.skipped: list[Skipped] = []
        self.left_alone = 0
        self.notes: list[str] = []

    def sources(self) -> Iterator[BagToRead]:
        for folder in self._tree.folders():
            if self._without is not None and self._is_store(folder):
                continue
            if folder.problem:
                self._skip('/'.join(folder.parts) or '.', folder.problem)
                continue
            yield from self._in_folder(folder)

    def _is_store(self, folder: Folder) -> bool:
        if self._tree.protocol != LOCAL:
            return False
        here = str(Path(folder.path).resolve())
        return here == self._without or here.startswith(f'{self._without}/')

    def _in_folder(self, folder: Folder) -> Iterator[BagToRead]:
        if any(entry.name == _METADATA or entry.name.endswith('.db3') for entry in folder.files):
            yield from self._bag_folder(folder)
            return
        beside = (SHIP_FILE, RUN_FILE, *_NO_BAGS)
        others = [e for e in folder.files if not e.name.endswith(beside)]
        bags = [entry for entry in others if self._is_bag(entry)]
        self.left_alone += len(others) - len(bags)
        # parts of one recording are one bag
        alone = len({_PART.sub(r'\1', entry.name) for entry in bags}) == 1
        if len(bags) > 1 and not alone and any(e.name == RUN_FILE for e in folder.files):
            where = _text('/'.join((*folder.parts, RUN_FILE)))
            self.notes.append(
                f'{where!r} lies beside {len(bags)} bags and is used for none of them; name it '
                f'BAG.{RUN_FILE}'
            )
        for entry in bags:
            yield from self._one(folder, entry, alone=alone)

    def _is_bag(self, entry: Entry) -> bool:
        if entry.name.endswith((*_BAGS, *_FOREIGN, *LOGS, *TABLES)):
            return True
        if entry.problem or not entry.size:
            return False
        return is_log(entry.name, self._tree.beginning(entry.path, _FIRST_BYTES))

    def _one(self, folder: Folder, entry: Entry, *, alone: bool) -> Iterator[BagToRead]:
        bag = _text('/'.join((*folder.parts, entry.name)))
        stem = entry.name.partition('.')[0]
        names = [f'{entry.name}.{RUN_FILE}', f'{stem}.{RUN_FILE}', *([RUN_FILE] if alone else [])]
        yield from self._source(folder, bag, (entry,), names, folder_bag=False)

    def _bag_folder(self, folder: Folder) -> Iterator[BagToRead]:
        """Yield a directory of rosbag2 as one bag."""
        files = tuple(e for e in folder.files if e.name.endswith((_METADATA, *_BAGS, '.db3')))
        bag = _text('/'.join(folder.parts) or self._tree.name)
        if folder.path == self._tree.root:  # the bag itself was given: what lies beside it counts
            self._top = posixpath.dirname(self._tree.root)
        beside = f'../{posixpath.basename(folder.path)}.{RUN_FILE}'
        yield from self._source(
            folder, bag, files, (RUN_FILE, beside, f'../{RUN_FILE}'), folder_bag=True
        )

    def _source(
        self,
        folder: Folder,
        bag: str,
        files: tuple[Entry, ...],
        run_names: Sequence[str],
        *,
        folder_bag: bool,
    ) -> Iterator[BagToRead]:
        problem = next((_problem(entry) for entry in files if _problem(entry)), '')
        if problem:
            self._skip(bag, problem)
            return
        try:
            beside = self._beside(folder.path)
            run = self._run(folder, run_names)
        except FleetError as error:
            self._skip(bag, str(error))
            return
        urls = tuple(self._tree.url(entry.path) for entry in files)
        yield BagToRead(_text(self._tree.name), bag, urls, folder_bag, beside, run)

    def _run(self, folder: Folder, names: Sequence[str]) -> str:
        for name in names:
            text = self._tree.text(posixpath.normpath(posixpath.join(folder.path, name)))
            if text is not None:
                return text
        return ''

    def _beside(self, path: str) -> Beside:
        """Return the nearest ship file from a folder up to the one given, and its events."""
        if path not in self._ships:
            ship = self._tree.text(posixpath.join(path, SHIP_FILE))
            if ship is not None:
                events = self._events(posixpath.join(path, EVENTS_FILE))
                self._ships[path] = Beside(ship, events, _text(posixpath.basename(path)))
            elif path == self._top:  # above it may lie the file of any ship
                self._ships[path] = Beside()
            else:
                self._ships[path] = self._beside(posixpath.dirname(path))
        return self._ships[path]

    def _events(self, path: str) -> str:
        """Return the known events; bags can do without them, and that is said."""
        try:
            return self._tree.text(path) or ''
        except FleetError as error:
            self.notes.append(f'no event is known, since {_text(str(error))}')
            return ''

    def _skip(self, bag: str, reason: str) -> None:
        self.skipped.append(Skipped(_text(self._tree.name), _text(bag), reason))


def is_log(name: str, first: bytes) -> bool:
    """
    Say whether a file is a log that is imported, by its first bytes alone.

    Parameters
    ----------
    name
        Of the file.
    first
        Its first bytes, packed with gzip or not.
    """
    from shipdrag_ros.sources import formats  # where all names say what they are, not needed
    from shipdrag_ros.sources.format import CERTAIN, Head
    from shipdrag_ros.sources.opened import GZIP

    if first.startswith(GZIP):
        try:
            first = zlib.decompressobj(wbits=31).decompress(first, _FIRST_BYTES)
        except zlib.error:
            return False
    head = Head(Path(name), first)
    return any(each.by_head and each.score(head) >= CERTAIN for each in formats.found())


def _problem(entry: Entry) -> str:
    if entry.problem:
        return entry.problem
    if entry.size > LIMIT_BYTES:
        return f'has {entry.size} bytes, more than {LIMIT_BYTES}; cut it into parts'
    return ''


def _text(name: str) -> str:
    """Return a name that a file can hold; bytes that are no text are escaped."""
    return name.encode('utf-8', 'surrogateescape').decode('utf-8', 'backslashreplace')
