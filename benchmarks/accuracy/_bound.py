# SPDX-License-Identifier: Apache-2.0
"""
Cramer-Rao bound of r(v) for one coastdown with the noise known.

Apart from the package on purpose: its own integration of the motion, and the
covariance of all readings in one dense matrix.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import solve_triangular

from benchmarks.accuracy._coasts import SLOW_S, Case, Coast, coasts, gust_m_s2
from shipdrag_ros.samples import Float64

POWERS = np.array([1, 2, 3, 4])  # of the family that r is known to belong to
_STEPS = 1500  # of the coastdown
_WARM_S = 1500.0  # of the slow force before the first reading
_BIN_S = 10.0  # of the means that stand for the steady record


class _Model:
    """The motion after the stop, and what a slow force does to it."""

    def __init__(self, case: Case, coast: Coast) -> None:
        self.hull, self.ship = case.hull, coast.truth.ship
        speeds = coast.speeds
        columns = self.columns(speeds)
        self.coefficients = np.linalg.lstsq(columns, coast.resists(speeds), rcond=None)[0]
        self.time_s = np.linspace(0.0, 1.0, _STEPS + 1) ** 2 * self.hull.duration_s

    def columns(self, speed_m_s: Float64) -> Float64:
        """Return the powers, relative to the speed at the start."""
        result: Float64 = (np.asarray(speed_m_s)[..., None] / self.hull.speed_m_s) ** POWERS
        return result

    def motion(self, coefficients: Float64, start_m_s: Float64) -> tuple[Float64, Float64]:
        """Return speed and distance at `time_s` of several motions at once, (m, k)."""

        def slope(v: Float64) -> Float64:
            r = np.sum(coefficients * self.columns(v), axis=-1)
            return np.asarray(-r / (1.0 + self.ship.n_r(v)))

        v, x = start_m_s.copy(), np.zeros_like(start_m_s)
        speeds, distances = [v], [x]
        for h in np.diff(self.time_s):
            a = slope(v)
            b = slope(v + h / 2.0 * a)
            c = slope(v + h / 2.0 * b)
            d = slope(v + h * c)
            x = x + h * v + h**2 / 6.0 * (a + b + c)
            v = v + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
            speeds.append(v)
            distances.append(x)
        return np.array(speeds), np.array(distances)

    def slow_force(self, rows_s: Float64, sd_m_s2: float) -> Float64:
        """Return the covariance (2m, 2m) of speeds and distances at `rows_s`."""
        step_s = self.hull.duration_s / 300.0
        grid_s = np.arange(rows_s[0] - _WARM_S, rows_s[-1] + step_s, step_s)
        v = np.array([self.hull.speed_m_s])
        path = self.motion(self.coefficients, v)[0][:, 0]
        v = np.interp(grid_s, self.time_s, path)
        inertia = 1.0 + self.ship.n_r(v)
        decelerates = self.columns(v) @ self.coefficients / inertia
        up = 1.001 * v
        faster = self.columns(up) @ self.coefficients / (1.0 + self.ship.n_r(up))
        decay = np.exp(-(faster - decelerates) / (up - v) * step_s)
        by_force = np.zeros((2, len(grid_s), len(grid_s)))
        for i in range(1, len(grid_s)):
            by_force[0, i] = decay[i] * by_force[0, i - 1]
            by_force[0, i, i - 1] += step_s / inertia[i]
            mean = 0.5 * (by_force[0, i - 1] + by_force[0, i])
            by_force[1, i] = by_force[1, i - 1] + step_s * mean
        at = (rows_s - grid_s[0]) / step_s
        low = np.minimum(at.astype(int), len(grid_s) - 2)
        part = (at - low)[:, None]
        rows = np.concatenate(
            [(1.0 - part) * each[low] + part * each[low + 1] for each in by_force]
        )
        force = sd_m_s2**2 * np.exp(-np.abs(grid_s[:, None] - grid_s) / SLOW_S)
        result: Float64 = rows @ force @ rows.T
        return result


def bound(case: Case) -> Float64:
    """
    Return the least standard deviation of r at the speeds of a comparison: (m,).

    Unknown are, beside r, the speed and the place at the stop, the current, and, with a steady
    record, the time of the stop.
    """
    hull = case.hull
    (coast,) = coasts(replace(case, gust_m_s=0.0), 1)
    model, window = _Model(case, coast), coast.window
    coast_s = (window.speed_through_water.time_ns - window.start_ns) * 1e-9
    spacing = hull.duration_s / (case.n - 1)
    size = max(1, round(_BIN_S / spacing)) if window.before is not None else 1
    steady_s = np.empty(0)
    if window.before is not None:
        before_s = (window.before.speed_through_water.time_ns - window.start_ns) * 1e-9
        steady_s = before_s[: len(before_s) // size * size].reshape(-1, size).mean(axis=1)
    rows_s = np.concatenate([steady_s, coast_s])
    count = np.where(rows_s < 0.0, size, 1)
    columns = _sensitivity(model, rows_s, onset=case.steady)
    covariance = np.diag(np.concatenate([hull.log_sd**2 / count, hull.position_sd**2 / count]))
    if case.gust_m_s:
        covariance += model.slow_force(rows_s, gust_m_s2(case))
    white = solve_triangular(np.linalg.cholesky(covariance), columns, lower=True)
    scale = np.linalg.norm(white, axis=0)
    triangle = np.linalg.qr(white / scale, mode='r')
    k = len(POWERS)
    powers_of = np.zeros((len(coast.speeds), len(scale)))
    powers_of[:, :k] = model.columns(coast.speeds) / scale[:k]
    return np.asarray(
        np.linalg.norm(solve_triangular(triangle.T, powers_of.T, lower=True), axis=0)
    )


def _sensitivity(model: _Model, rows_s: Float64, *, onset: bool) -> Float64:
    """Return the derivative of all speeds, then all distances, by the unknowns."""
    k = len(POWERS)
    v0 = model.hull.speed_m_s
    largest = float(np.abs(model.coefficients).max())
    steps = np.array([*np.full(k, 1e-4 * largest), 1e-4 * v0])
    shift = np.diag(steps)
    both = np.concatenate([shift, -shift])
    speed, distance = model.motion(model.coefficients + both[:, :k], v0 + both[:, k])
    after = rows_s >= 0.0
    columns = []
    for i, step in enumerate(steps):
        j = len(steps) + i
        in_speed, in_distance = (
            np.interp(rows_s, model.time_s, (found[:, i] - found[:, j]) / (2.0 * step))
            for found in (speed, distance)
        )
        if i == k:
            in_distance = np.where(after, in_distance, rows_s)
        else:
            in_speed, in_distance = np.where(after, in_speed, 0.0), np.where(after, in_distance, 0)
        columns.append([in_speed, in_distance])
    nothing, always = np.zeros_like(rows_s), np.ones_like(rows_s)
    columns += [[nothing, always], [nothing, rows_s]]  # place, current
    if onset:
        path = model.motion(model.coefficients, np.array([v0]))[0][:, 0]
        slope = np.interp(rows_s, model.time_s, np.gradient(path, model.time_s))
        lost = v0 - np.interp(rows_s, model.time_s, path)
        columns.append([np.where(after, -slope, 0.0), np.where(after, lost, 0.0)])
    return np.array([np.concatenate(pair) for pair in columns]).T
