# SPDX-License-Identifier: Apache-2.0
"""Values at times, and their means without outliers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.estimation.window import Series
from shipdrag_ros.inference.robust import MAD_TO_SD
from shipdrag_ros.inference.rows import bin_means
from shipdrag_ros.samples import Float64

_OUTLIER = 5.0  # robust standard deviations


@dataclass(frozen=True)
class Timed:
    """Values at times from the start of the record [s]; places are complex."""

    time_s: Float64
    value: np.ndarray[tuple[int], np.dtype[np.float64 | np.complex128]]

    @classmethod
    def of(cls, series: Series, start_ns: int) -> Timed:
        """Count the times of a series from a start [ns since the epoch]."""
        value = series.value
        flat = value if value.ndim == 1 else value[:, 0] + 1j * value[:, 1]
        return cls(np.asarray((series.time_ns - start_ns) * 1e-9, np.float64), flat)

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def step_s(self) -> float:
        """The usual time between samples."""
        return max(float(np.median(np.diff(self.time_s))), 1e-3)

    def part(self, start_s: float, end_s: float) -> Timed:
        """Return the samples between two times."""
        first, last = np.searchsorted(self.time_s, (start_s, end_s))
        return Timed(self.time_s[first:last], self.value[first:last])

    def means(self, middle_s: float) -> tuple[float, float, float]:
        """Return the mean of all, and of each half, without outliers."""
        value = np.asarray(self.value, np.float64)
        away = np.abs(value - np.median(value))
        keep = away <= _OUTLIER * MAD_TO_SD * np.median(away) + 0.05 * abs(np.median(value))
        edges = np.array([-np.inf, middle_s, np.inf])
        halves = bin_means(self.time_s[keep], value[keep], edges)[1]
        return float(value[keep].mean()), float(halves[0]), float(halves[-1])

    def at(self, time_s: float) -> complex:
        """Return the value on a line through all, without outliers; NaN where they are few."""
        after, value = self.time_s - time_s, np.asarray(self.value, np.complex128)
        for _ in range(2):
            if len(after) < 3 or after[0] > 0.0 or after[-1] < 0.0:
                return complex(math.nan)
            line = np.polynomial.polynomial.polyfit(after, np.array([value.real, value.imag]).T, 1)
            place = complex(line[0, 0], line[0, 1])
            away = np.abs(value - place - after * complex(line[1, 0], line[1, 1]))
            keep = away <= _OUTLIER * np.median(away) + 1e-9
            after, value = after[keep], value[keep]
        return place
