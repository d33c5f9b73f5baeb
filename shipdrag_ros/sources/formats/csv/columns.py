# SPDX-License-Identifier: Apache-2.0
"""Which column is which input, in which unit, and which time: as options or names say it."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, tzinfo
from decimal import Decimal
from importlib import resources
from math import pi

from shipdrag_ros import strict_yaml
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import FURTHER, GEODETIC, PITCHES, SHAFTS, Channel, kind_of

_KNOT, _KMH, _MPH = 1852.0 / 3600.0, 1.0 / 3.6, 0.44704
SPEED_UNITS = {'m/s': 1.0, 'kn': _KNOT, 'km/h': _KMH, 'ft/s': 0.3048, 'mph': _MPH}
"""Units of speed [m/s]."""
LENGTH_UNITS = {'m': 1.0, 'km': 1000.0, 'ft': 0.3048, 'nmi': 1852.0}
"""Units of length [m]."""
ANGLE_UNITS = {'rad': 1.0, 'deg': pi / 180.0}
"""Units of angles [rad]."""
_TURN_RATE = {'rad/s': 1.0, 'rpm': pi / 30.0, 'rev/s': 2.0 * pi, 'rps': 2.0 * pi}
_PITCH = {'ratio': 1.0, '%': 0.01, **ANGLE_UNITS}
COMPASS = 'compass'
_UNITS: dict[Channel, Mapping[str, float]] = {
    Channel.SPEED_THROUGH_WATER: SPEED_UNITS,
    Channel.SPEED_OVER_GROUND: SPEED_UNITS,
    Channel.POSITION: LENGTH_UNITS,
    Channel.POSITION_GEODETIC: {'deg': 1.0},  # as they are sent
    Channel.HEADING: {**ANGLE_UNITS, COMPASS: pi / 180.0},
    Channel.SHAFT: _TURN_RATE,
    Channel.PITCH: _PITCH,
    Channel.RUDDER: ANGLE_UNITS,
    Channel.WIND_APPARENT: {**SPEED_UNITS, **ANGLE_UNITS},
    Channel.DEPTH: LENGTH_UNITS,
}
_UNITS |= {each: _UNITS[each.kind] for each in Channel if each.input in FURTHER}
_COUNTS = {
    'position': (2,),
    'wind_apparent': (2,),
    'speed_over_ground': (1, 2),
    'shaft': (1, 2, 3, 4),
    'pitch': (1, 2, 3, 4),
}
NANOSECONDS: Mapping[str, Decimal] = {
    's': Decimal(10**9),
    'ms': Decimal(10**6),
    'us': Decimal(10**3),
    'ns': Decimal(1),
}


@dataclass(frozen=True)
class InputColumns:
    """
    The columns of one input.

    Attributes
    ----------
    channel
        What they hold; of several shafts or pitches, the first one.
    names
        Names or numbers, counted from 1; of one value, or of one a shaft.
    units
        In which they stand, as `--map` takes them.
    stated
        Whether a unit is stated; where not, they are SI.
    """

    channel: Channel
    names: tuple[str, ...]
    units: tuple[str, ...]
    stated: bool = True

    @property
    def name(self) -> str:
        """What they are mapped to."""
        return _name(self.channel)

    @property
    def factors(self) -> list[float]:
        """What each is multiplied by for the unit of `Channel`."""
        return [_UNITS[self.channel.kind][unit] for unit in self.units]

    @property
    def is_polar(self) -> bool:
        """Whether a wind is its speed, and where it comes from, clockwise from ahead."""
        return [unit in ANGLE_UNITS for unit in self.units] == [False, True]

    def by_channel(self) -> Iterator[InputColumns]:
        """
        Yield the columns of each channel: of several shafts, one each.
        """
        for channels in (SHAFTS, PITCHES):
            if self.channel is channels[0]:
                for channel, name, unit in zip(channels, self.names, self.units, strict=False):
                    yield InputColumns(channel, (name,), (unit,))
                return
        yield self


@dataclass(frozen=True)
class TimeColumn:
    """
    The column of the time of measurement.

    Attributes
    ----------
    names
        One column, or one of the date and one of the time of day.
    unit
        Of a count, see `NANOSECONDS`; '' where none is given.
    order
        Of year, month and day in a date, see `cells.ORDERS`; '' to be found.
    zone
        Of dates that state none.
    """

    names: tuple[str, ...]
    unit: str = ''
    order: str = ''
    zone: tzinfo = UTC


def parse_input(text: str) -> InputColumns:
    """
    Read `INPUT=COLUMN[:unit]`.

    `position` and `wind_apparent` take two columns, `speed_over_ground` one or the
    components east and north, `shaft` and `pitch` up to four, one a shaft. An
    apparent wind `aws:kn,awa:deg` is its speed and where it comes from, clockwise
    from ahead. A heading in `compass` is in degrees clockwise from north. A unit
    given once holds for all, `position=x,y:km` as much as `position=x:km,y`; several are
    taken as written, `position=x:km,y:m`. A position in `deg` is
    latitude and longitude; so is one without a unit whose columns say so. Others without
    a unit are SI, a pitch is a ratio.
    `speed_through_water_2` and the like are further instruments of a kind.

    Raises
    ------
    ImportDataError
        If the input or a unit is not known, or a column is missing.
    """
    name, _, rest = text.partition('=')
    name = name.strip()
    known = {unit for channel in _UNITS if _name(channel) == name for unit in _UNITS[channel]}
    if not known:
        inputs = ', '.join(dict.fromkeys(map(_name, _UNITS)))
        raise ImportDataError(f'--map {text!r}: no input {name!r}; inputs are {inputs}')
    counts = _COUNTS.get(kind_of(name), (1,))
    columns, units = zip(*(_split_unit(piece, known) for piece in rest.split(',')), strict=True)
    if len(columns) not in counts or not all(columns):
        expected = f'{counts[0]}' if len(counts) == 1 else f'{counts[0]} to {counts[-1]}'
        example = f'{name}={",".join(["COLUMN[:unit]"] * counts[0])}'
        raise ImportDataError(f'--map {text!r}: expected {expected} column(s), {example}')
    return columns_of(name, columns, units)


def columns_of(name: str, columns: Sequence[str], stated: Sequence[str]) -> InputColumns:
    """
    Return the columns of an input.

    Parameters
    ----------
    name
        Of the input, as `--map` takes it.
    columns
        Their names.
    stated
        Unit of each, '' where none is stated.

    Raises
    ------
    ImportDataError
        If the units do not go together.
    """
    given = [*filter(None, stated)]
    channel = next(channel for channel in _UNITS if _name(channel) == name)
    if 'deg' in given:
        channel = GEODETIC.get(channel, channel)
    known = _UNITS[channel]
    common = given[0] if given else next(iter(known))
    units = tuple(unit or common for unit in stated)  # a unit given once holds for all
    found = InputColumns(channel, tuple(columns), units, stated=bool(given))
    expected = ''
    if not known.keys() >= {*units}:
        expected = f'in deg, or both in {", ".join(LENGTH_UNITS)}'
    elif channel is Channel.WIND_APPARENT and ANGLE_UNITS.keys() & {*units} and not found.is_polar:
        expected = 'in a unit of speed, or the second in deg'
    if expected:
        text = f'{name}={",".join(columns)}'
        raise ImportDataError(f'--map {text!r}: expected both columns {expected}')
    return found


def parse_time(text: str) -> TimeColumn:
    """
    Read `COLUMN[:unit]` of the time, or `DATE,TIME` of two columns; s without a unit.

    Raises
    ------
    ImportDataError
        If the unit is not known.
    """
    column, unit = _split_unit(text, NANOSECONDS)
    names = (column,) if unit else tuple(name.strip() for name in column.split(','))
    if not all(names) or len(names) > 2:
        raise ImportDataError(f'--time {text!r}: expected COLUMN[:unit], or DATE,TIME')
    return TimeColumn(names, unit)


def _name(channel: Channel) -> str:
    return 'pitch' if channel in PITCHES else channel.input


def _split_unit(text: str, units: Collection[str]) -> tuple[str, str]:
    """Return column and unit; a colon may also be part of a column's name."""
    column, colon, unit = text.strip().rpartition(':')
    if not colon:
        return unit, ''
    if unit.strip() in units:
        return column.strip(), unit.strip()
    raise ImportDataError(
        f'{text!r}: no unit {unit!r} here; units are {", ".join(sorted(units))}. '
        'For a colon in the name of a column write its number'
    )


