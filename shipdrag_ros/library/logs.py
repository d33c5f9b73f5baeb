# SPDX-License-Identifier: Apache-2.0
"""Logs, tables and frames (of pandas, polars, others) made runs; files of one ship are joined."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.bags import Run
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.library.shown import in_python
from shipdrag_ros.progress import PartDone
from shipdrag_ros.samples import SECOND_NS
from shipdrag_ros.sources import formats
from shipdrag_ros.sources.format import Format, Job, Option
from shipdrag_ros.sources.formats.csv.importer import FORMAT as TABLE
from shipdrag_ros.sources.formats.csv.importer import read_csv
from shipdrag_ros.sources.formats.csv.table import (
    Cells,
    LogTable,
    TableRows,
    are_numbers,
    parse_input,
    parse_time,
    written,
)
from shipdrag_ros.sources.log import ImportResult, Log
from shipdrag_ros.sources.reading import LogRun, format_of, join

NANOSECONDS = 'ns'
FRAME = 'frame'
_ROWS = 1 << 14  # at a time
INDEX = 'time'
"""Column of a frame's own dates, where its index has no name."""


def is_frame(source: object) -> bool:
    """
    Say whether a source has named columns.
    """
    # of its type: a lazy frame would look at its data to tell its columns
    return hasattr(type(source), 'columns') and hasattr(source, '__getitem__')


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
                valued |= cells == cells if are_numbers(cells) else cells != ''  # NaN is no value
            lines = np.arange(first + 1, first + 1 + len(valued))
            yield TableRows(lines, columns)[valued]


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
        return array if are_numbers(array) else written(array)
    stamps = array.astype('datetime64[ns]')
    missing, counts = np.isnat(stamps), stamps.astype(np.int64)
    return np.where(missing, '', written(counts)) if missing.any() else counts


_NEAR_NS = 600 * SECOND_NS  # logs that begin so soon after another one ends continue it
_FORMAT = 'format'
_COLUMNS = "give the column of each input, {'speed_through_water': 'log:kn'} for instance"
_OWN = {'map': 'columns', 'time': 'time', 'rate': 'rate_hz'}  # options that are arguments


@dataclass(frozen=True)
class ReadOptions:
    """
    How a log is to be read, where it does not say so itself.

    Attributes
    ----------
    columns
        Column or columns by input, each with its unit behind a colon.
    time
        Column of the time, with its unit behind a colon.
    rate_hz
        Rows a second, where there is no column of the time.
    others
        Further options of `shipdrag import` by their names, as text or as numbers.
    """

    columns: Mapping[str, str | Sequence[str]] | None = None
    time: str | None = None
    rate_hz: float | None = None
    others: Mapping[str, Any] | None = None

    def of_dates(self, dates: Sequence[str]) -> ReadOptions:
        """
        Take the first column of dates for the time, where no other is given.

        Parameters
        ----------
        dates
            Columns that hold ns since the epoch.
        """
        time = self.time
        if time is None and self.rate_hz is None and dates:
            time = dates[0]
        return replace(self, time=f'{time}:{NANOSECONDS}' if time in dates else time)

    def __post_init__(self) -> None:
        if not isinstance(self.columns or {}, Mapping):
            raise ImportDataError(f'columns {self.columns!r}: {_COLUMNS}')
        for name, columns in (self.columns or {}).items():
            several = columns if isinstance(columns, list | tuple) else [columns]
            if not all(isinstance(each, str) for each in several):
                raise ImportDataError(f'columns: {name!r} is {columns!r}; {_COLUMNS}')

    @property
    def maps(self) -> tuple[str, ...]:
        """The columns as `shipdrag import --map` takes them."""
        return tuple(
            f'{name}={columns if isinstance(columns, str) else ",".join(columns)}'
            for name, columns in (self.columns or {}).items()
        )

    def options(self, source: Path | LogTable, *, alone: bool) -> dict[str, Any]:
        """
        Return the options of `shipdrag import` for a file.

        Parameters
        ----------
        source
        alone
            Whether it must have all the columns; of several files each takes those
            that it has, and one that has none is read by what it says itself.
        """
        found: dict[str, Any] = {}
        maps = [text for text in self.maps if alone or _is_in(text, source)]
        if maps:
            found['map'] = maps
        if self.time is not None:
            found['time'] = parse_time(self.time)
        if self.rate_hz is not None:
            found['rate'] = self.rate_hz
        return found | self._read_others()

    @property
    def named(self) -> Format | None:
        """
        The format that was named, if one was.

        Raises
        ------
        ImportDataError
            If there is none of the name.
        """
        name = (self.others or {}).get(_FORMAT)
        if name is None:
            return None
        known = {each.name: each for each in formats.found()}
        if name not in known:
            raise ImportDataError(f'options {_FORMAT!r}: {name!r}, there are {", ".join(known)}')
        return known[name]

    def _read_others(self) -> dict[str, Any]:
        """Return the further options as a format takes them."""
        known = {option.key: option for each in formats.found() for option in each.options}
        found: dict[str, Any] = {}
        if self.others is not None and not isinstance(self.others, Mapping):
            raise ImportDataError(
                f'options {self.others!r}: give each with its value, '
                "{'speed_unit': 'kn'} for instance"
            )
        for key, value in (self.others or {}).items():
            if key == _FORMAT:
                continue
            if key in _OWN:
                raise ImportDataError(f'options {key!r}: give {_OWN[key]}=')
            if key not in known:
                names = ', '.join(sorted({*known, _FORMAT} - set(_OWN)))
                raise ImportDataError(f'options {key!r}: not known; there are {names}')
            try:
                found[key] = _value(known[key], value)
            except (ValueError, ImportDataError) as error:
                raise ImportDataError(f'options {key!r}: {error}') from error
        return found


