# SPDX-License-Identifier: Apache-2.0
"""
From a fitted motion to r(v), and to the range in which it may be used.

r and v are evaluated at the same times and never interpolated. Where the speed
does not fall r(v) has two values: only the branch on which it falls is kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.result import FroudeMax, ResistanceCurve
from shipdrag_ros.regression.orthogonal import OrthogonalBasis, TimeScale
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship

SIGNIFICANT = 2.0  # fall or rise of dr/dFr, in its standard deviations
_MIN_POINTS = 3  # fewer are no curve


_RESISTANCE, _SIGMA, _REPEATABLE, _SLOPE, _SLOPE_SIGMA = range(5)  # rows of `_of_motion`


@dataclass(frozen=True)
class Motion:
    """
    Speed, acceleration and its rate at m times.

    The errors are rows of weights on k independent unit errors: the
    covariance of two quantities is the product of their rows.

    Attributes
    ----------
    speed, acceleration, jerk : (m,)
        [m/s], [m/s^2], [m/s^3].
    speed_error, acceleration_error, jerk_error : (m, k)
    """

    speed: Float64
    acceleration: Float64
    jerk: Float64
    speed_error: Float64
    acceleration_error: Float64
    jerk_error: Float64

    def __getitem__(self, part: slice) -> Motion:
        return Motion(
            self.speed[part],
            self.acceleration[part],
            self.jerk[part],
            self.speed_error[part],
            self.acceleration_error[part],
            self.jerk_error[part],
        )


@dataclass(frozen=True)
class PolynomialMotion:
    """
    Position or speed as a polynomial of time.

    Attributes
    ----------
    scale
        Of time.
    basis
        Polynomials; the first k are used.
    coefficients : (k,)
    root : (k, k)
        A root of the covariance of the coefficients: root root'.
    speed_at
        Which derivative of the polynomial is the speed: 0 or 1.
    """

    scale: TimeScale
    basis: OrthogonalBasis
    coefficients: Float64
    root: Float64
    speed_at: int

    def fitted(self, time_ns: Int64, *, derivative: int) -> Float64:
        """
        Return the polynomial, or a derivative in SI units, at (m,) times.
        """
        time = self.scale.normalise(time_ns)
        order = len(self.coefficients)
        rows = self.basis.evaluate(time, derivatives=derivative, order=order)[derivative]
        return _combine(self.coefficients, rows) / self.scale.half_s**derivative

    def motion(self, time: Float64) -> Motion:
        """
        Return the motion at (m,) normalised times.
        """
        first = self.speed_at
        order = len(self.coefficients)
        rows = self.basis.evaluate(time, derivatives=first + 2, order=order)
        values, errors = [], []
        for derivative in range(first, first + 3):
            unit = self.scale.half_s**derivative
            values.append(_combine(self.coefficients, rows[derivative]) / unit)
            errors.append(np.einsum('jm,jk->mk', rows[derivative], self.root) / unit)
        return Motion(*values, *errors)


def _combine(coefficients: Float64, rows: Float64) -> Float64:
    """Sum polynomials, (k,) times (k, m)."""
    result: Float64 = np.einsum('k,km->m', coefficients, rows)
    return result


def sigma(error: Float64) -> Float64:
    """
    Return standard deviations (m,) from rows of weights (m, k).
    """
    result: Float64 = np.sqrt(np.einsum('mk,mk->m', error, error))
    return result


@compiled('f8[:, ::1](f8[:], f8[:], f8[:], f8[:, :], f8[:, :], f8[::1], f8)')
def _of_motion(
    speed: Float64,
    acceleration: Float64,
    jerk: Float64,
    acceleration_error: Float64,
    jerk_error: Float64,
    n_r: Float64,
    n_r_sd: float,
) -> Float64:
    """
    Return r, its sigmas, dr/dv and its sigma, in the order of time.

    With a = dv/dt: dr/dv = -((1 + n_r) da/dt / a + dn_r/dv a); its error is of the motion alone.
    """
    found = np.empty((5, len(speed)))
    for i in range(len(speed)):
        v, a = abs(speed[i]), acceleration[i]
        inertia, by_v = 0.0, 0.0
        for c in n_r[::-1]:
            by_v = inertia + by_v * v
            inertia = c + inertia * v
        inertia += 1.0
        # at rest r has no slope
        per_a = 1.0 / a if a != 0.0 else np.nan
        by_a = by_v - inertia * jerk[i] * per_a * per_a
        of_acceleration = of_slope = 0.0
        for k in range(acceleration_error.shape[1]):
            error = acceleration_error[i, k]
            of_acceleration += error * error
            error = inertia * per_a * jerk_error[i, k] + by_a * error
            of_slope += error * error
        repeatable = inertia * math.sqrt(of_acceleration)
        found[_RESISTANCE, i] = 0.0 - inertia * a  # no negative zero
        found[_SIGMA, i] = math.sqrt(repeatable**2 + (a * n_r_sd) ** 2)
        found[_REPEATABLE, i] = repeatable
        found[_SLOPE, i] = -(inertia * jerk[i] * per_a + by_v * a)
        found[_SLOPE_SIGMA, i] = math.sqrt(of_slope)
    return found


def _resistance(motion: Motion, ship: Ship) -> Float64:
    found: Float64 = _of_motion(
        motion.speed,
        motion.acceleration,
        motion.jerk,
        motion.acceleration_error,
        motion.jerk_error,
        ship.n_r_polynomial(),
        ship.added_mass.sd,
    )
    return found


def specific_resistance(motion: Motion, ship: Ship) -> tuple[Float64, Float64, Float64]:
    """
    Return r, its sigma, and its sigma without the error of n_r.

    Notes
    -----
    S1 (12, 13); the error of n_r is independent of that of the motion.
    """
    found = _resistance(motion, ship)
    return found[_RESISTANCE], found[_SIGMA], found[_REPEATABLE]


def resistance_curve(motion: Motion, ship: Ship, *, froude_min: float) -> ResistanceCurve:
    """
    Return r(v) on the monotone branch of the speed.

    The branch is the longest fall of the speed, in m/s, through consecutive
    times with dv/dt < 0 and Fr >= froude_min.

    Parameters
    ----------
    motion
        At times that ascend, dense enough to show the shape.

    Raises
    ------
    EstimationError
        If there is no such branch.
    """
    froude = ship.froude(motion.speed)
    first, end = _falling(motion.speed, motion.acceleration, froude, froude_min)
    if end - first < _MIN_POINTS:
        low, high = float(motion.speed.min()), float(motion.speed.max())
        raise EstimationError(
            f'the fitted speed, {low:.4g}..{high:.4g} m/s (Fr {ship.froude(low):.3g}..'
            f'{ship.froude(high):.3g}), does not fall steadily above froude_min {froude_min:g}: '
            'give a window that lies in a coastdown, or a smaller froude_min'
        )
    branch = motion[first:end]
    # from the lowest speed to the highest, in fresh arrays
    found = _resistance(branch, ship)[:, ::-1].copy()
    per_froude = float(ship.speed(1.0))
    return ResistanceCurve(
        branch.speed[::-1].copy(),
        found[_RESISTANCE],
        found[_SIGMA],
        found[_REPEATABLE],
        froude[first:end][::-1].copy(),
        per_froude * found[_SLOPE],
        per_froude * found[_SLOPE_SIGMA],
    )


@compiled('UniTuple(i8, 2)(f8[:], f8[:], f8[:], f8)')
def _falling(
    speed: Float64, acceleration: Float64, froude: Float64, froude_min: float
) -> tuple[int, int]:
    """Find the times of the longest fall, first and end."""
    best_first = best_end = first = 0
    longest = -np.inf
    for i in range(len(speed)):
        usable = acceleration[i] < 0.0 and froude[i] >= froude_min
        if not usable:
            first = i + 1
        elif i == first or not speed[i] < speed[i - 1]:
            first = i
        elif speed[first] - speed[i] > longest:
            best_first, best_end = first, i + 1
            longest = speed[first] - speed[i]
    return best_first, best_end


def froude_max(curve: ResistanceCurve) -> tuple[float, FroudeMax]:
    """
    Return the upper end of the valid range, and what gave it.

    Notes
    -----
    S1 takes argmax dr/dFr: above that inflection the curve still carries the
    transient of the start. Over everything that is the transient itself, so:
    the first maximum from which dr/dFr falls, before it rises above it again,
    by more than `SIGNIFICANT` of its standard deviations (of the larger one of
    the two places). Polynomials also wiggle at low speed by more than their
    standard deviation says; a maximum that is exceeded by as much further up
    is such a wiggle. Many hulls have none: then the top of the branch.
    """
    top = _inflection(curve.slope, curve.slope_sigma)
    if top < 0:
        return float(curve.froude[-1]), FroudeMax.BRANCH_TOP
    return float(curve.froude[top]), FroudeMax.INFLECTION


@compiled('i8(f8[:], f8[:])')
def _inflection(slope: Float64, sigma: Float64) -> int:
    """Find the first significant maximum; -1: there is none."""
    for top in range(1, len(slope) - 1):
        if not slope[top - 1] < slope[top] >= slope[top + 1]:
            continue
        falls = exceeded = False
        for i in range(top + 1, len(slope)):
            fall, doubt = slope[top] - slope[i], max(sigma[top], sigma[i])
            if fall < -SIGNIFICANT * doubt:
                falls = False
                break
            exceeded = exceeded or fall < 0.0
            falls = falls or (not exceeded and fall > SIGNIFICANT * doubt)
        if falls:
            return top
    return -1


class ValidRange(NamedTuple):
    """
    Where a curve may be used, and what S1 would say of it, as `Estimate` has it.

    Attributes
    ----------
    froude_valid
        [Fr_min, Fr_max].
    froude_max_by
        Which rule gave Fr_max.
    froude_max_argmax
        argmax dr/dFr over the whole branch.
    max_relative_sigma
        max sigma_r / max r over the range, of the repeatable sigma.
    """

    froude_valid: tuple[float, float]
    froude_max_by: FroudeMax
    froude_max_argmax: float
    max_relative_sigma: float

    @classmethod
    def of_branch(cls, curve: ResistanceCurve) -> ValidRange:
        """
        Return the whole branch.
        """
        return cls._up_to(curve, float(curve.froude[-1]), FroudeMax.BRANCH_TOP)

    @classmethod
    def of_polynomial(cls, curve: ResistanceCurve) -> ValidRange:
        """
        Return the part below the transient of the start, `froude_max`.
        """
        return cls._up_to(curve, *froude_max(curve))

    @classmethod
    def _up_to(cls, curve: ResistanceCurve, top: float, by: FroudeMax) -> ValidRange:
        inside = slice(0, int(np.searchsorted(curve.froude, top, side='right')))
        return cls(
            (float(curve.froude[0]), top),
            by,
            float(curve.froude[np.argmax(curve.slope)]),
            float(curve.sigma_repeatable_m_s2[inside].max() / curve.resistance_m_s2[inside].max()),
        )


class AtEnd(NamedTuple):
    """
    Speed through water [m/s] and r [m/s^2] at the end of a window, with their sigmas.
    """

    last_speed_m_s: float
    last_speed_sigma_m_s: float
    last_resistance_m_s2: float
    last_sigma_m_s2: float

    @classmethod
    def of(cls, motion: Motion, ship: Ship) -> AtEnd:
        """
        Return those of the last time of a motion.
        """
        end = motion[-1:]
        r, r_sigma, _ = specific_resistance(end, ship)
        speed_sigma = sigma(end.speed_error)
        return cls(float(end.speed[0]), float(speed_sigma[0]), float(r[0]), float(r_sigma[0]))
