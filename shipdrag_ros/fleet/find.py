# SPDX-License-Identifier: Apache-2.0
"""
The bags below folders: which files make up which, and what lies beside them.

A bag is an MCAP file, a directory of rosbag2, or a log or table of a format that is
imported. A file whose name does not say so is known by its first bytes, where its
format shows in them (`Format.by_head`). What is none of these is left alone.
"""

from __future__ import annotations

import os
import posixpath
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shipdrag_ros.bags.mcap_file import METADATA, PART, is_bag_folder
from shipdrag_ros.errors import FleetError, ShipFileError, reason_of
from shipdrag_ros.ship import SHIP_FILE
from shipdrag_ros.sources.beside import BAGS, FIRST_BYTES, RUN_FILE, is_source, run_file

if TYPE_CHECKING:
    from fsspec import AbstractFileSystem

LOCAL = 'file'
TEXT_LIMIT_BYTES = 1 << 20
_AT_MOST = 64  # folders inside each other
_NO_FOLDERS = ('http://', 'https://')


@dataclass(frozen=True)
class Entry:
    """
    A file of a folder.

    Attributes
    ----------
    path
        For the file system.
    name
        In its folder.
    size
        [bytes]
    problem
        Why it must not be read; '' for a regular file.
    """

    path: str
    name: str
    size: int
    problem: str = ''


@dataclass(frozen=True)
class Folder:
    """
    A folder with its files, sorted by name.

    Attributes
    ----------
    path
        For the file system.
    parts
        Names of the folders from where the walk began.
    files
    problem
        Why it could not be read; '' where it could.
    """

    path: str
    parts: tuple[str, ...]
    files: tuple[Entry, ...]
    problem: str = ''


class Tree:
    """
    What is below a folder that a user names, on a disk or in an object store.

    A folder is entered once however many links lead to it, and what is no regular file is
    known before anything reads it.

    Parameters
    ----------
    place
        Folder or file: a path, or a URL that fsspec knows (`s3://bucket/folder`).

    Attributes
    ----------
    protocol
        `LOCAL`, or that of the URL.
    root
        The folder, for the file system.
    name
        Last part of it.
    only
        Name of the one file that was given; '' for a folder.

    Raises
    ------
    FleetError
        If there is nothing, if it cannot be reached, or if it is a web server.
    """

    def __init__(self, place: str) -> None:
        self.place = place
        self.protocol, _, _ = place.partition('://') if '://' in place else (LOCAL, '', '')
        self._fs, root = _file_system(place)
        self.only = ''
        with _reached(place):
            found = self._fs.exists(root)
            if found and self._fs.isfile(root):
                root, _, self.only = root.rpartition('/')
        if not found:
            raise FleetError(f'{place!r} does not exist; give a folder of bags')
        self.root = root or '/'
        self.name = posixpath.basename(self.root.rstrip('/')) or self.root

    def folders(self) -> Iterator[Folder]:
        """Yield every folder from the top, sorted by name; each once."""
        seen: set[str] = set()
        waiting: list[tuple[str, tuple[str, ...]]] = [(self.root, ())]
        while waiting:
            path, parts = waiting.pop()
            real = os.path.realpath(path) if self.protocol == LOCAL else path
            if real in seen:
                continue
            seen.add(real)
            inside, folder = self.read(path, parts)
            if self.only:
                files = tuple(each for each in folder.files if each.name == self.only)
                folder = replace(folder, files=files)
            yield folder
            if self.only or len(parts) >= _AT_MOST:
                continue
            waiting += [
                (child, (*parts, posixpath.basename(child)))
                for child in sorted(inside, reverse=True)
            ]

    def text(self, path: str) -> str | None:
        """
        Return a small text file, or None where there is none.

        Raises
        ------
        FleetError
            If it is there and is no small text file.
        """
        try:
            if not self._fs.isfile(path):
                if self.protocol == LOCAL and os.path.lexists(path):
                    raise FleetError(f'{path!r} is no regular file; put one there or remove it')
                return None
            with self._fs.open(path, 'rb') as file:
                content = file.read(TEXT_LIMIT_BYTES + 1)
        except FleetError:
            raise
        except Exception as error:  # each file system has errors of its own
            raise FleetError(f'{path!r} cannot be read: {error}') from error
        if len(content) > TEXT_LIMIT_BYTES:
            raise FleetError(f'{path!r} is longer than {TEXT_LIMIT_BYTES} bytes')
        try:
            return str(content.decode('utf-8-sig'))
        except UnicodeDecodeError as error:
            raise FleetError(f'{path!r} is not UTF-8: {error}') from error

    def beginning(self, path: str, size: int) -> bytes:
        """Return the first bytes of a file; none where it cannot be read."""
        try:
            with self._fs.open(path, 'rb') as file:
                return bytes(file.read(size))
        except Exception:  # each file system has errors of its own
            return b''

    def url(self, path: str) -> str:
        """Return what a worker opens: a path, or a URL."""
        return path if self.protocol == LOCAL else str(self._fs.unstrip_protocol(path))

    def read(self, path: str, parts: tuple[str, ...] = ()) -> tuple[list[str], Folder]:
        """Return the folders in a folder, and itself."""
        try:
            # not `fs.walk`: it follows no link, and drops what it cannot list below the top
            listed: list[dict[str, Any]] = self._fs.ls(path, detail=True, refresh=True)
        except Exception as error:  # each file system has errors of its own
            return [], Folder(path, parts, (), f'cannot be read: {reason_of(error)}')
        folders, files = [], []
        for about in listed:
            place = about['name'].rstrip('/')
            if place == path.rstrip('/'):  # an object store lists a folder made by hand in it
                continue
            entry, is_folder = self._entry(place, about)
            if is_folder:
                folders.append(place)
            else:
                files.append(entry)
        return folders, Folder(path, parts, tuple(sorted(files, key=lambda each: each.name)))

    def _entry(self, place: str, about: dict[str, Any]) -> tuple[Entry, bool]:
        """Return an entry of a folder, and whether it is a folder, too; links are followed."""
        name = posixpath.basename(place)
        if about.get('islink'):
            try:
                about = self._fs.info(place)
            except OSError as error:
                return Entry(place, name, 0, f'cannot be read: {error.strerror}'), False
        kind = about['type']
        problem = '' if kind in ('file', 'directory') else _irregular(about.get('mode', 0))
        return Entry(place, name, int(about.get('size') or 0), problem), kind == 'directory'


