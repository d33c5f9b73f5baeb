# SPDX-License-Identifier: Apache-2.0
"""Files of other programs made bags, which everything else reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

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
        In any format of `importing.formats`.
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
    from shipdrag_ros.importing.formats.csv.columns import parse_time
    from shipdrag_ros.importing.reading import import_file

    options: dict[str, object] = {}
    if told.maps:
        options['map'] = told.maps
    if told.time is not None:
        options['time'] = parse_time(told.time)
    if told.rate_hz is not None:
        options['rate'] = told.rate_hz
    found = import_file(source, bag, options=options, attachments=attachments)
    notes = [*found.result.summary(source)[1:], *found.result.details()]
    dated = getattr(found.result, 'base_ns', None) is None
    return Imported(bag, dated, tuple(f'{source.name}: {note}' for note in notes))
