# SPDX-License-Identifier: Apache-2.0
"""
What the oracle compares: means over short times, and how they are disturbed.

Everything random of the generator is known here by its size; its response is
linear in the ship's motion, so that all of it is one covariance.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from benchmarks.worlds.hidden.cases import Known, Observation
from benchmarks.worlds.hidden.effect import Effect, Leg
from benchmarks.worlds.hidden.hull import SHAPE_TERMS, Array
from benchmarks.worlds.hidden.oracle_means import Means, average, means_of, slow_covariance
from benchmarks.worlds.hidden.oracle_response import Response
from benchmarks.worlds.hidden.recording import BETWEEN_RUNS_NS, START_NS
from benchmarks.worlds.hidden.sailing import LEAD_IN_S, Disturbance, World, sail

_LEAD_IN_BINS = 12
_COAST_BINS = 50
_START_SD_M = 1000.0  # of the position that is counted from
_SLIP_SD = 0.02  # of the shaft speed over that under power
_BEARING_SD_RAD = 0.005  # of the compass
_STEP_S = 4.0  # of the oracle's simulations
_RADAR_SD = 0.003  # of its scale, beside another speed over ground
_DEPTH_SD = 0.01  # of draught over depth


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
        ways = [average(time, place[:, k], self.place) for k in range(2)]
        parts = [average(time, log, self.log, late_s=late)]
        parts += self._turned(np.column_stack(ways))
        if self.heading is not None:
            yaw = average(time, motion.heading_rad - self.frame_rad, self.heading)
            parts.append(_wrapped(yaw))
        if self.shaft is not None:
            parts.append(self._slip(parts[0], average(time, motion.shaft_rad_s, self.shaft)))
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
        response = Response(self)
        noise = self.known.noise
        lags, places = self.log, self.place
        n_log, n_place = len(lags.middle_s), len(places.middle_s)
        log = slow_covariance(lags, noise.log_colour) + np.diag(
            (noise.log_m_s**2 + noise.log_quantum_m_s**2 / 12.0) / lags.readings
        )
        white = (noise.position_m**2 + noise.position_quantum_m**2 / 12.0) / places.readings
        place = slow_covariance(places, noise.position_colour) + np.diag(white) + _START_SD_M**2
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
            total[here, here] = slow_covariance(self.heading, noise.wander) + _BEARING_SD_RAD**2
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
        error = slow_covariance(lags, (0.06 * self.speed_m_s, slow_s))
        generic['log'][:n_log, :n_log] = error * np.outer(coasting, coasting)
        error = slow_covariance(places, (100.0, slow_s))
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
        return means_of(series, (series.stamp_ns - start) / 1e9 - LEAD_IN_S, self._edges)

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


def _wrapped(angle: Array) -> Array:
    return np.arctan2(np.sin(angle), np.cos(angle))
