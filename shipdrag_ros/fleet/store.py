# SPDX-License-Identifier: Apache-2.0
"""
The store: a Parquet data set that any tool reads, and the files of each ship.

`coastdowns/ship=NAME/HASH.parquet` has one row a coastdown, `bags/HASH.parquet`
one row a bag, `ships/ship=NAME/` the ship file and the known events. A file
appears whole or not at all, that of `bags` last: what is listed there is done.
The same rows give the same bytes.
"""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, unquote

import numpy as np

from shipdrag_ros import __version__
from shipdrag_ros.coastdown.events import EndedBy, EndedCoastdown
from shipdrag_ros.diagnosis.document import candidates, sized
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.errors import FleetError
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

if TYPE_CHECKING:
    import pyarrow as pa


FROUDE: Float64 = np.round(np.linspace(0.02, 0.40, 77), 3)
"""Of every curve in the store."""

SHORT_S = 300.0
_ENDED = {
    EndedBy.TURN: 'turned',
    EndedBy.ENGINE: 'engine',
    EndedBy.ASTERN: 'engine',
    EndedBy.BRAKE: 'braked',
    EndedBy.DATA_STOP: 'data_stop',
    EndedBy.SILENCE: 'data_stop',
    EndedBy.RESET: 'data_stop',
}

Row = dict[str, Any]


@dataclass(frozen=True)
class BagResult:
    """
    What one bag gave.

    Attributes
    ----------
    bag
        The row of `bags`.
    coastdowns
        The rows of `coastdowns`.
    ship_file
        Text of the ship file that was used; '' without one.
    """

    bag: Row
    coastdowns: tuple[Row, ...] = ()
    ship_file: str = ''


def bag_row(root: str, bag: str, digest: str, *, error: str | None = None) -> Row:
    """Return the row of a bag of which nothing is read yet, or nothing can be."""
    return {
        'root': root,
        'bag': bag,
        'content_hash': digest,
        'software_version': __version__,
        'ship': None,
        'coastdowns': 0,
        'messages': 0,
        'warnings': [],
        'error': error,
    }


def coastdown_row(
    coastdown: EndedCoastdown,
    ship: Ship,
    *,
    diagnosis: DiagnosisResult | None,
    context: Mapping[str, Any],
    flags: Sequence[str] = (),
) -> Row:
    """
    Return the row of a coastdown.

    Parameters
    ----------
    coastdown
        As the replay found it.
    ship
        As she was in the run.
    diagnosis
        Of this coastdown alone; None where there is none.
    context
        Columns that all coastdowns of the bag share: `bag`, `content_hash`,
        `software_version`, `water_temperature_c`, `facts`.
    flags
        What else a trend may weigh.
    """
    estimate = None if coastdown.withdrawn else coastdown.estimate
    own_flags = (*flags, *_flags(coastdown), *(() if diagnosis else ('no_diagnosis',)))
    return {
        **{name: None for _, names in _OF_COASTDOWN for name in names.split()},
        **context,
        'time_ns': coastdown.start_ns,
        'end_ns': coastdown.end_ns,
        'ended_by': coastdown.ended_by.value,
        'heading_rad': coastdown.heading_rad,
        'froude': FROUDE,
        'speed_m_s': ship.speed(FROUDE),
        **_curve(estimate),
        'clean_m_s2': clean(ship),
        'length_m': ship.length_m,
        'draught_m': ship.draught_m,
        'displaced_volume_m3': ship.displaced_volume_m3,
        'water_density_kg_m3': ship.water.density_kg_m3,
        **({} if diagnosis is None else _diagnosis(diagnosis)),
        'flags': sorted(set(own_flags)),
        'error': _error(coastdown),
    }