def _file_system(place: str) -> tuple[AbstractFileSystem, str]:
    """Return the file system of a place, and the place in it."""
    if not place:
        raise FleetError("a folder is '', perhaps of a variable that is not set; name one")
    if place.lower().startswith(_NO_FOLDERS):
        raise FleetError(
            f'{place!r}: a web server has no folders to walk; download the bags and give their '
            'folder, or give an object store as s3://bucket/folder'
        )
    if '://' not in place:
        from fsspec.implementations.local import LocalFileSystem

        return LocalFileSystem(), os.path.abspath(place)
    from fsspec.core import url_to_fs

    with _reached(place):
        fs, path = url_to_fs(place)
    return fs, str(path).rstrip('/')


@contextmanager
def _reached(place: str) -> Iterator[None]:
    """Turn whatever a file system raises into an error that a user can mend."""
    try:
        yield
    except Exception as error:
        raise FleetError(
            f'{place!r} cannot be reached: {reason_of(error)}; check the '
            'address, and for s3:// the usual AWS variables (AWS_ACCESS_KEY_ID, AWS_ENDPOINT_URL)'
        ) from error


def _irregular(mode: int) -> str:
    kinds = {stat.S_IFIFO: 'a pipe', stat.S_IFSOCK: 'a socket'}
    kind = kinds.get(stat.S_IFMT(mode), 'a device')
    return f'is {kind} and no file; it may have no end'


EVENTS_FILE = 'events.csv'
LIMIT_BYTES = 64 << 30
"""Of a file; a longer one is skipped."""

