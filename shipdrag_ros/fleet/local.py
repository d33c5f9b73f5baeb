# SPDX-License-Identifier: Apache-2.0
"""The files of a bag on the disk of whoever reads it, and their digest."""

from __future__ import annotations

import hashlib
import posixpath
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from shipdrag_ros.errors import BagError, ShipdragError
from shipdrag_ros.fleet.find import BagToRead

_AT_ONCE_BYTES = 1 << 20


@dataclass(frozen=True)
class Identity:
    """
    What separates one bag from another.

    Attributes
    ----------
    digest
        SHA-256 of the bytes of its files, in hexadecimal digits.
    recording
        Id of the recording that it is a part of; '' where its name is not that of a part.
    """

    digest: str
    recording: str = ''


@contextmanager
def fetched(source: BagToRead) -> Iterator[tuple[Path, ...]]:
    """
    Bring the files of a bag to the disk, where they are not there already.

    Yields
    ------
    tuple of Path
        The files; a fetched copy is gone afterwards.

    Raises
    ------
    BagError
        If one cannot be fetched.
    """
    if not any('://' in file for file in source.files):
        with _named_by_the_bag(Path(source.files[0]).parent):
            yield tuple(map(Path, source.files))
        return
    with TemporaryDirectory(prefix='shipdrag-fleet-') as made:
        folder = Path(made) / posixpath.basename(source.bag.rstrip('/'))
        folder.mkdir()
        copies = [_copy(url, folder) for url in source.files]
        with _named_by_the_bag(folder):
            yield tuple(copies)


def _copy(url: str, folder: Path) -> Path:
    from fsspec.core import url_to_fs

    copy = folder / posixpath.basename(url)
    try:
        fs, path = url_to_fs(url)
        fs.get_file(path, str(copy))
    except Exception as error:  # each file system has errors of its own
        raise BagError(f'{url!r} cannot be fetched: {error}') from error
    return copy


@contextmanager
def _named_by_the_bag(folder: Path) -> Iterator[None]:
    """Leave out of an error where the file stood: a fetched copy stands anywhere."""
    try:
        yield
    except (ShipdragError, OSError) as error:
        raise BagError(str(error).replace(f'{folder}/', '')) from error


def identify(source: BagToRead) -> Identity | str:
    """
    Read a bag once, for its digest.

    Returns
    -------
    Identity or str
        Or why it cannot be read.
    """
    try:
        with fetched(source) as files:
            return Identity(_digest(files), _recording(files) if source.may_be_part else '')
    except (ShipdragError, OSError) as error:
        return str(error)


def content_hash(digests: Sequence[str], source: BagToRead) -> str:
    """
    Return what the rows of a bag depend on, as one digest.

    Parameters
    ----------
    digests
        Of the files of its parts, in their order.
    source
        The first part: the ship file, and `run.yaml` beside it.
    """
    found = hashlib.sha256()
    for text in (*digests, source.beside.ship, source.beside.ship_name, source.run):
        piece = text.encode('utf-8', 'surrogatepass')
        found.update(len(piece).to_bytes(8, 'little') + piece)
    return found.hexdigest()


def _digest(files: Sequence[Path]) -> str:
    found = hashlib.sha256()
    for path in files:
        found.update(path.name.encode('utf-8', 'surrogateescape') if len(files) > 1 else b'')
        with path.open('rb') as file:
            while piece := file.read(_AT_ONCE_BYTES):
                found.update(piece)
    return found.hexdigest()


def _recording(files: Sequence[Path]) -> str:
    from shipdrag_ros.bags.declarations import METADATA
    from shipdrag_ros.bags.mcap_file import McapFile

    try:
        about = McapFile(files[0]).contents.metadata.get(METADATA, {})
    except BagError:
        return ''  # the job will say so
    return str(about.get('recording_id', ''))
