# SPDX-License-Identifier: Apache-2.0
"""
Folders on a disk and in an object store, walked alike.

A folder is entered once however many links lead to it, and what is no regular
file is known before anything reads it.
"""

from __future__ import annotations

import os
import posixpath
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from shipdrag_ros.errors import FleetError, reason_of

if TYPE_CHECKING:  # a verb that needs no folders does not import it
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
    What is below a folder that a user names.

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
        """
        Yield every folder from the top, sorted by name; each once.
        """
        seen: set[str] = set()
        waiting: list[tuple[str, tuple[str, ...]]] = [(self.root, ())]
        while waiting:
            path, parts = waiting.pop()
            real = os.path.realpath(path) if self.protocol == LOCAL else path
            if real in seen:
                continue
            seen.add(real)
            inside, folder = self._read(path, parts)
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
            text: str = content.decode('utf-8-sig')
        except UnicodeDecodeError as error:
            raise FleetError(f'{path!r} is not UTF-8: {error}') from error
        return text

    def beginning(self, path: str, size: int) -> bytes:
        """
        Return the first bytes of a file; none where it cannot be read.
        """
        try:
            with self._fs.open(path, 'rb') as file:
                first: bytes = file.read(size)
        except Exception:  # each file system has errors of its own
            return b''
        return first

    def url(self, path: str) -> str:
        """
        Return what a worker opens: a path, or a URL.
        """
        if self.protocol == LOCAL:
            return path
        url: str = self._fs.unstrip_protocol(path)
        return url

    def _read(self, path: str, parts: tuple[str, ...]) -> tuple[list[str], Folder]:
        """Return the folders in a folder, and itself."""
        try:
            # not `fs.walk`: it follows no link, and drops what it cannot list below the top
            listed: list[dict[str, Any]] = self._fs.ls(path, detail=True, refresh=True)
        except Exception as error:  # each file system has errors of its own
            why = reason_of(error)
            return [], Folder(path, parts, (), f'cannot be read: {why}')
        folders, files = [], []
        for about in listed:
            place = about['name'].rstrip('/')
            if place == path.rstrip('/'):  # an object store lists a folder made by hand in it
                continue
            entry, is_folder = self._entry(place, about)
            if is_folder:
                folders.append(place)
            elif self.only in ('', entry.name):
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
