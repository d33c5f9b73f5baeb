# SPDX-License-Identifier: Apache-2.0
"""
Several coastdowns of one ship: one r(v), current and log offset taken out.

A current turns with the heading, the offset of a log, which one run takes for a
current, does not: the runs show both, and by its posterior r of each follows
its current. Where no run finds one, it is that under which the curves of runs
over ground agree, their speeds shifted by it. What still differs from run to run (wind, waves,
a current that changes) widens the band.

All are in calm deep water: the weather of one run is not that of another.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.display import short_repr
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.result import Estimate, ForceCurve, ResistanceCurve
from shipdrag_ros.posterior import priors
from shipdrag_ros.samples import Float64

_POINTS = 101
_OPPOSITE = 0.5  # cosine of the angle between runs below which they are separated
_LARGEST_CURRENT = 0.4  # of the lowest speed
_TRIED = 41  # currents, evenly, between two of which the best is sought
_LEAST_SEEN = 1e-3  # of a prior's information: what a run says that has seen nothing


@dataclass(frozen=True)
class Combined(ForceCurve):
    """
    r(v) in calm deep water from several coastdowns, each inside its valid range.

    The mean is weighted by the repeatable variances; the repeatable sigma is widened where the
    runs differ by more than it says.

    Attributes
    ----------
    scatter_m_s2 : (m,)
        Standard deviation of one run about the mean; NaN at speeds that one run alone reaches.
    runs
        How many.
    current_m_s, current_sigma_m_s
        Velocity of the water along the heading of the first run; None where
        the runs do not show it.
    """

    __repr__ = short_repr

    scatter_m_s2: Float64
    runs: int
    current_m_s: float | None
    current_sigma_m_s: float | None


def combine(estimates: Sequence[Estimate], headings_rad: Sequence[float | None]) -> Combined:
    """
    Combine the estimates of several coastdowns of one ship.

    Parameters
    ----------
    estimates
        Two or more.
    headings_rad
        Yaw of each run; None where it is not known.

    Raises
    ------
    EstimationError
        If there are fewer than two, or their valid ranges do not overlap.

    Notes
    -----
    What all runs share by their priors, the errors of the ship file's curve, of
    the log and of n_r, does not average out. What they do not is widened by
    Birge's ratio, the root of chi^2 per degree of freedom between the runs where
    it is above 1.
    """
    if len(estimates) < 2:
        raise EstimationError(f'{len(estimates)} coastdown(s) to combine, give two or more')
    heading = np.array([math.nan if each is None else each for each in headings_rad])
    along = np.cos(heading - heading[0])
    over_ground = np.array([not item.by_log and item.current_m_s is None for item in estimates])
    less, current, current_sigma = _currents(estimates, heading)
    curves = [
        replace(each, resistance_m_s2=each.resistance_m_s2 + more * each.by_current_1_s)
        for each, more in zip([one.valid_calm for one in estimates], less)
    ]
    if current is None and over_ground.any():
        current, current_sigma = _agreement(curves, over_ground, along)
    shifts = np.zeros(len(estimates))
    if current is not None:
        shifts = np.where(over_ground, current * np.nan_to_num(along), 0.0)
    shared = [_shared(*each) for each in zip(estimates, curves)]
    return _mean(curves, shared, shifts, current, current_sigma)


def _currents(
    estimates: Sequence[Estimate], heading_rad: Float64
) -> tuple[Float64, float | None, float | None]:
    """
    Return what each run has found too little of its current, and the current and its sd.

    The current turns with the heading, and is a calm one's other in each run. The error of what
    the runs with a log have found is that of one log, the same on every heading.
    """
    at = [i for i, each in enumerate(estimates) if each.current_sigma_m_s is not None]
    less = np.zeros(len(estimates))
    if not at:
        return less, None, None
    found = [(each.current_m_s, each.current_sigma_m_s, each.by_log) for each in estimates]
    value, sigma, by_log = np.array(found, np.float64)[at].T
    calm = priors.sheltered(max(float(each.calm.speed_m_s[-1]) for each in estimates))
    of_earth = (calm * priors.CURRENT.sd) ** 2
    prior = of_earth * np.nan_to_num(np.cos(heading_rad[:, None] - heading_rad))
    first = prior[0, at]
    alone = of_earth + (calm * priors.CALM_CURRENT.sd) ** 2
    np.fill_diagonal(prior, alone)
    # what each has found is its prior and what it has seen: the prior counts once
    seen = 1.0 / np.maximum(1.0 / sigma**2 - 1.0 / alone, _LEAST_SEEN / alone)
    prior, error = prior[np.ix_(at, at)], np.sqrt(np.outer(by_log * seen, by_log * seen))
    np.fill_diagonal(error, seen)
    weight = np.linalg.inv(prior + error)
    said = weight @ (value * seen / sigma**2)
    less[at] = prior @ said - value
    if not first.any():
        return less, None, None
    variance = of_earth - first @ weight @ first
    return less, float(first @ said), math.sqrt(variance)


def _agreement(
    curves: Sequence[ResistanceCurve], over_ground: np.ndarray, along: Float64
) -> tuple[float | None, float | None]:
    """Find the current under which the runs agree, where they were on opposite headings."""
    known = along[over_ground]
    spread = float(np.nanmax(known) - np.nanmin(known)) if np.isfinite(known).any() else 0.0
    reference = bool((~over_ground).any()) and bool((np.abs(known) > _OPPOSITE).any())
    if np.isnan(known).any() or not (spread > 2.0 * _OPPOSITE or reference):
        return None, None
    bound = _LARGEST_CURRENT * min(float(curve.speed_m_s[0]) for curve in curves)

    def misfit(current: float) -> float:
        try:
            _, r, weight, mean = _mean_r(curves, np.where(over_ground, current * along, 0.0))
        except EstimationError:  # it parts the ranges: of it the runs say nothing
            return math.inf
        return (len(curves) - 1) * _chi2(r, weight, mean)

    from scipy.optimize import minimize_scalar  # slow to import

    tried = np.linspace(-bound, bound, _TRIED)
    costs = [misfit(each) for each in tried]
    least = int(np.argmin(costs))
    if math.isinf(costs[least]):
        return None, None
    around = tried[max(least - 1, 0)], tried[min(least + 1, _TRIED - 1)]
    best = float(minimize_scalar(misfit, bounds=around, method='bounded').x)
    step = 1e-3 + 0.05 * bound
    curvature = (misfit(best + step) - 2.0 * misfit(best) + misfit(best - step)) / step**2
    sigma = math.sqrt(2.0 / curvature) if 0.0 < curvature < math.inf else bound
    return best, sigma


def _grid(curves: Sequence[ResistanceCurve], shifts: Float64) -> tuple[Float64, NDArray[np.bool_]]:
    """Return the speeds (m,), and which runs reach which of them, (runs, m)."""
    lows, highs = np.array([each.speed_m_s[[0, -1]] for each in curves]).T - shifts
    speed = np.linspace(lows.min(), highs.max(), _POINTS)
    slack = 1e-9 * speed[-1]
    reached = (lows[:, None] <= speed + slack) & (speed - slack <= highs[:, None])
    at_each = reached.sum(axis=0)
    if at_each.min() < 1 or at_each.max() < 2:
        raise EstimationError(
            f'the valid ranges of the {len(curves)} coastdowns do not overlap: from '
            f'{lows.max():.3g} m/s up, but to {highs.min():.3g} m/s only; give runs over the same '
            'speeds'
        )
    return speed, reached


def _shared(estimate: Estimate, curve: ResistanceCurve) -> Float64:
    """Return what other runs have too, at the speeds of a curve: of n_r, and of the rest."""
    of_n_r = np.sqrt(np.maximum(curve.sigma_m_s2**2 - curve.sigma_repeatable_m_s2**2, 0.0))
    rest = np.zeros(len(curve))
    if len(estimate.sigma_shared_m_s2):
        rest = np.interp(curve.speed_m_s, estimate.calm.speed_m_s, estimate.sigma_shared_m_s2)
    return np.stack([of_n_r, np.minimum(rest, curve.sigma_repeatable_m_s2)])


def _at(
    curves: Sequence[ResistanceCurve], values: Sequence[Float64], shifts: Float64, speed: Float64
) -> Float64:
    """Return values of each run at shifted speeds, (runs, m)."""
    rows = zip(curves, values, shifts)
    return np.array([np.interp(speed + at, curve.speed_m_s, value) for curve, value, at in rows])


def _mean_r(
    curves: Sequence[ResistanceCurve], shifts: Float64
) -> tuple[Float64, Float64, Float64, Float64]:
    """Return speeds (m,), r of each run, the weights of the runs, and the mean of r."""
    speed, reached = _grid(curves, shifts)
    r = _at(curves, [each.resistance_m_s2 for each in curves], shifts, speed)
    variance = _at(curves, [each.sigma_repeatable_m_s2**2 for each in curves], shifts, speed)
    weight = reached / variance
    return speed, r, weight, (weight * r).sum(axis=0) / weight.sum(axis=0)


def _chi2(r: Float64, weight: Float64, mean: Float64) -> float:
    """Return chi^2 between the runs per degree of freedom, over the speeds that several reach."""
    free = np.maximum((weight > 0.0).sum(axis=0) - 1, 0).sum()
    return float((weight * (r - mean) ** 2).sum() / free)


def _mean(
    curves: Sequence[ResistanceCurve],
    shared: Sequence[Float64],
    shifts: Float64,
    current: float | None,
    current_sigma: float | None,
) -> Combined:
    speed, r, weight, mean = _mean_r(curves, shifts)
    of_n_r, rest = (_at(curves, part, shifts, speed) for part in zip(*shared))
    share = weight / weight.sum(axis=0)
    # what the runs share is in each weight as if it were of that run alone
    common = (share * rest).sum(axis=0) ** 2 - (share**2 * rest**2).sum(axis=0)
    more, first = (weight > 0.0).sum(axis=0) - 1, curves[0]
    excess = max(1.0, _chi2(r, weight, mean))
    there = np.ma.masked_array(r, weight == 0.0)
    scatter = np.where(more > 0, there.std(axis=0, ddof=1).filled(np.nan), np.nan)
    repeatable = np.sqrt(excess / weight.sum(axis=0) + common)
    return Combined(
        speed_m_s=speed,
        resistance_m_s2=mean,
        sigma_m_s2=np.hypot(repeatable, (share * of_n_r).sum(axis=0)),
        sigma_repeatable_m_s2=repeatable,
        scatter_m_s2=scatter,
        froude=speed * float(first.froude[-1] / first.speed_m_s[-1]),
        runs=len(curves),
        current_m_s=current,
        current_sigma_m_s=current_sigma,
    )
