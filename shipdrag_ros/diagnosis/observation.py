# SPDX-License-Identifier: Apache-2.0
"""
A run as a diagnosis sees it: condensed rows of measurements, and what is known of it.

Rows are means over times in which the motion is as good as even, so that a few
hundred hold all that a run can show.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from shipdrag_ros.diagnosis.context import Context, Stop, stop_time_s
from shipdrag_ros.diagnosis.measured import CondensedRows, Measured, measured, whitener_of
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.estimation.record import RunRows
from shipdrag_ros.estimation.run_down import RunDown
from shipdrag_ros.estimation.steady import BIN_S, white_sd
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.inference.learning import LEAST_S
from shipdrag_ros.inference.rows import CODES, LOG, OUTLIER, OVER_GROUND, POSITION, bin_means
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.rows import FIRST_S, GROWTH, LONGEST_PART, LONGEST_S, NEIGHBOURS
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Fact, Ship

_ALIKE_S = 12.0  # beyond which the errors of filters and swell are as good as independent
_LEAST_DISPLAY = 0.01  # of the noise of a sample, from where a display's last digit counts
_COMPASS_SD_RAD, _COURSE_SD_RAD = 0.03, 0.1  # of the direction through water, leeway included
_LEAST_ROWS = 8  # of the steady record, for its speed
_KNOWN_S = 10.0  # sd of the time of the stop, above which the speed shows it better


@dataclass(frozen=True)
class CoastRun:
    """
    A coastdown to be diagnosed.

    Attributes
    ----------
    name
        For the user.
    window
        With the steady record before it.
    facts
        That a log book knows of this run.
    ship
        The ship as she was in this run; None: as in all.
    """

    name: str
    window: Window
    facts: tuple[Fact, ...] = ()
    ship: Ship | None = None


@dataclass(frozen=True)
class Observation:
    """
    One run.

    Attributes
    ----------
    name
        For the user.
    lead_in_s
        Length of the steady record.
    time_s : (m,)
        Times of all rows, ascending, from the start of the steady record.
    stop_sd_s
        How well the time of the stop, at the end of the lead-in, is known.
    run_down_s, run_down_sd_s
        Of the shaft: as the ship file states it, else as it was seen; 0: not known.
    heading_rad, heading_sd_rad
        Direction through water in the lead-in, from east, anticlockwise.
    speed_m_s
        Speed in the lead-in, roughly.
    along, across
        Measured along the heading and to port of it; across there are only
        positions, None without.
    across_whitener : (n, n)
        Inverse Cholesky factor of the noise of `across`.
    context
        What is measured besides.
    ship
        As she was in this run, without effects.
    stop_moved_s
        By how much the end of the lead-in is later than the stop was taken for at first.
    """

    name: str
    lead_in_s: float
    time_s: Float64
    stop_sd_s: float
    run_down_s: float
    run_down_sd_s: float
    heading_rad: float
    heading_sd_rad: float
    speed_m_s: float
    along: Measured
    across: Measured | None
    across_whitener: Float64
    context: Context
    ship: Ship
    stop_moved_s: float = 0.0

    @property
    def stopped_ns(self) -> int:
        """Time of the stop [ns since the epoch]."""
        return self.context.stop.since_ns + round(self.context.stop.lead_in_s * 1e9)

    @property
    def duration_s(self) -> float:
        """Length of the coastdown."""
        return float(self.time_s[-1]) - self.lead_in_s

    @classmethod
    def of(
        cls,
        window: Window,
        ship: Ship,
        parameters: Parameters,
        *,
        name: str,
        stop_moved_s: float = 0.0,
    ) -> Observation:
        """
        Condense a coastdown with the steady record before it.

        Parameters
        ----------
        window
            With the record before the stop.
        ship
            With a baseline, for how the ship answers a gust.
        parameters
            For the noise of the sensors and the convention of the heading.
        name
            For the user.
        stop_moved_s
            By how much the stop is known to be later than it is taken for; some
            seconds, as the record is not looked through again for it [s].

        Returns
        -------
        Observation
            With the noise of its steady part.

        Raises
        ------
        DiagnosisError
            If the steady record is too short.
        EstimationError
            If no input has enough samples.
        """
        run_down = RunDown.of(window, ship)
        record = RunRows.of(window, run_down, parameters)
        if record.steady_s < LEAST_S or window.before is None:
            raise DiagnosisError(
                f'{record.steady_s:.0f} s of steady sailing before the stop, at least '
                f'{LEAST_S:.0f} s are needed to separate an effect from the noise: give a record '
                'that begins earlier'
            )
        if run_down.stop_sd_s > _KNOWN_S:
            run_down = _stopped(window, run_down, record)
        run_down = replace(run_down, stop_ns=run_down.stop_ns + round(stop_moved_s * 1e9))
        since_ns = run_down.stop_ns + round(float(record.steady.time_s[0]) * 1e9)
        series = {
            input_: _joined(getattr(window.before, input_), getattr(window, input_), since_ns)
            for input_ in record.white_sd
        }
        lead_in_s = (run_down.stop_ns - since_ns) * 1e-9
        seconds = {
            input_: np.asarray((found.time_ns - since_ns) * 1e-9, np.float64)
            for input_, found in series.items()
        }
        heading_rad, heading_sd = _heading(window, series, seconds, lead_in_s, parameters)
        edges = _edges(lead_in_s, max(float(time[-1]) for time in seconds.values()))
        noise_of = {name: (sd, record.display_sd[name]) for name, sd in record.white_sd.items()}
        parts, across = _condensed_all(series, seconds, edges, noise_of, heading_rad, lead_in_s)
        times = np.unique(np.concatenate([part.time_s for part in (*parts, *across)]))
        speed = _speed(parts, lead_in_s)
        shaft_s = run_down.shaft_s if run_down.by_shaft else 0.0
        stop = Stop(since_ns, lead_in_s, heading_rad, speed, shaft_s)
        to_port = measured(across, times) if across else None
        return cls(
            name,
            lead_in_s,
            times,
            run_down.stop_sd_s,
            *(_stated_run_down(ship) or (run_down.shaft_s, run_down.shaft_sd_s)),
            heading_rad,
            heading_sd,
            speed,
            measured(parts, times),
            to_port,
            np.zeros((0, 0))
            if to_port is None
            else whitener_of(to_port, ship, speed, lead_in_s, run_down.stop_sd_s),
            Context.of(window, ship, times, stop),
            replace(ship, effects=()),
            stop_moved_s,
        )


def _stated_run_down(ship: Ship) -> tuple[float, float] | None:
    """Return the run-down of the thrust and its sd, where the ship file states it."""
    return None if ship.propulsion is None else (ship.propulsion.run_down_s, ship.propulsion.sd)


def _stopped(window: Window, run_down: RunDown, record: RunRows) -> RunDown:
    """Move the stop to where the speed begins to fall, if there is a speed."""
    assert window.before is not None
    for input_ in ('speed_through_water', 'speed_over_ground'):
        if input_ in record.white_sd:
            both = _joined(getattr(window.before, input_), getattr(window, input_), 0)
            stop_s = stop_time_s(
                np.asarray((both.time_ns - run_down.stop_ns) * 1e-9, np.float64),
                both.value,
                sd_m_s=record.white_sd[input_],
                run_down_s=run_down.shaft_s,
            )
            return replace(run_down, stop_ns=run_down.stop_ns + round(stop_s * 1e9))
    return run_down


def _joined(before: Series, after: Series, since_ns: int) -> Series:
    first = int(np.searchsorted(before.time_ns, since_ns))
    return Series(
        np.concatenate([before.time_ns[first:], after.time_ns]),
        np.concatenate([before.value[first:], after.value]),
        np.concatenate([before.variance[first:], after.variance]),
    )


def _edges(lead_in_s: float, end_s: float) -> Float64:
    """Return the edges of the bins, one of them at the stop."""
    steady = np.arange(lead_in_s, 0.0, -BIN_S)[::-1]
    widths: list[float] = []
    total = 0.0
    longest = max(LONGEST_S, (end_s - lead_in_s) / LONGEST_PART)
    while total < end_s - lead_in_s:
        widths.append(min(FIRST_S * GROWTH ** len(widths), longest))
        total += widths[-1]
    return np.concatenate([[-1.0], steady, lead_in_s + np.cumsum(widths)])


def _kept(value: Float64, sd: float) -> NDArray[np.bool_]:
    """Say what does not stand out from its neighbours."""
    away = np.abs(value - median_filter(value, NEIGHBOURS, mode='nearest'))
    keep: NDArray[np.bool_] = away <= OUTLIER * max(sd, float(np.median(away)))
    return keep


def _condensed(
    time_s: Float64,
    value: Float64,
    edges: Float64,
    noise: tuple[float, float],
    kind: int,
    lead_in_s: float,
) -> CondensedRows:
    """
    Return means, by the noise of a sample and what its last digit hides.

    Behind a filter, and in a swell, samples err alike for seconds: what their means scatter by
    in the steady record says how many count for one. Rounding errs alike while the signal
    stands, and averages out as it moves on.
    """
    when, mean, count = bin_means(time_s, value, edges)
    steady = time_s < lead_in_s
    sd, display = noise
    if kind != POSITION and steady.any():
        evenly = np.arange(0.0, lead_in_s, _ALIKE_S)
        _, means, counts = bin_means(time_s[steady], value[steady], evenly)
        sd = max(sd, white_sd(means) * math.sqrt(float(np.median(counts))))
    variance = sd**2 / count
    if display > _LEAST_DISPLAY * sd and len(mean) > 1:
        # both are sd of a uniform spread; as many errors are independent as digits are passed
        moved = np.clip(np.abs(np.gradient(mean)) / math.sqrt(12.0), display, None)
        variance += display**2 / np.minimum((moved / display) ** 2, count)
    return CondensedRows(when, kind, mean, variance)


def _condensed_all(
    series: dict[str, Series],
    seconds: dict[str, Float64],
    edges: Float64,
    noise_of: Mapping[str, tuple[float, float]],
    heading_rad: float,
    lead_in_s: float,
) -> tuple[list[CondensedRows], list[CondensedRows]]:
    """Return the rows along the heading, and those to port of it."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    along: list[CondensedRows] = []
    across: list[CondensedRows] = []
    for input_, found in series.items():
        noise, time = noise_of[input_], seconds[input_]
        sd = noise[0]
        if input_ != 'position':
            keep = _kept(found.value, sd)
            along.append(
                _condensed(time[keep], found.value[keep], edges, noise, CODES[input_], lead_in_s)
            )
            continue
        east, north = (found.value - found.value[0]).T
        ahead, to_port = cos * east + sin * north, cos * north - sin * east
        keep = _kept(ahead, sd) & _kept(to_port, sd)
        along.append(_condensed(time[keep], ahead[keep], edges, noise, POSITION, lead_in_s))
        across.append(_condensed(time[keep], to_port[keep], edges, noise, POSITION, lead_in_s))
    return along, across


