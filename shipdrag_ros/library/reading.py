# SPDX-License-Identifier: Apache-2.0
"""Bags, logs and frames read as one record of a ship."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from shipdrag_ros.bags import BagWriter, Run, open_runs
from shipdrag_ros.bags.locate import BagFiles
from shipdrag_ros.bags.mcap_file import McapFile
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.library.frames import NANOSECONDS, is_frame, write_table
from shipdrag_ros.library.logs import Imported, Told, import_log, is_bag
from shipdrag_ros.library.record import Record
from shipdrag_ros.replay.playback import SHIP_FILE
from shipdrag_ros.samples import SECOND_NS, Block, concatenate, in_arrival_order
from shipdrag_ros.ship import Ship

NEAR_S = 600.0
"""Logs that begin so soon after another one ends continue it."""

_FOLDER = 'shipdrag-'
_FRAME = 'frame'


def read(
    source: Any,
    *,
    ship: Ship | str | PathLike[str] | None = None,
    columns: Mapping[str, str | Sequence[str]] | None = None,
    time: str | None = None,
    rate_hz: float | None = None,
    remap: Mapping[str, str] | None = None,
) -> Record:
    """
    Read what was measured on one ship.

    Parameters
    ----------
    source
        Path of a bag (MCAP file or rosbag2 directory), of a log of NMEA 0183 or of a
        table (CSV); a frame of pandas or polars; or a list of these, all of one ship.
    ship
        The ship, or the path of her file; None: the one attached to the bag.
    columns
        Which column of a table or frame is which input, with its unit behind a colon:
        `{'speed_through_water': 'log:kn', 'position': ('lat:deg', 'lon:deg')}`. Without
        a unit it is SI. None: the columns have the names of the inputs.
    time
        Column of the time, with its unit (`s ms us ns`) behind a colon; s without one.
        Not needed of a frame with a column or an index of dates.
    rate_hz
        Rows a second [Hz], where there is no column of the time.
    remap
        Recorded topic of a bag -> input.

    Returns
    -------
    Record
        Bags are a run each. Logs and frames whose times follow or cover each other
        are joined to one run, those that count from the start of a test are not.

    Raises
    ------
    BagError, ImportDataError
        If something cannot be read; the message says what to do.
    ShipFileError
        If the ship file cannot be used.

    Notes
    -----
    Source: inputs and units are those of `shipdrag import`. Dates without a zone are UTC.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> import shipdrag_ros as sd
    >>> seconds = np.arange(1200.0)
    >>> knots = 12.0 / (1.0 + np.maximum(seconds - 300.0, 0.0) / 400.0)
    >>> frame = pd.DataFrame({'t': seconds, 'log': knots})
    >>> ship = sd.Ship(length_m=80.0, displaced_volume_m3=4000.0)
    >>> sd.read(frame, ship=ship, columns={'speed_through_water': 'log:kn'}, time='t')
    <Record: a ship without a name, 1 run, 1200 messages>
    """
    given = ship if ship is None or isinstance(ship, Ship) else Ship.load(ship)
    alone = isinstance(source, str | PathLike) or is_frame(source)
    sources = [source] if alone else list(source)
    told = Told(columns, time, rate_hz)
    bags = [Path(each) for each in sources if not is_frame(each) and is_bag(Path(each))]
    others = [each for each in sources if is_frame(each) or not is_bag(Path(each))]
    runs = open_runs(bags, remap=remap) if bags else []
    if not others:
        return Record(runs, given=given)
    folder = TemporaryDirectory(prefix=_FOLDER)
    attachments = {} if given is None else {SHIP_FILE: given.to_yaml()}
    made: list[tuple[Run, bool]] = []
    notes: list[str] = []
    for number, each in enumerate(others):
        bag = Path(folder.name) / f'{number}.mcap'
        name, imported = _imported(each, bag, told, attachments)
        made.append((_run(name, imported.bag), imported.dated))
        notes += imported.notes
    joined = _joined(made, Path(folder.name), attachments)
    return Record([*runs, *joined], given=given, notes=notes, folder=folder)


def _imported(
    source: Any, bag: Path, told: Told, attachments: Mapping[str, str]
) -> tuple[str, Imported]:
    """Make a bag of a log or of a frame; return how it is called, too."""
    if not is_frame(source):
        return str(source), import_log(Path(source), bag, told, attachments)
    table = bag.with_suffix('.csv')
    dates = write_table(source, table)
    time = told.time
    if time is None and told.rate_hz is None and dates:
        time = dates[0]
    if time in dates:
        time = f'{time}:{NANOSECONDS}'
    return _FRAME, import_log(table, bag, Told(told.columns, time, told.rate_hz), attachments)


def _run(name: str, bag: Path) -> Run:
    return Run(BagFiles(name, (bag,)), [McapFile(bag)])


def _joined(
    made: Sequence[tuple[Run, bool]], folder: Path, attachments: Mapping[str, str]
) -> list[Run]:
    """Join the runs that follow or cover each other."""
    given = [run for run, _ in made]
    groups: list[list[Run]] = []
    for run, dated in sorted(made, key=lambda each: each[0].span_ns or (0, 0)):
        if dated and groups and run.span_ns is not None:
            ends = [each.span_ns[1] for each in groups[-1] if each.span_ns is not None]
            if ends and run.span_ns[0] - max(ends) <= NEAR_S * SECOND_NS:
                groups[-1].append(run)
                continue
        groups.append([run])
    found = []
    # effects of the earth are stated along the run that was given first
    groups.sort(key=lambda group: min(given.index(run) for run in group))
    for number, group in enumerate(groups):
        if len(group) == 1:
            found += group
            continue
        _refuse_rivals(group)
        bag = folder / f'joined-{number}.mcap'
        with BagWriter(bag) as writer:
            for name, text in attachments.items():
                writer.attach(name, text)
            writer.write_samples(in_arrival_order([_block(run) for run in group]))
        found.append(_run(f'{group[0].name} and {len(group) - 1} more', bag))
    return found


def _block(run: Run) -> Block:
    return concatenate([item for item in run.inputs() if isinstance(item, Block)])


def _refuse_rivals(group: Sequence[Run]) -> None:
    """Refuse two sources of one input at one time: they would be mixed."""
    for number, one in enumerate(group):
        for other in group[:number]:
            assert one.span_ns is not None
            assert other.span_ns is not None
            if one.span_ns[0] > other.span_ns[1]:
                continue
            shared = {topic.input for topic in one.topics} & {
                topic.input for topic in other.topics
            }
            if shared:
                raise ImportDataError(
                    f'{other.name!r} and {one.name!r} both give {", ".join(map(str, shared))} at '
                    'the same time; give one of them, or read each by itself'
                )
