# SPDX-License-Identifier: Apache-2.0
"""
Messages of NMEA 2000 to readings.

Fast packets are put together and fields are read by `nmea2000`, which has the
table of canboat; units are SI.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import date
from itertools import chain, islice, pairwise
from math import cos, pi, remainder, sin
from typing import Any

from nmea2000 import backend

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import SECOND_NS, SHAFTS, Channel
from shipdrag_ros.sources.format import Job
from shipdrag_ros.sources.formats.n2k.frames import DAY_NS, MINUTE_NS, N2kFrame, parse
from shipdrag_ros.sources.opened import Lines
from shipdrag_ros.sources.stream import Origin, Reading, Tally

_BASE_NS = 946_684_800 * SECOND_NS  # 2000-01-01, for lines without a time
_RELATIVE_BELOW_NS = 100_000_000 * SECOND_NS
_SYSTEM_TIME, _GNSS = 126992, 129029
_DATED_FRAMES = 50_000  # in which a date is looked for
_FAST = (_GNSS,)
_EPOCH_DAYS = date(1970, 1, 1).toordinal()


@dataclass(frozen=True)
class FrameClock:
    """
    How the times of the lines are to be read.

    Attributes
    ----------
    rate_hz
        Frames a second, where the lines state no time.
    base_ns
        Added to times that do not count from 1970 [ns].
    notes
        What was assumed, a sentence each.
    """

    rate_hz: float | None = None
    base_ns: int = 0
    notes: tuple[str, ...] = ()


def clock_of(job: Job) -> FrameClock:
    """
    Find out how the times of a log are to be read.

    Raises
    ------
    ImportDataError
        If its lines state no time, or no date, and it is not given either.
    """
    name = repr(str(job.source))
    rate_hz = job.options.get('rate')
    day = job.options.get('date')
    days = None if day is None else day.toordinal() - _EPOCH_DAYS
    frames = (frame for line in Lines(job.source) if (frame := parse(line)) is not None)
    first = next(frames, None)
    if first is None:
        raise ImportDataError(f'{name} holds no frame of NMEA 2000')
    if rate_hz is not None:
        return FrameClock(rate_hz, days * DAY_NS if days else _BASE_NS)
    if first.time_ns is None:
        raise ImportDataError(
            f'{name}: its lines state no time; log with `candump -L`, or give --rate HZ, how '
            'many frames came in a second'
        )
    if not first.cycle_ns:
        if first.time_ns >= _RELATIVE_BELOW_NS:
            return FrameClock()
        times = [frame.time_ns for frame in islice(frames, 1000) if frame.time_ns is not None]
        if any(after < before for before, after in pairwise(times)):
            raise ImportDataError(
                f'{name}: its times are no dates and go back and forth, as those of `candump -td` '
                'do; log with `candump -L`, or give --rate HZ'
            )
        return FrameClock(base_ns=_BASE_NS)
    known_ns = _start_in(chain([first], islice(frames, _DATED_FRAMES)))
    if first.cycle_ns == MINUTE_NS:
        notes = ['The times of the frames count within a minute: a pause of a minute is not seen.']
        if known_ns is None:
            notes.append('No frame states the date; the times count from 2000-01-01.')
        start_ns = _BASE_NS if days is None else days * DAY_NS
        return FrameClock(base_ns=start_ns if known_ns is None else known_ns, notes=tuple(notes))
    if days is None and known_ns is not None:
        days = known_ns // DAY_NS
    if days is None:
        raise ImportDataError(
            f'{name} has times of day, and no date (no PGN 126992 or 129029 with one); give '
            '--date YYYY-MM-DD of its first time, in UTC'
        )
    return FrameClock(base_ns=days * DAY_NS)


def _start_in(frames: Iterable[N2kFrame]) -> int | None:
    """
    Return when the cycle of the first frame began [ns since 1970], by a message with a date.
    """
    packets, unwrapped = _Packets(), _Unwrapped()
    for frame in frames:
        since_ns = 0 if frame.time_ns is None else unwrapped.ns(frame.time_ns, frame.cycle_ns)
        if frame.pgn in (_SYSTEM_TIME, _GNSS):
            data = packets.whole(frame)
            place = 2 if frame.pgn == _SYSTEM_TIME else 1
            if data is not None and len(data) >= 8:
                days = int.from_bytes(data[place : place + 2], 'little')
                of_day = int.from_bytes(data[place + 2 : place + 6], 'little')  # [0.1 ms]
                if 0 < days < 0xFFFD and of_day < 864_000_000:
                    time_ns = days * DAY_NS + of_day * 100_000 - since_ns
                    # a time of day is the line's own, to which the message gives its day
                    return time_ns if frame.cycle_ns == MINUTE_NS else days * DAY_NS
    return None


class _Unwrapped:
    """Times that begin again after a cycle, counted on."""

    def __init__(self) -> None:
        self._cycles = 0
        self._last_ns = 0

    def ns(self, time_ns: int, cycle_ns: int) -> int:
        if time_ns < self._last_ns - cycle_ns // 2:
            self._cycles += 1
        elif time_ns > self._last_ns + cycle_ns // 2 and self._cycles:
            self._cycles -= 1  # a damaged time had passed for the next cycle's
        self._last_ns = time_ns
        return self._cycles * cycle_ns + time_ns


class _Packets:
    """Puts the frames of fast packets together."""

    def __init__(self) -> None:
        self._parts = backend.canboat.Reassembler()

    def whole(self, frame: N2kFrame) -> bytes | None:
        if frame.whole or frame.pgn not in _FAST:
            return frame.data
        sender = int(frame.sender) if frame.sender.isdecimal() else hash(frame.sender) % 254
        try:
            data: bytes | None = self._parts.push(frame.pgn, frame.data, sender % 256)
        except backend.canboat.ReassemblyError:
            return None  # a frame was lost
        return data


N2kValue = tuple[Channel, int, float, float]
N2kFields = Mapping[str, Any]


class N2kReader:
    """
    Takes the messages of a log.

    Parameters
    ----------
    tally
    clock
        From `clock_of`.
    options
        `gear` and `transducer`, where they were given.
    """

    def __init__(self, tally: Tally, clock: FrameClock, options: Mapping[str, Any]) -> None:
        self._tally = tally
        self._clock = clock
        self._gear: float | None = options.get('gear')
        self._transducer_m: float | None = options.get('transducer')
        self._packets = _Packets()
        self._frames = 0
        self._unwrapped = _Unwrapped()
        self._readers: dict[int, Callable[[N2kFields], N2kValue | str]] = {
            128259: _water,
            129026: _ground,
            129025: _position,
            _GNSS: _gnss,
            127250: self._heading,
            130306: _wind,
            128267: self._depth,
            127245: _rudder,
            127488: self._engine,
        }

    def read(self, job: Job) -> Iterator[Reading]:
        """
        Yield the readings of a log.
        """
        for text in self._clock.notes:
            self._tally.note(text)
        lines = Lines(job.source)
        total = job.source.stat().st_size
        for line in lines:
            self._tally.records += 1
            if self._tally.records % 1000 == 0 and job.progress is not None:
                job.progress(lines.done_bytes, total)
            if not line:
                continue
            frame = parse(line)
            if frame is None:
                self._tally.reject('line', 'no frame', line)
                continue
            yield from self._frame(frame, line)
        if lines.damage:
            self._tally.note(f'The log could not be read to its end, {lines.damage}.')

    def _frame(self, frame: N2kFrame, line: str) -> Iterator[Reading]:
        stamp_ns = self._stamp_ns(frame)
        read = self._readers.get(frame.pgn)
        if read is None:
            self._tally.not_used[f'PGN {frame.pgn}'] += 1
            return
        if stamp_ns is None:
            self._tally.reject('time', 'no time in the line', line)
            return
        data = self._packets.whole(frame)
        if data is None:
            return
        message = backend.decode(frame.pgn, data, units='si')
        if message is None:
            self._tally.reject(f'PGN {frame.pgn}', 'cannot be decoded', line)
            return
        fields = {field.id: field for field in message.fields}
        try:
            found = read(fields)
        except KeyError:  # of a message of another length
            found = 'without the field'
        if isinstance(found, str):
            self._tally.reject(f'PGN {frame.pgn}', found, line)
            return
        channel, rank, a, b = found
        origin = Origin(rank, f'PGN {frame.pgn} from {frame.sender}')
        yield Reading(channel, origin, stamp_ns, a, b)

    def _stamp_ns(self, frame: N2kFrame) -> int | None:
        self._frames += 1
        if self._clock.rate_hz is not None:
            since_s = (self._frames - 1) / self._clock.rate_hz
            return self._clock.base_ns + round(since_s * SECOND_NS)
        if frame.time_ns is None:
            return None
        if not frame.cycle_ns:
            return frame.time_ns + self._clock.base_ns
        return self._clock.base_ns + self._unwrapped.ns(frame.time_ns, frame.cycle_ns)

    def _heading(self, fields: N2kFields) -> N2kValue | str:
        heading, reference = fields['heading'].value, fields['reference'].value
        if heading is None:
            return _EMPTY
        if reference == 'True':
            return Channel.HEADING, 0, _yaw(heading), 0.0
        if reference != 'Magnetic':
            return 'neither true nor magnetic'
        deviation, variation = fields['deviation'].value, fields['variation'].value
        if variation is not None:
            return Channel.HEADING, 1, _yaw(heading + (deviation or 0.0) + variation), 0.0
        self._tally.note(
            'A heading is MAGNETIC, as its sensor states no variation: good for finding turns, '
            'not for directions over ground.'
        )
        return Channel.HEADING, 2, _yaw(heading), 0.0

    def _depth(self, fields: N2kFields) -> N2kValue | str:
        depth, offset = fields['depth'].value, fields['offset'].value
        if depth is None:
            return _EMPTY
        # negative: to the keel, whose depth is not stated
        if offset is None or offset <= 0.0:
            if self._transducer_m is None:
                return 'depth of the transducer not stated'
            offset = self._transducer_m
        return Channel.DEPTH, 0, depth + offset, 0.0

    def _engine(self, fields: N2kFields) -> N2kValue | str:
        if self._gear is None:
            return 'revolutions of the engine, and not of the shaft: give --gear RATIO'
        rate_hz, place = fields['speed'].value, fields['instance'].raw_value
        if rate_hz is None:
            return _EMPTY
        if not isinstance(place, int) or not 0 <= place < len(SHAFTS):
            return 'no engine from 0 to 3'
        return SHAFTS[place], 0, rate_hz * 2.0 * pi / self._gear, 0.0


_EMPTY = 'not available'


def _yaw(compass: float) -> float:
    return remainder(pi / 2.0 - compass, 2.0 * pi)


def _water(fields: N2kFields) -> N2kValue | str:
    speed = fields['speedWaterReferenced'].value
    return _EMPTY if speed is None else (Channel.SPEED_THROUGH_WATER, 0, speed, 0.0)


def _ground(fields: N2kFields) -> N2kValue | str:
    speed = fields['sog'].value
    return _EMPTY if speed is None else (Channel.SPEED_OVER_GROUND, 0, speed, 0.0)


def _position(fields: N2kFields) -> N2kValue | str:
    return _where(fields, 0)


def _gnss(fields: N2kFields) -> N2kValue | str:
    method = fields['method'].value
    if method in (None, 'no GNSS', 'Estimated (DR) mode', 'Manual Input', 'Simulate mode'):
        return f'no fix: {method}'
    return _where(fields, 1)


def _where(fields: N2kFields, rank: int) -> N2kValue | str:
    latitude, longitude = fields['latitude'].value, fields['longitude'].value
    if latitude is None or longitude is None:
        return _EMPTY
    if abs(latitude) > 90.0 or abs(longitude) > 180.0:
        return 'no latitude and longitude'
    return Channel.POSITION_GEODETIC, rank, latitude, longitude


def _wind(fields: N2kFields) -> N2kValue | str:
    speed, angle = fields['windSpeed'].value, fields['windAngle'].value
    if fields['reference'].value != 'Apparent':
        return f'wind that is not apparent: {fields["reference"].value}'
    if speed is None or angle is None:
        return _EMPTY
    return Channel.WIND_APPARENT, 0, -speed * cos(angle), speed * sin(angle)


def _rudder(fields: N2kFields) -> N2kValue | str:
    angle = fields['position'].value
    if angle is None:
        return _EMPTY
    return Channel.RUDDER, int(fields['instance'].raw_value or 0), angle, 0.0
