# SPDX-License-Identifier: Apache-2.0
"""In which unit a column of speeds agrees with the way between the positions."""

from __future__ import annotations

import numpy as np

from shipdrag_ros.samples import Float64
from shipdrag_ros.sources.formats.csv.columns import SPEED_UNITS

_STEP_S = 10.0  # over which the way is measured: long against the scatter of a position
_MOVING_M_S = 0.4
_FEWEST = 10
_NEAR = 1.25  # two units differ by 1.7 and more; a current or a log by less than this
_SPREAD = 1.6  # of the middle half of the ratios


def track_speed(time_s: Float64, latitude: Float64, longitude: Float64) -> Float64:
    """
    Return (n,) speeds over ground [m/s] around each sample, from positions; NaN where none is.

    Parameters
    ----------
    time_s : (n,)
        Ascending where it can be used [s].
    latitude, longitude : (n,)
        [deg].
    """
    if not np.isfinite(latitude).any():
        return np.full(len(time_s), np.nan)
    radius_m = 6.371e6
    north = np.radians(latitude) * radius_m
    east = np.radians(longitude) * radius_m * np.cos(np.radians(np.nanmean(latitude)))
    return plane_speed(time_s, east, north)


def plane_speed(time_s: Float64, x: Float64, y: Float64) -> Float64:
    """
    Return (n,) speeds [m/s] around each sample, from (n,) positions [m].
    """
    speed = np.full(len(time_s), np.nan)
    good = np.flatnonzero(np.isfinite(time_s) & np.isfinite(x) & np.isfinite(y))
    good = (
        good[np.r_[True, np.diff(np.maximum.accumulate(time_s[good])) > 0.0]]
        if len(good)
        else good
    )
    if len(good) < 2:
        return speed
    time = time_s[good]
    ends = np.minimum(np.searchsorted(time, time + _STEP_S), len(good) - 1)
    length_s = time[ends] - time
    whole = (length_s >= 0.5 * _STEP_S) & (length_s <= 3.0 * _STEP_S)
    way = np.hypot(x[good][ends] - x[good], y[good][ends] - y[good])
    middle = good[(np.arange(len(good)) + ends)[whole] // 2]
    speed[middle] = way[whole] / length_s[whole]
    return speed


def unit_of(values: Float64, track_m_s: Float64, stated: str = '') -> str:
    """
    Return the unit in which values agree with speeds over ground; '' where none clearly does.

    Parameters
    ----------
    values : (n,)
        In an unknown unit.
    track_m_s : (n,)
        From `track_speed`.
    stated
        Unit that may be another than m/s, kn and km/h, which are looked for.
    """
    use = np.isfinite(values) & np.isfinite(track_m_s) & (values > 0.0)
    use &= track_m_s > _MOVING_M_S
    if use.sum() < _FEWEST:
        return ''
    ratio = values[use] / track_m_s[use]
    low, middle, high = np.quantile(ratio, [0.25, 0.5, 0.75])
    if high > _SPREAD * low:
        return ''
    units = dict.fromkeys(('m/s', 'kn', 'km/h', stated or 'm/s'))
    off = {unit: abs(np.log(middle * SPEED_UNITS[unit])) for unit in units}
    nearest = min(off, key=lambda unit: off[unit])
    return nearest if off[nearest] < np.log(_NEAR) else ''
