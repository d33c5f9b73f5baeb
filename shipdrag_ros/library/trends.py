# SPDX-License-Identifier: Apache-2.0
"""Added resistance of ships against time, from a store or from results of this session."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shipdrag_ros import __version__
from shipdrag_ros.display import Table
from shipdrag_ros.errors import FleetError, ShipFileError
from shipdrag_ros.library.record import Resistance
from shipdrag_ros.library.replaying import Listener, Notes
from shipdrag_ros.library.shown import Shown, drawing, says_it_in_python, writing
from shipdrag_ros.ship import SHIP_FILE, Ship
from shipdrag_ros.trend import ShipTrend, fleet_trends, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from shipdrag_ros.fleet.store import HullEvent


@dataclass(frozen=True, repr=False)
class Trends(Shown):
    """
    Added resistance of each ship against time.

    Attributes
    ----------
    ships
        The hull to be cleaned first in front.
    skipped
        Bag and reason of what the fleet could not use.
    notes
        What of ship files and events could not be used.

    Raises
    ------
    FleetError
        By `of` and `plot`, of a ship that is not there or has no trend.

    Notes
    -----
    Source: docs/trend.md.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> found = sd.Trends(ships=(), skipped=(), notes=())
    >>> found
    <Trends: no ship>
    >>> found.to_frame().columns.tolist()[:3]
    ['ship', 'time', 'added_resistance']
    """

    ships: tuple[ShipTrend, ...]
    skipped: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()

    def of(self, ship: str) -> ShipTrend:
        """
        Return the trend of one ship.

        Raises
        ------
        FleetError
            If there is none of the name.
        """
        for each in self.ships:
            if each.series.name == ship:
                return each
        known = ', '.join(repr(each.series.name) for each in self.ships) or 'none'
        raise FleetError(f'no ship is called {ship!r}; there are: {known}')

    def _document(self) -> Mapping[str, Any]:
        return {
            'ships': [trend.to_dict() for trend in self.ships],
            'skipped': [{'bag': bag, 'reason': reason} for bag, reason in self.skipped],
        }

    def _lines(self) -> Sequence[str]:
        lines = [
            f'{trend.series.name}: {line}' for trend in self.ships for line in words.lines(trend)
        ]
        lines += [f'{bag} could not be used: {reason}' for bag, reason in self.skipped]
        return (*(lines or ['No coastdown was given: no trend.']), *self.notes)

    def table(self) -> Table:
        """
        Show a line a ship, the hull to be cleaned first on top.
        """
        return words.ranking(self.ships)

    def plot(self, ax: Axes | None = None, *, ship: str | None = None) -> Axes:
        """
        Draw the added resistance of one ship against time, with its events.

        Parameters
        ----------
        ax
            To draw on; None: new axes.
        ship
            Its name; None: the first.

        Returns
        -------
        matplotlib.axes.Axes
            Percent over the clean hull.
        """
        from shipdrag_ros.trend.page import draw_added_resistance

        if ship is None and not self.ships:
            raise FleetError('there is no ship; give coastdowns of one')
        trend = self.ships[0] if ship is None else self.of(ship)
        if trend.curve is None:
            raise FleetError(f'{trend.series.name!r} has no trend: {" ".join(words.lines(trend))}')
        with drawing(ax) as axis:
            draw_added_resistance(axis, trend)
        return axis

    def report(self, path: str | PathLike[str]) -> None:
        """
        Write the page that `shipdrag trend --report` writes.

        Parameters
        ----------
        path
            HTML file; an existing one is replaced.
        """
        from shipdrag_ros.trend.page import fleet_text

        with writing(path) as page:
            page.write_text(fleet_text(self.ships, self.skipped), encoding='utf-8')

    def _title(self) -> str:
        if not self.ships:
            return 'no ship'
        first = self.ships[0]
        names = ', '.join(each.series.name for each in self.ships)
        return f'{names}; {first.series.name} now {words.percent(first.now)} % over the clean hull'

    def _columns(self) -> Mapping[str, Any]:
        """Return a line a coastdown."""
        points = [(trend.series.name, point) for trend in self.ships for point in trend.points]
        return {
            'ship': [name for name, _ in points],
            'time': np.array([point.time_ns for _, point in points], 'datetime64[ns]'),
            'added_resistance': [point.value for _, point in points],
            'sd': [point.sd for _, point in points],
            'sd_repeatable': [point.sd_repeatable for _, point in points],
            'used': [point.used for _, point in points],
            'reason': [point.reason for _, point in points],
            'bag': [point.bag for _, point in points],
        }


@says_it_in_python
def trends(
    source: str | PathLike[str] | Sequence[Resistance],
    *,
    events: Mapping[str, Sequence[tuple[str, str]]] | None = None,
) -> Trends:
    """
    Follow the added resistance of each ship over time, as `shipdrag trend` does.

    Parameters
    ----------
    source
        Folder that `shipdrag fleet` has written, or what `estimate` gave for each
        record; their ships are known by name.
    events
        What was done to a hull, by name of the ship: date (ISO 8601) and one of
        `cleaning docking propeller_polish coating`. A store has its own.

    Returns
    -------
    Trends
        Growth, steps known and found, costs and the date from which cleaning pays.

    Raises
    ------
    FleetError
        If the folder is no store, or an event cannot be read.

    Notes
    -----
    Source: docs/trend.md. Three runs of a ship are the least for a trend.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> ship = sd.Ship.example()
    >>> runs = [
    ...     sd.simulate(ship, {'fouling': added}, start=date, duration_s=900.0, lead_in_s=400.0)
    ...     for date, added in [('2026-01-01', 0.02), ('2026-04-01', 0.08), ('2026-07-01', 0.2)]
    ... ]
    >>> found = sd.trends([sd.estimate(record) for record in runs])
    >>> found.ships[0].growth_per_year.value > 0.0
    True
    """
    if isinstance(source, str | PathLike):
        if events is not None:
            raise FleetError('a store has its own events; write them into events.csv of the ship')
        listener = Notes()
        found, skipped = trends_of(listener, Path(source))
        return Trends(tuple(found), tuple(skipped), tuple(listener.lines))
    results = tuple(source) if isinstance(source, Iterable) else (source,)
    if not all(isinstance(each, Resistance) for each in results):
        raise FleetError(
            'expected the folder of `shipdrag fleet`, or a list of results of '
            'shipdrag_ros.estimate(...)'
        )
    ships = {_name(run.ship.name): run.ship for each in results for run in each.runs}
    rows = list(_rows(results))
    return Trends(tuple(fleet_trends(rows, ships, _events(events or {}))))


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

    ships, events = _ships(listener, store)
    rows = read_coastdowns(store).to_pylist()
    bags = read_bags(store).to_pylist()
    skipped = [(row['bag'], row['error']) for row in bags if row['error'] is not None]
    return fleet_trends(rows, ships, events), skipped


def _ships(
    listener: Listener, store: Path
) -> tuple[dict[str, Ship], dict[str, Sequence[HullEvent]]]:
    """Return ship files and events that the store keeps; say which cannot be used."""
    from shipdrag_ros.fleet.find import EVENTS_FILE
    from shipdrag_ros.fleet.store import read_events, ship_texts

    ships: dict[str, Ship] = {}
    events: dict[str, Sequence[HullEvent]] = {}
    for name, files in ship_texts(store).items():
        if SHIP_FILE in files:
            try:
                ships[name] = Ship.from_yaml(files[SHIP_FILE], subject=f'ship file of {name!r}')
            except ShipFileError as error:
                listener.log(f'{error}\nits prices are not used')
        events[name], problems = read_events(files.get(EVENTS_FILE, ''))
        listener.log(*(f'{name}: {problem}' for problem in problems))
    return ships, events


def _rows(results: Sequence[Resistance]) -> Iterator[dict[str, Any]]:
    """Yield the rows that a store would hold, without a diagnosis."""
    from shipdrag_ros.fleet.store import coastdown_row  # Parquet takes long to import

    for each in results:
        for coastdown in each.coastdowns:
            context = {
                'bag': coastdown.bag,
                'content_hash': '',
                'software_version': __version__,
                'water_temperature_c': None,
                'facts': [str(fact) for fact in coastdown.ship.facts],
                'ship': _name(coastdown.ship.name),
            }
            yield coastdown_row(coastdown.event, coastdown.ship, diagnosis=None, context=context)


def _events(given: Mapping[str, Sequence[tuple[str, str]]]) -> dict[str, Sequence[HullEvent]]:
    from shipdrag_ros.fleet.store import read_events

    found: dict[str, Sequence[HullEvent]] = {}
    for ship, events in given.items():
        read, problems = read_events('\n'.join(f'{date},{kind}' for date, kind in events))
        if problems:
            raise FleetError(f'events of {ship!r}: {"; ".join(problems)}')
        found[ship] = read
    return found


def _name(name: str) -> str:
    from shipdrag_ros.fleet.job import UNNAMED

    return name or UNNAMED
