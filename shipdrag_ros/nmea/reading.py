# SPDX-License-Identifier: Apache-2.0
"""
A line of text as a sentence of NMEA 0183: what it measures and when, or why it is none.

The one reader of files and of wires. The checksum and the names of the fields are
pynmeagps'. Its message objects are not used: they refuse a whole sentence for a bad
field that is not needed here, and take `nan` and `1_0` for numbers.
"""

from __future__ import annotations

import re
from collections import Counter
from datetime import date
from enum import Enum
from functools import lru_cache
from typing import Any, NamedTuple, TypeVar

from shipdrag_ros.nmea.sentences import (
    READERS,
    TIMED,
    Fields,
    Mounting,
    NoValue,
    has_fix,
)
from shipdrag_ros.samples import SECOND_NS, Channel

START = re.compile('[$!]')
"""Of a sentence; none has either inside."""

DAY_NS = 86_400 * SECOND_NS
_LIMIT_NS = 2**31 * SECOND_NS  # of the stamp of a message
_CENTURY_TURNS = 80  # 80 to 99 are years of the 20th century
_ADDRESS = re.compile('[A-Z][A-Z0-9]{4}|P[A-Z0-9]{2,}')
_TIME = re.compile(r'(\d\d)(\d\d)(\d\d)(?:\.(\d+))?')
_DATE = re.compile(r'(\d\d)(\d\d)(\d\d)')
_RANK = {kind: place for place, kind in enumerate(READERS)}
_KEPT = 1 << 14  # sentences; instruments say the same again and again

AnySource = TypeVar('AnySource', bound=tuple[Any, ...])


class Checksum(Enum):
    """Whether a sentence must have a checksum; one it has must be right."""

    REQUIRED = 'required'
    OPTIONAL = 'optional'


class SentenceSource(NamedTuple):
    """Who sends an input; the better source is the smaller."""

    rank: int
    detail: str
    talker: str
    kind: str

    def __str__(self) -> str:
        return f'{self.talker}{self.kind} {self.detail}'.strip()


class SentenceTime(NamedTuple):
    """
    The time in a sentence.

    Attributes
    ----------
    of_day_ns
        Since midnight [ns]; a leap second is that of the midnight after it.
    day
        Days since 1970; None if the sentence has no date.
    trusted
        Whether the source calls its fix valid; ZDA always.
    """

    of_day_ns: int
    day: int | None
    trusted: bool


class SentenceValue(NamedTuple):
    """A value of a sentence, in the unit of its channel, and who sends it."""

    channel: Channel
    source: SentenceSource
    a: float
    b: float


class Sentence(NamedTuple):
    """
    A sentence whose checksum is right.

    Attributes
    ----------
    talker, kind
        Parts of its address, `GP` and `RMC` for instance; a proprietary
        sentence is all talker.
    time
        The time that it states, or why it states none; None of a kind that need not.
    values
        What it measures.
    refused
        Channels that it should hold and does not, and why.
    """

    talker: str
    kind: str
    time: SentenceTime | NoValue | None
    values: tuple[SentenceValue, ...]
    refused: tuple[tuple[Channel, str], ...]


class SentenceReader:
    """
    Reads sentences.

    Parameters
    ----------
    mounting
        What they do not say about the ship.
    checksum
        Whether they must have one.
    """

    def __init__(
        self, mounting: Mounting | None = None, checksum: Checksum = Checksum.REQUIRED
    ) -> None:
        self._mounting = mounting or Mounting()
        self._checksum = checksum
        self._repeated = lru_cache(_KEPT)(self._read)

    def read(self, text: str) -> Sentence | str:
        """
        Return what follows a `$`, without blanks around it, or why it is no sentence.
        """
        # one that states a time is never said again
        return self._read(text) if text[2:5] in TIMED else self._repeated(text)

    def _read(self, text: str) -> Sentence | str:
        content, star, stated = text.partition('*')
        if not star and self._checksum is Checksum.REQUIRED:
            return 'without checksum'
        if star and (len(stated) != 2 or checksum_of(content) != stated.upper()):
            return 'wrong checksum'
        address, *texts = content.split(',')
        if ' ' in content or '\t' in content:
            texts = [each.strip() for each in texts]
        parts = _parts(address)
        if parts is None:
            return 'no address'
        talker, kind = parts
        name = kind or talker  # a proprietary one is all talker
        if name not in READERS and name not in TIMED:
            return Sentence(talker, kind, None, (), ())
        fields = Fields(name, texts)
        values, refused = [], []
        for listed, read in READERS.get(name, ()):
            try:
                value = read(fields, self._mounting)
            except NoValue as reason:
                refused.append((listed, reason.reason))
                continue
            if value is not None:
                a, b, detail, channel = value
                source = _source(name, detail, talker, kind)
                where = listed if channel is None else channel
                values.append(SentenceValue(where, source, a, b))
        time = _time(fields) if name in TIMED else None
        return Sentence(talker, kind, time, tuple(values), tuple(refused))


