# SPDX-License-Identifier: Apache-2.0
"""Files from outside, plain or packed, in a memory and a time that they cannot fill."""

from __future__ import annotations

import codecs
import gzip
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from io import BufferedReader, TextIOWrapper
from pathlib import Path
from typing import IO, cast

from shipdrag_ros.errors import ImportDataError, reason_of
from shipdrag_ros.progress import PartDone

GZIP = b'\x1f\x8b'
HEAD_BYTES = 1 << 16
LINE_BYTES = 1 << 16
"""No line of a log is as long as this; of one that is, nothing is used."""

_FREE_BYTES = 64 << 20  # unpacked from any file
_SHOWN_LINES = 1000  # between two calls of the progress
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
                check_unpacked(path, size, packed)
    except BROKEN as error:
        if raw:
            return raw  # whoever reads it says how far it goes
        why = reason_of(error)
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
    with path.open('rb') as raw, ExitStack() as stack:
        file: IO[bytes] = raw
        if raw.peek(2)[:2] == GZIP:
            file = cast(IO[bytes], stack.enter_context(gzip.open(raw)))
        if cast(BufferedReader, file).peek(2)[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
            raise ImportDataError(f'{str(path)!r} is in UTF-16; save it as UTF-8')
        yield raw, file


def lines_of(
    path: Path,
    longest: int,
    *,
    encoding: str = 'utf-8-sig',
    newline: str | None = None,
    progress: PartDone | None = None,
) -> Iterator[str]:
    """
    Yield the lines of a text file, of one that is too long its first characters.

    Parameters
    ----------
    path
        Plain or packed with gzip.
    longest
        Characters of a line.
    encoding, newline
        As `TextIOWrapper` takes them.
    progress
        Called with how many bytes are read, and of how many.
    """
    number, size, total = 0, 0, path.stat().st_size
    with opened(path) as (raw, file):
        reader = cast(BufferedReader, file)
        text = TextIOWrapper(reader, encoding=encoding, errors='replace', newline=newline)
        whole = True
        while piece := text.readline(longest):
            if whole:
                yield piece
                number += 1
                if progress is not None and number % _SHOWN_LINES == 0:
                    progress(raw.tell(), total)
            whole = len(piece) < longest or piece.endswith('\n')
            size += len(piece)
            check_unpacked(path, size, raw)


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
            # a line ends with LF, CR or both; a serial adapter writes CR alone
            for line in lines_of(
                self.path, self._longest, encoding=self._encoding, progress=self._progress
            ):
                self.number += 1
                if len(line) >= self._longest - 1:
                    self.too_long.append(self.number)
                else:
                    yield line.strip()
        except BROKEN as error:
            self.damage = f'after line {self.number}: {error}'


def check_unpacked(path: Path, size: int, raw: IO[bytes]) -> None:
    """
    Refuse a packed file that unpacks to much more than any log does.

    Parameters
    ----------
    path
    size
        Of what was unpacked.
    raw
        From which, see `opened`.

    Raises
    ------
    ImportDataError
        Naming both sizes.
    """
    if size > _FREE_BYTES and size > _RATIO * max(raw.tell(), 1):
        raise ImportDataError(
            f'{str(path)!r} unpacks to more than {_RATIO} times its size; no log does. Unpack it '
            'and look'
        )