def _heading(
    window: Window,
    series: dict[str, Series],
    seconds: dict[str, Float64],
    lead_in_s: float,
    parameters: Parameters,
) -> tuple[float, float]:
    """Return direction through water in the lead-in, and its sd: compass, or else course."""
    assert window.before is not None
    yaw = window.before.heading.value
    if len(yaw):
        mean = math.atan2(float(np.sin(yaw).mean()), float(np.cos(yaw).mean()))
        if parameters.heading_convention == 'compass':
            mean = 0.5 * math.pi - mean
        return mean, _COMPASS_SD_RAD
    if 'position' not in series:
        return 0.0, 0.0
    steady = seconds['position'] < lead_in_s
    time = seconds['position'][steady]
    place = series['position'].value[steady]
    slopes = [float(np.polyfit(time - time.mean(), place[:, i], 1)[0]) for i in range(2)]
    return math.atan2(slopes[1], slopes[0]), _COURSE_SD_RAD


def _speed(parts: list[CondensedRows], lead_in_s: float) -> float:
    for part in sorted(parts, key=lambda part: part.kind):
        steady = part.time_s < lead_in_s
        if steady.sum() < _LEAST_ROWS:
            continue
        if part.kind in (LOG, OVER_GROUND):
            return float(np.median(part.value[steady]))
        return float(np.polyfit(part.time_s[steady], part.value[steady], 1)[0])
    raise DiagnosisError(
        f'{lead_in_s:.0f} s before the stop hold too few samples of any speed or position'
    )
