# SPDX-License-Identifier: Apache-2.0
"""
What the oracle compares: means over short times, and how they are disturbed.

Everything random of the generator is known here by its size; its response is
linear in the ship's motion, so that all of it is one covariance.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hidden.cases import SHAPE_RMS, Known, Observation
from hidden.effect import Effect, Leg
from hidden.hull import SHAPE_TERMS, Array
from hidden.recording import BETWEEN_RUNS_NS, START_NS, Series, gust_m_s2
from hidden.sailing import LEAD_IN_S, Disturbance, World, sail

_LEAD_IN_BINS = 12
_COAST_BINS = 50
_ENOUGH = 0.7  # of the readings of a bin
_START_SD_M = 1000.0  # of the position that is counted from
_SLIP_SD = 0.02  # of the shaft speed over that under power
_BEARING_SD_RAD = 0.005  # of the compass
_STEP_S = 4.0  # of the oracle's simulations
_RADAR_SD = 0.003  # of its scale, beside another speed over ground
_DEPTH_SD = 0.01  # of draught over depth


@dataclass(frozen=True)
class Means:
    """
    Means of one input over bins.

    Attributes
    ----------
    start_s, end_s : (n,)
        Of the bins, after the stop.
    value : (n, 2)
    readings : (n,)
    """

    start_s: Array
    end_s: Array
    value: Array
    readings: Array

    @property
    def middle_s(self) -> Array:
        """Middles of the bins."""
        return 0.5 * (self.start_s + self.end_s)

    @property
    def width_s(self) -> Array:
        """Lengths of the bins."""
        return self.end_s - self.start_s


def _means(series: Series, time: Array, edges: Array) -> Means:
    """Average what is near what is around it."""
    keep = np.ones(len(time), np.bool_)
    for column in series.value.T:
        padded = np.pad(column, 7, 'reflect', reflect_type='odd')
        around = np.lib.stride_tricks.sliding_window_view(padded, 15)
        # a steady motion does not count as being off
        near = 0.5 * (np.median(around[:, :7], axis=1) + np.median(around[:, 8:], axis=1))
        off = np.abs(column - near)
        keep &= off <= 8.0 * np.median(off) + 1e-9
    place = np.searchsorted(edges, time[keep]) - 1
    inside = (place >= 0) & (place < len(edges) - 1)
    place, value = place[inside], series.value[keep][inside]
    n = np.bincount(place, minlength=len(edges) - 1)
    every = float(np.median(np.diff(time)))
    enough = n >= np.maximum(_ENOUGH * np.diff(edges) / every, 2)
    sums = [np.bincount(place, column, minlength=len(n)) for column in value.T]
    mean = np.column_stack(sums)[enough] / n[enough, None]
    # where readings are missing the mean is of another moment
    middle = (np.bincount(place, time[keep][inside], minlength=len(n)) / np.maximum(n, 1))[enough]
    half = 0.5 * np.diff(edges)[enough]
    return Means(middle - half, middle + half, mean, n[enough])


def _average(time: Array, value: Array, means: Means, *, late_s: float = 0.0) -> Array:
    """Return the means of a curve over the bins."""
    steps = 0.5 * (value[1:] + value[:-1]) * np.diff(time)
    total = np.concatenate([[0.0], np.cumsum(steps)])
    start, end = means.start_s - late_s, means.end_s - late_s
    return (np.interp(end, time, total) - np.interp(start, time, total)) / means.width_s


class SeenRun:
    """
    One run as the oracle sees it.

    Attributes
    ----------
    speed_m_s
        First guess of the speed at the stop.
    """

    def __init__(self, observation: Observation, number: int, known: Known) -> None:
        self.known, self.number = known, number
        self.sign = 1.0 if number == 0 else -1.0
        self._series = observation.runs[number]
        duration = known.duration_s
        lead_in = np.linspace(-LEAD_IN_S + 5.0, -10.0, _LEAD_IN_BINS + 1)
        self._edges = np.concatenate([lead_in, np.linspace(0.0, duration - 2.0, _COAST_BINS + 1)])
        self.log = self._binned('speed_through_water')
        self.place = self._binned('position')
        steady = self.place.middle_s < 0.0
        east, north = self.place.value[steady][-1] - self.place.value[steady][0]
        self.frame_rad = float(np.arctan2(north, east))
        self.speed_m_s = float(np.mean(self.log.value[self.log.middle_s < 0.0, 0]))
        self.heading = self._binned('heading') if 'heading' in self._series else None
        self.shaft = self._binned('shaft') if 'shaft' in self._series else None

    def leg(self, speed_m_s: float) -> Leg:
        """
        Return the run at a speed.
        """
        return Leg(self.known.hull, self.sign, self.known.duration_s, speed_m_s)

    @cached_property
    def measured(self) -> Array:
        """Log, way along and across the frame, and what else there is."""
        parts = [self.log.value[:, 0], *self._in_frame(self.place.value)]
        if self.heading is not None:
            parts.append(_wrapped(self.heading.value[:, 0] - self.frame_rad))
        if self.shaft is not None:
            parts.append(self._slip(self.log.value[:, 0], self.shaft.value[:, 0]))
        return np.concatenate(parts)

    def predicted(
        self, effects: tuple[Effect, ...], speed_m_s: float, course: float, first_rad: float
    ) -> Array:
        """
        Return what would be measured.

        Parameters
        ----------
        effects
        speed_m_s
            At the stop.
        course
            Heading in the frame [rad].
        first_rad
            Heading of the first run.
        """
        leg = self.leg(speed_m_s)
        acting = tuple(effect for effect in effects if self.sign > 0 or not effect.single_run)
        motion = sail(
            leg,
            acting,
            heading_rad=self.frame_rad + course,
            first_heading_rad=first_rad,
            world=World(),
            disturbance=Disturbance.none(leg, step_s=_STEP_S),
            step_s=_STEP_S,
        )
        time, log, place = motion.time_s, motion.surge_m_s, motion.position_m
        for effect in acting:
            log, place = effect.log(leg, time, log), effect.radar(leg, time, place)
        late = sum(effect.log_delay_s() for effect in acting)
        ways = [_average(time, place[:, k], self.place) for k in range(2)]
        parts = [_average(time, log, self.log, late_s=late)]
        parts += self._turned(np.column_stack(ways))
        if self.heading is not None:
            yaw = _average(time, motion.heading_rad - self.frame_rad, self.heading)
            parts.append(_wrapped(yaw))
        if self.shaft is not None:
            parts.append(self._slip(parts[0], _average(time, motion.shaft_rad_s, self.shaft)))
        return np.concatenate(parts)

    def disturbed(self) -> tuple[Array, Array, dict[str, Array]]:
        """
        Return how the measurements scatter.

        Returns
        -------
        (n, n)
            Covariance of this run's own.
        (n, m)
            What all runs have in common, one column a standard normal number:
            the errors of the baseline.
        dict of (n, n)
            Of discrepancies that have no name, by channel.
        """
        response = _Response(self)
        noise = self.known.noise
        lags, places = self.log, self.place
        n_log, n_place = len(lags.middle_s), len(places.middle_s)
        log = _slow(lags, noise.log_colour) + np.diag(
            (noise.log_m_s**2 + noise.log_quantum_m_s**2 / 12.0) / lags.readings
        )
        white = (noise.position_m**2 + noise.position_quantum_m**2 / 12.0) / places.readings
        place = _slow(places, noise.position_colour) + np.diag(white) + _START_SD_M**2
        size = len(self.measured)
        total = np.zeros((size, size))
        along = slice(n_log, n_log + n_place)
        across = slice(n_log + n_place, n_log + 2 * n_place)
        total[:n_log, :n_log] = log
        total[along, along] = place
        total[across, across] = place
        both = slice(0, n_log + n_place)
        total[both, both] += response.of_gusts() + response.of_water()
        total[across, across] += response.across()
        done = across.stop
        if self.heading is not None:
            here = slice(done, done + len(self.heading.middle_s))
            total[here, here] = _slow(self.heading, noise.wander) + _BEARING_SD_RAD**2
            total[here, here] += np.diag(0.005**2 / self.heading.readings)
            done = here.stop
        if self.shaft is not None:
            run_down = np.exp(-np.maximum(self.shaft.start_s, 0.0) / self.known.hull.run_down_s)
            run_down[self.shaft.start_s < 0.0] = 0.0
            total[done:, done:] = np.diag((_SLIP_SD + 0.3 * run_down) ** 2)
        shared = np.zeros((size, SHAPE_TERMS + 4))
        shared[both] = response.of_baseline()
        generic = {'force': np.zeros((size, size)), 'log': np.zeros((size, size))}
        generic['radar'] = np.zeros((size, size))
        generic['force'][both, both] = response.of_any_force()
        slow_s = 0.3 * self.known.duration_s
        coasting = (lags.middle_s > 0.0).astype(float)
        error = _slow(lags, (0.06 * self.speed_m_s, slow_s))
        generic['log'][:n_log, :n_log] = error * np.outer(coasting, coasting)
        error = _slow(places, (100.0, slow_s))
        for way in (along, across):
            generic['radar'][way, way] = error
        return total, shared, generic

    @cached_property
    def true_wind(self) -> tuple[Array, Array] | None:
        """True wind as an anemometer has it, and its variance."""
        if 'wind_apparent' not in self._series:
            return None
        wind = self._binned('wind_apparent')
        way = self._in_frame(self.place.value)[0]
        over_ground = np.interp(
            wind.middle_s, self.place.middle_s, np.gradient(way, self.place.middle_s)
        )
        ahead = np.mean(-wind.value[:, 0] - over_ground)
        across = np.mean(-wind.value[:, 1])
        apparent = np.abs(np.mean(wind.value, axis=0))
        variance = 0.2**2 + (0.03 * apparent) ** 2
        return self.sign * np.array([ahead, across]), variance

    @cached_property
    def shoal(self) -> tuple[float, float] | None:
        """Draught over depth as an echo sounder has it, and its variance."""
        if 'depth' not in self._series:
            return None
        depth = float(np.mean(self._binned('depth').value[:, 0]))
        return self.known.hull.draught_m / depth, _DEPTH_SD**2

    @cached_property
    def radar_factor(self) -> tuple[float, float] | None:
        """Way by radar over that by another speed over ground, and its variance."""
        if 'speed_over_ground' not in self._series:
            return None
        ground = self._binned('speed_over_ground')
        place = self.place
        steps = np.hypot(*np.diff(place.value[place.middle_s < 0.0], axis=0).T)
        middles = place.middle_s[place.middle_s < 0.0]
        between = np.interp(
            0.5 * (middles[1:] + middles[:-1]), ground.middle_s, ground.value[:, 0]
        )
        return float(np.sum(steps) / np.sum(between * np.diff(middles))), _RADAR_SD**2

    def _binned(self, name: str) -> Means:
        series = self._series[name]
        start = START_NS + self.number * BETWEEN_RUNS_NS
        return _means(series, (series.stamp_ns - start) / 1e9 - LEAD_IN_S, self._edges)

    def _slip(self, log: Array, shaft: Array) -> Array:
        """Return the shaft speed over that under power, at the speed of the log."""
        assert self.shaft is not None
        hull = self.known.hull
        speed = np.interp(self.shaft.middle_s, self.log.middle_s, log)
        return shaft * hull.speed_m_s / (hull.shaft_rad_s * np.maximum(speed, 0.5))

    def _in_frame(self, place: Array) -> list[Array]:
        return self._turned(place - place[0])

    def _turned(self, place: Array) -> list[Array]:
        sine, cosine = np.sin(self.frame_rad), np.cos(self.frame_rad)
        east, north = place.T
        return [east * cosine + north * sine, north * cosine - east * sine]


class _Response:
    """How log and way along the track answer to small forces."""

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


def _slow(means: Means, process: tuple[float, float]) -> Array:
    """Return the covariance of the means of a slow process."""
    sd, slow_s = process
    part = means.width_s / slow_s
    apart = np.abs(means.middle_s[:, None] - means.middle_s)
    spread = 2.0 * np.sinh(0.5 * part) / part
    covariance = np.exp(-apart / slow_s) * np.outer(spread, spread)
    np.fill_diagonal(covariance, 2.0 * (part - 1.0 + np.exp(-part)) / part**2)
    return sd**2 * covariance


def _interpolate(at: Array, time: Array, columns: Array) -> Array:
    place = np.clip(np.searchsorted(time, at) - 1, 0, len(time) - 2)
    part = ((at - time[place]) / np.diff(time)[place])[:, None]
    return (1.0 - part) * columns[place] + part * columns[place + 1]


def _wrapped(angle: Array) -> Array:
    return np.arctan2(np.sin(angle), np.cos(angle))
