# SPDX-License-Identifier: Apache-2.0
"""
Lines of candump, Actisense (N2K ASCII), Yacht Devices (RAW) or canboat. PGNs 128259 speed
through water, 129026 speed over ground, 129025 and 129029 position, 127250 heading, 130306
apparent wind, 128267 depth, 127245 rudder; of 127488, the engine, with --gear. A time of day
takes its date from 126992 or 129029; lines without any time are counted with --rate.
"""

# Fast packets are put together and fields are read by `nmea2000`, which has the table of
# canboat; units are SI.

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from datetime import UTC
from fractions import Fraction
from functools import cache
from itertools import islice, pairwise
from math import pi
from typing import Any, NamedTuple

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.nmea.sentences import DAY_NS, NoValue, days_of, fraction_ns, of_day_ns
from shipdrag_ros.samples import SECOND_NS, SHAFTS, Channel
from shipdrag_ros.sources import format
from shipdrag_ros.sources.format import Lines
from shipdrag_ros.sources.log import BASE_NS, DATE_FROM_NS, Tally, iso_ns
from shipdrag_ros.sources.stream import Origin, Reading, counted, stream_format, wind, yaw

MINUTE_NS = 60 * SECOND_NS
_SINCE = r'\((?P<seconds>\d{1,10})\.(?P<fraction>\d{1,9})\)\s+'
_CLOCK = r'(?P<hour>\d\d):?(?P<minute>\d\d):?(?P<second>\d\d)\.(?P<fraction>\d{1,6})\s+'
_ISO = r'\d{4}-\d\d-\d\d[-T ]\d\d:\d\d:\d\d(?:[.,]\d{1,12})?'
_FORMS = tuple(
    re.compile(form.replace('HEX', '[0-9A-Fa-f]'))
    for form in (
        # can-utils: `candump -L`, then `candump -ta`, `candump`, and a format of its old versions
        rf'{_SINCE}\S+\s+(?P<id>HEX{{8}})#(?P<data>HEX*)\s*[RT]?',
        rf'(?:{_SINCE})?\S+\s+(?P<id>HEX{{8}})\s+\[\d+\](?P<data>(?:\s+HEX{{2}})*)',
        rf'(?:{_SINCE})?<0x(?P<id>HEX{{8}})>\s+\[\d+\](?P<data>(?:\s+HEX{{2}})*)',
        # candump of can-utils-j1939: the NAME of the sender and the PGN
        rf'(?:{_SINCE})?\S+?:(?P<sender>HEX{{2,16}}),(?P<pgn>HEX{{5}})\s+-\s+!\d\s+'
        r'\[\d+\](?P<data>(?:\s+HEX+)*)',
        # Actisense N2K ASCII: sender, addressee and priority, PGN, the whole message
        rf'A{_CLOCK}(?P<hex_sender>HEX{{2}})HEX{{3}}\s+(?P<pgn>HEX{{5,6}})\s+(?P<data>HEX+)',
        # Yacht Devices RAW
        rf'{_CLOCK}[RT]\s+(?P<id>HEX{{8}})(?P<data>(?:\s+HEX{{2}})+)',
        # canboat: time, priority, PGN, sender, addressee, length, bytes
        rf'(?P<iso>{_ISO}Z?),\d,(?P<decimal_pgn>\d{{4,6}}),(?P<sender>\d{{1,3}}),'
        r'\d{1,3},\d{1,3}(?P<data>(?:,HEX{2})*)',
        # SLCAN: identifier, length, bytes, and with some adapters milliseconds of a minute
        r'T(?P<id>HEX{8})(?P<length>[0-8])(?P<data>HEX*)',
    )
)
# what loggers write before a line: the date and time
_LED = re.compile(rf'[\[(]?({_ISO}\s?(?:Z|[+-]\d\d:?\d\d)?)[\])]?[\s,;]+(.+)')


