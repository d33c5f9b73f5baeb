# SPDX-License-Identifier: Apache-2.0
"""
From a window to rows: means over times in which the motion is even, the record before it too.

Sensor noise is what differs from sample to sample; what stays is left in the means, for
`inference.learning`. A reading is right with normal noise, or with a small chance anything within
the range of its input. Its weight in a mean is the probability that it is right, so nothing is
rejected by a rule.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.distance import along_track, evaluate, refit
from shipdrag_ros.estimation.run_down import RunDown
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.inference.rows import (
    CODES,
    KIND_COUNT,
    MAD_TO_SD,
    OUTLIER,
    POSITION,
    Rows,
    block_medians,
)
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.priors import STATED_POWER
from shipdrag_ros.samples import Float64, Int64

BIN_S = 30.0  # a steady record is condensed to its means over this
FINE_S = 5.0  # near the stop
_BLOCK_S = 60.0
_UNSTEADY = 0.06  # of the speed: a block that differs by more ends the steady record
_TURNED_RAD = 0.15  # a block on another course does too
_FIRST_PART, _FIRST_S, _GROWTH = 60.0, 3.0, 1.06  # of all, longest, and from one to the next
_LONGEST_PART, _LONGEST_S = 80.0, 12.0
_QUICK = 0.5  # of the number of parts, where time is short
_EVEN = 0.05  # of the time in which the speed halves: its mean is 3e-4 off that of a straight line
_NEIGHBOURS = 9  # whose medians show where a reading should be, and how fast it changes


def display_sd(value: Float64, white_sd: float) -> float:
    """
    Return what the last digit of a display hides from a mean of a steady signal.

    Parameters
    ----------
    value : (n,) or (n, 2)
        Of a signal that moves.
    white_sd
        Of its noise, in which a coarse display is lost.

    Notes
    -----
    Rounding to q errs by up to q / 2 and always alike while the signal stands; noise
    averages that to a part exp(-2 pi^2 sd^2 / q^2) (Widrow's theorem, its first term).
    """
    if value.ndim == 2:  # a course due north has nothing in the east
        return max(display_sd(column, white_sd) for column in value.T)
    levels = np.unique(value)
    if len(levels) < 2:
        return 0.0
    quantum = float(np.median(np.diff(levels)))
    left = math.exp(-2.0 * (math.pi * white_sd / quantum) ** 2)
    return quantum / math.sqrt(12.0) * left


@compiled
def weighted_white_sd(value: Float64, weight: Float64) -> float:
    """
    Return the standard deviation of white noise on a smooth signal, at a weight of 1.

    Parameters
    ----------
    value, weight : (n,)
        In ascending time; the variance is that at a weight of 1 over the weight.

    Notes
    -----
    From second differences, whose outliers are clipped; 0 where n < 4.
    """
    if len(value) < 4:
        return 0.0
    second = value[2:] - 2.0 * value[1:-1] + value[:-2]
    spread = (1.0 / weight[2:] + 4.0 / weight[1:-1] + 1.0 / weight[:-2]) / 6.0
    size = np.abs(second) / np.sqrt(spread)
    typical = MAD_TO_SD * np.median(size)
    if typical > 0.0:
        size = size[size < 4.0 * typical]
    return float(np.sqrt(np.mean(size * size) / 6.0))


@compiled
def steady_since(time_s: Float64, speed: Float64, heading_s: Float64, heading: Float64) -> float:
    """
    Return the time from which a record has been steady to its end.

    Parameters
    ----------
    time_s, speed : (n,)
        Ascending.
    heading_s, heading : (m,)
        Yaw [rad]; may be empty.
    """
    if len(time_s) == 0:
        return np.inf
    # the stop may be earlier than it was taken for: the last block shows nothing of the speed
    late = settled = float(time_s[-1]) - _BLOCK_S
    last = np.searchsorted(time_s, late - 2.0 * _BLOCK_S, side='right')
    level = np.median(speed[last : np.searchsorted(time_s, late, side='right')])
    course = np.nan
    late += _BLOCK_S
    while late - _BLOCK_S > time_s[0]:
        early = late - _BLOCK_S
        first = np.searchsorted(time_s, early, side='right')
        end = np.searchsorted(time_s, late, side='right')
        differs = end > first and abs(np.median(speed[first:end]) - level) > _UNSTEADY * level
        if differs and late <= settled:
            return late
        first = np.searchsorted(heading_s, early, side='right')
        end = np.searchsorted(heading_s, late, side='right')
        if end > first:
            yaw = heading[first:end]
            mean = math.atan2(np.sin(yaw).mean(), np.cos(yaw).mean())
            if math.isnan(course):
                course = mean
            if abs(math.atan2(math.sin(mean - course), math.cos(mean - course))) > _TURNED_RAD:
                return late
        late = early
    return float(time_s[0])


@compiled
def steady_means(
    time_s: Float64, value: Float64, weight: Float64, bin_s: float, fine_s: float
) -> tuple[Float64, Float64, Float64]:
    """
    Return means over `bin_s` of a record that is steady.

    Parameters
    ----------
    time_s, value, weight : (n,)
        n >= 1; the weight is 1 for a sample that is as good as most.
    bin_s
    fine_s
        At the end of the record means are over `FINE_S` for so long: the stop
        may have been earlier than it was taken for.

    Returns
    -------
    time_s, value, weight : (b,)
        The weight is the sum of those of the samples.
    """
    # outliers are found by what is near in time: the record may drift, and at its end slow down
    edges = _edges(time_s, 2.0 * _BLOCK_S, fine_s)
    near = np.interp(time_s, block_medians(time_s, edges), block_medians(value, edges))
    away = np.abs(value - near)
    # of a coarse display most readings are the median itself: that does not show the scatter
    scatter = max(MAD_TO_SD * np.median(away), weighted_white_sd(value, np.ones(len(value))))
    keep = away <= OUTLIER * scatter
    time_s, value, weight = time_s[keep], value[keep], weight[keep]
    edges = _edges(time_s, bin_s, fine_s)
    bins = len(edges) - 1
    mean_s, mean, total = np.zeros(bins), np.zeros(bins), np.zeros(bins)
    for i in range(bins):
        for j in range(edges[i], edges[i + 1]):
            total[i] += weight[j]
            mean_s[i] += weight[j] * time_s[j]
            mean[i] += weight[j] * value[j]
    return mean_s / total, mean / total, total


@compiled
def _edges(time_s: Float64, length_s: float, fine_s: float) -> Int64:
    """Return where each part begins, of `FINE_S` in the last `fine_s`, and the end of the last."""
    split = len(time_s)
    if fine_s > 0.0:
        split = np.searchsorted(time_s, time_s[-1] - fine_s)
    edges = np.zeros(1, np.int64)
    if split > 0:
        edges = _parts(time_s[:split], length_s)
    if split < len(time_s):
        edges = np.concatenate((edges, split + _parts(time_s[split:], FINE_S)[1:]))
    return edges


@compiled
def _parts(time_s: Float64, length_s: float) -> Int64:
    """Return where each part of a length begins, and the end of the last."""
    cell = np.floor((time_s - time_s[0]) / length_s)
    inner = np.flatnonzero(cell[1:] != cell[:-1]) + 1
    return np.concatenate((np.zeros(1, np.int64), inner, np.array([len(time_s)])))


LEAST_STAMPS = 12  # of an input: fewer do not show its noise
_ALIKE_S = 12.0  # beyond which such errors are as good as independent
_LEAST_DISPLAY = 0.01  # of the noise of a sample, from where a display's last digit counts
_FINE_S = 60.0  # of the steady record, its end, in which the stop may be
_WeightedRows = tuple[Float64, int, Float64, Float64]


@dataclass(frozen=True)
class RunRows:
    """
    Rows of the coastdown and of the steady record before it.

    Attributes
    ----------
    steady, coast
        Times count from the stop as far as known.
    steady_weight, coast_weight : (m,), (n,)
        How many samples of typical stated variance each row is worth.
    white_sd
        Standard deviation of the white noise of each input used, of such a sample.
    stamps
        Stamps of each input used, in the window.
    display_sd
        Of each input used: what the last digit hides from a mean of the steady record.
    notes
        A sentence for each input that is left out.
    """

    steady: Rows
    steady_weight: Float64
    coast: Rows
    coast_weight: Float64
    white_sd: dict[str, float]
    stamps: dict[str, Int64]
    display_sd: dict[str, float]
    notes: tuple[str, ...]

    @classmethod
    def of(
        cls,
        window: Window,
        run_down: RunDown,
        parameters: Parameters,
        *,
        heading_rad: float | None = None,
    ) -> RunRows:
        """
        Take what a window offers.

        Parameters
        ----------
        window
        run_down
            Its stop is time 0.
        parameters
            The known standard deviations are used.
        heading_rad
            Along which positions count, from east; None: along their track.

        Raises
        ------
        EstimationError
            If no input has enough samples, or none can be used.
        """
        inputs = {
            name: series for name in CODES if len(series := window.series(name)) >= LEAST_STAMPS
        }
        if not inputs:
            found = ', '.join(
                f'{name} {len(window.series(name))}' for name in CODES if name in window.motion
            )
            raise EstimationError(
                f'samples in the window: {found}; a fit of the motion needs {LEAST_STAMPS} of '
                'one of them: give a longer window'
            )
        _check_finite(inputs)
        zero_ns = run_down.stop_ns
        known = {
            name: parameters.position_sigma_m if _is_place(name) else parameters.speed_sigma_m_s
            for name in inputs
        }
        since = -np.inf if window.before is None else _steady_since(window, inputs, zero_ns)
        each_input, refused = {}, {}
        for name in inputs:
            try:
                each_input[name] = _condensed(
                    name, window, zero_ns, since, known[name], heading_rad
                )
            except EstimationError as error:
                refused[name] = error
        if not each_input:
            raise next(iter(refused.values()))
        steady = _merge([each.steady for each in each_input.values() if each.steady is not None])
        coast = _merge([each.coast for each in each_input.values()])
        return cls(
            *steady,
            *coast,
            {name: each.white_sd for name, each in each_input.items()},
            {name: inputs[name].time_ns for name in each_input},
            {name: each.display_sd for name, each in each_input.items()},
            tuple(f'without {name}: {error}' for name, error in refused.items()),
        )

    @property
    def steady_s(self) -> float:
        """Length of the steady record [s]."""
        return float(np.ptp(self.steady.time_s)) if len(self.steady.time_s) else 0.0

    def _variance(self, rows: Rows, weight: Float64) -> Float64:
        """Return that of the white noise of rows that are worth so many samples."""
        of_kind = np.zeros(len(CODES))
        for name, sd in self.white_sd.items():
            of_kind[CODES[name]] = sd**2
        return np.asarray(of_kind[rows.kind] / weight, np.float64)

    def condensed(
        self, speed_m_s: float, halved_s: float, *, quick: bool = False
    ) -> tuple[Rows, Float64]:
        """
        Return all rows as means, and the variance of their white noise.

        Parameters
        ----------
        speed_m_s, halved_s
            At the stop, and the time in which it halves, roughly.
        quick
            Whether fewer means will do.
        """
        white = self._variance(self.coast, self.coast_weight)
        coast, after = condense(self.coast, white, speed_m_s, halved_s, quick=quick)
        rows = Rows(*(np.concatenate([a, b]) for a, b in zip(self.steady, coast)))
        before = self._variance(self.steady, self.steady_weight)
        variance: Float64 = np.concatenate([before, after])
        for name, hidden in self.display_sd.items():
            own = rows.kind == CODES[name]
            if hidden > _LEAST_DISPLAY * self.white_sd[name] and own.sum() > 1:
                # rounding errs alike while a speed stays on one digit; as many errors are
                # independent as digits are passed
                count = self.white_sd[name] ** 2 / variance[own]
                passed = np.abs(np.gradient(rows.value[own])) / math.sqrt(12.0) / hidden
                variance[own] += hidden**2 / np.clip(passed**2, 1.0, np.maximum(count, 1.0))
        return rows, variance


class _InputRows(NamedTuple):
    """Times, kind, values and weights of one input, and the white noise of its samples."""

    coast: _WeightedRows
    steady: _WeightedRows | None
    white_sd: float
    display_sd: float


def _condensed(
    name: str,
    window: Window,
    zero_ns: int,
    since_s: float,
    known_sd: float,
    heading_rad: float | None,
) -> _InputRows:
    """Take one input as it is from the stop on, and as means from `since_s` up to it."""
    series = window.series(name)
    time_s, value = _seconds(series.time_ns, zero_ns), series.value
    before_s: Float64 = np.empty(0)
    before, variance = value[:0], series.variance[:0]
    if window.before is not None:
        earlier = window.before.series(name)
        before_s = _seconds(earlier.time_ns, zero_ns)
        keep = before_s >= since_s
        before_s, before, variance = before_s[keep], earlier.value[keep], earlier.variance[keep]
    both_s = np.concatenate([before_s, time_s])
    both = np.concatenate([before, value])
    if _is_place(name):
        both = _distance(both_s, both) if heading_rad is None else _ahead(both, heading_rad)
    before, value = both[: len(before_s)], both[len(before_s) :]
    weight = stated_weight(both_s, both, np.concatenate([variance, series.variance]))
    white_sd = max(weighted_white_sd(both, weight), 1e-6 * float(np.ptp(value)), 1e-9)
    steady: _WeightedRows | None = None
    if len(before_s):
        own, rate = weight[: len(before_s)], 0.0
        if _is_place(name):
            rate = _rate(before_s, before)
        else:
            # behind a filter, and in a swell, readings err alike for seconds
            _, each, total = steady_means(before_s, before, own, _ALIKE_S, 0.0)
            white_sd = max(white_sd, weighted_white_sd(each, total))
        at_s, mean, count = steady_means(before_s, before - rate * before_s, own, BIN_S, _FINE_S)
        steady = (at_s, CODES[name], mean + rate * at_s, count)
    white_sd = known_sd or white_sd
    coast = (time_s, CODES[name], value, weight[len(before_s) :])
    return _InputRows(coast, steady, white_sd, display_sd(series.value, white_sd))


def _rate(time_s: Float64, value: Float64) -> float:
    """Return how fast a value changes, by the median of its halves."""
    half = len(value) // 2
    if not half:
        return 0.0
    return float(np.median((value[half:] - value[:-half]) / (time_s[half:] - time_s[:-half])))


def _is_place(name: str) -> bool:
    return CODES[name] % KIND_COUNT == POSITION


def _check_finite(inputs: dict[str, Series]) -> None:
    for name, series in inputs.items():
        bad = int((~np.isfinite(series.value)).sum())
        if bad:
            raise EstimationError(
                f'{name}: {bad} value(s) are not finite: give accepted samples only'
            )


def _seconds(time_ns: Int64, zero_ns: int) -> Float64:
    return np.asarray((time_ns - zero_ns) * 1e-9, np.float64)


def _merge(parts: list[_WeightedRows]) -> tuple[Rows, Float64]:
    """Sort rows of several inputs by time; ties keep the order of the inputs."""
    if not parts:
        return Rows(np.empty(0), np.empty(0, np.int64), np.empty(0)), np.empty(0)
    time_s, value, weight = (np.concatenate([part[i] for part in parts]) for i in (0, 2, 3))
    kind = np.concatenate([np.full(len(part[0]), part[1], np.int64) for part in parts])
    order = np.argsort(time_s, kind='stable')
    return Rows(time_s[order], kind[order], value[order]), weight[order]


def _steady_since(window: Window, inputs: dict[str, Series], zero_ns: int) -> float:
    """Return the time [s after the stop] from which the record before is steady."""
    assert window.before is not None
    heading = window.before.heading
    heading_s = _seconds(heading.time_ns, zero_ns)
    in_order = sorted(inputs, key=lambda name: CODES[name] % KIND_COUNT)
    every = {name: window.before.series(name) for name in in_order}
    heard = {name: series for name, series in every.items() if len(series) >= LEAST_STAMPS}
    if not heard:
        return np.inf
    name, series = next(iter(heard.items()))
    if not _is_place(name):
        time_s = _seconds(series.time_ns, zero_ns)
        return float(steady_since(time_s, series.value, heading_s, heading.value))
    # positions alone do not show it from sample to sample: by their means
    time_s = _seconds(series.time_ns, zero_ns)
    edges = np.arange(time_s[-1], time_s[0] - 60.0, -60.0)[::-1]
    blocks = np.searchsorted(time_s, edges)
    rows = [
        (time_s[a:b].mean(), series.value[a:b].mean(axis=0)) for a, b in pairwise(blocks) if b > a
    ]
    if len(rows) < 3:
        return np.inf
    when = np.array([row[0] for row in rows])
    where = np.array([row[1] for row in rows])
    speed = np.hypot(*(np.diff(where, axis=0) / np.diff(when)[:, None]).T)
    return float(steady_since(0.5 * (when[1:] + when[:-1]), speed, heading_s, heading.value))


def _distance(time_s: Float64, position: Float64) -> Float64:
    scale = 0.5 * float(np.ptp(time_s))
    return along_track((time_s - time_s[0]) / scale - 1.0, position)


def _ahead(position: Float64, heading_rad: float) -> Float64:
    along = [math.cos(heading_rad), math.sin(heading_rad)]
    return np.asarray((position - position[0]) @ along, np.float64)


_ORDER = 12  # of the polynomial that stands for the motion
_RANGE = 100.0  # of a variance over the typical one, up and down
_OF_LOG_CHI2 = np.pi / np.sqrt(2.0)  # sd of ln(z^2) of a standard normal z
_LEAST = 1e-12  # of the largest residual: none is 0


def stated_weight(time_s: Float64, value: Float64, variance: Float64) -> Float64:
    """
    Return the weight of each sample, 1 for the typical stated variance.

    Parameters
    ----------
    time_s, value : (n,)
        In ascending time.
    variance : (n,), of a position (n, 2)
        One that is not above 0 and finite is not stated.

    Returns
    -------
    (n,)
        All 1 where a sample states no variance, or all state the same one.

    Notes
    -----
    The variance is that stated to a power, found from how the logarithm of the squared residual
    of a polynomial follows that of the stated variance; before, 1 +- 0.5, and within 0 to 1.
    """
    ones = np.ones(len(value))
    if len(value) <= _ORDER or not np.all(variance[0] > 0.0) or np.all(variance == variance[0]):
        return ones
    variance = variance.reshape(len(value), -1).mean(axis=1)
    if not np.all(np.isfinite(variance) & (variance > 0.0)):
        return ones
    log = np.log(np.clip(variance / np.median(variance), 1.0 / _RANGE, _RANGE))
    middle = 0.5 * (time_s[0] + time_s[-1])
    time = (time_s - middle) / (time_s[-1] - middle)
    size = np.abs(value - evaluate(refit(time, value, _ORDER), time, _ORDER)[0])
    follows = 2.0 * np.log(size + _LEAST * float(size.max()) + np.finfo(np.float64).tiny)
    away = log - log.mean()
    spread = float((away * away).sum())
    precision, of_prior = spread / _OF_LOG_CHI2**2, 1.0 / STATED_POWER.sd**2
    found = float((away * follows).sum()) / spread
    power = (precision * found + of_prior * STATED_POWER.mean) / (precision + of_prior)
    return np.asarray(np.exp(-min(max(power, 0.0), 1.0) * log), np.float64)


@compiled
def right(time_s: Float64, value: Float64, sd: Float64, wrong: float) -> Float64:
    """
    Return the probability of each reading that it is right.

    Parameters
    ----------
    time_s, value, sd : (n,)
        Of one input, in ascending time, with the standard deviation of its white noise.
    wrong
        Chance that a reading is anything.
    """
    n, size = len(value), min(_NEIGHBOURS, len(value))
    found, near = np.ones(n), np.empty(n)
    spread = max(value.max() - value.min(), 1e-12)
    half = size // 2
    for i in range(n):
        low = min(max(0, i - half), n - size)
        when, near_by = time_s[low : low + size] - time_s[i], value[low : low + size]
        slope = 0.0
        if half:
            # at either end of a record all neighbours are on one side
            apart = np.maximum(when[half:] - when[: size - half], 1e-9)
            slope = np.median((near_by[half:] - near_by[: size - half]) / apart)
        near[i] = np.median(near_by - slope * when)
    # slow errors and the motion move readings from the median of their neighbours
    away = np.abs(value - near)
    wander = 1.4826 * np.median(away)
    for i in range(n):
        width = max(sd[i], wander)
        good = (1.0 - wrong) * np.exp(-0.5 * (away[i] / width) ** 2) / (2.5066 * width)
        found[i] = max(good / (good + wrong / spread), 1e-9)
    return found


def edges_of(
    end_s: float, start_s: float = 0.0, halved_s: float = np.inf, *, quick: bool = False
) -> Float64:
    """
    Return the edges of bins from a start to an end; short where the motion changes.

    Parameters
    ----------
    end_s, start_s
    halved_s
        In which the speed halves, from the start on.
    quick
        Whether fewer will do.
    """
    fewer = _QUICK if quick else 1.0
    longest = max(_LONGEST_S, (end_s - start_s) / _LONGEST_PART) / fewer
    first = min(_FIRST_S, (end_s - start_s) / _FIRST_PART)
    even = _EVEN * halved_s * np.exp(_EVEN * np.arange(400.0))
    widths = np.minimum(np.minimum(first * _GROWTH ** np.arange(400), longest), even)
    edges = start_s + np.concatenate([[0.0], np.cumsum(widths)])
    return np.asarray(edges[: np.searchsorted(edges, end_s, side='right') + 1], np.float64)


def _crude(rows: Rows, speed_m_s: float, halved_s: float) -> Float64:
    """Return what rows would read of a motion of quadratic drag; 0 where none is known."""
    if not np.isfinite(halved_s):
        return np.zeros(len(rows.time_s))
    since = 1.0 + np.maximum(rows.time_s - rows.time_s[0], 0.0) / halved_s
    way = speed_m_s * halved_s * np.log(since)
    return np.asarray(np.where(rows.of(POSITION), way, speed_m_s / since), np.float64)


def condense(
    rows: Rows,
    variance: Float64,
    speed_m_s: float = 0.0,
    halved_s: float = np.inf,
    *,
    quick: bool = False,
) -> tuple[Rows, Float64]:
    """
    Average readings over bins.

    Parameters
    ----------
    rows
        Readings in ascending time.
    variance : (n,)
        Of their white noise.
    speed_m_s, halved_s
        At the start, and the time in which it halves, roughly: what bends there is no error.
    quick
        Whether fewer bins will do.

    Returns
    -------
    rows, variance
        In ascending time; a bin without readings is left out.
    """
    edges = edges_of(float(rows.time_s[-1]), float(rows.time_s[0]), halved_s, quick=quick)
    bent = rows.value - _crude(rows, speed_m_s, halved_s)
    times, kinds, values, variances = [], [], [], []
    for kind in np.unique(rows.kind):
        chosen = rows.kind == kind
        time_s, value, sd = rows.time_s[chosen], rows.value[chosen], np.sqrt(variance[chosen])
        weight = right(time_s, bent[chosen], sd, priors.WRONG.mean) / sd**2
        cell = np.searchsorted(edges, time_s, side='right')
        first = np.concatenate([[0], np.flatnonzero(np.diff(cell)) + 1])
        total = np.add.reduceat(weight, first)
        times.append(np.add.reduceat(weight * time_s, first) / total)
        values.append(np.add.reduceat(weight * value, first) / total)
        variances.append(1.0 / total)
        kinds.append(np.full(len(first), kind, np.int64))
    time_s = np.concatenate(times)
    order = np.argsort(time_s, kind='stable')
    found = Rows(time_s[order], np.concatenate(kinds)[order], np.concatenate(values)[order])
    return found, np.concatenate(variances)[order]
