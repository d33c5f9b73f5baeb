# SPDX-License-Identifier: Apache-2.0
"""
When the engine stopped, from the speed alone.

A diagnosis moves the stop by little steps about where it was taken to be, which
serves for some seconds. An onset found without the shaft is off by more, so the
kink in the speed is found first.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from shipdrag_ros.samples import Float64

_BEFORE_S, _AFTER_S = 240.0, 240.0  # of the onset that was found
_LEAST = 20  # samples on either side
_FARTHEST_S = 90.0


def kink_s(time_s: Float64, speed_m_s: Float64, *, sd_m_s: float, run_down_s: float) -> float:
    """
    Return when the speed begins to fall, 0 where that cannot be told.

    Parameters
    ----------
    time_s, speed_m_s : (n,)
        Ascending; from the onset that was found.
    sd_m_s
        Of the noise; what is farther off counts less.
    run_down_s
        Of the thrust, which ends as exp(-t / run_down_s).

    Notes
    -----
    Steady until the stop, then v0 / (1 + c s), the fall of a ship under a
    resistance as the square of her speed, with s the time less what the thrust
    gives back of it. So simple a form is off by some 2 s.
    """
    near = (time_s > -_BEFORE_S) & (time_s < _AFTER_S)
    time, speed = time_s[near], speed_m_s[near]
    if min((time < 0.0).sum(), (time >= 0.0).sum()) < _LEAST:
        return 0.0
    top = float(np.median(speed[time <= 0.5 * time[0]]))
    last = float(np.median(speed[-_LEAST:]))
    if not 0.0 < last < top:
        return 0.0

    def left(unknown: Float64) -> Float64:
        steady, fall, stop_s = unknown
        since = np.maximum(time - stop_s, 0.0)
        if run_down_s > 0.0:
            since = since - run_down_s * (1.0 - np.exp(-since / run_down_s))
        result: Float64 = (speed - steady / (1.0 + np.maximum(fall, 0.0) * since)) / sd_m_s
        return result

    guess = np.array([top, (top / last - 1.0) / time[-1], 0.0])
    found = least_squares(left, guess, loss='soft_l1', x_scale=[top, guess[1], 10.0])
    stop_s = float(found.x[2])
    return stop_s if abs(stop_s) < _FARTHEST_S else 0.0
