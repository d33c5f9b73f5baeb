# SPDX-License-Identifier: Apache-2.0
"""
How residual resistance must run, whatever the data.

A polynomial may fit every hull and still say that a longer ship of the same
fullness meets more resistance. These are the trends that are held against it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from shipdrag_ros.studies.residual.hulls import Hulls

_HUMP = 0.3  # Froude number of the first hump that a hollow follows


@dataclass(frozen=True)
class Expectation:
    """
    A trend that physics gives.

    Attributes
    ----------
    text
        What is expected, to be stated where it is not met.
    move
        Multiplies a ratio of hulls, the ratios tied to it along.
    sign
        +1 where resistance rises with the ratio, -1 where it falls.
    froude_max
        Beyond this nothing is expected.

    Notes
    -----
    After Guldhammer and Harvald, Ship Resistance (1974): their diagrams of C_R
    rise with Fr up to the first hump and fall with L / V^(1/3) throughout, and
    10^3 C_R rises by 0.16 for each unit of B/T at the same L / V^(1/3).
    """

    text: str
    move: Callable[[Hulls, float], Hulls]
    sign: int
    froude_max: float = float('inf')


EXPECTATIONS = (
    Expectation(f'rises with Fr below {_HUMP:g}', Hulls.faster, 1, _HUMP),
    Expectation('falls with L/B at the same B/T and C_B', Hulls.longer, -1),
    Expectation('rises with B/T at the same slenderness and C_B', Hulls.flatter, 1),
)
