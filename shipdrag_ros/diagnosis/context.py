# SPDX-License-Identifier: Apache-2.0
"""
What is measured besides the motion: wind, depth, heading.

It strikes hypotheses out, or makes them sure: an anemometer that feels no wind
speaks against a wind whatever the ship does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.diagnosis.noise import bin_means
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Action, Columns

_BIN_S = 60.0
_WIND_SD_M_S = 0.6  # of a true wind found from an anemometer: the ship bends the flow
_WIND_RELATIVE_SD = 0.05
_DEPTH_SD = 0.03  # relative
_DEEP_DRAUGHTS = 8.0  # of water: from there on its depth does not matter
_YAW_SD_RAD = 0.03  # of a mean over a bin: a ship yaws in the waves


@dataclass(frozen=True)
class Context:
    """
    Condensed context of one run.

    Attributes
    ----------
    value : (c,)
        Air ahead and to port [m/s], logarithm of the depth in draughts, yaw
        from the first heading [rad].
    whitener : (c, c)
        Lower triangular.
    at_wind, at_yaw : (w,), (h,)
        Times of the observation that the rows of wind and yaw are nearest to.
    has_depth
        Whether there is a row of depth.
    """

    value: Float64
    whitener: Float64
    at_wind: np.ndarray[tuple[int], np.dtype[np.intp]]
    at_yaw: np.ndarray[tuple[int], np.dtype[np.intp]]
    has_depth: bool

    @classmethod
    def of(
        cls, window: Window, ship: Ship, since_ns: int, times: Float64, heading_rad: float
    ) -> Context:
        """
        Condense what a window holds.

        Parameters
        ----------
        since_ns
            Time 0 of the observation [ns].
        times : (m,)
            Of the observation [s].
        """
        edges = np.arange(0.0, times[-1] + _BIN_S, _BIN_S)
        wind_s, wind = _binned(window, 'wind_apparent', since_ns, edges)
        yaw_s, yaw = _binned(window, 'heading', since_ns, edges)
        depth = _binned(window, 'depth', since_ns, edges)[1]
        has_depth = len(depth) > 0 and ship.draught_m is not None
        values = [wind[:, 0], wind[:, 1]]
        blocks = [_wind_covariance(wind[:, i]) for i in range(2)]
        if has_depth:
            assert ship.draught_m is not None
            draughts = float(np.median(depth)) / ship.draught_m
            values.append(np.log([min(draughts, _DEEP_DRAUGHTS)]))
            blocks.append(np.array([[_DEPTH_SD**2]]))
        values.append(np.angle(np.exp(1j * (yaw[:, 0] - heading_rad))) if len(yaw) else yaw[:, 0])
        blocks.append(np.eye(len(yaw)) * _YAW_SD_RAD**2)
        return cls(
            np.concatenate(values),
            _whitener(blocks),
            np.searchsorted(times, wind_s).clip(max=len(times) - 1),
            np.searchsorted(times, yaw_s).clip(max=len(times) - 1),
            has_depth,
        )

    def __len__(self) -> int:
        return len(self.value)

    def predict(
        self,
        ship: Ship,
        heading_rad: float,
        lead_in_s: float,
        columns: Columns,
        actions: list[Action],
    ) -> Float64:
        """
        Return what columns predict, (k, c).
        """
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        velocity = columns.velocity_over_ground_m_s[:, self.at_wind]
        air = np.array([action.wind_m_s for action in actions])
        east, north = (air[:, None, :] - velocity).transpose(2, 0, 1)
        parts = [cos * east + sin * north, cos * north - sin * east]
        if self.has_depth:
            assert ship.draught_m is not None
            depth = np.array([action.depth_m for action in actions]) / ship.draught_m
            parts.append(np.log(np.clip(depth, 1.0, _DEEP_DRAUGHTS))[:, None])
        after = columns.time_s[self.at_yaw] - lead_in_s
        yaw = np.zeros((len(actions), len(after)))
        for i, action in enumerate(actions):
            for turn in action.turns:
                yaw[i] += turn.rate_rad_s * np.clip(after - turn.start_s, 0.0, turn.duration_s)
        return np.concatenate([*parts, yaw], axis=1)


def _binned(window: Window, name: str, since_ns: int, edges: Float64) -> tuple[Float64, Float64]:
    """Return times and mean values, (b,) and (b, columns)."""
    parts: list[Series] = [getattr(window, name)]
    if window.before is not None:
        parts.insert(0, getattr(window.before, name))
    time_s = np.concatenate([(part.time_ns - since_ns) * 1e-9 for part in parts])
    value = np.concatenate([np.atleast_2d(part.value.T).T for part in parts])
    inside = (time_s >= edges[0]) & (time_s < edges[-1]) & np.isfinite(value).all(axis=1)
    if name == 'heading':
        value = np.unwrap(value, axis=0)
    if not inside.any():
        return np.empty(0), value[:0]
    found_s, found, _ = bin_means(time_s[inside], value[inside], edges)
    return found_s, found


def _wind_covariance(values: Float64) -> Float64:
    """A constant error of the true wind, and what the bins scatter."""
    n = len(values)
    if n == 0:
        return np.zeros((0, 0))
    scatter = max(float(np.median(np.abs(np.diff(values)))), 0.1) if n > 1 else 0.3
    constant = _WIND_SD_M_S**2 + (_WIND_RELATIVE_SD * float(np.abs(values).max())) ** 2
    return np.eye(n) * scatter**2 + constant


def _whitener(blocks: list[Float64]) -> Float64:
    size = sum(len(block) for block in blocks)
    whole = np.zeros((size, size))
    place = 0
    for block in blocks:
        if len(block):
            part = slice(place, place + len(block))
            whole[part, part] = np.linalg.inv(np.linalg.cholesky(block))
            place += len(block)
    return whole
