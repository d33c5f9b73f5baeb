# SPDX-License-Identifier: Apache-2.0
"""
What a format of log files declares: how it is recognised, read and shown, and its options.

Its files come from outside, plain or packed: they are read in a memory and a time that they
cannot fill.

Options
-------
--date YYYY-MM-DD
    date (UTC) of the first time, for a log that has only times of day; of NMEA 0183 also for
    one that is whole cycles of the GPS week (1024 weeks) early
--gear RATIO
    revolutions of the engine for one of the shaft: takes the shaft from the engine, of which
    alone NMEA 2000 and Signal K hold; 1 without a gear
--rate HZ
    without times: rows of a table, or frames of NMEA 2000, a second [Hz]; above 0 [Hz]
--transducer M
    depth of the echo sounder below the surface, where the log does not state it [m]
"""

from __future__ import annotations

import codecs
import gzip
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from datetime import date
from functools import cached_property
from io import BufferedReader, TextIOWrapper
from math import inf, nan
from pathlib import Path
from typing import IO, Any, NamedTuple, cast

from shipdrag_ros.errors import ImportDataError, reason_of
from shipdrag_ros.progress import PartDone
from shipdrag_ros.sources.log import ImportResult, Log

CERTAIN, LIKELY, POSSIBLE, NO = 1.0, 0.7, 0.3, 0.0
"""Scores of `Format.score`; the highest of all formats is taken."""

_TEXT_PER_ZERO = 100  # bytes
GZIP = b'\x1f\x8b'
HEAD_BYTES = 1 << 16
LINE_BYTES = 1 << 16
"""No line of a log is as long as this; of one that is, nothing is used."""
_FREE_BYTES = 64 << 20  # unpacked from any file
_SHOWN_LINES = 1000  # between two calls of the progress
_RATIO = 200  # text packs to a tenth, a bomb to a thousandth
BROKEN = (OSError, EOFError, zlib.error)
"""What reading a damaged file raises."""


@dataclass(frozen=True)
class Head:
    """
    The beginning of a file, as formats are recognised by it.

    Attributes
    ----------
    path
    raw
        Its first bytes, unpacked where it is packed with gzip.
    """

    path: Path
    raw: bytes

    @cached_property
    def lines(self) -> tuple[str, ...]:
        """The first lines that are not blank, as text; none of a binary file."""
        # a serial line leaves a few zeros in a text when it is plugged
        if self.raw.count(0) > len(self.raw) // _TEXT_PER_ZERO:
            return ()
        texts = self.raw.decode('utf-8', 'replace').removeprefix('\ufeff').splitlines()
        whole = texts if len(texts) == 1 else texts[:-1]  # the last one is cut
        return tuple(line.strip() for line in whole if line.strip())[:200]

    def share(self, is_one: Callable[[str], object]) -> float:
        """Return which share of the lines fulfils a condition."""
        return sum(bool(is_one(line)) for line in self.lines) / max(len(self.lines), 1)


def head_of(path: Path) -> Head:
    """
    Read the beginning of a file; of a folder, nothing.

    Raises
    ------
    ImportDataError
        If it cannot be read or is empty.
    """
    return Head(path, b'' if path.is_dir() else beginning(path))


@dataclass(frozen=True)
class Option:
    """
    An option of a format on the command line.

    Attributes
    ----------
    flag
        `--date` for instance.
    metavar, help
        As argparse shows them; without a metavar it is a switch. Without a help it is that which
        the docstring of the format has under `Options`.
    read
        Text to value; a ValueError or an ImportDataError says why not.
    many
        Whether it may be given more than once.
    """

    flag: str
    metavar: str
    help: str = ''
    read: Callable[[str], Any] = str
    many: bool = False

    @property
    def key(self) -> str:
        """Its name in `Job.options`."""
        return self.flag.lstrip('-').replace('-', '_')


def _date(text: str) -> date:
    try:
        return date.fromisoformat(text)
    except ValueError:
        raise ImportDataError(f'{text!r}, expected YYYY-MM-DD') from None


