# SPDX-License-Identifier: Apache-2.0
"""Which column of a table is which input, and in which unit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from decimal import Decimal
from math import pi

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.samples import PITCHES, SHAFTS, Channel

_SPEED = {'m/s': 1.0, 'kn': 1852.0 / 3600.0, 'km/h': 1.0 / 3.6, 'ft/s': 0.3048}
_LENGTH = {'m': 1.0, 'km': 1000.0, 'ft': 0.3048, 'nmi': 1852.0}
_ANGLE = {'rad': 1.0, 'deg': pi / 180.0}
_TURN_RATE = {'rad/s': 1.0, 'rpm': pi / 30.0, 'rev/s': 2.0 * pi}
_PITCH = {'ratio': 1.0, '%': 0.01, **_ANGLE}
_LATITUDE = {'deg': 1.0}  # as they are sent
_UNITS: Mapping[Channel, Mapping[str, float]] = {
    Channel.SPEED_THROUGH_WATER: _SPEED,
    Channel.SPEED_OVER_GROUND: _SPEED,
    Channel.POSITION: _LENGTH,
    Channel.POSITION_GEODETIC: _LATITUDE,
    Channel.HEADING: _ANGLE,
    Channel.SHAFT: _TURN_RATE,
    Channel.PITCH: _PITCH,
    Channel.RUDDER: _ANGLE,
    Channel.WIND_APPARENT: _SPEED,
    Channel.DEPTH: _LENGTH,
}
_COUNTS = {'position': (2,), 'wind_apparent': (2,), 'shaft': (1, 2, 3, 4), 'pitch': (1, 2, 3, 4)}
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
    factors
        What each is multiplied by for the unit of `Channel`.
    """

    channel: Channel
    names: tuple[str, ...]
    factors: tuple[float, ...]

    @property
    def name(self) -> str:
        """What they are mapped to."""
        return _name(self.channel)

    def by_channel(self) -> Iterator[InputColumns]:
        """
        Yield the columns of each channel: of several shafts, one each.
        """
        for channels in (SHAFTS, PITCHES):
            if self.channel is channels[0]:
                for channel, name, factor in zip(channels, self.names, self.factors, strict=False):
                    yield InputColumns(channel, (name,), (factor,))
                return
        yield self


@dataclass(frozen=True)
class TimeColumn:
    """The column of the time of measurement, and its unit in nanoseconds."""

    name: str
    unit_ns: Decimal


def parse_input(text: str) -> InputColumns:
    """
    Read `INPUT=COLUMN[:unit]`.

    `position` and `wind_apparent` take two columns, `shaft` and `pitch` up to
    four, one a shaft. A unit given once holds for all, `position=x,y:km` as much
    as `position=x:km,y`; several are taken as written, `position=x:km,y:m`. A
    position in `deg` is latitude and longitude. Without a unit the values are SI,
    a pitch is a ratio.

    Raises
    ------
    ImportDataError
        If the input or a unit is not known, or a column is missing.
    """
    name, _, rest = text.partition('=')
    name = name.strip()
    channels = [channel for channel in _UNITS if _name(channel) == name]
    if not channels:
        known = ', '.join(dict.fromkeys(map(_name, _UNITS)))
        raise ImportDataError(f'--map {text!r}: no input {name!r}; inputs are {known}')
    counts = _COUNTS.get(name, (1,))
    columns = [_split_unit(piece, _units_of(channels)) for piece in rest.split(',')]
    if len(columns) not in counts or not all(column for column, _ in columns):
        expected = f'{counts[0]}' if len(counts) == 1 else f'{counts[0]} to {counts[-1]}'
        example = f'{name}={",".join(["COLUMN[:unit]"] * counts[0])}'
        raise ImportDataError(f'--map {text!r}: expected {expected} column(s), {example}')
    given = [unit for _, unit in columns if unit is not None]
    channel = channels[0]
    if 'deg' in given and channel is Channel.POSITION:
        channel = Channel.POSITION_GEODETIC
    factors = _UNITS[channel]
    if any(unit not in factors for unit in given):
        raise ImportDataError(
            f'--map {text!r}: expected both columns in deg, or both in {", ".join(_LENGTH)}'
        )
    common = given[0] if given else None  # a unit given once holds for all columns
    units = [unit or common for _, unit in columns]
    return InputColumns(
        channel,
        tuple(column for column, _ in columns),
        tuple(1.0 if unit is None else factors[unit] for unit in units),
    )


def parse_time(text: str) -> TimeColumn:
    """
    Read `COLUMN[:unit]` of the time; s without a unit.

    Raises
    ------
    ImportDataError
        If the unit is not known.
    """
    column, unit = _split_unit(text, NANOSECONDS)
    if not column:
        raise ImportDataError(f'--time {text!r}: expected COLUMN[:unit]')
    return TimeColumn(column, NANOSECONDS[unit or 's'])


def _name(channel: Channel) -> str:
    return 'pitch' if channel in PITCHES else channel.input


def _units_of(channels: list[Channel]) -> set[str]:
    return {unit for channel in channels for unit in _UNITS[channel]}


def _split_unit(text: str, units: Mapping[str, object] | set[str]) -> tuple[str, str | None]:
    """Return column and unit; a colon may also be part of a column's name."""
    column, colon, unit = text.strip().rpartition(':')
    if not colon:
        return text.strip(), None
    if unit.strip() in units:
        return column.strip(), unit.strip()
    raise ImportDataError(
        f'{text!r}: no unit {unit!r} here; units are {", ".join(sorted(units))}. '
        'For a colon in the name of a column write its number'
    )
