# SPDX-License-Identifier: Apache-2.0
"""
What a listener hears of a node: readings, outputs, health, the ship.

The same whether it comes over topics or from a bag that is played.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from shipdrag_ros.display import printable
from shipdrag_ros.messages import types
from shipdrag_ros.samples import Block

DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
OK, WARN, ERROR, STALE = range(4)
OF_CONDITIONS = 'they are'
"""Key of the conditions that the figures of an estimate are of."""
READY_S = 600.0  # of steady sailing from which the noise is known well enough


@dataclass(frozen=True)
class Samples:
    """Readings of the inputs, in order of arrival."""

    block: Block


@dataclass(frozen=True)
class NodeMessage:
    """A message of the node, by the name of its topic below the node."""

    name: str
    payload: bytes


@dataclass(frozen=True)
class ShipFile:
    """The ship file that the node uses."""

    text: str


@dataclass(frozen=True)
class Status:
    """
    One part of a node's health.

    Attributes
    ----------
    node
        As the status names it.
    part
        `state`, `input heading`, `recording`, ...
    level
        One of `OK`, `WARN`, `ERROR`, `STALE`.
    message
    values
        Texts by key, the unit in the key.
    """

    node: str
    part: str
    level: int
    message: str
    values: Mapping[str, str]

    @classmethod
    def of(cls, part: str, level: int, message: str, values: Mapping[str, object]) -> Status:
        """
        Make a status of values of any kind.
        """
        return cls('', part, int(level), message, {k: _text(v) for k, v in values.items()})

    @property
    def input(self) -> str:
        """Name of the input that it is of; '' of none."""
        return self.part.removeprefix('input ') if self.part.startswith('input ') else ''

    def number(self, key: str) -> float | None:
        """
        Return a finite figure, None where there is none; the unit need not be given.
        """
        for name, text in self.values.items():
            if name == key or name.partition(' [')[0] == key:
                try:
                    value = float(text)
                except ValueError:
                    return None
                return value if math.isfinite(value) else None
        return None


@dataclass(frozen=True)
class Health:
    """All that a node says of itself at one time."""

    statuses: tuple[Status, ...]

    def of(self, part: str) -> Status | None:
        """
        Return the status of a part.
        """
        return next((status for status in self.statuses if status.part == part), None)

    @property
    def lead(self) -> tuple[float, float] | None:
        """How long the ship has been steady, and from when the record is ready [s]."""
        state = self.of('state')
        steady_s = None if state is None else state.number('steady lead')
        most_s = None if state is None else state.number('steady lead used at most')
        if steady_s is None or most_s is None:
            return None
        return steady_s, min(READY_S, most_s)

    @property
    def inputs(self) -> tuple[Status, ...]:
        """Those of the inputs."""
        return tuple(status for status in self.statuses if status.input)


Heard = Samples | NodeMessage | ShipFile | Health


def read_health(payload: bytes) -> list[Health]:
    """
    Decode a message of /diagnostics: the health of each node of this package in it.

    Raises
    ------
    MalformedMessage
        If it is no DiagnosticArray.
    """
    return health_of(types.deserialize(DIAGNOSTICS, payload).status)


def health_of(statuses: Iterable[Any]) -> list[Health]:
    """
    Sort statuses by node; those of others, which have no life cycle and monitor, are left out.
    """
    sorted_by_node: dict[str, list[Status]] = {}
    for status in statuses:
        status = _read(status)
        sorted_by_node.setdefault(status.node, []).append(status)
    return [
        Health(tuple(found))
        for found in sorted_by_node.values()
        if any({'lifecycle', 'monitor'} <= status.values.keys() for status in found)
    ]


def _text(value: object) -> str:
    if value is None:
        return 'none'
    return f'{value:.6g}' if isinstance(value, float) else str(value)


def _read(status: Any) -> Status:
    node, _, part = printable(str(status.name)).rpartition(': ')
    level = status.level  # a byte of rclpy, a number elsewhere
    return Status(
        node=node,
        part=part,
        level=level[0] if isinstance(level, bytes) else int(level),
        message=printable(str(status.message)),
        values={printable(str(item.key)): printable(str(item.value)) for item in status.values},
    )
