# SPDX-License-Identifier: Apache-2.0
"""
Sections of the ship file: water, air, propeller, propulsion, effects, economics, added mass.

What a key may hold is declared with its field; the merchant polynomial of n_r is `_MERCHANT`,
and the L / V^(1/3) outside of which it is refused stands in `consistency`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.fields import (
    INVALID,
    Kind,
    Problems,
    choice,
    declare,
    list_of,
    named,
    number,
    numbers,
    section,
    show,
    text,
)
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.samples import Float64

GRAVITY_M_S2 = 9.81


@dataclass(frozen=True)
class Water:
    """
    Water that the ship sails in; sea water at 15 degrees by default.
    """

    density_kg_m3: float = declare(number(900.0, 1100.0, 'kg/m^3'), 'density', default=1025.0)
    kinematic_viscosity_m2_s: float = declare(
        number(5e-7, 3e-6, 'm^2/s'), 'kinematic viscosity', default=1.19e-6
    )


@dataclass(frozen=True)
class Air:
    """
    Above-water ship, for the air drag along it.
    """

    frontal_area_m2: float = declare(number(1e-3, 1e4, 'm^2'), 'frontal area above water')
    drag_coefficient: float = declare(number(0.05, 2.0), 'drag coefficient on that area')


@dataclass(frozen=True)
class Propeller:
    """
    Propeller, and how it is while coasting.
    """

    diameter_m: float = declare(number(0.01, 15.0, 'm'), 'diameter')
    state_in_baseline: str = declare(
        choice('free', 'locked', 'none'), 'what the baseline contains'
    )


@dataclass(frozen=True)
class Propulsion:
    """
    How thrust and shaft speed decay after the stop: exp(-t / run_down_s).
    """

    run_down_s: float = declare(number(0.0, 600.0, 's'), 'time constant; 0: at once')
    sd: float = declare(number(0.0, 600.0, 's'), 'standard deviation of it', default=0.0)


@dataclass(frozen=True)
class StatedEffect:
    """
    An effect added to the baseline, as a diagnosis writes it.
    """

    name: str = declare(text(), 'which effect')
    parameters: Mapping[str, Parameter] = declare(
        named(section(Parameter, required=('value', 'sd'))), 'its parameters', hashed=False
    )


@dataclass(frozen=True)
class Economics:
    """
    Prices and efficiencies, by which a trend says what fouling costs and when cleaning pays.
    """

    fuel_usd_per_t: float = declare(number(1.0, 1e5, 'USD/t'), 'price of the fuel')
    sfoc_g_per_kwh: float = declare(number(50.0, 1000.0, 'g/kWh'), 'fuel for a brake kWh')
    propulsive_efficiency: float = declare(number(0.05, 1.0), 'effective power over brake power')
    days_at_sea_per_year: float = declare(number(0.0, 366.0, 'd'), 'days under way in a year')
    cleaning_usd: float = declare(
        number(0.0, 1e8, 'USD'), 'price of a cleaning, off-hire included'
    )
    service_speed_m_s: float | None = declare(
        number(0.1, 40.0, 'm/s'), 'speed at which runs are compared', default=None
    )


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
