# SPDX-License-Identifier: Apache-2.0
"""
Polynomial surfaces whose degree the data choose.

S5 raises the degree while the error falls substantially; that is the plateau
of S1 in other words, so its table and its rule serve here too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shipdrag_ros.errors import DataError
from shipdrag_ros.regression.domain import Domain, Prediction
from shipdrag_ros.regression.least_squares import LinearFit, least_squares
from shipdrag_ros.regression.order import OrderTable, rounding
from shipdrag_ros.regression.polynomial import Polynomial, Powers, monomials, terms_up_to
from shipdrag_ros.samples import Float64

LOWEST = 2  # S5 begins here
MAX_DEGREE = 8
_NARROWEST = 1e-30  # coefficients of raw powers go with the powers of its inverse
# Two tests follow the right degree, so chance goes beyond it in 2 of 100 surfaces. S1's order
# search takes more risk of that: there too low costs more than too high.
SIGNIFICANCE = 0.01


@dataclass(frozen=True)
class Surface:
    """
    A fitted surface.

    Attributes
    ----------
    inputs : (d,)
        Names of the variables.
    degree
        Chosen.
    degrees : (m,)
        Tried, one a row of `table`.
    table
        Of all degrees tried.
    polynomial
        The surface itself, in scaled variables.
    fit
        Of its terms.
    domain
        Of the data.
    notes
        What a reader must know, a sentence each.
    """

    inputs: tuple[str, ...]
    degree: int
    degrees: tuple[int, ...]
    table: OrderTable
    polynomial: Polynomial
    fit: LinearFit
    domain: Domain
    notes: tuple[str, ...]

    def summary(self, target: str = 'the value') -> tuple[str, ...]:
        """
        Say what was fitted, and what a reader must know of it.

        Parameters
        ----------
        target
            Name of what was measured.
        """
        from shipdrag_ros.regression import words  # it shows what this module holds

        return (words.sentence(self, target), *self.notes)

    @cached_property
    def coefficients(self) -> Float64:
        """(terms,) Of raw powers of the inputs, in the order of `polynomial.powers`."""
        values: Float64 = self._raw @ self.fit.coefficients
        return values

    @cached_property
    def sd(self) -> Float64:
        """(terms,) Standard deviations of `coefficients`."""
        spread = np.einsum('ij,jk,ik->i', self._raw, self.fit.covariance, self._raw)
        deviations: Float64 = np.sqrt(spread)
        return deviations

    @cached_property
    def _raw(self) -> Float64:
        return self.polynomial.raw()

    def predict(self, points: Float64) -> list[Prediction]:
        """
        Predict at (m, d) points; outside the data with the reason.
        """
        scaled = (points - self.polynomial.centre) / self.polynomial.half
        leverage = self.fit.leverage(monomials(scaled, self.polynomial.powers))
        sd = np.sqrt(self.fit.variance * (1.0 + leverage))
        return [
            Prediction(float(value), float(each), tuple(reasons))
            for value, each, reasons in zip(
                self.polynomial(points), sd, self.domain.reasons(points)
            )
        ]

    def source(self, name: str) -> str:
        """
        Return the surface and its derivatives as plain Python functions.

        They are named NAME and NAME_by_INPUT.
        """
        ranges = ', '.join(
            f'{key} {low:g}..{high:g}' for key, (low, high) in self.domain.ranges.items()
        )
        note = f'Polynomial of degree {self.degree} fitted to {ranges}.'
        functions = [self.polynomial.source(name, self.inputs, note)]
        for number, each in enumerate(self.inputs):
            slope = self.polynomial.derivative(number)
            text = f'Derivative of {name} by {each}.'
            functions.append(slope.source(f'{name}_by_{each}', self.inputs, text))
        return '\n\n'.join(functions)


def _check(points: Float64, inputs: Sequence[str], levels: Sequence[int]) -> None:
    """Refuse points that carry no surface; `levels` counts the values of each variable."""
    problems = [
        f'{name}: {count} different value(s), expected {LOWEST + 1} or more'
        for name, count in zip(inputs, levels)
        if count < LOWEST + 1
    ]
    problems += [
        f'{name}: varies by {extent:g} alone, expected {_NARROWEST:g} or more; use another unit'
        for name, extent in zip(inputs, np.ptp(points, axis=0))
        if 0.0 < extent < _NARROWEST
    ]
    needed = len(terms_up_to(LOWEST, [LOWEST] * len(inputs))) + 1
    if len(points) < needed:
        problems.append(
            f'{len(points)} row(s), expected {needed} or more for degree {LOWEST} in '
            f'{len(inputs)} variable(s)'
        )
    if problems:
        raise DataError('surface', problems)


def fit_surface(
    points: Float64,
    values: Float64,
    *,
    inputs: Sequence[str],
    max_degree: int = MAX_DEGREE,
) -> Surface:
    """
    Fit surfaces of growing degree and choose one.

    Parameters
    ----------
    points : (n, d)
        Where it was measured.
    values : (n,)
        What was measured.
    inputs : (d,)
        Names of the variables.
    max_degree
        Highest degree to try, 2 or more.

    Returns
    -------
    Surface
        Of the lowest degree on the plateau of the residual variance.

    Raises
    ------
    DataError
        If an input does not vary, rows are too few for degree 2, or inputs
        follow from each other.

    Notes
    -----
    S5; RMSE = sqrt(SSE / (n - p)), the s of S1 (11). A variable measured at k
    values carries powers up to k - 1; terms beyond are left out.

    Examples
    --------
    >>> import numpy as np
    >>> from shipdrag_ros.regression import fit_surface
    >>> points = np.random.default_rng(1).uniform(size=(30, 2))
    >>> surface = fit_surface(points, 1.0 + points.prod(axis=1), inputs=['a', 'b'])
    >>> f'{surface.predict(np.array([[0.5, 0.5]]))[0].value:.3f}'
    '1.250'
    """
    levels = [len(np.unique(column)) for column in points.T]
    _check(points, inputs, levels)
    most = [count - 1 for count in levels]
    lower, upper = points.min(axis=0), points.max(axis=0)
    centre, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    scaled = (points - centre) / half
    fits: list[tuple[int, Powers, LinearFit]] = []
    notes = []
    for degree in range(LOWEST, max_degree + 1):
        powers = terms_up_to(degree, most)
        if fits and len(powers) == len(fits[-1][1]):
            notes.append(f'The data carry no terms of degree {degree}: too few different values.')
            break
        if len(powers) >= len(points):
            notes.append(
                f'Degree {degree} has {len(powers)} terms, {len(points)} rows cannot determine it.'
            )
            break
        fit = least_squares(monomials(scaled, powers), values)
        if fit.rank < len(powers):
            notes.append(
                f'The data determine {fit.rank} of the {len(powers)} terms of degree {degree}.'
            )
            break
        fits.append((degree, powers, fit))
    if not fits:
        raise DataError(
            'surface',
            [f'{", ".join(inputs)}: inputs follow from each other. {notes[0]} Leave one out'],
        )
    table = OrderTable.of(
        [len(powers) for _, powers, _ in fits],
        [fit.sse for _, _, fit in fits],
        rows=len(points),
        rounding=rounding(float(values @ values)),
    )
    chosen = table.plateau(significance=SIGNIFICANCE)
    if chosen == len(fits) - 1 and len(fits) > 1:
        notes.append(
            f'The error still falls at degree {fits[-1][0]}, the highest tried: '
            'there may be more in the data.'
        )
    degree, powers, fit = fits[chosen]
    return Surface(
        inputs=tuple(inputs),
        degree=degree,
        degrees=tuple(each for each, _, _ in fits),
        table=table,
        polynomial=Polynomial(powers, fit.coefficients, centre, half),
        fit=fit,
        domain=Domain.of(inputs, points),
        notes=tuple(notes),
    )
