# SPDX-License-Identifier: Apache-2.0
"""The published forms of the residual-resistance coefficient, as columns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.residual.hulls import Hulls


@dataclass(frozen=True)
class RegressionForm:
    """
    A regression that is linear in its coefficients.

    Attributes
    ----------
    name
        Of the form.
    columns
        From n hulls to (n, p), one column a coefficient b0, b1, ..
    terms
        What each column is; psi is the slenderness L / V^(1/3).
    variables
        Ratios of `Hulls` that separate its hulls, Fr included.
    froude_max
        What its author made it for.
    """

    name: str
    columns: Callable[[Hulls], Float64]
    terms: tuple[str, ...]
    variables: tuple[str, ...]
    froude_max: float = float('inf')

    @property
    def needs_lcb(self) -> bool:
        """It cannot be used without the centre of buoyancy."""
        return 'lcb' in self.variables

    def place(self, hulls: Hulls) -> Float64:
        """
        Return (n, d) values of `variables`.
        """
        return np.column_stack([getattr(hulls, name) for name in self.variables])


def _sakhnovsky(hulls: Hulls) -> Float64:
    assert hulls.lcb is not None  # checked where the form is chosen
    x1, x2, x3 = hulls.L_B, hulls.B_T, hulls.C_B
    x4, x5, x6 = hulls.Fr, hulls.lcb, hulls.slenderness
    terms = (
        np.ones_like(x1),
        x1,
        x2 * x3,
        x3,
        x4,
        x5,
        x1**2,
        (x2 * x3 * x5) ** 2,
        (x3 * x6) ** 2,
        x4**2,
        x5**2,
        x6,
        x6**2,
        x3 * x4,
        (x2 * x6) ** 2,
    )
    return np.column_stack(terms)


def _sirotina(hulls: Hulls) -> Float64:
    x1 = hulls.Fr * np.sqrt(hulls.slenderness)  # Fr_V = v / sqrt(g V^(1/3))
    x2 = hulls.L_B - 7.88
    x3 = 2.0 * (hulls.B_T - 4.21)
    x4 = 10.0 * (hulls.C_B - 0.819)
    terms = (
        np.ones_like(x1),
        x1,
        x2,
        x3,
        x4,
        x1**2,
        x1 * x2,
        x1 * x3,
        x1 * x4,
        x2**2,
        x2 * x3,
        x2 * x4,
        x3**2,
        x3 * x4,
        x4**2,
    )
    return np.column_stack(terms)


_SAKHNOVSKY_TERMS = (
    *('1', 'L/B', '(B/T) C_B', 'C_B', 'Fr', 'lcb', '(L/B)²', '((B/T) C_B lcb)²', '(C_B psi)²'),
    *('Fr²', 'lcb²', 'psi', 'psi²', 'C_B Fr', '((B/T) psi)²'),
)
# Fr_V = v / sqrt(g V^(1/3)); the others about the middle of the series
_SIROTINA = ('Fr_V', '(L/B - 7.88)', '(2 B/T - 8.42)', '(10 C_B - 8.19)')
_SIROTINA_TERMS = (
    '1',
    *_SIROTINA,
    *(
        f'{one}²' if one == other else f'{one} {other}'
        for i, one in enumerate(_SIROTINA)
        for other in _SIROTINA[i:]
    ),
)

# S4 (1) and (2)
SAKHNOVSKY = RegressionForm(
    'sakhnovsky',
    _sakhnovsky,
    _SAKHNOVSKY_TERMS,
    ('L_B', 'B_T', 'C_B', 'lcb', 'Fr'),
    froude_max=0.14,
)
SIROTINA = RegressionForm('sirotina', _sirotina, _SIROTINA_TERMS, ('L_B', 'B_T', 'C_B', 'Fr'))
FORMS = {form.name: form for form in (SAKHNOVSKY, SIROTINA)}