def _value(option: Option, value: Any) -> Any:
    """Read a value as the command line would; a switch is on or off."""
    if not option.metavar:
        return bool(value)
    if not option.many:
        return option.read(str(value))
    several = value if isinstance(value, list | tuple) else [value]
    return [option.read(str(each)) for each in several]


def _is_in(text: str, source: Path | LogTable) -> bool:
    """Say whether a file is a table that has the columns of an input."""
    try:
        table = source if isinstance(source, LogTable) else LogTable(source)
        for name in parse_input(text).names:
            table.column(name)
    except ImportDataError:
        return False
    return True


@dataclass(frozen=True)
class _Part:
    """A source that can be read by itself."""

    place: int
    declared: Format
    source: Path | LogTable
    log: Log
    run: Run
    dated: bool


def read_logs(
    sources: Sequence[Any], how: ReadOptions, attachments: Mapping[str, str]
) -> tuple[list[Run], list[str]]:
    """
    Make runs of logs, tables and frames.

    Parameters
    ----------
    sources
        Paths and frames.
    how
        How tables and frames are to be read.
    attachments
        Text by name, a ship file for instance.

    Returns
    -------
    runs, notes
        In the order given; what of the sources was not used, and why.

    Raises
    ------
    ImportDataError
        If one cannot be read.
    """
    parts: list[_Part] = []
    notes: list[str] = []
    for place, source in enumerate(sources):
        part, said = _part(source, place, how, alone=len(sources) == 1)
        parts.append(part)
        notes += said
    for text in how.maps:
        if not any(_is_in(text, part.source) for part in parts):
            raise ImportDataError(f'columns {text!r}: none of the sources has them; name others')
    known = {option.key for part in parts for option in part.declared.options}
    for key in (key for key in how.others or {} if key not in known | {_FORMAT}):
        kinds = ' and '.join(dict.fromkeys(part.declared.kind for part in parts))
        raise ImportDataError(f'options {key!r}: {kinds} has no use for it; leave it out')
    runs: list[Run] = []
    for group in _groups(parts):
        if len(group) == 1:
            runs.append(group[0].run)
            continue
        joined, _, said = join([(each.run.paths[0].name, each.log) for each in group])
        notes += said
        whole = LogRun(joined, [each.run.paths[0] for each in group])
        whole.name = ', '.join(each.run.name for each in group)
        runs.append(whole)
    for run in runs:
        run.attachments |= attachments
    return runs, notes


def _part(source: Any, place: int, how: ReadOptions, *, alone: bool) -> tuple[_Part, list[str]]:
    """Read a source by itself; return it, and what of it was not used."""
    log = Log()
    if is_frame(source):
        name, path = FRAME, Path(FRAME)
        source = FrameTable(source)
        how = how.of_dates(source.dates)
        options = how.options(source, alone=alone)
        declared = how.named or TABLE  # however few columns it has
        if declared.name != TABLE.name:
            raise ImportDataError(f'a frame is a table, and not {declared.kind}; leave format out')
        found: ImportResult = read_csv(source, log, options)
    else:
        name, path = str(source), source
        options = how.options(path, alone=alone)
        declared = format_of(path, options, how.named)
        found = declared.read(Job(path, options), log)
    run = LogRun(log, [path])
    run.name = name
    notes = [*found.summary(path)[1:], *found.details()]
    dated = getattr(found, 'base_ns', None) is None
    said = [f'{name}: {in_python(note)}' for note in notes]
    return _Part(place, declared, source, log, run, dated), said


def _groups(parts: Sequence[_Part]) -> list[list[_Part]]:
    """Put together the parts whose dates follow or cover each other, in the order given."""
    groups: list[list[_Part]] = []
    end_ns = 0
    for part in sorted(parts, key=lambda each: each.run.span_ns or (0, 0)):
        start_ns, last_ns = part.run.span_ns or (0, 0)
        if part.dated and groups and groups[-1][0].dated and start_ns - end_ns <= _NEAR_NS:
            groups[-1].append(part)
            end_ns = max(end_ns, last_ns)
            continue
        groups.append([part])
        end_ns = last_ns
    # effects of the earth are stated along the run that was given first
    found = [sorted(group, key=lambda part: part.place) for group in groups]
    return sorted(found, key=lambda group: group[0].place)
