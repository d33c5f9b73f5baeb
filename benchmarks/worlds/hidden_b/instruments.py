# SPDX-License-Identifier: Apache-2.0
"""
Instruments, after their manuals: filters, steps of the display, rates, gaps, zeros.

Each reading has its stamp and its later arrival; stamps of a source ascend.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.worlds.hidden_b.hulls import Array
from benchmarks.worlds.hidden_b.setting import Faults, Setting
from benchmarks.worlds.hidden_b.voyage import Track
from benchmarks.worlds.hidden_b.weather import Sinusoids, band

KNOT = 1852.0 / 3600.0


@dataclass(frozen=True)
class Kit:
    """
    The instruments of a ship.

    Attributes
    ----------
    log_filter_s, log_every_s, log_step_m_s, log_sd_m_s, log_gain
        Of the speed log; `log_gain` the sd of its wander, relative.
    zeros, gaps_per_hour
        Share of readings that are exactly zero; breaks of any source.
    fix
        `gnss`, `geodetic` (the same in degrees) or `radar`.
    fix_every_s, wander_m, step_m
        Of the positions; wander and steps of GNSS.
    range_sd_m, bearing_sd_rad, marks_m
        Of the radar: two marks, from the place of the stop.
    """

    log_filter_s: float
    log_every_s: float
    log_step_m_s: float
    log_sd_m_s: float
    log_gain: float
    log_depth_m: float
    log_scale: float
    log_offset_m_s: float
    zeros: float
    gaps_per_hour: float
    fix: str
    fix_every_s: float
    wander_m: float
    step_m: float
    range_sd_m: float
    bearing_sd_rad: float
    marks_m: tuple[tuple[float, float], tuple[float, float]]
    origin_deg: tuple[float, float]
    wind_gain: float
    wind_turn_rad: float
    turn_step: float


def draw_kit(
    rng: np.random.Generator, time_s: float, speed_m_s: float, draught_m: float, far_m: float
) -> Kit:
    """
    Draw the instruments of a ship.

    Parameters
    ----------
    rng
    time_s, speed_m_s, draught_m
        Of the ship.
    far_m
        How far she goes in a run.
    """
    slow = float(np.clip(0.015 * time_s, 0.5, 15.0))  # a fast craft has a quick log
    fix = str(rng.choice(['gnss', 'geodetic', 'radar'], p=[0.3, 0.2, 0.5]))
    marks = []
    for side in rng.permutation([0.0, rng.uniform(0.4, 0.8)]):
        angle = rng.uniform(0, 2 * np.pi) + side * np.pi
        away = max(1500.0, 0.7 * far_m) * rng.uniform(0.8, 1.6)
        marks.append((float(away * np.cos(angle)), float(away * np.sin(angle))))
    return Kit(
        log_filter_s=rng.uniform(min(2.0, 0.7 * slow), slow),
        log_every_s=float(rng.choice([0.2, 0.5, 1.0, 1.0, 2.0])),
        log_step_m_s=float(rng.choice([0.1 * KNOT, 0.01 * KNOT, 0.01, 0.05])),
        log_sd_m_s=speed_m_s * 10 ** rng.uniform(-3.0, -1.9),
        log_gain=10 ** rng.uniform(-3.5, -2.7),
        log_depth_m=draught_m,
        log_scale=rng.uniform(-0.003, 0.003),
        log_offset_m_s=rng.uniform(-0.0012, 0.0012) * speed_m_s,
        zeros=float(rng.choice([0.0, 0.0, 0.001, 0.006])),
        gaps_per_hour=float(rng.choice([0.0, 1.0, 4.0])),
        fix=fix,
        fix_every_s=float(rng.choice([2.0, 3.0, 5.0]) if fix == 'radar' else 1.0),
        wander_m=rng.uniform(0.4, 2.0),
        step_m=float(rng.choice([0.0, rng.uniform(0.3, 2.5)])),
        range_sd_m=rng.uniform(2.0, 9.0),
        bearing_sd_rad=np.radians(rng.uniform(0.05, 0.25)),
        marks_m=(marks[0], marks[1]),
        origin_deg=(rng.uniform(-55.0, 65.0), rng.uniform(-180.0, 180.0)),
        wind_gain=rng.uniform(0.92, 1.06),
        wind_turn_rad=np.radians(rng.normal(0.0, 2.0)),
        turn_step=float(rng.choice([0.1, 1.0])) * 2 * np.pi / 60.0,
    )


EARTH_M = 6_371_000.0
MOTION = ('speed_through_water', 'position')
INPUTS = (*MOTION, 'wind_apparent', 'depth', 'heading', 'shaft')


@dataclass(frozen=True)
class Series:
    """
    Readings of one channel: stamps and arrivals [ns], values (n,) or (n, 2).
    """

    stamp_ns: NDArray[np.int64]
    value: Array
    receive_ns: NDArray[np.int64]


Recording = Mapping[str, Series]


def filtered(t: Array, value: Array, lag_s: float) -> Array:
    """
    Return what a first-order filter makes of values at even times.
    """
    if lag_s <= 0.0:
        return value
    keep = float(np.exp(-(t[1] - t[0]) / lag_s))
    found, last = np.empty_like(value), value[0]
    for i, now in enumerate(value):
        last = keep * last + (1.0 - keep) * now
        found[i] = last
    return found


def faulty_log(t: Array, water: Array, faults: Faults) -> Array:
    """
    Return what the log would read without noise.
    """
    read = filtered(t, np.interp(t - faults.late_s, t, water), faults.lag_s)
    read = (1.0 + faults.scale) * read + faults.offset_m_s
    if faults.swing is not None:
        read = read * (1.0 + faults.swing(t))
    return np.where(read < faults.dead_m_s, 0.0, read) if faults.dead_m_s > 0.0 else read


def faulty_place(track: Track, kit: Kit, faults: Faults) -> Array:
    """
    Return the places that would be found without noise, from the place of the stop.
    """
    true = (1.0 + faults.radar_scale) * (track.place_m - _stop(track))
    if faults.gyro is None or kit.fix != 'radar':
        return true
    error = faults.gyro(track.t)
    found = np.zeros_like(true)
    for mark in kit.marks_m:
        to = np.array(mark) - true
        c, s = np.cos(error), np.sin(error)
        found += 0.5 * (np.array(mark) - np.stack([c * to[:, 0] - s * to[:, 1],
                                                   s * to[:, 0] + c * to[:, 1]], 1))  # fmt: skip
    return found


def _stop(track: Track) -> Array:
    return track.place_m[int(np.argmin(np.abs(track.t)))]


def read(
    track: Track, setting: Setting, kit: Kit, inputs: tuple[str, ...], start_ns: int
) -> dict[str, Series]:
    """
    Return what the instruments say of a run.

    Parameters
    ----------
    track, setting, kit
    inputs
        Of `INPUTS`; each has random numbers of its own.
    start_ns
        Of the first reading.
    """
    found: dict[str, Series] = {}
    for name in inputs:
        rng = setting.stream(20, INPUTS.index(name))
        found |= getattr(_Readers(track, setting, kit, rng, start_ns), name)()
    return found


def _stepped(value: Array, step: float) -> Array:
    return np.round(value / step) * step


def _radar(place: Array, t: Array, kit: Kit, rng: np.random.Generator) -> Array:
    """Find the place from ranges and bearings of two marks, each weighted by its errors."""
    gyro = band(rng, 0.6 * kit.bearing_sd_rad, 100.0, 900.0, 10).at(t)
    normal, right = np.zeros((len(t), 2, 2)), np.zeros((len(t), 2))
    for mark in kit.marks_m:
        to = np.array(mark) - place
        away = np.hypot(to[:, 0], to[:, 1])
        seen = _stepped(away + kit.range_sd_m * rng.standard_normal(len(t)), 1.852)
        angle = np.arctan2(to[:, 1], to[:, 0]) + gyro
        angle = angle + kit.bearing_sd_rad * rng.standard_normal(len(t))
        c, s = np.cos(angle), np.sin(angle)
        found = np.array(mark) - seen[:, None] * np.stack([c, s], 1)
        radial, across = kit.range_sd_m**-2, (kit.bearing_sd_rad * np.maximum(away, 50.0)) ** -2
        weight = radial * _outer(c, s) + across[:, None, None] * _outer(-s, c)
        normal += weight
        right += np.einsum('nij,nj->ni', weight, found)
    return np.linalg.solve(normal, right[:, :, None])[:, :, 0]


def _outer(a: Array, b: Array) -> Array:
    return np.stack([np.stack([a * a, a * b], 1), np.stack([a * b, b * b], 1)], 1)


@dataclass(frozen=True)
class _Readers:
    """What reads a run; a method each input, by its name."""

    track: Track
    setting: Setting
    kit: Kit
    rng: np.random.Generator
    start_ns: int

    def _series(self, every_s: float) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
        """Return times of readings [s], stamps and arrivals."""
        track, rng = self.track, self.rng
        t = np.arange(track.t[0] + rng.uniform(0.0, every_s), track.t[-1], every_s)
        t = t + rng.uniform(-0.02, 0.02, len(t)) * min(every_s, 1.0)
        kept = np.ones(len(t), np.bool_)
        hours = (t[-1] - t[0]) / 3600.0
        for _ in range(rng.poisson(self.kit.gaps_per_hour * hours)):
            begin = rng.uniform(t[0], t[-1])
            kept &= (t < begin) | (t > begin + rng.uniform(3.0, 25.0))
        t = t[kept & (t >= track.t[0]) & (t <= track.t[-1])]
        stamps = self.start_ns + np.round((t - track.t[0]) * 1e9).astype(np.int64)
        late = rng.uniform(0.02, 0.15, len(t)) + rng.exponential(0.03, len(t))
        arrivals = np.maximum.accumulate(stamps + np.round(late * 1e9).astype(np.int64))
        return t, stamps, arrivals

    def speed_through_water(self) -> dict[str, Series]:
        grid, day = self.track.t, self.setting.weather
        fine = np.linspace(
            grid[0], grid[-1], round((grid[-1] - grid[0]) / min(1.0, grid[1] - grid[0]))
        )
        orbit = day.orbital(self.kit.log_depth_m)
        swell = Sinusoids(
            orbit * np.sqrt(self.rng.dirichlet(np.full(8, 3.0))),
            2 * np.pi / (day.swell_s * self.rng.uniform(0.85, 1.15, 8)),
            self.rng.uniform(0, 2 * np.pi, 8),
        )
        water = np.interp(fine, grid, self.track.water_m_s)
        gain = 1.0 + band(self.rng, self.kit.log_gain, 100.0, 2000.0, 10).at(fine)
        raw = filtered(fine, water * gain + swell.at(fine), self.kit.log_filter_s)
        noise = filtered(fine, self.rng.standard_normal(len(fine)), 0.3 * self.kit.log_filter_s)
        raw = raw + self.kit.log_sd_m_s * noise / noise.std()
        value = faulty_log(
            fine, (1.0 + self.kit.log_scale) * raw + self.kit.log_offset_m_s, self.setting.faults
        )
        t, stamps, arrivals = self._series(self.kit.log_every_s)
        found = _stepped(np.interp(t, fine, value), self.kit.log_step_m_s)
        found[self.rng.random(len(t)) < self.kit.zeros] = 0.0
        return {'speed_through_water': Series(stamps, found, arrivals)}

    def position(self) -> dict[str, Series]:
        t, stamps, arrivals = self._series(self.kit.fix_every_s)
        true = faulty_place(self.track, self.kit, self.setting.faults)
        place = np.stack([np.interp(t, self.track.t, true[:, k]) for k in (0, 1)], axis=1)
        if self.kit.fix == 'radar':
            place = _radar(place, t, self.kit, self.rng)
        else:
            for k in (0, 1):
                place[:, k] += band(self.rng, self.kit.wander_m, 80.0, 900.0, 14).at(t)
                place[:, k] += band(self.rng, 0.06 * self.kit.wander_m, 10.0, 80.0, 10).at(t)
                place[:, k] += 0.05 * self.rng.standard_normal(len(t))
            for _ in range(self.rng.poisson(2.0)):
                place[t > self.rng.uniform(t[0], t[-1])] += (
                    self.kit.step_m * self.rng.standard_normal(2)
                )
        if self.kit.fix != 'geodetic':
            return {'position': Series(stamps, _stepped(place, 0.01), arrivals)}
        latitude, longitude = self.kit.origin_deg
        north = np.degrees(place[:, 1] / EARTH_M)
        east = np.degrees(place[:, 0] / (EARTH_M * np.cos(np.radians(latitude))))
        degrees = np.stack([latitude + north, longitude + east], axis=1)
        return {'position_geodetic': Series(stamps, _stepped(degrees, 1e-5 / 6.0), arrivals)}

    def heading(self) -> dict[str, Series]:
        t, stamps, arrivals = self._series(1.0)
        value = np.interp(t, self.track.t, self.track.heading_rad)
        value = value + np.radians(self.rng.normal(0.0, 0.4))
        value = value + band(self.rng, np.radians(0.3), 100.0, 3000.0, 8).at(t)
        if self.setting.faults.gyro is not None:
            value = value + self.setting.faults.gyro(t)
        value = _stepped(value, np.radians(0.1))
        return {'heading': Series(stamps, (value + np.pi) % (2 * np.pi) - np.pi, arrivals)}

    def shaft(self) -> dict[str, Series]:
        found = {}
        for k in range(self.setting.screw.shafts):
            t, stamps, arrivals = self._series(1.0)
            end = '' if k == 0 else f'_{k + 1}'
            value = np.interp(t, self.track.t, self.track.shafts_rad_s[:, k])
            found[f'shaft{end}'] = Series(stamps, _stepped(value, self.kit.turn_step), arrivals)
            if self.setting.screw.drive == 'cpp':
                pitch = _stepped(np.interp(t, self.track.t, self.track.pitch), 0.01)
                found[f'pitch{end}'] = Series(stamps, pitch, arrivals)
        return found

    def wind_apparent(self) -> dict[str, Series]:
        t, stamps, arrivals = self._series(1.0)
        c, s = np.cos(self.kit.wind_turn_rad), np.sin(self.kit.wind_turn_rad)
        ahead, port = (np.interp(t, self.track.t, self.track.wind_m_s[:, k]) for k in (0, 1))
        value = self.kit.wind_gain * np.stack([c * ahead - s * port, s * ahead + c * port], axis=1)
        value = value + 0.2 * self.rng.standard_normal(value.shape)
        return {'wind_apparent': Series(stamps, _stepped(value, 0.1), arrivals)}

    def depth(self) -> dict[str, Series]:
        t, stamps, arrivals = self._series(2.0)
        bottom = self.setting.depth_m * (1.0 + band(self.rng, 0.02, 150.0, 2000.0, 8).at(t))
        value = bottom + 0.1 * self.rng.standard_normal(len(t))
        return {'depth': Series(stamps, _stepped(value, 0.1), arrivals)}
