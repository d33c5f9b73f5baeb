# SPDX-License-Identifier: Apache-2.0
"""What the oracle compares: means of the readings over short times, and of what it sails."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from benchmarks.worlds.hidden_b.cases import EPOCH_NS, Known
from benchmarks.worlds.hidden_b.hulls import Array, Hull
from benchmarks.worlds.hidden_b.instruments import EARTH_M, Recording, Series
from benchmarks.worlds.hidden_b.oracle_sail import Sailed

_BINS = (10, 40)  # of the steady part and of the rest
_COARSE = (4, 16)  # of what is measured beside the motion
_ROWS = ('speed_through_water', 'position', 'heading', 'shaft', 'wind_apparent')


class Means:
    """
    Means of an input over bins.

    Parameters
    ----------
    t : (readings,)
        Times of the readings [s]; where some are missing a mean is of another moment.
    value : (readings, k)
    place : (readings,)
        Number of the bin of each, ascending.

    Attributes
    ----------
    t, width
        Mean times of the readings; from the first to the last, by their number [s].
    value : (bins, k)
    n
        Numbers of readings.
    """

    def __init__(self, t: Array, value: Array, place: NDArray[np.int64]) -> None:
        _, self._place, n = np.unique(place, return_inverse=True, return_counts=True)
        self._times, self.n = t, n
        self.t = np.bincount(self._place, t) / n
        self.value = np.stack([np.bincount(self._place, column) for column in value.T], 1)
        self.value /= n[:, None]
        self.width = n * float(np.median(np.diff(t)))
        self._weights: dict[tuple[int, float, float], Array] = {}

    def of(self, t: Array, value: Array) -> Array:
        """
        Return the means of curves (times, k): (bins, k); straight on before they begin.
        """
        grid = len(t), float(t[0]), float(t[-1])
        if grid not in self._weights:
            i = np.clip(np.searchsorted(t, self._times) - 1, 0, len(t) - 2)
            part = np.minimum((self._times - t[i]) / (t[i + 1] - t[i]), 1.0)
            weights = np.zeros((len(self.n), len(t)))
            np.add.at(weights, (self._place, i), 1.0 - part)
            np.add.at(weights, (self._place, i + 1), part)
            self._weights[grid] = weights / self.n[:, None]
        found: Array = self._weights[grid] @ value
        return found


def _means(series: Series, start_ns: int, edges: Array) -> Means:
    t = (series.stamp_ns - start_ns) / 1e9
    value = series.value.reshape(len(t), -1)
    zero = np.all(value == 0.0, axis=1)
    # a zero among others is a dead band, one alone a lost reading
    keep = ~zero | (np.convolve(zero, np.ones(9), 'same') > 4.5)
    t, value = t[keep], value[keep]
    every = float(np.median(np.diff(t)))
    place = np.searchsorted(edges, t) - 1
    inside = (place >= 0) & (place < len(edges) - 1)
    n = np.bincount(place[inside], minlength=len(edges) - 1)
    enough = np.append(n >= np.maximum(0.6 * np.diff(edges) / every, 1), False)
    inside &= enough[place]
    return Means(t[inside], value[inside], place[inside])


class Run:
    """
    One run as the oracle sees it.

    Attributes
    ----------
    speed_m_s, heading_rad
        First guesses, from the steady part.
    quick_sd, gust_sd
        Scatter of the log within some seconds; of the wind, None where it is not read [m/s].
    shoal
        Draught over depth by the echo sounder, None where it is not read.
    measured
        All means in one row.
    """

    def __init__(self, seen: Recording, number: int, known: Known, hull: Hull) -> None:
        self.known, self.hull = known, hull
        start = EPOCH_NS + round(known.clock_s[number] * 1e9)
        seen = dict(seen)
        if 'position_geodetic' in seen:
            seen['position'] = _metres(seen['position_geodetic'], known)
        self.means = {}
        for name in (name for name in _ROWS if name in seen):
            before, after = _BINS if name in _ROWS[:2] else _COARSE
            lead = np.linspace(5.0 - known.lead_s, -0.01 * hull.time_s, before + 1)
            edges = np.concatenate([lead, np.linspace(0.0, known.coast_s - 1.0, after + 1)])
            self.means[name] = _means(seen[name], start, edges)
        log, place = self.means['speed_through_water'], self.means['position']
        self.speed_m_s = float(np.mean(log.value[log.t < 0.0]))
        before = place.value[place.t < 0.0]
        self.heading_rad = float(np.arctan2(*(before[-1] - before[0])[::-1]))
        self.shoal = None
        if 'depth' in seen:
            self.shoal = known.hull.draught_m / float(np.median(seen['depth'].value))
        self.measured = self._row({name: means.value for name, means in self.means.items()})
        t, readings = self._steady(seen['speed_through_water'], start)
        step = max(1, round(5.0 / float(np.median(np.diff(t)))))
        kept = readings[readings > 0.0]
        around = np.convolve(np.pad(kept, step, 'edge'), np.ones(2 * step + 1), 'valid')
        self.quick_sd = float(np.std(kept - around / (2 * step + 1)))
        self.gust_sd = None
        if 'wind_apparent' in seen:
            _, wind = self._steady(seen['wind_apparent'], start)
            self.gust_sd = float(np.sqrt(max(np.mean(np.var(wind, axis=0)) - 0.04, 0.01)))

    def _steady(self, series: Series, start_ns: int) -> tuple[Array, Array]:
        t = (series.stamp_ns - start_ns) / 1e9
        before = t < -0.01 * self.hull.time_s
        return t[before], series.value[before]

    def predicted(self, run: Sailed) -> Array:
        """
        Return the row that a run would give.
        """
        t, track = run.t, run.track
        curves = {
            'speed_through_water': (t, run.log[:, None]),
            'position': (t, run.place),
            'heading': (track.t, track.heading_rad[:, None]),
            'shaft': (track.t, track.shafts_rad_s[:, :1] / (2 * np.pi * track.steady[0])),
            'wind_apparent': (track.t, track.wind_m_s),
        }
        found = {}
        for name, means in self.means.items():
            found[name] = means.of(*curves[name])
            if name in ('shaft', 'wind_apparent'):
                found[name][means.t < 0.0] = curves[name][1][0]
        return self._row(found, measured=False)

    def _row(self, values: dict[str, Array], measured: bool = True) -> Array:
        parts = []
        for name, value in values.items():
            if name == 'position':
                value = value @ self.frame.T
            elif name == 'heading':
                value = (value - self.heading_rad + np.pi) % (2 * np.pi) - np.pi
            elif name == 'shaft' and measured:
                value = value / np.mean(value[self.means[name].t < 0.0])
            parts.append(value.T.ravel())
        return np.concatenate(parts)

    @cached_property
    def frame(self) -> Array:
        c, s = np.cos(self.heading_rad), np.sin(self.heading_rad)
        return np.array([[c, s], [-s, c]])


def _metres(series: Series, known: Known) -> Series:
    latitude, longitude = known.kit.origin_deg
    north = np.radians(series.value[:, 0] - latitude) * EARTH_M
    east = np.radians(series.value[:, 1] - longitude) * EARTH_M * np.cos(np.radians(latitude))
    return Series(series.stamp_ns, np.stack([east, north], axis=1), series.receive_ns)