_NAMES = strict_yaml.load(
    (resources.files('shipdrag_ros') / 'data' / 'columns.yaml').read_text(encoding='utf-8')
)
UNITS: Mapping[str, str] = {
    name: unit for unit, names in _NAMES['units'].items() for name in names
}
"""How units are written in names of columns, and how `--map` takes them."""

OTHER_UNITS = frozenset(_NAMES['other_units'])
"""Units in brackets or below a name that `--map` does not take: none is guessed for these."""

_BRACKETS = re.compile(r'[\[(]([^\[\]()]*)[\])]')
_ROLE_OF = {name: role for role, names in _NAMES['roles'].items() for name in names}


def role_and_unit(name: str, below: str = '') -> tuple[str, str]:
    """
    Return the role of a column and the unit that its name states; '' for neither.

    Parameters
    ----------
    name
        Of the column.
    below
        What a line of units says of it.
    """
    text = name.strip().lower()
    unit = _stated(below)
    for found in _BRACKETS.findall(text):
        unit = unit or _stated(found)
    plain = _words(_BRACKETS.sub(' ', text))
    words = plain.split()
    if 'rpm' in words and unit not in ('', 'rpm'):
        return ('shaft' if plain == 'rpm' else _ROLE_OF.get(plain, '')), ''
    if plain in _ROLE_OF and (unit or plain not in UNITS):
        return _ROLE_OF[plain], unit or UNITS.get(words[-1] if len(words) > 1 else '', '')
    for length in (3, 2, 1):  # `m_s` is two words
        tail = ' '.join(words[-length:])
        if len(words) > length and tail in UNITS:
            return _ROLE_OF.get(' '.join(words[:-length]), ''), unit or UNITS[tail]
    if plain == 'rpm':
        return 'shaft', 'rpm'
    return _ROLE_OF.get(plain, ''), unit


def _stated(text: str) -> str:
    text = text.strip().strip('[]()').strip().lower()
    return UNITS.get(text, text if text in OTHER_UNITS else '')


def _words(text: str) -> str:
    return ' '.join(
        re.sub(r'[^\w/°%-]+|_', ' ', text.replace('/', ' / ')).replace(' / ', ' ').split()
    )
