# SPDX-License-Identifier: Apache-2.0
"""
Coastdowns of this ship that have ended: heard, or recorded by a node in a folder of bags.

Nothing is estimated anew: a bag that a node recorded holds its curve and its event.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from shipdrag_ros.bags import open_runs
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.live.outputs import Curve, read_curve
from shipdrag_ros.messages import EventKind, EventNote, MalformedMessage, read_event
from shipdrag_ros.messages.topics import EVENTS, RESISTANCE_CURVE

_OPPOSITE_DEG = 30.0  # by which a reciprocal heading may be off
_ONE_DAY_S = 12 * 3600.0  # in which two runs are a pair


@dataclass(frozen=True)
class PastRun:
    """
    A coastdown that has ended.

    Attributes
    ----------
    bag
        Where it is recorded; '' where it was heard.
    start_ns, end_ns
    ended_by
    compass_deg
        Heading at the stop, None where none was measured.
    curve
        r(v), None without an estimate.
    why_not
        Why there is none.
    """

    bag: str
    start_ns: int
    end_ns: int
    ended_by: str
    compass_deg: float | None
    curve: Curve | None
    why_not: str = ''

    @classmethod
    def of(cls, note: EventNote, curve: Curve | None, *, bag: str = '') -> PastRun:
        """
        Take the event of its end, and the curve that was published with it.
        """
        values = note.values
        yaw = values.get('heading_rad')
        own = curve if curve is not None and 'estimator' in values else None
        _, _, why_not = note.text.partition('no estimate: ')
        return cls(
            bag,
            int(values.get('start_ns', note.stamp_ns)),
            int(values.get('end_ns', note.stamp_ns)),
            values.get('ended_by', 'end'),
            None if yaw is None else (90.0 - math.degrees(float(yaw))) % 360.0,
            own,
            why_not,
        )

    @property
    def reciprocal_deg(self) -> float | None:
        """The heading of the run that makes a pair with it."""
        return None if self.compass_deg is None else (self.compass_deg + 180.0) % 360.0

    def is_paired_with(self, other: PastRun) -> bool:
        """
        Whether both have a curve, on opposite headings, on one day.
        """
        if self.compass_deg is None or other.compass_deg is None:
            return False
        if self.curve is None or other.curve is None:
            return False
        apart = math.remainder(self.compass_deg - other.compass_deg - 180.0, 360.0)
        near = abs(self.start_ns - other.start_ns) * 1e-9 <= _ONE_DAY_S
        return abs(apart) <= _OPPOSITE_DEG and near


def recorded_runs(folder: Path) -> Iterator[PastRun | str]:
    """
    Yield the coastdowns that nodes recorded in the bags of a folder, and why a bag gave none.

    A folder that is not there is noted: the node that makes it may start later.

    Raises
    ------
    ShipdragError
        If it is no folder.
    """
    if not folder.exists():
        yield f'{folder}: there is no such folder so far, so no earlier coastdowns are shown'
        return
    if not folder.is_dir():
        raise ShipdragError(f'{str(folder)!r} is no folder; give one that holds bags')
    paths = sorted(folder.rglob('*.mcap'), key=lambda path: (path.stat().st_mtime, path))
    for path in paths:
        try:
            yield from _of_bag(path)
        except (ShipdragError, OSError) as error:
            yield f'{path.name}: {error}'


def _of_bag(path: Path) -> Iterator[PastRun | str]:
    found = False
    for run in open_runs([path]):
        curve: Curve | None = None
        for message in run.outputs():
            name = message.topic.rpartition('/')[2]
            try:
                if name == RESISTANCE_CURVE.name:
                    curve = read_curve(message.payload)
                elif name == EVENTS.name:
                    note = read_event(message.payload)
                    if note.kind is EventKind.COASTDOWN:
                        found = True
                        yield PastRun.of(note, curve, bag=path.name)
            except (MalformedMessage, ValueError):
                continue
    if not found:
        yield f'{path.name}: no coastdown was recorded in it'
