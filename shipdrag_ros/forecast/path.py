# SPDX-License-Identifier: Apache-2.0
"""Where she will be: the forecast along her present course over ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.window import Series
from shipdrag_ros.forecast.result import Forecast
from shipdrag_ros.samples import SECOND_NS, Float64, Int64

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
