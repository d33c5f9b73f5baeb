# SPDX-License-Identifier: Apache-2.0
"""Wind, waves and currents, as records of one second made from spectra."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.worlds.propulsion.hull import GRAVITY_M_S2, WATER_KG_M3, Hull, air_drag
from benchmarks.worlds.propulsion.motion import Float64, Surroundings


@dataclass(frozen=True)
class Sea:
    """
    Wind [m/s], significant wave height off a 130 m ship [m], currents [m/s], yaw [rad].
    """

    name: str
    wind_m_s: float
    height_m: float
    current_m_s: float
    eddies_m_s: float
    yaw_rad: float


SEAS = {
    sea.name: sea
    for sea in (
        Sea('calm', 2.0, 0.25, 0.05, 0.010, 0.006),
        Sea('moderate', 7.0, 1.2, 0.15, 0.025, 0.012),
        Sea('rough', 12.0, 2.6, 0.30, 0.050, 0.025),
    )
}
TURBULENCE = 0.13


def coloured(random: np.random.Generator, n: int, shape: Float64) -> Float64:
    """
    Return n values of unit variance whose spectrum goes as `shape` at `frequencies(n)`.
    """
    bins = len(shape)
    white = random.standard_normal(bins) + 1j * random.standard_normal(bins)
    values = np.fft.irfft(white * np.sqrt(shape))[:n]
    expected = np.sqrt(np.sum(shape[1:]) * 4.0) / (2 * (bins - 1))
    return np.asarray(values / expected)


def frequencies(n: int, step_s: float = 1.0) -> Float64:
    """
    Return the frequencies [Hz] for `coloured`, of a record of at least n values.
    """
    even = 2 ** int(np.ceil(np.log2(max(n, 64))))
    return np.fft.rfftfreq(even, step_s)


@dataclass(frozen=True)
class Weather:
    """
    What stays of a sea when gusts and groups are left out.

    Attributes
    ----------
    wind_m_s, head
        Mean wind, and how much of it comes from ahead (-1..1).
    waves_n
        Mean drag of the waves.
    """

    wind_m_s: float
    head: float
    waves_n: float

    def drag_n(self, hull: Hull, speed_m_s: float) -> float:
        """
        Return mean drag of wind and waves beyond the still air's [N].
        """
        blown = air_drag(speed_m_s + self.wind_m_s * self.head, hull.air_area_m2)
        return float(blown - air_drag(speed_m_s, hull.air_area_m2) + self.waves_n)


@dataclass(frozen=True)
class Waves:
    """
    What ship and log feel of single waves.

    Attributes
    ----------
    orbital_m_s, surge_m_s
        Sd of the water's motion at the log, and of the ship's.
    encounter_hz
        At half the speed at which the ship sails.
    """

    orbital_m_s: float
    surge_m_s: float
    encounter_hz: float


def waves(hull: Hull, sea: Sea, head: float, speed_m_s: float) -> Waves:
    """
    Single waves on a ship; `head` is 1 for waves from ahead, -1 from astern.
    """
    height = wave_height(hull, sea)
    period = 4.2 * np.sqrt(height) + 1.5
    omega = 2 * np.pi / period
    number = omega**2 / GRAVITY_M_S2
    depth = np.exp(-number * hull.draught_m)
    orbital = 0.6 * height / 4.0 * omega * depth
    # a ship much longer than the wave does not answer it
    answer = 0.6 / (1.0 + (0.5 * number * hull.length_m / np.pi) ** 2)
    encounter = abs(omega + number * head * 0.5 * speed_m_s) / (2 * np.pi)
    return Waves(float(orbital), float(orbital * answer), float(max(encounter, 0.02)))


def wave_height(hull: Hull, sea: Sea) -> float:
    """
    Return the height [m] that a ship of this length goes out in.
    """
    return float(sea.height_m * min(1.0, np.sqrt(hull.length_m / 130.0)))


def surroundings(
    hull: Hull, sea: Sea, course: float, seconds: int, random: np.random.Generator
) -> tuple[Surroundings, Weather]:
    """
    Draw a sea, a value each second, and what stays of it.
    """
    hertz = frequencies(seconds)
    kaimal = 1.0 / (1.0 + (hertz / 0.008) ** (5.0 / 3.0))
    kaimal[0] = 0.0
    comes_from = random.uniform(-np.pi, np.pi)
    head = float(np.cos(comes_from - course))
    mean = sea.wind_m_s * random.uniform(0.7, 1.3)
    gust = mean + TURBULENCE * mean * coloured(random, seconds, kaimal)
    wind = -np.outer([np.cos(comes_from), np.sin(comes_from)], gust)
    height = wave_height(hull, sea)
    added = 0.12 * WATER_KG_M3 * GRAVITY_M_S2 * height**2 * hull.breadth_m**2 / hull.length_m
    added *= 0.15 + 0.85 * (1.0 + head) / 2.0
    groups = np.where(hertz > 0, np.exp(-((hertz / 0.012) ** 2)), 0.0)
    push = added * (1.0 + 0.35 * coloured(random, seconds, groups))
    eddies = np.where(hertz > 0, 1.0 / (1.0 + (hertz * 2 * np.pi * 900.0) ** 2), 0.0)
    angle = random.uniform(-np.pi, np.pi)
    steady = sea.current_m_s * np.array([[np.cos(angle)], [np.sin(angle)]])
    moving = np.array([coloured(random, seconds, eddies) for _ in range(2)])
    current = steady + sea.eddies_m_s * moving
    helm = np.where(hertz > 0, np.exp(-(((hertz - 0.012) / 0.008) ** 2)), 0.0)
    wander = sea.yaw_rad * 2 * np.pi * 0.012 * coloured(random, seconds, helm)
    return Surroundings(wind, push, current, np.ones(seconds), wander), Weather(
        mean, head, float(added)
    )
