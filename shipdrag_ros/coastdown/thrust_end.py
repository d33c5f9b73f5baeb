# SPDX-License-Identifier: Apache-2.0
"""
When the thrust is gone, by the speed alone.

While the thrust runs down slowly, or one shaft stops after another, the
deceleration grows; from where the thrust is gone it falls with the speed. So the
speed bends twice: where the stop begins and where it ends. By v' = -c v^p the speed
is transformed so that it falls along straight lines; two bends are then
compared with one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.coastdown.readings import LEAST_READINGS, clean_readings, means, seconds
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.samples import Float64

_STEP_S = 5.0  # of the means of the speed, and between bends that are tried
_BEFORE_S, _AFTER_S = 300.0, 500.0  # of the record about the onset
_LEAST_S = 150.0  # of the record after it, however fast the speed falls
_LEFT = 0.55  # of the first speed: one power law goes no further
_LEAST_STEPS = 40
_EARLIEST_S, _LATEST_S = -100.0, 200.0  # of a bend, after the onset
_LONGEST_S = 240.0  # between two bends
_QUICK_S = 15.0  # the same where it is no slow run-down
# A quick stop: a run-down and the filter of a log, each of such a time constant; ...
_LAGS_S = (3.0, 6.0, 9.0)
_FILTER_S = 10.0  # ... or that of the ship file, or half of what this and that make together
_QUICK_AT_S = np.arange(-40.0, 61.0, 2.0)  # of its beginning, after the onset
_COASTS_S = 60.0  # after the second bend at least, ...
_COASTS = 1.5  # ... and this times what is between the two
_SHARE = (0.2, 0.65)  # of the whole deceleration that there is between the two
_POWERS = np.array([1.5, 2.0, 2.5, 3.0, 3.5])  # p
_POWER, _POWER_SD = 2.4, 0.7  # of hulls
# Gain of chi^2 over the best quick stop; in proportion more where the bends are further apart,
# as gusts that last so long are stronger.
_SIGNIFICANT, _GUST_S = 3.5, 25.0
_EBBS_S = 10.0  # after the second bend, by which thrust that falls evenly is gone
_LAG_S = 5.0  # of the filter of a log
# of the noise of neighbours: speeds from positions swing, those of a log wander slowly
_ALIKE_LOG, _ALIKE_TRACK = (0.0, 0.97), (-0.47, 0.97)
_ROUNDS = 3


@dataclass(frozen=True)
class ThrustEnd:
    """
    A slow end of the thrust.

    Attributes
    ----------
    began_s, ended_s
        When the deceleration began and ceased to grow, after the start of the window [s].
    sd_s
        Standard deviation of `ended_s`.
    """

    began_s: float
    ended_s: float
    sd_s: float


def thrust_end(window: Window, run_down_s: float = 0.0) -> ThrustEnd | None:
    """
    Find the end of a growing deceleration.

    Parameters
    ----------
    window
        From an onset on, with the steady record `before` it.
    run_down_s
        Time constant of a quick stop of this ship.

    Returns
    -------
    ThrustEnd or None
        None where the deceleration is there at once, as far as the speed shows.
    """
    found = _about_onset(window)
    if found is None:
        return None
    time_s, speed, alike = found
    ebbs_s = _EBBS_S - (_LAG_S if alike is _ALIKE_LOG else 0.0)
    at = np.arange(_EARLIEST_S, _LATEST_S + 1.0, _STEP_S)
    at = at[at <= time_s[-1] - _COASTS_S]
    apart = at - at[:, np.newaxis]
    left_s = time_s[-1] - np.broadcast_to(at, apart.shape)
    allowed = (apart >= 0.0) & (apart <= _LONGEST_S) & (left_s >= _COASTS * apart)
    lags_s = (*_LAGS_S, max(run_down_s, _STEP_S), 0.5 * (run_down_s + _FILTER_S))
    bends, lagged = _chi2(time_s, speed, at, lags_s, alike)
    slow = np.where(allowed & (apart > _QUICK_S), bends, np.inf)
    quick = min(lagged, float(np.min(bends[allowed & (apart <= _QUICK_S)])))
    began, ended = np.unravel_index(np.argmin(slow), slow.shape)
    least = float(slow[began, ended])
    needed = _SIGNIFICANT * max(1.0, apart[began, ended] / _GUST_S)
    if not quick - least > needed:
        return None
    weight = np.exp(0.5 * (least - slow)).sum(axis=0)
    weight /= weight.sum()
    variance = float(weight @ at**2 - (weight @ at) ** 2) + _STEP_S**2 / 12.0
    return ThrustEnd(float(at[began]), float(at[ended]) + ebbs_s, variance**0.5)


def _about_onset(window: Window) -> tuple[Float64, Float64, tuple[float, float]] | None:
    """Return means of the speed about the onset, and how alike neighbours may be."""
    if window.before is None:
        return None
    parts = (window.before, window)
    end_s = min(_AFTER_S, (window.end_ns - window.start_ns) * 1e-9)
    edges = np.arange(-_BEFORE_S, end_s + 0.5 * _STEP_S, _STEP_S)
    alike = _ALIKE_LOG
    for name in ('speed_through_water', 'speed_over_ground'):
        if len(getattr(window, name)) >= LEAST_READINGS:
            pieces = [(seconds(getattr(p, name), window), getattr(p, name).value) for p in parts]
            time_s, value = (np.concatenate(piece) for piece in zip(*pieces, strict=True))
            time_s, value = clean_readings(*_inside(time_s, value, edges))
            time_s, speed = means(time_s, time_s, edges), means(time_s, value, edges)
            break
    else:
        alike = _ALIKE_TRACK
        time_s = np.concatenate([seconds(p.position, window) for p in parts])
        place = np.concatenate([p.position.value for p in parts])
        time_s, place = _inside(time_s, place, edges)
        middle = means(time_s, time_s, edges)
        steps = [np.diff(means(time_s, place[:, axis], edges)) for axis in (0, 1)]
        time_s, speed = 0.5 * (middle[1:] + middle[:-1]), np.hypot(*steps) / np.diff(middle)
    there = np.isfinite(speed)
    time_s, speed = time_s[there], speed[there]
    if np.count_nonzero(time_s < 0.0) < LEAST_READINGS:
        return None
    first = float(np.median(speed[time_s < 0.0]))
    slow = time_s[(_smooth(speed) < _LEFT * first) & (time_s > 0.0)]
    kept = (time_s < max(_LEAST_S, slow[0] if len(slow) else np.inf)) & (speed > 0.1 * first)
    if np.count_nonzero(kept) < _LEAST_STEPS or not first > 0.0:
        return None
    return time_s[kept], speed[kept] / first, alike


def _inside(time_s: Float64, value: Float64, edges: Float64) -> tuple[Float64, Float64]:
    kept = (time_s >= edges[0]) & (time_s <= edges[-1])
    return time_s[kept], value[kept]


def _smooth(speed: Float64) -> Float64:
    return np.convolve(np.pad(speed, 2, mode='edge'), np.full(5, 0.2), 'valid')


def _chi2(
    time_s: Float64,
    speed: Float64,
    at: Float64,
    lags_s: tuple[float, ...],
    alike: tuple[float, float],
) -> tuple[Float64, float]:
    """
    Return chi^2 of bends at two of the times `at`, one in the diagonal.

    Each with the power that suits it best. Variance and likeness of neighbours are
    those of what the best of all leaves. The other number is the least chi^2 of a
    single bend that one of the lags rounds.
    """
    ramps = np.maximum(0.0, time_s[:, np.newaxis] - at)
    since_s = np.maximum(0.0, time_s[:, np.newaxis] - _QUICK_AT_S)
    rounded = [
        since_s - 2.0 * lag_s + (since_s + 2.0 * lag_s) * np.exp(-since_s / lag_s)
        for lag_s in lags_s
    ]
    smooth = _smooth(speed)
    tables = []
    for power in _POWERS:
        # the noise is that of the speed, in the straightened speed as here
        weight = smooth**power
        straight = (speed ** (1.0 - power) - 1.0) / (power - 1.0)
        columns = np.column_stack([np.ones(len(time_s)), straight, ramps, *rounded])
        tables.append(columns * weight[:, np.newaxis])
    likeness = 0.0
    prior = ((_POWERS - _POWER) / _POWER_SD) ** 2
    for _ in range(_ROUNDS):
        white = np.split(_whitened(np.hstack(tables), likeness), len(tables), axis=1)
        found = [_sums_of_squares(table, len(at)) for table in white]
        sums, lagged = (np.array(sums) for sums in zip(*found, strict=True))
        variance = max(float(sums.min()) / (len(time_s) - 6), 1e-12)
        chi2 = sums / variance + prior[:, np.newaxis, np.newaxis]
        best, one, two = np.unravel_index(np.argmin(chi2), chi2.shape)
        table = tables[best][:, [0, *{2 + one, 2 + two}]]
        straight = tables[best][:, 1]
        left = straight - table @ np.linalg.lstsq(table, straight, rcond=None)[0]
        likeness = float(np.clip(left[1:] @ left[:-1] / (left @ left), *alike))
    return chi2.min(axis=0), float(np.min(lagged / variance + prior))


def _whitened(table: Float64, likeness: float) -> Float64:
    """
    Whiten columns: noise that fades, or, where neighbours are opposed, differences.

    The inverse Cholesky factor of a first-order autoregression, or of a first-order
    moving average, applied row by row: both have two diagonals.
    """
    white = table.copy()
    if likeness >= 0.0:
        white[1:] = (table[1:] - likeness * table[:-1]) / np.sqrt(1.0 - likeness**2)
        return white
    size = 1.0
    for i in range(1, len(table)):
        below = likeness / size
        size = np.sqrt(1.0 - below * below)
        white[i] = (table[i] - below * white[i - 1]) / size
    return white


def _sums_of_squares(table: Float64, count: int) -> tuple[Float64, float]:
    """
    Return what is left by each pair of bends, and by the best rounded one.

    inf where two do not both steepen the fall.
    """
    level = table[:, 0] / np.linalg.norm(table[:, 0])
    rest = table[:, 1:] - np.outer(level, level @ table[:, 1:])
    straight, ramps, rounded = rest[:, 0], rest[:, 1 : count + 1], rest[:, count + 1 :]
    total = straight @ straight
    mixed, along = ramps.T @ ramps, ramps.T @ straight
    size = np.diag(mixed)
    one, two = np.triu_indices(count, 1)
    mix, a, b = mixed[one, two], along[one], along[two]
    # the same line twice where a gap in the record holds both
    area = np.maximum(size[one] * size[two] - mix**2, 1e-9 * size[one] * size[two])
    first, second = (size[two] * a - mix * b) / area, (size[one] * b - mix * a) / area
    share = first / np.maximum(first + second, 1e-300)
    steepens = (first > 0.0) & (second > 0.0) & (share > _SHARE[0]) & (share < _SHARE[1])
    left = np.full(mixed.shape, np.inf)
    left[one, two] = np.where(steepens, total - first * a - second * b, np.inf)
    np.fill_diagonal(left, total - np.maximum(along, 0.0) ** 2 / size)
    # one that would begin after the record is none
    fit = np.maximum(np.einsum('ij,ij->j', rounded, rounded), 1e-12)
    gain = np.maximum(rounded.T @ straight, 0.0) ** 2 / fit
    return left, float(total - gain.max())
