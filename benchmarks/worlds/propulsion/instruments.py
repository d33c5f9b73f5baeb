# SPDX-License-Identifier: Apache-2.0
"""What a log, a receiver or radar, shaft sensors and a gyro make of a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from benchmarks.worlds.propulsion.motion import ROW_S, Float64, Motion
from benchmarks.worlds.propulsion.sea import Waves, coloured, frequencies
from shipdrag_ros.samples import PITCHES, SHAFTS, Block, Channel

EPOCH_NS = 1_750_000_000_000_000_000
KNOT = 1852.0 / 3600.0
LATITUDE_DEG = 54.7


@dataclass(frozen=True)
class Fit:
    """
    The instruments of one ship, drawn once a case.

    Attributes
    ----------
    log_period_s, log_filter_s, log_step_m_s, log_noise_m_s, log_scale
        Spacing, time constant, quantum (0: none), white noise, error of scale of the log.
    track_period_s, track_noise_m, track_wander_m, track_wander_s
        Spacing, white noise, wander of the positions, and its time.
    geodetic
        Positions as latitude and longitude.
    shaft_period_s, shaft_step, shaft_noise
        Spacing; quantum [rad/s]; noise relative to the steady rate.
    """

    log_period_s: float
    log_filter_s: float
    log_step_m_s: float
    log_noise_m_s: float
    log_scale: float
    track_period_s: float
    track_noise_m: float
    track_wander_m: float
    track_wander_s: float
    geodetic: bool
    shaft_period_s: float
    shaft_step: float
    shaft_noise: float


def fit_out(random: np.random.Generator) -> Fit:
    """
    Draw instruments as ships have them.
    """
    radar = random.random() < 0.25
    return Fit(
        log_period_s=float(random.choice([0.2, 0.5, 1.0, 1.0, 1.0, 2.0, 5.0])),
        log_filter_s=float(random.uniform(2.0, 10.0)),
        log_step_m_s=float(random.choice([0.0, 0.01, 0.01 * KNOT, 0.1 * KNOT])),
        log_noise_m_s=float(random.uniform(0.01, 0.03)),
        log_scale=float(0.015 * random.standard_normal()),
        track_period_s=float(
            random.choice([2.0, 3.0]) if radar else random.choice([0.2, 1, 1, 2])
        ),
        track_noise_m=float(random.uniform(3.0, 6.0) if radar else random.uniform(0.2, 0.8)),
        track_wander_m=float(random.uniform(2.0, 4.0) if radar else random.uniform(0.5, 1.5)),
        track_wander_s=float(random.uniform(60.0, 300.0)),
        geodetic=bool(not radar),
        shaft_period_s=float(random.choice([0.5, 1.0, 1.0, 2.0])),
        shaft_step=float(random.choice([0.01, 0.1, 1.0]) * 2 * np.pi / 60.0),
        shaft_noise=float(random.uniform(0.001, 0.004)),
    )


def read(
    motion: Motion,
    fit: Fit,
    waves: Waves,
    controllable: bool,
    steady_omega: float,
    random: np.random.Generator,
) -> dict[str, list[Block]]:
    """
    Return blocks by instrument: log, track, heading, shaft.
    """
    n = len(motion.time_s)
    sea_shape = frequencies(n, ROW_S)
    narrow = np.exp(-(((sea_shape - waves.encounter_hz) / (0.25 * waves.encounter_hz)) ** 2))
    surge = waves.surge_m_s * coloured(random, n, narrow)
    orbit = waves.orbital_m_s * coloured(random, n, narrow)
    out = {
        'log': [_log(motion, fit, surge + orbit, random)],
        'track': [_track(motion, fit, surge, random)],
        'heading': [_heading(motion, random)],
    }
    pairs = zip(motion.omega, motion.pitch, SHAFTS, PITCHES, strict=False)
    shafts: list[Block] = []
    for omega, pitch, shaft, pitch_channel in pairs:
        take, stamp = _times(n, fit.shaft_period_s, random)
        noise = fit.shaft_noise * steady_omega * random.standard_normal(len(take))
        turning = np.abs(omega[take]) > 1e-3 * steady_omega
        shafts.append(
            _block(shaft, stamp, _quantised(omega[take] + noise * turning, fit.shaft_step), random)
        )
        if controllable:
            noisy = pitch[take] + 0.003 * random.standard_normal(len(take))
            shafts.append(_block(pitch_channel, stamp, noisy, random))
    out['shaft'] = shafts
    return out


def _times(n: int, period_s: float, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Rows to read, and their stamps [ns]."""
    every = max(round(period_s / ROW_S), 1)
    take = np.arange(random.integers(every), n, every)
    return take, EPOCH_NS + np.round(take * ROW_S * 1e9).astype(np.int64)