def same_time(rows: Sequence[Mapping[str, Any]]) -> dict[int, int]:
    """
    Return which coastdowns of one ship were recorded at the same time as another.

    A copied folder, a part of a bag and two recorders aboard give one run several rows.

    Parameters
    ----------
    rows
        Of one ship.

    Returns
    -------
    dict
        Place of a row to the place of the one that stands for it: the longest, then one that
        is not damaged, then the one of which most is known.
    """
    start = np.array([row['time_ns'] for row in rows], np.int64)
    end = np.array([row.get('end_ns') or row['time_ns'] for row in rows], np.int64)
    known = [
        sum(row.get(name) is not None for name in ('water_temperature_c', 'verdict', 'draught_m'))
        - 9 * ('damaged' in (row.get('flags') or ()))
        for row in rows
    ]
    order = sorted(range(len(rows)), key=lambda n: (start[n] - end[n], -known[n], rows[n]['bag']))
    kept: list[int] = []
    found = {}
    for number in order:
        together = np.minimum(end[kept], end[number]) - np.maximum(start[kept], start[number])
        at_once = np.flatnonzero((together > 0) | (start[kept] == start[number]))
        if len(at_once):
            found[number] = kept[int(at_once[0])]
        else:
            kept.append(number)
    return found


def clean(ship: Ship) -> Float64 | None:
    """
    Return r of the clean hull on the grid [m/s^2]; NaN outside the baseline's table.

    None without a baseline.
    """
    if ship.baseline is None:
        return None
    low, high = ship.baseline_range_m_s
    speed = ship.speed(FROUDE)
    inside = (speed >= low) & (speed <= high)
    found = np.full(len(FROUDE), np.nan)
    found[inside] = ship.resistance_n(speed[inside]) / ship.mass_kg
    return found


def _diagnosis(found: DiagnosisResult) -> Row:
    return {
        'verdict': found.verdict.value,
        'effects': json.dumps(sized(found.effects), sort_keys=True),
        'candidates': json.dumps(candidates(found), sort_keys=True),
    }


def _curve(estimate: Estimate | None) -> Row:
    names = ('resistance_m_s2', 'sigma_m_s2', 'sigma_repeatable_m_s2')
    of_conditions = ('conditions_resistance_m_s2', 'conditions_sigma_m_s2')
    if estimate is None:
        return {name: np.full(len(FROUDE), np.nan) for name in (*names, *of_conditions)}
    (low, high) = estimate.froude_valid
    inside = (low <= FROUDE) & (high >= FROUDE)
    on_grid = {}
    for name in (*names, *of_conditions):
        whole = estimate.conditions if name in of_conditions else estimate.calm
        of_curve = getattr(whole, name.removeprefix('conditions_'))
        value = np.interp(FROUDE, whole.froude, of_curve, left=np.nan, right=np.nan)
        on_grid[name] = np.where(inside, value, np.nan)
    return {
        'estimator': estimate.estimator,
        'speed_at_stop_m_s': float(estimate.calm.speed_m_s[-1]),
        **on_grid,
        'reference': json.dumps(vars(estimate.reference)),
        'froude_valid_min': low,
        'froude_valid_max': high,
    }


def _flags(coastdown: EndedCoastdown) -> list[str]:
    found = []
    if coastdown.withdrawn:
        found.append('withdrawn')
    if coastdown.cuts:
        found.append('cut')
    if coastdown.ended_by in _ENDED:
        found.append(_ENDED[coastdown.ended_by])
    if coastdown.end_ns - coastdown.start_ns < SHORT_S * 1e9:
        found.append('short')
    if coastdown.estimate is None:
        found.append('no_estimate')
    return found


def _error(coastdown: EndedCoastdown) -> str | None:
    if coastdown.withdrawn:
        why = '; '.join(f'{cut.reason.value}: {cut.text}' for cut in coastdown.cuts)
        return f'withdrawn: {why or "it turned out to be no coastdown"}'
    if coastdown.estimate is None:
        return coastdown.failure or 'no estimate was possible'
    return None


KINDS = ('cleaning', 'docking', 'propeller_polish', 'coating')
HEADER = ('date', 'kind', 'note')
_EARLIEST, _LATEST = 1900, 2200
_AROUND = 60  # characters shown of what is wrong


