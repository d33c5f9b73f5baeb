# SPDX-License-Identifier: Apache-2.0
"""A coastdown to be diagnosed, and when it began by the speed alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from shipdrag_ros.estimation.window import Window
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Fact, Ship

_STOP_BEFORE_S, _STOP_AFTER_S = 240.0, 240.0  # of the onset that was found
_STOP_LEAST = 20  # samples on either side
_FARTHEST_S = 90.0  # three sd of an onset found from the speed alone
_FIRM = 6.0  # 1 / sd of the run-down's logarithm, and of the power about that of a hull, 1
_LEAST_POWER = 0.05  # as good as an exponential, which 0 is


@dataclass(frozen=True)
class CoastRun:
    """
    A coastdown to be diagnosed.

    Attributes
    ----------
    name
        For the user.
    window
        With the steady record before it.
    facts
        That a log book knows of this run.
    ship
        The ship as she was in this run; None: as in all.
    """

    name: str
    window: Window
    facts: tuple[Fact, ...] = ()
    ship: Ship | None = None


def stop_time_s(time_s: Float64, speed_m_s: Float64, *, sd_m_s: float, run_down_s: float) -> float:
    """
    Return when the engine stopped, from the speed alone; 0 where that cannot be seen.

    A diagnosis moves the stop by little steps about where it was taken to be, which
    serves for some seconds; an onset found without the shaft is off by more.

    Parameters
    ----------
    time_s, speed_m_s : (n,)
        Ascending; from the onset that was found.
    sd_m_s
        Of the noise; what is farther off counts less.
    run_down_s
        Of the thrust, which ends as exp(-t / run_down_s).

    Returns
    -------
    float
        From the onset that was found [s].

    Notes
    -----
    Steady until the stop, then the fall of a ship under a resistance as a power of her speed,
    v0 (1 + p c s)^(-1 / p), with s the time less what the thrust gives back of it. The thrust
    may run down faster or slower than stated; what is returned stands for a stop after which
    it runs down as stated, and is gone as late.
    """
    near = (time_s > -_STOP_BEFORE_S) & (time_s < _STOP_AFTER_S)
    time, speed = time_s[near], speed_m_s[near]
    if min((time < 0.0).sum(), (time >= 0.0).sum()) < _STOP_LEAST:
        return 0.0
    top = float(np.median(speed[time <= 0.5 * time[0]]))
    last = float(np.median(speed[-_STOP_LEAST:]))
    if not 0.0 < last < top:
        return 0.0

    def left(unknown: Float64) -> Float64:
        steady, fall, power, slower, stop_s = unknown
        since = np.maximum(time - stop_s, 0.0)
        if run_down_s > 0.0:
            down_s = run_down_s * math.exp(slower)
            since = since - down_s * (1.0 - np.exp(-since / down_s))
        power = max(power, _LEAST_POWER)
        law = (1.0 + power * max(fall, 0.0) * since) ** (-1.0 / power)
        # rows besides, of the priors
        return np.append((speed - steady * law) / sd_m_s, np.array([slower, power - 1.0]) * _FIRM)

    guess = np.array([top, (top / last - 1.0) / time[-1], 1.0, 0.0, 0.0])
    scale = [top, guess[1], 0.5, 0.5, 10.0]
    found = least_squares(left, guess, loss='soft_l1', x_scale=scale)
    stop_s = float(found.x[4]) + run_down_s * (math.exp(float(found.x[3])) - 1.0)
    return stop_s if abs(stop_s) < _FARTHEST_S else 0.0