def _positive(text: str) -> float:
    return _number(text, 'a number above 0', lambda value: 0.0 < value < inf)


def _depth_m(text: str) -> float:
    return _number(text, 'a depth from 0 to 100 [m]', lambda value: 0.0 <= value < 100.0)


def _number(text: str, expected: str, fits: Callable[[float], bool]) -> float:
    try:
        value = float(text)
    except ValueError:
        value = nan
    if not fits(value):
        raise ImportDataError(f'{text!r}, expected {expected}')
    return value


DATE = Option('--date', 'YYYY-MM-DD', read=_date)
GEAR = Option('--gear', 'RATIO', read=_positive)
RATE = Option('--rate', 'HZ', read=_positive)
TRANSDUCER = Option('--transducer', 'M', read=_depth_m)


@dataclass(frozen=True)
class Job:
    """
    A file to read.

    Attributes
    ----------
    source
        The file.
    options
        Values by `Option.key`; one that was not given is not there.
    progress
        Called with how much is read, and of how much.
    """

    source: Path
    options: Mapping[str, Any] = field(default_factory=dict)
    progress: PartDone | None = None


class Format(NamedTuple):
    """
    A format of log files.

    Attributes
    ----------
    name
        As `--format` takes it.
    kind
        What a file of it is called in a sentence.
    about
        What is read of it, a line of the help.
    score
        How well the beginning of a file fits, from `NO` to `CERTAIN`.
    read
        Reads a file into a log, and says what became of it.
    options
        Those that it knows.
    chosen_by
        Key of an option that chooses it; '' for none.
    by_head
        Whether the score comes from the first bytes alone, and not from the file.
    """

    name: str
    kind: str
    about: str | None
    score: Callable[[Head], float]
    read: Callable[[Job, Log], ImportResult]
    options: tuple[Option, ...] = ()
    chosen_by: str = ''
    by_head: bool = True


def best_of(formats: Sequence[Format], head: Head) -> Format:
    """
    Return the format of a file.

    Raises
    ------
    ImportDataError
        If it has none of them.
    """
    scores = {each.name: each.score(head) for each in formats}
    best = max(formats, key=lambda each: scores[each.name])
    if scores[best.name] <= NO:
        if head.path.is_dir():
            raise ImportDataError(f'{str(head.path)!r} is a folder that is no bag; give a file')
        known = ', '.join(each.kind for each in formats)
        raise ImportDataError(
            f'{str(head.path)!r} is of no format known here; it begins with '
            f'{head.raw[:16]!r}. Known are {known}; say which it is with --format, or save it '
            'as a table (CSV)'
        )
    return best


def missing_library(job: Job, kind: str, library: str) -> ImportDataError:
    """
    Return the error of a file whose format needs a library that is not installed.

    Parameters
    ----------
    job
    kind
        What the file is, with its article.
    library
        One of the extra `logs`.
    """
    return ImportDataError(
        f"{str(job.source)!r} is {kind}, which needs {library}: pip install 'shipdrag_ros[logs]'"
    )


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


@dataclass
class Lines:
    """
    The lines of a text file, without blanks around them.

    Attributes
    ----------
    path
        Plain or packed with gzip.
    encoding
    longest
        A line of as many characters is left out.
    progress
        Called with how many bytes are read, and of how many.
    number
        Lines read so far.
    too_long
        Numbers of the lines that were left out.
    damage
        Why the file could not be read to its end; '' if it could.
    """

    path: Path
    encoding: str = 'utf-8-sig'
    longest: int = LINE_BYTES
    progress: PartDone | None = None
    number: int = field(default=0, init=False)
    too_long: list[int] = field(default_factory=list, init=False)
    damage: str = field(default='', init=False)

    def __iter__(self) -> Iterator[str]:
        self.number, self.too_long, self.damage = 0, [], ''
        try:
            # a line ends with LF, CR or both; a serial adapter writes CR alone
            for line in lines_of(
                self.path, self.longest, encoding=self.encoding, progress=self.progress
            ):
                self.number += 1
                if len(line) >= self.longest - 1:
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
