# SPDX-License-Identifier: Apache-2.0
"""
Polynomials in several variables: compiled values, derivatives, raw powers.

Variables are centred and scaled to [-1, 1] inside. Powers of raw degrees or
Reynolds numbers would lose the digits that high degrees need.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import comb

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import Float64

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


@compiled('f8[:, ::1](f8[:, ::1], i8[:, ::1], f8[::1], i8)')
def _evaluate(points: Float64, steps: Powers, coefficients: Float64, slopes: int) -> Float64:
    """
    Evaluate at (d, m) scaled points, and the first `slopes` derivatives.

    Row t of `steps`: the earlier term that term t is a multiple of, and by
    which variable.
    """
    count = points.shape[1]
    terms = len(coefficients)
    result = np.zeros((1 + slopes, count))
    value = np.empty((terms, _BLOCK))
    slope = np.zeros((slopes, terms, _BLOCK))
    # so many points at a time as stay in the fastest memory
    for first in range(0, count, _BLOCK):
        size = min(_BLOCK, count - first)
        z = points[:, first : first + size]
        out = result[:, first : first + size]
        value[0] = 1.0
        for i in range(size):
            out[0, i] = coefficients[0]
        for t in range(1, terms):
            before, by, c = steps[t, 0], steps[t, 1], coefficients[t]
            for i in range(size):
                value[t, i] = value[before, i] * z[by, i]
                out[0, i] += c * value[t, i]
            for j in range(slopes):
                own = 1.0 if j == by else 0.0
                for i in range(size):
                    slope[j, t, i] = slope[j, before, i] * z[by, i] + own * value[before, i]
                    out[1 + j, i] += c * slope[j, t, i]
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
        values: Float64 = self._at(points, 0)[0]
        return values

    def gradient(self, points: Float64) -> Float64:
        """
        Return the derivatives by each variable at (m, d) points; (m, d).
        """
        slopes: Float64 = self._at(points, len(self.centre))[1:].T / self.half
        return slopes

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

    def _at(self, points: Float64, slopes: int) -> Float64:
        scaled = np.ascontiguousarray(((points - self.centre) / self.half).T)
        result: Float64 = _evaluate(scaled, self._steps, self.coefficients, slopes)
        return result

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

    def raw(self) -> Float64:
        """
        Return the matrix from scaled coefficients to those of raw powers.

        Returns
        -------
        (terms, terms)
            Rows in the order of `powers`, now of the variables themselves.

        Notes
        -----
        ((x - c) / h)^p = sum_k binomial(p, k) x^k (-c)^(p - k) / h^p.
        """
        result = np.zeros((len(self.powers), len(self.powers)))
        for column, high in enumerate(self.powers):
            for row, low in enumerate(self.powers):
                if np.all(low <= high):
                    result[row, column] = np.prod(
                        [
                            comb(p, k) * (-c) ** (p - k) / h**p
                            for p, k, c, h in zip(
                                high.tolist(), low.tolist(), self.centre, self.half
                            )
                        ]
                    )
        return result

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
        terms = [
            ' * '.join(
                [repr(float(value))]
                + [f'_z{j}_{power}' for j, power in enumerate(powers) if power > 0]
            )
            for powers, value in zip(self.powers, self.coefficients)
        ]
        lines += ['    return (', *(f'        + {term}' for term in terms), '    )']
        return '\n'.join(lines) + '\n'


def monomials(scaled: Float64, powers: Powers) -> Float64:
    """
    Return the terms, (m, terms), at (m, d) scaled points.
    """
    columns: Float64 = np.prod(scaled[:, None, :] ** powers, axis=2)
    return columns
