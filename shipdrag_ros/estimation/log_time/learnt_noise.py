# SPDX-License-Identifier: Apache-2.0
"""
Slow disturbances of a coastdown, as the steady record before it shows them.

The coastdown itself cannot separate them from its own motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.estimation.log_time.inputs import Inputs
from shipdrag_ros.estimation.ode_fit.record import LEAST_STAMPS, RunRows
from shipdrag_ros.estimation.ode_fit.run_down import ONSET_SD_S, RunDown
from shipdrag_ros.estimation.ode_fit.steady import LEAST_S, condense, white_sd
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.inference.learning import learn, of_steady
from shipdrag_ros.inference.noise import GaussMarkovNoise, Noise, whiten
from shipdrag_ros.inference.rows import CODES, Input, Rows
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

_WAVES = 8  # of the steady record, slowest first, whose power is looked at
_BY_CHANCE = 2.0  # standard deviations of that power: less shows nothing slow
_LOST = 1e-6  # weight of a gross outlier, of a good sample's: none, but finite


@dataclass(frozen=True)
class LearntNoise:
    """
    What disturbs a coastdown slowly.

    Attributes
    ----------
    noise
        Gust force and wandering of the log.
    white_sd
        Noise of each input without the slow part, by name.
    coast_s, speed_m_s
        The quadratic coast v = v0 / (1 + t / tc), that damps the motion by a force.
    learnt_s
        Length of the steady record.
    """

    noise: GaussMarkovNoise
    white_sd: dict[str, float]
    coast_s: float
    speed_m_s: float
    learnt_s: float

    @classmethod
    def of(
        cls,
        window: Window,
        ship: Ship,
        parameters: Parameters,
        *,
        coast_s: float,
        speed_m_s: float,
    ) -> LearntNoise | None:
        """
        Learn from the record before a window; None where it shows nothing.
        """
        before = window.before
        if before is None or max(len(getattr(window, name)) for name in CODES) < LEAST_STAMPS:
            return None
        speed = before.speed_through_water
        if len(speed) >= LEAST_STAMPS and not _wanders(speed):
            return None
        record = RunRows.of(window, RunDown.of(window, ship), parameters)
        if record.steady_s < LEAST_S:
            return None
        # an onset found from the speed alone may be late
        keep = record.steady.time_s < -ONSET_SD_S
        steady = record.steady
        rows = Rows(steady.time_s[keep], steady.kind[keep], steady.value[keep])
        inertia = 1.0 + float(ship.n_r(speed_m_s))
        variance = record.steady_variance()[keep]
        learnt = learn(of_steady(rows, variance, 2.0 / coast_s, inertia), speed_m_s)
        if not learnt.learnt:
            return None
        # the nearest single setting: an average over all would cost each update ten times as much
        found = learnt.typical
        white = {input_.key: float(found.white[0, input_]) for input_ in Input}
        sizes = {name: sd * white[name] for name, sd in record.white_sd.items()}
        return cls(
            GaussMarkovNoise(*found.slow[0].tolist()), sizes, coast_s, speed_m_s, record.steady_s
        )

    @property
    def note(self) -> str:
        """What a reader must know."""
        return (
            f'slow disturbances, learnt from {self.learnt_s:.0f} s of steady record before the '
            'onset, are in the weights and in the band'
        )

    def whitened(
        self, rows: Float64, residual: Float64, weight: Float64, inputs: Inputs, ship: Ship
    ) -> tuple[Float64, Float64]:
        """
        Return columns and residual of which white noise of unit variance is left.

        Parameters
        ----------
        rows : (k, n)
        residual, weight : (n,)
            As the inputs; the weights say how much worse than others of its kind a
            sample is.
        """
        variance = np.empty(len(weight))
        for kind in inputs.used:
            part = inputs.part(kind)
            best = (weight[part] / inputs.stated[part]).max()
            white = self.white_sd.get(Input(kind).key, 1.0 / math.sqrt(best))
            variance[part] = white**2 / np.maximum(weight[part] / best, _LOST)
        order = np.argsort(inputs.time_s, kind='stable')
        time_s = inputs.time_s[order]
        rest_s = self.coast_s + time_s
        inertia = 1.0 + ship.n_r(self.speed_m_s * self.coast_s / rest_s)
        noise = Noise(variance[order], self.noise, 2.0 / rest_s, inertia)
        table = np.take(np.vstack([rows, residual]), order, axis=1)
        kinds = np.repeat(np.arange(len(Input)), inputs.count)[order]
        whiten(Rows(time_s, kinds, residual[order]), table, noise)
        return table[:-1], table[-1]


def _wanders(speed: Series) -> bool:
    """Say whether the slowest waves in means exceed what the noise of samples explains."""
    time_s = (speed.time_ns - speed.time_ns[0]) * 1e-9
    _, mean, count = condense(time_s, speed.value, np.ones(len(time_s)), 0.0)
    away = (mean - np.average(mean, weights=count)) * np.sqrt(count)
    bins = len(away)
    number = np.arange(1, min(_WAVES, bins - 1) + 1)
    waves = np.cos(np.pi / bins * np.outer(number, np.arange(bins) + 0.5))
    power = 2.0 / bins * float(((waves * away).sum(axis=1) ** 2).sum())
    limit = len(number) + _BY_CHANCE * math.sqrt(2.0 * len(number))
    return bool(power > limit * white_sd(speed.value) ** 2)
