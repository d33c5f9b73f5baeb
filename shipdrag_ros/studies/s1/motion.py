# SPDX-License-Identifier: Apache-2.0
"""
From a fitted motion to r(v).

r and v are evaluated at the same times and never interpolated. Where the speed
does not fall r(v) has two values: only the branch on which it falls is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.curve import AtEnd
from shipdrag_ros.estimation.result import ResistanceCurve
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship
from shipdrag_ros.studies.orthogonal import OrthogonalBasis, TimeScale

_MIN_POINTS = 3  # fewer are no curve


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

    def __getitem__(self, part: slice | NDArray[np.intp]) -> Motion:
        return Motion(*(np.ascontiguousarray(each[part]) for each in vars(self).values()))


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


def _resistance(motion: Motion, ship: Ship) -> ResistanceCurve:
    """
    Return r and its slope at the times of a motion.

    Notes
    -----
    S1 (12, 13); the error of n_r is independent of that of the motion. With a = dv/dt:
    dr/dv = -((1 + n_r) da/dt / a + dn_r/dv a); its error is of the motion alone.
    """
    speed, a, jerk = motion.speed, motion.acceleration, motion.jerk
    n_r = np.polynomial.Polynomial(ship.n_r_polynomial())
    inertia, by_v = 1.0 + n_r(np.abs(speed)), n_r.deriv()(np.abs(speed))
    per_a = 1.0 / np.where(a == 0.0, np.nan, a)  # at rest r has no slope
    by_a = by_v - inertia * jerk * per_a**2
    by_jerk = inertia * per_a
    slope_error = by_jerk[:, None] * motion.jerk_error + by_a[:, None] * motion.acceleration_error
    repeatable = inertia * sigma(motion.acceleration_error)
    per_froude = float(ship.speed(1.0))
    return ResistanceCurve(
        speed,
        0.0 - inertia * a,  # no negative zero
        np.hypot(repeatable, a * ship.added_mass.sd),
        repeatable,
        ship.froude(speed),
        -per_froude * (by_jerk * jerk + by_v * a),
        per_froude * sigma(slope_error),
    )


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
    speed, froude = motion.speed, ship.froude(motion.speed)
    usable = (motion.acceleration < 0.0) & (froude >= froude_min)
    goes_on = usable[1:] & usable[:-1] & (np.diff(speed) < 0.0)
    falls = np.split(np.arange(len(speed)), np.flatnonzero(~goes_on) + 1)
    longest = max(falls, key=lambda times: speed[times[0]] - speed[times[-1]])
    if len(longest) < _MIN_POINTS:
        low, high = float(speed.min()), float(speed.max())
        raise EstimationError(
            f'the fitted speed, {low:.4g}..{high:.4g} m/s (Fr {ship.froude(low):.3g}..'
            f'{ship.froude(high):.3g}), does not fall steadily above froude_min {froude_min:g}: '
            'give a window that lies in a coastdown, or a smaller froude_min'
        )
    # from the lowest speed to the highest
    return _resistance(motion[longest[::-1]], ship)


def at_end(motion: Motion, ship: Ship) -> AtEnd:
    """
    Return speed and r at the last time of a motion.
    """
    end = motion[-1:]
    r = _resistance(end, ship)
    each = (end.speed, sigma(end.speed_error), r.resistance_m_s2, r.sigma_m_s2)
    return AtEnd(*(float(one[0]) for one in each))
