# SPDX-License-Identifier: Apache-2.0
"""Means over short times: what the oracle compares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.worlds.hidden.hull import Array
from benchmarks.worlds.hidden.recording import Series

_ENOUGH = 0.7  # of the readings of a bin


@dataclass(frozen=True)
class Means:
    """
    Means of one input over bins.

    Attributes
    ----------
    start_s, end_s : (n,)
        Of the bins, after the stop.
    value : (n, 2)
    readings : (n,)
    """

    start_s: Array
    end_s: Array
    value: Array
    readings: Array

    @property
    def middle_s(self) -> Array:
        """Middles of the bins."""
        return 0.5 * (self.start_s + self.end_s)

    @property
    def width_s(self) -> Array:
        """Lengths of the bins."""
        return self.end_s - self.start_s


def means_of(series: Series, time: Array, edges: Array) -> Means:
    """
    Average what is near what is around it, between edges [s].
    """
    keep = np.ones(len(time), np.bool_)
    for column in series.value.T:
        padded = np.pad(column, 7, 'reflect', reflect_type='odd')
        around = np.lib.stride_tricks.sliding_window_view(padded, 15)
        # a steady motion does not count as being off
        near = 0.5 * (np.median(around[:, :7], axis=1) + np.median(around[:, 8:], axis=1))
        off = np.abs(column - near)
        keep &= off <= 8.0 * np.median(off) + 1e-9
    place = np.searchsorted(edges, time[keep]) - 1
    inside = (place >= 0) & (place < len(edges) - 1)
    place, value = place[inside], series.value[keep][inside]
    n = np.bincount(place, minlength=len(edges) - 1)
    every = float(np.median(np.diff(time)))
    enough = n >= np.maximum(_ENOUGH * np.diff(edges) / every, 2)
    sums = [np.bincount(place, column, minlength=len(n)) for column in value.T]
    mean = np.column_stack(sums)[enough] / n[enough, None]
    # where readings are missing the mean is of another moment
    middle = (np.bincount(place, time[keep][inside], minlength=len(n)) / np.maximum(n, 1))[enough]
    half = 0.5 * np.diff(edges)[enough]
    return Means(middle - half, middle + half, mean, n[enough])


def average(time: Array, value: Array, means: Means, *, late_s: float = 0.0) -> Array:
    """
    Return the means of a curve over the bins.
    """
    steps = 0.5 * (value[1:] + value[:-1]) * np.diff(time)
    total = np.concatenate([[0.0], np.cumsum(steps)])
    start, end = means.start_s - late_s, means.end_s - late_s
    return (np.interp(end, time, total) - np.interp(start, time, total)) / means.width_s


def slow_covariance(means: Means, process: tuple[float, float]) -> Array:
    """
    Return the covariance of the means of a slow process (sd, correlation time).
    """
    sd, slow_s = process
    part = means.width_s / slow_s
    apart = np.abs(means.middle_s[:, None] - means.middle_s)
    spread = 2.0 * np.sinh(0.5 * part) / part
    covariance = np.exp(-apart / slow_s) * np.outer(spread, spread)
    np.fill_diagonal(covariance, 2.0 * (part - 1.0 + np.exp(-part)) / part**2)
    return sd**2 * covariance
