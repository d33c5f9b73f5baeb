# SPDX-License-Identifier: Apache-2.0
"""What every format shares: the bag that is made, and what is left out of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from shipdrag_ros.bags.writer import BagWriter
from shipdrag_ros.samples import SECOND_NS, Block, Channel

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


@dataclass(frozen=True)
class Understood:
    """
    What an input was taken from.

    Attributes
    ----------
    input
    source
        Column, sentence or message.
    unit
        In which it stands there; '' where the format fixes it.
    first
        First value, in the unit of `Channel`.
    geodetic
        Whether it is a latitude and a longitude.
    """

    input: str
    source: str
    unit: str
    first: tuple[float, ...]
    geodetic: bool = False

    def __str__(self) -> str:
        unit = f' [{self.unit}]' if self.unit else ''
        values = ', '.join(f'{value:.6g}' for value in self.first)
        si = 'deg' if self.geodetic else _SI[self.input]
        return f'{self.input} <- {self.source}{unit}, first {values} {si}'


_SI = {
    'speed_through_water': 'm/s',
    'speed_over_ground': 'm/s',
    'position': 'm',
    'heading': 'rad (yaw)',
    'shaft': 'rad/s (pitch: ratio or rad)',
    'rudder': 'rad',
    'wind_apparent': 'm/s (forward, to port)',
    'depth': 'm',
}
_TWO_VALUES = (Channel.POSITION, Channel.POSITION_GEODETIC, Channel.WIND_APPARENT)


class ImportBag(BagWriter):
    """
    The bag that a log becomes.

    Attributes
    ----------
    first
        First value of each channel, in its unit.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.first: dict[Channel, tuple[float, ...]] = {}

    def write_samples(self, block: Block) -> None:
        """
        Write samples, and keep the first of each channel.
        """
        for number, place in zip(*np.unique(block.channel, return_index=True), strict=True):
            channel = Channel(number)
            if channel not in self.first:
                values = block.value[place, : 2 if channel in _TWO_VALUES else 1]
                self.first[channel] = tuple(values.tolist())
        super().write_samples(block)


@contextmanager
def new_bag(out: Path, attachments: Mapping[str, str] | None) -> Iterator[ImportBag]:
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
    writer = ImportBag(out)
    try:
        with writer:
            for name, text in (attachments or {}).items():
                writer.attach(name, text)
            yield writer
    except BaseException:
        out.unlink(missing_ok=True)
        raise
