# SPDX-License-Identifier: Apache-2.0
"""What is foretold of a glide."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipdrag_ros.display import short_repr
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.window import Series
from shipdrag_ros.samples import SECOND_NS, Float64, Int64

Z = 1.6448536269514722
"""Standard deviations on either side of the median that hold 90 %."""

NO_WAY = 'she makes no way ahead, there is no glide to foretell'
"""Why a forecast has no targets."""


class Band(NamedTuple):
    """Median of a time [s] or distance [m], and the bounds that hold 90 %."""

    median: float
    low: float
    high: float


class Milestone(NamedTuple):
    """When she has a speed, and how far on, from when it was foretold."""

    speed_m_s: float
    time_s: Band
    distance_m: Band


@dataclass(frozen=True)
class Forecast:
    """
    The rest of a glide, by speed.

    Attributes
    ----------
    made_ns
        Stamp of the last reading that it rests on [ns].
    stop_m_s
        Speed at the stop.
    speed_m_s : (n,)
        Descending, from the present speed on.
    time_s, distance_m : (n, 3)
        From `made_ns` on: median, low, high of when she has that speed and where.
    speed_sd_m_s
        Of the present speed.
    current_m_s
        Added to the speed for a way over ground.
    drift_sd_m : (n,)
        Standard deviation of the way that the water makes until then.
    targets_m_s
        Speeds that are spoken of, descending.
    over_ground
        Whether distances are over ground; else through water.
    """

    __repr__ = short_repr

    made_ns: int
    stop_m_s: float
    speed_m_s: Float64
    time_s: Float64
    distance_m: Float64
    speed_sd_m_s: float
    current_m_s: float
    drift_sd_m: Float64
    targets_m_s: tuple[float, ...]
    over_ground: bool

    def reaches(self, speed_m_s: float) -> Milestone:
        """
        Return when and where she has a speed, between the present and the last one.
        """
        at = self.speed_m_s[::-1]

        def band(values: Float64) -> Band:
            return Band(*(float(np.interp(speed_m_s, at, each[::-1])) for each in values.T))

        return Milestone(speed_m_s, band(self.time_s), band(self.distance_m))

    @property
    def milestones(self) -> tuple[Milestone, ...]:
        """Of each of the targets."""
        return tuple(self.reaches(each) for each in self.targets_m_s)

    def in_time(self, time_s: Float64 | None = None, *, over_ground: bool = False) -> Float64:
        """
        Return the same by time.

        Parameters
        ----------
        time_s : (m,)
            From `made_ns` on, ascending from 0; None: those at which she has each speed.
        over_ground
            Whether the way is over ground, along her course; else it is through water.

        Returns
        -------
        (m, 7)
            Time, speed, its low and high, distance, its low and high. Where she is slower than
            the last speed, that stands for her speed.

        Notes
        -----
        At a time, a glide that has each speed earlier is slower; her way is the integral.
        """
        time = self.time_s[:, 0] if time_s is None else time_s
        spread = np.array([0.0, -Z, Z])[:, None] * self.speed_sd_m_s
        columns = (self.time_s[:, 0], self.time_s[:, 1], self.time_s[:, 2])
        speed = np.stack([np.interp(time, each, self.speed_m_s) for each in columns])
        speed[:, 0] += spread[:, 0]
        steps = np.diff(time) * 0.5 * (speed[:, 1:] + speed[:, :-1])
        way = np.concatenate([np.zeros((3, 1)), np.cumsum(steps, axis=1)], axis=1)
        if over_ground:
            way += self.current_m_s * time
            beside = Z * np.interp(time, self.time_s[:, 0], self.drift_sd_m)
            way[1] = way[0] - np.hypot(way[0] - way[1], beside)
            way[2] = way[0] + np.hypot(way[2] - way[0], beside)
        return np.column_stack([time, *speed, *way])


_RECENT = 0.25  # of the window, whose positions show the course
_FEWEST = 5  # positions in it


def places(window: Window) -> Series | None:
    """
    Return the positions of the first instrument that still shows the course; None where none does.
    """
    recent = window.part(_recent_ns(window), window.end_ns).each('position')
    each = zip(window.each('position'), recent, strict=True)
    return next((whole for whole, part in each if len(part) >= _FEWEST), None)


def _recent_ns(window: Window) -> int:
    return window.end_ns - round(_RECENT * (window.end_ns - window.start_ns))


@dataclass(frozen=True)
class PathAhead:
    """
    Positions to come.

    Attributes
    ----------
    time_ns : (n,)
    position_m : (n, 2)
        In the plane of the window.
    course_rad
        Over ground, from the first axis of the plane to the second.
    """

    time_ns: Int64
    position_m: Float64
    course_rad: float

    @classmethod
    def of(cls, window: Window, forecast: Forecast) -> PathAhead | None:
        """
        Return the positions to come; None where the window shows no course.
        """
        series = places(window)
        if not forecast.over_ground or series is None:
            return None
        recent = series.time_ns >= _recent_ns(window)
        since_s = (series.time_ns[recent] - forecast.made_ns) / SECOND_NS
        rows = np.column_stack([np.ones(len(since_s)), since_s])
        (here, speed), *_ = np.linalg.lstsq(rows, series.value[recent], rcond=None)
        length = float(np.hypot(*speed))
        if length == 0.0:
            return None
        ahead = forecast.in_time(over_ground=True)
        return cls(
            forecast.made_ns + np.round(ahead[:, 0] * SECOND_NS).astype(np.int64),
            here + ahead[:, 4:5] * speed / length,
            float(np.arctan2(speed[1], speed[0])),
        )
