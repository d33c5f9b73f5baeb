# SPDX-License-Identifier: Apache-2.0
"""What every format shares: the bag that is made, and what is left out of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from shipdrag_ros.bags.writer import BagWriter
from shipdrag_ros.samples import SECOND_NS

LIMIT_NS = 2**31 * SECOND_NS
"""Of the stamp of a message."""

BATCH_SAMPLES = 4096
"""Written at a time."""

ATTACHMENT = 'import.yaml'
"""Where a bag says what it was made from."""

_FIRST_LINES = 3
_SHOWN = 40  # characters of a cell


@dataclass
class Rejected:
    """Cells or sentences rejected for one reason: how many, and the first of them."""

    count: int = 0
    first: list[str] = field(default_factory=list)

    def add(self, line: int, text: str) -> None:
        """
        Count one more.
        """
        self.count += 1
        if len(self.first) < _FIRST_LINES:
            shown = text if len(text) <= _SHOWN else f'{text[:_SHOWN]}...'
            self.first.append(f'line {line}: {shown!r}')


@contextmanager
def new_bag(out: Path, attachments: Mapping[str, str] | None) -> Iterator[BagWriter]:
    """
    Open a bag to import into; where that fails, none is left.

    Parameters
    ----------
    out
        MCAP file to make.
    attachments
        Text by name, a ship file for instance.

    Raises
    ------
    BagError
        If the bag cannot be made.
    """
    writer = BagWriter(out)
    try:
        with writer:
            for name, text in (attachments or {}).items():
                writer.attach(name, text)
            yield writer
    except BaseException:
        out.unlink(missing_ok=True)
        raise
