# SPDX-License-Identifier: Apache-2.0
"""Files of other programs made bags, which everything else reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from shipdrag_ros.importing.bag import Rejected

BAGS = ('.mcap', '.zstd')


@dataclass(frozen=True)
class Told:
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
    """

    columns: Mapping[str, str | Sequence[str]] | None = None
    time: str | None = None
    rate_hz: float | None = None

    @property
    def maps(self) -> tuple[str, ...]:
        """The columns as `shipdrag import --map` takes them."""
        return tuple(
            f'{name}={columns if isinstance(columns, str) else ",".join(columns)}'
            for name, columns in (self.columns or {}).items()
        )


@dataclass(frozen=True)
class Imported:
    """
    A log that has become a bag.

    Attributes
    ----------
    bag
    dated
        Whether its times are dates; others count from the start of a test.
    notes
        What of it was not used, and why.
    """

    bag: Path
    dated: bool
    notes: tuple[str, ...]


def is_bag(path: Path) -> bool:
    """
    Tell whether a path is read as it is: a file of MCAP, or a folder.
    """
    return path.is_dir() or path.suffix in BAGS or path.name == 'metadata.yaml'


def import_log(source: Path, bag: Path, told: Told, attachments: Mapping[str, str]) -> Imported:
    """
    Make a bag of a log.

    Parameters
    ----------
    source
        NMEA 0183, also packed with gzip, or a table.
    bag
        MCAP file to make.
    told
        How the columns of a table are to be read.
    attachments
        Text by name, a ship file for instance.

    Raises
    ------
    ImportDataError
        If it cannot be read.
    """
    from shipdrag_ros.fleet.sources import import_table
    from shipdrag_ros.importing.formats.csv.columns import parse_input, parse_time
    from shipdrag_ros.importing.formats.csv.importer import import_csv
    from shipdrag_ros.importing.formats.nmea.importer import import_nmea

    if not told.columns and _is_nmea(source):
        of_log = import_nmea(source, bag, attachments=attachments)
        return Imported(bag, True, _notes(source, of_log.rejected))
    if not told.columns:
        import_table(source, bag)
        return Imported(bag, False, ())
    result = import_csv(
        source,
        bag,
        inputs=[parse_input(text) for text in told.maps],
        time=None if told.time is None else parse_time(told.time),
        rate_hz=told.rate_hz,
        attachments=attachments,
    )
    return Imported(bag, result.base_ns is None, _notes(source, result.rejected))


def _is_nmea(source: Path) -> bool:
    with source.open('rb') as file:
        head = file.read(2)
    return head[:1] in (b'$', b'!') or head == b'\x1f\x8b'


def _notes(source: Path, rejected: Mapping[str, Mapping[str, Rejected]]) -> tuple[str, ...]:
    return tuple(
        f'{source.name}: {name}: {each.count} rejected, {reason}: {", ".join(each.first)}'
        for name, reasons in rejected.items()
        for reason, each in reasons.items()
    )
