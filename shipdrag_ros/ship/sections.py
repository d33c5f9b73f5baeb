# SPDX-License-Identifier: Apache-2.0
"""
Sections of the ship file: water, air, propeller, propulsion, effects, economics, added mass,
and the resistance that the ship is expected to have.

What a key may hold is declared with its field; the merchant polynomial of n_r is `_MERCHANT`,
and the L / V^(1/3) outside of which it is refused stands in `model`. The baseline is that of a
clean hull in calm, deep water without true wind, stated as coefficients or as a table; outside
its tables it refuses to answer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from shipdrag_ros.errors import ShipdragError
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
        if isinstance(model, str) and model in _MODELS:
            return section(_MODELS[model]).read(value, path, problems)
        shown = f'.model: {show(model)}' if isinstance(value, dict) else f': {show(value)}'
        problems.append(f'{path}{shown}, expected model: {expectation}')
        return INVALID

    return Kind(read, f'a model: {expectation}')


def n_r_polynomial(model: AddedMass, slenderness: float) -> Float64:
    """
    Return the coefficients of n_r in the Froude number, lowest power first.

    Notes
    -----
    S1 (2). Written with the Froude number, sqrt(g L) drops out of its b.
    """
    rows = model.coefficients
    found = [sum(c * slenderness**power for power, c in enumerate(row)) for row in rows]
    return np.array(found, np.float64)


NO_CLEAN_HULL = (
    'Fouling cannot be judged without a clean hull: the ship file states no `baseline`. Add one '
    'from model tests, or learn it from runs of the clean hull with `shipdrag baseline`.'
)
"""What is said first of a ship without a baseline."""

# Below this the flow along the hull is laminar and the ITTC line, singular at 100, means
# nothing: C_F is held, so that the resistance falls to 0 with the square of the speed.
REYNOLDS_MIN = 1e5

_KNOWN = declare(
    choice('resistance', 'retardation'),
    'what relative_sd is of; retardation, R / (mass (1 + n_r)), where coastdowns have shown it: '
    'the error of n_r is no part of it',
    default='resistance',
)
_SCATTER = declare(
    number(0.0, 1.0),
    'by how much single runs differ, relative: sd of the resistance from run to run',
    default=0.0,
)


@dataclass(frozen=True)
class CoefficientSd:
    """
    Relative standard deviations of the coefficients.
    """

    friction: float = declare(number(0.0, 1.0), 'of C_V as a whole, C_A included')
    wave: float = declare(number(0.0, 2.0), 'of C_W')
    correlation: float = declare(number(-0.999, 0.999), 'of the two', default=0.0)


@dataclass(frozen=True)
class CoefficientBaseline:
    """
    Resistance from coefficients on the wetted surface.

    Notes
    -----
    R = 0.5 rho S v |v| (C_V + C_W) + still-air drag,
    C_V = (1 + form_factor) C_F + correlation_allowance.
    """

    form_factor: float = declare(number(0.0, 1.0), 'k in (1 + k) C_F')
    correlation_allowance: float = declare(number(-5e-4, 2e-3), 'C_A')
    wave_froude: tuple[float, ...] = declare(
        numbers(0.0, 2.0, ascending=True), 'Froude numbers of the wave coefficients'
    )
    wave_coefficient: tuple[float, ...] = declare(numbers(0.0, 0.1), 'C_W, at each of wave_froude')
    relative_sd: CoefficientSd = declare(section(CoefficientSd), 'how well they are known')
    relative_sd_of: str = _KNOWN
    run_scatter: float = _SCATTER
    source: str = declare(text(), 'where the figures come from', default='')

    def wave(self, froude: Float64) -> Float64:
        """
        Return C_W at Froude numbers >= 0.

        Raises
        ------
        ShipdragError
            Outside the table.
        """
        points, values = self.wave_froude, self.wave_coefficient
        return _inside(points, values, froude, 'baseline.wave_froude', '')

    def viscous(self, reynolds: Float64) -> Float64:
        """
        Return C_V at Reynolds numbers of the length.
        """
        return (1.0 + self.form_factor) * ittc57(reynolds) + self.correlation_allowance


@dataclass(frozen=True)
class TableBaseline:
    """
    Resistance as a table, still-air drag included.
    """

    speed_m_s: tuple[float, ...] = declare(
        numbers(0.0, 40.0, 'm/s', ascending=True), 'speeds through water'
    )
    resistance_n: tuple[float, ...] = declare(
        numbers(0.0, 1e8, 'N'), 'resistance at each of speed_m_s'
    )
    relative_sd: float = declare(number(0.0, 1.0), 'relative standard deviation of the table')
    relative_sd_of: str = _KNOWN
    run_scatter: float = _SCATTER
    source: str = declare(text(), 'where the figures come from', default='')

    def resistance(self, speed: Float64) -> Float64:
        """
        Return the resistance [N] at speeds >= 0 [m/s].

        Raises
        ------
        ShipdragError
            Outside the table.
        """
        return _inside(self.speed_m_s, self.resistance_n, speed, 'baseline.speed_m_s', ' m/s')


Baseline = CoefficientBaseline | TableBaseline


def baseline() -> Kind:
    """
    Expect one of the two forms, known by their keys.
    """

    def read(value: object, path: str, problems: Problems) -> object:
        is_table = isinstance(value, dict) and ('speed_m_s' in value or 'resistance_n' in value)
        form = section(TableBaseline if is_table else CoefficientBaseline)
        return form.read(value, path, problems)

    return Kind(read, 'coefficients or a table')


def ittc57(reynolds: Float64) -> Float64:
    """
    Return the friction coefficient C_F of the ITTC-57 line.

    Notes
    -----
    C_F = 0.075 / (log10 Re - 2)^2, held below `REYNOLDS_MIN`.
    """
    return 0.075 / (np.log10(np.maximum(reynolds, REYNOLDS_MIN)) - 2.0) ** 2


@lru_cache(64)
def _curve(points: tuple[float, ...], values: tuple[float, ...]) -> Any:
    from scipy.interpolate import PchipInterpolator  # slow to import

    return PchipInterpolator(points, values)


def _inside(
    points: tuple[float, ...], values: tuple[float, ...], at: Float64, key: str, unit: str
) -> Float64:
    # the last digit of a Froude number made from a speed may lie outside
    near = np.clip(at, points[0], points[-1])
    outside = ~(np.abs(at - near) <= 1e-12 * points[-1])
    result: Float64 = _curve(tuple(points), tuple(values))(near)  # made in Python: any sequence
    if np.any(outside):
        worst = float(np.asarray(at)[outside].flat[0])
        raise ShipdragError(
            f'{key}: asked for {worst:.4g}{unit}, the table has '
            f'{points[0]:g}..{points[-1]:g}{unit}; add points or stay inside'
        )
    return result
