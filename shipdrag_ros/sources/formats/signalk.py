# SPDX-License-Identifier: Apache-2.0
"""
Deltas, one in a line: speedThroughWater, speedOverGround, position, heading, rudder, apparent
wind, depth below the surface, or below the transducer with --transducer; of the own vessel, each
input from one source. Revolutions are those of the engine and are taken with --gear.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from datetime import UTC
from itertools import accumulate
from math import pi
from typing import Any, TypeGuard

from shipdrag_ros.samples import SHAFTS, Channel
from shipdrag_ros.sources.format import CERTAIN, GEAR, NO, POSSIBLE, TRANSDUCER, Head, Job, Lines
from shipdrag_ros.sources.log import Tally, iso_ns
from shipdrag_ros.sources.stream import Origin, Reading, counted, stream_format, wind, yaw

_SELF = 'vessels.self'
_CONTEXT = re.compile(r'"context"\s*:\s*"([^"]{1,200})"')
_DEEPEST = 12  # brackets in a delta
_POSITION = 'navigation.position'
_BELOW = 'environment.depth.belowTransducer'
_SPEED, _ANGLE = 'environment.wind.speedApparent', 'environment.wind.angleApparent'
_NUMBERS: dict[str, tuple[Channel, int]] = {
    'navigation.speedThroughWater': (Channel.SPEED_THROUGH_WATER, 0),
    'navigation.speedThroughWaterLongitudinal': (Channel.SPEED_THROUGH_WATER, 1),
    'navigation.speedOverGround': (Channel.SPEED_OVER_GROUND, 0),
    'navigation.headingTrue': (Channel.HEADING, 0),
    'navigation.headingMagnetic': (Channel.HEADING, 1),
    'steering.rudderAngle': (Channel.RUDDER, 0),
    'environment.depth.belowSurface': (Channel.DEPTH, 0),
    _SPEED: (Channel.WIND_APPARENT, 0),
    _ANGLE: (Channel.WIND_APPARENT, 0),
}
_MAGNETIC = 'MAGNETIC: good for finding turns, not for directions over ground.'
_TOGETHER_NS = 2_000_000_000  # a wind's speed and angle that far apart are not one measurement
_ENGINE = re.compile(r'propulsion\.([^.]+)\.(?:.*\.)?revolutions')
_SHAFTS = {'starboard': 1, '1': 1, '2': 2, '3': 3}


def _score(head: Head) -> float:
    if not head.lines or head.share(lambda line: '{' in line) < 0.5:
        return NO
    if head.share(lambda line: '"updates"' in line or '"$source"' in line) > 0.3:
        return CERTAIN
    return POSSIBLE if head.share(lambda line: '"path"' in line) > 0.3 else NO


def _read(job: Job, tally: Tally) -> Iterator[Reading]:
    deltas = _Deltas(tally, job.options, _own_vessel(job))
    lines = Lines(job.source, progress=job.progress)
    for line in counted(lines, tally):
        yield from deltas.of_line(line)
    if lines.too_long:
        tally.note(f'{len(lines.too_long)} lines were too long for a delta.')


def _own_vessel(job: Job) -> str:
    """Return the context of the ship of the log: `vessels.self`, or the one named most often."""
    counts = Counter(found[1] for line in Lines(job.source) for found in _CONTEXT.finditer(line))
    if _SELF in counts or not counts:
        return _SELF
    return counts.most_common(1)[0][0]


class _Deltas:
    """Takes deltas apart, and puts the two halves of a wind together."""

    def __init__(self, tally: Tally, options: Mapping[str, Any], own: str) -> None:
        self._tally = tally
        self._gear: Any = options.get('gear')
        self._transducer: Any = options.get('transducer')
        self._own = own
        self._winds: dict[tuple[str, str], tuple[int, float]] = {}

    def of_line(self, line: str) -> Iterator[Reading]:
        """Yield what a line holds."""
        text = line[line.find('{') :] if '{' in line[:200] else line  # behind a time or a source
        # before the parser, which goes as deep as its text
        if max(accumulate((c in '[{') - (c in ']}') for c in text), default=0) > _DEEPEST:
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
        elif self._is_own(delta.get('context')):
            for update in updates:
                if isinstance(update, dict) and isinstance(update.get('values'), list):
                    yield from self._update(update)

    def _is_own(self, context: Any) -> bool:
        """Say whether a delta is of the ship of the log, and not of another that AIS shows."""
        if context in (None, '', _SELF, self._own):
            return True
        self._tally.note(f'The own vessel is taken to be {self._own}.')
        self._tally.not_used['deltas of other vessels'] += 1
        return False

    def _update(self, update: dict[str, Any]) -> Iterator[Reading]:
        stamp_ns = iso_ns(str(update.get('timestamp', '')), UTC)
        if stamp_ns is None:
            self._tally.reject('time', 'no time of an update', str(update.get('timestamp')))
            return
        source = update.get('$source') or update.get('source') or ''
        if isinstance(source, dict):
            source = source.get('label', '')
        for each in update['values']:
            if isinstance(each, dict) and isinstance(path := each.get('path'), str):
                found = self._value(path, each.get('value'), stamp_ns, str(source))
                if found is not None:
                    yield found

    def _value(self, path: str, value: Any, stamp_ns: int, source: str) -> Reading | None:
        origin = Origin(0, f'{path} {source}'.strip())
        engine = _ENGINE.fullmatch(path)
        if path == _POSITION:
            where = value if isinstance(value, dict) else {}
            latitude, longitude = where.get('latitude'), where.get('longitude')
            if _is_number(latitude) and _is_number(longitude) and abs(latitude) <= 90.0:
                here = float(latitude), float(longitude)
                origin = origin._replace(unit='deg')
                return Reading(Channel.POSITION_GEODETIC, origin, stamp_ns, *here)
            self._tally.reject('position', 'no latitude and longitude', str(value))
            return None
        if path in _NUMBERS:
            channel, rank = _NUMBERS[path]
        elif path == _BELOW and self._transducer is not None:
            channel, rank = Channel.DEPTH, 1
        elif engine is not None and self._gear is not None:
            channel, rank = SHAFTS[_SHAFTS.get(engine[1].lower(), 0)], 0
        else:
            hint = '' if engine is None else ' (of the engine: --gear RATIO makes it the shaft)'
            if path == _BELOW:
                hint = ' (--transducer M makes it the depth)'
            self._tally.not_used[path + hint] += 1
            return None
        if not _is_number(value):
            self._tally.reject(channel.input, 'no number', f'{path} {value}')
            return None
        number = float(value)
        if channel is Channel.WIND_APPARENT:
            return self._wind(path, number, stamp_ns, source)
        if engine is not None:
            number = number * 2.0 * pi / self._gear
        elif path == _BELOW:
            number += self._transducer
        elif channel is Channel.HEADING:
            number = yaw(number)
        if path == 'navigation.headingMagnetic':
            self._tally.note(f'A heading is {_MAGNETIC}')
        return Reading(channel, origin._replace(rank=rank), stamp_ns, number)

    def _wind(self, path: str, value: float, stamp_ns: int, source: str) -> Reading | None:
        self._winds[path, source] = (stamp_ns, value)
        speed, angle = self._winds.get((_SPEED, source)), self._winds.get((_ANGLE, source))
        if speed is None or angle is None or abs(speed[0] - angle[0]) > _TOGETHER_NS:
            return None
        del self._winds[_SPEED, source], self._winds[_ANGLE, source]
        origin = Origin(0, f'environment.wind {source}'.strip())
        stamp_ns = max(speed[0], angle[0])
        return Reading(Channel.WIND_APPARENT, origin, stamp_ns, *wind(speed[1], angle[1]))


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e12


FORMAT = stream_format(
    name='signalk',
    kind='a log of Signal K',
    about=__doc__,
    score=_score,
    read=_read,
    options=(GEAR, TRANSDUCER),
)
