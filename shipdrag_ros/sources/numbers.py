# SPDX-License-Identifier: Apache-2.0
"""Columns of numbers from a table in a file, all or none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shipdrag_ros.display import NUMBER
from shipdrag_ros.errors import DataError, ImportDataError
from shipdrag_ros.samples import Float64
from shipdrag_ros.sources.table import LogTable

_SHOWN = 20  # cells that are shown one by one
_MOST = 1e30  # its tenth power is a number still


@dataclass(frozen=True)
class Numbers:
    """
    Columns of one file.

    Attributes
    ----------
    names : (k,)
        Of the columns.
    values : (n, k)
        Finite numbers, whose higher powers are finite too.
    """

    names: tuple[str, ...]
    values: Float64

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def column(self, name: str) -> Float64:
        """
        Return (n,) values of a column that is there.
        """
        values: Float64 = self.values[:, self.names.index(name)]
        return values


def read_numbers(path: Path, names: Sequence[str], *, optional: Sequence[str] = ()) -> Numbers:
    """
    Read columns of a CSV file by name.

    Parameters
    ----------
    path
        Separated by comma, semicolon or tab, with a header.
    names
        Columns that must be there.
    optional
        Columns that are read where they are there.

    Raises
    ------
    DataError
        Naming every column that is missing, or every cell that is no usable
        number.
    ImportDataError
        If the file is no table.
    """
    table = LogTable(path)
    there = [name for name in optional if name in (table.header or ()) and name not in names]
    wanted = (*names, *there)
    places, problems = [], []
    for name in wanted:
        try:
            places.append(table.column(name))
        except ImportDataError as error:
            problems.append(str(error))
    if problems:
        raise DataError(str(path), problems)
    rows: list[list[float]] = []
    for some in table.rows():
        for line, *cells in zip(some.lines, *(some.texts(place) for place in places)):
            rows.append([_number(line, *each, problems) for each in zip(wanted, cells)])
    if not rows:
        problems.append('no row below the header, expected a line a measurement')
    if problems:
        more = len(problems) - _SHOWN
        shown = [*problems[:_SHOWN], f'and {more} more'] if more > 0 else problems
        raise DataError(str(path), shown)
    return Numbers(wanted, np.array(rows, np.float64).reshape(len(rows), len(wanted)))


def _number(line: int, name: str, cell: str, problems: list[str]) -> float:
    """Return the number of a cell; of one that holds none, what is wrong goes to the problems."""
    if NUMBER.fullmatch(cell) and abs(value := float(cell)) <= _MOST:
        return value
    comma = NUMBER.fullmatch(cell.replace(',', '.', 1)) and ',' in cell
    problems.append(
        f'line {line}, {name}: {cell!r}, expected a number, at most {_MOST:g} in size'
        + ('; write a decimal point' if comma else '')
    )
    return 0.0