@dataclass(frozen=True, order=True)
class HullEvent:
    """
    Something that was done to a hull.

    Attributes
    ----------
    time_ns
        [ns since the epoch]; of a date alone, its start in UTC.
    kind
        One of `KINDS`.
    note
        What else was written.
    """

    time_ns: int
    kind: str
    note: str = ''


def read_events(text: str) -> tuple[tuple[HullEvent, ...], tuple[str, ...]]:
    """
    Read `date,kind[,note]`.

    Parameters
    ----------
    text
        Of the file, an event a line; a header is not needed.

    Returns
    -------
    events, problems
        In the order of time, each once; and of each line that is left out, why.
    """
    events: set[HullEvent] = set()
    problems: list[str] = []
    # a line at a time: a quote that is not closed must not swallow the lines after it
    for number, line in enumerate(map(str.strip, text.splitlines()), start=1):
        try:
            event = None if not line or line.startswith('#') else _read_line(line)
        except ValueError as error:
            problems.append(f'events.csv line {number} is left out: {error}')
        else:
            events |= {event} if event else set()
    return tuple(sorted(events)), tuple(problems)


def _read_line(line: str) -> HullEvent | None:
    """Return the event of a line; None for a header and for empty cells."""
    try:
        [cells] = csv.reader([line], strict=True)
    except csv.Error as error:
        raise ValueError(
            f'{line[:_AROUND]!r}: {error}; write a note as "a note", a quote inside it twice'
        ) from error
    date, kind, *note = (cell.strip() for cell in (*cells, '')[: max(len(cells), 2)])
    if not any((date, kind, *note)) or date.lower() == HEADER[0]:
        return None
    try:
        moment = datetime.fromisoformat(date)
    except ValueError:
        raise ValueError(f'{date[:_AROUND]!r}, expected a date as 2026-03-01') from None
    kind = kind.lower()
    if kind not in KINDS:
        raise ValueError(f'{kind[:_AROUND]!r}, expected one of {", ".join(KINDS)}')
    if not _EARLIEST <= moment.year <= _LATEST:
        raise ValueError(f'{date[:_AROUND]!r}, expected a year from {_EARLIEST} to {_LATEST}')
    utc = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return HullEvent(round(utc.timestamp()) * 1_000_000_000, kind, ','.join(note))


