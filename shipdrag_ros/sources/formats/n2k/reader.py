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
from shipdrag_ros.nmea.sentences import NoValue
from shipdrag_ros.samples import SECOND_NS, SHAFTS, Channel
from shipdrag_ros.sources.format import Job
from shipdrag_ros.sources.formats.n2k.frames import DAY_NS, MINUTE_NS, N2kFrame, parse
from shipdrag_ros.sources.log import BASE_NS
from shipdrag_ros.sources.opened import Lines
from shipdrag_ros.sources.stream import Origin, Reading, Tally

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
        return FrameClock(rate_hz, days * DAY_NS if days else BASE_NS)
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
        return FrameClock(base_ns=BASE_NS)
    known_ns = _start_in(chain([first], islice(frames, _DATED_FRAMES)))
    if first.cycle_ns == MINUTE_NS:
        notes = ['The times of the frames count within a minute: a pause of a minute is not seen.']
        if known_ns is None:
            notes.append('No frame states the date; the times count from 2000-01-01.')
        start_ns = BASE_NS if days is None else days * DAY_NS
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
"""Channel, rank of the source, and two values."""


class _Fields:
    """The fields of a message, and what is known besides."""

    def __init__(
        self, message: Any, options: Mapping[str, Any], note: Callable[[str], None]
    ) -> None:
        self._fields = {field.id: field for field in message.fields}
        self.options = options
        self.note = note

    def value(self, name: str) -> Any:
        """Return the value of a field, None where it is not available."""
        return self._of(name).value

    def number(self, name: str) -> Any:
        """Return the value of a field; NoValue where it is not available."""
        value = self.value(name)
        if value is None:
            raise NoValue('not available')
        return value

    def instance(self) -> Any:
        """Return which of several instruments it is of."""
        return self._of('instance').raw_value

    def _of(self, name: str) -> Any:
        try:
            return self._fields[name]
        except KeyError:  # of a message of another length
            raise NoValue('without the field') from None


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
        self._options = options
        self._packets = _Packets()
        self._frames = 0
        self._unwrapped = _Unwrapped()

    def read(self, job: Job) -> Iterator[Reading]:
        """
        Yield the readings of a log.
        """
        for text in self._clock.notes:
            self._tally.note(text)
        lines = Lines(job.source, progress=job.progress)
        for line in lines:
            self._tally.records += 1
            frame = parse(line) if line else None
            if frame is not None:
                found = self._reading(frame, line)
                if found is not None:
                    yield found
            elif line:
                self._tally.reject('line', 'no frame', line)
        if lines.damage:
            self._tally.note(f'The log could not be read to its end, {lines.damage}.')

    def _reading(self, frame: N2kFrame, line: str) -> Reading | None:
        stamp_ns = self._stamp_ns(frame)
        read, name = _READERS.get(frame.pgn), f'PGN {frame.pgn}'
        if read is None:
            self._tally.not_used[name] += 1
            return None
        if stamp_ns is None:
            self._tally.reject('time', 'no time in the line', line)
            return None
        data = self._packets.whole(frame)
        if data is None:
            return None
        message = backend.decode(frame.pgn, data, units='si')
        try:
            if message is None:
                raise NoValue('cannot be decoded')
            channel, rank, a, b = read(_Fields(message, self._options, self._tally.note))
        except NoValue as reason:
            self._tally.reject(name, reason.reason, line)
            return None
        return Reading(channel, Origin(rank, f'{name} from {frame.sender}'), stamp_ns, a, b)

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


def _water(fields: _Fields) -> N2kValue:
    return Channel.SPEED_THROUGH_WATER, 0, fields.number('speedWaterReferenced'), 0.0


def _ground(fields: _Fields) -> N2kValue:
    return Channel.SPEED_OVER_GROUND, 0, fields.number('sog'), 0.0


def _position(fields: _Fields) -> N2kValue:
    latitude, longitude = fields.number('latitude'), fields.number('longitude')
    if abs(latitude) > 90.0 or abs(longitude) > 180.0:
        raise NoValue('no latitude and longitude')
    return Channel.POSITION_GEODETIC, 0, latitude, longitude


def _gnss(fields: _Fields) -> N2kValue:
    method = fields.value('method')
    if method in (None, 'no GNSS', 'Estimated (DR) mode', 'Manual Input', 'Simulate mode'):
        raise NoValue(f'no fix: {method}')
    channel, _, latitude, longitude = _position(fields)
    return channel, 1, latitude, longitude


def _heading(fields: _Fields) -> N2kValue:
    heading, reference, rank = fields.number('heading'), fields.value('reference'), 0
    if reference == 'Magnetic':
        deviation, variation = fields.value('deviation'), fields.value('variation')
        if variation is None:
            rank = 2
            fields.note(
                'A heading is MAGNETIC, as its sensor states no variation: good for finding '
                'turns, not for directions over ground.'
            )
        else:
            rank = 1
            heading += (deviation or 0.0) + variation
    elif reference != 'True':
        raise NoValue('neither true nor magnetic')
    return Channel.HEADING, rank, remainder(pi / 2.0 - heading, 2.0 * pi), 0.0


def _wind(fields: _Fields) -> N2kValue:
    if fields.value('reference') != 'Apparent':
        raise NoValue(f'wind that is not apparent: {fields.value("reference")}')
    speed, angle = fields.number('windSpeed'), fields.number('windAngle')
    return Channel.WIND_APPARENT, 0, -speed * cos(angle), speed * sin(angle)


def _depth(fields: _Fields) -> N2kValue:
    depth, offset = fields.number('depth'), fields.value('offset')
    if offset is None or offset <= 0.0:  # negative: to the keel, whose depth is not stated
        offset = fields.options.get('transducer')
        if offset is None:
            raise NoValue('depth of the transducer not stated')
    return Channel.DEPTH, 0, depth + offset, 0.0


def _rudder(fields: _Fields) -> N2kValue:
    return Channel.RUDDER, int(fields.instance() or 0), fields.number('position'), 0.0


def _engine(fields: _Fields) -> N2kValue:
    gear, place = fields.options.get('gear'), fields.instance()
    if gear is None:
        raise NoValue('revolutions of the engine, and not of the shaft: give --gear RATIO')
    rate_hz = fields.number('speed')
    if not isinstance(place, int) or not 0 <= place < len(SHAFTS):
        raise NoValue('no engine from 0 to 3')
    return SHAFTS[place], 0, rate_hz * 2.0 * pi / gear, 0.0


_READERS: Mapping[int, Callable[[_Fields], N2kValue]] = {
    128259: _water,
    129026: _ground,
    129025: _position,
    _GNSS: _gnss,
    127250: _heading,
    130306: _wind,
    128267: _depth,
    127245: _rudder,
    127488: _engine,
}
