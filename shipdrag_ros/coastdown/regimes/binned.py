# SPDX-License-Identifier: Apache-2.0
"""A window as the bins that the bank reads, as long as it takes to tell regimes in it."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.heading import rep103_yaw
from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.coastdown.regimes import state as s
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.inference.rows import MAD_TO_SD
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import FURTHER, MOTION_INPUTS, SECOND_NS, Float64, Int64

_BINS, _MOST = 60, 150  # of a window
_BEFORE = 60  # at most
_COURSE = 3  # bins on each side that show a course
_OPPOSED = -0.7  # cosine of heading and course


class Binned(NamedTuple):
    """
    What the bins of a window say, and of the record before it.

    Attributes
    ----------
    zero_ns
        Start of the first bin [ns].
    step_s
    before
        Bins before the window.
    said : (bins, SAID)
    noise : (NOISES,)
        White noise of each instrument.
    speed : (bins,)
        As the best of them shows it [m/s]; NaN where nothing does.
    """

    zero_ns: int
    step_s: float
    before: int
    said: Float64
    noise: Float64
    speed: Float64

    @property
    def top(self) -> float:
        """The highest speed [m/s]."""
        size = np.abs(self.speed[np.isfinite(self.speed)])
        return float(np.quantile(size, 0.98)) if len(size) else 0.0

    @property
    def swing(self) -> float:
        """The largest change of speed, but for a tenth of the record [m/s^2]."""
        some = 2 * _COURSE
        size = np.abs(self.speed[some:] - self.speed[:-some]) / (some * self.step_s)
        size = size[np.isfinite(size)]
        return float(np.quantile(size, 0.9)) if len(size) else 0.0


class _Bins(NamedTuple):
    """Bins of time, and the windows from which they are filled."""

    zero_ns: int
    step_s: float
    bins: int
    parts: tuple[Window, ...]

    def of(self, name: str, number: int | None = None) -> tuple[Float64, Float64]:
        """
        Return times [bins] and values of an input; of a shaft revs times pitch.
        """
        if number is None:
            found = [part.series(name) for part in self.parts]
            time_ns = np.concatenate([each.time_ns for each in found])
            value = np.concatenate([each.value for each in found])
        else:
            time_ns, value = shaft_revs(self.parts, number)
        place = (time_ns - self.zero_ns) / (SECOND_NS * self.step_s)
        inside = (place >= 0.0) & (place < self.bins)
        return place[inside], value[inside]

    def means(self, place: Float64, value: Float64) -> Float64:
        """
        Average the middle third of each bin: single spikes are none of it.
        """
        out = np.full(self.bins, np.nan)
        edges = np.searchsorted(place, np.arange(self.bins + 1))
        for k, (first, last) in enumerate(pairwise(edges.tolist())):
            if last > first:
                some = np.sort(value[first:last])
                off = (last - first) // 3
                out[k] = some[off : len(some) - off].mean()
        return out

    def speeds(self, kind: str) -> Float64:
        """
        Average a speed: of the first instrument, where it is silent of others in its scale.
        """
        out = np.full(self.bins, np.nan)
        for name in _names(self.parts[-1], kind):
            other = self.means(*self.of(name))
            both = np.isfinite(out) & np.isfinite(other) & (other != 0.0)
            scale = float(np.median(out[both] / other[both])) if both.any() else 1.0
            out = np.where(np.isnan(out), scale * other, out)
        return out


def _names(window: Window, kind: str) -> list[str]:
    """Return the inputs of a kind."""
    return [name for name in window.motion if FURTHER.get(name, name) == kind]


def bin_window(window: Window, parameters: Parameters, longest_s: float) -> Binned | None:
    """
    Bin a window and the record before it.

    Parameters
    ----------
    window
    parameters
        `heading_convention` is used.
    longest_s
        Bins are no longer.

    Returns
    -------
    Binned or None
        None where nothing shows a speed.
    """
    length_s = (window.end_ns - window.start_ns) / SECOND_NS
    heard = [series.time_ns for series in window.each(*MOTION_INPUTS) if len(series) > 2]
    apart = [float(np.median(np.diff(time_ns))) / SECOND_NS for time_ns in heard]
    if not apart:
        return None
    step_s = max(min(longest_s, length_s / _BINS), min(apart), length_s / _MOST)
    before = 0
    if window.before is not None:
        known_s = (window.start_ns - window.before.start_ns) / SECOND_NS
        before = min(int(known_s / step_s), _BEFORE)
        before = before if before >= 2 * _COURSE else 0  # bins that teach nothing
    parts = (window,) if window.before is None else (window.before, window)
    zero_ns = window.start_ns - round(before * step_s * SECOND_NS)
    count = before + max(math.ceil(length_s / step_s), 1)
    bins = _Bins(zero_ns, step_s, count, parts)
    said, noise = np.full((count, s.SAID), np.nan), np.zeros(s.NOISES)
    heading = _heading(bins)
    course = _track(bins, said, noise)
    yaw = np.array([rep103_yaw(each, parameters.heading_convention) for each in heading])
    with np.errstate(invalid='ignore'):
        opposed = (np.cos(course - yaw) < _OPPOSED) & (step_s > 1.5 * min(apart))
        sign = np.where(opposed, -1.0, 1.0)
    said[:, s.LOG] = bins.speeds('speed_through_water')
    said[:, s.GROUND] = sign * bins.speeds('speed_over_ground')
    said[:, s.ADVANCE] *= sign
    by_compass = bool(np.isfinite(heading).any())
    at = bins.of('heading')[0] if by_compass else np.empty(0)
    # the readings of a bin are not always in its middle
    apart_s = step_s * np.diff(bins.means(at, at)) if by_compass else step_s
    said[1:, s.RATE] = _turned(heading if by_compass else course) / apart_s
    said[:, s.RUDDER] = bins.means(*bins.of('rudder'))
    _shafts(bins, said)
    speed = said[:, s.LOG]
    for other in (said[:, s.GROUND], said[:, s.ADVANCE] / step_s):
        speed = np.where(np.isnan(speed), other, speed)
    for k, column in ((s.N_LOG, s.LOG), (s.N_GROUND, s.GROUND)):
        noise[k] = _white(said[:, column])
    known = np.diff(said[:, s.RATE])
    noise[s.N_RATE] = _mad(known) / math.sqrt(2.0) + 1e-5
    found = Binned(zero_ns, step_s, before, said, noise, speed)
    floor = n.WHITE_FLOOR * found.top
    noise[s.N_LOG], noise[s.N_GROUND] = max(noise[s.N_LOG], floor), max(noise[s.N_GROUND], floor)
    noise[s.N_FIX] = max(noise[s.N_FIX], floor * step_s)
    noise[s.N_WALK] = noise[s.N_FIX] / math.sqrt(6.0 * step_s)
    return found


def _mad(value: Float64) -> float:
    value = np.abs(value[np.isfinite(value)])
    return MAD_TO_SD * float(np.median(value)) if len(value) else 0.0


def _white(value: Float64) -> float:
    """Return the white noise of a value whose course is smooth."""
    return _mad(np.diff(value, 3)) / math.sqrt(20.0)


def _heading(bins: _Bins) -> Float64:
    place, value = bins.of('heading')
    return bins.means(place, np.unwrap(value)) if len(value) else np.full(bins.bins, np.nan)


def _turned(angle: Float64) -> Float64:
    turned = np.diff(angle)
    return np.asarray(np.arctan2(np.sin(turned), np.cos(turned)))


def _track(bins: _Bins, said: Float64, noise: Float64) -> Float64:
    """Put the way of each bin along the course into `said`; return the course."""
    heard = bins.parts[-1]
    track = max(_names(heard, 'position'), key=lambda name: len(heard.series(name)))
    place, value = bins.of(track)
    if not len(place):
        return np.full(bins.bins, np.nan)
    east, north = (bins.means(place, value[:, axis]) for axis in (0, 1))
    noise[s.N_FIX] = 0.5 * math.hypot(_white(east), _white(north)) * math.sqrt(2.0)
    course = np.full(bins.bins, np.nan)
    for k in range(bins.bins):
        low, high = max(k - _COURSE, 0), min(k + _COURSE, bins.bins - 1)
        some = np.isfinite(east[low : high + 1])
        if some.sum() >= 2:
            x, y = east[low : high + 1][some], north[low : high + 1][some]
            at = np.flatnonzero(some) - np.flatnonzero(some).mean()
            course[k] = math.atan2(float(at @ y), float(at @ x))
    way = np.full(bins.bins, np.nan)
    way[1:] = np.diff(east) * np.cos(course[1:]) + np.diff(north) * np.sin(course[1:])
    said[:, s.ADVANCE] = way
    return course


def _shafts(bins: _Bins, said: Float64) -> None:
    """Put revs times pitch of each shaft into `said`."""
    for k in range(len(bins.parts[0].shafts)):
        said[:, s.SHAFTS + k] = bins.means(*bins.of('shafts', k))


def shaft_revs(parts: tuple[Window, ...], number: int) -> tuple[Int64, Float64]:
    """
    Return times [ns] of the readings of a shaft, and revs times the pitch of then [rad/s].

    A pitch holds until the next is read, and the first one before it too.
    """
    time_ns, revs, pitch_ns, pitch = (
        np.concatenate([getattr(getattr(part, name)[number], of) for part in parts])
        for name in ('shafts', 'pitches')
        for of in ('time_ns', 'value')
    )
    if len(pitch):
        held = np.searchsorted(pitch_ns, time_ns, side='right') - 1
        revs = revs * pitch[np.maximum(held, 0)]
    return time_ns, revs
