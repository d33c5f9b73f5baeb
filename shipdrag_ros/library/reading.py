# SPDX-License-Identifier: Apache-2.0
"""Bags, logs and frames read as one record of a ship."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from shipdrag_ros.bags import open_runs
from shipdrag_ros.bags.mcap_file import is_bag
from shipdrag_ros.errors import BagError
from shipdrag_ros.library.record import Record
from shipdrag_ros.library.replaying import refuse_two_ships
from shipdrag_ros.library.wording import says_it_in_python
from shipdrag_ros.replay.playback import SHIP_FILE
from shipdrag_ros.ship import Ship


@says_it_in_python
def read(
    source: Any,
    *,
    ship: Ship | str | PathLike[str] | None = None,
    columns: Mapping[str, str | Sequence[str]] | None = None,
    time: str | None = None,
    rate_hz: float | None = None,
    remap: Mapping[str, str] | None = None,
    options: Mapping[str, Any] | None = None,
) -> Record:
    """
    Read what was measured on one ship.

    Parameters
    ----------
    source
        Path of a bag (MCAP file or rosbag2 directory), of a log in any format that
        `shipdrag import` knows, or of a table (CSV); a frame of pandas or polars; or a
        list of these, all of one ship.
    ship
        The ship, or the path of her file; None: the one attached to the bag.
    columns
        Which column of a table or frame is which input, with its unit behind a colon:
        `{'speed_through_water': 'log:kn', 'position': ('lat:deg', 'lon:deg')}`. Without
        a unit it is SI. Of several tables each takes the columns that it has. None:
        columns are known by their usual names and units.
    time
        Column of the time: dates, or a count with its unit (`s ms us ns`) behind a
        colon. Not needed where its name says it, and of a frame with a column or an
        index of dates.
    rate_hz
        Rows a second [Hz], where there is no column of the time.
    remap
        Recorded topic of a bag -> input.
    options
        Further options of `shipdrag import` for logs and tables: `{'speed_unit': 'kn'}`,
        `{'date': '2024-05-17'}`, `{'gear': 2.5}`.

    Returns
    -------
    Record
        Bags are a run each. Logs and frames whose dates follow or cover each other
        are joined to one run, those that count from the start of a test are not.

    Raises
    ------
    BagError, ImportDataError
        If something cannot be read, or is of two ships; the message says what to do.
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
    from shipdrag_ros.library.logs import is_frame

    if not isinstance(ship, Ship | str | PathLike | None):
        raise BagError(f'ship={ship!r}: expected a Ship, or the path of a ship file')
    given = ship if ship is None or isinstance(ship, Ship) else Ship.load(ship)
    alone = isinstance(source, str | PathLike) or is_frame(source)
    several = source if not alone and isinstance(source, Iterable) else [source]
    sources = [each if is_frame(each) else _path(each) for each in several]
    bags = [each for each in sources if isinstance(each, Path) and is_bag(each)]
    runs = open_runs(bags, remap=remap) if bags else []
    if given is None:
        refuse_two_ships((run, None) for run in runs)
    others = [each for each in sources if not (isinstance(each, Path) and is_bag(each))]
    if not others:
        given_for_logs = {'columns': columns, 'time': time, 'rate_hz': rate_hz, 'options': options}
        idle = [f'{name}=' for name, value in given_for_logs.items() if value is not None]
        notes = [f'{", ".join(idle)} not used: they are for logs and tables'] if idle else []
        return Record(runs, given=given, notes=notes)
    from shipdrag_ros.library.logs import ReadOptions, read_logs  # a bag needs no importer

    how = ReadOptions(columns, time, rate_hz, options)
    attachments = {} if given is None else {SHIP_FILE: given.to_yaml()}
    imported, notes = read_logs(others, how, attachments)
    return Record([*runs, *imported], given=given, notes=notes)


def _path(source: Any) -> Path:
    """Return the path that a source must be where it is no frame."""
    if not isinstance(source, str | PathLike):
        raise BagError(
            f'{type(source).__name__!r} is no source; give the path of a bag, a log or a table, '
            'a frame of pandas or polars, or a list of these'
        )
    return Path(source)
