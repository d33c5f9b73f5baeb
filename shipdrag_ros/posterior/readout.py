# SPDX-License-Identifier: Apache-2.0
"""What is read from the one posterior: r(v), its band and the parts of it."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.inference.rows import LOG
from shipdrag_ros.posterior import motion
from shipdrag_ros.posterior.laplace import NormalMixture, RunPosterior
from shipdrag_ros.samples import Float64

_BAND = 0.95
_NORMAL = 1.959964  # sd of a normal distribution within which so much is
_FARTHEST = (1.0 - _BAND) ** -0.5  # sd of any (Chebyshev)
_BAND_AT = 8  # speeds at which the band of a mixture is sought
_STEPS = 4096  # from 0 to the farthest
_SLOPE, _BY_SLOPE = 0.09, 6  # of the probability there, roughly, and how often it is followed
_ROUNDING = 1e-12  # of a correlation


@dataclass(frozen=True)
class ReadOut:
    """
    r at some speeds.

    Attributes
    ----------
    speed_m_s, resistance_m_s2, sigma_m_s2 : (m,)
    slope_1_s, slope_sigma_1_s : (m,)
        dr/dv.
    by_current_1_s : (m,)
        By how much r is another where the current is another: their covariance, as a slope.
    cross : (m, p)
        Covariance with all unknowns, within the band.
    found
    """

    speed_m_s: Float64
    resistance_m_s2: Float64
    sigma_m_s2: Float64
    slope_1_s: Float64
    slope_sigma_1_s: Float64
    by_current_1_s: Float64
    cross: Float64
    found: RunPosterior

    @property
    def n_r_m_s2(self) -> Float64:
        """The part of sigma that would go if n_r were known."""
        at = self.found.problem.coefficients + motion.INERTIA
        part: Float64 = np.abs(self.cross[:, at]) / np.sqrt(self.found.covariance[at, at])
        return np.minimum(part, self.sigma_m_s2)

    @property
    def repeatable_m_s2(self) -> Float64:
        """sigma without what n_r adds, which repeats from run to run."""
        return np.sqrt(np.maximum(self.sigma_m_s2**2 - self.n_r_m_s2**2, 0.0))

    @property
    def shared_m_s2(self) -> Float64:
        """
        What the errors of the ship file's curve and of the instruments as they are expected,
        which are those of her other runs too, put into sigma (m,).

        A posterior covariance V is V (P + D) V, of the errors of prior P and of those of the
        data D.
        """
        causes, problem = _causes(self.found), self.found.problem
        which = [*range(problem.of_hull), *causes['log'], *causes['ground']]
        prior = self.found.family @ (1.0 / problem.families.precision)
        shared: Float64 = np.sqrt(self.cross[:, which] ** 2 @ (1.0 / prior[which]))
        return shared

    @property
    def parts_m_s2(self) -> dict[str, Float64]:
        """
        Parts of sigma by cause (m,): `n_r`, `log`, `ground` (its scale), `held_force`, `wind`,
        `depth`, `law` and `noise`, whose squares add up to its square.

        Each is what would go if the cause were known, of what those before it leave (a Cholesky
        factor has them).
        """
        causes, variance = _causes(self.found), self.sigma_m_s2**2
        order = [which for each in causes.values() for which in each]
        covariance = self.found.covariance[np.ix_(order, order)]
        sd = np.sqrt(np.diag(covariance))
        # unknowns that follow from others by all digits count where they stand first
        lower = np.linalg.cholesky(covariance / np.outer(sd, sd) + _ROUNDING * np.eye(len(order)))
        due = np.linalg.solve(lower, (self.cross[:, order] / sd).T) ** 2
        parts, first = {}, 0
        for name, which in causes.items():
            parts[name] = due[first : first + len(which)].sum(axis=0)
            first += len(which)
        parts['noise'] = np.maximum(variance - due.sum(axis=0), 0.0)
        return {name: np.sqrt(np.minimum(part, variance)) for name, part in parts.items()}


def read(found: RunPosterior, speed_m_s: Float64, *, without: Collection[str] = ()) -> ReadOut:
    """
    Read r(v) and its band.

    Parameters
    ----------
    found
    speed_m_s : (m,)
        Through water.
    without
        Names of influences that are taken out.
    """
    problem, k = found.problem, found.problem.coefficients
    known, (columns, slopes) = motion.shapes_at(problem.forces, speed_m_s)
    grid, place = problem.law.speed_m_s, problem.of_hull
    for each in problem.influences:
        out = slice(place, place + len(each.columns))
        place += len(each.columns)
        if each.name in without:
            slope = np.gradient(each.known, grid, edge_order=2)
            known -= np.array([np.interp(speed_m_s, grid, value) for value in (each.known, slope)])
            columns[out] = slopes[out] = 0.0
    theta, covariance = found.mean[:k], found.covariance
    cross = columns.T @ covariance[:k]  # of r with every unknown
    variance = np.einsum('km,mk->m', columns, cross[:, :k])
    current = k + motion.CURRENT
    by_current = cross[:, current] / covariance[current, current]
    half = _half_band(found.force, columns[problem.free_forces])
    variance, cross = variance * half**2, cross * half[:, None]
    of_slope = np.einsum('km,kl,lm->m', slopes, covariance[:k, :k], slopes)
    return ReadOut(
        speed_m_s,
        known[0] + theta @ columns,
        np.sqrt(variance),
        known[1] + theta @ slopes,
        np.sqrt(of_slope),
        by_current,
        cross,
        found,
    )


def _half_band(force: NormalMixture, columns: Float64) -> Float64:
    """
    Return half of the band of 95 % about the mean, over that of a normal distribution of the
    same variance, from speed to speed.

    A mixture with a rare model far away has a large variance, which its band does not show.
    """
    at = np.unique(np.linspace(0, columns.shape[1] - 1, _BAND_AT).astype(int))
    mean, variance = force.through(columns[:, at])
    size = np.sqrt(force.weight @ (variance + mean**2))
    half = _quantile(force.weight, np.abs(mean) / size, np.sqrt(variance) / size)
    return np.interp(np.arange(columns.shape[1]), at, half / _NORMAL)


@compiled
def _quantile(weight: Float64, mean: Float64, sd: Float64) -> Float64:
    """
    Return what 95 % of each mixture (m, v) of variance 1 about 0 is not beyond, in even steps.

    Sought by a usual slope, then by halving.
    """
    m, v = mean.shape
    half, step, at = np.empty(v), _FARTHEST / _STEPS, int(_STEPS * _NORMAL / _FARTHEST)
    for i in range(v):
        low, high, tries = 0, _STEPS, 0
        while high - low > 1:
            at = min(max(at, low + 1), high - 1)
            inside = 0.0
            for j in range(m):
                scale = np.sqrt(2.0) * sd[j, i]
                inside += 0.5 * weight[j] * math.erf((at * step - mean[j, i]) / scale)
                inside += 0.5 * weight[j] * math.erf((at * step + mean[j, i]) / scale)
            low, high = (at, high) if inside < _BAND else (low, at)
            tries += 1
            at += int(np.floor((_BAND - inside) / (_SLOPE * step)))
            if tries > _BY_SLOPE:
                at = (low + high) // 2
        half[i] = (low + 0.5) * step
    return half


def _causes(found: RunPosterior) -> dict[str, list[int]]:
    """Return the unknowns of each cause."""
    problem, k = found.problem, found.problem.coefficients
    logs = problem.rows.of(LOG)
    of_logs, of_ground = (
        sorted({k + motion.own(code) for code in np.unique(problem.rows.kind[kind])})
        for kind in (logs, ~logs)
    )
    of_log = motion.SCALE, motion.OFFSET, motion.LAG
    causes = {
        'n_r': [k + motion.INERTIA],
        'log': [own + each for own in of_logs for each in of_log],
        'ground': [own + motion.GROUND_SCALE for own in of_ground],
    }
    first = problem.of_hull
    for each in problem.influences:
        causes[each.name] = list(range(first, first + len(each.columns)))
        first += len(each.columns)
    causes['law'] = list(range(2, problem.of_hull))
    return causes
