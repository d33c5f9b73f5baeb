# SPDX-License-Identifier: Apache-2.0
"""What the usual names of columns mean, and which unit a name states."""

from __future__ import annotations

import re
from collections.abc import Mapping

ROLES: Mapping[str, tuple[str, ...]] = {
    'stw': (
        'stw',
        'speed through water',
        'speed through the water',
        'water speed',
        'boatspeed',
        'boat speed',
        'bsp',
        'bspd',
        'log speed',
        'speed log',
        'speed water',
    ),
    'sog': (
        'sog',
        'speed over ground',
        'speed over the ground',
        'ground speed',
        'groundspeed',
        'ext sog',
        'gps sog',
        'gps speed',
        'gnss speed',
    ),
    'lat': ('lat', 'latitude', 'latitudine', 'latitud', 'gps lat', 'gps latitude', 'breite'),
    'lon': (
        *('lon', 'long', 'lng', 'longitude', 'longitudine', 'longitud', 'gps lon'),
        *('gps longitude', 'gps long', 'laenge', 'länge'),
    ),
    'x': ('x', 'pos x', 'x pos', 'position x', 'easting', 'east', 'pos e', 'pos east'),
    'y': ('y', 'pos y', 'y pos', 'position y', 'northing', 'north', 'pos n', 'pos north'),
    'heading': (
        *('hdg', 'hdt', 'heading', 'true heading', 'heading true', 'hdg true', 'gyro'),
        *('gyro heading', 'heading gyro'),
    ),
    'shaft': (
        *('shaft', 'shaft speed', 'shaft rpm', 'shaft revs', 'propeller', 'propeller speed'),
        *('propeller rpm', 'prop', 'prop rpm', 'screw'),
    ),
    'rudder': ('rudder', 'rudder angle'),
    'aws': ('aws', 'aw speed', 'apparent wind speed'),
    'awa': ('awa', 'aw angle', 'apparent wind angle'),
    'depth': ('depth', 'water depth', 'depth below surface', 'depht'),
    'east': ('ve', 'v e', 'vel e', 'v east', 'vel east', 'velocity east', 'east velocity'),
    'north': ('vn', 'v n', 'vel n', 'v north', 'vel north', 'velocity north', 'north velocity'),
    'time': (
        *('t', 'time', 'timestamp', 'datetime', 'date time', 'utc', 'date time utc', 'time utc'),
        *('unix', 'unix time', 'epoch', 'elapsed', 'elapsed time', 'seconds', 'utc time'),
        *('zeit', 'uhrzeit', 'hora'),
    ),
    'date': ('date', 'day', 'date utc', 'utc date', 'datum', 'fecha'),
}
"""By role, the names of its columns: in lower case, without a unit."""

UNITS: Mapping[str, str] = {
    **dict.fromkeys(('m/s', 'mps', 'm s', 'ms-1', 'm.s-1', 'm/sec', 'm per s'), 'm/s'),
    **dict.fromkeys(('kn', 'kt', 'kts', 'knot', 'knots'), 'kn'),
    **dict.fromkeys(('km/h', 'kmh', 'kph', 'km h'), 'km/h'),
    **dict.fromkeys(('ft/s', 'fps'), 'ft/s'),
    'mph': 'mph',
    **dict.fromkeys(('rad', 'radians'), 'rad'),
    **dict.fromkeys(('deg', '°', 'degree', 'degrees', 'grad'), 'deg'),
    **dict.fromkeys(('rpm', '1/min', 'min-1', 'r/min', 'u/min'), 'rpm'),
    **dict.fromkeys(('rps', 'rev/s', '1/s', 's-1', 'hz'), 'rev/s'),
    **dict.fromkeys(('rad/s', 'rad s', 'radps', 'rads'), 'rad/s'),
    **dict.fromkeys(('m', 'metre', 'metres', 'meter', 'meters'), 'm'),
    'km': 'km',
    **dict.fromkeys(('ft', 'feet'), 'ft'),
    **dict.fromkeys(('nm', 'nmi'), 'nmi'),
    **dict.fromkeys(('s', 'sec', 'seconds'), 's'),
    **dict.fromkeys(('ms', 'msec'), 'ms'),
    'us': 'us',
    'ns': 'ns',
}
"""How units are written in names of columns, and how `--map` takes them."""

OTHER_UNITS = frozenset(
    (
        *('%', 'percent', 'min', 'minutes', 'h', 'hr', 'hours', 'd', 'days', 'mrad', 'mil', 'gon'),
        *('cm/s', 'mm/s', 'm/min', 'deg/s', '°/s', 'cm', 'mm', 'fm', 'fathoms'),
    )
)
"""Units in brackets or below a name that `--map` does not take: none is guessed for these."""

_BRACKETS = re.compile(r'[\[(]([^\[\]()]*)[\])]')
_ROLE_OF = {name: role for role, names in ROLES.items() for name in names}


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
