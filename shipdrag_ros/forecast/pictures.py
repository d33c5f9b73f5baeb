# SPDX-License-Identifier: Apache-2.0
"""A forecast drawn."""

from __future__ import annotations

from matplotlib.axes import Axes

from shipdrag_ros.forecast.result import Forecast
from shipdrag_ros.samples import SECOND_NS


def draw_forecast(axis: Axes, forecast: Forecast, stop_ns: int, unit_m_s: float) -> None:
    """
    Draw the speed to come and its band of 90 %.

    Parameters
    ----------
    axis
    forecast
    stop_ns
        From which the time counts [ns].
    unit_m_s
        In which the speed is shown.
    """
    made_s = (forecast.made_ns - stop_ns) / SECOND_NS
    time, speed, low, high, *_ = forecast.in_time().T
    minutes = (time + made_s) / 60.0
    (line,) = axis.plot(minutes, speed / unit_m_s, label=f'foretold after {made_s:.0f} s')
    axis.fill_between(
        minutes, low / unit_m_s, high / unit_m_s, color=line.get_color(), alpha=0.2, lw=0.0
    )
