# SPDX-License-Identifier: Apache-2.0
"""Compiles what a coastdown needs before there is one."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.coastdown.monitor import Monitor
from shipdrag_ros.compiled import compile_all
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import SECOND_NS, Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship

_STEADY_S, _COAST_S = 300, 400
_UPDATE_S = 150.0  # one estimate shows what all of them call
_SPEED_M_S = 8.0
_SLOWING_1_S = 0.003  # speed over speed falls by so much a second
_START_NS = 1_700_000_000 * SECOND_NS


def warm(parameters: Parameters) -> None:
    """
    Compile what a monitor calls; about a minute of one core on the first start of a machine.

    Parameters
    ----------
    parameters
        Whose estimator will be used.

    Notes
    -----
    A small made-up coastdown goes through a monitor of its own: the functions that it calls are
    those that a real one calls.
    """
    compile_all()
    ship = Ship(length_m=150.0, displaced_volume_m3=20200.0)
    few = Parameters(estimator=parameters.estimator, update_s=_UPDATE_S)
    monitor = Monitor(ship, few)
    monitor.update(_coastdown())
    monitor.doubts()
    monitor.finish()
    compile_all()  # of the estimators, which were imported just now


def _coastdown() -> Block:
    """Readings of all instruments, one a second."""
    time_s = np.arange(-_STEADY_S, _COAST_S, 1.0)
    coasting_s = np.maximum(time_s, 0.0)
    rng = np.random.default_rng(0)
    slowed = 1.0 + _SLOWING_1_S * coasting_s
    speed = _SPEED_M_S / slowed
    distance = np.where(
        time_s < 0.0, _SPEED_M_S * time_s, _SPEED_M_S / _SLOWING_1_S * np.log(slowed)
    )
    track = np.column_stack([distance, 0.0 * distance])
    zero = np.zeros(len(time_s))
    wind = np.column_stack([-speed, zero])
    readings = {
        Channel.SPEED_THROUGH_WATER: speed + 0.02 * rng.standard_normal(len(time_s)),
        Channel.SPEED_OVER_GROUND: speed + 0.02 * rng.standard_normal(len(time_s)),
        Channel.POSITION: track + 0.5 * rng.standard_normal(track.shape),
        Channel.HEADING: 0.002 * rng.standard_normal(len(time_s)),
        Channel.SHAFT: np.where(time_s < 0.0, 10.0, 0.0),
        Channel.RUDDER: zero,
        Channel.WIND_APPARENT: wind,
        Channel.DEPTH: zero + 500.0,
    }
    stamp_ns = _START_NS + np.round((time_s + _STEADY_S) * SECOND_NS).astype(np.int64)
    return in_arrival_order(
        [Block.of(channel, stamp_ns, value) for channel, value in readings.items()]
    )
