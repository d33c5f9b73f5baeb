# SPDX-License-Identifier: Apache-2.0
"""
From samples to r(v), by polynomials that are orthogonal on the actual sample times.

Ideal conditioning and nested orders: a coefficient does not change when the
order grows. Derivatives follow by differentiating the recurrence, so a fit of
position gives speed and acceleration at any time.

r and v are evaluated at the same times and never interpolated. Where the speed
does not fall r(v) has two values: only the branch on which it falls is kept.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.result import AtEnd, ResistanceCurve
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.ship import Ship
from shipdrag_ros.studies.least_squares import OrderTable, rounding

ORTHOGONALITY_LOST = 1e-13  # |cos| of two columns above which one is orthogonalised again
_VANISHED = 1e-12  # beside the terms that a column is the difference of: rounding


@dataclass(frozen=True)
class TimeScale:
    """
    Normalised time on [-1, 1].

    Attributes
    ----------
    first_ns, span_ns
        Start and length of the interval [ns].

    Notes
    -----
    S1: t = (t* - t*_1 - S_c) / S_c. Nanoseconds are subtracted as integers:
    epoch seconds in floating point are good to 0.2 us only.
    """

    first_ns: int
    span_ns: int

    @classmethod
    def of(cls, *time_ns: Int64) -> TimeScale:
        """
        Span all the times given; none of the arrays may be empty.

        Raises
        ------
        ValueError
            If they are all the same.
        """
        first = min(int(times.min()) for times in time_ns)
        span = max(int(times.max()) for times in time_ns) - first
        if span == 0:
            raise ValueError(f'all times are {first} ns, expected different ones')
        return cls(first, span)

    @property
    def half_s(self) -> float:
        """S_c [s]: seconds for one unit of normalised time."""
        return self.span_ns * 0.5e-9

    def normalise(self, time_ns: Int64) -> Float64:
        """
        Return normalised times; -1 and 1 at the ends, exactly.
        """
        return (2 * (time_ns - self.first_ns) - self.span_ns) / self.span_ns


@dataclass(frozen=True)
class OrthogonalBasis:
    """
    Polynomials h_0 .. h_{order-1}, orthogonal on given times.

    Attributes
    ----------
    columns : (order, n)
        h_j at the sample times.
    squared_norm : (order,)
        sum h_j^2.
    alpha, beta : (order,)
        Of the step from h_j to h_{j+1}; the last is not used.
    correction : (order, order)
        Row j: what a second orthogonalisation took from h_j, in h_0 .. h_{j-1}.
    reorthogonalised
        How many columns needed it.

    Notes
    -----
    Forsythe's recurrence on [-1, 1] as Hayes uses it (S1; Seber, Linear
    Regression Analysis): h_0 = 1, h_{j+1} = (t - alpha_j) h_j - beta_j h_{j-1},
    alpha_j = sum t h_j^2 / sum h_j^2, beta_j = sum h_j^2 / sum h_{j-1}^2.
    Sums are numpy's own, pairwise, not those of BLAS, which depend on the
    number of threads in the last bit.
    """

    columns: Float64
    squared_norm: Float64
    alpha: Float64
    beta: Float64
    correction: Float64
    reorthogonalised: int

    @classmethod
    def on(cls, time: Float64, order: int) -> OrthogonalBasis:
        """
        Build up to `order` polynomials on the times given.

        Fewer distinct times than `order` carry fewer polynomials: read the
        `order` of the result.

        Parameters
        ----------
        time : (n,)
            Normalised times in [-1, 1], in any order, repeats allowed.
        order
            How many polynomials, at least 1.

        Returns
        -------
        OrthogonalBasis
            Of polynomials that are orthogonal on the times.

        Raises
        ------
        ValueError
            If there is no time, or `order` < 1.

        Notes
        -----
        Source: S1, after Forsythe (1957), J. SIAM 5, 74-88: a three-term recurrence,
        orthogonalised once more where digits were lost.

        Examples
        --------
        >>> import numpy as np
        >>> from shipdrag_ros.studies.s1.motion import OrthogonalBasis
        >>> time = np.linspace(-1.0, 1.0, 50)
        >>> basis = OrthogonalBasis.on(time, 3)
        >>> coefficients, _ = basis.fit(time**2)
        >>> basis.order, f'{coefficients[2]:.3f}'
        (3, '1.000')
        """
        if order < 1 or len(time) == 0:
            raise ValueError(f'{order} polynomials on {len(time)} times, expected 1 or more each')
        order = min(order, len(np.unique(time)))
        columns = np.empty((order, len(time)))
        squared_norm = np.empty(order)
        alpha, beta = np.zeros(order), np.zeros(order)
        correction = np.zeros((order, order))
        reorthogonalised = 0
        columns[0] = 1.0
        square = columns[0]  # h_j^2
        squared_norm[0] = len(time)
        done = 1
        while done < order:
            j = done - 1
            h, before, norms = columns[j], columns[:done], squared_norm[:done]
            alpha[j] = (square * time).sum() / norms[j]
            new = (time - alpha[j]) * h
            if j > 0:
                beta[j] = norms[j] / norms[j - 1]
                new -= beta[j] * columns[j - 1]
            overlap = np.einsum('ij,j->i', before, new) / norms
            square = new * new
            new_norm = square.sum()
            # cosines, written without a division by a norm that may be 0
            if (overlap * overlap * norms).max() > ORTHOGONALITY_LOST**2 * new_norm:
                new -= np.einsum('i,ij->j', overlap, before)
                square = new * new
                new_norm = square.sum()
                correction[done, :done] = overlap
                reorthogonalised += 1
            # |(t - alpha) h_j|^2 = |h_{j+1}|^2 + beta |h_j|^2
            if new_norm <= _VANISHED**2 * (new_norm + beta[j] * norms[j]):
                break
            columns[done] = new
            squared_norm[done] = new_norm
            done += 1
        return cls(
            columns[:done],
            squared_norm[:done],
            alpha[:done],
            beta[:done],
            correction[:done, :done],
            reorthogonalised,
        )

    @property
    def order(self) -> int:
        """How many polynomials."""
        return len(self.columns)

    def evaluate(self, time: Float64, *, derivatives: int, order: int | None = None) -> Float64:
        """
        Evaluate polynomials and their derivatives at any times.

        Parameters
        ----------
        time : (m,)
            Normalised times.
        derivatives
            Highest derivative wanted, 0 for the values alone.
        order
            How many polynomials; all where not given.

        Returns
        -------
        (derivatives + 1, order, m)
            d^i h_j / dt^i at [i, j].
        """
        order = self.order if order is None else order
        result = np.zeros((derivatives + 1, order, len(time)))
        result[0, 0] = 1.0
        # (t h)^(i) = t h^(i) + i h^(i-1)
        power = np.arange(1.0, derivatives + 1.0)[:, None]
        for j in range(order - 1):
            new = result[:, j + 1]
            new[:] = (time - self.alpha[j]) * result[:, j]
            new[1:] += power * result[:-1, j]
            if j > 0:
                new -= self.beta[j] * result[:, j - 1]
            if self.correction[j + 1].any():
                new -= np.einsum('i,dij->dj', self.correction[j + 1, : j + 1], result[:, : j + 1])
        return result

    def fit(self, values: Float64) -> tuple[Float64, Float64]:
        """
        Fit by least squares at every order at once.

        Parameters
        ----------
        values : (n,)
            Measured at the sample times.

        Returns
        -------
        coefficients : (order,)
            The first k of them are the fit of order k.
        sse : (order,)
            Sum of squared residuals of orders 1, 2, ..

        Notes
        -----
        S1 (9). The residual is carried from order to order: z.z - sum p^2 |h|^2
        would lose the digits of an offset.
        """
        residual = values.copy()
        coefficients, sse = np.empty(self.order), np.empty(self.order)
        for j, column in enumerate(self.columns):
            p = (column * residual).sum() / self.squared_norm[j]
            residual -= p * column
            coefficients[j] = p
            sse[j] = (residual * residual).sum()
        return coefficients, sse


def fit_orders(basis: OrthogonalBasis, values: Float64) -> tuple[Float64, OrderTable]:
    """
    Fit at every order that leaves a degree of freedom.

    Parameters
    ----------
    basis
        Polynomials on n times with equal weights.
    values : (n,)
        Measured at these times; n >= 2.

    Returns
    -------
    coefficients : (order,)
        The first k of them are the fit of order k.
    table
        Of orders 1, 2, ..
    """
    coefficients, sse = basis.fit(values)
    orders = np.arange(1, min(basis.order, len(values) - 1) + 1)
    table = OrderTable.of(
        orders, sse[: len(orders)], rows=len(values), rounding=rounding((values * values).sum())
    )
    return coefficients, table


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
        fitted: Float64 = np.einsum('k,km->m', self.coefficients, rows)
        return fitted / self.scale.half_s**derivative

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
            values.append(np.einsum('k,km->m', self.coefficients, rows[derivative]) / unit)
            errors.append(np.einsum('jm,jk->mk', rows[derivative], self.root) / unit)
        return Motion(*values, *errors)


def sigma(error: Float64) -> Float64:
    """
    Return standard deviations (m,) from rows of weights (m, k).
    """
    result: Float64 = np.sqrt(np.einsum('mk,mk->m', error, error))
    return result


def _resistance(motion: Motion, ship: Ship) -> ResistanceCurve:
    """Return r and its slope at the times of a motion: S1 (12, 13)."""
    # the error of n_r is independent of that of the motion; with a = dv/dt the slope is
    # dr/dv = -((1 + n_r) da/dt / a + dn_r/dv a), its error of the motion alone
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
        np.zeros_like(speed),
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
    if len(longest) < 3:  # no curve
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
