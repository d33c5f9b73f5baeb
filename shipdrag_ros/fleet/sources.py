# SPDX-License-Identifier: Apache-2.0
"""Logs and tables that can be read without being told how."""

from __future__ import annotations

from pathlib import Path

from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.importing.formats.csv.columns import parse_input, parse_time
from shipdrag_ros.importing.formats.csv.importer import import_csv
from shipdrag_ros.importing.formats.nmea.importer import import_nmea
from shipdrag_ros.importing.table import Table

TIME = ('time', 'time_s', 't', 't_s')
COLUMNS = {
    'speed_through_water': 'speed_through_water',
    'speed_over_ground': 'speed_over_ground',
    'heading': 'heading',
    'shaft': 'shaft',
    'rudder': 'rudder',
    'depth': 'depth',
    'x,y': 'position',
    'latitude,longitude': 'position',
}
"""Columns of a table that need no `--map`, and their input."""


def import_log(source: Path, bag: Path) -> None:
    """
    Write a log of NMEA 0183 as a bag.

    Raises
    ------
    ImportDataError
        If nothing in it can be used.
    """
    import_nmea(source, bag)


def import_table(source: Path, bag: Path) -> None:
    """
    Write a table as a bag, if its columns have the names of the inputs, in SI units.

    Raises
    ------
    ImportDataError
        If they have not.
    """
    header = Table(source).header or ()
    time = next((name for name in TIME if name in header), None)
    inputs = []
    for columns, name in COLUMNS.items():
        if all(column in header for column in columns.split(',')):
            unit = ':deg' if columns.startswith('latitude') else ''
            inputs.append(parse_input(f'{name}={columns}{unit}'))
    if time is None or not inputs:
        raise ImportDataError(
            f'its columns are {", ".join(header) or "without names"}; without being told which is '
            f'which, a table needs {" or ".join(TIME)} and some of {"; ".join(COLUMNS)}, in SI '
            'units. Make a bag of it with `shipdrag import`'
        )
    import_csv(source, bag, inputs=inputs, time=parse_time(time))
