# SPDX-License-Identifier: Apache-2.0
"""
The node's outputs read back from their bytes, and the coastdowns that ended, as they say.

Nothing is estimated anew: a bag that a node recorded holds its curve and its event.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shipdrag_ros.bags import open_runs
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.estimation.force import usual_within
from shipdrag_ros.messages import EventKind, EventNote, MalformedMessage, read_event, topics, types
from shipdrag_ros.messages.publishing import CURVE_FIELDS, FORECAST_FIELDS
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship


@dataclass(frozen=True)
class Figure:
    """A figure with its standard deviation, at a stamp [ns]."""

    stamp_ns: int
    value: float
    sigma: float


@dataclass(frozen=True)
class Curve:
    """
    r(v) with its standard deviation, speeds ascending.

    Attributes
    ----------
    stamp_ns
    speed_m_s, resistance_m_s2, sigma_m_s2 : (n,)
    """

    stamp_ns: int
    speed_m_s: Float64
    resistance_m_s2: Float64
    sigma_m_s2: Float64

    def at(self, speed_m_s: float) -> tuple[float, float]:
        """
        Return r and its standard deviation [m/s^2] at a speed inside the curve.
        """
        r = np.interp(speed_m_s, self.speed_m_s, self.resistance_m_s2)
        return float(r), float(np.interp(speed_m_s, self.speed_m_s, self.sigma_m_s2))

    def usual_m_s(self, ship: Ship | None) -> float:
        """
        Return the speed at which figures are stated; where the curve ends above it, its lowest.
        """
        span = np.array([[self.speed_m_s[0], self.speed_m_s[-1]]])
        return max(usual_within(span, ship), float(self.speed_m_s[0]))

    def band(self, ship: Ship | None) -> float:
        """
        Return two standard deviations over r, at the speed at which figures are stated.
        """
        r, sigma = self.at(self.usual_m_s(ship))
        return 2.0 * sigma / r if r > 0.0 else math.inf


def read_figure(topic: topics.OutputTopic, payload: bytes) -> Figure:
    """
    Read `~/speed` [m/s] or `~/resistance` [m/s^2].

    Raises
    ------
    MalformedMessage
        If it is not within 64 bits, from 0 on.
    """
    message = types.deserialize(topic.type, payload)
    held = message.twist if topic is topics.SPEED else message.accel
    vector = held.twist if topic is topics.SPEED else held.accel
    sigma = math.sqrt(max(float(held.covariance[0]), 0.0))
    return Figure(types.stamp_ns(message), float(vector.linear.x), sigma)


def read_curve(payload: bytes) -> Curve | None:
    """
    Read `~/resistance_curve`; None where it has too few points to be drawn.

    Raises
    ------
    MalformedMessage
        If it is not within 64 bits, from 0 on.
    """
    stamp_ns, points = _points(topics.RESISTANCE_CURVE, CURVE_FIELDS, payload)
    if len(points) < 2:
        return None
    return Curve(stamp_ns, points[:, 0], points[:, 1], points[:, 2])


@dataclass(frozen=True)
class ComingGlide:
    """
    The rest of the glide.

    Attributes
    ----------
    stamp_ns
    points : (n, 7)
        Time, speed, its low and high, distance, its low and high; times ascending from 0.
    """

    stamp_ns: int
    points: Float64

    def time_s(self, speed_m_s: float) -> tuple[float | None, float | None, float | None]:
        """
        Return when she has a speed, and the earliest and latest of that; None where not said.
        """

        def passed(column: int) -> float | None:
            below = np.flatnonzero(self.points[:, column] <= speed_m_s)
            if not len(below):
                return None
            i = max(int(below[0]), 1)
            part = slice(i - 1, i + 1)
            return float(np.interp(-speed_m_s, -self.points[part, column], self.points[part, 0]))

        return passed(1), passed(2), passed(3)

    def way_m(self, time_s: float) -> float:
        """
        Return how far on she is then.
        """
        return float(np.interp(time_s, self.points[:, 0], self.points[:, 4]))


def read_forecast(payload: bytes) -> ComingGlide | None:
    """
    Read `~/forecast`; None where it is withdrawn.

    Raises
    ------
    MalformedMessage
        If it is not within 64 bits, from 0 on.
    """
    stamp_ns, points = _points(topics.FORECAST, FORECAST_FIELDS, payload)
    return ComingGlide(stamp_ns, points) if len(points) >= 2 else None


@dataclass(frozen=True)
class ComingPath:
    """
    The positions to come.

    Attributes
    ----------
    stamp_ns
    time_s : (n,)
        From the stamp on.
    place_m : (n, 2)
        In the plane of the positions since the stop, two of them at least.
    """

    stamp_ns: int
    time_s: Float64
    place_m: Float64


def read_path(payload: bytes) -> ComingPath | None:
    """
    Read `~/forecast_path`; None where it is withdrawn, or she has no positions.

    Raises
    ------
    MalformedMessage
        If it is not within 64 bits, from 0 on.
    """
    message = types.deserialize(topics.FORECAST_PATH.type, payload)
    stamp_ns = types.stamp_ns(message)
    places = [
        ((types.stamp_ns(each) - stamp_ns) * 1e-9, each.pose.position.x, each.pose.position.y)
        for each in message.poses
    ]
    rows = np.array(places, np.float64).reshape(-1, 3)
    rows = rows[np.isfinite(rows).all(axis=1)]
    return ComingPath(stamp_ns, rows[:, 0], rows[:, 1:]) if len(rows) >= 2 else None


def _points(
    topic: topics.OutputTopic, names: tuple[str, ...], payload: bytes
) -> tuple[int, Float64]:
    message = types.deserialize(topic.type, payload)
    given = tuple(field.name for field in message.fields)
    if given != names or message.is_bigendian:
        raise MalformedMessage(f'fields {", ".join(given)}, expected {", ".join(names)}')
    try:
        points = np.frombuffer(message.data.tobytes(), '<f8').reshape(-1, len(names))
    except ValueError as error:
        raise MalformedMessage(f'not whole points: {error}') from error
    return types.stamp_ns(message), points[np.isfinite(points).all(axis=1)]


_OPPOSITE_DEG = 30.0  # by which a reciprocal heading may be off
ONE_DAY_S = 12 * 3600.0  # in which two runs are a pair


def time_ns(said: str | int) -> int:
    """
    Read a time that a peer sends [ns].

    Raises
    ------
    ValueError
        If it is not within 64 bits, from 0 on.
    """
    found = int(said)
    if not 0 <= found < 2**63:
        raise ValueError('no time since the epoch')
    return found


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
        if yaw is not None and not math.isfinite(float(yaw)):
            raise ValueError(f'heading_rad is {yaw}')
        own = curve if curve is not None and 'estimator' in values else None
        _, _, why_not = note.text.partition('no estimate: ')
        return cls(
            bag,
            time_ns(values.get('start_ns', note.stamp_ns)),
            time_ns(values.get('end_ns', note.stamp_ns)),
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
        near = abs(self.start_ns - other.start_ns) * 1e-9 <= ONE_DAY_S
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
                if name == topics.RESISTANCE_CURVE.name:
                    curve = read_curve(message.payload)
                elif name == topics.EVENTS.name:
                    note = read_event(message.payload)
                    if note.kind is EventKind.COASTDOWN:
                        found = True
                        yield PastRun.of(note, curve, bag=path.name)
            except (MalformedMessage, ValueError):
                continue
    if not found:
        yield f'{path.name}: no coastdown was recorded in it'