class N2kFrame(NamedTuple):
    """
    A frame, or a whole message.

    Attributes
    ----------
    time_ns
        Since 1970, or since its cycle began; None where the line states none.
    cycle_ns
        After which the time begins again, a day or a minute; 0 of a time since 1970.
    pgn, sender, data
    whole
        Whether `data` is a message that needs no further frames.
    """

    time_ns: int | None
    cycle_ns: int
    pgn: int
    sender: str
    data: bytes
    whole: bool


def parse(line: str) -> N2kFrame | None:
    """Take a line apart; None where it is no frame."""
    for form in _FORMS:
        found = form.fullmatch(line)
        frame = None if found is None else _frame(found.groupdict(''))
        if frame is not None:
            return frame
    led = _LED.fullmatch(line)
    if led is None:
        return None
    frame, time_ns = parse(led[2]), iso_ns(led[1], UTC)
    if frame is None or time_ns is None:
        return frame
    return frame._replace(time_ns=time_ns, cycle_ns=0)


def _frame(parts: dict[str, str]) -> N2kFrame | None:
    """Put the parts of a line together; None where they do not go together."""
    digits = re.sub(r'[\s,]+', '', parts['data'])
    time_ns, cycle_ns = None, 0
    if 'length' in parts:
        end = 2 * int(parts['length'])
        digits, clock = digits[:end], digits[end:]
        time_ns, cycle_ns = int(clock, 16) * 1_000_000 if clock else None, MINUTE_NS
        if len(digits) < end or len(clock) not in (0, 4) or (time_ns or 0) >= MINUTE_NS:
            return None
    elif 'hour' in parts:
        cycle_ns = DAY_NS
        with suppress(NoValue):
            time_ns = of_day_ns(parts['hour'], parts['minute'], parts['second'], parts['fraction'])
    elif 'iso' in parts:
        time_ns = iso_ns(f'{parts["iso"][:10]}T{parts["iso"][11:]}', UTC)
    elif parts['seconds']:
        time_ns = int(parts['seconds']) * SECOND_NS + fraction_ns(parts['fraction'])
    if len(digits) % 2:
        return None
    data = bytes.fromhex(digits)
    if 'id' in parts:  # of 29 bits; a PGN below 0xF000 is addressed
        number = int(parts['id'], 16) & 0x1FFFFFFF
        pgn = (number >> 8) & 0x3FFFF
        if (pgn >> 8) & 0xFF < 0xF0:
            pgn &= 0x3FF00
        if len(data) > 8:
            return None
        return N2kFrame(time_ns, cycle_ns, pgn, str(number & 0xFF), data, False)
    sender = parts.get('sender') or str(int(parts['hex_sender'], 16))
    pgn = int(parts['decimal_pgn']) if 'decimal_pgn' in parts else int(parts['pgn'], 16)
    whole = 'hex_sender' in parts or ('decimal_pgn' in parts and len(data) > 8)
    return N2kFrame(time_ns, cycle_ns, pgn, sender, data, whole)


_SYSTEM_TIME, _GNSS = 126992, 129029
_DATED_FRAMES = 50_000  # in which a date is looked for
_FAST = (_GNSS,)


class FrameClock:
    """
    Follows the times of the frames.

    Parameters
    ----------
    base_ns
        Added to times that do not count from 1970 [ns].
    rate_hz
        Frames a second, where the lines state no time.
    """

    def __init__(self, base_ns: int = 0, rate_hz: float | None = None) -> None:
        self._base_ns = base_ns
        self._frame_ns = None if rate_hz is None else SECOND_NS / Fraction(rate_hz)
        self._frames = -1
        self._cycles = 0
        self._last_ns = 0

    def ns(self, frame: N2kFrame) -> int | None:
        """Return the time of the next frame [ns since 1970], None where it has none."""
        self._frames += 1
        if self._frame_ns is not None:
            return self._base_ns + round(self._frames * self._frame_ns)
        if frame.time_ns is None:
            return None
        time_ns = (
            self.counted_on(frame.time_ns, frame.cycle_ns) if frame.cycle_ns else frame.time_ns
        )
        return self._base_ns + time_ns

    def counted_on(self, time_ns: int, cycle_ns: int) -> int:
        """Return a time that begins again after a cycle, counted on."""
        if time_ns < self._last_ns - cycle_ns // 2:
            self._cycles += 1
        elif time_ns > self._last_ns + cycle_ns // 2 and self._cycles:
            self._cycles -= 1  # a damaged time had passed for the next cycle's
        self._last_ns = time_ns
        return self._cycles * cycle_ns + time_ns


