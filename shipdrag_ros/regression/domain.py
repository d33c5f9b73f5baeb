# SPDX-License-Identifier: Apache-2.0
"""
Where a fit may be used: not outside the data.

Inside the range of each variable is not enough: of long ships with much beam
and short ones with little, neither long and narrow nor short and wide are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shipdrag_ros.samples import Float64

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
        least: Float64 = self.points.min(axis=0)
        return least

    @cached_property
    def upper(self) -> Float64:
        """(d,) Largest value of each variable."""
        largest: Float64 = self.points.max(axis=0)
        return largest

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
