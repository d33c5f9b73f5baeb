# SPDX-License-Identifier: Apache-2.0
"""Where she will be: the forecast along her present course over ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.estimation import Window
from shipdrag_ros.forecast.result import Forecast
from shipdrag_ros.samples import SECOND_NS, Float64, Int64

_RECENT = 0.25  # of the window, whose positions show the course
_FEWEST = 5  # positions in it


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
        series = window.position
        since_s = (series.time_ns - forecast.made_ns) / SECOND_NS
        recent = since_s >= _RECENT * since_s[0] if len(series) else np.zeros(0, np.bool_)
        if not forecast.over_ground or np.count_nonzero(recent) < _FEWEST:
            return None
        rows = np.column_stack([np.ones(np.count_nonzero(recent)), since_s[recent]])
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
