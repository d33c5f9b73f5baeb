# SPDX-License-Identifier: Apache-2.0
"""Figures, times and tables as text, the same in the terminal and on a page."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from datetime import UTC, datetime

M_S_PER_KNOT = 1852.0 / 3600.0
# what `float` takes besides, 1_000 or nan or infinity, is no measured number
NUMBER = re.compile(r'[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d{1,4})?')
LIGHT_KG = 1e4
"""Below it a ship is told in kg and N, above in t and kN."""

TRACK_LABELS = {
    'speed_through_water': ('Speed through water', 'm/s'),
    'speed_over_ground': ('Speed over ground', 'm/s'),
    'position': ('Distance along the track', 'm'),
    'position_across': ('Distance to port of the track', 'm'),
}


@dataclass(frozen=True)
class Table:
    """Column heads and rows, ready to be shown."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def spreadsheet_text(text: str) -> str:
    """
    Return a text that no spreadsheet takes for a formula.

    A file name may begin with `=`; a quote before it makes it text. Numbers are
    written as numbers and need none.
    """
    return f"'{text}" if text.startswith(('=', '+', '-', '@', '\t', '\r')) else text


def utc(time_ns: int) -> str:
    """
    Return a time in a form to read, in whole seconds of UTC.
    """
    seconds = time_ns // 1_000_000_000
    try:
        moment = datetime.fromtimestamp(seconds, UTC)
    except (ValueError, OverflowError, OSError):
        return f'{seconds} s'
    # clocks that start at zero (simulation, import) have no date worth reading
    if moment.year < 1980:
        return f'{seconds} s'
    return moment.strftime('%Y-%m-%d %H:%M:%S UTC')


def duration(seconds: float) -> str:
    """
    Return a length of time in s, and in min where that reads better.
    """
    if seconds < 600.0:
        return f'{seconds:.4g} s'
    return f'{seconds:.0f} s ({seconds / 60.0:.0f} min)'


def plus_minus(value: float, spread: float) -> str:
    """
    Return a value and its spread, both to the digits that the spread allows.
    """
    if not (math.isfinite(value) and math.isfinite(spread) and spread > 0.0):
        return f'{value:.4g} ± {spread:.2g}'
    decimals = decimals_of(spread)
    if decimals < 0:
        value, spread, decimals = round(value, decimals), round(spread, decimals), 0
    return f'{value:.{decimals}f} ± {spread:.{decimals}f}'


def decimals_of(spread: float) -> int:
    """
    Return the decimals that show two digits of a spread > 0; negative above 100.
    """
    return 1 - math.floor(math.log10(spread))


def force_unit(mass_kg: float) -> tuple[float, str]:
    """
    Return what a force of a ship is shown in: newtons in the unit, and its name.
    """
    return (1.0, 'N') if mass_kg < LIGHT_KG else (1000.0, 'kN')


def speed_text(speed_m_s: float, *, highest_m_s: float) -> str:
    """
    Return a speed without its unit; a model ship needs one digit more.
    """
    return f'{speed_m_s:.{2 if highest_m_s >= 1.0 else 3}f}'