_BESIDE = (SHIP_FILE, RUN_FILE, EVENTS_FILE, 'truth.csv')


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
        return not self.folder and PART.search(posixpath.basename(self.bag)) is not None


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
        If one of the places does not exist, cannot be reached or lies in the store.
    """
    searches = [_Search(Tree(place), without) for place in places]
    return FoundBags(
        tuple(source for each in searches for source in each.sources()),
        tuple(skipped for each in searches for skipped in each.skipped),
        sum(each.left_alone for each in searches),
        tuple(note for each in searches for note in each.notes),
    )


class _Search:
    """The search of one folder; what it skips is gathered."""

    def __init__(self, tree: Tree, store: Path | None) -> None:
        self._tree = tree
        self._store = None if store is None else store.resolve()
        if self._in_store(tree.root):
            raise FleetError(
                f'{tree.place!r} lies in the store {str(store)!r}, where no bag is looked for; '
                'give a store beside the bags or below them'
            )
        self._top = tree.root
        self._ships: dict[str, Beside] = {}
        self._sources: dict[str, list[str]] = {}
        self.skipped: list[Skipped] = []
        self.left_alone = 0
        self.notes: list[str] = []

    def sources(self) -> Iterator[BagToRead]:
        for folder in self._tree.folders():
            if self._in_store(folder.path):
                continue
            if folder.problem:
                self._skip('/'.join(folder.parts) or '.', folder.problem)
                continue
            yield from self._in_folder(folder)

    def _in_store(self, path: str) -> bool:
        if self._store is None or self._tree.protocol != LOCAL:
            return False
        return Path(path).resolve().is_relative_to(self._store)

    def _in_folder(self, folder: Folder) -> Iterator[BagToRead]:
        if is_bag_folder([entry.name for entry in folder.files]):
            yield from self._bag_folder(folder)
            return
        others = [e for e in folder.files if not e.name.endswith(_BESIDE)]
        bags = [entry for entry in others if self._is_source(entry)]
        self.left_alone += len(others) - len(bags)
        for entry in bags:
            bag = _text('/'.join((*folder.parts, entry.name)))
            yield from self._source(folder, bag, (entry,))

    def _is_source(self, entry: Entry) -> bool:
        readable = entry.size and not entry.problem
        first = partial(self._tree.beginning, entry.path, FIRST_BYTES) if readable else bytes
        return is_source(entry.name, first)

    def _bag_folder(self, folder: Folder) -> Iterator[BagToRead]:
        """Yield a directory of rosbag2 as one bag."""
        files = tuple(e for e in folder.files if e.name.endswith((METADATA, *BAGS)))
        bag = _text('/'.join(folder.parts) or self._tree.name)
        if folder.path == self._tree.root:  # the bag itself was given: what lies beside it counts
            self._top = posixpath.dirname(self._tree.root)
        yield from self._source(folder, bag, files, whole=True)

    def _source(
        self, folder: Folder, bag: str, files: tuple[Entry, ...], *, whole: bool = False
    ) -> Iterator[BagToRead]:
        problem = next(filter(None, map(_problem, files)), '')
        if problem:
            self._skip(bag, problem)
            return
        try:
            beside = self._beside(folder.path)
            run = self._run(folder.path if whole else files[0].path, whole)
        except (FleetError, ShipFileError) as error:
            self._skip(bag, str(error))
            return
        urls = tuple(self._tree.url(entry.path) for entry in files)
        yield BagToRead(_text(self._tree.name), bag, urls, whole, beside, run)

    def _run(self, bag: str, whole: bool) -> str:
        where, name = posixpath.split(bag)
        place = partial(posixpath.join, where)

        def say(text: str) -> None:
            shown = _text(posixpath.relpath(place(RUN_FILE), self._tree.root))
            note = f'{shown!r} {text}'
            if note not in self.notes:
                self.notes.append(note)

        found = run_file(
            [name],
            lambda each: self._tree.text(place(each)) is not None,
            partial(self._sources_in, where),
            say,
            folder=whole,
        )
        return '' if found is None else self._tree.text(place(found)) or ''

    def _sources_in(self, path: str) -> list[str]:
        """Return the names of all bags and logs in a folder."""
        if path not in self._sources:
            inside, folder = self._tree.read(path)
            names = [entry.name for entry in folder.files if self._is_source(entry)]
            for each in inside:
                if is_bag_folder([entry.name for entry in self._tree.read(each)[1].files]):
                    names.append(posixpath.basename(each))
            self._sources[path] = names
        return self._sources[path]

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


def _problem(entry: Entry) -> str:
    if entry.problem:
        return entry.problem
    if entry.size > LIMIT_BYTES:
        return f'has {entry.size} bytes, more than {LIMIT_BYTES}; cut it into parts'
    return ''


def _text(name: str) -> str:
    """Return a name that a file can hold; bytes that are no text are escaped."""
    return name.encode('utf-8', 'surrogateescape').decode('utf-8', 'backslashreplace')
