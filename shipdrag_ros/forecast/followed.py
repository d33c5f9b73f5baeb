# SPDX-License-Identifier: Apache-2.0
"""What followed a forecast, as the instruments show it without any law of a hull."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.distance import along_track
from shipdrag_ros.estimation.record import right
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.estimation.window import Series
from shipdrag_ros.forecast.result import Band, Forecast, Milestone
from shipdrag_ros.posterior import priors
from shipdrag_ros.samples import SECOND_NS, Float64, kind_of

OUTSIDE = 0.1
"""Share of what follows that the band leaves out."""
_BEHIND = 3  # readings that a speed must have been passed by


@dataclass(frozen=True)
class Passed:
    """
    A milestone, and when and where it was; None where the record does not show it.
    """

    foretold: Milestone
    was_s: float | None = None
    was_m: float | None = None


class Pair(NamedTuple):
    """A band, what followed, and how much of it was over when it was foretold; [s] or [m]."""

    band: Band
    was: float
    done: float

    @property
    def inside(self) -> bool:
        """Whether the band holds what followed."""
        return self.band.low <= self.was <= self.band.high

    @property
    def score(self) -> float:
        """Its `interval_score`."""
        return interval_score(*self)


@dataclass(frozen=True)
class Checked:
    """
    A forecast beside what followed.

    Attributes
    ----------
    forecast
    milestones
    done_s, done_m
        From the stop to when it was made.
    """

    forecast: Forecast
    milestones: tuple[Passed, ...]
    done_s: float
    done_m: float

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """Of all milestones that were seen to follow."""
        found = []
        for each in self.milestones:
            if each.was_s is not None and each.was_m is not None:
                found.append(Pair(each.foretold.time_s, each.was_s, self.done_s))
                found.append(Pair(each.foretold.distance_m, each.was_m, self.done_m))
        return tuple(found)

    @property
    def inside(self) -> float | None:
        """Share of what followed that lies in its band; None where nothing followed."""
        return _mean([float(each.inside) for each in self.pairs])

    @property
    def interval_score(self) -> float | None:
        """Mean of `interval_score`, of ways ahead of the stop; None where nothing followed."""
        scored = (each for each in self.pairs if each.done + min(each.band.low, each.was) > 0.0)
        return _mean([each.score for each in scored])


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None


def interval_score(band: Band, was: float, done: float) -> float:
    """
    Return the interval score of the logarithm of a time or distance from the stop; less is better.

    Parameters
    ----------
    band, was
        From when it was foretold.
    done
        Until then.

    Notes
    -----
    Gneiting, Raftery (2007), (43): width, and 2 / 0.1 of what lies outside.
    """
    low, high, seen = (math.log(done + each) for each in (band.low, band.high, was))
    outside = max(low - seen, 0.0) + max(seen - high, 0.0)
    return high - low + 2.0 / OUTSIDE * outside


@dataclass(frozen=True)
class Followed:
    """
    A glide as its readings show it: speed falls, way grows, and no more is taken for granted.

    Attributes
    ----------
    time_s, speed_m_s : (n,)
        Of the readings of the speed, made monotone; time from the stop.
    way_time_s, way_m : (m,)
        The same of places along the track; without places the integral of the speed.
    last_s
        From which on a speed cannot be said to be passed.
    """

    time_s: Float64
    speed_m_s: Float64
    way_time_s: Float64
    way_m: Float64
    last_s: float

    @classmethod
    def of(cls, window: Window, whole: Estimate) -> Followed:
        """
        Read what followed.

        Parameters
        ----------
        window
            Of the whole glide.
        whole
            Its estimate: which inputs were used, and how they read beside the speed that is
            estimated (scale of a log, current of a speed over ground). Without an input of the
            speed, the places as it fits them.

        Raises
        ------
        EstimationError
            If there are too few readings.
        """
        name = next(iter(whole.tracks_of('speed_through_water', 'speed_over_ground')), None)
        place, way = next(iter(whole.tracks_of('position')), ''), None
        if place and len(window.series(place)) > _BEHIND:
            way = _way(window, window.series(place), whole)
        if name is not None:
            series = window.series(name)
            if len(series) <= _BEHIND:
                raise EstimationError(f'{name}: {len(series)} readings do not show what followed')
            time_s = _since(window, series.time_ns)
            sd = np.full(len(series), max(whole.noise_sd.get(name, 0.0), 1e-6))
            sure = right(time_s, series.value, sd, priors.WRONG.mean)
            speed = _monotone(-series.value, sure)
            speed = _as_estimated(-speed, name, whole)
        else:
            track = whole.tracks[place]
            time_s = _since(window, track.time_ns)
            speed = -_monotone(-np.gradient(track.fitted, time_s))
        if way is None:
            steps = np.diff(time_s) * 0.5 * (speed[1:] + speed[:-1])
            way = time_s, np.concatenate([[0.0], np.cumsum(steps)])
        return cls(time_s, speed, *way, float(time_s[-_BEHIND]))

    def beside(self, forecast: Forecast, stop_ns: int) -> Checked:
        """
        Return a forecast with what followed it.
        """
        made = (forecast.made_ns - stop_ns) / SECOND_NS
        start = float(np.interp(made, self.way_time_s, self.way_m))
        found = []
        for each in forecast.milestones:
            at = self._passed_s(each.speed_m_s)
            if at is None:
                found.append(Passed(each))
                continue
            way = float(np.interp(at, self.way_time_s, self.way_m)) - start
            found.append(Passed(each, at - made, way))
        return Checked(forecast, tuple(found), made, start)

    def _passed_s(self, speed_m_s: float) -> float | None:
        """Return when a speed was passed, between the middles of even stretches."""
        levels, first, count = np.unique(-self.speed_m_s, return_index=True, return_counts=True)
        middle = 0.5 * (self.time_s[first] + self.time_s[first + count - 1])
        if not -levels[-1] <= speed_m_s <= -levels[0]:
            return None
        at = float(np.interp(-speed_m_s, levels, middle))
        return at if at <= self.last_s else None


def _since(window: Window, stamps: object) -> Float64:
    return np.asarray((np.asarray(stamps) - window.start_ns) / SECOND_NS)


def _way(window: Window, places: Series, whole: Estimate) -> tuple[Float64, Float64]:
    """Return times and ways of places: she advances, but where a current sets her back."""
    stamps = places.time_ns
    half = 0.5 * float(stamps[-1] - stamps[0])
    way = along_track((stamps - stamps[0]) / half - 1.0, places.value)
    time_s, current = _since(window, stamps), whole.current_m_s or 0.0
    back_m = current * time_s if current < -whole.last_speed_m_s else np.zeros(len(way))
    return time_s, _monotone(way - back_m) + back_m


def _monotone(values: Float64, weights: Float64 | None = None) -> Float64:
    """Return the ascending values that are nearest in squares (Robertson and others 1988)."""
    from scipy.optimize import isotonic_regression  # a quarter of a second, for what has followed

    return np.asarray(isotonic_regression(values, weights=weights).x)


def _as_estimated(speed: Float64, name: str, whole: Estimate) -> Float64:
    """Take from readings what the estimate says that the instrument adds."""
    read, is_so = float(whole.tracks[name].fitted[-1]), whole.last_speed_m_s
    if kind_of(name) == 'speed_through_water':
        return speed * (is_so / read) if read > 0.0 < is_so else speed
    return speed - (read - is_so)
