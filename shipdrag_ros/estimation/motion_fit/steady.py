# SPDX-License-Identifier: Apache-2.0
"""
The steady record before the onset: where it begins, and its means.

Sensor noise is what differs from sample to sample; what stays is left in the
means, for `learning`.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from shipdrag_ros.samples import Float64, Int64

BIN_S = 30.0  # a steady record is condensed to its means over this
LEAST_S = 300.0  # of record from which a disturbance can be learnt
_BLOCK_S = 60.0
_UNSTEADY = 0.06  # of the speed: a block that differs by more ends the steady record
_OUTLIER = 5.0  # robust standard deviations
_MAD_TO_SD = 1.4826


def white_sd(value: Float64) -> float:
    """
    Return the standard deviation of white noise on a smooth signal.

    Parameters
    ----------
    value : (n,)
        In ascending time.

    Notes
    -----
    From second differences, whose outliers are clipped; 0 where n < 4.
    """
    second = np.diff(value, 2)
    if len(second) < 2:
        return 0.0
    typical = _MAD_TO_SD * float(np.median(np.abs(second)))
    if typical > 0.0:
        second = second[np.abs(second) < 4.0 * typical]
    return float(np.sqrt(np.mean(second**2) / 6.0))


def steady_since(time_s: Float64, speed: Float64, heading_s: Float64, heading: Float64) -> float:
    """
    Return the time from which a record has been steady to its end.

    Parameters
    ----------
    time_s, speed : (n,)
        Ascending.
    heading_s, heading : (m,)
        Yaw [rad]; may be empty.
    """
    if len(time_s) == 0:
        return math.inf
    end = float(time_s[-1])
    level = float(np.median(speed[time_s > end - 2.0 * _BLOCK_S]))
    edges = np.arange(end, time_s[0] - _BLOCK_S, -_BLOCK_S)
    course: float | None = None
    for late, early in pairwise(edges):
        block = speed[(time_s > early) & (time_s <= late)]
        if len(block) and abs(float(np.median(block)) - level) > _UNSTEADY * level:
            return float(late)
        yaw = heading[(heading_s > early) & (heading_s <= late)]
        if len(yaw):
            mean = math.atan2(float(np.sin(yaw).mean()), float(np.cos(yaw).mean()))
            course = mean if course is None else course
            if abs(math.remainder(mean - course, 2.0 * math.pi)) > 0.15:
                return float(late)
    return float(time_s[0])


def condense(time_s: Float64, value: Float64) -> tuple[Float64, Float64, Int64]:
    """
    Return means over `BIN_S` of a record that is steady or moves evenly.

    Parameters
    ----------
    time_s, value : (n,)
        n >= 1.

    Returns
    -------
    time_s, value, count : (b,)
    """
    # outliers are told from what is near in time: the record may drift
    away = value - np.interp(time_s, *_medians(time_s, value))
    typical = _MAD_TO_SD * float(np.median(np.abs(away)))
    keep = np.abs(away) <= _OUTLIER * typical
    time_s, value = time_s[keep], value[keep]
    number = np.floor((time_s - time_s[0]) / BIN_S)
    first = np.concatenate([[0], np.flatnonzero(np.diff(number)) + 1])
    count = np.diff(np.concatenate([first, [len(time_s)]]))
    return (
        np.add.reduceat(time_s, first) / count,
        np.add.reduceat(value, first) / count,
        count,
    )


def _medians(time_s: Float64, value: Float64) -> tuple[Float64, Float64]:
    number = np.floor((time_s - time_s[0]) / (2.0 * _BLOCK_S))
    first = np.concatenate([[0], np.flatnonzero(np.diff(number)) + 1, [len(time_s)]])
    parts = [slice(a, b) for a, b in pairwise(first)]
    return (
        np.array([np.median(time_s[part]) for part in parts]),
        np.array([np.median(value[part]) for part in parts]),
    )
