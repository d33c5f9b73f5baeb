# SPDX-License-Identifier: Apache-2.0
"""
From a fitted motion to r(v).

r and v are evaluated at the same times and never interpolated. Where the speed
does not fall r(v) has two values: only the branch on which it falls is kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.compiled import compiled
from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.curve import AtEnd
from shipdrag_ros.estimation.result import ResistanceCurve
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship
from shipdrag_ros.studies.orthogonal import OrthogonalBasis, TimeScale

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
        return Motion(*(each[part] for each in vars(self).values()))


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
    return _of_motion(
        motion.speed,
        motion.acceleration,
        motion.jerk,
        motion.acceleration_error,
        motion.jerk_error,
        ship.n_r_polynomial(),
        ship.added_mass.sd,
    )


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


def at_end(motion: Motion, ship: Ship) -> AtEnd:
    """
    Return speed and r at the last time of a motion.
    """
    end = motion[-1:]
    r, r_sigma, _ = specific_resistance(end, ship)
    speed_sigma = sigma(end.speed_error)
    return AtEnd(float(end.speed[0]), float(speed_sigma[0]), float(r[0]), float(r_sigma[0]))