def write_events(events: Sequence[HullEvent]) -> str:
    """Return the text that `read_events` reads back."""
    text = StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(HEADER)
    for event in events:
        moment = datetime.fromtimestamp(event.time_ns // 1_000_000_000, UTC)
        date = f'{moment:%Y-%m-%dT%H:%M:%SZ}'
        writer.writerow((date, event.kind, *([event.note] if event.note else [])))
    return text.getvalue()


COASTDOWNS, BAGS, SHIPS = 'coastdowns', 'bags', 'ships'
_PARTITION = 'ship='
_ROWS_AT_ONCE = 1 << 16
_OF_COASTDOWN = (
    ('string', 'ship bag content_hash software_version'),
    ('int64', 'time_ns end_ns'),
    ('string', 'ended_by estimator'),
    ('float64', 'heading_rad speed_at_stop_m_s'),
    ('list of float64', 'froude speed_m_s resistance_m_s2 sigma_m_s2 sigma_repeatable_m_s2'),
    ('list of float64', 'conditions_resistance_m_s2 conditions_sigma_m_s2 clean_m_s2'),
    ('string', 'reference'),
    ('float64', 'froude_valid_min froude_valid_max length_m draught_m displaced_volume_m3'),
    ('float64', 'water_temperature_c water_density_kg_m3'),
    ('string', 'verdict effects candidates'),
    ('list of string', 'facts flags'),
    ('string', 'error'),
)
"""Columns of a coastdown in their order, by type."""
_OF_BAG = (
    ('string', 'root bag content_hash software_version ship'),
    ('int64', 'coastdowns messages'),
    ('list of string', 'warnings'),
    ('string', 'error'),
)


@dataclass(frozen=True)
class Done:
    """
    A bag that is in the store.

    Attributes
    ----------
    root, bag
        Last part of the folder that was given, and the path below it.
    software_version
        That made its rows.
    ship
        None where the bag could not be read.
    coastdowns
        Number of them.
    error
        Why it could not be read; None where it could.
    """

    root: str
    bag: str
    software_version: str
    ship: str | None
    coastdowns: int
    error: str | None


class Store:
    """
    A store to write to.

    Parameters
    ----------
    path
        Its folder; made if missing.

    Raises
    ------
    FleetError
        If it cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            for name in (COASTDOWNS, BAGS, SHIPS):
                (path / name).mkdir(parents=True, exist_ok=True)
                for left in (path / name).glob('**/.new-*'):
                    left.unlink()  # of a run that was killed
        except OSError as error:
            raise FleetError(
                f'{str(path)!r} cannot be made: {error.strerror}; give one that may be written'
            ) from error

    def done(self) -> dict[str, Done]:
        """
        Return the bags that are in the store, by content hash.

        Raises
        ------
        FleetError
            If a file of the store cannot be read.
        """
        columns = ['content_hash', *(item.name for item in fields(Done))]
        rows = read_bags(self.path).select(columns).to_pylist()
        return {row.pop('content_hash'): Done(**row) for row in rows}

    def write(self, result: BagResult) -> None:
        """
        Write what a bag gave; what the store has of the same content is replaced.

        Raises
        ------
        FleetError
            If the disk does not take it.
        """
        digest = result.bag['content_hash']
        try:
            self._remove_rows(digest)
            if result.coastdowns:
                folder = self.path / COASTDOWNS / partition(result.bag['ship'])
                schema = coastdown_schema(partitioned=True)
                _write(folder / f'{digest}.parquet', list(result.coastdowns), schema)
            _write(self.path / BAGS / f'{digest}.parquet', [result.bag], bag_schema())
        except OSError as error:
            raise FleetError(f'{str(self.path)!r} cannot be written: {error}') from error

    def remove(self, digest: str) -> None:
        """Take a bag out of the store."""
        (self.path / BAGS / f'{digest}.parquet').unlink(missing_ok=True)
        self._remove_rows(digest)

    def keep_ship(self, name: str, files: Mapping[str, str]) -> None:
        """
        Keep what is known of a ship beside her rows.

        Parameters
        ----------
        name
            Of the ship.
        files
            Text by file name; an empty one is removed.
        """
        folder = self.path / SHIPS / partition(name)
        folder.mkdir(parents=True, exist_ok=True)
        for file, text in files.items():
            if text:
                _replace(folder / file, text.encode())
            else:
                (folder / file).unlink(missing_ok=True)

    def _remove_rows(self, digest: str) -> None:
        for path in (self.path / COASTDOWNS).glob(f'{_PARTITION}*/{digest}.parquet'):
            path.unlink()


def partition(ship: str) -> str:
    """Return the folder of a ship; whatever her name holds, it is one folder."""
    return f'{_PARTITION}{quote(ship, safe=" ")}'


def read_coastdowns(store: Path) -> pa.Table:
    """
    Return the coastdowns of a store, by ship and time.

    Parameters
    ----------
    store
        Folder that `shipdrag fleet` has written.

    Returns
    -------
    pyarrow.Table
        Of `coastdown_schema()`; without rows where there are none.

    Raises
    ------
    FleetError
        If it is no store, or a file of it cannot be read.
    """
    import pyarrow as pa

    tables = []
    for path in sorted(_folder(store, COASTDOWNS).glob(f'{_PARTITION}*/*.parquet')):
        table = _read(path, coastdown_schema(partitioned=True))
        ship = unquote(path.parent.name.removeprefix(_PARTITION))
        tables.append(table.add_column(0, 'ship', pa.array([ship] * len(table), pa.string())))
    schema = coastdown_schema()
    found = pa.concat_tables([table.cast(schema) for table in tables] or [schema.empty_table()])
    return found.sort_by([('ship', 'ascending'), ('time_ns', 'ascending'), ('bag', 'ascending')])


def read_bags(store: Path) -> pa.Table:
    """
    Return the bags of a store, by name.

    Parameters
    ----------
    store
        Folder that `shipdrag fleet` has written.

    Returns
    -------
    pyarrow.Table
        Of `bag_schema()`.

    Raises
    ------
    FleetError
        If it is no store, or a file of it cannot be read.
    """
    import pyarrow as pa

    schema = bag_schema()
    paths = sorted(_folder(store, BAGS).glob('*.parquet'))
    found = pa.concat_tables([_read(path, schema) for path in paths] or [schema.empty_table()])
    return found.sort_by([('root', 'ascending'), ('bag', 'ascending')])


def ship_texts(store: Path) -> dict[str, dict[str, str]]:
    """Return the files kept of each ship: text by file name, by name of the ship."""
    return {
        unquote(folder.name.removeprefix(_PARTITION)): {
            path.name: path.read_text(encoding='utf-8') for path in sorted(folder.iterdir())
        }
        for folder in sorted(_folder(store, SHIPS).glob(f'{_PARTITION}*'))
    }


def coastdown_schema(*, partitioned: bool = False) -> pa.Schema:
    """
    Return the columns of a coastdown; `partitioned`: without the ship, which the folder shows.
    """
    return _schema(_OF_COASTDOWN, without='ship' if partitioned else '')


def bag_schema() -> pa.Schema:
    """Return the columns of a bag."""
    return _schema(_OF_BAG)


def _schema(columns: Sequence[tuple[str, str]], *, without: str = '') -> pa.Schema:
    import pyarrow as pa

    def kind(name: str) -> pa.DataType:
        inner = name.removeprefix('list of ')
        alone = pa.type_for_alias(inner)
        return alone if inner == name else pa.list_(alone)

    return pa.schema(
        (name, kind(of)) for of, names in columns for name in names.split() if name != without
    )


def _folder(store: Path, name: str) -> Path:
    if not (store / name).is_dir():
        raise FleetError(
            f'{str(store)!r} is no store of a fleet; make one with `shipdrag fleet DIR -o STORE`'
        )
    return store / name


def _read(path: Path, schema: pa.Schema) -> pa.Table:
    import pyarrow as pa
    from pyarrow import parquet

    try:
        with path.open('rb') as file:
            return parquet.read_table(file).select(schema.names).cast(schema)
    except (OSError, KeyError, ValueError, pa.ArrowException) as error:
        if _is_older(path, schema):
            raise FleetError(
                f'{str(path)!r} is of a version before 0.4.0, whose r(v) was of the conditions of '
                'each run, not of calm deep water: run `shipdrag fleet` again, which replaces it'
            ) from error
        raise FleetError(
            f'{str(path)!r} cannot be read: {error}; remove it and run `shipdrag fleet` again'
        ) from error


def _is_older(path: Path, schema: pa.Schema) -> bool:
    """Say whether a file lacks what later versions write."""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        names = set(parquet.read_schema(path).names)
    except (OSError, pa.ArrowException):
        return False
    return 'resistance_m_s2' in names and not set(schema.names) <= names


def _write(path: Path, rows: list[Row], schema: pa.Schema) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    columns = {
        name: pa.array([_plain(row[name]) for row in rows], schema.field(name).type)
        for name in schema.names
    }
    sink = pa.BufferOutputStream()
    parquet.write_table(
        pa.table(columns, schema=schema), sink, compression='zstd', row_group_size=_ROWS_AT_ONCE
    )
    path.parent.mkdir(exist_ok=True)
    _replace(path, sink.getvalue().to_pybytes())


def _plain(value: Any) -> Any:
    """Return text that UTF-8 can hold; a path may hold what is none."""
    if isinstance(value, str):
        return value.encode('utf-8', 'backslashreplace').decode()
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return value


def _replace(path: Path, content: bytes) -> None:
    """Write a file that is there whole, or as it was before."""
    new = path.with_name(f'.new-{os.getpid()}-{path.name[-80:]}')
    try:
        with new.open('xb') as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)
