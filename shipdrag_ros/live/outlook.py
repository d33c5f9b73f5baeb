# SPDX-License-Identifier: Apache-2.0
"""How much longer a coastdown must run until its band is as narrow as wanted."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

LONGEST_S = 3600.0  # a time to go beyond it is not shown
_LEAST_POINTS = 4
_LEAST_SLOPE = 0.2  # of log band over log time; flatter is no promise


def to_go_s(bands: Sequence[tuple[float, float]], goal: float) -> float | None:
    """
    Foresee when the band is narrow enough, by the power law of its latest half.

    Parameters
    ----------
    bands
        Time since the stop [s], ascending, and two standard deviations over r then.
    goal
        The same, as wanted.

    Returns
    -------
    float or None
        Seconds from the last time on, 0 where it is there; None where it cannot be foreseen.
    """
    if not bands:
        return None
    last_s, last = bands[-1]
    if last <= goal:
        return 0.0
    recent = [
        (math.log(t), math.log(band))
        for t, band in bands
        if t >= 0.5 * last_s and t > 0.0 and 0.0 < band < math.inf
    ]
    if len(recent) < _LEAST_POINTS:
        return None
    x, y = np.array(recent).T
    slope = float(np.polyfit(x, y, 1)[0])
    if slope > -_LEAST_SLOPE:
        return None
    left = last_s * ((last / goal) ** (-1.0 / slope) - 1.0)
    return left if left <= LONGEST_S else None
