# SPDX-License-Identifier: Apache-2.0
"""
Tracks of GPX: positions, and speeds where they are stated.

The parser is expat's, which fetches nothing; a declaration of an entity ends
the reading, so that none can be expanded.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import UTC
from xml.parsers import expat

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import Channel
from shipdrag_ros.sources.format import CERTAIN, LIKELY, NO, Format, Head, Job
from shipdrag_ros.sources.log import Log, iso_ns
from shipdrag_ros.sources.opened import check_unpacked, opened
from shipdrag_ros.sources.stream import Origin, Reading, StreamResult, Tally, read_stream

_CHUNK = 1 << 16
_DEEPEST = 32
_LONGEST = 100  # characters of a time or a speed
_POSITION = Origin(0, 'trkpt')
_SPEED = Origin(0, 'speed', 'm/s')
_NUMBER = re.compile(r'[-+]?\d{1,10}(\.\d{1,40})?([eE][-+]?\d{1,2})?')


def _score(head: Head) -> float:
    start = head.raw[:4096].lower()
    if b'<gpx' in start:
        return CERTAIN
    return LIKELY if start.lstrip().startswith(b'<?xml') and head.path.suffix == '.gpx' else NO


def _open(job: Job, log: Log) -> StreamResult:
    return read_stream(job, log, 'gpx', lambda tally: _read(job, tally))


def _read(job: Job, tally: Tally) -> Iterator[Reading]:
    points = _Points(tally)
    with opened(job.source) as (raw, file):
        size = 0
        while True:
            try:
                chunk = file.read(_CHUNK)
                size += len(chunk)
                if file is not raw:
                    check_unpacked(job.source, size, raw.tell())
                points.feed(chunk)
            except (expat.ExpatError, OSError, EOFError) as error:
                tally.note(f'The file is damaged, {error}; this is what stands before.')
                chunk = b''
            yield from points.take()
            if not chunk:
                break
            if job.progress is not None:
                job.progress(raw.tell(), job.source.stat().st_size)


class _Points:
    """The points of a track, while its XML is read."""

    def __init__(self, tally: Tally) -> None:
        self._tally = tally
        self._parser = expat.ParserCreate(namespace_separator=' ')
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._text
        self._parser.EntityDeclHandler = self._refuse
        self._parser.StartDoctypeDeclHandler = self._refuse
        self._depth = 0
        self._where: dict[str, str] | None = None
        self._texts: dict[str, str] = {}
        self._name = ''
        self._found: list[Reading] = []

    def feed(self, chunk: bytes) -> None:
        self._parser.Parse(chunk, not chunk)

    def take(self) -> list[Reading]:
        found, self._found = self._found, []
        return found

    def _refuse(self, *_: object) -> None:
        raise ImportDataError(
            'the file declares XML entities or a document type, which no GPX needs and which may '
            'unpack without end; it is not read. Export the track again'
        )

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise ImportDataError(f'the elements of the file stand more than {_DEEPEST} deep')
        self._name = name.rpartition(' ')[2]
        if self._name == 'trkpt':
            self._where = attributes
            self._texts = {}
        elif self._name in ('wpt', 'rtept'):
            self._tally.not_used[self._name] += 1

    def _text(self, text: str) -> None:
        if self._where is None or self._name not in ('time', 'speed'):
            return
        have = self._texts.get(self._name, '')
        if len(have) <= _LONGEST:
            self._texts[self._name] = have + text

    def _end(self, name: str) -> None:
        self._depth -= 1
        self._name = ''
        if name.rpartition(' ')[2] == 'trkpt' and self._where is not None:
            where, self._where = self._where, None
            self._tally.records += 1
            self._point(where)

    def _point(self, where: dict[str, str]) -> None:
        text = self._texts.get('time', '').strip()
        stamp_ns = iso_ns(text, UTC)
        if stamp_ns is None:
            self._tally.reject('time', 'no time of the point' if not text else 'no time', text)
            return
        latitude, longitude = where.get('lat', ''), where.get('lon', '')
        if _is_coordinate(latitude, 90.0) and _is_coordinate(longitude, 180.0):
            self._found.append(
                Reading(
                    Channel.POSITION_GEODETIC,
                    _POSITION,
                    stamp_ns,
                    float(latitude),
                    float(longitude),
                )
            )
        else:
            self._tally.reject('position', 'no latitude and longitude', f'{latitude},{longitude}')
        if speed := self._texts.get('speed', '').strip():
            if _NUMBER.fullmatch(speed):
                self._found.append(
                    Reading(Channel.SPEED_OVER_GROUND, _SPEED, stamp_ns, float(speed))
                )
            else:
                self._tally.reject('speed_over_ground', 'not a number', speed)


def _is_coordinate(text: str, largest: float) -> bool:
    return _NUMBER.fullmatch(text) is not None and abs(float(text)) <= largest


FORMAT = Format(
    name='gpx',
    kind='a GPX track',
    about='The points of tracks with their times, and their speeds [m/s]; ways and routes have no '
    'times and are counted.',
    score=_score,
    read=_open,
)
