# SPDX-License-Identifier: Apache-2.0
"""The trend of every ship of a store."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from shipdrag_ros.errors import ShipFileError
from shipdrag_ros.library.listener import Listener
from shipdrag_ros.ship import Ship

if TYPE_CHECKING:
    from shipdrag_ros.fleet.events import HullEvent
    from shipdrag_ros.trend import ShipTrend


def trends_of(listener: Listener, store: Path) -> tuple[list[ShipTrend], list[tuple[str, str]]]:
    """
    Return the trend of every ship of a store, and what the fleet could not use.

    Parameters
    ----------
    listener
        Called with what of the ship files and of the events cannot be used.
    store
        Folder that `shipdrag fleet` has written.

    Returns
    -------
    trends, skipped
        In the order of their rank; bag and reason.
    """
    # Parquet takes long to import
    from shipdrag_ros.fleet.store import read_bags, read_coastdowns
    from shipdrag_ros.trend import fleet_trends

    ships, events = _ships(listener, store)
    rows = read_coastdowns(store).to_pylist()
    bags = read_bags(store).to_pylist()
    skipped = [(row['bag'], row['error']) for row in bags if row['error'] is not None]
    return fleet_trends(rows, ships, events), skipped


def _ships(
    listener: Listener, store: Path
) -> tuple[dict[str, Ship], dict[str, Sequence[HullEvent]]]:
    """Return ship files and events that the store keeps; say which cannot be used."""
    from shipdrag_ros.fleet.events import read_events
    from shipdrag_ros.fleet.find import EVENTS_FILE, SHIP_FILE
    from shipdrag_ros.fleet.store import ship_texts

    ships: dict[str, Ship] = {}
    events: dict[str, Sequence[HullEvent]] = {}
    for name, files in ship_texts(store).items():
        if SHIP_FILE in files:
            try:
                ships[name] = Ship.from_yaml(files[SHIP_FILE], subject=f'ship file of {name!r}')
            except ShipFileError as error:
                listener.log(f'{error}\nits prices are not used')
        events[name], problems = read_events(files.get(EVENTS_FILE, ''))
        for problem in problems:
            listener.log(f'{name}: {problem}')
    return ships, events
