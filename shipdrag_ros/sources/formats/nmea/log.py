# SPDX-License-Identifier: Apache-2.0
"""
A log of NMEA 0183 as sentences, and a count of what is none.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from datetime import UTC
from fractions import Fraction
from pathlib import Path

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.nmea.reading import START, checksum_of
from shipdrag_ros.progress import PartDone
from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.sources.log import LIMIT_NS, Rejected, iso_ns
from shipdrag_ros.sources.opened import BROKEN, Lines, opened

_UTF_16 = (b'\xff\xfe', b'\xfe\xff')
_UTF_8_MARK = '\xef\xbb\xbf'  # as it looks in the encoding below
# every byte is a character, so that checksums are those of the bytes
_ENCODING = 'latin-1'
_LONGEST = 4096  # a sentence has 82 characters; some with a prefix have more
_TAG = re.compile(r'\\([^\\]*)\*([0-9A-Fa-f]{2})\\')
_TAGS = re.compile(f'(?:{_TAG.pattern})+')
_TAG_TIME = re.compile(r'(?:^|,)c:(\d{9,14})(?:,|$)')
_EPOCH = re.compile(r'\[?(\d{9,10}|\d{13})(\.\d+)?\]?[\s,;:]*')
_DATED = re.compile(r'(?:\w{1,40}\s+)?\[?(\d{4}-[^\]]+?)\]?[\s,;:]*')
_MILLISECONDS_FROM = 100_000_000_000  # a count of seconds that large is past the year 5000


class NmeaLog:
    """
    A log, plain or compressed with gzip.

    Parameters
    ----------
    path
        File with a sentence a line. Before a sentence may stand a TAG block,
        or the time of its receipt: seconds or milliseconds since 1970, or ISO
        8601, taken as UTC without a zone.

    Attributes
    ----------
    rejected
        Lines without a sentence by reason.
    lines
        Number of lines.
    damage
        Why the reading ended early, empty if it did not.

    Raises
    ------
    ImportDataError
        If the file cannot be read, is empty or in UTF-16.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rejected: dict[str, Rejected] = {}
        self.lines = 0
        self.damage = ''
        try:
            with opened(self.path) as (_, file):
                start = file.read(2)
        except BROKEN as error:
            reason = getattr(error, 'strerror', None) or str(error)
            raise ImportDataError(
                f'{str(path)!r} cannot be read: {reason}; give a log of NMEA 0183'
            ) from error
        if not start:
            raise ImportDataError(f'{str(path)!r} is empty; give a log with a sentence a line')
        if start in _UTF_16:
            raise ImportDataError(f'{str(path)!r} is in UTF-16; save it as UTF-8')

    def text(self, limit_bytes: int) -> str | None:
        """
        Return the whole log, or None if it is longer or no text in UTF-8.
        """
        with opened(self.path) as (_, file):
            try:
                raw = file.read(limit_bytes + 1)
                return None if len(raw) > limit_bytes else raw.decode()
            except (*BROKEN, UnicodeDecodeError):
                return None

    def texts(self, progress: PartDone | None = None) -> Iterator[tuple[int, str, int | None]]:
        """
        Yield line, text and time of receipt [ns] of what may be sentences, in their order.

        Parameters
        ----------
        progress
            Called with how many bytes are read, and of how many.
        """
        lines = Lines(self.path, encoding=_ENCODING, longest=_LONGEST, progress=progress)
        for line in lines:
            if line[:1] == '$' and line.rfind('$') == 0 and '!' not in line:
                yield lines.number, line[1:].strip(), None
            elif line:
                yield from self._of_line(lines.number, line.removeprefix(_UTF_8_MARK))
        self.lines, self.damage = lines.number, lines.damage
        for number in lines.too_long:
            self.reject(f'longer than {_LONGEST} characters', number, '')

    def lines_of(self, places: Collection[int]) -> dict[int, tuple[int, str]]:
        """
        Return line and text of what stands at some places among the texts.
        """
        left, found = set(places), {}
        texts = NmeaLog(self.path).texts() if left else iter(())
        for place, (line, text, _) in enumerate(texts):
            if place in left:
                found[place] = line, text
                left.remove(place)
                if not left:
                    break
        return found

    def _of_line(self, number: int, line: str) -> Iterator[tuple[int, str, int | None]]:
        # a lost line end leaves two sentences in a line
        prefix, *texts = START.split(line)
        if not texts:
            self.reject('no sentence', number, line)
            return
        prefix = prefix.strip()
        try:
            receive_ns = _receive_ns(prefix) if prefix else None
        except ValueError as error:
            self.reject(str(error), number, prefix)
            receive_ns = None
        for text in texts:
            yield number, text.strip(), receive_ns

    def reject(self, reason: str, number: int, text: str) -> None:
        """
        Count what is no sentence.
        """
        self.rejected.setdefault(reason, Rejected()).add(number, text)


def _receive_ns(prefix: str) -> int | None:
    """Return the time before a sentence [ns]; ValueError says why there is none."""
    if _TAGS.fullmatch(prefix):
        tags = _TAG.findall(prefix)
        if any(checksum_of(content) != checksum.upper() for content, checksum in tags):
            raise ValueError('wrong checksum of a TAG block')
        times = [found for content, _ in tags if (found := _TAG_TIME.search(content))]
        if not times:
            return None
        receive_ns = _counted_ns(times[0][1], '')
    elif epoch := _EPOCH.fullmatch(prefix):
        receive_ns = _counted_ns(epoch[1], epoch[2] or '')
    else:
        dated = _DATED.fullmatch(prefix)
        time_ns = None if dated is None else iso_ns(dated[1], UTC)
        if time_ns is None:
            raise ValueError('prefix not understood')
        receive_ns = time_ns
    if not 0 <= receive_ns < LIMIT_NS:
        raise ValueError('no possible date before it')
    return receive_ns


def _counted_ns(digits: str, fraction: str) -> int:
    count = int(digits)
    unit_ns = 1_000_000 if count >= _MILLISECONDS_FROM else SECOND_NS
    return count * unit_ns + _fraction_ns(fraction, unit_ns)


def _fraction_ns(text: str, unit_ns: int) -> int:
    """Return `.25` of a unit exactly; none without text."""
    return round(Fraction(f'0{text}') * unit_ns) if text else 0