@lru_cache(256)
def _parts(address: str) -> tuple[str, str] | None:
    """Return talker and kind; None of what is no address."""
    if not _ADDRESS.fullmatch(address):
        return None
    return (address, '') if address[0] == 'P' else (address[:2], address[2:])


@lru_cache(256)
def _source(name: str, detail: str, talker: str, kind: str) -> SentenceSource:
    return SentenceSource(_RANK[name], detail, talker, kind)


def checksum_of(content: str) -> str:
    """
    Return the two digits behind the star, of the characters before it.
    """
    total = int.from_bytes(content.encode('latin-1', 'replace'), 'little')
    half = 1 << len(content).bit_length() + 2
    while half >= 8:  # fold the upper bytes onto the lower ones
        total ^= total >> half
        half >>= 1
    return f'{total & 0xFF:02X}'


def best(counts: Counter[AnySource]) -> AnySource:
    """
    Return the one source of an input, by the number of values of each.

    The first in the order of `SentenceSource` of those with at least half as many
    values as the most frequent: two instruments of different place or
    scale are never mixed.
    """
    most = max(counts.values())
    return min(source for source, n in counts.items() if 2 * n >= most)


def _time(fields: Fields) -> SentenceTime | NoValue | None:
    if not fields['time']:
        return None
    try:
        of_day_ns, day = _of_day_ns(fields['time']), _day(fields)
    except NoValue as reason:
        return reason
    return SentenceTime(of_day_ns, day, fields.kind == 'ZDA' or has_fix(fields))


@lru_cache(256)  # several sentences of one fix have its time
def _of_day_ns(text: str) -> int:
    found = _TIME.fullmatch(text)
    if found is None:
        raise NoValue('no time of day', text)
    hour, minute, second = int(found[1]), int(found[2]), int(found[3])
    leap = (hour, minute, second) == (23, 59, 60)
    if hour > 23 or minute > 59 or (second > 59 and not leap):
        raise NoValue('no time of day', text)
    fraction_ns = int((found[4] or '')[:9].ljust(9, '0'))
    return (3600 * hour + 60 * minute + second) * SECOND_NS + fraction_ns


def _day(fields: Fields) -> int | None:
    if fields.kind == 'ZDA':
        texts = [fields[name] for name in ('year', 'month', 'day')]
        return _days(*texts) if all(texts) else None
    return _rmc_day(fields['date']) if fields.kind == 'RMC' and fields['date'] else None


@lru_cache(64)
def _rmc_day(text: str) -> int:
    found = _DATE.fullmatch(text)
    if found is None:
        raise NoValue('no possible date', text)
    century = 19 if int(found[3]) >= _CENTURY_TURNS else 20
    return _days(f'{century}{found[3]}', found[2], found[1])


@lru_cache(64)
def _days(*texts: str) -> int:
    """Return the days since 1970 of year, month and day."""
    if not all(text.isdecimal() and text.isascii() for text in texts):
        raise NoValue('no possible date', ','.join(texts))
    try:
        days = days_of(date(*map(int, texts)))
    except (ValueError, OverflowError):
        raise NoValue('no possible date', '-'.join(texts)) from None
    if not 0 <= days * DAY_NS < _LIMIT_NS - DAY_NS:
        raise NoValue('no possible date', '-'.join(texts))
    return days


def days_of(day: date) -> int:
    """
    Return the days since 1970.
    """
    return (day - date(1970, 1, 1)).days
