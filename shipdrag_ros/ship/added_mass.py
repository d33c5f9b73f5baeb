# SPDX-License-Identifier: Apache-2.0
"""Unsteady-motion correction n_r: the surge added mass over the ship's mass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.fields import (
    INVALID,
    Kind,
    Problems,
    choice,
    declare,
    list_of,
    number,
    numbers,
    section,
    show,
)
from shipdrag_ros.samples import Float64

# rows: powers of the Froude number; columns: powers of L / V^(1/3)
_MERCHANT = (
    (0.2017, -0.0321, 0.0010),
    (-0.4871, 0.1193, -0.0034),
    (5.9608, -1.3184, 0.0679),
)
_SD = declare(number(0.0, 1.0), 'standard deviation of n_r itself', default=0.02)


@dataclass(frozen=True, kw_only=True)
class MerchantAddedMass:
    """
    The published polynomial for merchant-type sea-going ships.
    """

    model: str = declare(choice('merchant'), 'how n_r is found', default='merchant')
    sd: float = _SD

    @property
    def coefficients(self) -> tuple[tuple[float, ...], ...]:
        """Rows: powers of Fr; columns: powers of L / V^(1/3)."""
        return _MERCHANT


@dataclass(frozen=True, kw_only=True)
class ConstantAddedMass:
    """
    The same n_r at every speed.
    """

    model: str = declare(choice('constant'), 'how n_r is found', default='constant')
    value: float = declare(number(1e-3, 2.0), 'n_r')
    sd: float = _SD

    @property
    def coefficients(self) -> tuple[tuple[float, ...], ...]:
        """Rows: powers of Fr; columns: powers of L / V^(1/3)."""
        return ((self.value,),)


@dataclass(frozen=True, kw_only=True)
class TableAddedMass:
    """
    A polynomial of the ship's own, of any degree.
    """

    model: str = declare(choice('table'), 'how n_r is found', default='table')
    coefficients: tuple[tuple[float, ...], ...] = declare(
        list_of(numbers(-1e4, 1e4, minimum=1), minimum=1),
        'rows: powers of Fr; columns: powers of L / V^(1/3)',
    )
    sd: float = _SD


AddedMass = MerchantAddedMass | ConstantAddedMass | TableAddedMass
_MODELS = {'merchant': MerchantAddedMass, 'constant': ConstantAddedMass, 'table': TableAddedMass}


def added_mass() -> Kind:
    """
    Expect one of the models, known by the key `model`.
    """
    expectation = 'merchant, constant or table'

    def read(value: object, path: str, problems: Problems) -> object:
        model = value.get('model') if isinstance(value, dict) else None
        if not isinstance(model, str) or model not in _MODELS:
            shown = f'.model: {show(model)}' if isinstance(value, dict) else f': {show(value)}'
            problems.append(f'{path}{shown}, expected model: {expectation}')
            return INVALID
        return section(_MODELS[model]).read(value, path, problems)

    return Kind(read, f'a model: {expectation}')


def n_r_polynomial(model: AddedMass, slenderness: float) -> Float64:
    """
    Return the coefficients of n_r in the Froude number, lowest power first.

    Notes
    -----
    S1 (2). Written with the Froude number, sqrt(g L) drops out of its b.
    """
    return np.array(
        [sum(c * slenderness**power for power, c in enumerate(row)) for row in model.coefficients],
        np.float64,
    )
