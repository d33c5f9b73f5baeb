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
from shipdrag_ros.progress import PartDone

GZIP = b'\x1f\x8b'
HEAD_BYTES = 1 << 16
LINE_BYTES = 1 << 16
"""No line of a log is as long as this; of one that is, nothing is used."""

_FREE_BYTES = 64 << 20  # unpacked from any file
_RATIO = 200  # text packs to a tenth, a bomb to a thousandth
BROKEN = (OSError, EOFError, zlib.error)
"""What reading a damaged file raises."""


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
    except BROKEN as error:
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
    The lines of a text file, without blanks around them.

    Parameters
    ----------
    path
        Plain or packed with gzip.
    encoding
    longest
        A line of as many characters is left out.
    progress
        Called with how many bytes are read, and of how many.

    Attributes
    ----------
    number
        Lines read so far.
    too_long
        Numbers of the lines that were left out.
    damage
        Why the file could not be read to its end; '' if it could.
    """

    def __init__(
        self,
        path: Path,
        *,
        encoding: str = 'utf-8-sig',
        longest: int = LINE_BYTES,
        progress: PartDone | None = None,
    ) -> None:
        self.path = path
        self.number = 0
        self.too_long: list[int] = []
        self.damage = ''
        self._encoding = encoding
        self._longest = longest
        self._progress = progress

    def __iter__(self) -> Iterator[str]:
        self.number, self.too_long, self.damage = 0, [], ''
        try:
            with opened(self.path) as (raw, file):
                yield from self._lines(raw, file)
        except BROKEN as error:
            self.damage = f'after line {self.number}: {error}'

    def _lines(self, raw: IO[bytes], file: IO[bytes]) -> Iterator[str]:
        # a line ends with LF, CR or both; a serial adapter writes CR alone
        text = TextIOWrapper(cast(BufferedReader, file), encoding=self._encoding, errors='replace')
        most, size, total = self._longest, 0, self.path.stat().st_size
        packed = file is not raw
        try:
            while line := text.readline(most):
                self.number += 1
                rest, length = line, len(line)
                while len(rest) == most and not rest.endswith('\n'):
                    rest = text.readline(most)
                    length += len(rest)
                    if packed:
                        check_unpacked(self.path, size + length, raw.tell())
                size += length
                if packed:
                    check_unpacked(self.path, size, raw.tell())
                if self._progress is not None and self.number % 1000 == 0:
                    self._progress(raw.tell(), total)
                if len(line) >= most - 1:
                    self.too_long.append(self.number)
                else:
                    yield line.strip()
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
