# SPDX-License-Identifier: Apache-2.0
"""
Settings of the noise: a size and a correlation time of each slow source, and what else varies.

What is known of the noise of a record is a handful of settings with their probabilities.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.noise import GaussMarkovNoise, Noise
from shipdrag_ros.inference.rows import KIND_COUNT, Rows
from shipdrag_ros.samples import Float64

# Parameters of a setting, all logarithms: size and time of gust, water, log, place; factors of
# the white sd of each input; hold of the engine.
SOURCES = 4
WHITE_OF = 2 * SOURCES
HOLD = WHITE_OF + KIND_COUNT
SIZE = HOLD + 1


class Settings(NamedTuple):
    """
    Choices of all sizes, with their probabilities; the most probable first.

    Attributes
    ----------
    slow : (s, 8)
        Fields of `GaussMarkovNoise`.
    white : (s, 3)
        Factor of the white standard deviation of each input.
    hold : (s,)
        Of the damping before the stop, over that of the hull.
    weight : (s,)
        Summing to 1.
    """

    slow: Float64
    white: Float64
    hold: Float64
    weight: Float64


@compiled
def noise_of(settings: Settings, which: int, rows: Rows, white: Noise, steady: int) -> Noise:
    """
    Return the noise of rows in a setting.

    Parameters
    ----------
    settings, which
    rows
    white
        As samples show it, and how the hull damps.
    steady
        How many of the rows are before the stop.
    """
    n = len(rows.kind)
    variance, damping = np.empty(n), white.damping_1_s.copy()
    for i in range(n):
        variance[i] = white.variance[i] * settings.white[which, rows.kind[i] % KIND_COUNT] ** 2
    for i in range(steady):
        damping[i] *= settings.hold[which]
    s = settings.slow[which]
    slow = GaussMarkovNoise(s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7])
    return Noise(variance, slow, damping, white.inertia)


@dataclass(frozen=True)
class NoisePosterior:
    """
    What is known of the noise of a record.

    Attributes
    ----------
    settings
    learnt
        False where nothing could be learnt: these are the settings of the prior.
    """

    settings: Settings
    learnt: bool

    @property
    def typical(self) -> Settings:
        """The one setting that comes nearest to all: mean squares of sizes, middle times."""
        weight = self.settings.weight
        slow = np.empty(2 * SOURCES)
        slow[::2] = np.sqrt(weight @ self.settings.slow[:, ::2] ** 2)
        slow[1::2] = np.exp(weight @ np.log(self.settings.slow[:, 1::2]))
        return Settings(
            slow[None],
            np.sqrt(weight @ self.settings.white**2)[None],
            np.exp(weight @ np.log(self.settings.hold))[None],
            np.ones(1),
        )

    @property
    def slow(self) -> GaussMarkovNoise:
        """Sizes and times of the typical setting."""
        return GaussMarkovNoise(*self.typical.slow[0].tolist())
