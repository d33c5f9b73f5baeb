# SPDX-License-Identifier: Apache-2.0
"""What instruments with faults read of a speed."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import Float64
from shipdrag_ros.simulation.action import Action


def log_reading(action: Action, time_s: Float64, speed_m_s: Float64, at_s: Float64) -> Float64:
    """
    Return what the log reads.

    Parameters
    ----------
    action
        With the faults: dead band, scale, offset, lag and clock, in the order
        in which a log has them.
    time_s, speed_m_s : (n,)
        True speed through water, linear between and constant outside.
    at_s : (m,)
        Stamps of the readings.

    Returns
    -------
    (m,)
        [m/s]
    """
    flow = log_flow(speed_m_s, action.log_dead_band_m_s, action.log_factor, action.log_offset_m_s)
    if action.log_lag_s > 0.0:
        flow = lagged(time_s, flow, action.log_lag_s)
    reading: Float64 = np.interp(at_s - action.log_late_s, time_s, flow)
    return reading


def log_flow(
    speed_m_s: Float64,
    dead_band_m_s: float | Float64,
    factor: float | Float64,
    offset_m_s: float | Float64,
) -> Float64:
    """
    Return what a log without memory reads, of any shape [m/s].
    """
    band = np.broadcast_to(dead_band_m_s, speed_m_s.shape)
    magnitude = np.abs(speed_m_s)
    passed = np.divide(magnitude, band, out=np.ones_like(band), where=magnitude < band)
    reading: Float64 = (1.0 + factor) * passed * speed_m_s + offset_m_s
    return reading


@compiled
def lagged(time_s: Float64, value: Float64, lag_s: float) -> Float64:
    """
    Filter what is linear between times, exactly, from a steady start.

    Parameters
    ----------
    time_s, value : (n,)
        Ascending times [s], and what is filtered.
    lag_s
        Time constant of the first-order filter, more than 0.

    Returns
    -------
    (n,)
        What the filter shows at the times.
    """
    result = value.copy()
    for i in range(1, len(value)):
        step = time_s[i] - time_s[i - 1]
        behind = 0.0 if step == 0.0 else (value[i] - value[i - 1]) / step * lag_s
        excess = result[i - 1] - value[i - 1] + behind
        result[i] = value[i] - behind + excess * np.exp(-step / lag_s)
    return result
