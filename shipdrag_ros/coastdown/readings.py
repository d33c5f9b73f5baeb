# SPDX-License-Identifier: Apache-2.0
"""The speed of a window as a series of readings without spikes, and its means."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.inference.rows import MAD_TO_SD
from shipdrag_ros.samples import Float64

_BINS = 48  # of a stretch; a change in it is found to within one of them
LEAST_READINGS = 8  # readings of an input that shows the speed
_HAMPEL = 5.0  # robust standard deviations from the median of 7 neighbours
_NEIGHBOURS = 3


def clean_readings(time_s: Float64, value: Float64) -> tuple[Float64, Float64]:
    """
    Leave out spikes: readings far from the median of their neighbours.

    Parameters
    ----------
    time_s, value : (n,)

    Returns
    -------
    time_s, value
        What is left.
    """
    n = len(value)
    if n < 2 * _NEIGHBOURS + 1:
        return time_s, value
    # at the ends the median of the first and last neighbours there are
    at = np.clip(np.arange(n), _NEIGHBOURS, n - 1 - _NEIGHBOURS)
    near = value[at[:, None] + np.arange(-_NEIGHBOURS, _NEIGHBOURS + 1)]
    away = np.abs(value - np.median(near, axis=1))
    scale = MAD_TO_SD * float(np.median(away))
    # a fall over the ends of the neighbourhood is none of noise
    fall = np.ptp(np.sort(near, axis=1)[:, 1:-1], axis=1)
    keep = away <= _HAMPEL * scale + fall
    return time_s[keep], value[keep]


def seconds(series: Series, window: Window) -> Float64:
    """
    Return the times of an input [s after the start of the window].
    """
    return np.asarray((series.time_ns - window.start_ns) * 1e-9)


def readings(window: Window) -> tuple[Float64, Float64]:
    """
    Return the speed of a window, by the best input that shows it.

    Returns
    -------
    time_s, speed
        [s] after `window.start_ns`, [m/s]; empty where nothing shows a speed.

    Notes
    -----
    Through water where there is a log, else over ground; from positions over steps
    that are long enough for them.
    """
    for series in window.each('speed_through_water', 'speed_over_ground'):
        if len(series) >= LEAST_READINGS:
            return clean_readings(seconds(series, window), series.value)
    track = max(window.each('position'), key=len)
    if len(track) < LEAST_READINGS:
        return np.empty(0), np.empty(0)
    time_s = seconds(track, window)
    count = min(_BINS, len(time_s) // 2) + 1
    edges = np.linspace(time_s[0], time_s[-1], count + 1)
    place = [means(time_s, track.value[:, axis], edges) for axis in (0, 1)]
    middle = means(time_s, time_s, edges)
    there = np.isfinite(middle)
    middle = middle[there]
    steps = np.hypot(np.diff(place[0][there]), np.diff(place[1][there]))
    return 0.5 * (middle[1:] + middle[:-1]), steps / np.diff(middle)


def means(time_s: Float64, value: Float64, edges: Float64) -> Float64:
    """
    Return the mean of a value between each two edges; NaN where there is none.
    """
    number = np.clip(np.searchsorted(edges, time_s, side='right') - 1, 0, len(edges) - 2)
    count = np.bincount(number, minlength=len(edges) - 1)
    total = np.bincount(number, value, minlength=len(edges) - 1)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def binned(time_s: Float64, speed: Float64, bins: int = _BINS) -> tuple[Float64, Float64]:
    """
    Average a speed over even steps of time.

    Returns
    -------
    time_s, speed : (n,)
        n is `bins` or fewer where readings are few.
    """
    if len(time_s) < 2:
        return time_s, speed
    count = max(min(bins, len(time_s)), 1)
    # each of `count` readings in the middle of its bin
    half = 0.5 * (time_s[-1] - time_s[0]) / max(len(time_s) - 1, 1)
    edges = np.linspace(time_s[0] - half, time_s[-1] + half, count + 1)
    t, v = means(time_s, time_s, edges), means(time_s, speed, edges)
    there = np.isfinite(t)
    return t[there], v[there]
