# SPDX-License-Identifier: Apache-2.0
"""A fitted motion: speed and its derivatives at any time, with their errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.regression.orthogonal import OrthogonalBasis, TimeScale
from shipdrag_ros.samples import Float64, Int64


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
