# SPDX-License-Identifier: Apache-2.0
"""What is foretold of a glide."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipdrag_ros.display import short_repr
from shipdrag_ros.samples import Float64

Z = 1.6448536269514722
"""Standard deviations on either side of the median that hold 90 %."""


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
    way_sd_m : (n,)
        Standard deviation of the distance at the median time of each speed.
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
    way_sd_m: Float64
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

    def in_time(self) -> Float64:
        """
        Return the same by time (n, 7).

        Returns
        -------
        (n, 7)
            Time, speed, its low and high, distance, its low and high. In a band that reaches
            beyond the last speed, that speed is its low end.
        """
        time = self.time_s[:, 0]
        spread = Z * self.speed_sd_m_s
        # at a time, a glide that loses speed earlier is slower
        low = np.interp(time, self.time_s[:, 1], self.speed_m_s)
        high = np.interp(time, self.time_s[:, 2], self.speed_m_s)
        low[0], high[0] = self.speed_m_s[0] - spread, self.speed_m_s[0] + spread
        way = self.distance_m[:, 0]
        half = Z * self.way_sd_m
        return np.column_stack(
            [
                time,
                self.speed_m_s,
                np.minimum(low, self.speed_m_s),
                np.maximum(high, self.speed_m_s),
                way,
                np.maximum(way - half, 0.0),
                way + half,
            ]
        )
