# SPDX-License-Identifier: Apache-2.0
"""
Polynomials orthogonal on the actual sample times.

Ideal conditioning and nested orders: a coefficient does not change when the
order grows. Derivatives follow by differentiating the recurrence, so a fit of
position gives speed and acceleration at any time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.samples import Float64, Int64

# |cos| between two columns above which a column is orthogonalised a second time
ORTHOGONALITY_LOST = 1e-13
# a column this small beside the terms it is the difference of is rounding, not a polynomial
_VANISHED = 1e-12


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
        >>> from shipdrag_ros.studies.orthogonal import OrthogonalBasis
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
