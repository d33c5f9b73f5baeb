# SPDX-License-Identifier: Apache-2.0
"""Logs of Signal K: deltas, one in a line, as the server's data log and others write them."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Iterator
from datetime import UTC
from math import cos, pi, remainder, sin
from typing import Any, TypeGuard

from shipdrag_ros.samples import SHAFTS, Channel
from shipdrag_ros.sources.format import CERTAIN, GEAR, NO, POSSIBLE, Format, Head, Job
from shipdrag_ros.sources.log import Log, iso_ns
from shipdrag_ros.sources.opened import Lines
from shipdrag_ros.sources.stream import Origin, Reading, StreamResult, Tally, read_stream

_SELF = 'vessels.self'
_CONTEXT = re.compile(r'"context"\s*:\s*"([^"]{1,200})"')
_DEEPEST = 12  # brackets in a delta
_PLAIN: dict[str, tuple[Channel, int, Callable[[float], float]]] = {
    'navigation.speedThroughWater': (Channel.SPEED_THROUGH_WATER, 0, float),
    'navigation.speedThroughWaterLongitudinal': (Channel.SPEED_THROUGH_WATER, 1, float),
    'navigation.speedOverGround': (Channel.SPEED_OVER_GROUND, 0, float),
    'navigation.headingTrue': (Channel.HEADING, 0, lambda a: remainder(pi / 2 - a, 2 * pi)),
    'navigation.headingMagnetic': (Channel.HEADING, 1, lambda a: remainder(pi / 2 - a, 2 * pi)),
    'steering.rudderAngle': (Channel.RUDDER, 0, float),
    'environment.depth.belowSurface': (Channel.DEPTH, 0, float),
}
_SPEED, _ANGLE = 'environment.wind.speedApparent', 'environment.wind.angleApparent'
_WIND = Origin(0, 'environment.wind')
_TOGETHER_NS = 2_000_000_000  # a wind's speed and angle that far apart are not one measurement


def _score(head: Head) -> float:
    if not head.lines or head.share(lambda line: '{' in line) < 0.5:
        return NO
    if head.share(lambda line: '"updates"' in line or '"$source"' in line) > 0.3:
        return CERTAIN
    return POSSIBLE if head.share(lambda line: '"path"' in line) > 0.3 else NO


def _open(job: Job, log: Log) -> StreamResult:
    gear, own = job.options.get('gear'), _own_vessel(job)
    return read_stream(
        job,
        log,
        'signalk',
        lambda tally: _Deltas(tally, gear, own).read(job),
        about={'gear': gear},
    )


def _own_vessel(job: Job) -> str:
    """Return the context of the ship of the log: `vessels.self`, or the one named most often."""
    counts = Counter(found[1] for line in Lines(job.source) for found in _CONTEXT.finditer(line))
    if _SELF in counts or not counts:
        return _SELF
    return counts.most_common(1)[0][0]


class _Deltas:
    """Takes deltas apart, and puts the two halves of a wind together."""

    def __init__(self, tally: Tally, gear: float | None, own: str) -> None:
        self._tally = tally
        self._gear = gear
        self._own = own
        self._winds: dict[tuple[str, str], tuple[int, float]] = {}

    def read(self, job: Job) -> Iterator[Reading]:
        lines = Lines(job.source)
        for line in lines:
            self._tally.records += 1
            if line:
                yield from self._line(line)
        if lines.damage:
            self._tally.note(f'The log could not be read to its end, {lines.damage}.')
        if lines.too_long:
            self._tally.note(f'{lines.too_long} lines were too long for a delta.')

    def _line(self, line: str) -> Iterator[Reading]:
        text = line[line.find('{') :] if '{' in line[:200] else line  # behind a time or a source
        depth = 0
        for letter in text:  # before the parser, which goes as deep as its text
            depth += letter in '[{'
            depth -= letter in ']}'
            if depth > _DEEPEST:
                self._tally.reject('line', f'more than {_DEEPEST} brackets deep', line)
                return
        try:
            delta = json.loads(text)
        except (ValueError, RecursionError):
            self._tally.reject('line', 'no JSON', line)
            return
        updates = delta.get('updates') if isinstance(delta, dict) else None
        if not isinstance(updates, list):
            self._tally.reject('line', 'no delta', line)
            return
        if not self._is_own(delta.get('context')):
            return
        for update in updates:
            if isinstance(update, dict):
                yield from self._update(update)

    def _is_own(self, context: Any) -> bool:
        """Say whether a delta is of the ship of the log, and not of another that AIS shows."""
        if context in (None, '', _SELF, self._own):
            return True
        if not isinstance(context, str) or context != self._own:
            self._tally.note(f'The own vessel is taken to be {self._own}.')
            self._tally.not_used['deltas of other vessels'] += 1
            return False
        return True

    def _update(self, update: dict[str, Any]) -> Iterator[Reading]:
        stamp_ns = iso_ns(str(update.get('timestamp', '')), UTC)
        values = update.get('values')
        if not isinstance(values, list):
            return
        if stamp_ns is None:
            self._tally.reject('time', 'no time of an update', str(update.get('timestamp')))
            return
        source = update.get('$source') or update.get('source') or ''
        if isinstance(source, dict):
            source = source.get('label', '')
        for value in values:
            if isinstance(value, dict) and isinstance(value.get('path'), str):
                yield from self._value(value['path'], value.get('value'), stamp_ns, str(source))

    def _value(self, path: str, value: Any, stamp_ns: int, source: str) -> Iterator[Reading]:
        name = f'{path} {source}'.strip()
        if path == 'navigation.position':
            where = value if isinstance(value, dict) else {}
            latitude, longitude = where.get('latitude'), where.get('longitude')
            if _is_number(latitude) and _is_number(longitude) and abs(latitude) <= 90.0:
                origin = Origin(0, name, 'deg')
                channel = Channel.POSITION_GEODETIC
                yield Reading(channel, origin, stamp_ns, float(latitude), float(longitude))
            else:
                self._tally.reject('position', 'no latitude and longitude', str(value))
        elif path in _PLAIN:
            channel, rank, turn = _PLAIN[path]
            if _is_number(value):
                if path == 'navigation.headingMagnetic':
                    self._tally.note(
                        'A heading is MAGNETIC: good for finding turns, not for directions over '
                        'ground.'
                    )
                yield Reading(channel, Origin(rank, name), stamp_ns, turn(float(value)))
            else:
                self._tally.reject(channel.input, 'no number', f'{path} {value}')
        elif path in (_SPEED, _ANGLE):
            yield from self._wind(path, value, stamp_ns, source)
        elif path.startswith('propulsion.') and path.endswith('.revolutions'):
            yield from self._engine(path, value, stamp_ns, source)
        else:
            self._tally.not_used[path] += 1

    def _wind(self, path: str, value: Any, stamp_ns: int, source: str) -> Iterator[Reading]:
        if not _is_number(value):
            self._tally.reject('wind_apparent', 'no number', f'{path} {value}')
            return
        self._winds[path, source] = (stamp_ns, float(value))
        speed, angle = self._winds.get((_SPEED, source)), self._winds.get((_ANGLE, source))
        if speed is None or angle is None or abs(speed[0] - angle[0]) > _TOGETHER_NS:
            return
        del self._winds[_SPEED, source], self._winds[_ANGLE, source]
        origin = Origin(0, f'{_WIND.name} {source}'.strip())
        ahead, port = -speed[1] * cos(angle[1]), speed[1] * sin(angle[1])
        yield Reading(Channel.WIND_APPARENT, origin, max(speed[0], angle[0]), ahead, port)

    def _engine(self, path: str, value: Any, stamp_ns: int, source: str) -> Iterator[Reading]:
        if self._gear is None:
            self._tally.not_used[f'{path} (of the engine: --gear RATIO makes it the shaft)'] += 1
            return
        if not _is_number(value):
            self._tally.reject('shaft', 'no number', f'{path} {value}')
            return
        name = path.split('.')[1]
        place = {'starboard': 1, '1': 1, '2': 2, '3': 3}.get(name.lower(), 0)
        rate = float(value) * 2.0 * pi / self._gear
        yield Reading(SHAFTS[place], Origin(0, f'{path} {source}'.strip()), stamp_ns, rate)


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e12


FORMAT = Format(
    name='signalk',
    kind='a log of Signal K',
    about='Deltas, one in a line: speedThroughWater, speedOverGround, position, heading, rudder, '
    'apparent wind, depth below the surface; of the own vessel, each input from one source. '
    'Revolutions are those of the engine and are taken with --gear.',
    score=_score,
    read=_open,
    options=(GEAR,),
)
