# SPDX-License-Identifier: Apache-2.0
"""A frame of pandas, polars or another library, as a table that `sources` reads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.progress import PartDone
from shipdrag_ros.sources.table import Cells, LogTable, TableRows, texts_of

NANOSECONDS = 'ns'
FRAME = 'frame'
_ROWS = 1 << 14  # at a time
INDEX = 'time'
"""Column of a frame's own dates, where its index has no name."""


def is_frame(source: object) -> bool:
    """
    Say whether a source has named columns.
    """
    return hasattr(source, 'columns') and hasattr(source, '__getitem__')


class FrameTable(LogTable):
    """
    A frame as a table: numbers to their last digit, dates in ns since the epoch.

    Parameters
    ----------
    frame
        With `columns` and, for each, something that `to_numpy()` or numpy can turn
        into an array. Dates without a zone are UTC. An index of dates becomes the
        first column, of its name where no other column has it.

    Attributes
    ----------
    dates
        Columns of dates, of which the index is first.

    Raises
    ------
    ImportDataError
        If the frame has no row, two columns of one name, or is a lazy one.
    """

    def __init__(self, frame: Any) -> None:
        if callable(getattr(frame, 'collect', None)):
            raise ImportDataError('a lazy frame holds no values yet; give frame.collect()')
        names = [str(name) for name in frame.columns]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ImportDataError(
                f'the frame has {names.count(twice)} columns {twice!r}; name each differently'
            )
        named = [(str(name), frame[name]) for name in frame.columns]
        index = getattr(frame, 'index', None)
        if str(getattr(index, 'dtype', '')).startswith('datetime64'):
            named.insert(0, (_free(str(getattr(index, 'name', None) or INDEX), named), index))
        self._arrays = [_array(values) for _, values in named]
        if not self._arrays or not len(self._arrays[0]):
            raise ImportDataError(
                'the frame holds no row or no column; give one with a row a sample'
            )
        self.path = Path(FRAME)
        self.delimiter = ','
        self.header = tuple(name.strip() for name, _ in named)
        self.units = None
        self.titles = ()
        self.width = len(named)
        self.joined_lines = 0
        self.dates = tuple(
            name for (name, _), array in zip(named, self._arrays) if array.dtype.kind == 'M'
        )

    def rows(self, progress: PartDone | None = None, *, most: int = _ROWS) -> Iterator[TableRows]:
        """
        Yield the rows, some at a time; those without any value are skipped.
        """
        total = len(self._arrays[0])
        for first in range(0, total, most):
            columns = [_cells(array[first : first + most]) for array in self._arrays]
            valued = np.zeros(len(columns[0]), np.bool_)
            for cells in columns:
                texts = not isinstance(cells, np.ndarray)
                valued |= [*map(bool, cells)] if texts else cells == cells  # NaN is no value
            yield TableRows(range(first + 1, first + 1 + len(valued)), columns)[valued]


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


def _cells(array: NDArray[Any]) -> Cells:
    """Return numbers as they are, dates in ns, and the text of other values."""
    if array.dtype.kind != 'M':
        return array if array.dtype.kind in 'fiu' else texts_of(array)
    stamps = array.astype('datetime64[ns]')
    missing, counts = np.isnat(stamps), stamps.astype(np.int64)
    if not missing.any():
        return counts
    return ['' if none else text for none, text in zip(missing.tolist(), texts_of(counts))]