def clock_of(job: format.Job, tally: Tally) -> FrameClock:
    """
    Find out how the times of a log are to be read; what is assumed is noted.

    Raises
    ------
    ImportDataError
        If its lines state no time, or no date, and it is not given either.
    """
    name = repr(str(job.source))
    rate_hz = job.options.get('rate')
    day = job.options.get('date')
    days = None if day is None else days_of(day)
    frames = (frame for line in Lines(job.source) if (frame := parse(line)) is not None)
    first = next(frames, None)
    if first is None:
        raise ImportDataError(f'{name} holds no frame of NMEA 2000')
    if rate_hz is not None:
        return FrameClock(days * DAY_NS if days else BASE_NS, rate_hz)
    if first.time_ns is None:
        raise ImportDataError(
            f'{name}: its lines state no time; log with `candump -L`, or give --rate HZ, how '
            'many frames came in a second'
        )
    if not first.cycle_ns and first.time_ns >= DATE_FROM_NS:
        return FrameClock()
    begin = [first, *islice(frames, _DATED_FRAMES)]
    times = [frame.time_ns for frame in begin[:1000] if frame.time_ns is not None]
    if not first.cycle_ns and any(after < before for before, after in pairwise(times)):
        raise ImportDataError(
            f'{name}: its times are no dates and go back and forth, as those of `candump -td` '
            'do; log with `candump -L`, or give --rate HZ'
        )
    known_ns = _start_in(begin)
    if first.cycle_ns != DAY_NS:
        if first.cycle_ns:
            tally.note(
                'The times of the frames count within a minute: a pause of a minute is not seen.'
            )
        if known_ns is None and days is None:
            tally.note('No frame states the date; the times count from 2000-01-01.')
            known_ns = BASE_NS
        return FrameClock(known_ns or (days or 0) * DAY_NS)
    if days is not None:
        known_ns = days * DAY_NS
    if known_ns is None:
        raise ImportDataError(
            f'{name} has times of day, and no date (no PGN 126992 or 129029 with one); give '
            '--date YYYY-MM-DD of its first time, in UTC'
        )
    return FrameClock(known_ns)


def _start_in(frames: Iterable[N2kFrame]) -> int | None:
    """Return when the cycle of the first frame began [ns since 1970], by a message with a date."""
    packets, clock = _Packets(), FrameClock()
    for frame in frames:
        if frame.time_ns is None:
            continue
        since_ns = clock.counted_on(frame.time_ns, frame.cycle_ns)
        if frame.pgn in (_SYSTEM_TIME, _GNSS):
            data = packets.whole(frame)
            place = 2 if frame.pgn == _SYSTEM_TIME else 1
            if data is not None and len(data) >= 8:
                days = int.from_bytes(data[place : place + 2], 'little')
                of_day = int.from_bytes(data[place + 2 : place + 6], 'little')  # [0.1 ms]
                if 0 < days < 0xFFFD and of_day < 864_000_000:
                    time_ns = days * DAY_NS + of_day * 100_000 - since_ns
                    # a day begins at midnight, by the line's own time of day
                    of_days = frame.cycle_ns == DAY_NS
                    return round(time_ns / DAY_NS) * DAY_NS if of_days else time_ns
    return None


