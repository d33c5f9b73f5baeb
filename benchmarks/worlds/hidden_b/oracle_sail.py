# SPDX-License-Identifier: Apache-2.0
"""
Runs without noise, as the oracle sails them, and what it compares: means over short times.

The laws are the generator's own, the hull is as the ship file states her. An effect is made by the
generator's own maker, from numbers that are given instead of drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, pi
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from benchmarks.worlds.hidden_b.cases import EPOCH_NS, Known
from benchmarks.worlds.hidden_b.effects import LIBRARY, Draw, Hidden
from benchmarks.worlds.hidden_b.hulls import AIR, GRAVITY, SEA, Array, Hull, ittc57
from benchmarks.worlds.hidden_b.instruments import (
    EARTH_M,
    Recording,
    Series,
    faulty_log,
    faulty_place,
    filtered,
)
from benchmarks.worlds.hidden_b.setting import Setting
from benchmarks.worlds.hidden_b.voyage import Track, sail_at, steady_point
from benchmarks.worlds.hidden_b.weather import Weather

_STILL = Weather('karman', (0.0, 0.0), 0.0, 0.0, (0.0, 0.0), (0.0, 0.0, 0.0), (), 0.0, 1.0)  # type: ignore[arg-type]
_BETWEEN_SD = 0.003  # of each of seven waves; resistance between the speeds of the file


@dataclass(frozen=True)
class Stated:
    """
    What a ship file states.

    Attributes
    ----------
    hull
        With resistance (stopped propeller apart) and added mass as stated.
    misses
        What one standard deviation of each error adds to the resistance, on the hull's grid: of
        the two that are stated, and of what lies between the speeds of the file.
    added_sd, run_down_sd
        Of the added mass; of the time in which the thrust falls, relative.
    """

    hull: Hull
    misses: tuple[Array, ...]
    added_sd: float
    run_down_sd: float


def stated(text: str, known: Known) -> Stated:
    """
    Read a ship file of world B.
    """
    file = yaml.safe_load(text)
    grid, baseline = known.hull.grid_m_s, file['baseline']
    hull = known.hull
    steady = np.linspace(0.0, 1.2 * hull.speed_m_s, 80)
    sd = baseline['relative_sd']
    if 'resistance_n' in baseline:
        speed = np.array(baseline['speed_m_s'])
        usual = _smooth(speed[1:], np.array(baseline['resistance_n'])[1:] / speed[1:] ** 2)(grid)
        usual = usual * grid**2
        share = 1.3 * grid / speed[-1]
        misses = (0.8 * sd * usual, 0.6 * sd * usual * np.cos(pi * share))
    else:
        pressure = 0.5 * SEA[0] * hull.wetted_m2 * grid**2
        air = 0.5 * AIR * hull.frontal_m2 * hull.air_drag * grid**2
        line = ittc57(grid * hull.length_m / SEA[1])
        friction = (1.0 + baseline['form_factor']) * line + baseline['correlation_allowance']
        froude = grid / np.sqrt(GRAVITY * hull.length_m)
        wave = _smooth(np.array(baseline['wave_froude']), np.array(baseline['wave_coefficient']))
        waves = pressure * np.maximum(wave(froude), 0.0)
        usual = pressure * friction + waves + air
        misses = (sd['friction'] * pressure * friction, sd['wave'] * waves)
    between = _BETWEEN_SD * usual * np.cos(pi * np.arange(3, 10)[:, None] * grid / hull.speed_m_s)
    added, down = file['added_mass'], file['propulsion']
    bare = replace(hull, still_n=usual, n_r=added['value'])
    # revs and torque before the stop depend on the drag hardly at all
    need = float(np.interp(hull.speed_m_s, grid, usual))
    held = steady_point(run_of(known, bare, 0, hull.speed_m_s, 0.0), need)
    drag = np.interp(grid, steady, known.screw.drag_n(steady, held))
    drag *= np.maximum(grid / steady[-1], 1.0) ** 2
    return Stated(
        replace(bare, still_n=np.maximum(usual - drag, 0.02 * usual)),
        (*misses, *between),
        added['sd'],
        down['sd'] / down['run_down_s'],
    )


def _smooth(x: Array, y: Array) -> Callable[[Array], Array]:
    curve = PchipInterpolator(x, y)
    return lambda at: curve(np.clip(at, x[0], x[-1]))


def run_of(known: Known, hull: Hull, run: int, speed: float, heading: float) -> Setting:
    """
    Return a run on which nothing acts.
    """
    return Setting(
        hull=hull,
        screw=known.screw,
        weather=_STILL,
        speed_m_s=speed,
        heading_rad=heading,
        first_rad=heading,
        lead_s=known.lead_s,
        coast_s=known.coast_s,
        step_s=min(4.0 * known.step_s, known.coast_s / 300.0),
        clock_s=known.clock_s[run],
        seed=(0,),
        quiet=True,
    )


Change = Callable[[Setting], None]
_WEATHER = (  # a standard deviation of each: in m/s, of the flow over the speed
    ('wind', (0.65, 0.0)), ('wind', (0.0, 0.65)),
    ('flow', (1.6e-3, 0.0)), ('flow', (0.0, 1.6e-3)),
    ('tide', (6e-3, 0.0, 0.0)), ('tide', (0.0, 6e-3, 0.0)),
    ('tide', (6e-3, 0.0, -np.pi / 2)), ('tide', (0.0, 6e-3, -np.pi / 2)),
)  # fmt: skip
_SCALE, _OFFSET = 1.7e-3, 7e-4  # of the log; over the speed


def shared(row: Callable[[Change, Hull], Array], stated: Stated) -> Array:
    """
    Return what a standard deviation of each changes, a column each: (n, m).

    Parameters
    ----------
    row
        Returns what would be seen of a hull in settings that are changed.
    stated
    """
    hull = stated.hull
    plain = row(lambda _: None, hull)
    hulls = [replace(hull, still_n=hull.still_n + miss) for miss in stated.misses]
    hulls.append(replace(hull, n_r=hull.n_r + stated.added_sd))
    late = 1.0 + stated.run_down_sd
    changes = [
        _changing('screw', inertia_s=lambda now: now * late, ramp_s=lambda now: now * late),
        *(_blowing(hull, name, value) for name, value in _WEATHER),
        _changing('faults', scale=lambda now: now + _SCALE),
        _changing('faults', offset_m_s=lambda now: now + _OFFSET * hull.speed_m_s),
    ]
    rows = [row(lambda _: None, each) for each in hulls] + [row(each, hull) for each in changes]
    return np.stack([each - plain for each in rows], axis=1)


def _blowing(hull: Hull, name: str, value: tuple[float, ...]) -> Change:
    size = hull.speed_m_s if name == 'flow' else 1.0
    return _changing('weather', **{name: lambda _: tuple(size * each for each in value)})


def _changing(part: str, **laws: Callable[[Any], Any]) -> Change:
    """Return what makes of attributes of a part of a setting what laws make of them."""

    def change(setting: Setting) -> None:
        now = getattr(setting, part)
        changed = {name: law(getattr(now, name)) for name, law in laws.items()}
        setattr(setting, part, replace(now, **changed))

    return change


class _Given:
    """Stands for a generator of random numbers: each draw is the next number given."""

    def __init__(self, numbers: Sequence[float]) -> None:
        self.numbers = list(numbers)

    def uniform(self, *_: Any) -> float:
        return self.numbers.pop(0)

    normal = choice = uniform


def made(name: str, numbers: Sequence[float], hull: Hull, known: Known, steady: Any) -> Hidden:
    """
    Return an effect of the library.

    Parameters
    ----------
    name
    numbers
        What its maker would draw, in that order.
    hull, known, steady
        The ship; revs and torque before the stop.
    """
    given = _Given(numbers)
    draw = Draw(given, hull, known.screw, 1.0, known.coast_s, steady)  # type: ignore[arg-type]
    found = LIBRARY[name][0](draw)
    return _exact(found, numbers[0]) if name == 'fouling' else found


def _exact(found: Hidden, factor: float) -> Hidden:
    """Return fouling of a factor itself: its maker takes the next of 200 heights, in steps."""
    part = factor / found.parameters['friction_factor']

    def apply(setting: Setting) -> None:
        found.apply(setting)
        law = setting.still.pop()
        setting.still.append(lambda hull, v, r: r + part * (law(hull, v, r) - r))

    return replace(found, parameters={'friction_factor': factor}, apply=apply)


@dataclass(frozen=True)
class Sailed:
    """
    A run without noise, from some time before the stop on, at even steps.

    Attributes
    ----------
    t, log, place, track
    """

    t: Array
    log: Array
    place: Array
    track: Track


def sailed(setting: Setting, known: Known, *, push: float = 0.0) -> Sailed:
    """
    Sail a quiet run, and read log and place without noise.

    Parameters
    ----------
    setting
    known
    push
        Change of the speed at the stop, for which the engine was not set [m/s].
    """
    hull, dt = setting.hull, setting.step_s
    t = np.arange(round(setting.coast_s / dt) + 1) * dt
    track = sail_at(setting, t, push)
    before = ceil(0.35 * hull.time_s / dt)
    early = np.arange(-before, 0) * dt
    water = np.concatenate([np.full(before, track.water_m_s[0]), track.water_m_s])
    place = np.concatenate([early[:, None] * track.ground_m_s[0], track.place_m])
    whole = replace(track, t=np.concatenate([early, t]), water_m_s=water, place_m=place)
    seen = filtered(whole.t, water, known.kit.log_filter_s)
    log = faulty_log(whole.t, seen, setting.faults)
    return Sailed(whole.t, log, faulty_place(whole, known.kit, setting.faults), track)


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
