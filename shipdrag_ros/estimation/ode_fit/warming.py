# SPDX-License-Identifier: Apache-2.0
"""Compiles the fit before it is needed."""

from __future__ import annotations

from functools import cache

import numpy as np

from shipdrag_ros.estimation.ode_fit.estimate import estimate
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, concatenate
from shipdrag_ros.ship import Ship

_STEADY_S, _COAST_S, _STEP_S = 400.0, 300.0, 5.0


@cache
def warm() -> None:
    """
    Fit a small made-up coastdown, so that no real one waits for a compiler.
    """
    time_s = np.arange(-_STEADY_S, _COAST_S, _STEP_S)
    coasting = np.maximum(time_s, 0.0)
    rng = np.random.default_rng(0)
    speed = 8.0 / (1.0 + 0.003 * coasting) + 0.05 * rng.standard_normal(len(time_s))
    distance = np.where(time_s < 0.0, 8.0 * time_s, 8.0 / 0.003 * np.log1p(0.003 * coasting))
    track = np.column_stack([distance, 0.0 * distance]) + rng.standard_normal((len(time_s), 2))
    stamps = np.round((time_s + _STEADY_S) * 1e9).astype(np.int64)
    block = concatenate(
        [
            Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed),
            Block.of(Channel.POSITION, stamps, track),
        ]
    )
    start_ns = round(_STEADY_S * 1e9)
    window = Window.from_block(block, start_ns, int(stamps[-1]), before_ns=0)
    estimate(window, Ship(length_m=150.0, displaced_volume_m3=20200.0), Parameters())