def _block(
    channel: Channel, stamp: np.ndarray, value: np.ndarray, random: np.random.Generator
) -> Block:
    delay = int(random.uniform(0.02, 0.4) * 1e9)
    return Block.of(channel, stamp, value, receive_ns=stamp + delay)


def _quantised(value: np.ndarray, step: float) -> np.ndarray:
    return np.asarray(np.round(value / step) * step) if step > 0.0 else value


def _log(motion: Motion, fit: Fit, sea: Float64, random: np.random.Generator) -> Block:
    share = ROW_S / fit.log_filter_s
    white = random.standard_normal(len(sea)) * fit.log_noise_m_s
    # the noise as stated is that of the filtered reading
    white *= np.sqrt((2.0 - share) / share)
    filtered = _low_pass((1.0 + fit.log_scale) * (motion.speed + sea) + white, share)
    take, stamp = _times(len(filtered), fit.log_period_s, random)
    reading = _quantised(filtered[take], fit.log_step_m_s)
    return _block(Channel.SPEED_THROUGH_WATER, stamp, reading, random)


def _low_pass(value: Float64, share: float) -> Float64:
    start = (1.0 - share) * value[0]
    return np.asarray(lfilter([share], [1.0, share - 1.0], value, zi=[start])[0])


def _track(motion: Motion, fit: Fit, surge: Float64, random: np.random.Generator) -> Block:
    n = len(motion.time_s)
    take, stamp = _times(n, fit.track_period_s, random)
    along = np.cumsum(surge) * ROW_S
    along -= np.mean(along)
    hertz = frequencies(len(take), fit.track_period_s)
    wander = np.where(hertz > 0, 1.0 / (1.0 + (hertz * 2 * np.pi * fit.track_wander_s) ** 2), 0.0)
    place = []
    for way, turned in ((motion.east, np.cos(motion.yaw)), (motion.north, np.sin(motion.yaw))):
        error = fit.track_noise_m * random.standard_normal(len(take))
        error += fit.track_wander_m * coloured(random, len(take), wander)
        place.append((way + along * turned)[take] + error)
    east, north = place
    if not fit.geodetic:
        return _block(Channel.POSITION, stamp, np.column_stack(place), random)
    return _block(Channel.POSITION_GEODETIC, stamp, _geodetic(east, north), random)


def _geodetic(east: Float64, north: Float64) -> Float64:
    """Latitude and longitude [deg] of metres on the WGS 84 ellipsoid."""
    a, e2 = 6378137.0, 6.69437999014e-3
    latitude = np.radians(LATITUDE_DEG)
    w = np.sqrt(1.0 - e2 * np.sin(latitude) ** 2)
    latitude = latitude + north * w**3 / (a * (1.0 - e2))
    middle = 0.5 * (latitude[1:] + latitude[:-1])
    radius = a / np.sqrt(1.0 - e2 * np.sin(middle) ** 2) * np.cos(middle)
    longitude = np.radians(10.3) + np.concatenate([[0.0], np.cumsum(np.diff(east) / radius)])
    return np.degrees(np.column_stack([latitude, longitude]))


def _heading(motion: Motion, random: np.random.Generator) -> Block:
    take, stamp = _times(len(motion.time_s), 1.0, random)
    noise = 0.003 * random.standard_normal(len(take))
    yaw = np.angle(np.exp(1j * (motion.yaw[take] + noise + 0.01 * random.standard_normal())))
    return _block(Channel.HEADING, stamp, yaw, random)
