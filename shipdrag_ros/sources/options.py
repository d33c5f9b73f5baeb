# SPDX-License-Identifier: Apache-2.0
"""Options that several formats share."""

from __future__ import annotations

from datetime import date
from math import isfinite

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.sources.format import Option


def _date(text: str) -> date:
    try:
        return date.fromisoformat(text)
    except ValueError:
        raise ImportDataError(f'{text!r}, expected YYYY-MM-DD') from None


def positive(text: str) -> float:
    """
    Read a finite number above 0.

    Raises
    ------
    ImportDataError
        If it is none.
    """
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not (isfinite(value) and value > 0.0):
        raise ImportDataError(f'{text!r}, expected a number above 0')
    return value


def _depth_m(text: str) -> float:
    try:
        depth_m = float(text)
    except ValueError:
        depth_m = -1.0
    if not 0.0 <= depth_m < 100.0:
        raise ImportDataError(f'{text!r}, expected a depth from 0 to 100 [m]')
    return depth_m


DATE = Option(
    '--date',
    'YYYY-MM-DD',
    'date (UTC) of the first time, for a log that has only times of day; of NMEA 0183 also for '
    'one that is whole cycles of the GPS week (1024 weeks) early',
    _date,
)
GEAR = Option(
    '--gear',
    'RATIO',
    'revolutions of the engine for one of the shaft: takes the shaft from the engine, of which '
    'alone NMEA 2000 and Signal K hold; 1 without a gear',
    positive,
)
RATE = Option(
    '--rate',
    'HZ',
    'without times: rows of a table, or frames of NMEA 2000, a second [Hz]; above 0 [Hz]',
    positive,
)
TRANSDUCER = Option(
    '--transducer',
    'M',
    'depth of the echo sounder below the surface, where the log does not state it [m]',
    _depth_m,
)
