# SPDX-License-Identifier: Apache-2.0
"""The first rows of a table, by the roles that the names of its columns give them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from shipdrag_ros.samples import Float64
from shipdrag_ros.sources.formats.csv.cells import (
    BadCell,
    degrees_of,
    has_decimal_commas,
    minutes_of,
    number,
)
from shipdrag_ros.sources.formats.csv.names import role_and_unit
from shipdrag_ros.sources.table import LogTable

_SAMPLE_ROWS = 20_000


@dataclass(frozen=True)
class NamedColumn:
    """A column with a role; `key` is its name, or its number where the name is not enough."""

    key: str
    place: int
    unit: str

    @property
    def typed(self) -> str:
        """As `--map` takes it."""
        return str(self.place + 1) if set(self.key) & set(',:=') else self.key


class FirstRows:
    """
    The first rows of a table that has a header.

    Parameters
    ----------
    table

    Attributes
    ----------
    path, header
        Of the table.
    roles
        Columns by what their names say they are, in their order.
    """

    def __init__(self, table: LogTable) -> None:
        assert table.header is not None
        self.table = table
        self.path = str(table.path)
        self.header = table.header
        self.roles: dict[str, list[NamedColumn]] = {}
        self._rows = list(islice(table.rows(), _SAMPLE_ROWS))
        for place, name in enumerate(table.header):
            below = table.units[place] if table.units and place < len(table.units) else ''
            role, unit = role_and_unit(name, below)
            key = name if table.header.count(name) == 1 else str(place + 1)
            if role:
                self.roles.setdefault(role, []).append(NamedColumn(key, place, unit))

    def texts(self, place: int) -> list[str]:
        """
        Return the cells of a column; '' where a row is too short.
        """
        return [row.cells[place] if place < len(row.cells) else '' for row in self._rows]

    def values(self, place: int) -> Float64:
        """
        Return (n,) numbers of a column, NaN where a cell is none.
        """
        texts = self.texts(place)
        comma = has_decimal_commas(texts)
        return _read(number, [text.replace(',', '.', 1) if comma else text for text in texts])

    def largest(self, place: int) -> float:
        """
        Return the largest size of the numbers of a column; 0 where it has none.
        """
        return float(np.nanmax(np.abs(self.values(place)), initial=0.0))


def coordinates(texts: Sequence[str], side: str, minutes: bool) -> Float64:
    """
    Return (n,) latitudes or longitudes [deg], NaN where a cell is none.

    Parameters
    ----------
    texts : (n,)
        Cells.
    side
        'NS' or 'EW'.
    minutes
        Whether they are written in degrees and minutes.
    """
    return _read(minutes_of(side) if minutes else degrees_of(side), texts)


def _read(reader: Callable[[str], float], texts: Sequence[str]) -> Float64:
    found = np.full(len(texts), np.nan)
    for place, text in enumerate(texts):
        try:
            found[place] = reader(text)
        except BadCell:
            continue
    return found
