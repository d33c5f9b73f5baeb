# SPDX-License-Identifier: Apache-2.0
"""
Polynomial surfaces whose degree the data choose.

S5 raises the degree while the error falls substantially; that is the plateau
of S1 in other words, so its table and its rule serve here too. A fit is
not used outside the data; inside the range of each input is not enough: of long ships
with much beam and short ones with little, neither long and narrow nor short and wide are
known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.compiled import compiled
from shipdrag_ros.errors import DataError
from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.least_squares import LinearFit, OrderTable, least_squares, rounding

Powers = NDArray[np.int64]
_BLOCK = 64


def terms_up_to(degree: int, most: Sequence[int]) -> Powers:
    """
    Return the powers of all terms up to a total degree.

    Parameters
    ----------
    degree
        Largest sum of the powers of a term.
    most : (d,)
        Largest power of each variable.

    Returns
    -------
    (terms, d) int64
        By ascending degree: those of a lower degree come first.
    """
    each = [range(min(degree, limit), -1, -1) for limit in most]
    found = [powers for powers in product(*each) if sum(powers) <= degree]
    return np.array(sorted(found, key=sum), np.int64).reshape(-1, len(most))


@compiled('f8[::1](f8[:, ::1], i8[:, ::1], f8[::1])')
def _evaluate(points: Float64, steps: Powers, coefficients: Float64) -> Float64:
    """
    Evaluate at (d, m) scaled points.

    Row t of `steps`: the earlier term that term t is a multiple of, and by
    which variable.
    """
    count = points.shape[1]
    result = np.full(count, coefficients[0])
    value = np.ones((len(coefficients), _BLOCK))
    # so many points at a time as stay in the fastest memory
    for first in range(0, count, _BLOCK):
        size = min(_BLOCK, count - first)
        z, here = points[:, first : first + size], result[first : first + size]
        for t in range(1, len(coefficients)):
            before, by, c = steps[t, 0], steps[t, 1], coefficients[t]
            for i in range(size):
                value[t, i] = value[before, i] * z[by, i]
                here[i] += c * value[t, i]
    return result


@dataclass(frozen=True)
class Polynomial:
    """
    A polynomial in scaled variables z = (x - centre) / half.

    Attributes
    ----------
    powers : (terms, d) int64
        Of the scaled variables, in each term: from `terms_up_to`.
    coefficients : (terms,)
        Of the scaled terms.
    centre, half : (d,)
        Middle and half width of each variable.
    """

    powers: Powers
    coefficients: Float64
    centre: Float64
    half: Float64

    def __call__(self, points: Float64) -> Float64:
        """
        Return the values at (m, d) points.
        """
        scaled = np.ascontiguousarray(((points - self.centre) / self.half).T)
        return _evaluate(scaled, self._steps, self.coefficients)

    def gradient(self, points: Float64) -> Float64:
        """
        Return the derivatives by each variable at (m, d) points; (m, d).
        """
        return np.column_stack([self.derivative(i)(points) for i in range(len(self.centre))])

    def derivative(self, variable: int) -> Polynomial:
        """
        Return the derivative by one variable, a polynomial again.
        """
        has = self.powers[:, variable] > 0
        powers = self.powers[has]
        if not len(powers):
            return replace(self, powers=self.powers[:1], coefficients=np.zeros(1))
        factor = powers[:, variable] / self.half[variable]
        powers[:, variable] -= 1
        return replace(self, powers=powers, coefficients=self.coefficients[has] * factor)

    @cached_property
    def _steps(self) -> Powers:
        """(terms, 2) From which earlier term each follows, and by which variable."""
        place = {tuple(powers): number for number, powers in enumerate(self.powers.tolist())}
        steps = np.zeros((len(self.powers), 2), np.int64)
        for number, powers in enumerate(self.powers):
            by = int(np.argmax(powers > 0))
            if powers[by] > 0:
                before = powers.copy()
                before[by] -= 1
                steps[number] = place[tuple(before.tolist())], by
        return steps

    @cached_property
    def raw(self) -> Float64:
        """
        (terms, terms) From scaled coefficients to those of raw powers, in the order of `powers`.

        Notes
        -----
        ((x - c) / h)^p = sum_k binomial(p, k) x^k (-c)^(p - k) / h^p.
        """
        from scipy.special import comb  # slow to import

        high, low = self.powers[None], self.powers[:, None]
        shift = (-self.centre) ** np.maximum(high - low, 0)
        return np.asarray(np.prod(comb(high, low) * shift / self.half**high, axis=2))

    def source(self, name: str, inputs: Sequence[str], note: str) -> str:
        """
        Return a plain Python function of this polynomial, as text.

        Parameters
        ----------
        name
            Of the function.
        inputs : (d,)
            Names of its arguments, floats or arrays.
        note
            A line for its docstring.

        Notes
        -----
        Powers of each variable are computed once, then summed by terms.
        """
        lines = [f'def {name}({", ".join(inputs)}):', f'    """{note}"""']
        for j, each in enumerate(inputs):
            scaled = f'({each} - {float(self.centre[j])!r}) / {float(self.half[j])!r}'
            lines.append(f'    _z{j}_1 = {scaled}')
            lines += [
                f'    _z{j}_{power} = _z{j}_{power - 1} * _z{j}_1'
                for power in range(2, int(self.powers[:, j].max()) + 1)
            ]
        lines.append('    return (')
        for powers, value in zip(self.powers, self.coefficients):
            factors = [f'_z{j}_{power}' for j, power in enumerate(powers) if power > 0]
            lines.append(f'        + {" * ".join([repr(float(value)), *factors])}')
        return '\n'.join([*lines, '    )\n'])


def monomials(scaled: Float64, powers: Powers) -> Float64:
    """
    Return the terms, (m, terms), at (m, d) scaled points.
    """
    columns: Float64 = np.prod(scaled[:, None, :] ** powers, axis=2)
    return columns


_ROUNDING = 1e-6  # of the range of the data: as near to the hull as this is inside
_SUM_TO_ONE = 1e3  # how strongly weights are held to sum to 1


@dataclass(frozen=True)
class Prediction:
    """
    A value from a fit, and whether the fit may be asked for it.

    Attributes
    ----------
    value
        What the fit says, inside or not.
    sd
        Standard deviation of a new measurement there; infinite where the data
        leave the value open.
    reasons
        Why it may not be used; empty inside.
    """

    value: float
    sd: float
    reasons: tuple[str, ...]

    @classmethod
    def each(
        cls, values: Float64, sds: Float64, reasons: Sequence[Sequence[str]]
    ) -> list[Prediction]:
        """
        Return predictions at several points.
        """
        rows = zip(values.tolist(), sds.tolist(), reasons)
        return [cls(value, sd, tuple(why)) for value, sd, why in rows]

    @property
    def inside(self) -> bool:
        """The fit may be used here."""
        return not self.reasons


@dataclass(frozen=True)
class Domain:
    """
    The hull of the data in some variables.

    Attributes
    ----------
    names : (d,)
        Of the variables.
    points : (n, d)
        The data.
    """

    names: tuple[str, ...]
    points: Float64

    @classmethod
    def of(cls, names: Sequence[str], points: Float64) -> Domain:
        """
        Take the hull of (n, d) data.
        """
        return cls(tuple(names), np.unique(points, axis=0))

    @cached_property
    def lower(self) -> Float64:
        """(d,) Least value of each variable."""
        return np.asarray(self.points.min(axis=0))

    @cached_property
    def upper(self) -> Float64:
        """(d,) Largest value of each variable."""
        return np.asarray(self.points.max(axis=0))

    @property
    def ranges(self) -> dict[str, list[float]]:
        """Least and largest value of each variable by its name."""
        return {
            name: [float(low), float(high)]
            for name, low, high in zip(self.names, self.lower, self.upper)
        }

    def distance(self, points: Float64) -> Float64:
        """
        Return how far points are outside the convex hull; 0 inside.

        Parameters
        ----------
        points : (m, d)

        Returns
        -------
        (m,)
            In ranges of the data.

        Notes
        -----
        A point is inside if it is a mean of data with weights >= 0; the nearest
        such mean is found by non-negative least squares (Lawson and Hanson), in
        any number of variables and where the data lie in a plane.
        """
        from scipy.optimize import nnls  # slow to import

        extent = self.upper - self.lower
        extent = np.where(extent > 0.0, extent, 1.0)
        centre = self.points.mean(axis=0)
        ones = np.full(len(self.points), _SUM_TO_ONE)
        corners = np.vstack([((self.points - centre) / extent).T, ones])
        found = np.array(
            [nnls(corners, [*at, _SUM_TO_ONE])[1] for at in (points - centre) / extent]
        )
        return np.where(found < _ROUNDING, 0.0, found)

    def reasons(self, points: Float64) -> list[list[str]]:
        """
        Say why (m, d) points are outside; an empty list for each inside.
        """
        slack = _ROUNDING * (self.upper - self.lower)
        result = []
        for at, away in zip(points, self.distance(points)):
            outside = [
                f'{name} {value:g} is outside {low:g}..{high:g} of the data'
                for name, value, low, high, near in zip(
                    self.names, at, self.lower, self.upper, slack
                )
                if not low - near <= value <= high + near
            ]
            if away > 0.0 and not outside:
                outside = [
                    f'no data around this combination of {", ".join(self.names)}: outside their '
                    f'convex hull by {away:.2g} of their range'
                ]
            result.append(outside)
        return result


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
        rmse = float(np.sqrt(self.fit.variance))
        sentence = (
            f'{target} is a polynomial of degree {self.degree} in {", ".join(self.inputs)}: '
            f'{len(self.polynomial.powers)} terms, RMSE {rmse:.4g}.'
        )
        return (sentence, *self.notes)

    @cached_property
    def coefficients(self) -> Float64:
        """(terms,) Of raw powers of the inputs, in the order of `polynomial.powers`."""
        return self.polynomial.raw @ self.fit.coefficients

    @cached_property
    def sd(self) -> Float64:
        """(terms,) Standard deviations of `coefficients`."""
        raw = self.polynomial.raw
        return np.asarray(np.sqrt(np.einsum('ij,jk,ik->i', raw, self.fit.covariance, raw)))

    def predict(self, points: Float64) -> list[Prediction]:
        """
        Predict at (m, d) points; outside the data with the reason.
        """
        scaled = (points - self.polynomial.centre) / self.polynomial.half
        leverage = self.fit.leverage(monomials(scaled, self.polynomial.powers))
        sd = np.sqrt(self.fit.variance * (1.0 + leverage))
        return Prediction.each(self.polynomial(points), sd, self.domain.reasons(points))

    def source(self, name: str) -> str:
        """
        Return the surface and its derivatives as plain Python functions.

        They are named NAME and NAME_by_INPUT.
        """
        ranges = ', '.join(
            f'{key} {low:g}..{high:g}' for key, (low, high) in self.domain.ranges.items()
        )
        note = f'Polynomial of degree {self.degree} fitted to {ranges}.'
        slopes = (
            self.polynomial.derivative(number).source(
                f'{name}_by_{each}', self.inputs, f'Derivative of {name} by {each}.'
            )
            for number, each in enumerate(self.inputs)
        )
        return '\n\n'.join([self.polynomial.source(name, self.inputs, note), *slopes])


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
    points: Float64, values: Float64, *, inputs: Sequence[str], max_degree: int = MAX_DEGREE
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
    >>> from shipdrag_ros.studies.surface.fit import fit_surface
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
        why = f'inputs follow from each other. {notes[0]} Leave one out'
        raise DataError('surface', [f'{", ".join(inputs)}: {why}'])
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
    degrees = tuple(each for each, _, _ in fits)
    polynomial = Polynomial(powers, fit.coefficients, centre, half)
    domain = Domain.of(inputs, points)
    return Surface(tuple(inputs), degree, degrees, table, polynomial, fit, domain, tuple(notes))
