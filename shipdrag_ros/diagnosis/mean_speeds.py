# SPDX-License-Identifier: Apache-2.0
"""A coastdown as means of the speed over short times, where no baseline is stated."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.diagnosis.diagnose import CoastRun
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.estimation.ode_fit.steady import white_sd
from shipdrag_ros.inference.rows import bin_means
from shipdrag_ros.samples import Float64

_BINS, _LEAST_ROWS = 150, 20


@dataclass(frozen=True)
class MeanSpeeds:
    """
    A coastdown, averaged over bins.

    Attributes
    ----------
    time_s, speed_m_s, white_sd_m_s : (n,)
        From the start of the window; the first is where the speed is highest.
    heading_rad
        NaN where it is not known.
    swing_rad
        Of the heading during the run; 0 where it is not known.
    """

    by_log: bool
    time_s: Float64
    speed_m_s: Float64
    white_sd_m_s: Float64
    heading_rad: float
    swing_rad: float

    @property
    def duration_s(self) -> float:
        """Time from the highest speed to the end."""
        return float(self.time_s[-1] - self.time_s[0])

    @classmethod
    def of(cls, run: CoastRun) -> MeanSpeeds:
        """
        Average a run from its highest speed on.

        Raises
        ------
        DiagnosisError
            If there are too few speeds, or none ahead.
        """
        window = run.window
        by_log = len(window.speed_through_water) >= 2 * _LEAST_ROWS
        series = window.speed_through_water if by_log else window.speed_over_ground
        if len(series) < 2 * _LEAST_ROWS:
            raise DiagnosisError(
                f'{run.name}: {len(series)} speeds in the coastdown, and the ship file has no '
                f'baseline; to fit one, at least {2 * _LEAST_ROWS} speeds through water or over '
                'ground are needed: give a record with a speed, or a ship file with `baseline`'
            )
        time = np.asarray((series.time_ns - window.start_ns) * 1e-9, np.float64)
        edges = np.linspace(time[0], time[-1] + 1e-6, min(_BINS, len(time) // 2) + 1)[1:]
        when, mean, count = bin_means(time, series.value, edges)
        top = int(np.argmax(mean))  # until then the thrust has not run down
        yaw = window.heading.value
        if not mean[top] > 0.0:
            raise DiagnosisError(
                f'{run.name}: the speed is never above 0: give a record of a ship under way ahead'
            )
        if len(mean) - top < _LEAST_ROWS:
            raise DiagnosisError(
                f'{run.name}: the speed is highest {when[top]:.0f} s after the begin and there '
                'is too little after it: give a record that begins at the stop'
            )
        return cls(
            by_log,
            when[top:],
            mean[top:],
            (max(white_sd(series.value), 1e-4 * float(mean[top])) / np.sqrt(count))[top:],
            float(np.angle(np.exp(1j * yaw).mean())) if len(yaw) else math.nan,
            float(np.ptp(np.unwrap(yaw))) if len(yaw) else 0.0,
        )
