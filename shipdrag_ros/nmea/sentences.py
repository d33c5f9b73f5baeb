# SPDX-License-Identifier: Apache-2.0
"""
What the sentences of NMEA 0183 measure, in the units of `Channel`.

One row a value that a sentence may hold. Several sentences may hold the same
input; the one that comes first here is the better.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from datetime import date
from functools import lru_cache
from math import cos, hypot, isfinite, pi, radians, remainder, sin
from typing import Any, NamedTuple, TypeVar

from pynmeagps.nmeatypes_get import NMEA_PAYLOADS_GET

from shipdrag_ros.display import M_S_PER_KNOT, NUMBER
from shipdrag_ros.samples import PITCHES, SECOND_NS, SHAFTS, Channel

_FOOT_M = 0.3048
_FATHOM_M = 6.0 * _FOOT_M
_WIND_UNITS = {'N': M_S_PER_KNOT, 'K': 1.0 / 3.6, 'M': 1.0, 'S': 0.44704}
_ANGLES = {
    'NS': re.compile(r'(\d{2})(\d{2}(?:\.\d+)?)'),
    'EW': re.compile(r'(\d{3})(\d{2}(?:\.\d+)?)'),
}
_NO_MEASUREMENT = {'N': 'no fix', 'E': 'dead reckoning', 'M': 'manual', 'S': 'simulated'}
_NO_HEADING = {'E': 'estimated', 'M': 'manual', 'S': 'simulated', 'V': 'not valid'}
_NO_FIX = {'0': 'no fix', '6': 'dead reckoning', '7': 'manual', '8': 'simulated'}
MAGNETIC = 'magnetic'
_GLL_OF_OLD = 4  # fields
OWN_OFFSET = 'with its own offset'
STATED_DEPTH = 'with the stated depth of the transducer'
NOT_STATED = 'state the depth of the transducer'


class NoValue(Exception):
    """A value that a sentence does not hold, and why."""


class MeasuredValue(NamedTuple):
    """
    A value of a sentence.

    Attributes
    ----------
    a, b
        Columns of the value, see `Channel`.
    detail
        What separates it from others of the same sentence: the shaft, the rudder, a
        heading that is magnetic.
    channel
        What it is, where the sentence says it: which shaft.
    """

    a: float
    b: float = 0.0
    detail: str = ''
    channel: Channel | None = None


class Fields(dict[str, str]):
    """
    The fields of a sentence by pynmeagps' names; one that is not there is empty.

    Parameters
    ----------
    kind
        Of the sentence.
    texts
        What follows its address, without blanks around them.
    transducer_m
        Depth of the echo sounder below the surface [m]; None if unknown.
    """

    def __init__(self, kind: str, texts: Sequence[str], transducer_m: float | None = None) -> None:
        super().__init__(zip(_NAMES.get(kind, ()), texts))
        self.kind = kind
        self.transducer_m = transducer_m

    def __missing__(self, name: str) -> str:
        return ''

    def number(self, name: str) -> float:
        """Return a number; NoValue if there is none."""
        text = self[name]
        if not text:
            raise NoValue('empty')
        if not NUMBER.fullmatch(text) or not isfinite(number := float(text)):
            raise NoValue('not a number')
        return number

    def first(self, *choices: tuple[str, float]) -> float:
        """Return the first of several fields that is not empty, times its factor."""
        for name, factor in choices:
            if self[name]:
                return self.number(name) * factor
        raise NoValue('empty')

    def check(self, name: str, *, allowed: str) -> None:
        """Refuse a status that is not allowed; NMEA 0183 before 2.3 has some empty."""
        if self[name] and self[name] not in allowed:
            status = self[name] if len(self[name]) == 1 else 'not known'
            raise NoValue(f'status {status}')


# None: the sentence need not hold it, and does not
FieldsReader = Callable[[Fields], MeasuredValue | None]


def _water_vhw(fields: Fields) -> MeasuredValue:
    return MeasuredValue(fields.first(('spdN', M_S_PER_KNOT), ('spdK', 1.0 / 3.6)))


def _water_vbw(fields: Fields) -> MeasuredValue:
    fields.check('waterspdstatus', allowed='A')
    return MeasuredValue(fields.number('longwaterspd') * M_S_PER_KNOT)


def _ground_vbw(fields: Fields) -> MeasuredValue:
    fields.check('groundspdstatus', allowed='A')
    return MeasuredValue(
        hypot(fields.number('longgroundspd'), fields.number('transgroundspd')) * M_S_PER_KNOT
    )


def _ground_vtg(fields: Fields) -> MeasuredValue:
    _check_mode(fields)
    return MeasuredValue(fields.first(('sogn', M_S_PER_KNOT), ('sogk', 1.0 / 3.6)))


def _ground_rmc(fields: Fields) -> MeasuredValue:
    _check_fix(fields)
    return MeasuredValue(fields.number('spd') * M_S_PER_KNOT)


def _position(fields: Fields) -> MeasuredValue:
    _check_fix(fields)
    return MeasuredValue(_angle(fields, 'lat', 'NS', 90.0), _angle(fields, 'lon', 'EW', 180.0))


def _angle(fields: Fields, name: str, sides: str, largest_deg: float) -> float:
    """Return degrees from degrees and minutes and a side, the first positive."""
    text, side = fields[name], fields[sides]
    if not text or not side:
        raise NoValue('empty')
    found = _ANGLES[sides].fullmatch(text)
    if found is None or side not in tuple(sides):
        raise NoValue('no latitude and longitude')
    minutes = float(found[2])
    angle_deg = int(found[1]) + minutes / 60.0
    if minutes >= 60.0 or angle_deg > largest_deg:
        raise NoValue('no latitude and longitude')
    return angle_deg if side == sides[0] else -angle_deg


def _yaw_hdt(fields: Fields) -> MeasuredValue:
    return MeasuredValue(_yaw(fields.number('headingT')))


def _yaw_ths(fields: Fields) -> MeasuredValue:
    mode = fields['mi']
    if mode in _NO_HEADING:
        raise NoValue(f'mode {mode}: {_NO_HEADING[mode]}')
    return MeasuredValue(_yaw(fields.number('headt')))


def _yaw_hdg(fields: Fields) -> MeasuredValue:
    """Apply what deviation and variation the sensor states; none is no zero variation."""
    heading_deg = fields.number('headingM')
    if fields['deviation']:
        heading_deg += _easterly(fields, 'deviation', 'deviationEW')
    if not fields['variation']:
        return MeasuredValue(_yaw(heading_deg), detail=MAGNETIC)
    return MeasuredValue(_yaw(heading_deg + _easterly(fields, 'variation', 'variationEW')))


def _easterly(fields: Fields, name: str, side: str) -> float:
    if fields[side] not in ('E', 'W'):
        raise NoValue(f'{name} neither E nor W')
    return fields.number(name) if fields[side] == 'E' else -fields.number(name)


def _yaw(compass_deg: float) -> float:
    """Return REP-103 yaw [rad] in (-pi, pi] of a compass angle."""
    return remainder(radians(90.0 - compass_deg), 2.0 * pi)


def _shaft(fields: Fields) -> MeasuredValue:
    place, detail = _shaft_place(fields)
    return MeasuredValue(fields.number('rpm') * pi / 30.0, detail=detail, channel=SHAFTS[place])


def _pitch(fields: Fields) -> MeasuredValue | None:
    """Return the ratio to the greatest pitch; a fixed propeller has none to give."""
    if not fields['pitch'] or fields['source'] != 'S':
        return None
    place, detail = _shaft_place(fields)
    return MeasuredValue(fields.number('pitch') * 0.01, detail=detail, channel=PITCHES[place])


def _shaft_place(fields: Fields) -> tuple[int, str]:
    """
    Return place of a shaft, from 0, and its name.

    NMEA 0183 numbers from the centre line, odd to starboard and even to port, 0 on
    the line; the place of 1 to 4 is the number and that of 0 the fourth, as in the
    names of joints, so that no two of four shafts meet.
    """
    fields.check('status', allowed='A')
    if fields['source'] != 'S':
        raise NoValue('not of a shaft')
    number = fields['engineshaftnum'] or '0'
    if not number.isdecimal() or int(number) > len(SHAFTS):
        raise NoValue('no number of a shaft from 0 to 4')
    return (int(number) - 1) % len(SHAFTS), f'shaft {number}'


def _wind(fields: Fields) -> MeasuredValue:
    fields.check('status', allowed='A')
    if fields['reference'] == 'T':
        raise NoValue('true wind, computed and not measured')
    if fields['reference'] != 'R':
        raise NoValue('neither R nor T')
    unit = _WIND_UNITS.get(fields['speedu'])
    if unit is None:
        raise NoValue('no unit')
    # where it comes from, clockwise from ahead; its velocity points the other way
    angle, speed = radians(fields.number('angle')), fields.number('speed') * unit
    return MeasuredValue(-speed * cos(angle), speed * sin(angle))


def _depth_dpt(fields: Fields) -> MeasuredValue:
    depth_m = fields.number('depth')
    # negative: to the keel, whose depth is not stated
    if fields['offset'] and (offset_m := fields.number('offset')) >= 0.0:
        return MeasuredValue(depth_m + offset_m, detail=OWN_OFFSET)
    return MeasuredValue(depth_m + _transducer(fields), detail=STATED_DEPTH)


def _depth_dbt(fields: Fields) -> MeasuredValue:
    depth_m = fields.first(('depthm', 1.0), ('depthf', _FOOT_M), ('depthfath', _FATHOM_M))
    return MeasuredValue(depth_m + _transducer(fields), detail=STATED_DEPTH)


def _transducer(fields: Fields) -> float:
    if fields.transducer_m is None:
        raise NoValue(NOT_STATED)
    return fields.transducer_m


def _rudder(fields: Fields) -> MeasuredValue:
    """Return the starboard or single rudder, or the port one; as sent, + turns to starboard."""
    for side, detail in (('stbd', ''), ('port', 'port')):
        if fields[f'{side}angle']:
            fields.check(f'{side}status', allowed='A')
            return MeasuredValue(radians(fields.number(f'{side}angle')), detail=detail)
    raise NoValue('empty')


def has_fix(fields: Fields) -> bool:
    """Say whether the source itself calls its fix valid."""
    try:
        _check_fix(fields)
    except NoValue:
        return False
    return True


def _check_fix(fields: Fields) -> None:
    if fields.kind == 'GGA':
        quality = fields['quality']
        if not quality:
            raise NoValue('quality empty')
        if quality in _NO_FIX:
            raise NoValue(f'quality {quality}: {_NO_FIX[quality]}')
        return
    if not fields['status']:
        if fields.kind == 'GLL' and len(fields) <= _GLL_OF_OLD:
            return  # before NMEA 0183 2.0 it had neither time nor status
        raise NoValue('status empty')
    fields.check('status', allowed='AD')
    _check_mode(fields)


def _check_mode(fields: Fields) -> None:
    mode = fields['posMode']
    if mode in _NO_MEASUREMENT:
        raise NoValue(f'mode {mode}: {_NO_MEASUREMENT[mode]}')


def _water_uhaw(fields: Fields) -> MeasuredValue:
    """Return the part along the heading of what an ADCP measures east and north [kn]."""
    if fields['kind'] != 'UVH':
        raise NoValue('not of east, north and heading')
    heading = radians(fields.number('heading'))
    east, north = fields.number('east'), fields.number('north')
    return MeasuredValue((east * sin(heading) + north * cos(heading)) * M_S_PER_KNOT)


READERS: Mapping[str, tuple[tuple[Channel, FieldsReader], ...]] = {
    'RMC': ((Channel.POSITION_GEODETIC, _position), (Channel.SPEED_OVER_GROUND, _ground_rmc)),
    'GGA': ((Channel.POSITION_GEODETIC, _position),),
    'GLL': ((Channel.POSITION_GEODETIC, _position),),
    'VTG': ((Channel.SPEED_OVER_GROUND, _ground_vtg),),
    'VBW': ((Channel.SPEED_THROUGH_WATER, _water_vbw), (Channel.SPEED_OVER_GROUND, _ground_vbw)),
    'VHW': ((Channel.SPEED_THROUGH_WATER, _water_vhw),),
    'PUHAW': ((Channel.SPEED_THROUGH_WATER, _water_uhaw),),
    'HDT': ((Channel.HEADING, _yaw_hdt),),
    'THS': ((Channel.HEADING, _yaw_ths),),
    'HDG': ((Channel.HEADING, _yaw_hdg),),
    'RPM': ((Channel.SHAFT, _shaft), (Channel.PITCH, _pitch)),
    'RSA': ((Channel.RUDDER, _rudder),),
    'MWV': ((Channel.WIND_APPARENT, _wind),),
    'DPT': ((Channel.DEPTH, _depth_dpt),),
    'DBT': ((Channel.DEPTH, _depth_dbt),),
}
"""What each sentence measures; the better source of an input first."""

TIMED = ('RMC', 'GGA', 'GLL', 'ZDA')
"""Sentences that hold the time."""

USED = frozenset((*READERS, *TIMED))
"""Sentences that hold anything that is used here."""

_NAMES = {kind: tuple(NMEA_PAYLOADS_GET[kind]) for kind in USED if kind in NMEA_PAYLOADS_GET}
_NAMES['PUHAW'] = ('kind', 'east', 'north', 'heading')


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

    @property
    def name(self) -> str:
        """Under which `READERS` has it: a proprietary sentence is all talker."""
        return self.kind or self.talker


class SentenceReader:
    """
    Reads sentences.

    Parameters
    ----------
    transducer_m
        Depth of the echo sounder below the surface [m]; None if unknown.
    checksum
        Whether they must have a checksum; one that they have must be right.
    """

    def __init__(self, transducer_m: float | None = None, *, checksum: bool = True) -> None:
        self._transducer_m = transducer_m
        self._checksum = checksum
        self._repeated = lru_cache(_KEPT)(self._read)

    def read(self, text: str) -> Sentence | str:
        """Return what follows a `$`, without blanks around it, or why it is no sentence."""
        # one that states a time is never said again
        return self._read(text) if text[2:5] in TIMED else self._repeated(text)

    def _read(self, text: str) -> Sentence | str:
        content, star, stated = text.partition('*')
        if not star and self._checksum:
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
        if name not in USED:
            return Sentence(talker, kind, None, (), ())
        fields = Fields(name, texts, self._transducer_m)
        values, refused = [], []
        for listed, read in READERS.get(name, ()):
            try:
                value = read(fields)
            except NoValue as reason:
                refused.append((listed, str(reason)))
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
    """Return the two digits behind the star, of the characters before it."""
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
        raise NoValue('no time of day')
    return of_day_ns(*found.groups())


def of_day_ns(hour: str, minute: str, second: str | None, fraction: str | None) -> int:
    """
    Return the time since midnight [ns]; a leap second is that of the midnight after it.

    Parameters
    ----------
    hour, minute, second, fraction
        Digits, the last of them those behind the point.

    Raises
    ------
    NoValue
        If no clock shows them.
    """
    clock = int(hour), int(minute), int(second or 0)
    if clock > (23, 59, 60) or clock[1] > 59 or (clock[2] > 59 and clock != (23, 59, 60)):
        raise NoValue('no time of day')
    return (3600 * clock[0] + 60 * clock[1] + clock[2]) * SECOND_NS + fraction_ns(fraction)


def fraction_ns(digits: str | None) -> int:
    """Return the part of a second [ns] that the digits behind its point are."""
    return int((digits or '')[:9].ljust(9, '0'))


def _day(fields: Fields) -> int | None:
    if fields.kind == 'ZDA':
        texts = [fields[name] for name in ('year', 'month', 'day')]
        return _days(*texts) if all(texts) else None
    return _rmc_day(fields['date']) if fields.kind == 'RMC' and fields['date'] else None


@lru_cache(64)
def _rmc_day(text: str) -> int:
    found = _DATE.fullmatch(text)
    if found is None:
        raise NoValue('no possible date')
    century = 19 if int(found[3]) >= _CENTURY_TURNS else 20
    return _days(f'{century}{found[3]}', found[2], found[1])


@lru_cache(64)
def _days(*texts: str) -> int:
    """Return the days since 1970 of year, month and day."""
    if not all(text.isdecimal() and text.isascii() for text in texts):
        raise NoValue('no possible date')
    try:
        days = days_of(date(*map(int, texts)))
    except (ValueError, OverflowError):
        raise NoValue('no possible date') from None
    if not 0 <= days * DAY_NS < _LIMIT_NS - DAY_NS:
        raise NoValue('no possible date')
    return days


def days_of(day: date) -> int:
    """Return the days since 1970."""
    return (day - date(1970, 1, 1)).days
