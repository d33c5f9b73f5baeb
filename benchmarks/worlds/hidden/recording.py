# SPDX-License-Identifier: Apache-2.0
"""What the sensors of a ship make of a motion, with all the faults of real ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from benchmarks.worlds.hidden.effect import Effect, Leg
from benchmarks.worlds.hidden.hull import Array
from benchmarks.worlds.hidden.sailing import LEAD_IN_S, Disturbance, Motion, times

Int = NDArray[np.int64]

START_NS = 1_750_000_000_000_000_000
BETWEEN_RUNS_NS = 7_200_000_000_000
MOTION = ('speed_through_water', 'position')
CONTEXT = ('wind_apparent', 'depth', 'heading', 'shaft')
INPUTS = (*MOTION, *CONTEXT)
_EVERY_S = {'position': 3.0, 'wind_apparent': 2.0, 'depth': 2.0}
_DEEP = 12.0  # draughts of water where nothing is said of the depth


@dataclass(frozen=True)
class Noise:
    """
    Sizes of what is random; pairs are (standard deviation, correlation time).

    Attributes
    ----------
    log_m_s, position_m
        White.
    log_colour, position_colour
        Slow, [m/s] and [m].
    gust
        Force along the ship, by the speed [m/s] that it makes of steady sailing.
    water
        Slow current [m/s], along and across.
    wander
        Of the heading [rad].
    log_quantum_m_s, position_quantum_m
        Readings are multiples of it.
    outliers
        Share of readings of log and position.
    """

    log_m_s: float
    position_m: float
    log_colour: tuple[float, float]
    position_colour: tuple[float, float]
    gust: tuple[float, float]
    water: tuple[float, float]
    wander: tuple[float, float]
    log_quantum_m_s: float
    position_quantum_m: float
    outliers: float


@dataclass(frozen=True)
class Series:
    """
    Readings of one input, in order of arrival.

    Attributes
    ----------
    stamp_ns, receive_ns : (n,)
    value : (n, 2)
        SI; an unused column is 0.
    """

    stamp_ns: Int
    receive_ns: Int
    value: Array


Recording = Mapping[str, Series]


def draw_noise(rng: np.random.Generator) -> Noise:
    """
    Draw the sizes of what is random in a case.
    """

    def between(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    return Noise(
        log_m_s=between(0.02, 0.06),
        position_m=between(4.0, 12.0),
        log_colour=(between(0.005, 0.02), between(20.0, 90.0)),
        position_colour=(between(2.0, 6.0), between(30.0, 120.0)),
        gust=(between(0.01, 0.03), between(60.0, 300.0)),
        water=(between(0.01, 0.025), between(600.0, 1500.0)),
        wander=(between(0.005, 0.02), between(40.0, 100.0)),
        log_quantum_m_s=float(rng.choice([0.01, 0.0257, 0.0514])),
        position_quantum_m=float(rng.choice([0.1, 1.0])),
        outliers=between(0.002, 0.01),
    )


def disturb(leg: Leg, noise: Noise, heading_rad: float, rng: np.random.Generator) -> Disturbance:
    """
    Draw gusts, slow current and wander of one run.
    """
    time = times(leg)
    gust = gust_m_s2(leg, noise) * _slow(time, noise.gust[1], rng)
    along, across = (noise.water[0] * _slow(time, noise.water[1], rng) for _ in range(2))
    sine, cosine = np.sin(heading_rad), np.cos(heading_rad)
    water = np.column_stack([along * cosine - across * sine, along * sine + across * cosine])
    return Disturbance(gust, water, noise.wander[0] * _slow(time, noise.wander[1], rng))


def gust_m_s2(leg: Leg, noise: Noise) -> float:
    """
    Return the standard deviation of the force over the mass.
    """
    hull, speed_sd = leg.hull, noise.gust[0]
    speeds = leg.speed_m_s * np.array([0.99, 1.01])
    damping = float(np.diff(hull.still_n(speeds))[0] / (0.02 * leg.speed_m_s) / hull.mass_kg)
    return speed_sd * float(np.sqrt(damping * (damping + 1.0 / noise.gust[1])))


@dataclass(frozen=True)
class Scene:
    """
    What a sensor is in the middle of.

    Attributes
    ----------
    motion, leg, effects, noise
    heading_rad
        Of this run, for where the radar mark is.
    rng
        Source of random numbers; no input depends on another.
    """

    motion: Motion
    leg: Leg
    effects: tuple[Effect, ...]
    noise: Noise
    heading_rad: float
    rng: np.random.Generator


def read(name: str, scene: Scene, number: int) -> Series:
    """
    Read an input of a run; its number counts from 0, the later the later.
    """
    start_ns = START_NS + number * BETWEEN_RUNS_NS
    rng, motion = scene.rng, scene.motion
    every = _EVERY_S.get(name, 1.0)
    time = np.arange(-LEAD_IN_S + rng.uniform(0.0, every), scene.leg.duration_s, every)
    time = time + rng.normal(0.0, 0.01 * every, len(time))
    time = np.clip(time, motion.time_s[0], motion.time_s[-1])
    value = _SENSORS[name](scene, time)
    keep = _kept(time, rng)
    late = 0.0
    if name == 'speed_through_water':
        late = sum(effect.log_delay_s() for effect in scene.effects)
    stamp = start_ns + _nanoseconds(time + late + LEAD_IN_S)
    # a stamp may not lie ahead of its arrival
    receive = start_ns + _nanoseconds(time + max(late, 0.0) + LEAD_IN_S + rng.uniform(0.05, 0.3))
    return Series(stamp[keep], receive[keep], value[keep])


def _log(scene: Scene, time: Array) -> Array:
    speed = np.interp(time, scene.motion.time_s, scene.motion.surge_m_s)
    for effect in scene.effects:
        speed = effect.log(scene.leg, time, speed)
    sd, colour_s = scene.noise.log_colour
    speed = (
        speed
        + scene.rng.normal(0.0, scene.noise.log_m_s, len(time))
        + sd * _slow(time, colour_s, scene.rng)
    )
    wrong = scene.rng.random(len(time)) < scene.noise.outliers
    speed = np.where(wrong, speed * scene.rng.uniform(0.4, 1.6, len(time)), speed)
    return _columns(_rounded(speed, scene.noise.log_quantum_m_s))


def _position(scene: Scene, time: Array) -> Array:
    place = np.column_stack(
        [np.interp(time, scene.motion.time_s, scene.motion.position_m[:, k]) for k in range(2)]
    )
    # the mark lies ahead of where she stops, and to one side
    bearing = scene.heading_rad + scene.rng.uniform(0.1, 0.5) * scene.rng.choice([-1.0, 1.0])
    distance = (
        scene.leg.speed_m_s * (LEAD_IN_S + scene.leg.duration_s) * scene.rng.uniform(1.1, 1.4)
    )
    place = place - distance * np.array([np.cos(bearing), np.sin(bearing)])
    for effect in scene.effects:
        place = effect.radar(scene.leg, time, place)
    sd, colour_s = scene.noise.position_colour
    wrong = scene.rng.random(len(time)) < scene.noise.outliers
    for k in range(2):
        place[:, k] += scene.noise.position_m * scene.rng.standard_normal(len(time))
        place[:, k] += sd * _slow(time, colour_s, scene.rng)
        place[:, k] += wrong * scene.rng.uniform(-300.0, 300.0, len(time))
    return _rounded(place, scene.noise.position_quantum_m)


def _heading(scene: Scene, time: Array) -> Array:
    yaw = np.interp(time, scene.motion.time_s, scene.motion.heading_rad)
    yaw = yaw + scene.rng.normal(0.0, 0.005) + scene.rng.normal(0.0, 0.005, len(time))
    return _columns(np.arctan2(np.sin(yaw), np.cos(yaw)))


def _shaft(scene: Scene, time: Array) -> Array:
    rate = np.interp(time, scene.motion.time_s, scene.motion.shaft_rad_s)
    return _columns(rate + scene.rng.normal(0.0, 0.02, len(time)))


def _depth(scene: Scene, time: Array) -> Array:
    stated = [depth for effect in scene.effects if (depth := effect.depth_m()) is not None]
    depth = stated[0] if stated else _DEEP * scene.leg.hull.draught_m
    depth = depth * (1.0 + 0.005 * _slow(time, 200.0, scene.rng))
    return _columns(depth + scene.rng.normal(0.0, 0.1, len(time)))


def _wind(scene: Scene, time: Array) -> Array:
    true = np.array([effect.wind_m_s() for effect in scene.effects] or [(0.0, 0.0)]).sum(axis=0)
    over_ground = [
        np.gradient(scene.motion.position_m[:, k], scene.motion.time_s) for k in range(2)
    ]
    yaw = scene.motion.heading_rad
    ahead = over_ground[0] * np.cos(yaw) + over_ground[1] * np.sin(yaw)
    to_port = over_ground[1] * np.cos(yaw) - over_ground[0] * np.sin(yaw)
    gusts = np.column_stack([0.4 * _slow(time, 60.0, scene.rng) for _ in range(2)])
    # air from ahead flows aft, air from port flows to starboard
    air = np.column_stack(
        [
            -np.interp(time, scene.motion.time_s, ahead) - scene.leg.sign * true[0],
            -np.interp(time, scene.motion.time_s, to_port) - scene.leg.sign * true[1],
        ]
    )
    return (
        (1.0 + scene.rng.normal(0.0, 0.03)) * air + gusts + scene.rng.normal(0.0, 0.3, air.shape)
    )


_SENSORS = {
    'speed_through_water': _log,
    'position': _position,
    'heading': _heading,
    'shaft': _shaft,
    'depth': _depth,
    'wind_apparent': _wind,
}


def _slow(time: Array, correlation_s: float, rng: np.random.Generator) -> Array:
    """Draw a first-order Gauss-Markov process of variance 1, on a grid of its own."""
    step = correlation_s / 20.0
    n = int((time[-1] - time[0]) / step) + 3
    keep = np.exp(-1.0 / 20.0)
    white = rng.standard_normal(n)
    white[1:] *= np.sqrt(1.0 - keep**2)
    values = lfilter([1.0], [1.0, -keep], white)
    return np.interp(time, time[0] + step * np.arange(n), values)


def _kept(time: Array, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Drop single readings, and all readings for a while now and then."""
    keep = rng.random(len(time)) > 0.01
    for _ in range(int(rng.integers(0, 4))):
        start = rng.uniform(time[0], time[-1])
        keep &= (time < start) | (time > start + rng.uniform(5.0, 40.0))
    return keep


def _rounded(value: Array, quantum: float) -> Array:
    return np.round(value / quantum) * quantum


def _columns(value: Array) -> Array:
    return np.column_stack([value, np.zeros_like(value)])


def _nanoseconds(time_s: Array) -> Int:
    return np.round(time_s * 1e9).astype(np.int64)
