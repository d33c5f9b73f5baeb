# SPDX-License-Identifier: Apache-2.0
"""Files from outside, plain or packed, in a memory and a time that they cannot fill."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader, TextIOWrapper
from pathlib import Path
from typing import IO, cast

from shipdrag_ros.errors import ImportDataError

GZIP = b'\x1f\x8b'
HEAD_BYTES = 1 << 16
LINE_BYTES = 1 << 16
"""No line of a log is as long as this; of one that is, nothing is used."""

_FREE_BYTES = 64 << 20  # unpacked from any file
_RATIO = 200  # text packs to a tenth, a bomb to a thousandth
_BROKEN = (OSError, EOFError, zlib.error)


def beginning(path: Path) -> bytes:
    """
    Return the first bytes of a file, unpacked where it is packed with gzip.

    Raises
    ------
    ImportDataError
        If it cannot be read or is empty.
    """
    if not path.is_file():
        why = 'is no regular file' if path.exists() else 'does not exist'
        raise ImportDataError(f'{str(path)!r} {why}; give a log or a table of measurements')
    raw = b''
    try:
        with opened(path) as (packed, file):
            raw = file.read(HEAD_BYTES)
            size = len(raw)
            while file is not packed and size <= _FREE_BYTES and (more := file.read(1 << 20)):
                size += len(more)
                check_unpacked(path, size, packed.tell())
    except _BROKEN as error:
        if raw:
            return raw  # whoever reads it says how far it goes
        why = getattr(error, 'strerror', None) or str(error)
        raise ImportDataError(
            f'{str(path)!r} cannot be read: {why}; give a log or a table of measurements'
        ) from error
    if not raw:
        raise ImportDataError(f'{str(path)!r} is empty; give a log or a table of measurements')
    return raw


@contextmanager
def opened(path: Path) -> Iterator[tuple[IO[bytes], IO[bytes]]]:
    """
    Open a file, and what is in it; packed or not by its content, whatever its name.

    Yields
    ------
    raw, file
        The first shows how far the reading is, the second is read.
    """
    with path.open('rb') as raw:
        if raw.peek(2)[:2] != GZIP:
            yield raw, raw
            return
        with gzip.open(raw) as unpacked:
            yield raw, cast(IO[bytes], unpacked)


class Lines:
    """
    The lines of a text file, one by one.

    Parameters
    ----------
    path
        Plain or packed with gzip.

    Attributes
    ----------
    number
        Lines read so far.
    too_long
        Lines of more than `LINE_BYTES`, which are left out.
    damage
        Why the file could not be read to its end; '' if it could.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.number = 0
        self.too_long = 0
        self.damage = ''
        self.done_bytes = 0

    def __iter__(self) -> Iterator[str]:
        self.number = self.too_long = 0
        self.damage = ''
        try:
            with opened(self.path) as (raw, file):
                yield from self._lines(raw, file)
        except _BROKEN as error:
            self.damage = f'after line {self.number}: {error}'

    def _lines(self, raw: IO[bytes], file: IO[bytes]) -> Iterator[str]:
        # a line ends with LF, CR or both; a serial adapter writes CR alone
        text = TextIOWrapper(cast(BufferedReader, file), encoding='utf-8-sig', errors='replace')
        size = 0
        try:
            while line := text.readline(LINE_BYTES):
                self.number += 1
                whole = line
                while len(line) == LINE_BYTES and not line.endswith('\n'):
                    line = text.readline(LINE_BYTES)
                    size += len(line)
                    if file is not raw:
                        check_unpacked(self.path, size, raw.tell())
                size += len(whole)
                if file is not raw:
                    check_unpacked(self.path, size, raw.tell())
                if self.number % 1000 == 0:
                    self.done_bytes = raw.tell()
                if len(whole) == LINE_BYTES and not whole.endswith('\n'):
                    self.too_long += 1
                else:
                    yield whole.strip()
        finally:
            text.detach()  # whoever opened the file closes it


def check_unpacked(path: Path, size: int, packed: int) -> None:
    """
    Refuse a packed file that unpacks to much more than any log does.

    Raises
    ------
    ImportDataError
        Naming both sizes.
    """
    if size > _FREE_BYTES and size > _RATIO * max(packed, 1):
        raise ImportDataError(
            f'{str(path)!r} unpacks to more than {_RATIO} times its size; no log does. Unpack it '
            'and look'
        )
