# SPDX-License-Identifier: Apache-2.0
"""A frame of pandas, polars or another library, written as a table that `sources` reads."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.errors import ImportDataError

NANOSECONDS = 'ns'
INDEX = 'time'
"""Column of a frame's own dates, where its index has no name."""


def is_frame(source: object) -> bool:
    """
    Say whether a source has named columns.
    """
    return hasattr(source, 'columns') and hasattr(source, '__getitem__')


def write_table(frame: Any, path: Path) -> tuple[str, ...]:
    """
    Write a frame as CSV: numbers to their last digit, dates in ns since the epoch.

    Parameters
    ----------
    frame
        With `columns` and, for each, something that `to_numpy()` or numpy can turn
        into an array. Dates without a zone are UTC. An index of dates becomes the
        first column, of its name where no other column has it.
    path
        File to make.

    Returns
    -------
    tuple of str
        Columns of dates, of which the index is first.

    Raises
    ------
    ImportDataError
        If the frame has no row, or is a lazy one.
    """
    if callable(getattr(frame, 'collect', None)):
        raise ImportDataError('a lazy frame holds no values yet; give frame.collect()')
    named = [(str(name), frame[name]) for name in frame.columns]
    index = getattr(frame, 'index', None)
    if str(getattr(index, 'dtype', '')).startswith('datetime64'):
        named.insert(0, (_free(str(getattr(index, 'name', None) or INDEX), named), index))
    dates, columns = [], []
    for name, values in named:
        array = _array(values)
        if array.dtype.kind == 'M':
            dates.append(name)
        columns.append(list(_cells(array)))
    if not columns or not columns[0]:
        raise ImportDataError('the frame holds no row or no column; give one with a row a sample')
    with path.open('w', encoding='utf-8', newline='') as file:
        writer = csv.writer(file)
        writer.writerow([name for name, _ in named])
        writer.writerows(zip(*columns, strict=True))
    return tuple(dates)


def _free(name: str, named: Sequence[tuple[str, Any]]) -> str:
    """Return a name that no column has."""
    taken = {each for each, _ in named}
    while name in taken:
        name = f'{name} (index)'
    return name


def _array(values: Any) -> NDArray[Any]:
    """Return a column as an array; dates with a zone in UTC."""
    if str(getattr(values, 'dtype', '')).startswith('datetime64'):
        return np.asarray(values.to_numpy(dtype='datetime64[ns]'))
    return np.asarray(values.to_numpy() if hasattr(values, 'to_numpy') else values)


def _cells(array: NDArray[Any]) -> Iterable[str]:
    """Yield the text of each value; nothing where there is none."""
    if array.dtype.kind == 'M':
        stamps = array.astype('datetime64[ns]')
        return (
            '' if missing else f'{stamp}'
            for missing, stamp in zip(np.isnat(stamps), stamps.astype(np.int64).tolist())
        )
    # the shortest text that reads back as the same number; NaN is no value
    return ('' if value is None or value != value else str(value) for value in array.tolist())
