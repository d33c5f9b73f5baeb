# SPDX-License-Identifier: Apache-2.0
"""
Hulls as the ratios that a regression knows them by.

Length, breadth, draught, volume and block coefficient are tied to each other:
slenderness^3 = (L/B)^2 (B/T) / C_B. Whoever varies one of the ratios moves another.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.errors import DataError
from shipdrag_ros.samples import Float64

REQUIRED = ('L_B', 'B_T', 'Fr')
OPTIONAL = ('C_B', 'slenderness', 'lcb')
# beyond what the digits of ratios in print explain
_CONTRADICTION = 0.02


@dataclass(frozen=True)
class Hulls:
    """
    Hulls at speeds, one a row.

    Attributes
    ----------
    L_B, B_T, C_B : (n,)
        Length to breadth, breadth to draught, block coefficient.
    slenderness : (n,)
        L / V^(1/3).
    Fr : (n,)
        v / sqrt(g L).
    lcb : (n,) or None
        Centre of buoyancy along the ship over L; None where not known.
    """

    L_B: Float64
    B_T: Float64
    C_B: Float64
    slenderness: Float64
    Fr: Float64
    lcb: Float64 | None

    @classmethod
    def of(cls, subject: str, names: tuple[str, ...], values: Float64) -> Hulls:
        """
        Take columns; C_B or slenderness follows from the others.

        Parameters
        ----------
        subject
            What the columns are from, for errors.
        names : (k,)
            Some of `REQUIRED` and `OPTIONAL`.
        values : (n, k)

        Raises
        ------
        DataError
            If both C_B and slenderness are missing, or a ratio is not above 0.
        """
        columns = dict(zip(names, values.T))
        problems = []
        for name in ('L_B', 'B_T', 'C_B', 'slenderness', 'Fr'):
            bad = np.flatnonzero(columns.get(name, np.ones(1)) <= 0.0)
            if len(bad):
                problems.append(
                    f'{name}: {columns[name][bad[0]]:g} in row {bad[0] + 1}, expected above 0; '
                    f'{len(bad)} such row(s)'
                )
        if 'C_B' not in columns and 'slenderness' not in columns:
            problems.append('neither C_B nor slenderness; give one, the other follows')
        if problems:
            raise DataError(subject, problems)
        product = columns['L_B'] ** 2 * columns['B_T']
        slenderness = columns.get('slenderness')
        block = columns.get('C_B')
        if slenderness is None:
            slenderness = np.cbrt(product / columns['C_B'])
        if block is None:
            block = product / slenderness**3
        return cls(
            L_B=columns['L_B'],
            B_T=columns['B_T'],
            C_B=block,
            slenderness=slenderness,
            Fr=columns['Fr'],
            lcb=columns.get('lcb'),
        )

    def __len__(self) -> int:
        return len(self.Fr)

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Hulls:
        """
        Return some of the rows.
        """
        return Hulls(
            L_B=self.L_B[rows],
            B_T=self.B_T[rows],
            C_B=self.C_B[rows],
            slenderness=self.slenderness[rows],
            Fr=self.Fr[rows],
            lcb=None if self.lcb is None else self.lcb[rows],
        )

    def at(self, froude: Float64) -> Hulls:
        """
        Return the first hull at other Froude numbers.
        """
        first = self.take(np.zeros(len(froude), np.intp))
        return replace(first, Fr=froude)

    @property
    def contradictions(self) -> int:
        """How many rows state a C_B and a slenderness that cannot both be."""
        follows = np.cbrt(self.L_B**2 * self.B_T / self.C_B)
        return int(np.sum(np.abs(self.slenderness / follows - 1.0) > _CONTRADICTION))

    def groups(self) -> NDArray[np.intp]:
        """
        Return the number of the hull that each row belongs to, from 0.
        """
        shapes = [self.L_B, self.B_T, self.C_B, *(() if self.lcb is None else (self.lcb,))]
        _, number = np.unique(np.column_stack(shapes), axis=0, return_inverse=True)
        found: NDArray[np.intp] = number.reshape(-1)
        return found

    def longer(self, factor: float) -> Hulls:
        """
        Multiply L/B at the same B/T, C_B and Fr.
        """
        return replace(
            self, L_B=self.L_B * factor, slenderness=self.slenderness * factor ** (2.0 / 3.0)
        )

    def flatter(self, factor: float) -> Hulls:
        """
        Multiply B/T at the same slenderness, C_B and Fr.
        """
        return replace(self, B_T=self.B_T * factor, L_B=self.L_B * factor**-0.5)

    def faster(self, factor: float) -> Hulls:
        """
        Multiply Fr.
        """
        return replace(self, Fr=self.Fr * factor)
