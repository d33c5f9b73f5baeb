# SPDX-License-Identifier: Apache-2.0
"""
The points of tracks with their times, and their speeds [m/s]; ways and routes have no times
and are counted.
"""

# The parser fetches nothing; a document type, which alone can declare entities, ends the reading.

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from datetime import UTC
from xml.etree.ElementTree import ParseError, XMLParser

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import Channel
from shipdrag_ros.sources.format import (
    BROKEN,
    CERTAIN,
    LIKELY,
    NO,
    Head,
    Job,
    check_unpacked,
    opened,
)
from shipdrag_ros.sources.log import Tally, iso_ns
from shipdrag_ros.sources.stream import Origin, Reading, stream_format

_CHUNK = 1 << 16
_DEEPEST = 32
_LONGEST = 100  # characters of a time or a speed
_POSITION = Origin(0, 'trkpt')
_SPEED = Origin(0, 'speed', 'm/s')
_DO = 'export the recorded track with its times, or its points as CSV for --rate HZ'
_NUMBER = re.compile(r'[-+]?\d{1,10}(\.\d{1,40})?([eE][-+]?\d{1,2})?')


def _score(head: Head) -> float:
    start = head.raw[:4096].lower()
    if b'<gpx' in start:
        return CERTAIN
    return LIKELY if start.lstrip().startswith(b'<?xml') and head.path.suffix == '.gpx' else NO


def _read(job: Job, tally: Tally) -> Iterator[Reading]:
    points = _Points(tally)
    parser = XMLParser(target=points)
    size, total, chunk = 0, job.source.stat().st_size, b' '
    with opened(job.source) as (raw, file):
        while chunk:
            try:
                chunk = file.read(_CHUNK)
                size += len(chunk)
                check_unpacked(job.source, size, raw)
                if chunk:
                    parser.feed(chunk)
                else:
                    parser.close()
            except (ParseError, LookupError, ValueError, *BROKEN) as error:
                tally.note(f'The file is damaged, {error}; this is what stands before.')
                chunk = b''
            yield from points.found
            points.found.clear()
            if job.progress is not None:
                job.progress(raw.tell(), total)
    if not tally.records:
        tally.note(f'It holds no point of a track: {_DO}.')


class _Points:
    """The points of a track, while its XML is read."""

    def __init__(self, tally: Tally) -> None:
        self.found: list[Reading] = []
        self._tally = tally
        self._depth = 0
        self._name = ''
        self._point: dict[str, str] | None = None  # attributes, time and speed of the open one

    def doctype(self, *_: object) -> None:
        """Refuse what may declare entities."""
        raise ImportDataError(
            'the file declares XML entities or a document type, which no GPX needs and which may '
            'unpack without end; it is not read. Export the track again'
        )

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Begin an element."""
        self._depth += 1
        if self._depth > _DEEPEST:
            raise ImportDataError(f'the elements of the file stand more than {_DEEPEST} deep')
        self._name = name.rpartition('}')[2]
        if self._name == 'trkpt':
            self._point = {**attributes, 'time': '', 'speed': ''}
        elif self._name in ('wpt', 'rtept'):
            self._tally.not_used[self._name] += 1

    def data(self, text: str) -> None:
        """Take text of the element."""
        point = self._point
        if point is not None and self._name in ('time', 'speed'):
            point[self._name] = (point[self._name] + text)[:_LONGEST]

    def end(self, name: str) -> None:
        """End an element."""
        self._depth -= 1
        self._name = ''
        if name.rpartition('}')[2] == 'trkpt' and self._point is not None:
            self._tally.records += 1
            self._take(self._point)
            self._point = None

    def _take(self, point: Mapping[str, str]) -> None:
        text, speed = point['time'].strip(), point['speed']
        lat, lon = point.get('lat', ''), point.get('lon', '')
        stamp_ns = iso_ns(text, UTC)
        if stamp_ns is None:
            self._tally.reject('time', 'no time' if text else f'no time of the point: {_DO}', text)
            return
        if _is_coordinate(lat, 90.0) and _is_coordinate(lon, 180.0):
            where = float(lat), float(lon)
            self.found.append(Reading(Channel.POSITION_GEODETIC, _POSITION, stamp_ns, *where))
        else:
            self._tally.reject('position', 'no latitude and longitude', f'{lat},{lon}')
        if _NUMBER.fullmatch(speed.strip()):
            self.found.append(Reading(Channel.SPEED_OVER_GROUND, _SPEED, stamp_ns, float(speed)))
        elif speed.strip():
            self._tally.reject('speed_over_ground', 'not a number', speed)


def _is_coordinate(text: str, largest: float) -> bool:
    return _NUMBER.fullmatch(text) is not None and abs(float(text)) <= largest


FORMAT = stream_format(name='gpx', kind='a GPX track', about=__doc__, score=_score, read=_read)
