# SPDX-License-Identifier: Apache-2.0
"""
Wind, water and swell, as sums of sinusoids.

Gusts have the spectrum of von Karman or of Davenport; the tide is an ellipse of 12.4 h; eddies
of some minutes to an hour are met in place, so that the ship lags behind them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.worlds.hidden_b.hulls import GRAVITY, Array

LUNAR_S = 44_714.0


@dataclass(frozen=True)
class Sinusoids:
    """
    A sum of sinusoids: amplitudes, angular frequencies and phases.
    """

    size: Array
    omega: Array
    phase: Array

    def at(self, t: Array) -> Array:
        """
        Return the values at times [s].
        """
        found = np.zeros(np.shape(t))
        for size, omega, phase in zip(self.size, self.omega, self.phase, strict=True):
            found += size * np.cos(omega * np.asarray(t) + phase)
        return found

    def rate(self, t: Array) -> Array:
        """
        Return the derivative at times [s].
        """
        found = np.zeros(np.shape(t))
        for size, omega, phase in zip(self.size, self.omega, self.phase, strict=True):
            found -= size * omega * np.sin(omega * np.asarray(t) + phase)
        return found


def band(rng: np.random.Generator, sd: float, short_s: float, long_s: float, n: int) -> Sinusoids:
    """
    Draw sinusoids of equal power per octave between two periods.
    """
    edge = np.geomspace(1.0 / long_s, 1.0 / short_s, n + 1)
    f = np.exp(rng.uniform(np.log(edge[:-1]), np.log(edge[1:])))
    size = sd * np.sqrt(2.0 / n) * np.sqrt(rng.exponential(1.0, n))
    return Sinusoids(size, 2 * np.pi * f, rng.uniform(0, 2 * np.pi, n))


def gusts(
    rng: np.random.Generator, law: str, mean_m_s: float, height_m: float, sd: float
) -> Sinusoids:
    """
    Draw the gusts of a wind.

    Parameters
    ----------
    rng
    law
        `karman` or `davenport`.
    mean_m_s, height_m
        Of the wind that blows past, for the time scale.
    sd
        Of the gusts [m/s].
    """
    wind = max(mean_m_s, 2.0)
    edge = np.geomspace(1.0 / 2500.0, 0.2, 49)
    f = np.exp(rng.uniform(np.log(edge[:-1]), np.log(edge[1:])))
    if law == 'karman':
        x = f * 25.0 * max(height_m, 3.0) ** 0.35 * 2.0 / wind
        spectrum = (x / f) / (1.0 + 70.8 * x**2) ** (5.0 / 6.0)
    else:
        x = 1200.0 * f / wind
        spectrum = x**2 / f / (1.0 + x**2) ** (4.0 / 3.0)
    power = spectrum * np.diff(edge)
    size = sd * np.sqrt(2.0 * power / power.sum())
    return Sinusoids(size, 2 * np.pi * f, rng.uniform(0, 2 * np.pi, len(f)))


@dataclass(frozen=True)
class Weather:
    """
    What always blows, flows and rolls, in a frame fixed to the ground (x east, y north).

    Attributes
    ----------
    wind
        Mean velocity of the air [m/s].
    gust_share
        Of the gusts in the mean wind, beside `gust_least` [m/s].
    flow
        Steady current [m/s].
    tide
        Amplitude along x and y [m/s], and phase [rad].
    eddies
        Of the water, met in place, along x and y.
    swell_m, swell_s
        Amplitude and period.
    """

    law: str
    wind: tuple[float, float]
    gust_share: float
    gust_least: float
    flow: tuple[float, float]
    tide: tuple[float, float, float]
    eddies: tuple[Sinusoids, Sinusoids]
    swell_m: float
    swell_s: float

    def current(self, t: Array) -> Array:
        """
        Return the velocity of the water at times of the day, eddies apart: (n, 2).
        """
        turn = np.cos(2 * np.pi * np.asarray(t) / LUNAR_S + self.tide[2])
        return np.stack([self.flow[k] + self.tide[k] * turn for k in (0, 1)], axis=-1)

    def orbital(self, depth_m: float) -> float:
        """
        Return the amplitude of the orbital velocity of the swell at a depth [m/s].
        """
        omega = 2 * np.pi / self.swell_s
        return self.swell_m * omega * float(np.exp(-(omega**2) / GRAVITY * depth_m))


def draw_weather(rng: np.random.Generator, time_s: float, speed_m_s: float) -> Weather:
    """
    Draw a quiet day: light air, hardly a current, some swell.
    """
    wind, flow, tide = rng.uniform(0.2, 1.8), rng.uniform(0.0, 0.012), rng.uniform(0.0, 0.015)
    a, b, c = rng.uniform(0, 2 * np.pi, 3)
    long_s = float(np.clip(4.0 * time_s, 300.0, 3600.0))
    sd = speed_m_s * 10 ** rng.uniform(-3.4, -2.6)
    eddies = tuple(band(rng, sd, long_s / 12.0, long_s, 14) for _ in range(2))
    return Weather(
        law=str(rng.choice(['karman', 'davenport'])),
        wind=(wind * np.cos(a), wind * np.sin(a)),
        gust_share=rng.uniform(0.12, 0.25),
        gust_least=rng.uniform(0.1, 0.35),
        flow=(flow * speed_m_s * np.cos(b) / 3, flow * speed_m_s * np.sin(b) / 3),
        tide=(tide * np.cos(c), tide * np.sin(c), rng.uniform(0, 2 * np.pi)),
        eddies=(eddies[0], eddies[1]),
        swell_m=10 ** rng.uniform(-1.5, -0.5) * (1.0 if time_s > 100.0 else 0.4),
        swell_s=rng.uniform(5.0, 13.0),
    )
