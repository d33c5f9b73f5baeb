# SPDX-License-Identifier: Apache-2.0
"""How log and radar answer to all that is random, as covariances."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from benchmarks.worlds.hidden.cases import SHAPE_RMS
from benchmarks.worlds.hidden.hull import SHAPE_TERMS, Array
from benchmarks.worlds.hidden.recording import gust_m_s2
from benchmarks.worlds.hidden.sailing import LEAD_IN_S

if TYPE_CHECKING:
    from benchmarks.worlds.hidden.oracle_data import SeenRun


class Response:
    """
    How log and way along the track answer to small forces.
    """

    def __init__(self, run: SeenRun) -> None:
        self.run, hull = run, run.known.hull
        duration = run.known.duration_s
        self.edges = np.unique(
            np.concatenate(
                [
                    np.linspace(-LEAD_IN_S, 0.0, 31),
                    np.linspace(0.0, 60.0, 21),
                    np.linspace(60.0, duration, 81),
                ]
            )
        )
        self.step, self.middle = np.diff(self.edges), 0.5 * (self.edges[1:] + self.edges[:-1])
        # a coast is smooth, and so is the log after its bins
        self.speed = np.maximum(np.interp(self.middle, run.log.middle_s, run.log.value[:, 0]), 0.1)
        self.inertia = 1.0 + hull.added_mass(self.speed)
        faster = hull.still_n(1.01 * self.speed) - hull.still_n(0.99 * self.speed)
        damping = faster / (0.02 * self.speed) / hull.mass_kg / self.inertia
        n = len(self.middle)
        # speed at the end of each step after a unit jump of speed in each
        self.jump = np.zeros((n, n))
        row = np.zeros(n)
        for i in range(n):
            row = row * np.exp(-damping[i] * self.step[i])
            row[i] = 1.0
            self.jump[i] = row

    def _seen(self, speed: Array, over_ground: Array) -> Array:
        """Read log and way from speeds (steps, columns) at the ends of the steps."""
        run = self.run
        way = np.cumsum(over_ground * self.step[:, None], axis=0)
        zero = np.zeros((1, speed.shape[1]))
        parts = [
            _interpolate(run.log.middle_s, self.edges, np.vstack([zero, speed])),
            _interpolate(run.place.middle_s, self.edges, np.vstack([zero, way])),
        ]
        return np.vstack(parts)

    def _of_force(self, force_m_s2: Array) -> Array:
        speed = self.jump @ (force_m_s2 * (self.step / self.inertia)[:, None])
        before = np.vstack([np.zeros((1, speed.shape[1])), speed[:-1]])
        return self._seen(speed, 0.5 * (speed + before))

    def of_gusts(self) -> Array:
        """Covariance."""
        noise = self.run.known.noise
        size = gust_m_s2(self.run.leg(self.run.speed_m_s), noise)
        columns = self._of_force(size * self._root(noise.gust[1]))
        return columns @ columns.T

    def of_water(self) -> Array:
        """Covariance."""
        size, slow_s = self.run.known.noise.water
        water = size * self._root(slow_s)
        change = np.diff(water, axis=0, prepend=water[:1])
        speed = -self.jump @ (change / self.inertia[:, None])
        columns = self._seen(speed, speed + water)
        return columns @ columns.T

    def across(self) -> Array:
        """Covariance of the way across: wander of the heading, and slow current."""
        noise = self.run.known.noise
        total = 0.0
        for size, slow_s in ((noise.wander[0] * self.speed, noise.wander[1]), noise.water):
            drift = np.multiply(size, self._root(slow_s).T).T
            way = np.cumsum(drift * self.step[:, None], axis=0)
            way = np.vstack([np.zeros((1, way.shape[1])), way])
            columns = _interpolate(self.run.place.middle_s, self.edges, way)
            total = total + columns @ columns.T
        return total

    def of_baseline(self) -> Array:
        """Columns: friction, wave, n_r, run-down, and the shape of the curve."""
        hull, time, speed = self.run.known.hull, self.middle, self.speed
        at_stop = np.array([self.run.speed_m_s])
        thrust = np.exp(-np.maximum(time, 0.0) / hull.run_down_s)
        shapes = SHAPE_RMS / np.sqrt(0.5 * SHAPE_TERMS) * np.eye(SHAPE_TERMS)

        def force(resistance) -> Array:  # type: ignore[no-untyped-def]
            # the thrust was equal to the resistance
            lost = resistance(at_stop)[0] * thrust - resistance(speed)
            return np.where(time > 0.0, lost, 0.0) / hull.mass_kg

        columns = [
            hull.friction_sd * force(hull.friction_n),
            hull.wave_sd * force(hull.wave_n),
            -hull.n_r_sd / self.inertia * force(hull.still_n),
        ]
        after = np.maximum(time, 0.0)
        longer = after / hull.run_down_s**2 * thrust * hull.run_down_sd
        columns.append(hull.still_n(at_stop)[0] / hull.mass_kg * longer)
        columns += [
            force(lambda u, shape=shape: hull.still_n(u) * hull.shape(u, shape))
            for shape in shapes
        ]
        return self._of_force(np.column_stack(columns))

    def of_any_force(self) -> Array:
        """Covariance of a force that nothing is known of."""
        hull = self.run.known.hull
        size = 0.2 * hull.still_n(np.array([self.run.speed_m_s]))[0] / hull.mass_kg
        coasting = (self.middle > 0.0)[:, None]
        columns = self._of_force(size * coasting * self._root(0.3 * self.run.known.duration_s))
        return columns @ columns.T

    def _root(self, slow_s: float) -> Array:
        """Root of the covariance of a slow process of variance 1."""
        apart = np.abs(self.middle[:, None] - self.middle)
        # a step that is long against the process averages it
        part = self.step / slow_s
        averaged = 2.0 * (part - 1.0 + np.exp(-part)) / part**2
        covariance = np.exp(-apart / slow_s) * np.sqrt(np.outer(averaged, averaged))
        np.fill_diagonal(covariance, averaged + 1e-9)
        return np.linalg.cholesky(covariance)


def _interpolate(at: Array, time: Array, columns: Array) -> Array:
    place = np.clip(np.searchsorted(time, at) - 1, 0, len(time) - 2)
    part = ((at - time[place]) / np.diff(time)[place])[:, None]
    return (1.0 - part) * columns[place] + part * columns[place + 1]
