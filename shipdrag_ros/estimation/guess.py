# SPDX-License-Identifier: Apache-2.0
"""A crude answer to start a fit from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.steady import block_medians
from shipdrag_ros.inference.rows import KIND_COUNT, POSITION, Rows
from shipdrag_ros.samples import Float64

_LEAST_LOSS = 1e-3  # of the speed over the window: less is rounding
_ABOVE = 1.05  # of the highest median: she was hardly faster
_BLOCKS, _BLOCKS_OF_SPEED = 12, 48  # whose medians outliers do not reach


@dataclass(frozen=True)
class InitialGuess:
    """
    Purely quadratic drag.

    Attributes
    ----------
    speed_m_s
        At time 0.
    quadratic_1_m
        r / v^2.
    lowest
        Speed at the end over that at the start.
    seen : (2, b)
        Times and median speeds of parts of the record.
    """

    speed_m_s: float
    quadratic_1_m: float
    lowest: float
    seen: Float64

    @classmethod
    def of(cls, coast: Rows, n_r: float) -> InitialGuess:
        """
        Fit a line through 1/v.

        Raises
        ------
        EstimationError
            If the ship does not slow down.
        """
        code = min(np.unique(coast.kind).tolist(), key=lambda code: (code % KIND_COUNT, code))
        kind, chosen = code % KIND_COUNT, coast.kind == code
        time_s, value = coast.time_s[chosen], coast.value[chosen]
        blocks = _BLOCKS if kind == POSITION else _BLOCKS_OF_SPEED
        count = min(blocks, len(time_s) // 4)
        edges = np.linspace(0.0, len(time_s), count + 1).astype(np.int64)
        when, speed = block_medians(time_s, edges), block_medians(value, edges)
        if kind == POSITION:
            speed = np.diff(speed) / np.diff(when)
            when = 0.5 * (when[1:] + when[:-1])
        top = float(speed.max())
        if not top > 0.0:
            raise EstimationError(
                f'the speed in the window is {top:.3g} m/s at most: give a window that lies in '
                'a coastdown'
            )
        inverse = 1.0 / np.maximum(speed, 0.05 * top)
        # 1/v = 1/v0 + c t / (1 + n_r); relative errors of v count alike
        weight = 1.0 / inverse**2
        mean_t, mean = np.average(when, weights=weight), np.average(inverse, weights=weight)
        t = when - mean_t
        slope = float((weight * t * (inverse - mean)).sum() / (weight * t * t).sum())
        if not slope * float(np.ptp(time_s)) > _LEAST_LOSS * mean:
            raise EstimationError(
                f'no deceleration in {np.ptp(time_s):.4g} s: give a longer window, or one after '
                'the engine stop'
            )
        first = mean - slope * mean_t
        v0 = min(1.0 / first, _ABOVE * top) if first > 0.0 else _ABOVE * top
        return cls(
            float(v0),
            slope * (1.0 + n_r),
            float(np.clip(speed[-1] / v0, 0.05, 0.9)),
            np.stack([when, speed]),
        )