@cache
def _backend() -> Any:
    """Return the table of messages, which takes long to import."""
    from nmea2000 import backend

    return backend


class _Packets:
    """Puts the frames of fast packets together."""

    def __init__(self) -> None:
        self._canboat = _backend().canboat
        self._parts = self._canboat.Reassembler()
        self._senders: dict[str, int] = {}

    def whole(self, frame: N2kFrame) -> bytes | None:
        if frame.whole or frame.pgn not in _FAST:
            return frame.data
        sender = self._senders.setdefault(frame.sender, len(self._senders))
        try:
            data: bytes | None = self._parts.push(frame.pgn, frame.data, sender % 256)
        except self._canboat.ReassemblyError:
            return None  # a frame was lost
        return data


N2kValue = tuple[Channel, int, float, float]
"""Channel, rank of the source, and two values."""


class _Fields(dict[str, Any]):
    """The fields of a message by name, and what is known besides."""

    def __init__(
        self, message: Any, options: Mapping[str, Any], note: Callable[[str], None]
    ) -> None:
        super().__init__((field.id, field) for field in message.fields)
        self.options = options
        self.note = note

    def __missing__(self, name: str) -> Any:
        raise NoValue('without the field')  # of a message of another length

    def value(self, name: str) -> Any:
        """Return the value of a field, None where it is not available."""
        return self[name].value

    def number(self, name: str) -> Any:
        """Return the value of a field; NoValue where it is not available."""
        if self[name].value is None:
            raise NoValue('not available')
        return self[name].value

    def instance(self) -> Any:
        """Return which of several instruments it is of."""
        return self['instance'].raw_value


def _read(job: format.Job, tally: Tally) -> Iterator[Reading]:
    clock, packets = clock_of(job, tally), _Packets()
    for line in counted(Lines(job.source, progress=job.progress), tally):
        frame = parse(line)
        if frame is None:
            tally.reject('line', 'no frame', line)
            continue
        stamp_ns, name = clock.ns(frame), f'PGN {frame.pgn}'
        read = _READERS.get(frame.pgn)
        if read is None:
            tally.not_used[name] += 1
        elif stamp_ns is None:
            tally.reject('time', 'no time in the line', line)
        elif (data := packets.whole(frame)) is not None:
            try:
                channel, rank, a, b = read(_fields(frame.pgn, data, job, tally))
            except NoValue as reason:
                tally.reject(name, str(reason), line)
            else:
                origin = Origin(rank, f'{name} from {frame.sender}')
                yield Reading(channel, origin, stamp_ns, a, b)


def _fields(pgn: int, data: bytes, job: format.Job, tally: Tally) -> _Fields:
    message = _backend().decode(pgn, data, units='si')
    if message is None:
        raise NoValue('cannot be decoded')
    return _Fields(message, job.options, tally.note)


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
    return Channel.HEADING, rank, yaw(heading), 0.0


def _wind(fields: _Fields) -> N2kValue:
    if fields.value('reference') != 'Apparent':
        raise NoValue(f'wind that is not apparent: {fields.value("reference")}')
    return Channel.WIND_APPARENT, 0, *wind(fields.number('windSpeed'), fields.number('windAngle'))


def _depth(fields: _Fields) -> N2kValue:
    depth, offset = fields.number('depth'), fields.value('offset')
    if offset is None or offset <= 0.0:  # negative: to the keel, whose depth is not stated
        offset = fields.options.get('transducer')
        if offset is None:
            raise NoValue('depth below the transducer: give --transducer M')
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


FORMAT = stream_format(
    name='n2k',
    kind='a log of NMEA 2000',
    about=__doc__,
    score=lambda head: format.CERTAIN if head.share(parse) > 0.5 else format.NO,
    read=_read,
    options=(format.DATE, format.GEAR, format.RATE, format.TRANSDUCER),
)
